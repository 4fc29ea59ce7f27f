"""A moving picture (animated PNG) of EXR sequences side by side: linear to sRGB.

    python3 benchmarks/exr_moving.py OUT.png NOISY_DIR CLEAN_DIR ... [--colours 40,140] [--exposure 1] [--fps 12] [--crop X,Y,W,H]

Those of the README: 2 samples a pixel, what `quell denoise` makes of them, and the reference,

    quell denoise ../shared/frames/hall/noisy -o clean
    python3 benchmarks/exr_moving.py docs/media/hall.png ../shared/frames/hall/noisy clean ../shared/frames/hall/reference --colours 12,100,80 --crop 75,16,250,193

and of the real-time filter, once its history is full:

    quell render glossy-room -o strip --size 260x146 --frames 0-23 --jitter --reference 512 --reference-frames 12-23
    python3 benchmarks/exr_moving.py docs/media/demo.png strip/noisy strip/denoised strip/reference --exposure 1.25 --colours 20,140,95

Frames that all folders have are shown, in order. Each panel has a palette of its own (255 colours together; a noisy one needs
few: its grain hides the steps). Needs `pip install OpenEXR numpy Pillow`.
"""
import argparse
import struct
import zlib

import numpy as np
from PIL import Image

import exr_sequence

GAP = 4  # dark columns between panels
LAST = 3  # the last frame stays as long as so many
DITHERED = 64  # colours of a panel from which on it is dithered: fewer serve a noisy one, whose grain hides the steps
# An ordered dither of 4x4 pixels (Bayer 1973), in levels of 256.
BAYER = (np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]]) - 7.5) * 0.6


def encoded(path, name, exposure, crop):
    x = np.clip(np.nan_to_num(exr_sequence.beauty(path, name)) * exposure, 0, 1)
    if crop:
        left, top, width, height = crop
        x = x[top : top + height, left : left + width]
    return (np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055) * 255 + 0.5).astype(np.uint8)


def indexed(frames, colours, first):
    """The frames as indices from `first` on into a palette of their own, and that palette."""
    chosen = Image.fromarray(np.concatenate(frames, 0)).quantize(colours, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    palette = np.asarray(chosen.getpalette()[: 3 * colours], np.uint8).reshape(-1, 3)
    # Ordered dither hides the steps of smooth walls; the same in every frame, it does not flicker.
    height, width = frames[0].shape[:2]
    offset = (colours >= DITHERED) * np.tile(BAYER, (height // 4 + 1, width // 4 + 1))[:height, :width, None]
    dithered = [np.clip(frame + offset, 0, 255).astype(np.uint8) for frame in frames]
    stacked = Image.fromarray(np.concatenate(dithered, 0)).quantize(palette=chosen, dither=Image.Dither.NONE)
    return np.split(np.asarray(stacked) + np.uint8(first), len(frames)), palette


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def write(path, frames, palette, fps):
    """An animated PNG; `frames` hold indices into `palette`. https://wiki.mozilla.org/APNG_Specification"""
    height, width = frames[0].shape
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)))
        f.write(chunk(b"acTL", struct.pack(">II", len(frames), 0)) + chunk(b"PLTE", palette.tobytes()))
        sequence = 0
        for number, frame in enumerate(frames):
            delay = LAST if number + 1 == len(frames) else 1
            f.write(chunk(b"fcTL", struct.pack(">IIIIIHHBB", sequence, width, height, 0, 0, delay, fps, 0, 0)))
            sequence += 1
            rows = np.concatenate([np.zeros((height, 1), np.uint8), frame], 1).tobytes()  # filter 0: indices are no quantities
            packed = zlib.compress(rows, 9)
            if number == 0:
                f.write(chunk(b"IDAT", packed))
            else:
                f.write(chunk(b"fdAT", struct.pack(">I", sequence) + packed))
                sequence += 1
        f.write(chunk(b"IEND", b""))


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("out")
    ap.add_argument("folders", nargs="+")
    ap.add_argument("--pass", dest="name")
    ap.add_argument("--colours", help="of each panel, divided by commas, 255 together")
    ap.add_argument("--exposure", type=float, default=1.0)
    ap.add_argument("--fps", type=int, default=12)
    ap.add_argument("--crop")
    a = ap.parse_args()
    crop = [int(v) for v in a.crop.split(",")] if a.crop else None
    colours = [int(v) for v in a.colours.split(",")] if a.colours else [255 // len(a.folders)] * len(a.folders)
    if len(colours) != len(a.folders) or sum(colours) > 255:
        raise SystemExit(f"--colours {a.colours}: a number for each of {len(a.folders)} folders is needed, at most 255 together")
    found = [exr_sequence.files(folder) for folder in a.folders]
    numbers = sorted(set.intersection(*(set(f) for f in found)))
    if not numbers:
        raise SystemExit("no frame number that all folders have")
    palette, panels = [np.asarray([[16, 18, 22]], np.uint8)], []
    for files, count in zip(found, colours):
        pictures = [encoded(files[n], a.name, a.exposure, crop) for n in numbers]
        indices, own = indexed(pictures, count, sum(len(p) for p in palette))
        palette.append(own)
        panels.append(indices)
    gap = np.zeros((panels[0][0].shape[0], GAP), np.uint8)
    frames = []
    for views in zip(*panels):
        parts = [views[0]]
        for view in views[1:]:
            parts += [gap, view]
        frames.append(np.concatenate(parts, 1))
    write(a.out, frames, np.concatenate(palette), a.fps)
    print(f"{a.out}: {len(frames)} frames")


if __name__ == "__main__":
    main()
