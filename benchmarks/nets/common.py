"""What the training scripts of the nets share: data, losses, figures, and the weights as Rust."""
import glob
import os
import re
import sys

import numpy as np
import torch
from torch import nn

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import exr_sequence

# A pixel counts at most this many times the mean error of the best candidate: single glints would decide alone.
MOST = 30.0


def layers(inputs, hidden, outputs):
    sizes = [inputs, *hidden, outputs]
    return nn.ModuleList([nn.Linear(a, b) for a, b in zip(sizes, sizes[1:])])


def run(net, x):
    for layer in net[:-1]:
        x = torch.relu(layer(x))
    return net[-1](x)


def references(ladder, scene, count):
    """Pictures by frame. Where a sequence of few samples lacks a reference, its rendering at 64 samples is one: noisier, but independent."""
    found = {}
    for folder in ("noisy_64", "reference") if int(count.split("_")[1]) <= 4 else ("reference",):
        path = os.path.join(ladder, scene, folder)
        found.update(exr_sequence.files(path) if os.path.isdir(path) else {})
    return found


def drawn(views):
    """Names of the scenes drawn by chance, and of every seventh, which no training sees."""
    numbers = sorted((int(os.path.basename(p)) for p in glob.glob(os.path.join(views, "drawn", "*"))))
    names = [os.path.join("drawn", str(n)) for n in numbers]
    return names, names[::7]


def expanded(views, scenes):
    """`drawn` replaced by the names of all of them."""
    return [name for scene in scenes for name in (drawn(views)[0] if scene == "drawn" else [scene])]


def sequences(views, ladder, scenes, load):
    """{(scene, count): load(folder of views, references)} of what there is; `drawn`: all of its scenes."""
    found = {}
    for scene in expanded(views, scenes):
        folder = os.path.join(views, scene)
        for count in sorted(os.listdir(folder)) if os.path.isdir(folder) else ():
            data = load(os.path.join(folder, count), references(ladder, scene, count))
            if data:
                found[scene, count] = data
    return found


def shares(text):
    """`harbour:0.4,night` -> {"harbour": 0.4, "night": 1.0}"""
    return {name: float(share or 1) for name, _, share in (part.partition(":") for part in text.split(",")) if name}


def read_rust(path):
    """The layers of a net that `rust` wrote."""
    text = open(path).read()
    text = text[text.index("first:") :]
    rows = [[float(v) for v in row.split(",")] for row in re.findall(r"\[(-?\d[^\[\]]*)\]", text)]
    found, layer = nn.ModuleList(), []
    for row in rows:
        layer.append(row)
        # A layer's rows are as many as the layer before has outputs, then what it adds.
        if len(layer) > (found[-1].out_features if found else text[: text.index("], [")].count("[") - 1):
            one = nn.Linear(len(layer) - 1, len(row))
            one.weight, one.bias = (nn.Parameter(torch.tensor(np.array(v, np.float32)), False) for v in (np.transpose(layer[:-1]), row))
            found.append(one)
            layer = []
    return found


def relative(x, r):
    return ((x - r) ** 2 / (r**2 + 0.01)).mean(-1)


def logarithm(x):
    return torch.log2(1 + torch.clamp(x.mean(-1), min=0))


def figures(x, r):
    """Relative squared error without its largest thousandth, error of the logarithm, absolute error relative to the light."""
    error = relative(x, r).flatten().sort()[0]
    change = (logarithm(x) - logarithm(r)).square().mean().sqrt()
    return float(error[: int(len(error) * 0.999)].mean()), float(change), float(((x - r).abs() / (r + 0.1)).mean())


def compressed(error):
    return MOST * torch.log1p(error / MOST)


def loss(x, r, base, flicker=4.0):
    """Of each pixel, in units of the best candidate's `figures`. The error of the logarithm stands for flicker."""
    squared = compressed(relative(x, r) / base[..., 0])
    change = compressed((logarithm(x) - logarithm(r)) ** 2 / base[..., 1] ** 2)
    absolute = ((x - r).abs() / (r + 0.1)).mean(-1) / base[..., 2]
    return squared + flicker * change + absolute + 0.3 * torch.sqrt(squared + 1e-6)


def line(base, found):
    """Figures of a result as ratios to the input's: relMSE times lower, the others as they are."""
    return f"{base[0] / found[0]:7.2f} {found[1] / base[1]:6.3f} {found[2] / base[2]:6.3f}"


def rust(net, scale, declaration, uses, path, script):
    """Writes `static NET` with the scale of what it reads folded into the first layer."""
    mean, deviation = [np.asarray(v, np.float64) for v in scale]
    parts = [(l.weight.detach().numpy().astype(np.float64).T, l.bias.detach().numpy().astype(np.float64)) for l in net]
    w, b = parts[0]
    parts[0] = (w / deviation[:, None], b - (mean / deviation) @ w)
    row = lambda v: "[" + ", ".join(f"{x:.5e}" for x in v) + "]"
    out = [f"//! The net's weights, written by `benchmarks/nets/{script}`.", "", "#![cfg_attr(rustfmt, rustfmt_skip)]", ""]
    out += uses + ["use crate::kernels::net::Net;", "", f"pub(super) static NET: {declaration} = Net {{"]
    for name, (w, b) in zip(("first", "second", "third"), parts):
        out += [f"    {name}: ([", *(f"        {row(v)}," for v in w), f"    ], {row(b)}),"]
    with open(path, "w") as fh:
        fh.write("\n".join(out + ["};"]) + "\n")
