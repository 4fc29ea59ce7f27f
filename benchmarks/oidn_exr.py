"""Open Image Denoise on an EXR sequence, frame by frame, for comparison.

    python3 benchmarks/oidn_exr.py NOISY OUT [--pass Combined] [--quality high] [--aux prefiltered] [--frames 1-12]
    python3 benchmarks/score_exr.py NOISY OUT REFERENCE

The RT filter, HDR, with the albedo and normal that Blender writes for it (`Denoising Albedo`, `Denoising Normal`; else
`albedo` and `nn`, `Normal`). These are noisy themselves. `--aux prefiltered`, the default, does what the manual of Open Image Denoise
advises for best quality and what Blender does by default ("Accurate"): each is filtered by itself first, then the picture with
`cleanAux`, which alone uses the large weights. `--aux noisy` hands them over as they are. OUT/NAME.####.exr holds `Combined` as
half floats. Needs `pip install pyoidn OpenEXR numpy` (pyoidn 2.5.1 is Open Image Denoise 2.5.1).
"""
import argparse
import os
import time

import numpy as np
import pyoidn

import exr_sequence


def prefiltered(device, name, image, quality):
    """An auxiliary image (`albedo`, `normal`) filtered by itself, float32 (H, W, 3)."""
    image, out = np.array(image, np.float32, order="C"), np.empty(image.shape, np.float32)
    with pyoidn.Filter(device) as f:
        f.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
        f.set_image("output", out, pyoidn.OIDN_FORMAT_FLOAT3)
        f.set_quality(QUALITIES[quality])
        f.commit()
        f.execute()
    if error := device.get_error():
        raise SystemExit(f"{name}: {error}")
    return out


QUALITIES = {
    "fast": pyoidn.OIDN_QUALITY_FAST,
    "balanced": pyoidn.OIDN_QUALITY_BALANCED,
    "high": pyoidn.OIDN_QUALITY_HIGH,
}


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("noisy")
    ap.add_argument("out")
    ap.add_argument("--pass", dest="name", help="the pass to filter (default Combined, else R, G, B)")
    ap.add_argument("--quality", default="high", choices=tuple(QUALITIES))
    ap.add_argument("--aux", default="prefiltered", choices=("prefiltered", "noisy"), help="what is done to albedo and normal")
    ap.add_argument("--guides", default="Denoising Albedo,albedo|Denoising Normal,Normal,nn")
    ap.add_argument("--frames", help="only these, A-B")
    a = ap.parse_args()
    os.makedirs(a.out, exist_ok=True)
    albedos, normals = (part.split(",") for part in a.guides.split("|"))
    found = exr_sequence.files(a.noisy)
    if a.frames:
        first, last = (int(v) for v in (a.frames.split("-") * 2)[:2])
        found = {n: p for n, p in found.items() if first <= n <= last}
    device = pyoidn.Device()
    device.commit()
    seconds = 0.0
    for path in found.values():
        passes = exr_sequence.read(path)
        color = np.ascontiguousarray(exr_sequence.beauty(path, a.name))
        albedo = next((passes[k] for k in albedos if k in passes), None)
        normal = next((passes[k] for k in normals if k in passes), None)
        begin = time.time()
        is_clean = a.aux == "prefiltered" and albedo is not None
        if is_clean:
            albedo = prefiltered(device, "albedo", albedo, a.quality)
            normal = None if normal is None else prefiltered(device, "normal", normal, a.quality)
        clean = pyoidn.denoise(color, albedo=albedo, normal=normal, hdr=True, clean_aux=is_clean, quality=a.quality)
        seconds += time.time() - begin
        exr_sequence.write(os.path.join(a.out, os.path.basename(path)), {"Combined": np.asarray(clean)})
    print(f"{a.out}: {len(found)} frames, {seconds / max(len(found), 1):.2f} s a frame in the filter")


if __name__ == "__main__":
    main()
