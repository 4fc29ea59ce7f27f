"""Train the net of the sequence filter's stage `blend`: the shares of input, wavelet's picture and stabilised picture.

    python3 benchmarks/nets/blend.py VIEWS LADDER --fit harbour:0.4,workshop,night --report yard,night,kitchen --weights crates/quell/src/stages/blend/weights.rs

VIEWS holds what the example `blend_views` writes, LADDER the sequences of `benchmarks/ladder` with their references. Needs
`pip install torch numpy OpenEXR`. The scenes of `--report` are never trained on: their figures are printed.

References are themselves noisy; their noise is independent of the candidates', so it adds a constant to squared errors.
"""
import argparse
import os
import time

import numpy as np
import torch
from torch import nn

from common import figures, layers, line, loss, run, rust, sequences, shares

CANDIDATES = 3


def load(folder, references):
    """What the net reads, the candidates, the reference and the noise of every frame that has all."""
    import exr_sequence

    found = []
    for name in sorted(os.listdir(folder)):
        number = int(name.split(".")[0])
        if name.endswith(".npy") and number in references:
            data = torch.tensor(np.load(os.path.join(folder, name)))
            picture = torch.tensor(exr_sequence.beauty(references[number]).astype(np.float32))
            found.append([v.reshape(-1, *v.shape[2:]) for v in (data[..., 10:], data[..., :9].reshape(*data.shape[:2], 3, 3), picture, data[..., 9])])
    return [torch.cat(v) for v in zip(*found)] if found else None


class Net(nn.Module):
    def __init__(self, inputs, hidden):
        super().__init__()
        self.layers = layers(inputs, hidden, CANDIDATES + 1)

    def forward(self, x):
        """Shares, and `log2` of the expected squared error over the noise."""
        z = run(self.layers, x)
        half = 0.5 * (z[..., :CANDIDATES] + torch.sqrt(z[..., :CANDIDATES] ** 2 + 4))
        g = half * half
        return g / g.sum(-1, keepdim=True), z[..., CANDIDATES]


def report(net, scale, data, name):
    inputs, candidates, reference, _ = data
    with torch.no_grad():
        found, _ = net((inputs - scale[0]) / scale[1])
    base, wavelet, steady = [figures(candidates[:, k], reference) for k in range(CANDIDATES)]
    result = figures((found[..., None] * candidates).sum(-2), reference)
    print(f"{name:24} net {line(base, result)}   stabilised {line(base, steady)}   wavelet {line(base, wavelet)}   shares {' '.join('%.2f' % s for s in found.mean(0))}", flush=True)


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("views")
    ap.add_argument("ladder")
    ap.add_argument("--fit", required=True, help="scenes to train on, as harbour:0.4,workshop; the number is the share of its pixels that is taken")
    ap.add_argument("--report", default="")
    ap.add_argument("--weights", help="Rust file to write")
    ap.add_argument("--hidden", default="32,24")
    ap.add_argument("--steps", type=int, default=2500)
    ap.add_argument("--flicker", type=float, default=3.0, help="weight of the error of the logarithm")
    ap.add_argument("--seed", type=int, default=0)
    a = ap.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(a.seed)
    taken = shares(a.fit)
    sets = sequences(a.views, a.ladder, [*taken, *filter(None, a.report.split(","))], load)
    rows = []
    for (scene, _), (inputs, candidates, reference, noise) in sets.items():
        if scene in taken:
            base = torch.tensor(np.min([figures(candidates[:, k], reference) for k in range(CANDIDATES)], 0)).float()
            i = torch.randperm(len(noise))[: int(min(len(noise), 120000) * taken[scene])]
            rows.append([inputs[i], candidates[i], reference[i], noise[i], base.expand(len(i), 3)])
    inputs, candidates, reference, noise, base = [torch.cat(v) for v in zip(*rows)]
    scale = inputs.mean(0), inputs.std(0) + 1e-3
    net = Net(inputs.shape[1], [int(n) for n in a.hidden.split(",")])
    optimiser = torch.optim.Adam(net.parameters(), 4e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, a.steps)
    begin = time.time()
    for step in range(a.steps):
        i = torch.randint(0, len(inputs), (8192,))
        found, error = net((inputs[i] - scale[0]) / scale[1])
        out, r = (found[..., None] * candidates[i]).sum(-2), reference[i]
        # expected error over the noise: the mean of a distribution whose logarithm is `error`
        actual = ((out.detach() - r) ** 2).mean(-1) / torch.clamp(noise[i], min=1e-12)
        expected = torch.clamp(actual, max=1e4) * torch.exp2(-error.clamp(-20, 14)) + error.clamp(-20, 14) * np.log(2)
        total = loss(out, r, base[i], a.flicker).mean() + 0.02 * expected.mean()
        optimiser.zero_grad()
        total.backward()
        optimiser.step()
        schedule.step()
        if step % 500 == 0:
            print(step, float(total.detach()), f"{time.time() - begin:.0f} s", flush=True)
    for (scene, count), data in sets.items():
        report(net, scale, data, f"{scene} {count}{' (fit)' if scene in taken else ''}")
    if a.weights:
        hidden = ", ".join(a.hidden.split(","))
        rust(net.layers, scale, f"Net<{{ super::INPUTS }}, {hidden}, {CANDIDATES + 1}>", [], a.weights, "blend.py")


if __name__ == "__main__":
    main()
