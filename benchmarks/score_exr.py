"""Score a filtered EXR sequence against its references, as ratios to the noisy one's errors.

    python3 benchmarks/score_exr.py NOISY RESULT REFERENCE [RESULT2 ...] [--json FILE] [--frames 1-12]
    python3 benchmarks/score_exr.py ../shared/frames/hall/noisy OUT ../shared/frames/hall/reference

Three folders of EXR files, matched by the last number in their names; further result folders may follow. Every frame
that has a reference, a noisy and a result file counts. Needs `pip install OpenEXR numpy flip-evaluator`. About 1.5 s of
one core a frame of 400x225, most of it FLIP. The noisy frames' own errors are kept in the temporary folder and used
again while neither they nor the references change.

    HDR-FLIP  PyPI flip-evaluator, HDR, its own exposures and 67 pixels a degree; mean over pixels and frames
    relMSE    mean over channels of (x - r)^2 / (r^2 + 0.01), the worst 0.1 % of a frame's pixels dropped; mean over frames
    flicker   root mean square, over pixels and pairs of neighbouring frames, of the change of log2(1 + mean RGB) error

The table gives each as it is, then as a ratio to noisy: HDR-FLIP and flicker as result / noisy (less is better),
relMSE as noisy / result, "times lower" (more is better). A multi-part file's `ViewLayer.Combined` is scored, or
`--pass NAME`; a file without it gives its plain R, G, B. `--noisy-pass "Noisy Image"` is for frames that Blender
denoised itself. Nothing is clipped but negative values, which FLIP and the logarithm do not take.
"""
import argparse
import hashlib
import json
import os
import tempfile
from concurrent.futures import ProcessPoolExecutor

import flip_evaluator
import numpy as np

import exr_sequence


def rel_mse(x, r):
    error = np.sort(((x - r) ** 2 / (r**2 + 0.01)).mean(-1).ravel().astype(np.float64))
    return float(error[: int(len(error) * 0.999)].mean())


def one(job):
    """HDR-FLIP, relMSE and the logarithmic error of one frame."""
    path, name, reference = job
    x, r = exr_sequence.beauty(path, name), exr_sequence.beauty(reference)
    if x.shape != r.shape:
        raise SystemExit(f"{path}: {x.shape[1]}x{x.shape[0]}, but {reference} is {r.shape[1]}x{r.shape[0]}")
    bad = int((~np.isfinite(x)).sum())
    x, r = np.nan_to_num(x, posinf=65504, neginf=0), np.maximum(r, 0)
    flip = float(flip_evaluator.evaluate(r, np.maximum(x, 0), "HDR", applyMagma=False)[1])
    log = lambda v: np.log2(1 + np.maximum(v.mean(-1), 0))
    return flip, rel_mse(x, r), log(x) - log(r), bad


def score(folder, name, references, numbers, pool):
    found = exr_sequence.files(folder)
    used = [n for n in numbers if n in found]
    rows = dict(zip(used, pool.map(one, [(found[n], name, references[n]) for n in used])))
    pairs = {n: float(np.mean((rows[n + 1][2] - rows[n][2]) ** 2)) for n in used if n + 1 in rows}
    return {
        "folder": folder,
        "frames": used,
        "flip": float(np.mean([rows[n][0] for n in used])) if used else None,
        "relmse": float(np.mean([rows[n][1] for n in used])) if used else None,
        "flicker": float(np.sqrt(np.mean(list(pairs.values())))) if pairs else None,
        "not_finite": sum(rows[n][3] for n in used),
        "flip_of_frame": {n: rows[n][0] for n in used},
        "relmse_of_frame": {n: rows[n][1] for n in used},
        "flicker_squared_from": pairs,
    }


def base_score(folder, name, references, numbers, pool):
    """As `score`, of the noisy frames, kept in the temporary folder."""
    found = exr_sequence.files(folder)
    inputs = [os.path.abspath(p) for n in numbers for p in (found[n], references[n])]
    state = json.dumps([name, flip_evaluator.__file__, [(p, os.stat(p).st_mtime_ns, os.stat(p).st_size) for p in inputs]])
    key = hashlib.sha256((state + open(__file__).read()).encode()).hexdigest()[:24]
    path = os.path.join(tempfile.gettempdir(), f"score_exr-{os.getuid()}-{key}.json")
    if os.path.exists(path):
        kept = json.load(open(path))
        return {k: {int(n): x for n, x in v.items()} if isinstance(v, dict) else v for k, v in kept.items()}
    result = score(folder, name, references, numbers, pool)
    with open(path + f".{os.getpid()}", "w") as fh:
        json.dump(result, fh)
    os.replace(path + f".{os.getpid()}", path)
    return result


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("noisy")
    ap.add_argument("result")
    ap.add_argument("reference")
    ap.add_argument("more", nargs="*", help="further result folders")
    ap.add_argument("--pass", dest="name", help="the results' pass to score (default Combined, else R, G, B)")
    ap.add_argument("--noisy-pass", help="the noisy files' pass (default as --pass has it)")
    ap.add_argument("--frames", help="only these, A-B")
    ap.add_argument("--json", help="write all figures, each frame's too, to this file")
    ap.add_argument("--each", action="store_true", help="print each frame's figures too")
    a = ap.parse_args()
    references = exr_sequence.files(a.reference)
    noisy = exr_sequence.files(a.noisy)
    numbers = [n for n in sorted(references) if n in noisy]
    if a.frames:
        first, last = (int(v) for v in (a.frames.split("-") * 2)[:2])
        numbers = [n for n in numbers if first <= n <= last]
    if not numbers:
        raise SystemExit("no frame has both a noisy file and a reference")
    report = []
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        base = base_score(a.noisy, a.noisy_pass or a.name, references, numbers, pool)
        print(f"{'':36} frames  HDR-FLIP    relMSE   flicker |  FLIP ratio  relMSE times  flicker ratio")
        for folder in [a.noisy, a.result, *a.more]:
            s = base if folder == a.noisy else score(folder, a.name, references, numbers, pool)
            if not s["frames"]:
                print(f"{folder}: no frame of it has a reference")
                continue
            if s["frames"] != base["frames"]:
                s["note"] = f"only frames {s['frames']}; ratios to the same noisy frames'"
            mean = lambda key: np.mean([base[key][n] for n in s["frames"]])
            s["flip_ratio"] = s["flip"] / mean("flip_of_frame")
            s["relmse_times"] = mean("relmse_of_frame") / s["relmse"] if s["relmse"] else None
            pairs = [base["flicker_squared_from"][n] for n in s["flicker_squared_from"]]
            s["flicker_ratio"] = s["flicker"] / np.sqrt(np.mean(pairs)) if pairs and min(pairs) > 0 else None
            show = lambda v, f: format(v, f) if v is not None else "-"
            print(
                f"{folder[-36:]:36} {len(s['frames']):6d}  {s['flip']:8.4f}  {s['relmse']:8.4f}  "
                f"{show(s['flicker'], '.4f'):>8} |  {s['flip_ratio']:10.3f}  {show(s['relmse_times'], '.2f'):>12}  "
                f"{show(s['flicker_ratio'], '.3f'):>13}" + (f"  NOT FINITE: {s['not_finite']}" if s["not_finite"] else "")
            )
            if "note" in s:
                print(f"    {s['note']}")
            if a.each:
                for n in s["frames"]:
                    f, m = s["flip_of_frame"][n], s["relmse_of_frame"][n]
                    ratio, times = f / base["flip_of_frame"][n], base["relmse_of_frame"][n] / max(m, 1e-12)
                    print(f"    frame {n:5d}: HDR-FLIP {f:.4f} ({ratio:.3f}), relMSE {m:.4f} ({times:.1f} times)")
            report.append(s)
    if a.json:
        with open(a.json, "w") as fh:
            json.dump(report, fh, indent=1)


if __name__ == "__main__":
    main()
