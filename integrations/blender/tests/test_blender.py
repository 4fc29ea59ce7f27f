"""The extension inside Blender, without a window: run by run.py, which builds and names the zip.

    PYTHON test_blender.py EXTENSION.zip QUELL FOLDER

PYTHON has bpy as a module, or is `blender --background --python test_blender.py --`. FOLDER is empty. Every operator runs
on a small scene, and every bad input says what it should.
"""
import os
import re
import shutil
import sys
import time
import unittest

import bpy

ZIP, QUELL, FOLDER = (os.path.abspath(path) for path in sys.argv[-3:])
FRAMES = 4


def scene():
    return bpy.context.scene


def install():
    done = bpy.ops.extensions.package_install_files(filepath=ZIP, repo="user_default", enable_on_install=True)
    assert done == {"FINISHED"}, done
    return "bl_ext.user_default.quell_denoise"


def build(name):
    """A new file with the factory's cube, a floor and a camera that moves; 4 frames of 96x54 at 2 samples."""
    bpy.ops.wm.read_factory_settings(use_empty=False)
    bpy.ops.preferences.addon_enable(module=MODULE)
    bpy.ops.mesh.primitive_plane_add(size=20, location=(0, 0, -1))
    camera = scene().camera
    for frame in (1, FRAMES):
        camera.location.x = 7.4 - 0.1 * frame
        camera.keyframe_insert("location", frame=frame)
    scene().frame_end = FRAMES
    render = scene().render
    render.engine, scene().cycles.samples = "CYCLES", 2
    render.resolution_x, render.resolution_y = 96, 54
    folder = os.path.join(FOLDER, name)
    os.makedirs(folder)
    bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, "scene.blend"))
    render.filepath = "//render/shot_####"
    preferences().program = QUELL
    return folder


def preferences():
    return bpy.context.preferences.addons[MODULE].preferences


def values(owner):
    """All of a block's settings that can be compared; what follows from others (`file_extension`) is read-only."""
    found = {}
    for item in owner.bl_rna.properties:
        plain = item.type in ("BOOLEAN", "INT", "FLOAT", "STRING", "ENUM") and not getattr(item, "is_array", False)
        if plain and not item.is_readonly:
            found[item.identifier] = getattr(owner, item.identifier)
    return found


def everything():
    """The settings that Prepare could touch, and what it says."""
    now = scene()
    owners = [now, now.render, now.render.image_settings, now.cycles, now.quell_denoise]
    for layer in now.view_layers:
        owners += [layer, layer.cycles]
    return [values(owner) for owner in owners] + [[line.text for line in now.quell_denoise.prepared]]


def tree():
    now = scene()
    return now.compositing_node_group if hasattr(now, "compositing_node_group") else now.node_tree


def nodes(of):
    """The user's nodes and links, as far as they can be written down."""
    ours = {node.name for node in of.nodes if node.get("quell_denoise")}
    listed = {n.name: (n.bl_idname, tuple(n.location), n.mute, n.label) for n in of.nodes if n.name not in ours}
    links = [(k.from_node.name, k.from_socket.name, k.to_node.name, k.to_socket.name) for k in of.links]
    return listed, sorted(link for link in links if not {link[0], link[2]} & ours)


def end_node(of):
    kinds = ("CompositorNodeComposite", "NodeGroupOutput")
    return next(node for node in of.nodes if node.bl_idname in kinds)


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = build(self.id().rsplit(".", 1)[1])

    def says(self, words, operator, *args):
        """The operator ends with an error that has these words, and the panel shows it."""
        with self.assertRaisesRegex(RuntimeError, words):
            operator(*args)
        self.assertRegex(" ".join(operators().State.lines), words)

    def rendered(self):
        return sorted(os.listdir(os.path.join(self.folder, "render")))


def operators():
    return sys.modules[MODULE + ".operators"]


class Whole(Case):
    def test_prepare_render_denoise_load(self):
        self.assertEqual(bpy.ops.quell.prepare(), {"FINISHED"})
        self.assertEqual(bpy.ops.quell.render_and_denoise(), {"FINISHED"})
        names = [f"shot_{n:04d}.exr" for n in range(1, FRAMES + 1)]
        self.assertEqual(self.rendered(), ["quell", *names])
        result = os.path.join(self.folder, "render", "quell")
        self.assertEqual(sorted(os.listdir(result)), names)
        self.assertIn("4 of 4 frames are written", operators().State.lines[0])
        # As prepared there is nothing to complain about.
        self.assertEqual([line for line in operators().State.lines[1:]], [])
        before = {name: os.stat(os.path.join(result, name)).st_mtime_ns for name in names}
        scene().quell_denoise.resume = True
        self.assertEqual(bpy.ops.quell.denoise(), {"FINISHED"})
        self.assertEqual(before, {name: os.stat(os.path.join(result, name)).st_mtime_ns for name in names})
        self.check_load(result, names)
        self.check_noise(result, names)

    def check_load(self, result, names):
        if hasattr(scene(), "compositing_node_group"):
            group = bpy.data.node_groups.new("mine", "CompositorNodeTree")
            group.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
            scene().compositing_node_group = group
            layers, end = group.nodes.new("CompositorNodeRLayers"), group.nodes.new("NodeGroupOutput")
            group.links.new(layers.outputs[0], end.inputs[0])
        else:
            scene().use_nodes = True
        mine = tree().nodes.new("CompositorNodeBlur")
        mine.label, mine.location = "mine", (-900.0, -300.0)
        before = nodes(tree())
        scene().quell_denoise.motion_blur = True
        bpy.ops.ed.undo_push(message="before loading")
        # The second argument is what a click does: remember it for undo.
        self.assertEqual(bpy.ops.quell.load("EXEC_DEFAULT", True), {"FINISHED"})
        self.assertEqual(nodes(tree()), before)
        bpy.ops.ed.undo()
        self.assertEqual(nodes(tree()), before)
        self.assertFalse(any(node.get("quell_denoise") for node in tree().nodes))
        bpy.ops.quell.load()
        bpy.ops.quell.load()
        self.assertEqual(nodes(tree()), before)
        ours = {node.bl_idname: node for node in tree().nodes if node.get("quell_denoise")}
        image = ours["CompositorNodeImage"]
        self.assertEqual((image.frame_start, image.frame_offset, image.frame_duration), (1, 0, FRAMES))
        self.assertEqual((image.image.source, image.image.filepath), ("SEQUENCE", f"//render/quell/{names[0]}"))
        links = [(k.from_node.name, k.from_socket.name, k.to_socket.name) for k in tree().links]
        for source, target in (("Combined", "Image"), ("Vector", "Speed"), ("Depth", "Z")):
            self.assertIn((image.name, source, target), links)
        self.check_frames(result, names, image)

    def check_frames(self, result, names, image):
        """Each frame of the scene shows the file of its number: the difference to that file is black, to others not."""
        of = tree()
        still = of.nodes.new("CompositorNodeImage")
        for node in of.nodes:
            node.mute = node.bl_idname == "CompositorNodeRLayers"
        if hasattr(scene(), "compositing_node_group"):
            mix = of.nodes.new("ShaderNodeMix")
            mix.data_type, mix.blend_type = "RGBA", "DIFFERENCE"
            mix.inputs[0].default_value = 1.0
            a, b, out = mix.inputs[6], mix.inputs[7], mix.outputs[2]
        else:
            mix = of.nodes.new("CompositorNodeMixRGB")
            mix.blend_type = "DIFFERENCE"
            a, b, out = mix.inputs[1], mix.inputs[2], mix.outputs[0]
        of.links.new(out, end_node(of).inputs[0])
        of.links.new(image.outputs["Combined"], a)
        settings = scene().render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        settings.file_format = "OPEN_EXR"
        path = os.path.join(self.folder, "difference.exr")
        for frame, name, same in ((1, names[0], True), (3, names[2], True), (3, names[0], False)):
            still.image = bpy.data.images.load(os.path.join(result, name))
            of.links.new(still.outputs["Combined"], b)
            scene().frame_set(frame)
            scene().render.filepath = path
            bpy.ops.render.render(write_still=True)
            shown = bpy.data.images.load(path)
            worst = max(abs(v) for i, v in enumerate(shown.pixels) if i % 4 < 3)
            bpy.data.images.remove(shown)
            self.assertEqual(worst == 0.0, same, (frame, name, worst))

    def check_noise(self, result, names):
        """What comes out is calmer than what went in: neighbours on the floor differ less."""
        noise = []
        for path in (os.path.join(self.folder, "render", names[1]), os.path.join(result, names[1])):
            pixels = combined(path)
            rows = [pixels[(6 * 96 + x) * 4] for x in range(96)]
            noise.append(sum((a - b) ** 2 for a, b in zip(rows, rows[1:])))
        self.assertLess(noise[1], 0.25 * noise[0])


def combined(path):
    """Pixels of a multi-layer file's Combined, through the compositor: Blender gives no script the layers."""
    of = tree()
    node = of.nodes.new("CompositorNodeImage")
    node.image = bpy.data.images.load(path)
    of.links.new(node.outputs["Combined"], end_node(of).inputs[0])
    scene().render.filepath = os.path.join(FOLDER, "combined.exr")
    bpy.ops.render.render(write_still=True)
    of.nodes.remove(node)
    image = bpy.data.images.load(scene().render.filepath)
    pixels = list(image.pixels)
    bpy.data.images.remove(image)
    return pixels


class Prepare(Case):
    def test_undo_brings_all_back(self):
        scene().render.use_motion_blur = True
        before = everything()
        bpy.ops.ed.undo_push(message="before prepare")
        self.assertEqual(bpy.ops.quell.prepare("EXEC_DEFAULT", True), {"FINISHED"})
        lines = [line.text for line in scene().quell_denoise.prepared]
        self.assertTrue(any(line.startswith("Motion Blur: off") for line in lines))
        self.assertTrue(any("Vector Blur" in line for line in lines))
        after = everything()
        self.assertNotEqual(after, before)
        self.assertEqual(scene().render.image_settings.file_format, "OPEN_EXR_MULTILAYER")
        self.assertEqual(scene().render.image_settings.color_depth, "16")
        bpy.ops.ed.undo()
        self.assertEqual(everything(), before)
        bpy.ops.ed.redo()
        self.assertEqual(everything(), after)
        bpy.ops.quell.prepare()
        self.assertEqual(len(scene().quell_denoise.prepared), 0)

    def test_the_list_is_complete(self):
        before = everything()[:-1]
        bpy.ops.quell.prepare()
        changed = [(k, a[k], b[k]) for a, b in zip(before, everything()[:-1]) for k in a if a[k] != b[k]]
        self.assertEqual(len(changed), len(scene().quell_denoise.prepared), changed)

    def test_other_engines(self):
        scene().render.engine = "BLENDER_WORKBENCH"
        before = everything()
        self.says("choose Cycles", bpy.ops.quell.prepare)
        self.says("choose Cycles", bpy.ops.quell.render_and_denoise)
        self.assertEqual(everything(), before)


class Bad(Case):
    def test_no_program(self):
        preferences().program = ""
        kept = {name: os.environ[name] for name in ("PATH", "HOME")}
        os.environ.update(PATH="/nowhere", HOME=FOLDER)
        try:
            bpy.ops.quell.prepare()
            self.says("quell was not found.*https://github.com/quell-denoise/quell", bpy.ops.quell.render_and_denoise)
            self.assertFalse(os.path.exists(os.path.join(self.folder, "render", "shot_0001.exr")))
            # Beside the .blend file.
            shutil.copy(QUELL, os.path.join(self.folder, "quell"))
            self.assertEqual(operators().find_program(), os.path.join(self.folder, "quell"))
        finally:
            os.environ.update(kept)

    def test_a_program_that_is_not_quell(self):
        preferences().program = shutil.which("ls")
        bpy.ops.quell.prepare()
        self.says("is not the program quell", bpy.ops.quell.render_and_denoise)

    def test_not_saved(self):
        bpy.ops.wm.read_factory_settings(use_empty=False)
        bpy.ops.preferences.addon_enable(module=MODULE)
        preferences().program = QUELL
        scene().render.engine, scene().render.filepath = "CYCLES", "//render/"
        bpy.ops.quell.prepare()
        for operator in (bpy.ops.quell.render_and_denoise, bpy.ops.quell.denoise, bpy.ops.quell.load):
            self.says("Save the .blend file first", operator)

    def test_not_prepared(self):
        self.says("press Prepare", bpy.ops.quell.render_and_denoise)

    def test_a_folder_that_cannot_be_written(self):
        bpy.ops.quell.prepare()
        scene().render.filepath = "//scene.blend/shot_"
        self.says("Cannot write to|is a file", bpy.ops.quell.render_and_denoise)

    def test_nothing_to_do(self):
        bpy.ops.quell.prepare()
        self.says("render first", bpy.ops.quell.denoise)
        self.says("No clean frame", bpy.ops.quell.load)

    def test_files_that_are_no_exr(self):
        bpy.ops.quell.prepare()
        os.makedirs(os.path.join(self.folder, "render"))
        for n in range(1, FRAMES + 1):
            with open(os.path.join(self.folder, "render", f"shot_{n:04d}.exr"), "w") as file:
                file.write("no picture")
        self.says("shot_0001.exr", bpy.ops.quell.denoise)

    def test_cancelled_half_way(self):
        scene().render.resolution_x, scene().render.resolution_y, scene().frame_end = 320, 180, 1
        bpy.ops.quell.prepare()
        bpy.ops.render.render(animation=True)
        folder, many = os.path.join(self.folder, "render"), 40
        for n in range(2, many + 1):
            shutil.copy(os.path.join(folder, "shot_0001.exr"), os.path.join(folder, f"shot_{n:04d}.exr"))
        scene().frame_end = many
        # What the window's timer drives, driven by a loop.
        module = operators()
        job = module.Job(module.sequence_of(scene()), module.find_program())
        job.start()
        while job.step() and job.fraction == 0:
            time.sleep(0.01)
        job.cancel()
        job.finish()
        self.assertEqual(job.outcome, "CANCELLED", job.message)
        files = os.listdir(os.path.join(folder, "quell"))
        self.assertTrue(0 < len([name for name in files if not name.startswith(".")]) < many)
        self.assertEqual([name for name in files if not name.endswith(".exr") or name.startswith(".")], [])
        self.assertEqual(len(os.listdir(folder)), many + 1)
        scene().quell_denoise.resume = True
        self.assertEqual(bpy.ops.quell.denoise(), {"FINISHED"})
        self.assertEqual(len(os.listdir(os.path.join(folder, "quell"))), many)


class Install(unittest.TestCase):
    def test_off_and_on(self):
        bpy.ops.preferences.addon_disable(module=MODULE)
        self.assertFalse(hasattr(bpy.types.Scene, "quell_denoise"))
        bpy.ops.preferences.addon_enable(module=MODULE)
        self.assertTrue(hasattr(bpy.types.Scene, "quell_denoise"))
        self.assertTrue(hasattr(bpy.types, "QUELL_PT_denoise"))

    def test_this_blender_knows_what_the_panel_draws(self):
        """Without a window nothing is drawn, so a name that is gone would only be seen by users."""
        folder = os.path.dirname(operators().__file__)
        source = "".join(open(os.path.join(folder, name)).read() for name in ("operators.py", "panel.py"))
        functions = bpy.types.UILayout.bl_rna.functions
        known = functions["operator"].parameters["icon"].enum_items.keys()
        # Named as an argument, and in the table of outcomes.
        icons = re.findall(r'icon="(\w+)"', source) + re.findall(r'tell\("(\w+)"', source) + ["CANCEL", "DOT"]
        self.assertGreater(len(icons), 10)
        self.assertEqual([icon for icon in icons if icon not in known], [])
        for name in ("progress", "prop", "label", "box", "separator"):
            self.assertIn(name, functions.keys())


if __name__ == "__main__":
    print(f"Blender {bpy.app.version_string}", flush=True)
    MODULE = install()
    done = unittest.main(argv=["test_blender"], exit=False, verbosity=2)
    sys.stdout.flush()
    os._exit(0 if done.result.wasSuccessful() else 1)
