#!/usr/bin/env python3
"""EXR frames beside and below each other until they fill a larger size: large frames for measuring time and memory.

    python3 benchmarks/tile_exr.py ../shared/frames/hall/noisy /tmp/large --size 1920x1080

Parts, channels, compression and attributes stay as they are. Surfaces repeat, so that the picture means nothing; what each pixel
costs stays. Needs `pip install OpenEXR numpy`.
"""
import argparse
import os

import numpy as np
import OpenEXR

from exr_sequence import files


def tiled(path, out, size):
    width, height = size
    window = (np.array([0, 0], np.int32), np.array([width - 1, height - 1], np.int32))
    parts = []
    with OpenEXR.File(path, separate_channels=True) as file:
        for part in file.parts:
            header = dict(part.header, dataWindow=window, displayWindow=window)
            # The writer counts them itself.
            header.pop("chunkCount", None)
            channels = {}
            for name, channel in part.channels.items():
                pixels = channel.pixels
                times = (-(-height // pixels.shape[0]), -(-width // pixels.shape[1]))
                channels[name] = OpenEXR.Channel(np.tile(pixels, times)[:height, :width].copy())
            parts.append(OpenEXR.Part(header, channels, part.name()))
    OpenEXR.File(parts).write(out)


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("frames")
    ap.add_argument("out")
    ap.add_argument("--size", default="1920x1080")
    a = ap.parse_args()
    size = tuple(int(v) for v in a.size.split("x"))
    os.makedirs(a.out, exist_ok=True)
    for path in files(a.frames).values():
        tiled(path, os.path.join(a.out, os.path.basename(path)), size)


if __name__ == "__main__":
    main()
