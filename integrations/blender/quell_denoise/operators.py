# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons, the settings behind them, and the one job that may run."""
import os

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, PointerProperty, StringProperty

from . import binary, compositor, frames, prepare
from .errors import Problem
from .job import Job

TICK_SECONDS = 0.2


class State:
    """What the panel shows of jobs; not part of the file, and never undone."""

    job = None
    icon = ""
    # Where it was looked for, the program's path, the problem there was.
    program = (None, "", None)
    # The last outcome: a message, then details.
    lines = ()

    @classmethod
    def tell(cls, icon, *lines):
        cls.icon, cls.lines = icon, lines
        _redraw()


def _redraw():
    for window in getattr(bpy.context.window_manager, "windows", ()):
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()


class QuellLine(bpy.types.PropertyGroup):
    text: StringProperty()


class QuellSettings(bpy.types.PropertyGroup):
    depth: EnumProperty(
        name="Color Depth",
        description="Of the colours in the rendered files; depth, normals and vectors are float in any case",
        items=(
            ("16", "Half", "Small files; light above 65504 is cut"),
            ("32", "Float", "Twice the size, any brightness"),
        ),
    )
    resume: BoolProperty(
        name="Keep Finished Frames",
        description="Leave frames alone that quell wrote from these files with these settings before. "
        "Off: all are denoised anew, as they must be after a new render",
    )
    motion_blur: BoolProperty(
        name="Motion Blur",
        description="With the result, add a Vector Blur node: motion blur made from the motion vectors, with the shutter of "
        "the render settings",
    )
    prepared: CollectionProperty(type=QuellLine)


class QuellPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    program: StringProperty(
        name="Program",
        description="The program quell, or the folder that it lies in. Empty: looked for on PATH, beside the .blend file and "
        "where cargo and pip install",
        subtype="FILE_PATH",
    )

    def draw(self, context):
        self.layout.prop(self, "program")
        program, problem = known_program()
        if problem is None:
            self.layout.label(text=f"Found: {program}", icon="CHECKMARK")
        else:
            wrapped(self.layout, str(problem), context, icon="ERROR")


def wrapped(layout, text, context, icon="NONE"):
    """Labels do not wrap."""
    width = max(24, int(getattr(context.region, "width", 400) / 6.5 / context.preferences.system.ui_scale) - 4)
    line, lines = "", []
    for word in text.split():
        if line and len(line) + 1 + len(word) > width:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}".strip()
    column = layout.column(align=True)
    for i, part in enumerate([*lines, line]):
        column.label(text=part, icon=icon if i == 0 else "BLANK1" if icon != "NONE" else "NONE")


def _where():
    addon = bpy.context.preferences.addons.get(__package__)
    return bpy.path.abspath(addon.preferences.program) if addon else "", os.path.dirname(bpy.data.filepath)


def find_program():
    """The program's path, or a Problem; what was found is kept for `known_program`."""
    where = _where()
    try:
        State.program = (where, binary.find(*where), None)
    except Problem as problem:
        State.program = (where, "", problem)
        raise
    return State.program[1]


def known_program():
    """The same for drawing, searched for only where it may have changed.

    Python that waits for a disk while a panel is drawn lets the render's thread in, and Blender may then take all later
    scripts for drawing ones that must not write (seen in 4.3).
    """
    if State.program[0] != _where() and State.job is None:
        try:
            find_program()
        except Problem:
            pass
    return State.program[1:]


def sequence_of(scene):
    """The files of a scene's render."""
    render = scene.render
    if render.use_multiview and render.image_settings.views_format == "INDIVIDUAL":
        raise Problem("Stereo in a file for each eye: choose Views Format Multi-View in Output properties")
    return frames.sequence(
        lambda frame: render.frame_path(frame=frame),
        scene.frame_start,
        scene.frame_end,
        scene.frame_step,
        saved=bool(bpy.data.filepath),
    )


def check_cycles(scene):
    if scene.render.engine != "CYCLES":
        raise Problem("quell filters what Cycles traced: choose Cycles as Render Engine in Render properties")


class _Operator(bpy.types.Operator):
    """Reports what went wrong, in the panel too."""

    def stop(self, problem):
        State.tell("ERROR", str(problem))
        self.report({"ERROR"}, str(problem))
        return {"CANCELLED"}


class QUELL_OT_prepare(_Operator):
    bl_idname = "quell.prepare"
    bl_label = "Prepare"
    bl_description = "Set the scene up for quell: passes on, denoising and motion blur off, animated seed, OpenEXR MultiLayer"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        scene = context.scene
        try:
            check_cycles(scene)
        except Problem as problem:
            return self.stop(problem)
        settings = scene.quell_denoise
        found, hints = prepare.changes(scene, settings.depth)
        lines = prepare.apply(found)
        settings.prepared.clear()
        for line in lines + hints:
            settings.prepared.add().text = line
            self.report({"INFO"}, line)
        State.tell("CHECKMARK", f"Prepared: {len(lines)} settings changed, listed below" if lines else "All is set already")
        return {"FINISHED"}


class WindowRender:
    """Blender's own render of the animation, in its own window and thread."""

    def __init__(self):
        self.cancelled = False
        self._running = False

    def start(self):
        self._running = True
        self._handlers(add=True)
        try:
            started = bpy.ops.render.render("INVOKE_DEFAULT", animation=True)
        except RuntimeError as error:
            self._handlers(add=False)
            raise Problem(str(error).strip()) from error
        if "CANCELLED" in started:
            self._handlers(add=False)
            raise Problem("Blender does not render: another render may be running")

    def step(self):
        if self._running:
            return True
        self._handlers(add=False)
        return False

    def cancel(self):
        """Blender lets no script stop a render: its own window does, with Esc. What follows is left out."""

    def _complete(self, *_):
        self._running = False

    def _cancel(self, *_):
        self.cancelled, self._running = True, False

    def _handlers(self, add):
        for handlers, call in (
            (bpy.app.handlers.render_complete, self._complete),
            (bpy.app.handlers.render_cancel, self._cancel),
        ):
            if add:
                handlers.append(call)
            elif call in handlers:
                handlers.remove(call)


class ScriptRender:
    """The same for scripts and for Blender without a window: `start` returns when all is rendered."""

    cancelled = False

    def start(self):
        try:
            bpy.ops.render.render(animation=True)
        except RuntimeError as error:
            raise Problem(str(error).strip()) from error

    def step(self):
        return False

    def cancel(self):
        pass


class _Denoise(_Operator):
    """Both operators that run the program; `invoke` in a window never blocks, `execute` in a script does."""

    def render(self, window):
        """What renders, or None."""
        return None

    def make(self, context, window):
        if State.job is not None:
            raise Problem("quell is at work already: wait, or cancel")
        scene = context.scene
        found = sequence_of(scene)
        program = find_program()
        job = Job(found, program, self.render(window), scene.quell_denoise.resume)
        job.start()
        return job

    def execute(self, context):
        try:
            job = self.make(context, window=False)
        except Problem as problem:
            return self.stop(problem)
        job.finish()
        return self.finish(job)

    def invoke(self, context, event):
        if bpy.app.background:
            return self.execute(context)
        try:
            self.job = State.job = self.make(context, window=True)
        except Problem as problem:
            return self.stop(problem)
        State.tell("")
        manager = context.window_manager
        self.timer = manager.event_timer_add(TICK_SECONDS, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        running = self.job.step()
        _redraw()
        if running:
            return {"PASS_THROUGH"}
        self.release(context)
        return self.finish(self.job)

    def cancel(self, context):
        """Blender ends, or another file is opened."""
        self.job.stop_now()
        self.release(context)

    def release(self, context):
        context.window_manager.event_timer_remove(self.timer)
        State.job = None

    def finish(self, job):
        level, icon = {
            "DONE": ("INFO", "CHECKMARK"),
            "PARTIAL": ("WARNING", "ERROR"),
            "CANCELLED": ("WARNING", "CANCEL"),
        }.get(job.outcome, ("ERROR", "ERROR"))
        State.tell(icon, job.message, *job.notes)
        for note in job.notes:
            self.report({"WARNING"}, note)
        self.report({level}, job.message)
        return {"FINISHED"} if job.outcome in ("DONE", "PARTIAL") else {"CANCELLED"}


class QUELL_OT_denoise(_Denoise):
    bl_idname = "quell.denoise"
    bl_label = "Denoise Existing"
    bl_description = "Denoise the frames that are rendered already, into the folder quell beside them"


class QUELL_OT_render_and_denoise(_Denoise):
    bl_idname = "quell.render_and_denoise"
    bl_label = "Render and Denoise"
    bl_description = "Render the animation, then denoise it into the folder quell beside it"

    def render(self, window):
        return WindowRender() if window else ScriptRender()

    def make(self, context, window):
        check_cycles(context.scene)
        return super().make(context, window)


class QUELL_OT_cancel(bpy.types.Operator):
    bl_idname = "quell.cancel"
    bl_label = "Cancel"
    bl_description = "Stop denoising; frames that are written stay, and none is half written"

    @classmethod
    def poll(cls, context):
        return State.job is not None

    def execute(self, context):
        State.job.cancel()
        return {"FINISHED"}


class QUELL_OT_load(_Operator):
    bl_idname = "quell.load"
    bl_label = "Load Result"
    bl_description = "Add the clean frames to the compositor as an Image node; your own nodes and links stay as they are"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        scene = context.scene
        try:
            lines = compositor.load(scene, sequence_of(scene), scene.quell_denoise.motion_blur)
        except Problem as problem:
            return self.stop(problem)
        State.tell("CHECKMARK", *lines)
        for line in lines:
            self.report({"INFO"}, line)
        return {"FINISHED"}


CLASSES = (
    QuellLine,
    QuellSettings,
    QuellPreferences,
    QUELL_OT_prepare,
    QUELL_OT_denoise,
    QUELL_OT_render_and_denoise,
    QUELL_OT_cancel,
    QUELL_OT_load,
)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.quell_denoise = PointerProperty(type=QuellSettings)


def unregister():
    if State.job is not None:
        State.job.stop_now()
        State.job = None
    State.lines = ()
    del bpy.types.Scene.quell_denoise
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
