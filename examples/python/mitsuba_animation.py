"""Mitsuba 3 renders a short animation, quell cleans it: arrays all the way, no file between them.

    pip install mitsuba quell-denoise                 # pyoidn as well, and Open Image Denoise is scored beside it
    python examples/python/mitsuba_animation.py OUT [--frames 12] [--size 192x108] [--spp 4] [--reference 256] [--variant scalar_rgb]

A court of columns on a checked floor, a ball of brushed metal, a warm lamp in it and a pale sky above; the camera walks round it. The AOV
integrator gives albedo, shading normal, position and distance; quell finds the cameras, and so the motion, from the positions. OUT gets
strip.png (noisy, quell, Open Image Denoise, reference of the middle frame) and the figures are printed: relative mean
squared error, and flicker (the same of the difference between neighbouring frames), each over the noisy input's.

`--variant llvm_ad_rgb` renders faster, where there is an LLVM library of version 16 or newer (Debian: libllvm19).
"""

import argparse
import math
import os
import time

import mitsuba as mi
import numpy as np

import quell


def moved(at, size=(1, 1, 1), axis=(0, 1, 0), angle=0.0):
    return mi.ScalarTransform4f().translate(list(at)).rotate(list(axis), angle).scale(list(size))


def matt(r, g, b):
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": [r, g, b]}}


def court():
    """Everything but the camera."""
    checks = {
        "type": "checkerboard", "to_uv": mi.ScalarTransform4f().scale([14, 14, 1]),
        "color0": {"type": "rgb", "value": [0.70, 0.66, 0.58]}, "color1": {"type": "rgb", "value": [0.18, 0.20, 0.26]},
    }  # fmt: skip
    found = {
        "type": "scene",
        "integrator": {
            "type": "aov", "aovs": "albedo:albedo,normal:sh_normal,position:position,distance:depth",
            "img": {"type": "path", "max_depth": 6},
        },
        "floor": {"type": "rectangle", "to_world": moved((0, 0, 0), (5, 5, 1), (1, 0, 0), -90), "bsdf": {"type": "diffuse", "reflectance": checks}},
        "ball": {"type": "sphere", "center": [0.0, 0.6, 0.0], "radius": 0.6, "bsdf": {"type": "roughconductor", "material": "Cu", "alpha": 0.15}},
        "lamp": {"type": "sphere", "center": [0.9, 1.9, 0.5], "radius": 0.16, "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [34, 26, 16]}}},
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.22, 0.26, 0.34]}},
    }  # fmt: skip
    for i in range(7):
        angle = 2 * math.pi * i / 7
        x, z = 1.8 * math.cos(angle), 1.8 * math.sin(angle)
        colour = matt(0.75, 0.72, 0.65) if i % 2 else matt(0.55, 0.22, 0.16)
        found[f"column{i}"] = {"type": "cylinder", "p0": [x, 0, z], "p1": [x, 1.7, z], "radius": 0.16, "bsdf": colour}
        found[f"slab{i}"] = {"type": "cube", "to_world": moved((x, 1.78, z), (0.26, 0.08, 0.26), angle=-math.degrees(angle)), "bsdf": colour}
    return found


def sensor(frame, width, height):
    angle = math.radians(24 + 1.2 * frame)
    eye = [4.4 * math.cos(angle), 1.7, 4.4 * math.sin(angle)]
    return mi.load_dict({
        "type": "perspective", "fov": 44, "fov_axis": "x", "near_clip": 0.01, "far_clip": 100.0,
        "to_world": mi.ScalarTransform4f().look_at(origin=eye, target=[0, 0.7, 0], up=[0, 1, 0]),
        "sampler": {"type": "independent", "sample_count": 4},
        # One pixel a sample: wider filters spread one sample's noise over several.
        "film": {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb", "component_format": "float32", "rfilter": {"type": "box"}},
    })  # fmt: skip


def animation(frames, width, height, spp, first_seed=1):
    """(frames, height, width, 13): color, albedo, normal and position, three channels each, and the distance."""
    scene = mi.load_dict(court())
    # Another seed for every frame: else noise would stand still over the picture.
    rendered = [
        mi.render(scene, sensor=sensor(frame, width, height), spp=spp, seed=first_seed + frame) for frame in range(frames)
    ]
    return np.stack([np.array(frame, np.float32) for frame in rendered])


def scores(picture, reference, noisy):
    """Relative error and flicker over those of the noisy input."""

    def error(a, b):
        return np.mean((a - b) ** 2 / (b.mean(axis=-1, keepdims=True) ** 2 + 0.01))

    def flicker(a):
        return np.mean(np.abs(np.diff(a, axis=0) - np.diff(reference, axis=0)))

    return error(picture, reference) / error(noisy, reference), flicker(picture) / flicker(noisy)


def open_image_denoise(color, albedo, normal):
    try:
        import pyoidn
    except ImportError:
        return None
    found = [
        pyoidn.denoise(np.ascontiguousarray(c), albedo=np.ascontiguousarray(a), normal=np.ascontiguousarray(n), hdr=True)
        for c, a, n in zip(color, np.clip(albedo, 0, 1), normal)
    ]
    return np.stack([np.asarray(f) for f in found])


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("out")
    ap.add_argument("--frames", type=int, default=12)
    ap.add_argument("--size", default="192x108")
    ap.add_argument("--spp", type=int, default=4)
    ap.add_argument("--reference", type=int, default=256, help="samples a pixel of the reference; 0: none, and no figures")
    ap.add_argument("--variant", default="scalar_rgb")
    a = ap.parse_args()
    mi.set_variant(a.variant)
    os.makedirs(a.out, exist_ok=True)
    width, height = (int(v) for v in a.size.split("x"))
    begin = time.time()
    layers = animation(a.frames, width, height, a.spp)
    color, albedo, normal, position = (layers[..., 3 * i : 3 * i + 3] for i in range(4))
    distance = layers[..., 12]
    print(f"rendered {a.frames} frames, {time.time() - begin:.1f} s")

    begin = time.time()
    # Mitsuba's depth is the distance along the ray: `renderer` says so.
    clean = quell.denoise(color, albedo=albedo, normal=normal, depth=distance, position=position, renderer="mitsuba", progress=True)
    print(f"denoised, {time.time() - begin:.1f} s")

    strip = [color, clean]
    other = open_image_denoise(color, albedo, normal)
    strip += [] if other is None else [other]
    if a.reference:
        reference = animation(a.frames, width, height, a.reference, first_seed=1000)[..., :3]
        strip.append(reference)
        for name, picture in [("quell", clean), ("Open Image Denoise, albedo and normal as they come", other)]:
            if picture is not None:
                error, flicker = scores(picture, reference, color)
                print(f"{name}: error {error:.4f}, flicker {flicker:.3f} of the noisy input's")
    middle = np.concatenate([pictures[a.frames // 2] for pictures in strip], axis=1)
    mi.util.write_bitmap(os.path.join(a.out, "strip.png"), mi.Bitmap(middle.astype(np.float32)))
    print(os.path.join(a.out, "strip.png"))


if __name__ == "__main__":
    main()
