"""Train the net of the sequence filter's stage `blend`: the shares of input, wavelet's picture and stabilised picture, and the kernels
that their mixture is filtered with.

    python3 benchmarks/nets/blend.py VIEWS LADDER --fit harbour,workshop,night,drawn --report yard,kitchen --weights crates/quell/src/stages/blend/weights.bin

VIEWS holds what the example `blend_views` writes, LADDER the sequences of `benchmarks/ladder` with their references, and under
`drawn/SEED` those of scenes drawn by chance. Where a frame has no reference its rendering at 64 samples is one, for fewer samples. Needs
`pip install torch numpy OpenEXR`. The scenes of `--report`, and every seventh drawn one, are never trained on: their figures are printed.

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

CANDIDATES, READ, WIDTHS = 3, 35, (16, 32, 32)
# Of the kernel.
SIDE = 3
# The last of what the net reads are feature buffers: albedo, normal, depth.
ALBEDO, NORMAL = slice(READ - 7, READ - 4), slice(READ - 4, READ - 1)
# Of the kernel's own pixel, to begin with: the others count as little as they may and still be found.
CENTRE = 5.0
# `blend.kernel_noise`
KERNEL_NOISE = 0.15
# Samples of references: for the expected error of what is compared with them.
REFERENCE, SUBSTITUTE = 256, 64


def load(folder, found):
    """What the net reads, the candidates, the reference and the noise of every frame that has all: (channels, height, width)."""
    import exr_sequence

    frames = []
    for name in sorted(os.listdir(folder)):
        number = int(name.split(".")[0])
        if name.endswith(".npy") and number in found:
            data = torch.tensor(np.load(os.path.join(folder, name))).permute(2, 0, 1)
            samples = SUBSTITUTE if "noisy_" in found[number] else REFERENCE
            picture = torch.tensor(exr_sequence.beauty(found[number]).astype(np.float32)).permute(2, 0, 1)
            frames.append({"candidates": data[:9], "noise": data[9:10], "read": data[10:], "reference": picture, "samples": samples})
    return frames


class Net(nn.Module):
    def __init__(self):
        super().__init__()
        a, b, c = WIDTHS
        conv = lambda i, o, side=3: nn.Conv2d(i, o, side, padding=side // 2, padding_mode="replicate")
        shapes = [(READ, a, 1), (a, a), (a, b), (b, c), (c, c), (b + c, b), (a + b, a), (a, CANDIDATES + 1 + SIDE * SIDE, 1)]
        self.layers = nn.ModuleList([conv(*shape) for shape in shapes])
        # All candidates alike to begin with: from there none is given up too early.
        nn.init.zeros_(self.layers[-1].weight)
        nn.init.zeros_(self.layers[-1].bias)
        self.layers[-1].bias.data[CANDIDATES + 1 + SIDE * SIDE // 2] = CENTRE
        self.register_buffer("mean", torch.zeros(READ, 1, 1))
        self.register_buffer("deviation", torch.ones(READ, 1, 1))

    def forward(self, x):
        """Shares; kernels; and `log2` of the expected squared error over the noise."""
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
        return g / g.sum(1, keepdim=True), torch.softmax(y[:, CANDIDATES + 1 :], 1), y[:, CANDIDATES]


def mixed(shares, kernels, candidates, noise=None):
    """The mixture of the candidates, filtered; with the noise's variance as far as the noise is strong: `blend.kernel_noise`."""
    n, _, h, w = candidates.shape
    mixture = (shares[:, :, None] * candidates.view(n, CANDIDATES, 3, h, w)).sum(1)
    wider = F.pad(mixture, [SIDE // 2] * 4, mode="replicate")
    taps = [wider[..., k // SIDE : k // SIDE + h, k % SIDE : k % SIDE + w] for k in range(SIDE * SIDE)]
    change = sum(kernels[:, k : k + 1] * tap for k, tap in enumerate(taps)) - mixture
    if noise is None:
        return mixture + change
    brightness = F.avg_pool2d(candidates[:, 3:].mean(1, keepdim=True), 5, 1, 2, count_include_pad=False)
    relative = noise / (brightness.square() + 1e-12)
    return mixture + relative / (relative + KERNEL_NOISE**2) * change


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


def recoloured(parts, rng):
    """Channels of colour in another order and normals turned, so that the net learns none by heart; sometimes without buffers, as from
    renderers that have none."""
    order = torch.tensor(rng.permutation(3))
    colours = lambda t: t.view(-1, 3, *t.shape[1:])[:, order].reshape(t.shape)
    read, candidates, reference, noise = parts
    read = read.clone()
    contrast, offset = rng.uniform(0.5, 1.2), rng.uniform(0, 0.3)
    read[:9], read[ALBEDO] = colours(read[:9]), colours(read[ALBEDO]) * contrast + offset
    turn = torch.tensor(np.linalg.qr(rng.normal(size=(3, 3)))[0].astype(np.float32))
    read[NORMAL] = torch.einsum("ij,jhw->ihw", turn, read[NORMAL])
    if rng.random() < 0.1:
        read[ALBEDO] = 0
    if rng.random() < 0.1:
        read[NORMAL.start :] = 0
    return [read, colours(candidates), colours(reference), noise]


def tile(frame, size, rng):
    """A part of a frame, turned and mirrored at random."""
    h, w = frame["reference"].shape[-2:]
    y, x = rng.integers(0, h - size + 1), rng.integers(0, w - size + 1)
    parts = [frame[k][:, y : y + size, x : x + size] for k in ("read", "candidates", "reference", "noise")]
    parts = recoloured(parts, rng)
    for turn in (lambda t: t.flip(-1), lambda t: t.flip(-2), lambda t: t.transpose(-1, -2)):
        if rng.random() < 0.5:
            parts = [turn(t) for t in parts]
    return parts


def report(net, frames, name):
    rows = []
    blocks = lambda error: F.avg_pool2d(error[None, None], 16)
    for frame in frames:
        with torch.no_grad():
            shares, kernels, _ = net(frame["read"][None])
        r = last(frame["reference"])
        pictures = [last(frame["candidates"][3 * k : 3 * k + 3]) for k in range(CANDIDATES)] + [last(mixed(shares, kernels, frame["candidates"][None], frame["noise"][None])[0])]
        worse = (blocks(relative(pictures[3], r)) > 1.1 * blocks(relative(pictures[0], r))).float().mean()
        rows.append([np.array(figures(p, r)) for p in pictures] + [shares.mean((0, 2, 3)).numpy(), float(worse)])
    first, wavelet, steady, out, shares, worse = [np.mean([row[k] for row in rows], 0) for k in range(6)]
    print(f"{name:28} net {line(first, out)} blocks worse {worse:.3f}   stabilised {line(first, steady)}   wavelet {line(first, wavelet)}   shares {' '.join('%.2f' % s for s in shares)}", flush=True)


def values(net):
    """All that the file of weights holds, in its order."""
    return [net.mean, net.deviation] + [v for layer in net.layers for v in (layer.weight, layer.bias)]


def begin_with(net, path, read, outputs):
    """The weights of a net that reads the first `read` of the inputs and gives the first `outputs`. The rest stays as it is."""
    found = torch.tensor(np.fromfile(path, "<f2").astype(np.float32))
    all_values = values(net)
    shapes = [list(v.shape) for v in all_values]
    shapes[0][0] = shapes[1][0] = shapes[2][1] = read
    shapes[-2][0] = shapes[-1][0] = outputs
    parts = found.split([int(np.prod(shape)) for shape in shapes])
    with torch.no_grad():
        for value, part, shape in zip(all_values, parts, shapes):
            value[tuple(slice(n) for n in shape)] = part.view(shape)


def given(net, read, outputs):
    """1 for each weight that `begin_with` takes from a file, 0 for the others."""
    marks = [torch.ones_like(p) for p in net.parameters()]
    marks[0][:, read:] = 0
    marks[-2][outputs:] = 0
    marks[-1][outputs:] = 0
    return marks


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
    ap.add_argument("--begin-read", type=int, default=READ, help="inputs that those read, of which the others' weights begin at random")
    ap.add_argument("--begin-outputs", type=int, default=CANDIDATES + 1 + SIDE * SIDE)
    ap.add_argument("--rate", type=float, default=2e-3)
    ap.add_argument("--steps", type=int, default=3000)
    ap.add_argument("--decay", type=float, default=0.1, help="of the weights")
    ap.add_argument("--near", type=float, default=0.0, help="of the distance from the weights that --begin gave, in place of 0")
    ap.add_argument("--batch", type=int, default=6)
    ap.add_argument("--tile", type=int, default=56, help="pixels, of which 4 at each border do not count; 8 more than a multiple of 16")
    ap.add_argument("--flicker", type=float, default=3.0, help="weight of the error of the logarithm")
    ap.add_argument("--blocks", type=float, default=10.0, help="weight of blocks that are worse than the input")
    ap.add_argument("--many", type=float, default=1.5, help="how much more often sequences of 64 samples are drawn")
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
    # A picture counts by its pixels, up to a point; a sequence as much however many frames it has; many samples more, which are rarer.
    share = lambda count, group: (a.many if count == "noisy_64" else 1.0) / len(group)
    weights = np.array([min(f["noise"].numel(), 60000) * share(count, group) for (_, count), group in fit.items() for f in group])
    net = Net()
    read = torch.cat([frame["read"].flatten(1) for frame, _ in frames], 1)
    net.mean.copy_(read.mean(1)[:, None, None])
    net.deviation.copy_(read.std(1)[:, None, None] + 1e-3)
    if a.begin:
        begin_with(net, a.begin, a.begin_read, a.begin_outputs)
    optimiser = torch.optim.AdamW(net.parameters(), a.rate, weight_decay=a.decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, a.rate, a.steps, pct_start=0.1)
    begun = [(p, p.detach().clone(), known) for p, known in zip(net.parameters(), given(net, a.begin_read, a.begin_outputs))]
    # The weights that come out are means over the last steps: single ones sway from scene to scene.
    mean = torch.optim.swa_utils.AveragedModel(net, multi_avg_fn=torch.optim.swa_utils.get_ema_multi_avg_fn(0.995))
    begin, smooth = time.time(), 0.0
    for step in range(a.steps):
        chosen = rng.choice(len(frames), a.batch, p=weights / weights.sum())
        read, candidates, r, noise = [torch.stack(t) for t in zip(*(tile(frames[k][0], a.tile, rng) for k in chosen))]
        shares, kernels, error = net(read)
        # All of what the kernel changes counts: trained with less it dares more, and blocks at many samples get worse.
        out = mixed(shares, kernels, candidates)
        each = loss(out, r, torch.stack([frames[k][1] for k in chosen]), a.flicker)
        share = torch.tensor([counts[k] / frames[k][0]["samples"] for k in chosen])
        each = each + 0.1 * error_found(error, out.detach(), r, noise, share)
        # what lies at a tile's border sees less than it will
        inner = lambda t: t[..., 4:-4, 4:-4]
        total = inner(each).mean() + a.blocks * worse(inner(out), inner(candidates[:, :3]), inner(r))
        optimiser.zero_grad()
        total.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        with torch.no_grad():
            for value, start, known in begun if a.near else ():
                value -= known * optimiser.param_groups[0]["lr"] * a.near * (value - start)
        mean.update_parameters(net)
        smooth = 0.98 * smooth + 0.02 * float(total.detach())
        if step % 250 == 0:
            print(step, f"{smooth / (1 - 0.98 ** (step + 1)):.3f} {time.time() - begin:.0f} s", flush=True)
    net = mean.module
    for (name, count), group in [*others.items(), *fit.items()]:
        report(net, group, f"{name} {count}{'' if (name, count) in others else ' (fit)'}")
    if a.weights:
        write(net, a.weights)


if __name__ == "__main__":
    main()
