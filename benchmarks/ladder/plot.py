"""Curves of error over samples, an SVG with one panel a sequence, from the JSON files that `ladder.py` writes.

    python3 benchmarks/ladder/plot.py OUT.svg DATA/results/quell.json [MORE.json ...] [--figure relmse|flip|flicker] [--columns 4]
    python3 benchmarks/ladder/plot.py - DATA/results/quell.json --table

`--table` prints the ratios to the input as a Markdown table instead of drawing: HDR-FLIP, relMSE times lower, flicker.

Both axes are logarithmic. The input, Open Image Denoise, and quell under the label that it was scored with; further files
add further labels. Needs nothing but Python.
"""
import argparse
import json
import math

COLORS = {"input": "#808080", "oidn": "#d1710f"}
NAMES = {"input": "input", "oidn": "Open Image Denoise, best"}
OWN = ("#1f6fd1", "#2e9e5b", "#a04fc4", "#c43f5a")
TITLES = {"relmse": "relMSE", "flip": "HDR-FLIP", "flicker": "flicker"}
WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 230, 190, 44, 26, 10, 30


def curves(paths, figure):
    """{scene: {label: {samples: error}}} of the scenes with more than one count."""
    found = {}
    for path in paths:
        for entry in json.load(open(path)):
            for label, figures in entry["filters"].items():
                if figures[figure]:
                    found.setdefault(entry["scene"], {}).setdefault(label, {})[entry["spp"]] = figures[figure]
    return {scene: lines for scene, lines in found.items() if len({n for line in lines.values() for n in line}) > 1}


def ticks(low, high):
    """Powers of ten, or of two where these are fewer than two."""
    tens = [10.0**k for k in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1) if low <= 10.0**k <= high]
    return tens if len(tens) > 1 else [2.0**k for k in range(-20, 8) if low <= 2.0**k <= high]


def panel(scene, lines, colors, x0, y0):
    counts = sorted({n for line in lines.values() for n in line})
    values = [v for line in lines.values() for v in line.values()]
    low, high = min(values) / 1.3, max(values) * 1.3
    first, last = math.log2(min(counts)) - 0.3, math.log2(max(counts)) + 0.3
    w, h = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM
    at_x = lambda n: x0 + LEFT + w * (math.log2(n) - first) / (last - first)
    at_y = lambda v: y0 + TOP + h * (1 - math.log(v / low) / math.log(high / low))
    out = [f'<text x="{x0 + LEFT}" y="{y0 + 17}" font-weight="bold">{scene}</text>']
    for v in ticks(low, high):
        y = at_y(v)
        out.append(f'<path d="M{x0 + LEFT} {y:.1f}h{w}" class="g"/><text x="{x0 + LEFT - 4}" y="{y + 3.5:.1f}" text-anchor="end">{v:.3g}</text>')
    for n in counts:
        out.append(f'<path d="M{at_x(n):.1f} {y0 + TOP}v{h}" class="g"/><text x="{at_x(n):.1f}" y="{y0 + TOP + h + 14}" text-anchor="middle">{n}</text>')
    for label, line in lines.items():
        points = [(at_x(n), at_y(v)) for n, v in sorted(line.items())]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        out.append(f'<polyline points="{path}" fill="none" stroke="{colors[label]}" stroke-width="2"/>')
        out += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.6" fill="{colors[label]}"/>' for x, y in points]
    return out


def times(ratio):
    """relMSE "times lower" with as many digits as say something."""
    t = 1 / ratio
    return f"{t:.0f}" if t >= 20 else f"{t:.1f}" if t >= 2 else f"{t:.2f}" if t >= 0.05 else f"{t:.4f}"


def table(paths):
    """Rows of a sequence and count; each filter's three ratios, and of quell the share of blocks that are worse."""
    entries, labels = {}, []
    for path in paths:
        for entry in json.load(open(path)):
            entries.setdefault((entry["scene"], entry["spp"]), {}).update(entry["filters"])
            labels += [label for label in entry["filters"] if label != "input" and label not in labels]
    own = [label for label in labels if label != "oidn"]
    head = [*own, "Open Image Denoise", *(f"{label}: worse blocks of 1000, worst" for label in own)]
    print("| sequence, samples | " + " | ".join(head) + " |\n|---|" + "---|" * len(head))
    for (scene, spp), filters in sorted(entries.items()):
        cells = []
        for label in [*own, "oidn"]:
            r = filters[label]["ratio"] if label in filters else None
            cells.append("-" if r is None else f"{r['flip']:.3f} / {times(r['relmse'])} / {r['flicker']:.3f}")
        for label in own:
            b = filters[label]["blocks"] if label in filters else {"counted": 0}
            share = f"{1000 * b['worse'] / b['counted']:.1f}" if b["counted"] else "-"
            cells.append(share + (f", {b['worst'][0][0]:.1f}" if b["counted"] and b["worst"] else ""))
        print(f"| `{scene}`, {spp} | " + " | ".join(cells) + " |")


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("out")
    ap.add_argument("files", nargs="+")
    ap.add_argument("--figure", choices=tuple(TITLES), default="relmse")
    ap.add_argument("--columns", type=int, default=4)
    ap.add_argument("--table", action="store_true")
    a = ap.parse_args()
    if a.table:
        table(a.files)
        return
    found = curves(a.files, a.figure)
    labels = list(dict.fromkeys(label for lines in found.values() for label in lines))
    own = [label for label in labels if label not in COLORS]
    colors = COLORS | dict(zip(own, OWN))
    rows = -(-len(found) // a.columns)
    width, height = a.columns * WIDTH, rows * HEIGHT + 30
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="10.5" fill="#333">',
        "<style>.g{stroke:#ddd;fill:none}</style>",
        f'<rect width="{width}" height="{height}" fill="#fff"/>',
    ]
    for i, (scene, lines) in enumerate(found.items()):
        out += panel(scene, lines, colors, (i % a.columns) * WIDTH, (i // a.columns) * HEIGHT)
    x = LEFT
    for label in labels:
        name = NAMES.get(label, label)
        out.append(f'<path d="M{x} {height - 14}h18" stroke="{colors[label]}" stroke-width="2"/><text x="{x + 23}" y="{height - 10}">{name}</text>')
        x += 45 + 6 * len(name)
    out.append(f'<text x="{width - RIGHT}" y="{height - 10}" text-anchor="end">{TITLES[a.figure]} over samples a pixel</text></svg>')
    with open(a.out, "w") as fh:
        fh.write("\n".join(out) + "\n")


if __name__ == "__main__":
    main()
