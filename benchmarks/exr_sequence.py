"""Reading and writing of EXR sequences for the scripts beside this file.

Needs `pip install OpenEXR numpy`. A frame is a dictionary from a pass (`Combined`, `Diffuse Direct`, ...; "" where a
file names none) to a float32 array (height, width, components), components in the order R G B A, X Y Z W or u v.
"""
import os
import re

import numpy as np
import OpenEXR

ORDER = {c: i for i, c in enumerate(["R", "G", "B", "A", "X", "Y", "Z", "W", "u", "v"])}


def files(folder):
    """{frame number: path} of the EXR files in `folder`, the number being the last one in the name."""
    found = {}
    for name in sorted(os.listdir(folder)):
        match = re.search(r"(-?\d+)\.exr$", name)
        if match:
            number = int(match.group(1))
            if number in found:
                raise SystemExit(f"{folder}: two files of frame {number}: {os.path.basename(found[number])}, {name}")
            found[number] = os.path.join(folder, name)
    if not found:
        raise SystemExit(f"{folder}: no EXR file whose name ends in a number")
    return found


def short(layer):
    """The pass of a layer name: what stands after the view layer's name (`ViewLayer.Combined` -> `Combined`)."""
    return layer.rsplit(".", 1)[-1]


def read(path, passes=None):
    """The passes of a file (all, or those named), of every part."""
    grouped, owner = {}, {}
    for part in OpenEXR.File(path, separate_channels=True).parts:
        for name, channel in part.channels.items():
            layer, _, component = name.rpartition(".")
            key = short(layer)
            if passes is not None and key not in passes:
                continue
            # of two layers with this pass the first counts, but the compositor's result only where it is alone
            if owner.setdefault(key, layer).startswith("Composite.") and layer != owner[key]:
                owner[key], grouped[key] = layer, []
            if layer == owner[key]:
                grouped.setdefault(key, []).append((ORDER.get(component, 99), component, channel.pixels))
    return {
        key: np.stack([np.asarray(p, np.float32) for _, _, p in sorted(found, key=lambda c: c[:2])], -1)
        for key, found in grouped.items()
    }


def beauty(path, name=None):
    """Linear RGB (height, width, 3) of the pass `name`; without one of `Combined`, else of plain R, G, B."""
    found = read(path, {name} if name else {"Combined", ""})
    for key in [name] if name else ["Combined", ""]:
        if key in found and found[key].shape[-1] >= 3:
            return found[key][..., :3]
    raise SystemExit(f"{path}: no pass {name or 'Combined, nor R, G, B'}")


def write(path, passes, half=True):
    """One part, ZIP; `passes` as `read` gives them, of three or four components, `Combined` among them."""
    channels = {}
    for key, pixels in passes.items():
        for i, component in enumerate("RGBA"[: pixels.shape[-1]]):
            name = f"ViewLayer.{key}.{component}" if key else component
            channels[name] = np.clip(pixels[..., i], -65504, 65504).astype(np.float16 if half else np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(path)
