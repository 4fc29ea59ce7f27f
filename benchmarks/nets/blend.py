"""Train the net of the sequence filter's stage `blend`: the shares of input, wavelet's picture and stabilised picture.

    python3 benchmarks/nets/blend.py VIEWS LADDER --fit harbour,workshop,night,drawn --report yard,kitchen --weights crates/quell/src/stages/blend/weights.bin

VIEWS holds what the example `blend_views` writes, LADDER the sequences of `benchmarks/ladder` with their references, and under
`drawn/SEED` those of scenes drawn by chance. Needs `pip install torch numpy OpenEXR`. The scenes of `--report`, and every seventh drawn
one, are never trained on: their figures are printed.

The net is convolutional (`crates/quell/src/kernels/conv.rs`). References are themselves noisy; their noise is independent of the
candidates', so it adds a constant to squared errors.
"""
import argparse
import os
import time

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

from common import compressed, drawn, figures, line, logarithm, relative, sequences

CANDIDATES, READ, WIDTHS = 3, 26, (16, 32, 32)


def load(folder, found):
    """What the net reads, the candidates, the reference and the noise of every frame that has all: (channels, height, width)."""
    import exr_sequence

    frames = []
    for name in sorted(os.listdir(folder)):
        number = int(name.split(".")[0])
        if name.endswith(".npy") and number in found:
            data = torch.tensor(np.load(os.path.join(folder, name))).permute(2, 0, 1)
            picture = torch.tensor(exr_sequence.beauty(found[number]).astype(np.float32)).permute(2, 0, 1)
            frames.append({"candidates": data[:9], "noise": data[9:10], "read": data[10:], "reference": picture})
    return frames


class Net(nn.Module):
    def __init__(self):
        super().__init__()
        a, b, c = WIDTHS
        conv = lambda i, o, side=3: nn.Conv2d(i, o, side, padding=side // 2, padding_mode="replicate")
        shapes = [(READ, a, 1), (a, a), (a, b), (b, c), (c, c), (b + c, b), (a + b, a), (a, CANDIDATES + 1, 1)]
        self.layers = nn.ModuleList([conv(*shape) for shape in shapes])
        # All candidates alike to begin with: from there none is given up too early.
        nn.init.zeros_(self.layers[-1].weight)
        nn.init.zeros_(self.layers[-1].bias)
        self.register_buffer("mean", torch.zeros(READ, 1, 1))
        self.register_buffer("deviation", torch.ones(READ, 1, 1))

    def forward(self, x):
        """Shares, and `log2` of the expected squared error over the noise."""
        h, w = x.shape[-2:]
        x = ((F.pad(x, (0, -w % 4, 0, -h % 4), mode="replicate") - self.mean) / self.deviation).clamp(-4, 4)
        run = lambda k, v: F.leaky_relu(self.layers[k](v), 0.05)
        half, twice = lambda v: F.avg_pool2d(v, 2), lambda v: F.interpolate(v, scale_factor=2, mode="nearest")
        a = run(1, run(0, x))
        b = run(2, half(a))
        c = run(4, run(3, half(b)))
        d = run(5, torch.cat([b, twice(c)], 1))
        y = self.layers[7](run(6, torch.cat([a, twice(d)], 1)))[..., :h, :w]
        z = y[:, :CANDIDATES]
        z = 6 * z / (6 + z.abs())
        g = (0.5 * (z + torch.sqrt(z * z + 4))) ** 2
        return g / g.sum(1, keepdim=True), y[:, CANDIDATES]


def mixed(shares, candidates):
    n, _, h, w = candidates.shape
    return (shares[:, :, None] * candidates.view(n, CANDIDATES, 3, h, w)).sum(1)


def last(t):
    """Channels last, as `common` wants them."""
    return t.movedim(-3, -1)


def tone(t):
    return torch.log2(1 + torch.clamp(t, min=0) / 0.1)


def base(frame):
    """Errors of the best candidate, by which those of a pixel are divided."""
    r = last(frame["reference"])
    each = [last(frame["candidates"][3 * k : 3 * k + 3]) for k in range(CANDIDATES)]
    found = [[*figures(c, r), float((tone(c) - tone(r)).abs().mean())] for c in each]
    return torch.tensor(np.maximum(np.min(found, 0), 1e-7)).float()


def loss(out, r, base, flicker):
    out, r, base = last(out), last(r), base[:, :, None, None]
    squared = compressed(relative(out, r) / base[:, 0])
    change = compressed((logarithm(out) - logarithm(r)) ** 2 / base[:, 1] ** 2)
    absolute = ((out - r).abs() / (r + 0.1)).mean(-1) / base[:, 2]
    return squared + flicker * change + absolute + 0.3 * torch.sqrt(squared + 1e-6) + (tone(out) - tone(r)).abs().mean(-1) / base[:, 3]


def worse(out, first, r):
    """How much worse than the input blocks of 16x16 pixels are: what users of many samples meet first, and what the mean of all errors
    hardly sees."""
    blocks = lambda x: F.avg_pool2d(relative(last(x), last(r))[:, None], 16)
    return torch.log1p(torch.relu(blocks(out) / (blocks(first) + 1e-6) - 1)).mean()


def error_found(error, out, r, noise, share):
    """Of the expected error its distance from the real one, both logarithms, of means over 5x5: so single outliers do not decide what is
    said of all pixels. `share`: the noise of the reference over the input's."""
    pool = lambda x: F.avg_pool2d(x[:, None], 5, 1, 2, count_include_pad=False)[:, 0]
    actual = pool(((out - r) ** 2).mean(1)) / torch.clamp(pool(noise[:, 0]), min=1e-12) - share[:, None, None]
    return F.smooth_l1_loss(error, torch.log2(actual.clamp(min=1e-3)), reduction="none")


def tile(frame, size, rng):
    """A part of a frame, turned and mirrored at random."""
    h, w = frame["reference"].shape[-2:]
    y, x = rng.integers(0, h - size + 1), rng.integers(0, w - size + 1)
    parts = [frame[k][:, y : y + size, x : x + size] for k in ("read", "candidates", "reference", "noise")]
    for turn in (lambda t: t.flip(-1), lambda t: t.flip(-2), lambda t: t.transpose(-1, -2)):
        if rng.random() < 0.5:
            parts = [turn(t) for t in parts]
    return parts


def report(net, frames, name):
    rows = []
    blocks = lambda error: F.avg_pool2d(error[None, None], 16)
    for frame in frames:
        with torch.no_grad():
            shares, _ = net(frame["read"][None])
        r = last(frame["reference"])
        pictures = [last(frame["candidates"][3 * k : 3 * k + 3]) for k in range(CANDIDATES)] + [last(mixed(shares, frame["candidates"][None])[0])]
        worse = (blocks(relative(pictures[3], r)) > 1.1 * blocks(relative(pictures[0], r))).float().mean()
        rows.append([np.array(figures(p, r)) for p in pictures] + [shares.mean((0, 2, 3)).numpy(), float(worse)])
    first, wavelet, steady, out, shares, worse = [np.mean([row[k] for row in rows], 0) for k in range(6)]
    print(f"{name:28} net {line(first, out)} blocks worse {worse:.3f}   stabilised {line(first, steady)}   wavelet {line(first, wavelet)}   shares {' '.join('%.2f' % s for s in shares)}", flush=True)


def values(net):
    """All that the file of weights holds, in its order."""
    return [net.mean, net.deviation] + [v for layer in net.layers for v in (layer.weight, layer.bias)]


def begin_with(net, path):
    found = torch.tensor(np.fromfile(path, "<f2").astype(np.float32))
    parts = found.split([v.numel() for v in values(net)])
    with torch.no_grad():
        for value, part in zip(values(net), parts):
            value.copy_(part.view_as(value))


def write(net, path):
    np.concatenate([v.detach().numpy().ravel() for v in values(net)]).astype("<f2").tofile(path)


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("views")
    ap.add_argument("ladder")
    ap.add_argument("--fit", required=True, help="scenes to train on")
    ap.add_argument("--report", default="")
    ap.add_argument("--weights", help="file to write")
    ap.add_argument("--begin", help="weights to begin with, instead of random ones")
    ap.add_argument("--rate", type=float, default=2e-3)
    ap.add_argument("--steps", type=int, default=3000)
    ap.add_argument("--batch", type=int, default=6)
    ap.add_argument("--tile", type=int, default=56, help="pixels, of which 4 at each border do not count; 8 more than a multiple of 16")
    ap.add_argument("--flicker", type=float, default=3.0, help="weight of the error of the logarithm")
    ap.add_argument("--blocks", type=float, default=10.0, help="weight of blocks that are worse than the input")
    ap.add_argument("--samples", type=float, default=256, help="of the references, for the expected error")
    ap.add_argument("--threads", type=int, default=1)
    ap.add_argument("--seed", type=int, default=0)
    a = ap.parse_args()
    torch.set_num_threads(a.threads)
    torch.manual_seed(a.seed)
    rng = np.random.default_rng(a.seed)
    fit = sequences(a.views, a.ladder, a.fit.split(","), load)
    held = drawn(a.views)[1]
    others = {**{k: v for k, v in fit.items() if k[0] in held}, **sequences(a.views, a.ladder, filter(None, a.report.split(",")), load)}
    fit = {k: v for k, v in fit.items() if k[0] not in held}
    frames = [(frame, base(frame)) for group in fit.values() for frame in group]
    counts = [int(count.split("_")[1]) for (_, count), group in fit.items() for _ in group]
    # A picture counts by its pixels, up to a point.
    weights = np.array([min(frame["noise"].numel(), 60000) for frame, _ in frames], float)
    net = Net()
    read = torch.cat([frame["read"].flatten(1) for frame, _ in frames], 1)
    if a.begin:
        begin_with(net, a.begin)
    else:
        net.mean.copy_(read.mean(1)[:, None, None])
        net.deviation.copy_(read.std(1)[:, None, None] + 1e-3)
    optimiser = torch.optim.Adam(net.parameters(), a.rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, a.rate, a.steps, pct_start=0.1)
    begin, smooth = time.time(), 0.0
    for step in range(a.steps):
        chosen = rng.choice(len(frames), a.batch, p=weights / weights.sum())
        read, candidates, r, noise = [torch.stack(t) for t in zip(*(tile(frames[k][0], a.tile, rng) for k in chosen))]
        shares, error = net(read)
        out = mixed(shares, candidates)
        each = loss(out, r, torch.stack([frames[k][1] for k in chosen]), a.flicker)
        share = torch.tensor([counts[k] / a.samples for k in chosen])
        each = each + 0.1 * error_found(error, out.detach(), r, noise, share)
        # what lies at a tile's border sees less than it will
        inner = lambda t: t[..., 4:-4, 4:-4]
        total = inner(each).mean() + a.blocks * worse(inner(out), inner(candidates[:, :3]), inner(r))
        optimiser.zero_grad()
        total.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        smooth = 0.98 * smooth + 0.02 * float(total.detach())
        if step % 250 == 0:
            print(step, f"{smooth / (1 - 0.98 ** (step + 1)):.3f} {time.time() - begin:.0f} s", flush=True)
    for (name, count), group in [*others.items(), *fit.items()]:
        report(net, group, f"{name} {count}{'' if (name, count) in others else ' (fit)'}")
    if a.weights:
        write(net, a.weights)


if __name__ == "__main__":
    main()
