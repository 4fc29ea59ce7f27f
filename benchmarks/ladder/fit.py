"""Coordinate search for parameters of the sequence filter, on sequences that nothing is reported on.

    python3 benchmarks/ladder/fit.py DATA --quell target/release/quell --on workshop:4,workshop:64,harbour:4,drawn/101:4 \
        gather.matte_decay=0.88+0.02 wavelet.matte=2.2*1.2 gather.frames=6+1

DATA is what `render.py` made; `drawn/N` are scenes drawn by chance, in DATA/drawn/N/noisy_COUNT and DATA/drawn/N/reference
(`../nets/README.md` has the commands). A parameter is NAME=START+STEP or NAME=START*FACTOR; names joined by `,` move together.
Each is moved up, then down, as far as the score falls by more than --least; then the next; factors shrink from round to round.
It ends when a whole round moves nothing.

The score is the mean over the sequences of log(HDR-FLIP) + 0.2 log(relMSE) + 0.3 log(flicker), each over the input's. Needs what
`ladder.py` needs. Two sequences are filtered at a time, on one thread each: 30 s a step for 13 sequences of 256x144.
"""
import argparse
import json
import math
import os
import re
import shutil
import subprocess
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import ladder
import measure
from measure import exr_sequence

WEIGHTS = {"flip": 1.0, "relmse": 0.2, "flicker": 0.3}


class Parameter:
    def __init__(self, text):
        found = re.fullmatch(r"([\w.,]+)=([-\d.e]+)([+*])([\d.e]+)", text)
        if not found:
            raise argparse.ArgumentTypeError(f"NAME=START+STEP or NAME=START*FACTOR, not {text}")
        names, start, self.kind, step = found.groups()
        self.names, self.step = names.split(","), float(step)
        self.whole = self.kind == "+" and "." not in start + step
        self.value = float(start)

    def moved(self, direction):
        return self.value * self.step**direction if self.kind == "*" else self.value + direction * self.step

    def arguments(self):
        shown = int(self.value) if self.whole else round(self.value, 6)
        return [word for name in self.names for word in ("--set", f"{name}={shown}")]

    def __str__(self):
        return f"{','.join(self.names)}={self.value:.4g}"


class Search:
    def __init__(self, args, pool):
        self.args, self.pool = args, pool
        self.rungs = [self.rung(*text.rsplit(":", 1)) for text in args.on.split(",")]
        self.base = {r.name: self.figures(r, r.noisy) for r in self.rungs}

    def rung(self, scene, count):
        folder = os.path.join(self.args.data, scene)
        reference, kept = os.path.join(folder, "reference"), os.path.join(folder, "reference", "samples.json")
        samples = min(json.load(open(kept)).values()) if os.path.exists(kept) else self.args.drawn_samples
        return ladder.Rung(scene, int(count), os.path.join(folder, f"noisy_{count}"), reference, samples, [])

    def figures(self, rung, files):
        rows = list(self.pool.map(measure.frame, [rung.job(files[n], None, n, False) for n in rung.frames]))
        return measure.sequence(dict(zip(rung.frames, rows)))

    def score(self, parameters):
        """Of the parameters as they are, and the figures of each sequence."""
        settings = [word for p in parameters for word in p.arguments()] + self.args.arguments

        def run(rung):
            folder = os.path.join(self.args.data, "results", "fit", rung.name)
            shutil.rmtree(folder, ignore_errors=True)
            command = [self.args.quell, "denoise", rung.folder, "-o", folder, "--frames", ladder.frames_text(rung), "--quiet"]
            subprocess.run([*command, "--threads", "1", *settings], check=True, stdout=subprocess.DEVNULL)
            return exr_sequence.files(folder)

        with ThreadPoolExecutor(2) as threads:
            made = list(threads.map(run, self.rungs))
        total, found = 0.0, {}
        for rung, files in zip(self.rungs, made):
            figures, base = self.figures(rung, files), self.base[rung.name]
            ratios = {k: figures[k] / base[k] for k in WEIGHTS if figures[k] and base[k]}
            total += sum(WEIGHTS[k] * math.log(v) for k, v in ratios.items())
            found[rung.name] = " ".join(f"{v:.3f}" for v in ratios.values())
        return total / len(self.rungs), found

    def run(self, parameters):
        begin = time.time()
        best, found = self.score(parameters)
        print(f"{best:.5f} to begin with, {time.time() - begin:.0f} s a step: {found}", flush=True)
        for number in range(self.args.rounds):
            before = best
            for p in parameters:
                for direction in (1, -1):
                    before_this = best
                    while True:
                        old, p.value = p.value, p.moved(direction)
                        if p.value < 0:
                            p.value = old
                            break
                        score, now = self.score(parameters)
                        print(f"    {p}: {score:.5f} ({score - best:+.5f})", flush=True)
                        if score > best - self.args.least:
                            p.value = old
                            break
                        best, found = score, now
                    if best < before_this:
                        break
            print(f"{best:.5f} after round {number + 1}: {' '.join(map(str, parameters))} {found}", flush=True)
            if best == before:
                break
            for p in parameters:
                p.step **= 0.6 if p.kind == "*" else 1


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("data")
    ap.add_argument("parameters", nargs="+", type=Parameter)
    ap.add_argument("--quell", default="quell")
    ap.add_argument("--on", required=True, help="sequences, as workshop:4,drawn/101:64")
    ap.add_argument("--drawn-samples", type=int, default=384, help="of references without a samples.json")
    ap.add_argument("--set", dest="arguments", action="append", default=[], help="NAME=VALUE, kept as it is")
    ap.add_argument("--rounds", type=int, default=3)
    ap.add_argument("--least", type=float, default=3e-4, help="by which the score has to fall")
    args = ap.parse_args()
    args.arguments = [word for text in args.arguments for word in ("--set", text)]
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        Search(args, pool).run(args.parameters)


if __name__ == "__main__":
    main()
