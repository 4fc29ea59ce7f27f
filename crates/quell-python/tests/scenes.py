"""Small noisy sequences: a wall of stripes that moves by two pixels a frame, with a highlight that moves with it."""

import numpy as np

HEIGHT, WIDTH = 28, 40


def frame(number, dtype=np.float32):
    """Passes of one frame as (height, width, channels), and depth without that axis."""
    random = np.random.default_rng(number + 100)
    x = np.arange(WIDTH) + 2 * number
    stripe = (x // 5) % 2 == 0
    albedo = np.empty((HEIGHT, WIDTH, 3))
    albedo[:] = np.where(stripe[None, :, None], [0.8, 0.5, 0.2], [0.1, 0.3, 0.6])
    rows = np.linspace(0.5, 1.5, HEIGHT)[:, None, None]
    matte = rows * random.gamma(2.0, 0.5, (HEIGHT, WIDTH, 3))
    glossy = 0.3 * random.gamma(1.0, 1.0, (HEIGHT, WIDTH, 3))
    normal = np.zeros((HEIGHT, WIDTH, 3))
    normal[..., 2] = 1.0
    depth = 3.0 + 0.01 * (np.arange(WIDTH)[None, :] + np.arange(HEIGHT)[:, None])
    motion = np.zeros((HEIGHT, WIDTH, 2))
    motion[..., 0] = 2.0
    white = np.ones((HEIGHT, WIDTH, 3))
    found = dict(
        color=matte * albedo + glossy, albedo=albedo, normal=normal, depth=depth, motion=motion, matte=matte,
        glossy=glossy, white=white,
    )  # fmt: skip
    return {name: value.astype(dtype) for name, value in found.items()}


def sequence(numbers, dtype=np.float32):
    frames = [frame(number, dtype) for number in numbers]
    return {name: np.stack([f[name] for f in frames]) for name in frames[0]}


_LETTERS = {1: "V", 2: "XY", 3: "RGB", 4: "RGBA"}


def channels(passes):
    """Arrays as the channels of a file: `color` has no layer, depth is `Z`."""
    found = {}
    for name, array in passes.items():
        if array.ndim == 2:
            found["Z" if name == "depth" else name] = array
            continue
        letters = "XYZW" if name == "Vector" else _LETTERS[array.shape[2]]
        for c, letter in enumerate(letters):
            found[letter if name == "color" else f"{name}.{letter}"] = array[..., c]
    return found


def pick(found, name, count):
    """Channels of a file as an array again."""
    letters = _LETTERS[count]
    return np.stack([found[letter if name == "color" else f"{name}.{letter}"] for letter in letters], axis=-1)
