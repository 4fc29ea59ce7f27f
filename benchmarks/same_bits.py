#!/usr/bin/env python3
"""Hashes of what a build of quell writes: two builds give the same list where no bit of any picture changed.

    python3 benchmarks/same_bits.py target/release/quell before.txt
    python3 benchmarks/same_bits.py target/release/quell after.txt --compare before.txt

Each line is `HASH  CASE/FILE`. Of EXR files the channels, the window, the compression and the stored pixels count; the other
attributes (which hold paths, times and versions) do not, nor how well ZIP did. Of PNG files all but that counts. Standard library only; half a
minute on two cores. Cases that need frames which are not there are printed as SKIPPED; exit status 1 where a case fails
or, with --compare, where a line differs.
"""
import argparse
import hashlib
import os
import struct
import subprocess
import sys
import tempfile
import zlib

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FRAMES = os.path.join(ROOT, "..", "shared", "frames")
HALL = os.path.join(FRAMES, "hall", "noisy")
BOX = os.path.join(FRAMES, "mitsuba_box", "noisy")
SMALL = ["--size", "160x90", "--count", "4"]
# What shapes the pixels of an EXR file; the other attributes name programs, paths and settings.
COUNTED = {b"channels", b"compression", b"dataWindow", b"displayWindow", b"type", b"lineOrder", b"tiles"}

# name, what must exist, arguments; {out} is the case's folder, {top} the folder of all cases. Later cases read earlier ones.
CASES = [
    ("hall", HALL, ["denoise", HALL, "-o", "{out}"]),
    # A part of the picture at a time, on frames that wait in a file: the lists of hall and hall-bands are the same. The filter with its
    # convolutional net takes 446 MiB at the least (its bands need 20 rows more on either side), 499 at once.
    ("hall-bands", HALL, ["denoise", HALL, "-o", "{out}", "--max-memory", "480M", "--frames", "5"]),
    ("hall-past", HALL, ["denoise", HALL, "-o", "{out}", "--history", "past", "--frames", "6", "--backend", "cpu"]),
    ("mitsuba-box", BOX, ["denoise", BOX, "-o", "{out}"]),
    ("demo", None, ["demo", "-o", "{out}", "--size", "240x136", "--count", "6", "--exr"]),
    ("mirror-hall", None, ["render", "mirror-hall", "-o", "{out}", "--spp", "2", "--replacement", "glass", *SMALL]),
    ("disocclusion", None, ["render", "disocclusion", "-o", "{out}", "--jitter", *SMALL]),
    ("mirror-hall-sequence", None, ["denoise", "{top}/mirror-hall/noisy", "-o", "{out}"]),
]


def unpacked(data, at, attributes, multipart):
    """The bytes of one chunk's pixels, as ZIP sees them, with its place; where the next chunk begins."""
    tiled = b"tiles" in attributes
    head = (4 if multipart else 0) + (16 if tiled else 4)
    place, length = data[at : at + head], struct.unpack_from("<i", data, at + head)[0]
    at += head + 4
    packed = data[at : at + length]
    if attributes[b"compression"][-1] in (2, 3):
        try:
            packed = zlib.decompress(packed)
        except zlib.error:
            # Kept as it is, since ZIP would make it no shorter.
            apart = packed[0::2] + packed[1::2]
            packed = apart[:1] + bytes((b - a + 128) & 255 for a, b in zip(apart, apart[1:]))
    return place + packed, at + length


def exr_pixels(data):
    """The bytes of an EXR file that say what its pixels are, however well ZIP did."""
    flags = struct.unpack_from("<I", data, 4)[0]
    at, kept, parts, chunks = 8, [], [], 0
    while True:
        counted = {}
        start = at
        while data[at] != 0:
            end = data.index(b"\0", at)
            name, at = data[at:end], end + 1
            end = data.index(b"\0", at)
            kind, at = data[at:end], end + 1
            length = struct.unpack_from("<i", data, at)[0]
            value, at = data[at + 4 : at + 4 + length], at + 4 + length
            counted[name] = kind + b"\0" + value
        at += 1
        empty = at == start + 1
        if not empty:
            parts.append(counted)
            kept += [n + b"\0" + v for n, v in sorted(counted.items()) if n in COUNTED]
            chunks += chunk_count(counted)
        if empty or not flags & 0x1000:
            break
    multipart = bool(flags & 0x1000)
    at += 8 * chunks
    for _ in range(chunks):
        part = struct.unpack_from("<i", data, at)[0] if multipart else 0
        pixels, at = unpacked(data, at, parts[part], multipart)
        kept.append(pixels)
    return b"".join(kept)


def chunk_count(attributes):
    """Chunks of a part: what it says, else from the window and the compression of scan lines."""
    if b"chunkCount" in attributes:
        return struct.unpack("<i", attributes[b"chunkCount"][-4:])[0]
    window = struct.unpack("<4i", attributes[b"dataWindow"][-16:])
    rows = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32, 5: 16, 6: 32, 7: 32, 8: 32, 9: 256}[attributes[b"compression"][-1]]
    return -(-(window[3] - window[1] + 1) // rows)


def png_pixels(data):
    """The bytes of a PNG file that say what its pixels are, however well deflate did."""
    at, kept, packed = 8, [], []
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + length]
        (packed if kind == b"IDAT" else kept).append(body)
        at += 12 + length
    return b"".join(kept) + zlib.decompress(b"".join(packed))


def hash_of(path):
    with open(path, "rb") as file:
        data = file.read()
    pixels = exr_pixels(data) if path.endswith(".exr") else png_pixels(data)
    return hashlib.sha256(pixels).hexdigest()[:32]


def pictures(folder):
    """The pictures below a folder, sorted, relative to it."""
    found = []
    for where, _, names in os.walk(folder):
        found += [os.path.relpath(os.path.join(where, n), folder) for n in names if n.endswith((".exr", ".png"))]
    return sorted(found)


def run(binary, top):
    """Runs every case; the lines of the list, and whether all succeeded."""
    lines, good = [], True
    for name, needs, arguments in CASES:
        if needs is not None and not os.path.isdir(needs):
            print(f"SKIPPED {name}: {os.path.relpath(needs, ROOT)} is not there")
            lines.append(f"SKIPPED  {name}")
            continue
        out = os.path.join(top, name)
        words = [binary, *(w.format(out=out, top=top) for w in arguments)]
        done = subprocess.run(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace")
        found = pictures(out)
        if done.returncode != 0 or not found:
            print(f"FAILED {name}: status {done.returncode}, {len(found)} pictures\n{done.stderr[-2000:]}")
            lines.append(f"FAILED  {name}")
            good = False
            continue
        print(f"{name}: {len(found)} pictures", flush=True)
        lines += [f"{hash_of(os.path.join(out, picture))}  {name}/{picture}" for picture in found]
    return lines, good


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("binary")
    ap.add_argument("out")
    ap.add_argument("--compare", metavar="LIST", help="a list of before: exit status 1 where a line differs")
    a = ap.parse_args()
    with tempfile.TemporaryDirectory() as top:
        lines, good = run(os.path.abspath(a.binary), top)
    with open(a.out, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")
    if a.compare:
        with open(a.compare, encoding="utf-8") as file:
            before = file.read().splitlines()
        for line in sorted(set(before) ^ set(lines), key=lambda l: l.split("  ")[1]):
            print(("- " if line in before else "+ ") + line)
        good &= before == lines
        print(f"{len(lines)} lines, " + ("all the same" if before == lines else "NOT the same"))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
