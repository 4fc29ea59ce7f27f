"""Open Image Denoise on an EXR sequence, frame by frame, for comparison.

    python3 benchmarks/oidn_exr.py NOISY OUT [--pass Combined] [--quality high] [--frames 1-12]
    python3 benchmarks/score_exr.py NOISY OUT REFERENCE

The RT filter, HDR, with the albedo and normal that Blender writes for it (`Denoising Albedo`, `Denoising Normal`; else
`albedo` and `nn`, `Normal`); these are noisy themselves, so `cleanAux` is off. OUT/NAME.####.exr holds `Combined` as half
floats. Needs `pip install pyoidn OpenEXR numpy` (pyoidn 2.5.1 is Open Image Denoise 2.5.1).
"""
import argparse
import os
import time

import numpy as np
import pyoidn

import exr_sequence


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("noisy")
    ap.add_argument("out")
    ap.add_argument("--pass", dest="name", help="the pass to filter (default Combined, else R, G, B)")
    ap.add_argument("--quality", default="high", choices=("fast", "balanced", "high"))
    ap.add_argument("--guides", default="Denoising Albedo,albedo|Denoising Normal,Normal,nn")
    ap.add_argument("--frames", help="only these, A-B")
    a = ap.parse_args()
    os.makedirs(a.out, exist_ok=True)
    albedos, normals = (part.split(",") for part in a.guides.split("|"))
    found = exr_sequence.files(a.noisy)
    if a.frames:
        first, last = (int(v) for v in (a.frames.split("-") * 2)[:2])
        found = {n: p for n, p in found.items() if first <= n <= last}
    seconds = 0.0
    for path in found.values():
        passes = exr_sequence.read(path)
        color = np.ascontiguousarray(exr_sequence.beauty(path, a.name))
        albedo = next((passes[k] for k in albedos if k in passes), None)
        normal = next((passes[k] for k in normals if k in passes), None)
        begin = time.time()
        clean = pyoidn.denoise(color, albedo=albedo, normal=normal, hdr=True, quality=a.quality)
        seconds += time.time() - begin
        exr_sequence.write(os.path.join(a.out, os.path.basename(path)), {"Combined": np.asarray(clean)})
    print(f"{a.out}: {len(found)} frames, {seconds / max(len(found), 1):.2f} s a frame in the filter")


if __name__ == "__main__":
    main()
