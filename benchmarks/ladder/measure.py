"""The errors of one frame against its reference, whole, in blocks and by region; used by `ladder.py`.

A reference is noisy too. Its variance is subtracted wherever errors are squared: relMSE, blocks, regions and flicker, for the
input and for every result alike. It is the file's pass `variance` where there is one (made from independent pieces), else
the error of the input times SPP / (SPP + samples of the reference). HDR-FLIP stays as it is.
"""
import os
import sys

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
import exr_sequence

BLOCK = 16
FLOOR = 1e-6  # of a pixel's relative squared error: 0.1 %, what half floats round away and nobody sees
KEPT = 0.999  # as score_exr.py: the worst 0.1 % of a frame's pixels is left out of relMSE; before, the 0.1 % whose reference is least known


def reference_variance(path, r, noisy, share):
    """Variance of the reference, per pixel and channel; `share` is SPP / (SPP + its samples)."""
    found = exr_sequence.read(path, {"variance"})
    if "variance" in found:
        return found["variance"][..., :3]
    return (noisy - r) ** 2 * share


def blocks_of(x):
    """Sums over blocks of 16x16, those at the right and lower edge may be smaller."""
    h, w = x.shape
    rows = np.add.reduceat(x, np.arange(0, h, BLOCK), 0)
    return np.add.reduceat(rows, np.arange(0, w, BLOCK), 1)


def relative_depth_edges(z):
    """Pixels next to which depth changes by more than 5 %."""
    padded = np.pad(z, 1, mode="edge")
    shifted = [padded[1 + dy : 1 + dy + z.shape[0], 1 + dx : 1 + dx + z.shape[1]] for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    return np.max(shifted, 0) > 1.05 * np.min(shifted, 0)


def regions(path):
    """{name: mask} of a frame by its feature buffers, each pixel in the first that holds it."""
    p = exr_sequence.read(path)
    depth = next((p[k][..., 0] for k in ("Denoising Depth", "Depth", "dd") if k in p), None)
    if depth is None:
        return {}
    left, out = np.ones(depth.shape, bool), {}

    def take(name, mask):
        nonlocal left
        out[name], left = mask & left, left & ~mask

    level = lambda *names: sum(p[n][..., :3].mean(-1) for n in names if n in p) + np.zeros(depth.shape)
    lit = level("Emission", "Volume Direct", "Volume Indirect")
    take("emission and volume", lit > 0.02)
    take("edges of depth", relative_depth_edges(np.minimum(depth, 1e4)))
    specular, matt = level("Glossy Color", "Transmission Color"), level("Diffuse Color")
    take("mirror and glass", specular > np.maximum(0.25, 2 * matt))
    take("rest", np.ones(depth.shape, bool))
    return out


def frame(job):
    """Errors of one frame. `job`: result, pass, reference, noisy file, share of the input's samples, with regions?"""
    import flip_evaluator

    path, name, reference, noisy, share, with_regions = job
    r = exr_sequence.beauty(reference)
    x = exr_sequence.beauty(path, name)
    if x.shape != r.shape:
        raise SystemExit(f"{path}: {x.shape[1]}x{x.shape[0]}, but {reference} is {r.shape[1]}x{r.shape[0]}")
    bad = int((~np.isfinite(x)).sum())
    x, r = np.nan_to_num(x, posinf=65504, neginf=0), np.maximum(r, 0)
    variance = reference_variance(reference, r, np.nan_to_num(exr_sequence.beauty(noisy), posinf=65504, neginf=0), share)

    weight = 1 / (r.astype(np.float64) ** 2 + 0.01)
    error = ((x - r) ** 2 * weight).mean(-1)
    doubt = (variance * weight).mean(-1)
    # Pixels whose reference is least known are left out of every result: a firefly of the input, by which the noise of a reference in one
    # piece is known, or of the reference itself would be subtracted from those results alone that keep its pixel.
    certain = np.argsort(doubt, axis=None)[: int(error.size * KEPT)]
    kept = certain[np.argsort(error.ravel()[certain])[: int(error.size * KEPT**2)]]
    log = lambda v: np.log2(1 + np.maximum(v.mean(-1), 0))
    # the noise of channels goes together, so the deviation of their mean is at most the mean of theirs
    of_log = (np.sqrt(np.maximum(variance, 0)).mean(-1) / ((1 + r.mean(-1)) * np.log(2))) ** 2
    out = {
        "flip": float(flip_evaluator.evaluate(r, np.maximum(x, 0), "HDR", applyMagma=False)[1]),
        "relmse": float(error.ravel()[kept].mean()),
        "relmse_of_reference": float(doubt.ravel()[kept].mean()),
        "log": (log(x) - log(r)).astype(np.float32),
        "log_of_reference": float(of_log.mean()),
        "blocks": blocks_of(error).tolist(),
        "blocks_of_reference": blocks_of(doubt).tolist(),
        "not_finite": bad,
    }
    if with_regions:
        is_kept = np.zeros(error.size, bool)
        is_kept[kept] = True
        masks = {k: m & is_kept.reshape(m.shape) for k, m in regions(noisy).items()}
        out["regions"] = {k: [int(m.sum()), float(error[m].sum()), float(doubt[m].sum())] for k, m in masks.items()}
    return out


def sequence(rows):
    """Figures of a sequence from {frame: what `frame` gives}; noise of the references subtracted but for HDR-FLIP."""
    numbers = sorted(rows)
    less = lambda whole, noise: max(whole - noise, 1e-3 * whole, 1e-12)
    flicker = {}
    for n in numbers:
        if n + 1 in rows:
            a, b = rows[n], rows[n + 1]
            whole = float(np.mean((b["log"] - a["log"]) ** 2))
            flicker[n] = less(whole, a["log_of_reference"] + b["log_of_reference"]) ** 0.5
    relmse = {n: less(rows[n]["relmse"], rows[n]["relmse_of_reference"]) for n in numbers}
    named = {}
    for n in numbers:
        for k, v in rows[n].get("regions", {}).items():
            named[k] = [p + q for p, q in zip(named.get(k, [0, 0, 0]), v)]
    return {
        "frames": numbers,
        "flip": float(np.mean([rows[n]["flip"] for n in numbers])),
        "relmse": float(np.mean(list(relmse.values()))),
        "relmse_with_noise": float(np.mean([rows[n]["relmse"] for n in numbers])),
        "flicker": float(np.mean([v**2 for v in flicker.values()]) ** 0.5) if flicker else None,
        "flip_of_frame": {n: rows[n]["flip"] for n in numbers},
        "relmse_of_frame": relmse,
        "flicker_from_frame": flicker,
        "blocks": {n: rows[n]["blocks"] for n in numbers},
        "blocks_of_reference": {n: rows[n]["blocks_of_reference"] for n in numbers},
        "regions": {k: {"pixels": v[0], "error": less(v[1], v[2])} for k, v in named.items() if v[0]},
        "not_finite": sum(rows[n]["not_finite"] for n in numbers),
    }


def worse_blocks(base, result):
    """Blocks whose error is compared: (how many, [(factor, frame, x, y), ...] of those more than 10 % worse, worst first).

    Only blocks count in which the input's error is above the noise of the reference and above `FLOOR`.
    """
    counted, worse = 0, []
    for n in result["frames"]:
        e, x, doubt = (np.array(s[k][n]) for s, k in ((base, "blocks"), (result, "blocks"), (base, "blocks_of_reference")))
        is_above = e - doubt > np.maximum(doubt, FLOOR * BLOCK**2)
        factor = (x - doubt) / np.where(is_above, e - doubt, 1)
        counted += int(is_above.sum())
        for j, i in zip(*np.nonzero(is_above & (factor > 1.1))):
            worse.append((float(factor[j, i]), n, int(i) * BLOCK, int(j) * BLOCK))
    return counted, sorted(worse, reverse=True)
