"""Render a sequence of a scene beside this file with Blender's Cycles, for the benchmarks.

    python make_sequence.py --scene workshop --kind noisy     --out OUT/workshop/noisy
    python make_sequence.py --scene workshop --kind reference --out OUT/workshop/reference [--frames 2,4,6-8]
    python make_sequence.py --scene yard [--variant f14|fog|blur] --kind noisy --out OUT/yard/noisy
    python make_sequence.py --scene drawn --draw 88 [--variant f14|blur|fine] --kind noisy --out OUT/drawn/88/noisy

Needs `pip install bpy==5.0.1` (Python 3.11). Scenes are built in code, nothing is loaded. Same version and arguments,
same pixels. Files: OUT/SCENE.####.exr (of a variant OUT/SCENE-VARIANT.####.exr), Blender's own multi-layer OpenEXR, one
part a pass, colours half. Frames that exist are left alone, so an interrupted run goes on.

Noisy frames have seed = frame, references seed = 100000 + frame and the same settings with more samples, so that they are
the mean of the noisy ones. No denoising, no motion blur but in the variant `blur` (half a frame), no adaptive sampling, no
compositing.

    workshop  2 samples, box filter 1 px, no clamping, no caustics: as `hall`
    others    4 samples, and else Blender's defaults: Blackman-Harris filter 1.5 px, indirect clamp 10, filter glossy 1,
              caustics, 12 bounces (`night` 6), sampling pattern `AUTOMATIC`
"""
import argparse
import os
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import bpy

SCENES = ("workshop", "yard", "night", "harbour", "kitchen", "drawn")


def numbers(text):
    """`1-4,7` -> [1, 2, 3, 4, 7]"""
    out = []
    for part in text.split(","):
        first, last = (int(v) for v in (part.split("-") * 2)[:2])
        out.extend(range(first, last + 1))
    return out


def passes(layer):
    layer.name = "ViewLayer"
    for name in ("combined", "z", "position", "normal", "vector", "emit", "environment"):
        setattr(layer, f"use_pass_{name}", True)
    for lobe in ("diffuse", "glossy", "transmission"):
        for kind in ("direct", "indirect", "color"):
            setattr(layer, f"use_pass_{lobe}_{kind}", True)
    layer.cycles.use_pass_volume_direct = layer.cycles.use_pass_volume_indirect = True
    layer.cycles.denoising_store_passes = True


def output(render):
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth, settings.exr_codec = "16", "ZIP"


def as_hall(cycles):
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.sampling_pattern = "TABULATED_SOBOL"
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 6, 4, 4
    cycles.transmission_bounces, cycles.transparent_max_bounces = 6, 4


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("--scene", choices=SCENES, required=True)
    ap.add_argument("--kind", choices=("noisy", "reference"), required=True)
    ap.add_argument("--variant", choices=("plain", "f14", "fog", "blur", "fine"), default="plain")
    ap.add_argument("--draw", type=int, default=0, help="which of the scenes of `drawn`, any number")
    ap.add_argument("--out", required=True)
    ap.add_argument("--frames", help="as 1-4,7; all by default")
    ap.add_argument("--spp", type=int, help="samples; references have 256")
    ap.add_argument("--size", default="320x180")
    ap.add_argument("--seed", type=int, help="one seed for all frames (by default it follows the frame)")
    ap.add_argument("--piece", type=int, default=1, help="which of several independent references: its seeds are PIECE * 100000 + frame")
    ap.add_argument("--threads", type=int, help="threads of Cycles; all by default")
    a = ap.parse_args()

    bpy.ops.wm.read_factory_settings(use_empty=True)
    module = __import__(a.scene)
    change = {"f14": "open_lens", "fog": "fog", "fine": "fine_textures"}.get(a.variant)
    if change and not hasattr(module, change):
        ap.error(f"the scene {a.scene} has no variant {a.variant}")
    drawn = [a.draw] if a.scene == "drawn" else []
    camera = module.build(*drawn)
    if change:
        getattr(module, change)(camera)

    scene = bpy.context.scene
    render, cycles = scene.render, scene.cycles
    render.engine, cycles.device = "CYCLES", "CPU"
    render.resolution_x, render.resolution_y = (int(v) for v in a.size.split("x"))
    render.resolution_percentage, render.fps = 100, 24
    render.use_compositing = render.use_sequencer = False
    render.use_motion_blur, render.motion_blur_shutter = a.variant == "blur", 0.5
    render.use_persistent_data = True
    if a.threads:
        render.threads_mode, render.threads = "FIXED", a.threads
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.samples = a.spp or (256 if a.kind == "reference" else 2 if a.scene == "workshop" else 4)
    if a.scene == "workshop":
        as_hall(cycles)
    if hasattr(module, "settings"):
        module.settings(cycles, *drawn)
    passes(scene.view_layers[0])
    output(render)

    name = a.scene if a.variant == "plain" else f"{a.scene}-{a.variant}"
    os.makedirs(a.out, exist_ok=True)
    for frame in numbers(a.frames) if a.frames else range(1, module.FRAMES + 1):
        path = os.path.join(a.out, f"{name}.{frame:04d}.exr")
        if os.path.exists(path):
            continue
        scene.frame_set(frame)
        cycles.seed = a.seed if a.seed is not None else frame + (100000 * a.piece if a.kind == "reference" else 0)
        render.filepath = path + ".part.exr"
        begin = time.time()
        bpy.ops.render.render(write_still=True)
        os.replace(render.filepath, path)
        print(f"{path}: {time.time() - begin:.1f} s", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
