"""Show where each stage's picture of a frame goes wrong: what numbers alone do not say.

    cargo run --release -p quell-frames --example blend_views -- DATA/night/noisy_4 VIEWS/night/noisy_4 6-6 0
    python3 benchmarks/nets/look.py VIEWS/night/noisy_4/0006.npy DATA/night/reference/night.0006.exr OUT.png [--exposure 2] [--worst 4]

OUT.png: input, wavelet's picture | stabilised picture, reference; below, in the same order, the logarithm of each one's relative squared
error (black: 1e-6, white: 1), and last where the wavelet's picture is worse than the input (red) and better (green). Printed: error of each, the share of the worst
hundredth of the pixels, and the worst blocks of 16x16 pixels, with their worst pixel and what each picture shows there. Needs numpy, OpenEXR, Pillow.
"""
import argparse
import os
import sys

import numpy as np
from PIL import Image

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import exr_sequence

NAMES = ("input", "wavelet", "stabilised")
BLOCK = 16


def tone(linear, exposure):
    linear = np.clip(linear * 2.0**exposure, 0, None)
    return np.clip(np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055), 0, 1)


def relative(picture, reference):
    return ((picture - reference) ** 2 / (reference**2 + 0.01)).mean(-1)


def blocks(error):
    """Means over blocks, what is left over at the right and below left out."""
    h, w = (n // BLOCK for n in error.shape)
    return error[: h * BLOCK, : w * BLOCK].reshape(h, BLOCK, w, BLOCK).mean((1, 3))


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("views")
    ap.add_argument("reference")
    ap.add_argument("out")
    ap.add_argument("--exposure", type=float, default=0.0, help="stops")
    ap.add_argument("--worst", type=int, default=4, help="blocks that are printed of each picture")
    a = ap.parse_args()
    views = np.load(a.views)
    pictures = [views[..., 3 * k : 3 * k + 3] for k in range(3)]
    reference = exr_sequence.beauty(a.reference).astype(np.float32)
    errors = [relative(picture, reference) for picture in pictures]
    for name, error in zip(NAMES, errors):
        largest = np.sort(error.ravel())[::-1]
        print(f"{name:12} relMSE {error.mean():.4g}, {largest[: len(largest) // 100].sum() / largest.sum():.0%} of it in the worst hundredth")
    for name, error in list(zip(NAMES, errors))[1:]:
        means = blocks(error)
        for k in np.argsort(means.ravel())[::-1][: a.worst]:
            top, left = (BLOCK * n for n in divmod(int(k), means.shape[1]))
            part = error[top : top + BLOCK, left : left + BLOCK]
            y, x = np.unravel_index(part.argmax(), part.shape)
            shown = ", ".join(f"{n} {p[top + y, left + x].mean():.3g}" for n, p in zip((*NAMES, "reference"), (*pictures, reference)))
            print(f"{name:12} block at {left}, {top}: {part.mean():.3g}; pixel {left + x}, {top + y}: {shown}")
    shades = [np.clip(np.log10(error + 1e-9) / 6 + 1, 0, 1)[..., None].repeat(3, -1) for error in errors]
    change = 200 * (errors[1] - errors[0])
    shades.append(np.stack([np.clip(change, 0, 1), np.clip(-change, 0, 1), 0 * change], -1))
    tiles = [tone(picture, a.exposure) for picture in (*pictures, reference)] + shades
    rows = [np.concatenate(tiles[k : k + 2], 1) for k in range(0, len(tiles), 2)]
    Image.fromarray((np.concatenate(rows) * 255).astype(np.uint8)).save(a.out)


if __name__ == "__main__":
    main()
