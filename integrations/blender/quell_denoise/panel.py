# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel in Output properties."""
import bpy

from .operators import State, known_program, wrapped


class QUELL_PT_denoise(bpy.types.Panel):
    bl_label = "quell Denoise"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "output"

    def draw(self, context):
        layout = self.layout
        settings = context.scene.quell_denoise
        _, problem = known_program()
        if problem is not None:
            wrapped(layout.box(), str(problem), context, icon="ERROR")

        column = layout.column()
        row = column.row()
        row.operator("quell.prepare", icon="PREFERENCES")
        row.prop(settings, "depth", text="")

        job = State.job
        column.separator()
        buttons = column.column(align=True)
        buttons.enabled = job is None
        buttons.operator("quell.render_and_denoise", icon="RENDER_ANIMATION")
        buttons.operator("quell.denoise", icon="SEQUENCE")
        options = column.row()
        options.enabled = job is None
        options.prop(settings, "resume")
        if job is not None:
            row = column.row()
            row.progress(factor=job.fraction, text=job.text())
            if not job.cancelling:
                row.operator("quell.cancel", text="", icon="X")

        column.separator()
        row = column.row()
        row.enabled = job is None
        row.operator("quell.load", icon="NODE_COMPOSITING")
        row.prop(settings, "motion_blur")

        if State.lines and State.lines[0] != str(problem):
            box = layout.box()
            for i, line in enumerate(State.lines):
                wrapped(box, line, context, icon=State.icon if i == 0 else "DOT")


class QUELL_PT_prepared(bpy.types.Panel):
    bl_label = "What Prepare Changed"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "output"
    bl_parent_id = "QUELL_PT_denoise"

    @classmethod
    def poll(cls, context):
        return len(context.scene.quell_denoise.prepared) > 0

    def draw(self, context):
        column = self.layout.column(align=True)
        for line in context.scene.quell_denoise.prepared:
            wrapped(column, line.text, context, icon="DOT")


CLASSES = (QUELL_PT_denoise, QUELL_PT_prepared)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
