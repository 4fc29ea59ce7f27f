"""Train the net of the sequence filter's stage `blend`, and write its weights as Rust.

    cargo run --release -p quell-frames --example blend_views -- LADDER/SCENE/noisy_N VIEWS/SCENE/noisy_N 6-8     # each sequence
    python3 benchmarks/blend/train.py VIEWS LADDER --fit harbour,workshop --report yard,night,kitchen --weights crates/quell/src/stages/blend/weights.rs

VIEWS holds what the example `blend_views` writes, LADDER the sequences of `benchmarks/ladder` with their references. Needs
`pip install torch numpy OpenEXR`; about ten minutes on one core. The scenes of `--report` are never trained on: their
figures are printed (relMSE times lower and flicker, as `benchmarks/score_exr.py` has them).

The loss, relative to that of each sequence's best candidate: relative squared error, absolute error relative to the light, and squared error
of the logarithm, which stands for flicker. References are themselves noisy; their noise is independent of the candidates', so
it adds a constant to squared errors.
"""
import argparse
import os
import sys

import numpy as np
import torch
from torch import nn

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import exr_sequence

HIDDEN = (24, 16)
CANDIDATES = 3


def load(views, ladder, scene, count):
    """What the net reads, the candidates and the reference of every frame that has both."""
    folder = os.path.join(views, scene, count)
    references = exr_sequence.files(os.path.join(ladder, scene, "reference"))
    found = []
    for name in sorted(os.listdir(folder)):
        number = int(name.split(".")[0])
        if number in references:
            data = np.load(os.path.join(folder, name))
            found.append((data[..., 10:], data[..., :9].reshape(*data.shape[:2], 3, 3), exr_sequence.beauty(references[number]), data[..., 9]))
    return [np.stack(v) for v in zip(*found)] if found else None


class Net(nn.Module):
    def __init__(self, inputs):
        super().__init__()
        self.layers = nn.ModuleList([nn.Linear(inputs, HIDDEN[0]), nn.Linear(HIDDEN[0], HIDDEN[1]), nn.Linear(HIDDEN[1], CANDIDATES + 1)])

    def forward(self, x):
        x = torch.relu(self.layers[0](x))
        x = torch.relu(self.layers[1](x))
        z = self.layers[2](x)
        half = 0.5 * (z[..., :3] + torch.sqrt(z[..., :3] ** 2 + 4))
        g = half * half
        return g / g.sum(-1, keepdim=True), z[..., 3]


def rel(x, r):
    return ((x - r) ** 2 / (r**2 + 0.01)).mean(-1)


def log(x):
    return torch.log2(1 + torch.clamp(x.mean(-1), min=0))


def figures(x, r):
    e = np.sort(rel(x, r).reshape(len(x), -1), -1)
    relmse = e[:, : int(e.shape[1] * 0.999)].mean()
    d = np.log2(1 + np.maximum(x.mean(-1), 0)) - np.log2(1 + np.maximum(r.mean(-1), 0))
    return relmse, np.sqrt(np.mean((d[1:] - d[:-1]) ** 2)) if len(d) > 1 else np.nan, np.mean(np.abs(x - r) / (r + 0.1))


def report(net, scale, data, name):
    inputs, candidates, reference, _ = data
    with torch.no_grad():
        shares, _ = net(torch.tensor((inputs - scale[0]) / scale[1]).float())
    shares = shares.numpy()
    out = (shares[..., None] * candidates).sum(-2)
    base, figs, steady = figures(candidates[..., 0, :], reference), figures(out, reference), figures(candidates[..., 2, :], reference)
    line = lambda f: f"{base[0] / f[0]:7.2f} {f[1] / base[1]:6.3f} {f[2] / base[2]:6.3f}"
    print(f"{name:24} net {line(figs)}   stabilised {line(steady)}   shares {' '.join('%.2f' % s for s in shares.mean((0, 1, 2)))}", flush=True)


def rust(net, scale, path):
    mean, deviation = [v.astype(np.float64) for v in scale]
    layers = [(l.weight.detach().numpy().astype(np.float64).T, l.bias.detach().numpy().astype(np.float64)) for l in net.layers]
    w, b = layers[0]
    layers[0] = (w / deviation[:, None], b - (mean / deviation) @ w)
    row = lambda v: "[" + ", ".join(f"{x:.5e}" for x in v) + "]"
    out = ["//! The net's weights, written by `benchmarks/blend/train.py`.", "", "#![cfg_attr(rustfmt, rustfmt_skip)]", ""]
    out += [f"pub(super) const HIDDEN_{k + 1}: usize = {n};" for k, n in enumerate(HIDDEN)] + [f"pub(super) const OUTPUTS: usize = {CANDIDATES + 1};"]
    sizes = ["super::INPUTS", "HIDDEN_1", "HIDDEN_2", "OUTPUTS"]
    for k, (w, b) in enumerate(layers):
        out.append(f"pub(super) const WEIGHTS_{k + 1}: [[f32; {sizes[k + 1]}]; {sizes[k]}] = [")
        out += [f"    {row(v)}," for v in w]
        out += ["];", f"pub(super) const BIAS_{k + 1}: [f32; {sizes[k + 1]}] = {row(b)};"]
    with open(path, "w") as fh:
        fh.write("\n".join(out) + "\n")


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("views")
    ap.add_argument("ladder")
    ap.add_argument("--fit", required=True, help="scenes to train on, as harbour:0.1,workshop; the number is the share of its pixels that is taken")
    ap.add_argument("--report", default="")
    ap.add_argument("--weights", help="Rust file to write")
    ap.add_argument("--steps", type=int, default=2500)
    ap.add_argument("--seed", type=int, default=0)
    ap.add_argument("--without", default="", help="what the net reads, by place, that it shall not")
    ap.add_argument("--jitter", type=float, default=0.0, help="noise on what the net reads, in its deviations")
    ap.add_argument("--clamp", type=float, default=100.0, help="the most that a pixel counts, times the mean error of the best candidate")
    a = ap.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(a.seed)
    rng = np.random.default_rng(a.seed)
    taken = {name: float(share or 1) for name, _, share in (part.partition(":") for part in a.fit.split(","))}
    a.fit = ",".join(taken)
    sets = {}
    for scene in filter(None, (a.fit + "," + a.report).split(",")):
        if os.path.isdir(os.path.join(a.views, scene)):
            for count in sorted(os.listdir(os.path.join(a.views, scene))):
                data = load(a.views, a.ladder, scene, count)
                if data:
                    sets[scene, count] = data
    rows = []
    for (scene, count), (inputs, candidates, reference, noise) in sets.items():
        if scene in a.fit.split(","):
            base = np.min([figures(candidates[..., k, :], reference) for k in range(CANDIDATES)], 0)
            n = noise.size
            pick = rng.choice(n, int(min(n, 120000) * taken[scene]), False)
            kind = np.tile(np.array([base[0], base[1] ** 2, base[2]]), (len(pick), 1))
            brightness = candidates[..., 2, :].mean(-1)
            rows.append([v.reshape(n, *v.shape[3:])[pick].astype(np.float32) for v in (inputs, candidates, reference, noise, brightness)] + [kind.astype(np.float32)])
    inputs, candidates, reference, noise, brightness, kind = [torch.tensor(np.concatenate(v)) for v in zip(*rows)]
    scale = inputs.mean(0).numpy(), inputs.std(0).numpy() + 1e-3
    for k in filter(None, a.without.split(",")):
        scale[1][int(k)] = 1e6
    inputs = (inputs - torch.tensor(scale[0])) / torch.tensor(scale[1])
    net = Net(inputs.shape[1])
    optimiser = torch.optim.Adam(net.parameters(), 4e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, a.steps)
    for step in range(a.steps):
        i = torch.randint(0, len(inputs), (8192,))
        x = inputs[i]
        shares, error = net(x + a.jitter * torch.randn_like(x))
        out = (shares[..., None] * candidates[i]).sum(-2)
        r, k = reference[i], kind[i]
        squared = torch.clamp(rel(out, r) / k[:, 0], max=a.clamp)
        change = torch.clamp((log(out) - log(r)) ** 2 / k[:, 1], max=a.clamp)
        absolute = ((out - r).abs() / (r + 0.1)).mean(-1) / k[:, 2]
        # expected error over the noise: the mean of a distribution whose logarithm is `error`
        actual = ((out.detach() - r) ** 2).mean(-1) / torch.clamp(noise[i], min=1e-12)
        expected = torch.clamp(actual, max=1e4) * torch.exp2(-error.clamp(-20, 14)) + error.clamp(-20, 14) * np.log(2)
        loss = squared.mean() + 2.0 * change.mean() + absolute.mean() + 0.3 * torch.sqrt(squared + 1e-6).mean() + 0.02 * expected.mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        if step % 500 == 0:
            print(step, float(loss.detach()), flush=True)
    for (scene, count), data in sets.items():
        report(net, scale, data, f"{scene} {count}{' (fit)' if scene in a.fit.split(',') else ''}")
    if a.weights:
        rust(net, scale, a.weights)


if __name__ == "__main__":
    main()
