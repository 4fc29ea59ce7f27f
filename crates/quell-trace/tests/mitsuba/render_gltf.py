#!/usr/bin/env python3
"""Renders glTF files with Mitsuba 3, for the z-test of quell's reader and path tracer (tests/main/mitsuba_gltf.rs).

    pip install mitsuba==3.9.1 numpy       # see render.py
    python3 render_gltf.py ../../../../../shared/scenes/modern_hall.glb --bounces 3

The file is read a second time here, by struct, json and numpy alone: nodes with matrices, indexed triangles, factors of
metallic-roughness, emission, smooth glass, directional lights, the first camera. The test and this script agree on
what they leave out, so that both renderers have the same to do:
- normals of vertices: all faces are flat;
- textures: a textured base colour is its factor times 0.5.

Pictures, variances and conventions are those of render.py, at 32 x 18 pixels.
"""

import argparse
import json
import pathlib
import struct
import tempfile
import time

import numpy as np

import render
from render import dr, mi

render.WIDTH, render.HEIGHT = 32, 18

TEXTURED = 0.5


class SchlickGlass(mi.BSDF):
    """A smooth interface: Schlick's Fresnel at the cosine on the thin side, F0 from the index, radiance over n^2."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.index = props["index"]
        self.f0 = ((self.index - 1) / (self.index + 1)) ** 2
        sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [mi.BSDFFlags.DeltaReflection | sides, mi.BSDFFlags.DeltaTransmission | sides]
        self.m_flags = self.m_components[0] | self.m_components[1]

    def sample(self, ctx, si, sample1, sample2, active=True):
        cos = dr.abs(si.wi.z)
        entering = si.wi.z > 0
        eta = dr.select(entering, mi.Float(self.index), mi.Float(1 / self.index))
        sin2_far = (1 - cos * cos) / (eta * eta)
        total = sin2_far >= 1
        cos_far = dr.sqrt(dr.maximum(1 - sin2_far, 0))
        grazing = 1 - dr.select(entering, cos, cos_far)
        fresnel = dr.select(total, 1, self.f0 + (1 - self.f0) * dr.power(grazing, 5))
        reflect = sample1 < fresnel
        through = mi.Vector3f(-si.wi.x / eta, -si.wi.y / eta, dr.select(entering, -cos_far, cos_far))
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo = dr.select(reflect, mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z), through)
        bs.pdf = dr.select(reflect, fresnel, 1 - fresnel)
        bs.eta = dr.select(reflect, 1, eta)
        reflection, transmission = mi.UInt32(+mi.BSDFFlags.DeltaReflection), mi.UInt32(+mi.BSDFFlags.DeltaTransmission)
        bs.sampled_type = dr.select(reflect, reflection, transmission)
        bs.sampled_component = dr.select(reflect, mi.UInt32(0), mi.UInt32(1))
        return bs, mi.Color3f(dr.select(mi.Bool(active), dr.select(reflect, 1, 1 / (eta * eta)), 0))

    def eval(self, ctx, si, wo, active=True):
        return mi.Color3f(0)

    def pdf(self, ctx, si, wo, active=True):
        return mi.Float(0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return mi.Color3f(0), mi.Float(0)

    def to_string(self):
        return "SchlickGlass"


mi.register_bsdf("schlick_glass", SchlickGlass)

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}


class Gltf:
    def __init__(self, path):
        data = path.read_bytes()
        magic, _, _, json_length, _ = struct.unpack_from("<IIIII", data)
        assert magic == 0x46546C67, path
        self.json = json.loads(data[20 : 20 + json_length])
        self.binary = data[20 + json_length + 8 :]

    def accessor(self, index):
        a = self.json["accessors"][index]
        view = self.json["bufferViews"][a["bufferView"]]
        dtype, width = COMPONENTS[a["componentType"]], WIDTHS[a["type"]]
        item = np.dtype(dtype).itemsize * width
        start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        assert view.get("byteStride", item) == item and not a.get("normalized") and "sparse" not in a
        return np.frombuffer(self.binary, dtype, a["count"] * width, start).reshape(-1, width)

    def nodes(self):
        """All nodes of the default scene with their world matrices."""

        def walk(index, parent):
            node = self.json["nodes"][index]
            assert "rotation" not in node and "scale" not in node and "translation" not in node, "matrices only"
            world = parent @ np.array(node.get("matrix", np.eye(4).T.ravel()), dtype=float).reshape(4, 4).T
            yield node, world
            for child in node.get("children", []):
                yield from walk(child, world)

        for root in self.json["scenes"][self.json.get("scene", 0)]["nodes"]:
            yield from walk(root, np.eye(4))


def material(m):
    """BSDF and emitted radiance."""
    pbr, extensions = m.get("pbrMetallicRoughness", {}), m.get("extensions", {})
    if extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0) > 0:
        assert pbr["roughnessFactor"] == 0 and "KHR_materials_volume" in extensions
        return {"type": "schlick_glass", "index": extensions.get("KHR_materials_ior", {}).get("ior", 1.5)}, None
    assert "KHR_materials_ior" not in extensions
    color = np.array(pbr.get("baseColorFactor", [1, 1, 1, 1])[:3])
    if "baseColorTexture" in pbr:
        color = color * TEXTURED
    bsdf = render.material(*map(float, color), float(pbr.get("roughnessFactor", 1)), float(pbr.get("metallicFactor", 1)))
    strength = extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1)
    emission = np.array(m.get("emissiveFactor", [0, 0, 0])) * strength
    return bsdf, emission if emission.any() else None


def load(path, folder):
    gltf = Gltf(path)
    shapes, camera = {}, None
    for node, world in gltf.nodes():
        if "camera" in node and camera is None:
            fov = gltf.json["cameras"][node["camera"]]["perspective"]["yfov"]
            eye, axis = world[:3, 3], -world[:3, 2]
            assert abs(world[1, 0]) < 1e-5, "the camera must not roll"
            camera = {"eye": eye.tolist(), "target": (eye + axis).tolist(), "vertical_fov": float(np.degrees(fov))}
        if "KHR_lights_punctual" in node.get("extensions", {}):
            light = gltf.json["extensions"]["KHR_lights_punctual"]["lights"]
            light = light[node["extensions"]["KHR_lights_punctual"]["light"]]
            assert light["type"] == "directional"
            irradiance = np.array(light.get("color", [1, 1, 1])) * light.get("intensity", 1)
            direction = -world[:3, 2] / np.linalg.norm(world[:3, 2])
            shapes[f"light{len(shapes)}"] = {
                "type": "directional",
                "direction": direction.tolist(),
                "irradiance": {"type": "rgb", "value": irradiance.tolist()},
            }
        if "mesh" not in node:
            continue
        for primitive in gltf.json["meshes"][node["mesh"]]["primitives"]:
            name = f"shape{len(shapes)}"
            points = gltf.accessor(primitive["attributes"]["POSITION"]).astype(float) @ world[:3, :3].T + world[:3, 3]
            faces = gltf.accessor(primitive["indices"]).reshape(-1, 3)
            if np.linalg.det(world[:3, :3]) < 0:
                faces = faces[:, ::-1]
            mesh = mi.Mesh(name, len(points), len(faces))
            parameters = mi.traverse(mesh)
            parameters["vertex_positions"] = points.astype(np.float32).ravel()
            parameters["faces"] = faces.astype(np.uint32).ravel()
            parameters.update()
            file = str(folder / f"{name}.ply")
            mesh.write_ply(file)
            bsdf, emission = material(gltf.json["materials"][primitive["material"]])
            shapes[name] = {"type": "ply", "filename": file, "face_normals": True, "bsdf": bsdf}
            if emission is not None:
                radiance = {"type": "rgb", "value": emission.tolist()}
                shapes[name]["emitter"] = {"type": "area", "radiance": radiance}
    return shapes, camera


def main():
    parser = argparse.ArgumentParser(description="Renders the pictures of quell's z-test on glTF files.")
    parser.add_argument("files", nargs="+", type=pathlib.Path)
    parser.add_argument("--samples", type=int, default=1 << 15, help="paths a pixel, at least")
    parser.add_argument("--bounces", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).parent)
    args = parser.parse_args()
    for file in args.files:
        start = time.time()
        with tempfile.TemporaryDirectory() as folder:
            shapes, camera = load(file, pathlib.Path(folder))
            mean, variance, count = render.render(shapes, camera, args.bounces, args.samples, args.seed)
        render.write_pfm(args.out / f"{file.stem}.mean.pfm", mean)
        render.write_pfm(args.out / f"{file.stem}.variance.pfm", variance)
        facts = {
            "made_by": "render_gltf.py",
            "mitsuba": mi.__version__,
            "variant": mi.variant(),
            "samples_a_pixel": count,
            "seed": args.seed,
            "size": [render.WIDTH, render.HEIGHT],
            "bounces": args.bounces,
            "camera": camera,
            "mean": [float(f"{m:.6g}") for m in mean.mean(axis=(0, 1))],
        }
        (args.out / f"{file.stem}.json").write_text(json.dumps(facts, indent=2) + "\n")
        error = np.sqrt(variance[mean > 0] / mean[mean > 0] ** 2)
        print(
            f"{file.stem}: {count} samples a pixel in {time.time() - start:.0f} s, mean {mean.mean(axis=(0, 1))}, "
            f"relative standard error: median {np.median(error):.4f}, largest {error.max():.4f}"
        )


if __name__ == "__main__":
    main()
