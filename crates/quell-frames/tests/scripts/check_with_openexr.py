"""Checks a file of `cargo run -p quell-frames --example 01_write_and_read FILE` with the reference library.

Needs PyPI `OpenEXR` and `numpy`. Run: python check_with_openexr.py FILE
"""

import sys

import numpy as np
import OpenEXR

WIDTH, HEIGHT = 40, 22


def main(path):
    with OpenEXR.File(path, separate_channels=True) as file:
        header, channels = dict(file.header()), file.channels()
        pixels = {name: channel.pixels for name, channel in channels.items()}

    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)

    def same(name, expected, kind=np.float32):
        assert pixels[name].dtype == kind, (name, pixels[name].dtype)
        assert np.array_equal(pixels[name], np.broadcast_to(np.asarray(expected, kind), (HEIGHT, WIDTH))), name

    def colour(layer, k):
        for component, values in zip("RGB", (x, y, x + y)):
            same(f"{layer}.{component}", values * np.float32(k))

    colour("Emit", 0.5)
    colour("DiffInd", 0.25)
    colour("GlossInd", 0.125)
    colour("DiffCol", 0.0625)
    for component in "RGB":
        same(f"GlossCol.{component}", 1.0)
        same(f"quell.pass.matte.key light.{component}", 0.5)
        same(f"quell.half_a.matte.{component}", 0.125)
    same("A", 1.0)
    same("Depth.Z", np.where(y == 0, np.inf, 1 + x))
    for component, value in zip("XYZ", (0.0, 0.6, 0.8)):
        same(f"Normal.{component}", np.where(y == 0, np.float32(0), np.float32(value)))
    # Blender's vectors: the previous position is (x + X, y - Y), rows counted downwards.
    same("Vector.X", x * np.float32(0.5))
    same("Vector.Y", -y * np.float32(0.25))
    assert "Vector.Z" not in pixels
    same("quell.roughness", (x + 100 * y) * np.float32(0.001))
    same("quell.glossy_hit_distance", (x + 100 * y) * 2)
    same("quell.matte_hit_distance", (x + 100 * y) * 4)
    same("quell.surface_id", (x * 70_000 + y).astype(np.uint32), np.uint32)
    same("quell.variance.matte", (x + 100 * y) * np.float32(0.5))
    same("quell.confidence", 0.75)

    # The passes add up by Blender's rule.
    for component in "RGB":
        total = sum(
            pixels[f"{lobe}Col.{component}"] * pixels[f"{lobe}Ind.{component}"] for lobe in ("Diff", "Gloss")
        )
        total = total + pixels[f"Emit.{component}"]
        assert np.allclose(pixels[component], total, rtol=1e-6), component

    assert header["quell.frame"] == 12 and header["quell.exposure"] == 1.5, header
    assert header["quell.content"] == "noisy" and header["quell.scene"] == "example"
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert np.array_equal(np.ravel(header["quell.camera_position"]), [1, 2, 3])
    assert np.array_equal(np.ravel(header["quell.camera_jitter"]), [0.25, -0.125])

    # The matrix multiplies row vectors, as Imath's do: the point 5 in front of the eye is the picture's centre.
    matrix = np.array(header["quell.clip_from_world"], np.float64).reshape(4, 4)
    clip = np.array([1.0, 2.0, -2.0, 1.0]) @ matrix
    assert np.allclose(clip[:2], 0, atol=1e-5) and np.isclose(clip[3], 5), clip
    print(f"{path}: {len(pixels)} channels and the header are as they should be")


if __name__ == "__main__":
    main(sys.argv[1])
