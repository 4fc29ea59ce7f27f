"""Render the ladder's sequence of another renderer with Mitsuba 3 (`pip install mitsuba==3.9.1`), as `make_sequence.py` does with Cycles.

    python make_mitsuba.py --kind noisy|reference --spp 16 --out OUT [--frames 1-12] [--piece 1] [--threads 2]

256x144, box filter, `independent` sampler: its noise is white, with the heavy tails of a path tracer without clamping. A room
with checked floor and striped wall, a ball of rough metal that rolls past a clear one, a mirror, thin rods, a small bright
lamp and a large dim one; the camera moves sideways. AOVs: albedo, shading normal, position, depth; no motion vectors.

Variant llvm_ad_rgb: needs an LLVM shared library of version 16 or newer (Debian: libllvm19).
"""
import argparse
import os
import sys
import time

import drjit as dr
import mitsuba as mi
import numpy as np

from render import numbers

mi.set_variant("llvm_ad_rgb")
WIDTH, HEIGHT, FRAMES = 256, 144, 12
PASS_SPP = 64  # of one call: memory grows with it


def transform(*steps):
    out = mi.ScalarTransform4f()
    for name, value in steps:
        out = getattr(out, name)(value) if name != "rotate" else out.rotate(*value)
    return out


def matt(color):
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(color)}}


def checked(a, b, times):
    return {
        "type": "diffuse",
        "reflectance": {
            "type": "checkerboard",
            "color0": {"type": "rgb", "value": list(a)},
            "color1": {"type": "rgb", "value": list(b)},
            "to_uv": mi.ScalarTransform4f().scale([times[0], times[1], 1]),
        },
    }


def wall(at, axis, angle, size, bsdf):
    to_world = transform(("translate", at), ("rotate", (axis, angle)), ("scale", [size[0], size[1], 1]))
    return {"type": "rectangle", "to_world": to_world, "bsdf": bsdf}


def lamp(at, size, radiance):
    """A rectangle that shines downwards."""
    found = wall(at, [1, 0, 0], 90, size, matt((0.1, 0.1, 0.1)))
    found["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}}
    return found


def scene(frame, with_aovs):
    t = frame - 1
    camera = transform().look_at(origin=[-0.9 + 0.06 * t, 1.35, 4.6], target=[-0.05 + 0.015 * t, 0.85, 0.0], up=[0, 1, 0])
    steel = {"type": "roughconductor", "material": "Al", "alpha": 0.12}
    path = {"type": "path", "max_depth": 8}
    d = {
        "type": "scene",
        "integrator": {"type": "aov", "aovs": "albedo:albedo,nn:sh_normal,pos:position,dd:depth", "img": path} if with_aovs else path,
        "sensor": {
            "type": "perspective", "fov": 42, "fov_axis": "x", "near_clip": 0.01, "far_clip": 100.0, "to_world": camera,
            "sampler": {"type": "independent", "sample_count": 4},
            "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "pixel_format": "rgb", "component_format": "float16",
                     "rfilter": {"type": "box"}},
        },
        "floor": wall([0, 0, 0], [1, 0, 0], -90, (2.6, 2.6), checked((0.62, 0.58, 0.50), (0.16, 0.19, 0.24), (12, 12))),
        "back": wall([0, 1.3, -1.7], [1, 0, 0], 0, (2.6, 1.3), checked((0.62, 0.30, 0.20), (0.48, 0.20, 0.14), (40, 1))),
        "left": wall([-2.0, 1.3, 0], [0, 1, 0], 90, (2.6, 1.3), matt((0.20, 0.42, 0.30))),
        "right": wall([2.0, 1.3, 0], [0, 1, 0], -90, (2.6, 1.3), matt((0.55, 0.52, 0.46))),
        "ceiling": wall([0, 2.6, 0], [1, 0, 0], 90, (2.6, 2.6), matt((0.75, 0.74, 0.70))),
        "large": lamp([0.9, 2.59, -0.2], (0.5, 0.5), (3.0, 3.2, 3.6)),
        "small": lamp([-1.2, 2.2, 0.3], (0.13, 0.13), (40, 32, 20)),
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.25, 0.28, 0.34]}},
        "mirror": {"type": "rectangle", "to_world": transform(("translate", [1.0, 0.95, -1.45]), ("rotate", ([0, 1, 0], -14)), ("scale", [0.45, 0.7, 1])),
                   "bsdf": {"type": "conductor", "material": "Ag"}},
        "glass": {"type": "sphere", "center": [0.55, 0.34, 0.75], "radius": 0.34, "bsdf": {"type": "dielectric", "int_ior": 1.5}},
        "rolling": {"type": "sphere", "to_world": transform(("translate", [-1.25 + 0.13 * t, 0.42, -0.25]), ("scale", 0.42)), "bsdf": steel},
        "box": {"type": "cube", "to_world": transform(("translate", [-0.25, 0.35, 1.0]), ("rotate", ([0, 1, 0], 8 * t)), ("scale", [0.22, 0.35, 0.22])),
                "bsdf": checked((0.75, 0.55, 0.08), (0.08, 0.12, 0.40), (5, 5))},
    }  # fmt: skip
    for i in range(9):
        x = -1.7 + 0.16 * i
        d[f"rod{i}"] = {"type": "cylinder", "p0": [x, 0, -1.2], "p1": [x, 1.7, -1.2], "radius": 0.012, "bsdf": matt((0.7, 0.7, 0.72))}
    return d


def noisy(frame, spp, path):
    found = mi.load_dict(scene(frame, True))
    mi.render(found, spp=spp, seed=frame)
    found.sensors()[0].film().write(path)


def reference(frame, spp, piece, path):
    found, total, passes = mi.load_dict(scene(frame, False)), np.zeros((HEIGHT, WIDTH, 3)), max(spp // PASS_SPP, 1)
    for k in range(passes):
        total += np.array(mi.render(found, spp=spp // passes, seed=100000 * piece + 1000 * frame + k), np.float64)
    mi.Bitmap((total / passes).astype(np.float32)).write(path)


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("--kind", choices=("noisy", "reference"), required=True)
    ap.add_argument("--spp", type=int, required=True)
    ap.add_argument("--out", required=True)
    ap.add_argument("--frames", default=f"1-{FRAMES}")
    ap.add_argument("--piece", type=int, default=1)
    ap.add_argument("--threads", type=int)
    a = ap.parse_args()
    if a.threads:
        dr.set_thread_count(a.threads)
    os.makedirs(a.out, exist_ok=True)
    for frame in numbers(a.frames):
        path, begin = os.path.join(a.out, f"mitsuba.{frame:04d}.exr"), time.time()
        if os.path.exists(path):
            continue
        part = path + ".part.exr"
        noisy(frame, a.spp, part) if a.kind == "noisy" else reference(frame, a.spp, a.piece, part)
        os.replace(part, path)
        print(f"{path}: {time.time() - begin:.1f} s", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
