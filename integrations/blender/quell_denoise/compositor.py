# SPDX-License-Identifier: GPL-3.0-or-later
"""The result as an Image node of the compositor, beside the user's nodes and linked to none of them."""
import os

import bpy

from .errors import Problem

# Marks the nodes that are ours, whatever the user calls them.
MARK = "quell_denoise"
_SPACE = 60.0


def _tree(scene):
    """The scene's compositing nodes, made as Blender makes them where there are none: renders stay as they were."""
    if hasattr(scene, "compositing_node_group"):  # Blender 5
        tree = scene.compositing_node_group
        if tree is None:
            tree = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
            tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
            layers, end = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("NodeGroupOutput")
            layers.location, end.location = (-200.0, 0.0), (200.0, 0.0)
            tree.links.new(layers.outputs["Image"], end.inputs[0])
            scene.compositing_node_group = tree
        return tree
    if scene.node_tree is None:
        scene.use_nodes = True
    return scene.node_tree


def _ours(tree, kind):
    return next((node for node in tree.nodes if node.bl_idname == kind and node.get(MARK)), None)


def _new(tree, kind, label, place):
    node = tree.nodes.new(kind)
    node[MARK] = True
    node.label = label
    node.location = place
    return node


def _below(tree):
    """A place below all nodes, at their left edge."""
    if not tree.nodes:
        return (0.0, 0.0)
    left = min(node.location.x for node in tree.nodes)
    # A node's height is known to the window alone: its sockets tell what it will be.
    heights = (160.0 + 22.0 * sum(s.enabled for s in (*node.inputs, *node.outputs)) for node in tree.nodes)
    bottom = min(node.location.y - height for node, height in zip(tree.nodes, heights))
    return (left, bottom - _SPACE)


def load(scene, found, motion_blur=False):
    """Makes the node, or points it at the present result. Returns what was done, a line each."""
    numbers = found.results()
    if not numbers:
        raise Problem(f"No clean frame lies in {found.result}: press Denoise Existing first")
    path = os.path.join(found.result, found.name(numbers[0]))
    tree = _tree(scene)
    node = _ours(tree, "CompositorNodeImage")
    place = _below(tree)
    if node is None:
        node = _new(tree, "CompositorNodeImage", "quell", place)
    old = node.image
    try:
        image = bpy.data.images.load(bpy.path.relpath(path) if bpy.data.filepath and _near(path) else path)
    except RuntimeError as error:
        raise Problem(f"Blender cannot read {path}: {error}") from error
    image.source = "SEQUENCE"
    image.name = "quell"
    node.image = image
    if old is not None and old.users == 0:
        bpy.data.images.remove(old)
    node.frame_start = numbers[0]
    node.frame_offset = numbers[0] - 1
    node.frame_duration = numbers[-1] - numbers[0] + 1
    node.use_auto_refresh = True
    _choose_layer(node, scene)
    lines = [f"Image node 'quell': frames {numbers[0]} to {numbers[-1]} of {found.result}"]
    missing = numbers[-1] - numbers[0] + 1 - len(numbers)
    if missing:
        lines.append(f"{missing} frames in between are missing: they show nothing")
    if motion_blur:
        lines.append(_blur(scene, tree, node))
    if not any(other.bl_idname == "CompositorNodeViewer" for other in tree.nodes):
        viewer = _new(tree, "CompositorNodeViewer", "quell", (node.location.x + 600.0, node.location.y))
        blurred = _ours(tree, "CompositorNodeVecBlur") if motion_blur else None
        tree.links.new((blurred or node).outputs["Image" if blurred else _picture(node)], viewer.inputs[0])
        lines.append("Viewer node: switch on Backdrop in the compositor to see it")
    if hasattr(scene, "node_tree") and not hasattr(scene, "compositing_node_group") and not scene.use_nodes:
        lines.append("Compositing nodes are switched off in this scene (Use Nodes): the node waits there")
    return lines


def _near(path):
    """Relative paths reach only the same drive."""
    return os.path.splitdrive(path)[0] == os.path.splitdrive(bpy.data.filepath)[0]


def _choose_layer(node, scene):
    """A view layer, not the compositor's own picture."""
    if not node.has_layers:
        return
    # Which layers a file has is told to nobody: a name that it lacks raises.
    for layer in scene.view_layers:
        try:
            node.layer = layer.name
            return
        except TypeError:
            continue


def _picture(node):
    names = [socket.name for socket in node.outputs if socket.enabled]
    return next((name for name in ("Combined", "Image") if name in names), names[0])


def _blur(scene, tree, node):
    names = [socket.name for socket in node.outputs]
    wanted = {"Combined": "Image", "Vector": "Speed", "Depth": "Z"}
    lacking = [name for name in wanted if name not in names]
    if lacking:
        return f"No Vector Blur node: the frames hold no {' and no '.join(lacking)}"
    blur = _ours(tree, "CompositorNodeVecBlur")
    if blur is None:
        blur = _new(tree, "CompositorNodeVecBlur", "quell motion blur", (node.location.x + 300.0, node.location.y))
        for source, target in wanted.items():
            tree.links.new(node.outputs[source], blur.inputs[target])
        shutter = scene.render.motion_blur_shutter
        if "Shutter" in blur.inputs:  # Blender 4.5 and later
            blur.inputs["Shutter"].default_value = shutter
        else:
            blur.factor = shutter
    return f"Vector Blur node: motion blur of shutter {scene.render.motion_blur_shutter:g}"
