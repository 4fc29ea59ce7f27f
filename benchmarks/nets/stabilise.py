"""Train the net of the sequence filter's stage `stabilise`: the bandwidths of its cross-bilateral filter (Kalantari et al. 2015).

    python3 benchmarks/nets/stabilise.py VIEWS LADDER --fit harbour,night,workshop --report yard,hall --weights crates/quell/src/stages/stabilise/weights.rs

VIEWS holds what the example `blend_views` writes with taps, LADDER the sequences of `benchmarks/ladder`. Needs `pip install torch
numpy OpenEXR`. The scenes of `--report` are never trained on: their figures are printed.

What is trained: `log2` of a bandwidth for each part of the signature and the distance in pixels, for taps of the frame itself and for
those of others, and for frames between. Beside the filtered picture a mixture of it and the input is asked to be good, as the stage
`blend` will make one.
"""
import argparse
import os
import time

import numpy as np
import torch
from torch import nn

from common import figures, layers, line, loss, run, rust, sequences, shares

HEAD, CHANNELS, PARTS = 30, 9, 4
TAPS = 25 + 6 * 9
READ = (0, 1, 2, 3, 4, 7, 11, 12, 14, 15, 16)  # as `READ` in stages/stabilise/mod.rs
# where training begins: `log2` of bandwidths that a fit of constants gave
START = (0.3, -1.5, 1.5, -1.0, -1.0, -3.0, -2.0, 1.0, -1.0, 1.9, -3.0)
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
    def __init__(self, hidden):
        super().__init__()
        self.layers = layers(len(READ), hidden, len(START) + 1)
        nn.init.zeros_(self.layers[-1].weight)
        with torch.no_grad():
            self.layers[-1].bias.copy_(torch.tensor([*START, -2.0]))

    def forward(self, head, taps, scale):
        """The filtered colour, and a mixture with the input, over the brightness."""
        taps = taps.float()
        statistics = head[:, 13:]
        z = run(self.layers, (statistics[:, READ] - scale[0]) / scale[1])
        noise = head[:, 3] * 3 * head[:, 2] ** 2
        fine = torch.exp2(statistics[:, DETAIL]) * noise
        ones = torch.ones_like(noise)
        deviation = torch.stack([fine + LEAST_DEVIATION, noise + LEAST_DEVIATION, ones, ones, ones], -1)
        bandwidths = torch.exp2(z[:, :10].clamp(-20, 20)).reshape(-1, 2, PARTS + 1) / deviation[:, None]
        away = taps[..., 8]
        group = (away > 1.5).long()
        weight = (taps[..., 3:8] * torch.gather(bandwidths, 1, group[..., None].expand(-1, -1, PARTS + 1))).sum(-1)
        weight = weight + torch.exp2(z[:, 10:11].clamp(-20, 20)) * torch.clamp(away - 2, min=0)
        weight = torch.where(away > 0, torch.exp2(-weight.clamp(max=60)), 0.0)
        out = (weight[..., None] * taps[..., :3]).sum(1) / weight.sum(1, keepdim=True)
        return out, out + torch.sigmoid(z[:, 11:]) * (head[:, 4:7] - out)


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
    ap.add_argument("--hidden", default="8,8")
    ap.add_argument("--steps", type=int, default=600)
    ap.add_argument("--batch", type=int, default=800, help="pixels of each sequence a step")
    ap.add_argument("--rate", type=float, default=6e-3)
    ap.add_argument("--decay", type=float, default=0.5, help="of the weights: without it the net fits its scenes a little better and others worse")
    ap.add_argument("--seed", type=int, default=0)
    a = ap.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(a.seed)
    weights = shares(a.fit)
    sets = sequences(a.views, a.ladder, [*weights, *filter(None, a.report.split(","))], load)
    fit = {key: data for key, data in sets.items() if key[0] in weights}
    scale = torch.cat([head[:, 13:][:, READ] for head, _, _ in fit.values()])
    scale = scale.mean(0), scale.std(0) + 1e-3
    base = {key: torch.tensor(np.min([figures(c, r) for c in candidates(head)], 0)).float() for key, (head, _, r) in fit.items()}
    net = Net([int(n) for n in a.hidden.split(",")])
    optimiser = torch.optim.AdamW(net.parameters(), a.rate, weight_decay=a.decay)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, a.steps)
    begin = time.time()
    for step in range(a.steps):
        total = 0.0
        for key, (head, taps, reference) in fit.items():
            i = torch.randint(0, len(head), (a.batch,))
            h = head[i]
            filtered, mixed = net(h, taps[i], scale)
            of = lambda x: loss(x / h[:, 2:3], reference[i], base[key]).mean()
            total = total + weights[key[0]] * (0.5 * of(filtered) + of(mixed))
        optimiser.zero_grad()
        total.backward()
        optimiser.step()
        schedule.step()
        if step % 100 == 0:
            print(step, float(total.detach()) / sum(weights[scene] for scene, _ in fit), f"{time.time() - begin:.0f} s", flush=True)
    for (scene, count), data in sets.items():
        report(net, scale, *data, f"{scene} {count}{' (fit)' if scene in weights else ''}")
    if a.weights:
        last = net.layers[-1]
        kept = nn.Linear(last.in_features, len(START))
        kept.weight, kept.bias = nn.Parameter(last.weight[: len(START)]), nn.Parameter(last.bias[: len(START)])
        hidden = ", ".join(a.hidden.split(","))
        rust([*net.layers[:-1], kept], scale, f"Net<{{ READ.len() }}, {hidden}, OUTPUTS>", ["use super::{OUTPUTS, READ};"], a.weights, "stabilise.py")


if __name__ == "__main__":
    main()
