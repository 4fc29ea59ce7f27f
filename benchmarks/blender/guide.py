"""The pictures of docs/blender.md, made with Blender itself from sequences of `make_sequence.py`.

    python make_sequence.py --scene yard --kind noisy --out OUT/noisy          # and --kind reference
    quell denoise OUT/noisy -o OUT/clean
    python guide.py OUT/noisy OUT/clean OUT/reference MEDIA [--frame 6]

MEDIA gets blender-result.png (noisy, clean, reference), blender-view.png (the numbers in the file as a plain viewer shows
them, and as Blender does) and blender-motion-blur.png (clean, with the Vector Blur node, and rendered with motion blur).
Needs `pip install bpy==5.0.1`, numpy and ImageMagick's `convert`.
"""
import argparse
import os
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import bpy

import make_sequence
import yard

SHUTTER = 0.5


def empty(view="AgX"):
    """A scene whose compositor is all there is to render; its end."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.view_settings.view_transform = view
    tree = bpy.data.node_groups.new("guide", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    scene.compositing_node_group = tree
    return scene, tree, tree.nodes.new("NodeGroupOutput").inputs[0]


def show(exr, png, view="AgX", blur=False):
    """A frame's Combined as PNG, as Blender's render window shows it."""
    scene, tree, end = empty(view)
    node = tree.nodes.new("CompositorNodeImage")
    node.image = bpy.data.images.load(exr)
    scene.render.resolution_x, scene.render.resolution_y = 320, 180
    out = node.outputs["Combined"]
    if blur:
        vectors = tree.nodes.new("CompositorNodeVecBlur")
        vectors.inputs["Shutter"].default_value = SHUTTER
        for source, target in (("Combined", "Image"), ("Depth", "Z"), ("Vector", "Speed")):
            tree.links.new(node.outputs[source], vectors.inputs[target])
        out = vectors.outputs["Image"]
    tree.links.new(out, end)
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = png
    bpy.ops.render.render(write_still=True)


def blurred(frame, png):
    """The scene with Cycles' own motion blur, 64 samples."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    yard.build()
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
    scene.cycles.samples, scene.cycles.use_denoising = 64, False
    scene.render.resolution_x, scene.render.resolution_y = 320, 180
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, SHUTTER
    scene.frame_set(frame)
    scene.render.filepath = png
    bpy.ops.render.render(write_still=True)


def beside(out, *pictures, crop=None):
    cut = ["-crop", crop, "+repage", "-filter", "point", "-resize", "300%"] if crop else []
    rows = [part for picture in pictures for part in ("(", picture, *cut, ")")]
    subprocess.run(["convert", *rows, "+append", "-strip", "-colors", "250", out], check=True)
    print(f"{out}: {os.path.getsize(out) // 1000} kB")


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("noisy")
    ap.add_argument("clean")
    ap.add_argument("reference")
    ap.add_argument("media")
    ap.add_argument("--frame", type=int, default=6)
    a = ap.parse_args()
    name = f"yard.{a.frame:04d}.exr"
    with tempfile.TemporaryDirectory() as folder:
        path = lambda what: os.path.join(folder, what + ".png")
        for what, source in (("noisy", a.noisy), ("clean", a.clean), ("reference", a.reference)):
            show(os.path.abspath(os.path.join(source, name)), path(what))
        clean = os.path.abspath(os.path.join(a.clean, name))
        show(clean, path("plain"), view="Standard")
        show(clean, path("vector"), blur=True)
        blurred(a.frame, path("blurred"))
        media = lambda what: os.path.join(a.media, f"blender-{what}.png")
        beside(media("result"), path("noisy"), path("clean"), path("reference"))
        beside(media("view"), path("plain"), path("clean"))
        beside(media("motion-blur"), path("clean"), path("vector"), path("blurred"), crop="100x86+113+60")


if __name__ == "__main__":
    main()
