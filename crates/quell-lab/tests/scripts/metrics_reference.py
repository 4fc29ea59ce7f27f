"""Numbers of tests/main/metrics.rs from independent implementations.

FLIP and HDR-FLIP: the authors' own program (PyPI `flip-evaluator`); SSIM: PyPI `scikit-image`; relMSE, fireflies, energy
and PSNR: numpy, from the definitions. Pictures are made by formula, the same in the test.
Run: python metrics_reference.py
"""

import flip_evaluator as flip
import numpy as np
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

WIDTH, HEIGHT = 97, 61


def noise(seed, count):
    """The top 24 bits of a 32-bit linear congruential generator, 0..1."""
    state, values = seed, np.empty(count, np.float32)
    for i in range(count):
        state = (state * 1664525 + 1013904223) & 0xFFFFFFFF
        values[i] = np.float32((state >> 8) / 16777216.0)
    return values


def pictures():
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float64)
    u, v = x / WIDTH, y / HEIGHT
    wave = 0.5 + 0.5 * np.sin(0.9 * x) * np.cos(0.35 * y)
    reference = np.stack([0.05 + 0.9 * u * wave, 0.1 + 0.6 * v, 0.8 - 0.6 * u], axis=-1)
    disc = (x - 60.0) ** 2 + (y - 25.0) ** 2 < 15.0**2
    reference[disc] = [0.9, 0.15, 0.1]
    reference = reference.astype(np.float32)
    grain = noise(7, HEIGHT * WIDTH * 3).reshape(HEIGHT, WIDTH, 3)
    noisy = (reference * (np.float32(0.6) + np.float32(0.8) * grain)).astype(np.float32)
    blurred = reference.copy()
    blurred[:, 1:-1] = (reference[:, :-2] + reference[:, 1:-1] + reference[:, 2:]) / np.float32(3.0)
    scale = np.where(disc, np.float32(30.0), np.float32(0.7)).astype(np.float32)[..., None]
    return reference, noisy, blurred, (reference * scale), (noisy * scale), (blurred * scale)


def rel_mse(picture, reference):
    d, r = picture.astype(np.float64), reference.astype(np.float64)
    mean_luminance = (r @ np.array([0.2126, 0.7152, 0.0722])).mean()
    error = ((d - r) ** 2 / (r**2 + 0.01 * mean_luminance**2)).mean(axis=-1).ravel()
    error.sort()
    return error.mean(), error[: len(error) - int(np.ceil(len(error) * 0.001))].mean()


def tone(c):
    """The curve of tone.rs: a shoulder on the largest component that fades to white, then sRGB."""
    c = np.maximum(c.astype(np.float64), 0.0)
    peak = c.max(axis=-1, keepdims=True)
    start = 0.3
    new_peak = 1.0 - (1.0 - start) ** 2 / (peak + 1.0 - start - start)
    white = 1.0 - 1.0 / (0.4 * (peak - new_peak) + 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        shown = c * new_peak / peak
    shown = np.where(peak < start, c, shown + (new_peak - shown) * white)
    return np.where(shown <= 0.0031308, 12.92 * shown, 1.055 * shown ** (1 / 2.4) - 0.055)


def psnr(picture, reference):
    return -10.0 * np.log10(((tone(picture) - tone(reference)) ** 2).mean())


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def ssim(picture, reference):
    """Of the luma as it is shown; window, constants and border as in the paper of 2004."""
    a, b = tone(picture) @ LUMINANCE, tone(reference) @ LUMINANCE
    return structural_similarity(
        a, b, data_range=1.0, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
    )


def spotted(reference):
    """Three pixels far too bright, one black."""
    picture = reference.copy()
    for x, y, v in [(5, 5, 400.0), (50, 40, 900.0), (90, 7, 5000.0)]:
        picture[y, x] = v
    picture[30, 30] = 0.0
    return picture


def fireflies(picture, reference):
    d, r = picture.astype(np.float64) @ LUMINANCE, reference.astype(np.float64) @ LUMINANCE
    limit = 10.0 * np.sort(r.ravel())[int((r.size - 1) * 0.999)]
    return int((np.abs(d - r) > limit).sum())


def main():
    reference, noisy, blurred, reference_hdr, noisy_hdr, blurred_hdr = pictures()
    for name, picture in [("noisy", noisy), ("blurred", blurred)]:
        picture = np.clip(picture, 0, 1)
        _, mean, _ = flip.evaluate(np.clip(reference, 0, 1), picture, "LDR", inputsRGB=False, applyMagma=False)
        print(f"ldr {name}: {mean:.6f}")
    for name, picture in [("noisy", noisy_hdr), ("blurred", blurred_hdr)]:
        parameters = {"startExposure": -4.0, "stopExposure": 2.0, "numExposures": 6, "tonemapper": "ACES"}
        error, mean, _ = flip.evaluate(
            reference_hdr, picture, "HDR", applyMagma=False, parameters=parameters
        )
        print(f"hdr {name}: {mean:.6f}; at (30, 20): {error[20, 30].item():.6f}, at (60, 25): {error[25, 60].item():.6f}")
        print(f"relMSE {name}: mean %.6f, trimmed %.6f" % rel_mse(picture, reference_hdr))
        shown, shown_reference = tone(picture), tone(reference_hdr)
        by_skimage = peak_signal_noise_ratio(shown_reference, shown, data_range=1.0)
        print(f"PSNR {name}: {psnr(picture, reference_hdr):.5f}; by scikit-image: {by_skimage:.5f}")
        print(f"SSIM {name}: {ssim(picture, reference_hdr):.6f}")
        print(f"energy {name}: {picture.astype(np.float64).sum() / reference_hdr.astype(np.float64).sum():.6f}")
        linear = lambda p: np.where(tone(p) <= 0.04045, tone(p) / 12.92, ((tone(p) + 0.055) / 1.055) ** 2.4)
        _, mean, _ = flip.evaluate(
            linear(reference_hdr).astype(np.float32), linear(picture).astype(np.float32), "LDR", inputsRGB=False,
            applyMagma=False
        )
        print(f"FLIP of the tone-mapped {name}: {mean:.6f}")
    picture = spotted(reference_hdr)
    print("spotted: relMSE %.6f, trimmed %.6f" % rel_mse(picture, reference_hdr), end="")
    print(f", fireflies {fireflies(picture, reference_hdr)}")
    _, mean, used = flip.evaluate(reference_hdr, noisy_hdr, "HDR", applyMagma=False)
    print(f"hdr noisy, automatic exposures: {mean:.6f} with {used}")


if __name__ == "__main__":
    main()
