"""Scenes drawn by chance, for training only: `build(seed)` gives another one for every seed.

A room, a yard or a night; walls and ground with textures, rough, polished or wet; things of plastic, metal, glass, leaf and mirror, some of
them thin (fences, wires, grass); some move, turn or carry a texture; lamps, sun and sky, some of which move or are switched; steam in some.
The camera rests, walks, turns or circles.
"""
import math
import random

import bpy

import kit

FRAMES = 9


def draw(seed):
    """What a scene is like, decided first, so that `settings` agrees with `build`."""
    r = random.Random(1000 + seed)
    return r, r.choice(["room", "yard", "yard", "night"])


def color(r, bright=0.8):
    base = r.uniform(0.05, bright)
    return tuple(min(0.9, base * r.uniform(0.4, 1.3)) for _ in range(3))


def texture(r, bright=0.8):
    a, b = color(r, bright), color(r, bright)
    kind = r.randrange(5)
    if kind == 0:
        return a
    if kind == 1:
        return kit.checker(a, b, r.uniform(1, 12))
    if kind == 2:
        return kit.bricks(a, b, color(r, bright), r.uniform(0.8, 4), (r.choice([0, math.pi / 2]), 0, 0))
    return kit.noise(a, b, r.uniform(1, 25), (r.uniform(0.3, 4), 1, 1), detail=r.choice([2.0, 5.0]))


def surface(r, shiny=0.6):
    """A material of any kind; `shiny`: how often it is not plainly diffuse."""
    if r.random() > shiny:
        return kit.diffuse("matte", texture(r))
    kind = r.randrange(8)
    if kind <= 1:
        return kit.principled("plastic", texture(r), r.uniform(0.1, 0.7), coat=r.choice([0.0, 0.0, 1.0]))
    if kind <= 3:
        return kit.principled("metal", texture(r, 0.9), r.choice([0.0, 0.05, 0.15, 0.3, 0.5]), metal=1.0)
    if kind == 4:
        return kit.glass("glass", tuple(r.uniform(0.7, 1.0) for _ in range(3)), rough=r.choice([0.0, 0.0, 0.2]))
    if kind == 5:
        return kit.principled("mirror", (0.9, 0.9, 0.9), 0.0, metal=1.0)
    return kit.principled("paint", texture(r), r.uniform(0.2, 0.5))


def thing(r, mat):
    """A thing of about one metre around the origin, standing on z = 0."""
    kind = r.randrange(7)
    if kind == 0:
        return kit.ball("ball", r.uniform(0.2, 0.6), mat, (0, 0, 0))
    if kind == 1:
        x, y, z = (r.uniform(0.15, 0.6) for _ in range(3))
        return kit.box("box", (-x, -y, 0), (x, y, 2 * z), mat)
    if kind == 2:
        profile = [(0.001, 0.0)] + [(r.uniform(0.08, 0.4), 0.25 * i) for i in range(r.randrange(3, 7))]
        return kit.lathe("vase", [*profile, (0.001, profile[-1][1])], mat)
    if kind == 3:
        points, faces = kit.torus_shape(r.uniform(0.25, 0.5), r.uniform(0.03, 0.15))
        return kit.mesh("ring", [(x, y, z + 0.6) for x, y, z in points], faces, mat, smooth=True)
    if kind == 4:
        n, length = r.randrange(2, 7), r.uniform(0.3, 0.9)
        blades = [kit.box_shape((-length, -0.02, -0.06), (length, 0.02, 0.06))]
        shape = []
        for i in range(n):
            a = math.pi * i / n
            (points, faces), = blades
            shape.append(([(x * math.cos(a) - z * math.sin(a), y, 1 + x * math.sin(a) + z * math.cos(a)) for x, y, z in points], faces))
        return kit.mesh("wheel", *kit.join(shape), mat)
    if kind == 5:
        rods = [kit.rod_shape((0.12 * i - 0.6, 0, 0), (0.12 * i - 0.6 + r.uniform(-0.1, 0.1), 0, r.uniform(0.7, 1.5)), r.uniform(0.004, 0.03)) for i in range(11)]
        return kit.mesh("rods", *kit.join(rods), mat, smooth=True)
    quads = []
    for _ in range(160):
        x, y, z, s = r.gauss(0, 0.3), r.gauss(0, 0.3), r.uniform(0.2, 1.4), r.uniform(0.04, 0.12)
        u, v = [[r.gauss(0, s) for _ in range(3)] for _ in range(2)]
        corner = lambda a, b: tuple(p + a * q + b * w for p, q, w in zip((x, y, z), u, v))
        quads.append(([corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)], [(0, 1, 2, 3)]))
    return kit.mesh("leaves", *kit.join(quads), kit.leaf("leaf", texture(r, 0.4)))


def fence(r, y):
    mat, step, thick = surface(r), r.uniform(0.15, 0.5), r.uniform(0.004, 0.02)
    rods = [kit.rod_shape((-4 + step * i, y, 0), (-4 + step * (i + r.choice([0, 1])), y, 1.6), thick, 6) for i in range(int(8 / step))]
    rods += [kit.rod_shape((-4, y, z), (4, y, z), thick, 6) for z in (0.4, 0.8, 1.2, 1.6)]
    kit.mesh("fence", *kit.join(rods), mat, smooth=True)
    if r.random() < 0.4:
        kit.mesh("lit", *kit.rod_shape((-4, y - 0.03, 1.0), (4, y - 0.03, 1.0), thick, 6), kit.emission("lit", color(r, 1.0), r.uniform(1, 8)), smooth=True)


def grass(r, mat):
    blades = []
    for _ in range(2500):
        x, y, a, h = r.uniform(-4, 4), r.uniform(-2, 5), r.uniform(0, 6.3), r.uniform(0.05, 0.3)
        dx, dy = 0.012 * math.cos(a), 0.012 * math.sin(a)
        blades.append(([(x - dx, y - dy, 0), (x + dx, y + dy, 0), (x + r.gauss(0, 0.06), y + r.gauss(0, 0.06), h)], [(0, 1, 2)]))
    kit.mesh("grass", *kit.join(blades), mat)


def motion(r, found, at, turn):
    """Most things rest; the others move on a line, turn, or both."""
    speed = (r.gauss(0, 0.05), r.gauss(0, 0.05), 0.0) if r.random() < 0.3 else (0.0, 0.0, 0.0)
    spin = [r.gauss(0, 0.12) for _ in range(3)] if r.random() < 0.25 else [0.0] * 3
    kit.animate(found, FRAMES, lambda t: (tuple(p + t * v for p, v in zip(at, speed)), (t * spin[0], t * spin[1], turn + t * spin[2])))


def lamps(r, place):
    count = r.randrange(1, 4) if place == "room" else r.randrange(2, 6)
    for i in range(count):
        at = (r.uniform(-3, 3), r.uniform(-2, 4), r.uniform(1.8, 2.9))
        power = r.uniform(40, 200) if place == "room" else r.uniform(20, 160)
        kind = r.choice(["AREA", "POINT", "SPOT"])
        found = kit.light("lamp", kind, at, power, tuple(r.uniform(0.5, 1.0) for _ in range(3)), (0.3, r.uniform(0.2, 1.2)) if kind == "AREA" else None,
                          towards=(r.gauss(0, 0.4), r.gauss(0, 0.4), -1))
        if kind != "AREA":
            found.data.shadow_soft_size = r.choice([0.02, 0.1, 0.3])
        fate = r.random()
        if fate < 0.25:
            on, off = r.randrange(2, 8), r.random() < 0.5
            kit.key_every_frame(FRAMES, lambda t: power if (t >= on) != off else 0.0, found.data, "energy")
        elif fate < 0.5:
            v, angle = (r.gauss(0, 0.15), r.gauss(0, 0.15), 0.0), tuple(found.rotation_euler)
            kit.animate(found, FRAMES, lambda t, v=v: (tuple(p + t * q for p, q in zip(at, v)), angle))
    for _ in range(r.randrange(0, 4) if place == "room" else r.randrange(2, 9)):
        at, strength = (r.uniform(-3, 3), r.uniform(-1, 4.5), r.uniform(0.1, 2.2)), r.uniform(1, 30)
        mat = kit.emission("glow", tuple(r.uniform(0.2, 1.0) for _ in range(3)), strength)
        if r.random() < 0.4:
            kit.ball("bulb", r.uniform(0.02, 0.1), mat, at, 12)
        else:
            for k in range(r.randrange(1, 9)):
                kit.box("lamp", (at[0] + 0.16 * k, at[1], at[2]), (at[0] + 0.16 * k + 0.07, at[1] + 0.02, at[2] + 0.07), mat)
        if r.random() < 0.4:
            socket = next(n for n in mat.node_tree.nodes if n.bl_idname == "ShaderNodeEmission").inputs["Strength"]
            period = r.randrange(2, 5)
            kit.key_every_frame(FRAMES, lambda t: strength if t % period else 0.0, socket, "default_value")


def steam(r):
    def build(tree):
        node = tree.nodes.new("ShaderNodeVolumeScatter")
        node.inputs["Density"].default_value = r.uniform(0.3, 1.5)
        return node.outputs[0]

    mat = kit.material("steam", build, socket="Volume")
    for i in range(3):
        found = kit.ball("steam", 0.3 * (1 + 0.4 * i), mat, (0, 0, 0), 12)
        kit.animate(found, FRAMES, lambda t, i=i: ((0.3 + 0.05 * i * math.sin(i + 0.2 * t), 1.0, 0.3 * i + 0.03 * t), (0, 0, 0)))


def build(seed):
    r, place = draw(seed)
    floor = kit.principled("floor", texture(r), r.choice([0.0, 0.1, 0.3, 0.6]), coat=r.choice([0.0, 1.0])) if r.random() < 0.5 else surface(r, 0.2)
    kit.box("floor", (-9, -7, -0.2), (9, 9, 0.0), floor)
    kit.box("back", (-9, 5.0, 0), (9, 5.3, r.uniform(1.5, 5)), surface(r, 0.3))
    if place == "room":
        for at in ((-4.2, -7), (4.0, -7)):
            kit.box("side", (at[0], -7, 0), (at[0] + 0.2, 6, 3.2), surface(r, 0.2))
        kit.box("ceiling", (-5, -7, 3.0), (5, 6, 3.2), kit.diffuse("ceiling", (0.7, 0.7, 0.68)))
        kit.box("front", (-5, -7.2, 0), (5, -7, 3.2), surface(r, 0.2))
    if r.random() < 0.35:
        kit.box("picture", (-1.5, 4.9, 0.6), (1.2, 4.97, 1.9), kit.principled("glass", (0.85, 0.87, 0.9), 0.0, metal=1.0))
    for _ in range(r.randrange(8, 22)):
        found = thing(r, surface(r))
        found.scale = (r.uniform(0.4, 1.3),) * 3
        motion(r, found, (r.uniform(-3.2, 3.2), r.uniform(-2.0, 4.5), r.choice([0, 0, r.uniform(0, 1.5)])), r.uniform(0, 6.3))
    if r.random() < 0.4:
        fence(r, r.uniform(-2.5, 3))
    if place == "yard" and r.random() < 0.5:
        grass(r, kit.leaf("grass", texture(r, 0.35)))
    if place != "yard" or r.random() < 0.3:
        lamps(r, place)
    if r.random() < 0.15:
        steam(r)
    if place == "yard":
        turn = r.uniform(0, 6.3)
        kit.light("sun", "SUN", (0, 0, 9), r.uniform(2, 8), (1.0, r.uniform(0.75, 0.98), r.uniform(0.55, 0.95)),
                  towards=(math.cos(turn), math.sin(turn), -r.uniform(0.3, 1.5)), angle=math.radians(r.choice([0.5, 1.0, 4.0])))
        kit.sky((0.9, 0.93, 1.0), (0.2, 0.4, 0.9), r.uniform(0.3, 1.5), r.choice([0.0, 0.8]))
    else:
        kit.sky((0.03, 0.034, 0.055), (0.006, 0.009, 0.022), r.uniform(0.2, 3.0))

    camera = kit.camera(r.uniform(20, 45))
    start, target = (r.uniform(-2.5, 2.5), r.uniform(-6.5, -4), r.uniform(0.8, 2.4)), (r.uniform(-1, 1), 1.5, r.uniform(0.4, 1.2))
    walk = [0.0] * 6 if r.random() < 0.2 else [r.gauss(0, 0.05) for _ in range(6)]
    path = lambda t: kit.look(tuple(p + t * v for p, v in zip(start, walk[:3])), tuple(p + t * v for p, v in zip(target, walk[3:])))
    kit.animate(camera, FRAMES, path)
    camera["seed"] = seed
    return camera


def open_lens(camera):
    """Depth of field: what is out of focus is spread over some pixels of 192."""
    r = random.Random(9000 + camera["seed"])
    lens = camera.data
    lens.dof.use_dof, lens.dof.focus_distance, lens.dof.aperture_fstop = True, r.uniform(2.5, 9), 1.4
    # a larger camera with the same view: a usual lens would hardly blur a small picture
    larger = r.uniform(3.0, 9.0)
    lens.lens, lens.sensor_width = larger * lens.lens, larger * lens.sensor_width


def fine_textures(camera):
    """Checks and grain of two to four pixels and little contrast on what has a colour, and a mirror or two that show them."""
    r = random.Random(7000 + camera["seed"])
    kit.box("behind", (-9, -8.3, 0), (9, -8, r.uniform(2, 5)), kit.diffuse("behind", color(r)))  # for the mirrors to show
    for mat in bpy.data.materials:
        tree = mat.node_tree
        for node in [n for n in tree.nodes if n.bl_idname in ("ShaderNodeBsdfDiffuse", "ShaderNodeBsdfPrincipled")]:
            contrast, scale = r.uniform(0.1, 0.5), r.uniform(8, 30)
            pattern = r.choice([kit.checker, kit.checker, kit.noise])((1.0,) * 3, (1.0 - contrast,) * 3, scale)(tree)
            socket = node.inputs.get("Color") or node.inputs["Base Color"]
            product = tree.nodes.new("ShaderNodeVectorMath")
            product.operation = "MULTIPLY"
            product.inputs[0].default_value = tuple(socket.default_value)[:3]
            if socket.is_linked:
                tree.links.new(socket.links[0].from_socket, product.inputs[0])
            tree.links.new(pattern, product.inputs[1])
            tree.links.new(product.outputs[0], socket)
    mirror = kit.principled("mirror", (0.9, 0.9, 0.9), 0.0, metal=1.0)
    kit.box("mirror", (-4, 4.8, 0.2), (4, 4.9, 2.6), mirror)
    if r.random() < 0.5:
        found = kit.box("leaning", (-0.7, -0.03, 0), (0.7, 0.03, 1.4), mirror)
        found.location, found.rotation_euler = (r.uniform(-2, 2), r.uniform(0, 3), 0), (r.uniform(-0.3, 0), 0, r.uniform(-0.6, 0.6))


def settings(cycles, seed):
    r = random.Random(5000 + seed)
    cycles.max_bounces, cycles.volume_bounces = r.choice([4, 6, 8, 12]), 0
    if r.random() < 0.3:
        cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    if r.random() < 0.3:
        cycles.sample_clamp_indirect = 0.0
