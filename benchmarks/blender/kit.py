"""Materials, shapes, lights and animation for scenes that are built wholly in code (Blender's Python module `bpy`).

Units are metres, z is up. Everything placed by chance takes a `random.Random` with a fixed seed.
"""
import math

import bpy
from mathutils import Euler, Vector


# ---- materials: a base colour is an RGB triple, or a function from a node tree to a colour socket
def material(name, build, socket="Surface"):
    mat = bpy.data.materials.new(name)
    mat.use_nodes = True
    tree = mat.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(build(tree), output.inputs[socket])
    return mat


def set_color(tree, socket, color):
    if callable(color):
        tree.links.new(color(tree), socket)
    else:
        socket.default_value = (*color, 1.0)


def principled(name, color, rough, metal=0.0, coat=0.0):
    def build(tree):
        node = tree.nodes.new("ShaderNodeBsdfPrincipled")
        node.inputs["Roughness"].default_value = rough
        node.inputs["Metallic"].default_value = metal
        node.inputs["Coat Weight"].default_value = coat
        set_color(tree, node.inputs["Base Color"], color)
        return node.outputs[0]

    return material(name, build)


def diffuse(name, color):
    def build(tree):
        node = tree.nodes.new("ShaderNodeBsdfDiffuse")
        set_color(tree, node.inputs["Color"], color)
        return node.outputs[0]

    return material(name, build)


def leaf(name, color, through=0.35):
    """Diffuse on both sides, and lets a share `through` of the light pass."""

    def build(tree):
        front, back, mix = (tree.nodes.new(f"Shader{k}") for k in ("NodeBsdfDiffuse", "NodeBsdfTranslucent", "NodeMixShader"))
        set_color(tree, front.inputs["Color"], color)
        set_color(tree, back.inputs["Color"], color)
        mix.inputs[0].default_value = through
        tree.links.new(front.outputs[0], mix.inputs[1])
        tree.links.new(back.outputs[0], mix.inputs[2])
        return mix.outputs[0]

    return material(name, build)


def glass(name, color, ior=1.45, rough=0.0):
    def build(tree):
        node = tree.nodes.new("ShaderNodeBsdfGlass")
        node.inputs["Roughness"].default_value = rough
        node.inputs["IOR"].default_value = ior
        set_color(tree, node.inputs["Color"], color)
        return node.outputs[0]

    return material(name, build)


def emission(name, color, strength):
    def build(tree):
        node = tree.nodes.new("ShaderNodeEmission")
        node.inputs["Strength"].default_value = strength
        set_color(tree, node.inputs["Color"], color)
        return node.outputs[0]

    return material(name, build)


def coordinates(tree, scale, rotation=(0, 0, 0)):
    where, mapping = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Scale"].default_value = scale
    mapping.inputs["Rotation"].default_value = rotation
    tree.links.new(where.outputs["Object"], mapping.inputs["Vector"])
    return mapping.outputs["Vector"]


def ramp(tree, factor, stops):
    node = tree.nodes.new("ShaderNodeValToRGB")
    elements = node.color_ramp.elements
    while len(elements) < len(stops):
        elements.new(1.0)
    for element, (position, color) in zip(elements, stops):
        element.position, element.color = position, (*color, 1)
    tree.links.new(factor, node.inputs[0])
    return node.outputs["Color"]


def checker(a, b, scale):
    def build(tree):
        node = tree.nodes.new("ShaderNodeTexChecker")
        node.inputs["Color1"].default_value, node.inputs["Color2"].default_value = (*a, 1), (*b, 1)
        node.inputs["Scale"].default_value = 1.0
        tree.links.new(coordinates(tree, (scale,) * 3), node.inputs["Vector"])
        return node.outputs["Color"]

    return build


def noise(a, b, scale, stretch=(1, 1, 1), low=0.4, high=0.6, detail=4.0):
    """Fractal noise between two colours; `stretch` makes grain."""

    def build(tree):
        node = tree.nodes.new("ShaderNodeTexNoise")
        node.inputs["Scale"].default_value, node.inputs["Detail"].default_value = scale, detail
        tree.links.new(coordinates(tree, stretch), node.inputs["Vector"])
        return ramp(tree, node.outputs[0], [(low, a), (high, b)])

    return build


def bricks(a, b, mortar, scale, rotation=(0, 0, 0)):
    def build(tree):
        node = tree.nodes.new("ShaderNodeTexBrick")
        for socket, color in (("Color1", a), ("Color2", b), ("Mortar", mortar)):
            node.inputs[socket].default_value = (*color, 1)
        node.inputs["Scale"].default_value = scale
        tree.links.new(coordinates(tree, (1, 1, 1), rotation), node.inputs["Vector"])
        return node.outputs["Color"]

    return build


# ---- shapes
def mesh(name, points, faces, mat, smooth=False):
    data = bpy.data.meshes.new(name)
    data.from_pydata([tuple(p) for p in points], [], faces)
    data.materials.append(mat)
    if smooth:
        data.polygons.foreach_set("use_smooth", [True] * len(data.polygons))
    data.update()
    found = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(found)
    return found


def box_shape(low, high):
    points = [(x, y, z) for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])]
    return points, [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def box(name, low, high, mat):
    return mesh(name, *box_shape(low, high), mat)


def join(shapes):
    """One (points, faces) of several."""
    points, faces = [], []
    for more_points, more_faces in shapes:
        start = len(points)
        points.extend(more_points)
        faces.extend(tuple(i + start for i in face) for face in more_faces)
    return points, faces


def rod_shape(a, b, radius, sides=8):
    a, b = Vector(a), Vector(b)
    along = (b - a).normalized()
    u = along.orthogonal().normalized()
    v = along.cross(u)
    ring = [radius * (math.cos(t) * u + math.sin(t) * v) for t in (2 * math.pi * i / sides for i in range(sides))]
    faces = [(i, (i + 1) % sides, sides + (i + 1) % sides, sides + i) for i in range(sides)]
    return [a + r for r in ring] + [b + r for r in ring], faces


def lathe(name, profile, mat, at=(0, 0, 0), segments=48):
    """Surface of revolution of [(radius, height), ...] about z, smooth but at corners of more than 60 degrees."""
    rings, faces_of = [], []
    for k, (r, z) in enumerate(profile):
        rings.append((r, z))
        if 0 < k < len(profile) - 1:
            before = Vector((r - profile[k - 1][0], z - profile[k - 1][1]))
            after = Vector((profile[k + 1][0] - r, profile[k + 1][1] - z))
            if before.angle(after) > math.radians(60):
                faces_of.append(False)
                rings.append((r, z))
        faces_of.append(k < len(profile) - 1)
    # `faces_of[i]`: is ring i joined to the next? A corner is two rings that are not
    points = [
        (at[0] + r * math.cos(2 * math.pi * s / segments), at[1] + r * math.sin(2 * math.pi * s / segments), at[2] + z)
        for r, z in rings
        for s in range(segments)
    ]
    faces = [
        (k * segments + s, k * segments + (s + 1) % segments, (k + 1) * segments + (s + 1) % segments, (k + 1) * segments + s)
        for k in range(len(rings) - 1)
        if faces_of[k]
        for s in range(segments)
    ]
    return mesh(name, points, faces, mat, smooth=True)


def ball(name, radius, mat, at, n=32):
    """A sphere that stands on the point `at`."""
    angles = [math.pi * i / n for i in range(n + 1)]
    profile = [(max(radius * math.sin(a), 1e-4), radius - radius * math.cos(a)) for a in angles]
    return lathe(name, profile, mat, at, segments=2 * n)


def torus_shape(radius, tube, n=64, m=10):
    """About the y axis."""
    points = []
    for i in range(n):
        a = 2 * math.pi * i / n
        for j in range(m):
            b = 2 * math.pi * j / m
            r = radius + tube * math.cos(b)
            points.append((r * math.cos(a), tube * math.sin(b), r * math.sin(a)))
    faces = []
    for i in range(n):
        for j in range(m):
            k, l = (i + 1) % n, (j + 1) % m
            faces.append((i * m + j, i * m + l, k * m + l, k * m + j))
    return points, faces


# ---- lights, sky, animation
def light(name, kind, at, energy, color, size=None, towards=None, angle=None):
    data = bpy.data.lights.new(name, kind)
    data.energy, data.color = energy, color
    if size:
        data.shape, data.size, data.size_y = "RECTANGLE", *size
    if angle is not None:
        data.angle = angle
    found = bpy.data.objects.new(name, data)
    found.location = at
    if towards:
        found.rotation_euler = Vector(towards).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(found)
    return found


def sky(horizon, zenith, strength, clouds=0.0):
    """A vertical gradient, optionally with white clouds of fractal noise."""
    world = bpy.data.worlds.new("sky")
    bpy.context.scene.world = world
    world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    new, link = tree.nodes.new, tree.links.new
    output, background, where = (new(f"Shader{k}") for k in ("NodeOutputWorld", "NodeBackground", "NodeTexCoord"))
    split = new("ShaderNodeSeparateXYZ")
    background.inputs["Strength"].default_value = strength
    link(where.outputs["Generated"], split.inputs[0])
    color = ramp(tree, split.outputs["Z"], [(0.0, horizon), (1.0, zenith)])
    if clouds:
        cloud, mix = new("ShaderNodeTexNoise"), new("ShaderNodeMixRGB")
        cloud.inputs["Scale"].default_value, cloud.inputs["Detail"].default_value = 3.0, 5.0
        link(where.outputs["Generated"], cloud.inputs["Vector"])
        white = (clouds,) * 3
        link(ramp(tree, cloud.outputs[0], [(0.5, (0, 0, 0)), (0.7, white)]), mix.inputs[0])
        link(color, mix.inputs[1])
        mix.inputs[2].default_value = (1.1, 1.1, 1.15, 1)
        color = mix.outputs[0]
    link(color, background.inputs["Color"])
    link(background.outputs[0], output.inputs["Surface"])


def animate(found, frames, place):
    """A key at every frame and two beyond each end: `place(t)` gives location and Euler angles, t = 0 at the first."""
    found.rotation_mode = "XYZ"
    for t in range(-2, frames + 2):
        found.location, found.rotation_euler = place(t)
        found.keyframe_insert("location", frame=1 + t)
        found.keyframe_insert("rotation_euler", frame=1 + t)


def key_every_frame(frames, value, owner, path):
    """A key at every frame and two beyond each end, so that nothing is blended at whole frames: `value(t)`, t = 0 at the first."""
    for t in range(-2, frames + 2):
        setattr(owner, path, value(t))
        owner.keyframe_insert(path, frame=1 + t)


def deform(found, frames, shape):
    """Moves the points of a mesh by shape keys, one a frame, which Cycles follows in its vectors: `shape(t)` gives all points."""
    found.shape_key_add(name="basis")
    for t in range(-2, frames + 2):
        block = found.shape_key_add(name=f"t{t}", from_mix=False)
        block.data.foreach_set("co", [c for p in shape(t) for c in p])
        for near in (t - 1, t, t + 1):
            block.value = 1.0 if near == t else 0.0
            block.keyframe_insert("value", frame=1 + near)
    for curve in curves_of(found.data.shape_keys):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def curves_of(owner):
    """The animation curves of `owner`; Blender 5 keeps them in layers."""
    data = owner.animation_data
    if hasattr(data.action, "fcurves"):
        return list(data.action.fcurves)
    return [c for layer in data.action.layers for strip in layer.strips for c in strip.channelbag(data.action_slot).fcurves]


def camera(lens):
    data = bpy.data.cameras.new("camera")
    data.lens, data.sensor_width, data.sensor_fit = lens, 36.0, "HORIZONTAL"
    data.clip_start, data.clip_end = 0.05, 500.0
    found = bpy.data.objects.new("camera", data)
    bpy.context.scene.collection.objects.link(found)
    bpy.context.scene.camera = found
    return found


def look(at, target):
    """Location and Euler angles of a camera at `at` that looks at `target`, upright."""
    quaternion = (Vector(target) - Vector(at)).to_track_quat("-Z", "Y")
    return at, Euler(quaternion.to_euler())
