#!/usr/bin/env python3
"""Instructions that each stage takes, counted by valgrind: a figure that no other load of the machine moves.

    python3 benchmarks/instructions.py target/release/quell            # compares with benchmarks/instructions.json
    python3 benchmarks/instructions.py target/release/quell --write    # writes that file anew

Runs `quell bench` of both filters on one thread under callgrind, on small frames made in memory. Valgrind's processor has AVX2 and
fused multiply-add and no AVX-512, so that counts are those of that level on every machine that has it. A count is what a stage's
function and all that it calls took, in the whole run. Exit status 1 where a stage takes more than the margin (3 %) more than the file
says, or is not found; a stage that takes less by as much is named, so that the file is written anew. Counts are of one version of the
compiler: with another one, without valgrind, or on a processor without AVX2, nothing is compared (SKIPPED). Standard library only; about
60 processor seconds.
"""
import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

FILE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "instructions.json")

# Arguments of `bench`; of each stage the function whose count is taken, which the compiler must not have inlined: those of the sequence filter
# are entries of a table of pointers (cpu/sequence.rs), those of the real-time filter walk over rows, or do a row.
RUNS = {
    "sequence": (
        ["--sequence", "--size", "128x48", "--count", "1"],
        {
            "prepare": "quell::window::prepared::PreparedFrame::new",
            "reflection_motion": "quell::stages::reflection_motion::cpu::run",
            "gather": "quell::stages::gather::cpu::run",
            "feature_noise": "quell::stages::feature_noise::cpu::run",
            "variance": "quell::cpu::passes::variance::run",
            "wavelet": "quell::cpu::passes::wavelet::run",
            "residual": "quell::stages::residual::cpu::run",
            "residual: picture": "quell::stages::residual::cpu::picture",
            "recombine: sum": "quell::stages::recombine::cpu::sum",
            "stabilise: signature": "quell::stages::stabilise::joint::signature",
            "blend: trajectories": "quell::stages::blend::over_time::along",
            "stabilise": "quell::cpu::passes::stabilise::run",
            "blend": "quell::stages::blend::cpu::run",
            "recombine: rescale": "quell::stages::recombine::cpu::rescale",
        },
    ),
    "paper": (
        ["--preset", "paper", "--backend", "cpu", "--size", "320x180", "--count", "3"],
        {
            "all stages": "quell::cpu::Cpu::run",
            "temporal": "quell::cpu::passes::temporal::run",
            "firefly": "quell::cpu::passes::firefly::run::{{closure}}",
            "sparse_bilateral": "quell::cpu::passes::sparse_bilateral::run::{{closure}}",
            "glossy_bilateral": "quell::cpu::passes::glossy_bilateral::run::{{closure}}",
        },
    ),
    "quality": (
        ["--preset", "quality", "--backend", "cpu", "--size", "320x180", "--count", "3", "--jitter"],
        {
            "all stages": "quell::cpu::Cpu::run",
            "changed_light": "quell::cpu::passes::change::run",
            "temporal": "quell::cpu::passes::temporal::run",
            "young_filter": "quell::cpu::passes::young_filter::run",
            "antialiasing": "quell::cpu::passes::antialiasing::run",
        },
    ),
}


def compiler():
    """The compiler's version, e.g. 1.95.0; empty where there is none."""
    try:
        said = subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return ""
    return said.split()[1] if len(said.split()) > 1 else ""


def has_avx2():
    """True where valgrind's processor will have what the level needs: it offers no more than the machine's own."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            flags = next((line.split() for line in file if line.startswith("flags")), [])
    except OSError:
        return False
    return {"avx2", "fma", "f16c"} <= set(flags)


def inclusive(path):
    """Of each function that is called, what all its calls took; the total of the run."""
    names, counts, total = {}, {}, 0
    callee, line_of_call = None, False
    with open(path, encoding="utf-8", errors="replace") as lines:
        for line in lines:
            if line_of_call:
                counts[callee] = counts.get(callee, 0) + int(line.split()[1])
                line_of_call = False
            elif found := re.match(r"(c?fn)=\((\d+)\)(?: (.*))?$", line):
                kind, number, name = found.groups()
                if name:
                    names[number] = name
                if kind == "cfn":
                    callee = number
            elif line.startswith("calls="):
                line_of_call = True
            elif line.startswith("totals:"):
                total = int(line.split()[1])
    by_name = {}
    for number, count in counts.items():
        name = names.get(number, "?")
        by_name[name] = by_name.get(name, 0) + count
    return by_name, total


def count(program, arguments, stages, folder):
    """Instructions of each stage, and of the whole run; absent where the function was not found."""
    out = os.path.join(folder, "callgrind.out")
    command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", "-q", program, "bench", *arguments]
    done = subprocess.run([*command, "--threads", "1", "--bandwidth", "10"], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: status {done.returncode}\n{done.stderr[-4000:]}")
    by_name, total = inclusive(out)
    found = {}
    for stage, function in stages.items():
        if function in by_name:
            found[stage] = by_name[function]
    return found, total


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("program")
    parser.add_argument("--write", action="store_true", help="write the file anew")
    parser.add_argument("--margin", type=float, default=3.0, metavar="PERCENT", help="default 3")
    options = parser.parse_args()
    version = compiler()
    if shutil.which("valgrind") is None:
        print("SKIPPED: no valgrind")
        return 0
    if not has_avx2():
        print("SKIPPED: no AVX2")
        return 0
    known = {}
    if not options.write:
        with open(FILE, encoding="utf-8") as file:
            known = json.load(file)
        if known["rustc"] != version:
            print(f"SKIPPED: counts are of rustc {known['rustc']}, this is {version or 'none'}")
            return 0
    written, worse, better = {"rustc": version}, [], []
    with tempfile.TemporaryDirectory() as folder:
        for run, (arguments, stages) in RUNS.items():
            found, total = count(os.path.abspath(options.program), arguments, stages, folder)
            written[run] = {"arguments": " ".join(arguments), "instructions": found}
            before = known.get(run, {}).get("instructions", {})
            print(f"{run}: bench {' '.join(arguments)}, {total / 1e6:.0f} million instructions")
            for stage in stages:
                if stage not in found:
                    worse.append(f"{run} {stage}: its function {stages[stage]} is not called; name it anew in {__file__}")
                    continue
                text = f"  {stage:<22} {found[stage] / 1e6:10.2f} million"
                if stage in before:
                    change = 100.0 * (found[stage] / before[stage] - 1.0)
                    text += f"  {change:+6.2f} %"
                    if abs(change) > options.margin:
                        list_ = worse if change > 0.0 else better
                        list_.append(f"{run} {stage}: {before[stage]} -> {found[stage]} instructions, {change:+.1f} %")
                elif not options.write:
                    worse.append(f"{run} {stage}: not in {FILE}")
                print(text)
    if options.write:
        with open(FILE, "w", encoding="utf-8") as file:
            json.dump(written, file, indent=1)
            file.write("\n")
        print(f"written: {FILE}")
    for line in better:
        print(f"fewer: {line}; write the file anew with --write")
    for line in worse:
        print(f"MORE: {line}")
    if worse:
        print(f"more than {options.margin} % above the file; where the work grew on purpose, write it anew with --write")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
