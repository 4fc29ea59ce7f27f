"""The buttons in a Blender with a window, as a click runs them: Blender stays usable, progress moves, cancel stops.

    apt-get install blender xvfb xdotool imagemagick
    xvfb-run -s "-screen 0 1200x1500x24" blender --factory-startup --window-geometry 0 0 1200 1500 \\
        --python integrations/blender/tests/test_window.py -- EXTENSION.zip QUELL FOLDER

A full Blender of 4.2 or later (the wheels have no window); FOLDER is empty, and gets screenshots. Exit status 0 if all holds.
"""
import os
import shutil
import sys
import traceback

import bpy

ZIP, QUELL, FOLDER = (os.path.abspath(path) for path in sys.argv[-3:])
MODULE = "bl_ext.user_default.quell_denoise"
FRAMES, MANY = 3, 60


def operators():
    return sys.modules[MODULE + ".operators"]


def window():
    return bpy.context.window_manager.windows[0]


def area(kind):
    """The largest area becomes an editor of this kind."""
    found = max(window().screen.areas, key=lambda a: a.width * a.height)
    found.ui_type = kind
    return found


def click(operator):
    """As a button does."""
    here = area("PROPERTIES")
    region = next(r for r in here.regions if r.type == "WINDOW")
    with bpy.context.temp_override(window=window(), area=here, region=region):
        try:
            return operator("INVOKE_DEFAULT", True)
        except RuntimeError:  # An error was reported.
            return {"CANCELLED"}


def refused(operator, words):
    """The operator does nothing, and the panel says why."""
    assert click(operator) == {"CANCELLED"}
    lines = " ".join(operators().State.lines)
    assert words in lines, lines


def shot(name):
    """What the X server shows: Blender's own screenshots of software OpenGL are black."""
    os.system(f"import -window root '{os.path.join(FOLDER, name)}.png'")


def until(done, seconds=120):
    for _ in range(seconds * 10):
        if done():
            return
        yield 0.1
    raise AssertionError("waited in vain")


def steps():
    """A generator: each yield gives Blender its window back for so many seconds."""
    scene = bpy.context.scene
    state = operators().State
    here = area("PROPERTIES")
    yield 1.0
    here.spaces.active.context = "OUTPUT"
    yield 1.0
    refused(bpy.ops.quell.render_and_denoise, "press Prepare")
    assert click(bpy.ops.quell.prepare) == {"FINISHED"}
    assert not scene.cycles.use_denoising
    bpy.ops.ed.undo()
    assert bpy.context.scene.cycles.use_denoising, "undo"
    bpy.ops.ed.redo()
    scene = bpy.context.scene
    assert not scene.cycles.use_denoising, "redo"
    yield 0.5
    shot("prepared")

    # Without a program: a message in the panel, and nothing happens.
    bpy.context.preferences.addons[MODULE].preferences.program = "/nowhere"
    refused(bpy.ops.quell.render_and_denoise, "no program there")
    yield 0.5
    shot("no-program")
    bpy.context.preferences.addons[MODULE].preferences.program = QUELL

    assert click(bpy.ops.quell.render_and_denoise) == {"RUNNING_MODAL"}
    assert state.job.rendering
    refused(bpy.ops.quell.denoise, "at work already")
    ticks = 0
    seen = set()
    while state.job is not None:
        ticks += 1
        seen.add(state.job.text().split(":")[0])
        yield 0.05
    assert ticks > 5 and "Rendering" in seen, (ticks, seen)
    assert f"{FRAMES} of {FRAMES} frames are written" in state.lines[0], state.lines
    yield 0.5
    shot("done")
    folder = os.path.dirname(scene.render.frame_path(frame=1))
    assert len(os.listdir(os.path.join(folder, "quell"))) == FRAMES

    for n in range(FRAMES + 1, MANY + 1):
        shutil.copy(os.path.join(folder, "shot_0001.exr"), os.path.join(folder, f"shot_{n:04d}.exr"))
    scene.frame_end = MANY
    assert click(bpy.ops.quell.denoise) == {"RUNNING_MODAL"}
    yield from until(lambda: state.job.fraction > 0.2)
    # Blender is usable meanwhile: the user works on.
    bpy.context.object.location.z += 0.5
    shot("progress")
    assert click(bpy.ops.quell.cancel) == {"FINISHED"}
    yield from until(lambda: state.job is None)
    assert "Cancelled" in state.lines[0], state.lines
    written = [name for name in os.listdir(os.path.join(folder, "quell")) if not name.startswith(".")]
    assert 0 < len(written) < MANY, len(written)
    yield 0.5
    shot("cancelled")

    # A render that is stopped in its own window: nothing is denoised, and the message says how to go on.
    scene.frame_end, scene.cycles.samples = FRAMES, 4096
    shutil.rmtree(folder)
    assert click(bpy.ops.quell.render_and_denoise) == {"RUNNING_MODAL"}
    yield 2.0
    os.system("xdotool key Escape")
    yield from until(lambda: state.job is None, 30)
    assert "Rendering was cancelled" in state.lines[0], state.lines
    assert os.listdir(os.path.join(folder, "quell")) == []

    scene.cycles.samples = 2
    assert click(bpy.ops.quell.render_and_denoise) == {"RUNNING_MODAL"}
    yield from until(lambda: state.job is None)
    scene.quell_denoise.motion_blur = True
    assert click(bpy.ops.quell.load) == {"FINISHED"}
    here = area("CompositorNodeTree")
    yield 1.0
    region = next(r for r in here.regions if r.type == "WINDOW")
    with bpy.context.temp_override(window=window(), area=here, region=region):
        bpy.ops.node.view_all()
    yield 1.5
    shot("loaded")


def drive(sequence):
    """A timer's function that goes through the steps and ends Blender."""

    def tick():
        try:
            return next(sequence)
        except StopIteration:
            print("window: all passed", flush=True)
            os._exit(0)
        except BaseException:
            traceback.print_exc()
            sys.stderr.flush()
            shot("failed")
            os._exit(1)

    return tick


def begin():
    done = bpy.ops.extensions.package_install_files(filepath=ZIP, repo="user_default", enable_on_install=True)
    assert done == {"FINISHED"}, done
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.render_display_type = "NONE"
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=20, location=(0, 0, -1))
    camera = scene.camera
    for frame in (1, FRAMES):
        camera.location.x = 7.4 - 0.1 * frame
        camera.keyframe_insert("location", frame=frame)
    scene.frame_end = FRAMES
    scene.render.engine, scene.cycles.samples = "CYCLES", 2
    scene.render.resolution_x, scene.render.resolution_y = 320, 180
    bpy.ops.wm.save_as_mainfile(filepath=os.path.join(FOLDER, "scene.blend"))
    scene.render.filepath = "//render/shot_####"
    bpy.app.timers.register(drive(steps()), first_interval=1.0)


begin()
