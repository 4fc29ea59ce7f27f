"""Train the net of the sequence filter's stage `stabilise`: the bandwidths of its cross-bilateral filter (Kalantari et al. 2015).

    python3 benchmarks/nets/stabilise.py VIEWS LADDER --fit workshop,harbour:0.2,night --report yard,hall --weights crates/quell/src/stages/stabilise/weights.rs
    python3 benchmarks/nets/stabilise.py VIEWS LADDER --fit workshop,harbour:0.2,night,drawn:0.25 --report yard,hall \
        --bandwidths crates/quell/src/stages/stabilise/weights.rs --weights crates/quell/src/stages/stabilise/share.rs

VIEWS holds what the example `blend_views` writes with taps, LADDER the sequences of `benchmarks/ladder`. Needs `pip install torch
numpy OpenEXR`. The scenes of `--report` are never trained on: their figures are printed.

What is trained first: `log2` of a bandwidth for each part of the signature and the distance in pixels, for taps of the frame itself and
for those of others, and for frames between. With `--bandwidths` these are kept as they are, and a second net is trained: `log2` of
the input's share in what is averaged, over the filtered picture's. Beside the filtered picture a mixture of it and the input has to be
good, as the stage `blend` will make one. The scene `drawn` stands for all scenes drawn by chance but every seventh.
"""
import argparse
import os
import time

import numpy as np
import torch
from torch import nn

from common import drawn, expanded, figures, layers, line, loss, read_rust, run, rust, sequences, shares

HEAD, CHANNELS, PARTS = 30, 12, 4
TAPS = 7 * 9
READ = (0, 1, 2, 3, 4, 7, 11, 12, 14, 15, 16)  # as `READ` in stages/stabilise/mod.rs
# where training begins: `log2` of bandwidths that a fit of constants gave, of the input's share, and a mixture with the input
START = (0.3, -1.5, 1.5, -1.0, -1.0, -3.0, -2.0, 1.0, -1.0, 1.9, -3.0)
SHARE, MIXTURE = -4.0, -2.0
LEAST_DEVIATION = 1e-7  # as in stages/stabilise/mod.rs
DETAIL = 11  # which of the statistics is the fine variance of the wavelet's picture, over the noise


def load(folder, references):
    import exr_sequence

    found = []
    for name in sorted(os.listdir(folder)):
        number = int(name.split(".")[0])
        if name.endswith(".head") and number in references:
            head = np.fromfile(os.path.join(folder, name), np.float32).reshape(-1, HEAD)
            taps = np.fromfile(os.path.join(folder, name[:-4] + "taps"), np.float16).reshape(len(head), TAPS, CHANNELS)
            picture = exr_sequence.beauty(references[number])
            found.append((head, taps, picture[head[:, 1].astype(int), head[:, 0].astype(int)].astype(np.float32)))
    return [torch.tensor(np.concatenate(v)) for v in zip(*found)] if found else None


class Net(nn.Module):
    """`bandwidths`: the net that gives them, where this one gives the input's share."""

    def __init__(self, hidden, bandwidths=None):
        super().__init__()
        begin = [SHARE] if bandwidths else START
        self.layers = layers(len(READ), hidden, len(begin) + 1)
        self.bandwidths = bandwidths
        nn.init.zeros_(self.layers[-1].weight)
        with torch.no_grad():
            self.layers[-1].bias.copy_(torch.tensor([*begin, MIXTURE]))

    def forward(self, head, taps, scale):
        """The filtered colour, and a mixture with the input, over the brightness."""
        taps = taps.float()
        statistics = head[:, 13:]
        y = run(self.layers, (statistics[:, READ] - scale[0]) / scale[1])
        z = run(self.bandwidths, statistics[:, READ]) if self.bandwidths else y
        noise = head[:, 3] * 3 * head[:, 2] ** 2
        fine = torch.exp2(statistics[:, DETAIL]) * noise
        ones = torch.ones_like(noise)
        deviation = torch.stack([fine + LEAST_DEVIATION, noise + LEAST_DEVIATION, ones, ones, ones], -1)
        bandwidths = torch.exp2(z[:, :10].clamp(-20, 20)).reshape(-1, 2, PARTS + 1) / deviation[:, None]
        away = taps[..., 11]
        group = (away > 1.5).long()
        weight = (taps[..., 6:11] * torch.gather(bandwidths, 1, group[..., None].expand(-1, -1, PARTS + 1))).sum(-1)
        weight = weight + torch.exp2(z[:, 10:11].clamp(-20, 20)) * torch.clamp(away - 2, min=0)
        weight = torch.where(away > 0, torch.exp2(-weight.clamp(max=60)), 0.0)
        share = torch.sigmoid(y[:, 0].clamp(-20, 20) * np.log(2))[:, None, None] if self.bandwidths else 0.0
        colours = taps[..., :3] + share * (taps[..., 3:6] - taps[..., :3])
        out = (weight[..., None] * colours).sum(1) / weight.sum(1, keepdim=True)
        return out, out + torch.sigmoid(y[:, -1:]) * (head[:, 4:7] - out)


def begin_with(net, found):
    """The weights of `found`, which lacks the output that mixes with the input: that one stays as it is."""
    with torch.no_grad():
        for own, other in zip(net.layers, found):
            own.weight[: len(other.weight)], own.bias[: len(other.bias)] = other.weight, other.bias


def candidates(head):
    return [head[:, k : k + 3] / head[:, 2:3] for k in (4, 7, 10)]


def report(net, scale, head, taps, reference, name):
    with torch.no_grad():
        both = [net(h, t, scale) for h, t in zip(head.split(4096), taps.split(4096))]
    filtered, mixed = [torch.cat(v) / head[:, 2:3] for v in zip(*both)]
    base, wavelet, before = [figures(c, reference) for c in candidates(head)]
    found = "   ".join(f"{n} {line(base, f)}" for n, f in (("wavelet", wavelet), ("before", before), ("net", figures(filtered, reference)), ("mixed", figures(mixed, reference))))
    print(f"{name:24} {found}", flush=True)


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("views")
    ap.add_argument("ladder")
    ap.add_argument("--fit", required=True, help="scenes to train on, as harbour:0.5,night; the number is the weight of its loss")
    ap.add_argument("--report", default="")
    ap.add_argument("--weights", help="Rust file to write")
    ap.add_argument("--bandwidths", help="Rust file of the net that gives the bandwidths: train that of the share")
    ap.add_argument("--begin", help="Rust file of the weights to begin with, instead of random ones")
    ap.add_argument("--keep", type=float, default=0.0, help="share of the weights of --begin in those that are written: between both ends lie nets that keep most of what either learned")
    ap.add_argument("--hidden", default="8,8")
    ap.add_argument("--steps", type=int, default=900)
    ap.add_argument("--sequences", type=int, default=14, help="taken by chance in a step")
    ap.add_argument("--batch", type=int, default=500, help="pixels of each of them")
    ap.add_argument("--rate", type=float, default=6e-3)
    ap.add_argument("--decay", type=float, default=0.5, help="of the weights: without it the net of the bandwidths fits its scenes a little better and others worse; 0.05 for the share")
    ap.add_argument("--flicker", type=float, default=4.0, help="weight of the error of the logarithm")
    ap.add_argument("--seed", type=int, default=0)
    a = ap.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(a.seed)
    held = drawn(a.views)[1]
    weights = {name: share for scene, share in shares(a.fit).items() for name in expanded(a.views, [scene]) if name not in held}
    sets = sequences(a.views, a.ladder, [*weights, *held, *filter(None, a.report.split(","))], load)
    fit = {key: data for key, data in sets.items() if key[0] in weights}
    scale = torch.cat([head[:, 13:][:, READ] for head, _, _ in fit.values()])
    scale = scale.mean(0), scale.std(0) + 1e-3
    base = {key: torch.tensor(np.min([figures(c, r) for c in candidates(head)], 0)).float() for key, (head, _, r) in fit.items()}
    net = Net([int(n) for n in a.hidden.split(",")], a.bandwidths and read_rust(a.bandwidths))
    if a.begin:
        begin_with(net, read_rust(a.begin))
        # What these read is scaled in their first layer.
        scale = torch.zeros_like(scale[0]), torch.ones_like(scale[1])
    begun = [p.detach().clone() for p in net.parameters()]
    optimiser = torch.optim.AdamW(net.parameters(), a.rate, weight_decay=a.decay)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, a.steps)
    begin = time.time()
    for step in range(a.steps):
        total = 0.0
        chosen = [list(fit)[k] for k in torch.randperm(len(fit))[: a.sequences]]
        for key in chosen:
            head, taps, reference = fit[key]
            i = torch.randint(0, len(head), (a.batch,))
            h = head[i]
            filtered, mixed = net(h, taps[i], scale)
            of = lambda x: loss(x / h[:, 2:3], reference[i], base[key], a.flicker).mean()
            total = total + weights[key[0]] * (0.5 * of(filtered) + of(mixed))
        optimiser.zero_grad()
        total.backward()
        optimiser.step()
        schedule.step()
        if step % 100 == 0:
            print(step, float(total.detach()) / sum(weights[scene] for scene, _ in chosen), f"{time.time() - begin:.0f} s", flush=True)
    with torch.no_grad():
        for value, before in zip(net.parameters(), begun):
            value.lerp_(before, a.keep)
    for (scene, count), data in sets.items():
        report(net, scale, *data, f"{scene} {count}{' (fit)' if scene in weights else ''}")
    if a.weights:
        last = net.layers[-1]
        # The mixture with the input is that of `blend`.
        kept = nn.Linear(last.in_features, last.out_features - 1)
        kept.weight, kept.bias = nn.Parameter(last.weight[:-1]), nn.Parameter(last.bias[:-1])
        hidden = ", ".join(a.hidden.split(","))
        outputs, names = ("1", "READ") if a.bandwidths else ("OUTPUTS", "{OUTPUTS, READ}")
        rust([*net.layers[:-1], kept], scale, f"Net<{{ READ.len() }}, {hidden}, {outputs}>", [f"use super::{names};"], a.weights, "stabilise.py")


if __name__ == "__main__":
    main()
