"""quell and Open Image Denoise on the ladder: every sequence at every sample count, scored against its references.

    python3 benchmarks/ladder/ladder.py DATA --quell target/release/quell [--label NAME] [-- ARGUMENTS OF quell denoise]
        [--scenes yard,night] [--counts 4,64] [--frames 6-8] [--only quell|oidn] [--check] [--json FILE] [--crops N]

DATA is what `render.py` made; `hall` and `mitsuba_box` are taken from --shared. Results lie in DATA/results/NAME/, so variants
stand side by side. Those of the input and of Open Image Denoise (`high`, prefiltered albedo and normal) are kept and made
again only when a frame changes; quell is run each time (`--keep` leaves results alone that exist). A sequence whose
references are not there yet is left out. Needs what `score_exr.py` and `oidn_exr.py` need.

One line a sequence, count and filter: HDR-FLIP and flicker as ratios to the input (less is better), relMSE "times lower"
(more is better), as in `score_exr.py`, but with the references' noise subtracted (see `measure.py`) and on all frames that have
a reference. `frame`: the worst ratio of a single frame (a pair of frames for flicker) of the three, errors upwards. `blocks`: of
16x16 blocks in which the input's error is above the reference's noise, how many of a thousand are more than 10 % worse than the
input, and the worst factor. `--check` adds which points do not hold, and exits with 1 if there are any:

    each frame   HDR-FLIP, relMSE and flicker at most 1.02 times the input's
    peer         in two of three figures no higher than Open Image Denoise, in the third at most 1.1 times
    blocks       at most one in a thousand more than 10 % worse than the input, none twice as bad
"""
import argparse
import glob
import hashlib
import json
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor

import measure
import render
from measure import exr_sequence

BENCHMARKS = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FIGURES = ("flip", "relmse", "flicker")


class Rung:
    """One sequence at one count: its folders, its scored frames."""

    def __init__(self, scene, spp, noisy, reference, samples, frames):
        self.scene, self.spp, self.samples = scene, spp, samples
        self.noisy, self.references = exr_sequence.files(noisy), exr_sequence.files(reference)
        self.folder, self.name = noisy, f"{scene}_{spp}"
        self.frames = [n for n in sorted(self.references) if n in self.noisy and (not frames or n in frames)]

    def job(self, path, name, n, with_regions):
        share = self.spp / (self.spp + self.samples)
        return path, name, self.references[n], self.noisy[n], share, with_regions

    def state(self, files):
        """A key that changes with the scored files, their references and the code that measures."""
        paths = [p for n in self.frames for p in (files[n], self.references[n], self.noisy[n])]
        stamps = [(p, os.stat(p).st_mtime_ns, os.stat(p).st_size) for p in paths]
        return hashlib.sha256((json.dumps(stamps) + open(measure.__file__).read()).encode()).hexdigest()[:24]


def rungs(data, shared, scenes, counts, frames):
    """All that can be scored now."""
    found = []
    for scene in render.SCENES + render.VARIANTS:
        reference = os.path.join(data, scene, "reference")
        kept = os.path.join(reference, "samples.json")
        if not os.path.exists(kept):
            continue
        samples = min(json.load(open(kept)).values())
        for folder in glob.glob(os.path.join(data, scene, "noisy_*")):
            spp = int(re.search(r"\d+$", folder).group())
            if os.path.exists(os.path.join(folder, f"{scene}.{render.scored(scene)[1] + 2:04d}.exr")):
                found.append((scene, spp, folder, reference, samples))
    for scene, spp, noisy, samples in (("hall", 2, "noisy", 512), ("hall", 64, "noisy_64spp", 512), ("mitsuba_box", 4, "noisy", 1024)):
        folder = os.path.join(shared, scene)
        if os.path.isdir(os.path.join(folder, noisy)):
            found.append((scene, spp, os.path.join(folder, noisy), os.path.join(folder, "reference"), samples))
    wanted = [f for f in sorted(found) if (not scenes or f[0] in scenes) and (not counts or f[1] in counts)]
    return [r for r in (Rung(*f, frames) for f in wanted) if r.frames]


def run(arguments):
    done = subprocess.run(arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(arguments)}\n{done.stdout[-3000:]}")


def frames_text(rung):
    return f"{rung.frames[0]}-{rung.frames[-1]}"


def complete(rung, folder):
    """Result files of every scored frame that are newer than the input's?"""
    paths = {n: os.path.join(folder, os.path.basename(rung.noisy[n])) for n in rung.frames}
    return all(os.path.exists(p) and os.path.getmtime(p) > os.path.getmtime(rung.noisy[n]) for n, p in paths.items())


def filtered(rung, label, results, args):
    """Result files by frame, made where they have to be, and the seconds it took."""
    if label == "input":
        return rung.noisy, None
    folder, begin = os.path.join(results, label, rung.name), time.time()
    if label == "oidn":
        if not complete(rung, folder):
            script = os.path.join(BENCHMARKS, "oidn_exr.py")
            run([sys.executable, script, rung.folder, folder, "--frames", frames_text(rung)])
    elif not (args.keep and complete(rung, folder)):
        command = [args.quell, "denoise", rung.folder, "-o", folder, "--frames", frames_text(rung), "--overwrite", "--quiet"]
        run(command + args.arguments)
    return exr_sequence.files(folder), time.time() - begin


def score(rung, label, results, args, pool):
    """A function that gives the figures of one filter: scoring goes on while the next filter runs."""
    files, seconds = filtered(rung, label, results, args)
    cache = os.path.join(results, "scores", f"{label}-{rung.name}-{rung.state(files)}.json")
    if os.path.exists(cache):
        kept = json.load(open(cache))
        return lambda: number_keys(kept)
    rows = pool.map(measure.frame, [rung.job(files[n], None, n, True) for n in rung.frames])

    def finish():
        figures = measure.sequence(dict(zip(rung.frames, rows)))
        figures["seconds_a_frame"] = seconds / len(rung.frames) if seconds else None
        os.makedirs(os.path.dirname(cache), exist_ok=True)
        with open(cache + ".part", "w") as fh:
            json.dump(figures, fh)
        os.replace(cache + ".part", cache)
        return figures

    return finish


def number_keys(kept):
    return {k: {int(n): x for n, x in v.items()} if isinstance(v, dict) and k != "regions" else v for k, v in kept.items()}


def compare(base, figures, peer):
    """Ratios to the input, the worst of single frames, blocks, regions, and the points that do not hold."""
    ratio = {k: figures[k] / base[k] if figures[k] and base[k] else None for k in FIGURES}
    single, faults = {}, []
    for key, of in (("flip", "flip_of_frame"), ("relmse", "relmse_of_frame"), ("flicker", "flicker_from_frame")):
        worst = max(((figures[of][n] / base[of][n], n) for n in figures[of]), default=None)
        single[key] = worst
        if worst and worst[0] > 1.02:
            faults.append(f"{key} of frame {worst[1]}: {worst[0]:.2f} times the input's")
    counted, worse = measure.worse_blocks(base, figures)
    if len(worse) > counted / 1000:
        faults.append(f"blocks: {len(worse)} of {counted} more than 10 % worse")
    if worse and worse[0][0] > 2:
        faults.append("a block {:.1f} times worse than the input: frame {} at {},{}".format(*worse[0]))
    if peer:
        to_peer = sorted((figures[k] / peer[k], k) for k in FIGURES if figures[k] and peer[k])
        above = [f"{k} {v:.2f}" for v, k in to_peer if v > 1]
        if len(above) > 1 or to_peer[-1][0] > 1.1:
            faults.append("times Open Image Denoise: " + ", ".join(above))
    whole = sum(r["error"] for r in figures["regions"].values())
    region = {
        k: {"pixels": r["pixels"], "share_of_error": r["error"] / whole, "ratio": r["error"] / base["regions"][k]["error"]}
        for k, r in figures["regions"].items()
    }
    blocks = {"counted": counted, "worse": len(worse), "worst": worse[:20]}
    return {"ratio": ratio, "single": single, "blocks": blocks, "regions": region, "faults": faults}


HEAD = f"{'':16} {'spp':>4} {'':12} HDR-FLIP  relMSE     flicker | frame: FLIP  relMSE  flicker | blocks/1000   worst"


def line(rung, label, figures, found):
    show = lambda v, width, digits: format(v, f"{width}.{digits}f") if v is not None else "-".rjust(width)
    ratio, single, blocks = found["ratio"], found["single"], found["blocks"]
    times = 1 / ratio["relmse"] if ratio["relmse"] else None
    worst = [single[k][0] if single[k] else None for k in FIGURES]
    share = 1000 * blocks["worse"] / blocks["counted"] if blocks["counted"] else None
    return (
        f"{rung.scene:16} {rung.spp:4d} {label:12} {show(ratio['flip'], 8, 3)}  {show(times, 6, 2 if times and times >= 0.1 else 4)}x  {show(ratio['flicker'], 10, 3)} |"
        f" {show(worst[0], 11, 3)} {show(worst[1], 7, 3)}  {show(worst[2], 7, 3)} | {show(share, 11, 1)}"
        f" {show(blocks['worst'][0][0] if blocks['worst'] else None, 7, 2)}"
        + (f"  NOT FINITE: {figures['not_finite']}" if figures["not_finite"] else "")
    )


def crops(rung, label, results, found, count):
    """PNGs of the worst blocks with what is around them: input, result, reference."""
    folder = os.path.join(results, label, "crops")
    os.makedirs(folder, exist_ok=True)
    for factor, n, x, y in found["blocks"]["worst"][:count]:
        name = os.path.basename(rung.noisy[n])
        trio = [rung.noisy[n], os.path.join(results, label, rung.name, name), rung.references[n]]
        out = os.path.join(folder, f"{rung.name}-{n}-{x}-{y}-{factor:.1f}.png")
        window = f"{max(x - 24, 0)},{max(y - 24, 0)},64,64"
        run([sys.executable, os.path.join(BENCHMARKS, "exr_png.py"), out, *trio, "--crop", window, "--scale", "4", "--columns", "3"])


def write_report(path, report):
    """Adds the entries to the file; those of the same sequence and count are replaced."""
    os.makedirs(os.path.dirname(os.path.abspath(path)), exist_ok=True)
    kept = json.load(open(path)) if os.path.exists(path) else []
    merged = {(e["scene"], e["spp"]): e for e in [*kept, *report]}
    with open(path, "w") as fh:
        json.dump([merged[k] for k in sorted(merged)], fh, indent=1)


def arguments():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("data")
    ap.add_argument("--quell", default="quell")
    ap.add_argument("--label", default="quell", help="what this variant of quell is called")
    ap.add_argument("--only", choices=("quell", "oidn"))
    ap.add_argument("--scenes", type=lambda t: t.split(","), default=[])
    ap.add_argument("--counts", type=lambda t: [int(v) for v in t.split(",")], default=[])
    ap.add_argument("--frames", type=render.numbers, default=[], help="score only these, as 6-8")
    ap.add_argument("--shared", default=os.path.join(os.path.dirname(BENCHMARKS), "..", "shared", "frames"))
    ap.add_argument("--keep", action="store_true", help="use quell's results that exist")
    ap.add_argument("--regions", action="store_true", help="print errors by region")
    ap.add_argument("--crops", type=int, default=0, help="PNGs of so many of the worst blocks of each sequence")
    ap.add_argument("--json", help="add all figures to this file (DATA/results/LABEL.json by default)")
    ap.add_argument("--check", action="store_true", help="exit with 1 if a point does not hold")
    ours, theirs = sys.argv[1:], []
    if "--" in ours:
        at = ours.index("--")
        ours, theirs = ours[:at], ours[at + 1 :]
    args = ap.parse_args(ours)
    args.arguments = theirs
    if args.label in ("input", "oidn", "scores"):
        ap.error(f"--label {args.label} is taken")
    return args


def main():
    args = arguments()
    results = os.path.join(args.data, "results")
    labels = [args.label] * (args.only != "oidn") + ["oidn"] * (args.only != "quell")
    report, faults = [], []
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        open_jobs = []
        for rung in rungs(args.data, args.shared, args.scenes, args.counts, args.frames):
            open_jobs.append((rung, {label: score(rung, label, results, args, pool) for label in ["input", *labels]}))
        print(HEAD)
        for rung, waiting in open_jobs:
            figures = {label: finish() for label, finish in waiting.items()}
            entry = {"scene": rung.scene, "spp": rung.spp, "reference_spp": rung.samples, "filters": {}}
            for label, own in figures.items():
                found = compare(figures["input"], own, figures.get("oidn") if label == args.label else None)
                entry["filters"][label] = {k: own[k] for k in (*FIGURES, "seconds_a_frame") if k in own} | found
                if label == "input":
                    continue
                print(line(rung, label, own, found), flush=True)
                if args.regions:
                    print("\n".join(f"{'':22}{k:22} {v['share_of_error']:6.1%} of the error, {1 / v['ratio']:6.2f}x" for k, v in found["regions"].items()))
                if label == args.label:
                    faults += [f"{rung.scene} {rung.spp}: {text}" for text in found["faults"]]
                    crops(rung, label, results, found, args.crops)
            report.append(entry)
    path = args.json or os.path.join(results, f"{args.label}.json")
    write_report(path, report)
    if args.check:
        print("\n".join(["", f"{len(faults)} points do not hold:", *faults]) if faults else "\nall points hold")
        return 1 if faults else 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
