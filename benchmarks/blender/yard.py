"""A yard in the sun: the reported second sequence. Another character than the hall: outdoors, thin things everywhere.

A picket fence and a wire one, bushes and a tree of single leaves, a veranda in the shade, a bicycle wheel that spins 11
degrees a frame, a flat mirror, a clear glass ball, a varnished body, hard shadows of the sun, a cloudy sky; the camera
orbits 1.6 degrees a frame. The variants: `f14` is a lens at f/1.4 focused before the wheel, `fog` fills the yard with a
thin mist.
"""
import math
import random

import bpy
from mathutils import Vector

import kit

FRAMES = 12


def leaves(rng, centre, radius, count, size):
    """Quads scattered in an ellipsoid, denser outside, each turned by chance."""
    points, faces = [], []
    for _ in range(count):
        d = Vector((rng.gauss(0, 1), rng.gauss(0, 1), rng.gauss(0, 1))).normalized()
        r = (0.45 + 0.55 * rng.random()) if rng.random() < 0.8 else rng.random()
        at = Vector(centre) + Vector((d.x * radius[0], d.y * radius[1], d.z * radius[2])) * r
        n = Vector((rng.gauss(0, 1), rng.gauss(0, 1), rng.gauss(0.7, 1))).normalized()
        u = n.orthogonal().normalized()
        u = (u * math.cos(a := 6.2832 * rng.random()) + n.cross(u) * math.sin(a)) * size * (0.7 + 0.6 * rng.random())
        v = n.cross(u) * 0.5
        start = len(points)
        points += [at - u, at + v, at + u, at - v]
        faces.append((start, start + 1, start + 2, start + 3))
    return points, faces


def grass(rng, count):
    points, faces = [], []
    for _ in range(count):
        x, y = rng.uniform(-4.5, 4.5), rng.uniform(-4.5, 4.0)
        if abs(x) < 1.2 and abs(y) < 1.2:
            continue
        h, a = rng.uniform(0.08, 0.22), rng.uniform(0, 6.2832)
        lean = Vector((math.cos(a), math.sin(a), 0)) * 0.05
        side = Vector((-math.sin(a), math.cos(a), 0)) * 0.012
        base = Vector((x, y, 0))
        start = len(points)
        points += [base - side, base + side, base + lean + Vector((0, 0, h))]
        faces.append((start, start + 1, start + 2))
    return points, faces


def build():
    rng = random.Random(11)
    lawn = kit.diffuse("lawn", kit.noise((0.13, 0.22, 0.05), (0.22, 0.24, 0.09), 3.0))
    blade = kit.leaf("blade", (0.16, 0.32, 0.06))
    paving = kit.principled("paving", kit.bricks((0.50, 0.47, 0.42), (0.40, 0.38, 0.35), (0.18, 0.17, 0.15), 1.7), 0.55)
    paint = kit.principled("paint", (0.82, 0.82, 0.78), 0.4)
    bark = kit.diffuse("bark", kit.noise((0.20, 0.13, 0.08), (0.10, 0.07, 0.05), 9.0, (1, 1, 0.2)))
    green = kit.leaf("green", (0.14, 0.34, 0.06))
    light_green = kit.leaf("light_green", (0.30, 0.42, 0.08))
    rubber = kit.principled("rubber", (0.03, 0.03, 0.035), 0.6)
    chrome = kit.principled("chrome", (0.85, 0.85, 0.87), 0.12, metal=1.0)
    mirror = kit.principled("mirror", (0.95, 0.95, 0.95), 0.0, metal=1.0)
    varnish = kit.principled("varnish", (0.55, 0.03, 0.03), 0.35, coat=1.0)
    clear = kit.glass("glass", (0.96, 1.0, 0.98))
    brick = kit.diffuse("brick", kit.bricks((0.50, 0.26, 0.17), (0.40, 0.19, 0.13), (0.66, 0.62, 0.56), 1.1, (math.pi / 2, 0, 0)))
    wire = kit.principled("wire", (0.5, 0.5, 0.52), 0.35, metal=1.0)

    kit.box("ground", (-60, -60, -0.2), (60, 60, 0.0), lawn)
    kit.box("terrace", (-1.25, -1.25, 0.0), (1.25, 1.25, 0.03), paving)
    kit.mesh("grass", *grass(rng, 900), blade)
    kit.box("house", (0.9, 5.6, 0.0), (7.0, 6.2, 3.4), brick)
    # a veranda before it: shade that only sky and ground light
    kit.box("roof", (-0.2, 2.4, 2.15), (7.0, 5.6, 2.3), bark)
    columns = [kit.rod_shape((x, 2.55, 0), (x, 2.55, 2.15), 0.05) for x in (-0.1, 3.3, 6.8)]
    kit.mesh("columns", *kit.join(columns), paint, smooth=True)
    kit.box("door", (1.8, 5.56, 0.0), (2.7, 5.6, 2.1), paint)

    # fences: white pickets behind, thin wires before the tree
    pickets = [kit.box_shape((-5.2 + 0.19 * i, 3.6, 0.06), (-5.2 + 0.19 * i + 0.07, 3.63, 1.0 + 0.05 * (i % 2))) for i in range(56)]
    pickets += [kit.box_shape((-5.3, 3.63, z), (5.5, 3.66, z + 0.06)) for z in (0.3, 0.78)]
    kit.mesh("pickets", *kit.join(pickets), paint)
    wires = [kit.rod_shape((-3.6, 0.75, z), (-1.3, 0.95, z), 0.006, 6) for z in (0.2, 0.35, 0.5, 0.65, 0.8)]
    wires += [kit.rod_shape((-3.6 + 0.46 * i, 0.75 + 0.04 * i, 0), (-3.6 + 0.46 * i, 0.75 + 0.04 * i, 0.85), 0.012) for i in range(6)]
    kit.mesh("wires", *kit.join(wires), wire, smooth=True)

    # a tree and bushes of single leaves
    kit.lathe("trunk", [(0.16, 0.0), (0.11, 0.6), (0.09, 1.5), (0.06, 2.3)], bark, (-2.2, 1.6, 0), 16)
    twigs = []
    for i in range(14):
        a, z = 2.399 * i, 1.1 + 0.09 * i
        twigs.append(kit.rod_shape((-2.2, 1.6, z), (-2.2 + 0.8 * math.cos(a), 1.6 + 0.8 * math.sin(a), z + 0.5), 0.014, 6))
    kit.mesh("twigs", *kit.join(twigs), bark)
    kit.mesh("crown", *leaves(rng, (-2.2, 1.6, 2.35), (1.15, 1.15, 0.85), 620, 0.14), green)
    kit.mesh("bush", *leaves(rng, (2.5, 2.2, 0.45), (0.7, 0.55, 0.5), 420, 0.12), light_green)
    # a hedge and posts behind the camera, for the mirror
    kit.mesh("hedge", *leaves(rng, (4.5, -7.2, 0.9), (5.0, 0.7, 1.1), 4000, 0.12), green)
    posts = [kit.rod_shape((1.0 + i, -6.2, 0), (1.0 + i, -6.2, 2.6), 0.06) for i in range(7)]
    kit.mesh("posts", *kit.join(posts), paint)
    kit.mesh("bush_b", *leaves(rng, (-0.6, 3.0, 0.3), (0.5, 0.35, 0.35), 260, 0.11), green)

    # the wheel on its stand: rim, tyre, 28 spokes, hub; it turns about the y axis
    stand = [kit.rod_shape((-0.05 + s, y, 0.03), (-0.05, y, 0.62), 0.014) for s in (-0.22, 0.22) for y in (-0.09, 0.09)]
    kit.mesh("stand", *kit.join(stand), wire, smooth=True)
    spokes = []
    for i in range(28):
        a = 2 * math.pi * i / 28
        y = 0.03 if i % 2 else -0.03
        spokes.append(kit.rod_shape((0.02 * math.cos(a), y, 0.02 * math.sin(a)), (0.5 * math.cos(a), 0, 0.5 * math.sin(a)), 0.0045, 6))
    spokes.append(kit.rod_shape((0, -0.1, 0), (0, 0.1, 0), 0.022, 12))
    spokes.append(kit.torus_shape(0.50, 0.014))
    rim = kit.mesh("rim", *kit.join(spokes), chrome, smooth=True)
    tyre = kit.mesh("tyre", *kit.torus_shape(0.535, 0.026), rubber, smooth=True)
    flag = kit.mesh("flag", [(0.30, -0.02, -0.05), (0.44, -0.02, -0.05), (0.44, -0.02, 0.05), (0.30, -0.02, 0.05)], [(0, 1, 2, 3)],
                    kit.diffuse("flag", (0.9, 0.45, 0.05)))
    for spinning in (rim, tyre, flag):
        kit.animate(spinning, FRAMES, lambda t: ((-0.05, 0, 0.62), (0, math.radians(11 * t), 0)))

    # mirror, glass, varnished body, an upright pole
    tilt = kit.box("mirror", (-0.55, -0.01, 0.0), (0.55, 0.01, 1.5), mirror)
    tilt.location, tilt.rotation_euler = (1.35, 1.15, 0.05), (math.radians(3), 0, math.radians(-16))
    frame = [kit.box_shape((-0.60, -0.02, 0.0), (-0.55, 0.02, 1.5)), kit.box_shape((0.55, -0.02, 0.0), (0.60, 0.02, 1.5)),
             kit.box_shape((-0.60, -0.02, 1.5), (0.60, 0.02, 1.55))]
    around = kit.mesh("frame", *kit.join(frame), bark)
    around.location, around.rotation_euler = tilt.location, tilt.rotation_euler
    kit.ball("glass_ball", 0.24, clear, (0.75, -0.55, 0.03))
    kit.lathe("body", [(0.001, 0.0), (0.30, 0.02), (0.38, 0.16), (0.34, 0.34), (0.16, 0.46), (0.001, 0.48)], varnish, (-0.95, -0.55, 0.03))
    kit.ball("chrome_ball", 0.13, chrome, (-0.35, -0.85, 0.03))

    kit.light("sun", "SUN", (0, 0, 10), 4.0, (1.0, 0.94, 0.84), towards=(0.55, 0.62, -0.72), angle=math.radians(0.53))
    kit.sky((0.80, 0.88, 1.0), (0.16, 0.34, 0.80), 1.5, clouds=0.9)

    camera = kit.camera(35.0)

    def orbit(t):
        a = math.radians(-104 + 1.6 * t)
        return kit.look((5.0 * math.cos(a), 5.0 * math.sin(a), 1.5), (0.0, 0.35, 0.72))

    kit.animate(camera, FRAMES, orbit)
    return camera


def open_lens(camera):
    camera.data.dof.use_dof = True
    camera.data.dof.focus_distance = 4.4
    camera.data.dof.aperture_fstop = 1.4
    # a lens of 35 mm would hardly blur a yard: the sensor of a larger camera with the same view
    camera.data.lens, camera.data.sensor_width = 180.0, 36.0 * 180.0 / 35.0


def fog(_camera):
    """A box of thin, forward-scattering mist around yard and camera."""
    mat = bpy.data.materials.new("mist")
    mat.use_nodes = True
    tree = mat.node_tree
    tree.nodes.clear()
    output, scatter = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeVolumeScatter")
    scatter.inputs["Density"].default_value = 0.06
    scatter.inputs["Anisotropy"].default_value = 0.3
    scatter.inputs["Color"].default_value = (0.95, 0.96, 1.0, 1)
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    kit.box("mist", (-9, -9, -0.05), (9, 9, 4.0), mat)
