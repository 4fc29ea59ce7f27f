"""Make the ladder's sequences: each scene at rising sample counts, and references for its middle frames.

    python3 benchmarks/ladder/render.py DATA [--scenes yard,night] [--rounds 1,2] [--threads 2] [--list]

Needs `pip install bpy==5.0.1 OpenEXR numpy` (Python 3.11), for the scene `mitsuba` also `mitsuba==3.9.1`. What exists is left
alone, so an interrupted run goes on, and a finished one does nothing. One renderer runs at a time. The order is such that
the run can be used early: a first round of 4 and 64 samples and a short reference for each scene, then 16, then 256.

    DATA/SCENE/noisy_SPP/SCENE.####.exr      all passes
    DATA/SCENE/pieces/SPP-K/SCENE.####.exr   independent references of SPP samples, seeds K * 100000 + frame
    DATA/SCENE/reference/SCENE.####.exr      their weighted mean, `Combined`, and the estimated `variance` of that mean
    DATA/SCENE/reference/samples.json        how many samples each reference has by now
"""
import argparse
import glob
import json
import os
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
SCENES = ("yard", "night", "mitsuba", "harbour", "kitchen", "workshop")
# depth of field, fog, motion blur: rendered only where --scenes names them
VARIANTS = ("yard-f14", "yard-fog", "yard-blur", "kitchen-blur", "harbour-blur")
LAST = {"workshop": 8}
SCORED = {"workshop": (4, 6)}
COUNTS = {"workshop": (2, 4, 16, 64)}
# independent references (samples, number), by round: 256 samples to begin with, then 768, then 2048
PIECES = (((256, 2),), ((256, 3), (256, 4)), ((512, 1), (512, 5), (256, 6)))


def numbers(text):
    """`1-4,7` -> [1, 2, 3, 4, 7]"""
    ranges = [(part.split("-") * 2)[:2] for part in text.split(",")]
    return [n for first, last in ranges for n in range(int(first), int(last) + 1)]


def scored(scene):
    """First and last frame with a reference."""
    return SCORED.get(scene, (6, 8))


def last_frame(scene):
    return LAST.get(scene, 12)


def jobs(scenes, rounds):
    """(scene, folder, samples, piece or None, frames), first things first."""
    level = lambda scene, spp, first, last: (scene, f"noisy_{spp}", spp, None, range(first, last + 1))
    pieces = lambda scene, k: [(scene, f"pieces/{spp}-{n}", spp, n, range(scored(scene)[0], scored(scene)[1] + 1)) for spp, n in PIECES[k]]
    for k in rounds:
        for scene in scenes:
            for spp in COUNTS.get(scene, (4, 16, 64)):
                if k == (2 if spp == 16 else 1):
                    yield level(scene, spp, 1, last_frame(scene))
            if k == 3:
                # the dearest level: two frames more on either side than are scored
                first, last = scored(scene)
                yield level(scene, 256, max(first - 2, 1), min(last + 2, last_frame(scene)))
            yield from pieces(scene, k - 1)


def missing(data, job):
    scene, folder, _, _, frames = job
    return [n for n in frames if not os.path.exists(os.path.join(data, scene, folder, f"{scene}.{n:04d}.exr"))]


def command(data, job, frames, threads):
    scene, folder, spp, piece, _ = job
    maker = "make_mitsuba.py" if scene == "mitsuba" else "../blender/make_sequence.py"
    kind = ["--kind", "noisy"] if piece is None else ["--kind", "reference", "--piece", str(piece)]
    base, _, variant = scene.partition("-")
    which = [] if scene == "mitsuba" else ["--scene", base, "--variant", variant or "plain"]
    return [
        sys.executable, os.path.join(HERE, maker), *which, *kind, "--spp", str(spp), "--threads", str(threads),
        "--frames", ",".join(map(str, frames)), "--out", os.path.join(data, scene, folder),
    ]  # fmt: skip


def join_pieces(data, scene):
    """The mean of a frame's pieces, weighted by samples, and its variance by their differences, where a piece is newer than the mean."""
    import numpy as np

    import exr_sequence

    kept = os.path.join(data, scene, "reference", "samples.json")
    samples = json.load(open(kept)) if os.path.exists(kept) else {}
    for n in range(scored(scene)[0], scored(scene)[1] + 1):
        name = f"{scene}.{n:04d}.exr"
        found = sorted(glob.glob(os.path.join(data, scene, "pieces", "*-*", name)))
        out = os.path.join(data, scene, "reference", name)
        if not found or (os.path.exists(out) and os.path.getmtime(out) > max(map(os.path.getmtime, found))):
            continue
        counts = np.array([int(path.split(os.sep)[-2].split("-")[0]) for path in found], np.float64)
        weights = (counts / counts.sum())[:, None, None, None]
        parts = np.array([exr_sequence.beauty(path) for path in found], np.float64)
        mean = (weights * parts).sum(0)
        passes = {"Combined": mean}
        if len(found) > 1:
            # every piece's variance is s / its count, so the weighted squares estimate s, and the mean's variance is s / all
            passes["variance"] = (weights * (parts - mean) ** 2).sum(0) / (len(found) - 1)
        os.makedirs(os.path.dirname(out), exist_ok=True)
        exr_sequence.write(out + ".part.exr", passes, half=False)
        os.replace(out + ".part.exr", out)
        samples[str(n)] = int(counts.sum())
        with open(kept, "w") as fh:
            json.dump(samples, fh)


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("data")
    ap.add_argument("--scenes", default=",".join(SCENES))
    ap.add_argument("--rounds", default="1,2,3", help="1: 4 and 64 samples and a first reference; 2: 16 samples, references of 768; 3: 256, of 2048")
    ap.add_argument("--threads", type=int, default=2)
    ap.add_argument("--no-pieces", action="store_true", help="no references this time")
    ap.add_argument("--list", action="store_true", help="print what is missing and make nothing")
    a = ap.parse_args()
    for job in jobs(a.scenes.split(","), [int(k) for k in a.rounds.split(",")]):
        if a.no_pieces and job[3] is not None:
            continue
        frames = missing(a.data, job)
        if a.list:
            print(f"{job[0]:10} {job[1]:10} {'missing ' + ','.join(map(str, frames)) if frames else 'complete'}")
            continue
        if frames:
            begin = time.time()
            subprocess.run(command(a.data, job, frames, a.threads), check=True, stdout=subprocess.DEVNULL)
            seconds = (time.time() - begin) / len(frames)
            print(f"{time.strftime('%H:%M')} {job[0]} {job[1]}: {seconds:.1f} s a frame", flush=True)
        if job[3] is not None:
            join_pieces(a.data, job[0])


if __name__ == "__main__":
    main()
