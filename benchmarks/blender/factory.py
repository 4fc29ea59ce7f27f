"""Frames as Blender's factory settings give them, of the yard, 160x90, 4 samples, frames 1 to 4.

    python factory.py --variant passes --out OUT/passes        # with bpy 4.5 or 5.0: pip install bpy==4.5.15 | 5.0.1
    python factory.py --variant passes --reference --out OUT/reference

Factory settings are kept: denoising on (so `Combined` is filtered), seed 0 in every frame, adaptive sampling, Blackman-Harris
filter, compositing on. Changed are the engine (Cycles), size, samples, the file format (multi-layer OpenEXR, half, ZIP)
and what the variant says:

    bare      nothing else: the view layer's own passes
    passes    all light passes, Position, Normal, Depth, Vector and denoising data, as a user of a denoiser switches on
    nodes     `passes`, with the default compositing nodes (render layers to output)
    blur      `passes`, with motion blur
    fixed     `passes`, without denoising and with an animated seed: what a user is told to do

What each file holds is in README.md beside this file. References (256 samples, no denoising, seed 100000 + frame) are of
the same settings else; those of `blur` have motion blur too.
"""
import argparse
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import bpy

import make_sequence
import yard


def composite(scene):
    """The nodes that Blender makes when compositing is switched on."""
    if hasattr(scene, "compositing_node_group"):
        tree = bpy.data.node_groups.new("compositing", "CompositorNodeTree")
        scene.compositing_node_group = tree
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        end = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        end = tree.nodes.new("CompositorNodeComposite")
    layers = tree.nodes.new("CompositorNodeRLayers")
    tree.links.new(layers.outputs["Image"], end.inputs[0])


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("--variant", choices=("bare", "passes", "nodes", "blur", "fixed"), required=True)
    ap.add_argument("--reference", action="store_true")
    ap.add_argument("--out", required=True)
    ap.add_argument("--frames", default="1-4")
    a = ap.parse_args()

    bpy.ops.wm.read_factory_settings()
    for found in list(bpy.data.objects):
        bpy.data.objects.remove(found)
    yard.build()
    scene = bpy.context.scene
    render, cycles, layer = scene.render, scene.cycles, scene.view_layers[0]
    render.engine, cycles.device = "CYCLES", "CPU"
    render.resolution_x, render.resolution_y = 160, 90
    cycles.samples = 256 if a.reference else 4
    if a.variant != "bare":
        make_sequence.passes(layer)
    if a.variant == "nodes":
        composite(scene)
    render.use_motion_blur = a.variant == "blur"
    if a.variant == "fixed" or a.reference:
        cycles.use_denoising = False
    make_sequence.output(render)
    os.makedirs(a.out, exist_ok=True)
    for frame in make_sequence.numbers(a.frames):
        scene.frame_set(frame)
        if a.reference:
            cycles.seed, cycles.use_adaptive_sampling = 100000 + frame, False
        elif a.variant == "fixed":
            cycles.seed = frame
        render.filepath = os.path.join(a.out, f"yard.{frame:04d}.exr")
        bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
