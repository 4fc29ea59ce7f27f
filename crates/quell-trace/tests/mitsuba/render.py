#!/usr/bin/env python3
"""Renders two scenes with Mitsuba 3, for the z-test of quell's path tracer (tests/main/mitsuba.rs).

    pip install mitsuba==3.9.1 numpy       # Mitsuba loads libLLVM: 19 works, 14 and 15 lack an instruction; if it
                                           # finds another first, name the file in DRJIT_LIBLLVM_PATH
    python3 render.py                      # both scenes, a few minutes on two cores
    python3 render.py metal-corner --samples 256 --out /tmp/preview

Nothing here is shared with quell's code: the scenes are written down a second time, and the BRDF is written from its
equations. Whoever changes a scene in Rust changes it here and renders it again.

For each scene there are two pictures in Portable Float Map format (linear RGB, little endian, rows from the bottom to
the top), `NAME.mean.pfm` and `NAME.variance.pfm`: the mean of all samples of a pixel, and the variance of that mean
estimated from the spread of the samples, which are independent. `NAME.json` tells how they were made.

Conventions of quell that are followed here:
- every sample of a pixel goes through the pixel's centre: quell's frames are sampled there;
- light is scattered at most `bounces` + 1 times between source and eye, which Mitsuba calls depth `bounces` + 2, and no
  roulette ends a path early;
- lamps shine on their front side only (edge_u x edge_v), and surfaces reflect on both sides.
"""

import argparse
import json
import pathlib
import time

import numpy as np

import mitsuba as mi

mi.set_variant("llvm_ad_rgb")
import drjit as dr  # noqa: E402  (the variant has to be chosen first)

WIDTH, HEIGHT = 24, 18

# Paths of one kernel launch: keeps memory under 1 GiB.
PATHS_PER_LAUNCH = 1 << 19


class FactoredBrdf(mi.BSDF):
    """f = base_color (1 - metallic) / pi (1 - F)^2 + g F, on both sides of the surface.

    F: Schlick (1994) at the angle between half vector and viewer, F0 = lerp(0.04, base_color, metallic).
    g = D G2 / (4 cos_i cos_o): D of GGX (Walter et al. 2007, eq. 33) with alpha = roughness^2, G2 height-correlated
    (Heitz 2014, eq. 99: 1 / (1 + Lambda_i + Lambda_o), Lambda of GGX from eq. 72).
    """

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        base_color = [props[channel] for channel in "rgb"]
        metallic, roughness = props["metallic"], props["roughness"]
        self.matte = mi.Color3f([c * (1 - metallic) / np.pi for c in base_color])
        self.f0 = mi.Color3f([0.04 + (c - 0.04) * metallic for c in base_color])
        self.alpha = mi.Float(roughness**2)
        # Only how directions are drawn depends on these two; the picture does not.
        self.matte_share = mi.Float(0.0 if metallic == 1 else 0.7)
        self.normals = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, roughness**2, True)
        sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.GlossyReflection | sides]
        self.m_flags = self.m_components[0]

    def lambda_(self, cos):
        tan2 = (1 - cos * cos) / (cos * cos)
        return (dr.sqrt(1 + self.alpha * self.alpha * tan2) - 1) / 2

    def brdf_times_cos(self, wi, wo):
        """Both directions are above the surface."""
        h = dr.normalize(wi + wo)
        fresnel = self.f0 + (1 - self.f0) * dr.power(dr.clip(1 - dr.dot(wi, h), 0, 1), 5)
        alpha2 = self.alpha * self.alpha
        cos2 = h.z * h.z
        tan2 = (h.x * h.x + h.y * h.y) / cos2
        d = alpha2 / (dr.pi * cos2 * cos2 * dr.square(alpha2 + tan2))
        g2 = 1 / (1 + self.lambda_(wi.z) + self.lambda_(wo.z))
        glossy = d * g2 / (4 * wi.z * wo.z)
        return (self.matte * dr.square(1 - fresnel) + fresnel * glossy) * wo.z

    def density(self, wi, wo):
        h = dr.normalize(wi + wo)
        glossy = self.normals.pdf(wi, h) / (4 * dr.dot(wi, h))
        return self.matte_share * wo.z / dr.pi + (1 - self.matte_share) * glossy

    @staticmethod
    def upwards(wi, wo):
        """The two directions as seen from the viewer's side."""
        side = dr.select(wi.z < 0, mi.Float(-1), mi.Float(1))
        return mi.Vector3f(wi.x, wi.y, wi.z * side), mi.Vector3f(wo.x, wo.y, wo.z * side), side

    def sample(self, ctx, si, sample1, sample2, active=True):
        wi, _, side = self.upwards(si.wi, si.wi)
        h, _ = self.normals.sample(wi, sample2)
        glossy = 2 * dr.dot(wi, h) * h - wi
        wo = dr.select(sample1 < self.matte_share, mi.warp.square_to_cosine_hemisphere(sample2), glossy)
        pdf = self.density(wi, wo)
        active = mi.Bool(active) & (wi.z > 0) & (wo.z > 0) & (pdf > 0)
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo = mi.Vector3f(wo.x, wo.y, wo.z * side)
        bs.pdf = dr.select(active, pdf, 0)
        bs.eta = 1
        bs.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        bs.sampled_component = 0
        return bs, dr.select(active, self.brdf_times_cos(wi, wo) / pdf, 0)

    def eval(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx, si, wo, active=True):
        wi, wo, _ = self.upwards(si.wi, wo)
        active = mi.Bool(active) & (wi.z > 0) & (wo.z > 0)
        return dr.select(active, self.brdf_times_cos(wi, wo), 0), dr.select(active, self.density(wi, wo), 0)

    def to_string(self):
        return "FactoredBrdf"


mi.register_bsdf("factored", FactoredBrdf)


def material(r, g, b, roughness, metallic=0.0):
    return {"type": "factored", "r": r, "g": g, "b": b, "roughness": roughness, "metallic": metallic}


def quad(corner, edge_u, edge_v, bsdf, emission=None):
    """A rectangle from a corner and two edges at a right angle."""
    corner, u, v = (np.array(a, dtype=float) for a in (corner, edge_u, edge_v))
    normal = np.cross(u, v)
    to_world = np.eye(4)
    to_world[:3, :] = np.stack([u / 2, v / 2, normal / np.linalg.norm(normal), corner + (u + v) / 2], axis=1)
    shape = {"type": "rectangle", "to_world": mi.ScalarTransform4f(to_world), "bsdf": bsdf}
    if emission is not None:
        shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": list(emission)}}
    return shape


def box(half_width, height, degrees, at, bsdf):
    """A box with a square base that stands on the floor, turned about the vertical."""
    t = mi.ScalarTransform4f
    to_world = (
        t().translate(list(at))
        @ t().rotate([0, 1, 0], degrees)
        @ t().translate([0, height / 2, 0])
        @ t().scale([half_width, height / 2, half_width])
    )
    return {"type": "cube", "to_world": to_world, "bsdf": bsdf}


def cornell_box():
    """quell's built-in scene of this name, camera 1."""
    w, h, d = 1.7, 2.0, 1.1
    white = material(0.74, 0.73, 0.7, 0.9)
    satin = material(0.72, 0.7, 0.68, 0.35)
    shapes = {
        "floor": quad([-w, 0, d], [2 * w, 0, 0], [0, 0, -2 * d], white),
        "ceiling": quad([-w, h, -d], [2 * w, 0, 0], [0, 0, 2 * d], white),
        "back": quad([-w, 0, -d], [2 * w, 0, 0], [0, h, 0], white),
        "left": quad([-w, 0, d], [0, 0, -2 * d], [0, h, 0], material(0.62, 0.07, 0.05, 0.9)),
        "right": quad([w, 0, -d], [0, 0, 2 * d], [0, h, 0], material(0.13, 0.45, 0.1, 0.9)),
        "lamp": quad(
            [-0.35, h - 0.01, -0.28], [0.7, 0, 0], [0, 0, 0.56], material(0.7, 0.7, 0.7, 1.0), [40, 31, 20]
        ),
        "short": box(0.31, 0.62, -17, [0.6, 0, 0.35], white),
        "tall": box(0.32, 1.25, 20, [-0.6, 0, -0.3], satin),
    }
    return shapes, {"eye": [0, 1, 4.1], "target": [0, 0.97, 0], "vertical_fov": 36}, 3


def metal_corner():
    """White rough metal (F = 1) on the floor and a box, a satin box, matte walls, a lamp and a dim sky.

    The box is as rough as quell needs to share a lamp's light between its direct and its glossy term.
    """
    shapes = {
        "floor": quad([-1.5, 0, 1.5], [3, 0, 0], [0, 0, -3], material(1, 1, 1, 0.3, 1)),
        "back": quad([-1.5, 0, -1.5], [3, 0, 0], [0, 2, 0], material(0.7, 0.6, 0.4, 0.8)),
        "left": quad([-1.5, 0, 1.5], [0, 0, -3], [0, 2, 0], material(0.7, 0.1, 0.1, 0.8)),
        "lamp": quad([-1, 1.9, -1], [2, 0, 0], [0, 0, 1.5], material(0.5, 0.5, 0.5, 0.8), [4, 3.6, 3]),
        "metal": box(0.3, 0.7, 25, [0.6, 0, -0.4], material(1, 1, 1, 0.2, 1)),
        "satin": box(0.25, 0.5, -20, [-0.5, 0, 0.3], material(0.2, 0.4, 0.7, 0.25)),
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.3, 0.4, 0.5]}},
    }
    return shapes, {"eye": [0.2, 1.2, 3.6], "target": [0, 0.6, -0.2], "vertical_fov": 40}, 2


# Scene and samples a pixel.
SCENES = {"cornell-box": (cornell_box, 1 << 17), "metal-corner": (metal_corner, 1 << 17)}


def pixel_rays(camera):
    """Origin and directions through the pixel centres, row by row from the top left."""
    eye, target = np.array(camera["eye"], dtype=float), np.array(camera["target"], dtype=float)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    half_height = np.tan(np.radians(camera["vertical_fov"]) / 2)
    half_width = half_height * WIDTH / HEIGHT
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].reshape(2, -1) + 0.5
    x, y = (2 * x / WIDTH - 1) * half_width, (1 - 2 * y / HEIGHT) * half_height
    directions = forward + x[:, None] * right + y[:, None] * up
    return eye, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def render(shapes, camera, bounces, samples, seed):
    """Mean of each pixel and variance of that mean, both of shape (HEIGHT, WIDTH, 3)."""
    scene = mi.load_dict({"type": "scene", **shapes})
    integrator = mi.load_dict({"type": "path", "max_depth": bounces + 2, "rr_depth": 1 << 20})
    eye, directions = pixel_rays(camera)
    pixels = WIDTH * HEIGHT
    batch = min(samples, max(1, PATHS_PER_LAUNCH // pixels))
    # Sample s of pixel p is lane s * pixels + p.
    lanes = np.tile(directions, (batch, 1)).astype(np.float32)
    direction = mi.Vector3f(lanes[:, 0], lanes[:, 1], lanes[:, 2])
    sampler = mi.load_dict({"type": "independent"})
    total, squares, count = np.zeros((pixels, 3)), np.zeros((pixels, 3)), 0
    while count < samples:
        sampler.seed(seed + count, batch * pixels)
        ray = mi.RayDifferential3f(mi.Ray3f(mi.Point3f(eye.tolist()), direction))
        radiance, _, _ = integrator.sample(scene, sampler, ray)
        values = np.array(radiance, dtype=np.float64).T.reshape(batch, pixels, 3)
        assert np.isfinite(values).all()
        total += values.sum(axis=0)
        squares += np.square(values).sum(axis=0)
        count += batch
    mean = total / count
    variance = np.maximum(squares / count - mean**2, 0) / (count - 1)
    shape = (HEIGHT, WIDTH, 3)
    return mean.reshape(shape), variance.reshape(shape), count


def write_pfm(path, picture):
    header = f"PF\n{picture.shape[1]} {picture.shape[0]}\n-1.0\n".encode()
    path.write_bytes(header + picture[::-1].astype("<f4").tobytes())


def main():
    parser = argparse.ArgumentParser(description="Renders the pictures of quell's z-test.")
    parser.add_argument("scenes", nargs="*", help=f"default: {' '.join(SCENES)}")
    parser.add_argument("--samples", type=int, help="paths a pixel, at least; default: as committed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).parent)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    for name in args.scenes or SCENES:
        scene, samples = SCENES[name]
        shapes, camera, bounces = scene()
        start = time.time()
        mean, variance, count = render(shapes, camera, bounces, args.samples or samples, args.seed)
        write_pfm(args.out / f"{name}.mean.pfm", mean)
        write_pfm(args.out / f"{name}.variance.pfm", variance)
        facts = {
            "made_by": "render.py",
            "mitsuba": mi.__version__,
            "variant": mi.variant(),
            "samples_a_pixel": count,
            "seed": args.seed,
            "size": [WIDTH, HEIGHT],
            "bounces": bounces,
            "camera": camera,
            "mean": [float(f"{m:.6g}") for m in mean.mean(axis=(0, 1))],
        }
        (args.out / f"{name}.json").write_text(json.dumps(facts, indent=2) + "\n")
        error = np.sqrt(variance[mean > 0] / mean[mean > 0] ** 2)
        print(
            f"{name}: {count} samples a pixel in {time.time() - start:.0f} s, mean {mean.mean(axis=(0, 1))}, "
            f"relative standard error: median {np.median(error):.4f}, largest {error.max():.4f}"
        )


if __name__ == "__main__":
    main()
