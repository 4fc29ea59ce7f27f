"""Break a sequence of Blender's multi-part EXR files in one way, at a chosen strength.

    python3 benchmarks/doctor/break_exr.py IN OUT FAULT [STRENGTH] [--cameras cameras.json] [--frames 1-12]

Made to find out from which strength on a fault spoils what `quell denoise` makes of the frames, and to try `quell doctor`
on them: docs/doctor.md. Needs `pip install OpenEXR numpy`. Faults, and what STRENGTH means:

    none            nothing (for comparison)
    few             only Combined, Denoising Albedo, Normal, Depth, Vector
    scale S         vectors times S
    sign-x, sign-y, sign-both, axis, zero
    direction       the pairs of vectors swapped: previous for next
    vector-noise S  vectors off by a normal deviate of S pixels
    normal-01, normal-camera (needs --cameras), normal-scale S
    depth-ray, depth-inverse      Depth along the ray, 1 / Depth; Position is left out, which would tell
    jitter S        guides moved by up to S / 2 pixels, otherwise in every frame
    splat S         all light convolved with a Gaussian of S pixels deviation, as a splatted filter does
    denoised S      layout `few`; S of Combined replaced by its mean over 7x7 pixels of one normal
    albedo S        layout `few`; Denoising Albedo times S where it is brighter than 0.3
    undemodulated   light passes times their colour, and no Combined
    dwa S           everything DWAA at level S
    twos            every second frame is the one before
    hold            likewise, but the noise is its own: only the guides are those of the frame before
    nan S, infinite S, negative S, fireflies S    share S of all pixels of all light
    seed            residuals of the first frame's light over every frame: one seed
    size S          frame 6 is S times as wide
"""
import argparse
import json
import os
import re

import numpy as np
import OpenEXR

LIGHT = re.compile(r"(Combined|Direct|Indirect|Emission|Environment|Noisy Image)$")
GUIDE = re.compile(r"(Depth|Normal|Position|Albedo)$")


def read(path):
    with OpenEXR.File(path, separate_channels=True) as f:
        parts = {}
        for p in f.parts:
            header = dict(p.header)
            parts[p.name()] = (header, {name: c.pixels.copy() for name, c in p.channels.items()})
        return parts


def write(path, parts):
    out = []
    for name, (header, channels) in parts.items():
        header = {k: v for k, v in header.items() if k in ("compression", "dwaCompressionLevel", "type", "Software", "software")}
        header.setdefault("type", OpenEXR.scanlineimage)
        header["name"] = name
        out.append(OpenEXR.Part(header, {n: OpenEXR.Channel(n, v) for n, v in channels.items()}, name))
    OpenEXR.File(out).write(path)


def planes(parts, end):
    """The channels of a pass, in the order of its letters."""
    for name, (_, channels) in parts.items():
        if name.split(".")[-1] == end:
            order = "XYZW" if any(n.endswith(".X") for n in channels) else "RGBZ"
            keys = sorted((n for n in channels if n[-1] in order), key=lambda n: order.index(n[-1]))
            return channels, keys
    return {}, []


def put(channels, key, value):
    kind = channels[key].dtype
    if kind == np.float16:
        value = np.where(np.isfinite(value), np.clip(value, -65504, 65504), value)
    channels[key] = np.ascontiguousarray(value.astype(kind))


def each(parts, pattern, change):
    for name, (_, channels) in parts.items():
        if pattern.search(name):
            for key in list(channels):
                if key[-1] != "A":
                    put(channels, key, change(channels[key].astype(np.float32), key))


def gauss(plane, s):
    r = int(np.ceil(3 * s))
    k = np.exp(-0.5 * (np.arange(-r, r + 1) / s) ** 2)
    k /= k.sum()
    for axis in (0, 1):
        padded = np.pad(plane, [(r, r) if a == axis else (0, 0) for a in (0, 1)], mode="edge")
        plane = sum(w * np.take(padded, np.arange(plane.shape[axis]) + i, axis) for i, w in enumerate(k))
    return plane


def shifted(plane, dx, dy):
    """The plane at (x + dx, y + dy), bilinear."""
    h, w = plane.shape
    x, y = np.arange(w) + dx, np.arange(h) + dy
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = x - x0, (y - y0)[:, None]
    at = lambda i, j: plane[np.clip(y0 + j, 0, h - 1)][:, np.clip(x0 + i, 0, w - 1)]
    return (at(0, 0) * (1 - fx) + at(1, 0) * fx) * (1 - fy) + (at(0, 1) * (1 - fx) + at(1, 1) * fx) * fy


def nearest(plane, dx, dy):
    h, w = plane.shape
    y, x = np.clip(np.round(np.arange(h) + dy).astype(int), 0, h - 1), np.clip(np.round(np.arange(w) + dx).astype(int), 0, w - 1)
    return plane[y][:, x]


def keep(parts, ends):
    for name in list(parts):
        if name.split(".")[-1] not in ends:
            del parts[name]


def halton(n, base):
    f, r = 1.0, 0.0
    while n:
        f /= base
        r += f * (n % base)
        n //= base
    return r


def damage(parts, fault, s, number, cameras, memory):
    rng = np.random.default_rng(number * 7919 + 13)
    vector, v = planes(parts, "Vector")
    if fault == "few":
        keep(parts, ("Combined", "Denoising Albedo", "Normal", "Depth", "Vector"))
    elif fault in ("scale", "zero"):
        for k in v:
            put(vector, k, vector[k].astype(np.float32) * (s if fault == "scale" else 0))
    elif fault in ("sign-x", "sign-y", "sign-both"):
        for k in v:
            if fault == "sign-both" or (k[-1] in "XZ") == (fault == "sign-x"):
                vector[k] = -vector[k]
    elif fault == "axis":
        for a, b in ((0, 1), (2, 3)):
            vector[v[a]], vector[v[b]] = vector[v[b]], vector[v[a]]
    elif fault == "direction":
        for a, b in ((0, 2), (1, 3)):
            vector[v[a]], vector[v[b]] = -vector[v[b]], -vector[v[a]]
    elif fault == "unit":
        h, w = vector[v[0]].shape
        for k in v:
            put(vector, k, vector[k].astype(np.float32) / (w if k[-1] in "XZ" else h))
    elif fault == "vector-noise":
        for k in v:
            put(vector, k, vector[k].astype(np.float32) + s * rng.normal(size=vector[k].shape))
    elif fault == "normal-01":
        normal, n = planes(parts, "Normal")
        background = sum(normal[k].astype(np.float32) ** 2 for k in n) == 0
        for k in n:
            put(normal, k, np.where(background, 0, normal[k].astype(np.float32) * 0.5 + 0.5))
    elif fault == "normal-scale":
        each(parts, re.compile(r"ViewLayer\.Normal$"), lambda p, _: p * s)
    elif fault == "normal-camera":
        normal, n = planes(parts, "Normal")
        m = np.array(cameras[number]["world_to_camera"])[:3, :3]
        x = np.stack([normal[k].astype(np.float32) for k in n], -1) @ m.T
        for c, k in enumerate(n):
            put(normal, k, x[..., c])
    elif fault in ("depth-ray", "depth-inverse"):
        depth, d = planes(parts, "Depth")
        position, p = planes(parts, "Position")
        eye = np.array(cameras[number]["camera_to_world"])[:3, 3]
        x = np.stack([position[k].astype(np.float32) for k in p], -1) - eye
        z = depth[d[0]]
        ray = np.where(z < 1e9, np.linalg.norm(x, axis=-1), z)
        put(depth, d[0], ray if fault == "depth-ray" else np.where(z < 1e9, 1 / z, 0))
        for name in [n for n in parts if n.endswith("Position")]:
            del parts[name]
    elif fault == "jitter":
        dx, dy = s * (halton(number, 2) - 0.5), s * (halton(number, 3) - 0.5)
        depth, d = planes(parts, "Depth")
        z = np.minimum(depth[d[0]].astype(np.float32), 1e6)
        sides = np.stack([nearest(z, i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
        # Across silhouettes nothing lies between the surfaces.
        smooth = sides.max(0) < 1.1 * sides.min(0)
        each(parts, GUIDE, lambda p, k: np.where(smooth, shifted(p, dx, dy), nearest(p, dx, dy)))
    elif fault == "splat":
        each(parts, LIGHT, lambda p, _: gauss(p, s))
        add_up(parts)
    elif fault == "denoised":
        keep(parts, ("Combined", "Denoising Albedo", "Normal", "Depth", "Vector"))
        normal, n = planes(parts, "Normal")
        facing = np.stack([np.round(normal[k].astype(np.float32) * 3) for k in n], -1)
        group = (facing * [1, 10, 100]).sum(-1)
        colour, c = planes(parts, "Combined")
        for k in c:
            x, mean = colour[k].astype(np.float32), np.zeros(group.shape, np.float32)
            for g in np.unique(group):
                inside = (group == g).astype(np.float32)
                total = lambda q: gauss(gauss(q, 2.0), 2.0)
                mean += inside * total(np.minimum(x, 4) * inside) / np.maximum(total(inside), 1e-6)
            put(colour, k, (1 - s) * x + s * mean)
    elif fault == "albedo":
        keep(parts, ("Combined", "Denoising Albedo", "Normal", "Depth", "Vector"))
        each(parts, re.compile("Denoising Albedo$"), lambda p, _: np.where(p > 0.3, p * s, p))
    elif fault == "undemodulated":
        for lobe in ("Diffuse", "Glossy", "Transmission"):
            colour, c = planes(parts, f"{lobe} Color")
            for end in ("Direct", "Indirect"):
                light, l = planes(parts, f"{lobe} {end}")
                for a, b in zip(l, c):
                    put(light, a, light[a].astype(np.float32) * colour[b].astype(np.float32))
        del parts["ViewLayer.Combined"]
    elif fault == "dwa":
        for header, _ in parts.values():
            header["compression"] = OpenEXR.DWAA_COMPRESSION
            header["dwaCompressionLevel"] = float(s)
    elif fault in ("twos", "hold"):
        if number % 2 == 1:
            memory["held"] = parts
        elif "held" in memory:
            for name in parts:
                if fault == "twos" or not LIGHT.search(name):
                    parts[name] = memory["held"][name]
    elif fault in ("nan", "infinite", "negative", "fireflies"):
        hit = rng.random(next(iter(vector.values())).shape) < s
        value = {"nan": lambda p: np.nan, "infinite": lambda p: np.inf, "negative": lambda p: -np.abs(p) - 0.5,
                 "fireflies": lambda p: np.abs(p) + 300.0}[fault]
        each(parts, LIGHT, lambda p, _: np.where(hit, value(p), p))
    elif fault == "seed":
        each(parts, LIGHT, lambda p, k: same_noise(p, k, memory))
    elif fault == "size":
        if number == 6:
            for _, channels in parts.values():
                for k in list(channels):
                    channels[k] = np.ascontiguousarray(channels[k][:, : int(channels[k].shape[1] * s)])
    elif fault != "none":
        raise SystemExit(f"no fault is called {fault}")


def add_up(parts):
    """Combined as the sum of the passes."""
    beauty, c = planes(parts, "Combined")
    for i, key in enumerate(c):
        get = lambda end: (lambda found, keys: found[keys[i]].astype(np.float32))(*planes(parts, end))
        total = get("Emission") + get("Environment") + get("Volume Direct") + get("Volume Indirect")
        for lobe in ("Diffuse", "Glossy", "Transmission"):
            total = total + get(f"{lobe} Color") * (get(f"{lobe} Direct") + get(f"{lobe} Indirect"))
        put(beauty, key, total)


def same_noise(plane, key, memory):
    """The frame's local mean, times the first frame's own noise over its local mean."""
    mean = gauss(plane, 2.0)
    if key not in memory:
        memory[key] = np.where(mean > 1e-6, plane / np.maximum(mean, 1e-6), 1)
    return mean * memory[key]


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("source")
    ap.add_argument("target")
    ap.add_argument("fault")
    ap.add_argument("strength", nargs="?", type=float, default=1.0)
    ap.add_argument("--cameras")
    ap.add_argument("--frames", default="1-1000000")
    a = ap.parse_args()
    first, last = (int(x) for x in a.frames.split("-"))
    cameras = {}
    if a.cameras:
        with open(a.cameras) as fh:
            found = json.load(fh)["frames"]
        cameras = {int(c["frame"]): c for c in found} if isinstance(found, list) else {int(n): c for n, c in found.items()}
    os.makedirs(a.target, exist_ok=True)
    memory = {}
    for name in sorted(os.listdir(a.source)):
        number = re.search(r"(-?\d+)\.exr$", name)
        if not number or not first <= int(number.group(1)) <= last:
            continue
        parts = read(os.path.join(a.source, name))
        damage(parts, a.fault, a.strength, int(number.group(1)), cameras, memory)
        write(os.path.join(a.target, name), parts)


if __name__ == "__main__":
    main()
