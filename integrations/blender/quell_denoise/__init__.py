# SPDX-License-Identifier: GPL-3.0-or-later
"""quell in Blender: Prepare, Render and Denoise, Denoise Existing, Load Result, in Output properties.

Nothing here imports bpy before `register`, so that the plain modules can be tested without Blender.
"""


def register():
    from . import operators, panel

    operators.register()
    panel.register()


def unregister():
    from . import operators, panel

    panel.unregister()
    operators.unregister()
