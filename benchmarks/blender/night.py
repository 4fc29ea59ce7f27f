"""A street at night, reported only: light that changes over surfaces at rest.

A sign that blinks, a running display of small lamps, a street lamp that is switched on at frame 7, a window that goes
dark at frame 6, headlights of a car that passes; wet asphalt with puddles, a wire fence with lit wires before all of it,
steam over a grate; walls whose emission is exactly 0. The camera rests until frame 6 and then moves slowly.
"""
import math

import bpy

import kit

FRAMES = 12
SIGN_IS_ON = (0, 0, 1, 1, 1, 0, 0, 1, 1, 0, 0, 1)


def asphalt():
    """Rough and grey, in places covered by water that lies flat."""

    def build(tree):
        node = tree.nodes.new("ShaderNodeBsdfPrincipled")
        grain = kit.noise((0.035, 0.036, 0.04), (0.09, 0.088, 0.085), 14.0)
        puddle = kit.noise((0.025, 0.025, 0.025), (0.42, 0.42, 0.42), 0.9, low=0.47, high=0.53, detail=2.0)
        kit.set_color(tree, node.inputs["Base Color"], grain)
        tree.links.new(puddle(tree), node.inputs["Roughness"])
        return node.outputs[0]

    return kit.material("asphalt", build)


def switched(name, color, strength, is_on):
    """Emission that is `strength` in frames t with `is_on(t)`, else 0."""
    mat = kit.emission(name, color, strength)
    socket = next(n for n in mat.node_tree.nodes if n.bl_idname == "ShaderNodeEmission").inputs["Strength"]
    kit.key_every_frame(FRAMES, lambda t: strength if is_on(t) else 0.0, socket, "default_value")
    return mat


def steam(at, radius, density):
    def build(tree):
        node = tree.nodes.new("ShaderNodeVolumeScatter")
        node.inputs["Density"].default_value = density
        node.inputs["Anisotropy"].default_value = 0.2
        node.inputs["Color"].default_value = (0.95, 0.95, 0.95, 1)
        return node.outputs[0]

    mat = kit.material("steam", build, socket="Volume")
    for i in range(4):
        found = kit.ball(f"steam{i}", radius * (1 + 0.35 * i), mat, (0, 0, 0), 12)
        kit.animate(found, FRAMES, lambda t, i=i: ((at[0] + 0.10 * i * math.sin(1.3 * i + 0.12 * t), at[1], 0.02 + (0.26 * i + 0.02 * t)), (0, 0, 0)))


def car(black, chrome):
    body = kit.join([
        kit.box_shape((-1.5, -0.55, 0.28), (1.5, 0.55, 0.75)),
        kit.box_shape((-0.9, -0.50, 0.75), (0.7, 0.50, 1.15)),
    ])  # fmt: skip
    wheels = [kit.torus_shape(0.24, 0.08, 24, 8) for _ in range(4)]
    places = [(x, y, 0.32) for x in (-0.95, 0.95) for y in (-0.52, 0.52)]
    wheels = [([(p[0] + x, p[1] + y, p[2] + z) for p in points], faces) for (points, faces), (x, y, z) in zip(wheels, places)]
    parts = [kit.mesh("car", *body, black), kit.mesh("wheels", *kit.join(wheels), chrome, smooth=True)]
    glow, red = kit.emission("headlight", (1.0, 0.95, 0.85), 40.0), kit.emission("tail", (1.0, 0.04, 0.02), 6.0)
    for y in (-0.4, 0.4):
        parts.append(kit.box("front", (1.5, y - 0.08, 0.5), (1.52, y + 0.08, 0.62), glow))
        parts.append(kit.box("rear", (-1.52, y - 0.08, 0.55), (-1.5, y + 0.08, 0.65), red))
    where = lambda t: ((-4.6 + 0.55 * t, 2.2, 0.0), (0, 0, 0))
    for part in parts:
        kit.animate(part, FRAMES, where)
    for y in (-0.4, 0.4):
        beam = kit.light("beam", "SPOT", (0, 0, 0), 420, (1.0, 0.95, 0.85))
        beam.data.spot_size, beam.data.spot_blend, beam.data.shadow_soft_size = math.radians(50), 0.5, 0.05
        kit.animate(beam, FRAMES, lambda t, y=y: ((-4.6 + 0.55 * t + 1.55, 2.2 + y, 0.56), (0, math.radians(-84), 0)))


def build():
    brick = kit.diffuse("brick", kit.bricks((0.30, 0.13, 0.09), (0.22, 0.10, 0.07), (0.35, 0.33, 0.30), 1.6, (math.pi / 2, 0, 0)))
    plaster = kit.diffuse("plaster", kit.noise((0.42, 0.40, 0.36), (0.32, 0.31, 0.28), 2.0))
    stone = kit.principled("stone", (0.30, 0.30, 0.31), 0.5)
    iron = kit.principled("iron", (0.30, 0.30, 0.32), 0.35, metal=1.0)
    chrome = kit.principled("chrome", (0.80, 0.80, 0.82), 0.10, metal=1.0)
    black = kit.principled("black", (0.03, 0.035, 0.05), 0.30, coat=1.0)

    kit.box("street", (-14, -6, -0.2), (14, 3.4, 0.0), asphalt())
    kit.box("pavement", (-14, 3.4, -0.2), (14, 4.6, 0.12), stone)
    kit.box("house_a", (-14, 4.6, 0.0), (0.6, 5.0, 5.0), brick)
    kit.box("house_b", (0.6, 4.6, 0.0), (14, 5.0, 4.0), plaster)
    kit.box("door", (1.2, 4.57, 0.12), (2.1, 4.6, 2.2), black)
    # windows: one lit, one that goes dark at frame 6, one dark
    for i, (x, mat) in enumerate([
        (-3.4, kit.emission("window", (1.0, 0.72, 0.40), 1.3)),
        (-1.9, switched("window_b", (1.0, 0.80, 0.55), 1.3, lambda t: t < 5)),
        (2.8, chrome),
    ]):  # fmt: skip
        kit.box(f"window{i}", (x, 4.57, 1.2), (x + 0.8, 4.6, 2.3), mat)
        bars = [kit.box_shape((x + 0.385, 4.54, 1.2), (x + 0.415, 4.57, 2.3)), kit.box_shape((x, 4.54, 1.72), (x + 0.8, 4.57, 1.75))]
        kit.mesh("bars", *kit.join(bars), stone)

    # the sign: strokes as of letters, and a frame of lamps that run around the door
    neon = switched("neon", (1.0, 0.10, 0.35), 9.0, lambda t: SIGN_IS_ON[min(max(t, 0), FRAMES - 1)])
    strokes = []
    for i in range(5):
        x = -0.4 - 2.4 + 0.52 * i
        strokes.append(kit.rod_shape((x, 4.5, 2.75), (x, 4.5, 3.25), 0.025, 8))
        strokes.append(kit.rod_shape((x, 4.5, 3.25 if i % 2 else 2.75), (x + 0.3, 4.5, 3.25 if i % 2 else 2.75), 0.025, 8))
        if i % 3 == 0:
            strokes.append(kit.rod_shape((x, 4.5, 3.0), (x + 0.26, 4.5, 3.0), 0.025, 8))
    kit.mesh("sign", *kit.join(strokes), neon, smooth=True)
    kit.box("panel", (0.9, 4.52, 2.45), (4.3, 4.6, 2.85), black)
    for phase in range(4):
        lit = switched(f"lamp{phase}", (1.0, 0.85, 0.35), 22.0, lambda t, phase=phase: (t + phase) % 4 == 0)
        lamps = [kit.box_shape((x, 4.49, 2.58), (x + 0.07, 4.52, 2.65)) for x in (1.0 + 0.2 * i for i in range(phase, 16, 4))]
        lamps += [kit.box_shape((x, 4.49, 2.70), (x + 0.07, 4.52, 2.77)) for x in (1.0 + 0.2 * i for i in range((phase + 2) % 4, 16, 4))]
        kit.mesh(f"display{phase}", *kit.join(lamps), lit)

    # street lamp: dark until frame 6
    kit.mesh("post", *kit.join([kit.rod_shape((3.6, 3.6, 0.1), (3.6, 3.6, 3.3), 0.04), kit.rod_shape((3.6, 3.6, 3.3), (2.9, 3.2, 3.35), 0.03)]), iron, smooth=True)
    kit.ball("bulb", 0.09, switched("bulb", (1.0, 0.75, 0.45), 30.0, lambda t: t >= 6), (2.9, 3.2, 3.12), 12)
    lamp = kit.light("lamp", "SPOT", (2.9, 3.2, 3.1), 0, (1.0, 0.75, 0.45), towards=(0, -0.1, -1))
    lamp.data.spot_size, lamp.data.spot_blend, lamp.data.shadow_soft_size = math.radians(120), 0.4, 0.06
    kit.key_every_frame(FRAMES, lambda t: 260.0 if t >= 6 else 0.0, lamp.data, "energy")

    # a wire fence near the camera, two of its wires lit
    wires = [kit.rod_shape((-3.2, -1.6, z), (3.2, -1.9, z), 0.006, 6) for z in (0.35, 0.6, 0.85, 1.35, 1.6)]
    for i in range(26):
        x = -3.2 + 0.25 * i
        wires.append(kit.rod_shape((x, -1.6 - 0.047 * (x + 3.2), 0.0), (x + 0.25, -1.61 - 0.047 * (x + 3.2), 1.6), 0.004, 5))
    wires += [kit.rod_shape((x, -1.6 - 0.047 * (x + 3.2), 0), (x, -1.6 - 0.047 * (x + 3.2), 1.7), 0.02) for x in (-3.2, -1.1, 1.0, 3.1)]
    kit.mesh("fence", *kit.join(wires), iron, smooth=True)
    for z, color in ((1.1, (0.25, 0.55, 1.0)), (1.7, (1.0, 0.6, 0.2))):
        kit.mesh("lit_wire", *kit.rod_shape((-3.2, -1.62, z), (3.2, -1.92, z), 0.004, 6), kit.emission("lit", color, 4.0), smooth=True)

    grate = [kit.box_shape((-1.75 + 0.06 * i, 1.0, 0.0), (-1.72 + 0.06 * i, 1.5, 0.015)) for i in range(8)]
    kit.mesh("grate", *kit.join(grate), iron)
    steam((-1.5, 1.25), 0.22, 1.4)
    kit.lathe("bin", [(0.001, 0.0), (0.26, 0.0), (0.28, 0.75), (0.26, 0.78), (0.001, 0.78)], chrome, (0.1, 4.0, 0.12), 32)
    kit.box("crate", (-3.9, 3.6, 0.12), (-3.2, 4.3, 0.7), plaster)
    car(black, chrome)
    kit.sky((0.030, 0.034, 0.055), (0.006, 0.009, 0.022), 1.0)

    camera = kit.camera(30.0)

    def place(t):
        d = max(0, t - 5)
        return kit.look((-0.5 + 0.03 * d, -5.6 + 0.02 * d, 1.5), (-0.1 + 0.02 * d, 2.0, 1.25))

    kit.animate(camera, FRAMES, place)
    return camera


def settings(cycles):
    cycles.max_bounces, cycles.volume_bounces = 6, 0
