"""PNGs of EXR frames, to look at: linear to sRGB, exposure 1.

    python3 benchmarks/exr_png.py OUT.png A.exr B.exr ... [--pass Combined] [--scale 2] [--crop X,Y,W,H] [--exposure 1]

Several files stand side by side. Needs `pip install OpenEXR numpy scikit-image`.
"""
import argparse

import numpy as np
from skimage.io import imsave

import exr_sequence


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("out")
    ap.add_argument("files", nargs="+")
    ap.add_argument("--pass", dest="name")
    ap.add_argument("--scale", type=int, default=1)
    ap.add_argument("--crop")
    ap.add_argument("--columns", type=int, default=2)
    ap.add_argument("--exposure", type=float, default=1.0)
    a = ap.parse_args()
    tiles = []
    for path in a.files:
        x = np.clip(np.nan_to_num(exr_sequence.beauty(path, a.name)) * a.exposure, 0, 1)
        if a.crop:
            left, top, width, height = (int(v) for v in a.crop.split(","))
            x = x[top : top + height, left : left + width]
        x = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
        tiles.append(np.repeat(np.repeat(x, a.scale, 0), a.scale, 1))
    while len(tiles) % a.columns and len(tiles) > a.columns:
        tiles.append(np.zeros_like(tiles[0]))
    rows = [np.concatenate(tiles[i : i + a.columns], 1) for i in range(0, len(tiles), a.columns)]
    imsave(a.out, (np.concatenate(rows, 0) * 255 + 0.5).astype(np.uint8), check_contrast=False)


if __name__ == "__main__":
    main()
