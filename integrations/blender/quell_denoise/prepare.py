# SPDX-License-Identifier: GPL-3.0-or-later
"""What Prepare changes in a scene, and why. Works on anything with Blender's attributes."""
from dataclasses import dataclass

# quell reads all of them; DWA, B44 and PXR24 damage depth, normals and vectors.
LOSSLESS = ("NONE", "ZIP", "ZIPS", "PIZ", "RLE")

_LOBES = ("diffuse", "glossy", "transmission")
_LAYER_PASSES = (
    ("combined", "Combined", "the picture"),
    ("z", "Depth", "tells surfaces apart"),
    ("normal", "Normal", "tells surfaces apart"),
    ("position", "Position", "tells the camera's way"),
    ("vector", "Vector", "finds a surface again in other frames"),
    *((f"{lobe}_{kind}", f"{lobe.title()} {kind.title()}", "light") for lobe in _LOBES for kind in ("direct", "indirect")),
    *((f"{lobe}_color", f"{lobe.title()} Color", "taken out of the light, so that textures stay sharp") for lobe in _LOBES),
    ("emit", "Emission", "all light passes together make the picture"),
    ("environment", "Environment", "all light passes together make the picture"),
)


@dataclass
class Change:
    """One setting that is not as it should be. `apply` makes it so."""

    owner: object
    attribute: str
    label: str
    old: object
    new: object
    reason: str

    def apply(self):
        setattr(self.owner, self.attribute, self.new)

    def text(self):
        if isinstance(self.new, bool):
            return f"{self.label}: {'on' if self.new else 'off'} ({self.reason})"
        return f"{self.label}: {_word(self.old)} → {_word(self.new)} ({self.reason})"


def _word(value):
    if isinstance(value, float):
        return f"{value:g}"
    words = {"16": "Half", "32": "Float", "OPEN_EXR_MULTILAYER": "OpenEXR MultiLayer", "MULTI_LAYER_IMAGE": "Multi-Layer EXR"}
    return words.get(str(value), str(value))


def changes(scene, depth="16"):
    """What has to be changed, in the order in which it must be applied, and hints to the user.

    `depth` is "16" (half; data passes are float all the same) or "32" (float, for light above 65504).
    """
    found, hints = [], []

    def wish(owner, attribute, label, new, reason):
        if not hasattr(owner, attribute):
            hints.append(f"This Blender has no setting {attribute} ({label}): left alone")
            return
        old = getattr(owner, attribute)
        if old != new:
            found.append(Change(owner, attribute, label, old, new, reason))

    render, cycles = scene.render, scene.cycles
    wish(cycles, "use_denoising", "Sampling > Denoise", False, "quell needs the light as it was traced")
    wish(cycles, "use_animated_seed", "Sampling > Animate Seed", True, "noise must differ between frames to average out")
    if getattr(cycles, "scrambling_distance", 1.0) != 1.0:
        wish(cycles, "scrambling_distance", "Sampling > Scrambling Distance", 1.0, "less makes neighbours share their noise")
    if getattr(cycles, "auto_scrambling_distance", False):
        wish(cycles, "auto_scrambling_distance", "Sampling > Automatic Scrambling", False, "it makes neighbours share noise")
    if render.use_motion_blur:
        hints.append(
            "Motion blur comes back on the clean frames: Load Result with Motion Blur adds a Vector Blur node "
            f"(shutter {render.motion_blur_shutter:g})"
        )
    wish(render, "use_motion_blur", "Motion Blur", False, "with it on Cycles writes motion vectors of zero")

    for layer in scene.view_layers:
        if not layer.use:
            continue
        name = f"{layer.name} > Passes"
        for attribute, label, reason in _LAYER_PASSES:
            wish(layer, f"use_pass_{attribute}", f"{name} > {label}", True, reason)
        for kind in ("direct", "indirect"):
            wish(layer.cycles, f"use_pass_volume_{kind}", f"{name} > Volume {kind.title()}", True, "light")
        wish(layer.cycles, "denoising_store_passes", f"{name} > Denoising Data", True, "what mirrors and glass show")

    image = render.image_settings
    if hasattr(image, "media_type"):  # Blender 5
        wish(image, "media_type", "Output > Media Type", "MULTI_LAYER_IMAGE", "all passes in one file")
    wish(image, "file_format", "Output > File Format", "OPEN_EXR_MULTILAYER", "all passes in one file")
    wish(image, "color_depth", "Output > Color Depth", depth, "colours; data passes are float in any case")
    if image.exr_codec not in LOSSLESS:
        wish(image, "exr_codec", "Output > Codec", "ZIP", f"{image.exr_codec} damages depth, normals and vectors")
    wish(render, "use_file_extension", "Output > File Extensions", True, "files are found by their names")
    if scene.frame_step != 1:
        hints.append(f"Frame Step is {scene.frame_step}: frames that do not follow each other are filtered one by one")
    return found, hints


def apply(found):
    """Applies changes; their lines."""
    lines = []
    for change in found:
        change.apply()
        lines.append(change.text())
    return lines
