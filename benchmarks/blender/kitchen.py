"""A kitchen, reported only: glasses, brushed metal, a fan that turns, a lamp that is switched and one that swings.

Indoors: a bright lamp under the hood goes out at frame 7, a pendant lamp swings over the table the whole time, a fan turns 23
degrees a frame behind a cage of wires; glazed tiles, steel with grain, chrome, a blind of slats at the
window. The camera moves slowly.
"""
import math
import random

import kit

FRAMES = 12


def brushed(name, color, stretch):
    """Metal whose roughness has a grain."""

    def build(tree):
        node = tree.nodes.new("ShaderNodeBsdfPrincipled")
        node.inputs["Metallic"].default_value = 1.0
        kit.set_color(tree, node.inputs["Base Color"], color)
        grain = kit.noise((0.14, 0.14, 0.14), (0.36, 0.36, 0.36), 12.0, stretch)
        tree.links.new(grain(tree), node.inputs["Roughness"])
        return node.outputs[0]

    return kit.material(name, build)


def tumbler(name, r, h, mat, at):
    kit.lathe(name, [(0.001, 0.0), (r, 0.0), (r * 1.12, h), (r * 1.12 - 0.006, h), (r - 0.006, 0.012), (0.001, 0.012)], mat, at, 40)


def wine(name, mat, at):
    profile = [(0.001, 0.0), (0.045, 0.0), (0.045, 0.004), (0.005, 0.012), (0.005, 0.10), (0.03, 0.12), (0.045, 0.16), (0.036, 0.22), (0.033, 0.22), (0.042, 0.16), (0.028, 0.125), (0.001, 0.115)]
    kit.lathe(name, profile, mat, at, 40)


def build():
    rng = random.Random(5)
    tiles = kit.principled("tiles", kit.bricks((0.70, 0.74, 0.72), (0.62, 0.68, 0.68), (0.30, 0.30, 0.30), 3.4, (math.pi / 2, 0, 0)), 0.10)
    floor = kit.principled("floor", kit.checker((0.55, 0.52, 0.46), (0.13, 0.14, 0.16), 2.2), 0.22)
    plaster = kit.diffuse("plaster", (0.74, 0.70, 0.62))
    cabinet = kit.principled("cabinet", (0.10, 0.24, 0.23), 0.35)
    oak = kit.principled("oak", kit.noise((0.42, 0.27, 0.14), (0.28, 0.16, 0.07), 6.0, (4, 0.4, 1)), 0.4)
    steel = brushed("steel", (0.74, 0.74, 0.75), (0.5, 14, 0.5))
    copper = brushed("copper", (0.90, 0.52, 0.34), (1, 1, 18))
    chrome = kit.principled("chrome", (0.86, 0.86, 0.88), 0.04, metal=1.0)
    clear, green_glass = kit.glass("glass", (0.98, 1.0, 0.99)), kit.glass("green_glass", (0.45, 0.80, 0.50))
    white = kit.principled("white", (0.80, 0.79, 0.76), 0.25)
    dark = kit.principled("dark", (0.05, 0.05, 0.05), 0.4)

    # the room: x -2.2..2.2, y -1..3.2, z 0..2.6
    kit.box("floor", (-2.4, -1.2, -0.1), (2.4, 3.4, 0.0), floor)
    kit.box("ceiling", (-2.4, -1.2, 2.6), (2.4, 3.4, 2.7), plaster)
    kit.box("back", (-2.4, 3.2, 0.0), (2.4, 3.4, 2.6), tiles)
    kit.box("front", (-2.4, -1.2, 0.0), (2.4, -1.0, 2.6), plaster)
    kit.box("right", (2.2, -1.2, 0.0), (2.4, 3.4, 2.6), plaster)
    for i, (y0, y1, z0, z1) in enumerate([(-1.2, 3.4, 0, 1.0), (-1.2, 3.4, 2.1, 2.6), (-1.2, 0.9, 1.0, 2.1), (2.3, 3.4, 1.0, 2.1)]):
        kit.box(f"left{i}", (-2.4, y0, z0), (-2.2, y1, z1), plaster)
    slats = []
    for i in range(20):
        z = 1.03 + 0.055 * i
        slats.append(([(-2.24, 0.9, z), (-2.24, 2.3, z), (-2.20, 2.3, z + 0.03), (-2.20, 0.9, z + 0.03)], [(0, 1, 2, 3)]))
    kit.mesh("blind", *kit.join(slats), white)

    # counter, hob, hood, sink
    kit.box("counter", (-2.2, 2.55, 0.86), (2.2, 3.2, 0.90), steel)
    kit.box("drawers", (-2.2, 2.62, 0.0), (2.2, 3.2, 0.86), cabinet)
    handles = [kit.rod_shape((-1.9 + 0.7 * i, 2.58, 0.72), (-1.5 + 0.7 * i, 2.58, 0.72), 0.012) for i in range(6)]
    kit.mesh("handles", *kit.join(handles), chrome, smooth=True)
    kit.box("hob", (0.45, 2.62, 0.90), (1.15, 3.12, 0.915), dark)
    kit.mesh("hood", [(0.35, 2.6, 1.65), (1.25, 2.6, 1.65), (1.25, 3.2, 1.65), (0.35, 3.2, 1.65), (0.65, 2.9, 2.0), (0.95, 2.9, 2.0), (0.95, 3.2, 2.0), (0.65, 3.2, 2.0)],
             [(0, 1, 5, 4), (1, 2, 6, 5), (3, 0, 4, 7), (4, 5, 6, 7)], steel)
    kit.box("flue", (0.65, 2.9, 2.0), (0.95, 3.2, 2.6), steel)
    kit.lathe("pot", [(0.001, 0.0), (0.13, 0.0), (0.13, 0.16), (0.125, 0.16), (0.125, 0.01), (0.001, 0.01)], copper, (0.65, 2.82, 0.916), 48)
    kit.lathe("kettle", [(0.001, 0.0), (0.11, 0.0), (0.12, 0.06), (0.07, 0.16), (0.02, 0.18), (0.001, 0.2)], chrome, (0.97, 2.85, 0.916), 48)
    tap = [kit.rod_shape((-0.9, 3.05, 0.9), (-0.9, 3.05, 1.2), 0.016), kit.rod_shape((-0.9, 3.05, 1.2), (-0.9, 2.8, 1.17), 0.014)]
    kit.mesh("tap", *kit.join(tap), chrome, smooth=True)
    kit.lathe("bottle", [(0.001, 0), (0.04, 0), (0.04, 0.2), (0.013, 0.27), (0.013, 0.33), (0.001, 0.33)], green_glass, (-1.5, 2.9, 0.901), 32)
    for i, x in enumerate((-0.55, -0.4, -0.25)):
        tumbler(f"tumbler{i}", 0.035, 0.11, clear, (x, 2.85 - 0.05 * i, 0.901))
    # a rack with spoons and a wire basket
    rack = [kit.rod_shape((-1.3, 3.14, 1.6), (0.1, 3.14, 1.6), 0.008)]
    rack += [kit.rod_shape((-1.25 + 0.11 * i, 3.13, 1.6), (-1.25 + 0.11 * i, 3.13, 1.32 - 0.04 * (i % 3)), 0.007) for i in range(12)]
    kit.mesh("rack", *kit.join(rack), chrome, smooth=True)
    kit.box("shelf", (-1.6, 2.95, 1.9), (0.2, 3.2, 1.93), oak)
    for i in range(9):
        x = -1.5 + 0.19 * i
        color = [0.1 + 0.6 * rng.random() for _ in range(3)]
        kit.lathe(f"tin{i}", [(0.001, 0), (0.06, 0), (0.06, 0.12 + 0.08 * rng.random()), (0.001, 0.2)], kit.principled("tin", color, 0.3), (x, 3.07, 1.93), 24)

    # the table before it
    kit.box("table", (-1.1, 0.75, 0.74), (0.75, 1.55, 0.78), oak)
    legs = [kit.rod_shape((x, y, 0), (x, y, 0.74), 0.03) for x in (-1.0, 0.65) for y in (0.83, 1.47)]
    kit.mesh("legs", *kit.join(legs), dark, smooth=True)
    wine("wine_a", clear, (-0.55, 1.1, 0.781))
    wine("wine_b", clear, (-0.35, 1.3, 0.781))
    tumbler("glass", 0.035, 0.12, clear, (0.10, 1.05, 0.781))
    kit.lathe("carafe", [(0.001, 0), (0.07, 0), (0.08, 0.08), (0.03, 0.2), (0.04, 0.25), (0.036, 0.25), (0.026, 0.2), (0.075, 0.08), (0.065, 0.01), (0.001, 0.01)], clear, (0.35, 1.25, 0.781), 48)
    kit.lathe("bowl", [(0.001, 0.0), (0.06, 0.0), (0.16, 0.08), (0.155, 0.085), (0.055, 0.01), (0.001, 0.01)], steel, (-0.15, 1.15, 0.78), 48)
    for i, color in enumerate([(0.70, 0.10, 0.04), (0.75, 0.45, 0.03), (0.35, 0.55, 0.06)]):
        kit.ball(f"fruit{i}", 0.04, kit.principled("fruit", color, 0.3, coat=0.5), (-0.20 + 0.06 * i, 1.12 + 0.04 * (i % 2), 0.80), 16)

    # the fan on the counter: five bent blades of chrome about the y axis, behind a cage of wires
    at, blades, cage = (1.62, 2.85, 1.17), [], [kit.torus_shape(0.23, 0.007, 48, 8)]
    for i in range(5):
        a = 2 * math.pi * i / 5
        corner = lambda r, da, y: (r * math.cos(a + da), y, r * math.sin(a + da))
        blades.append(([corner(0.04, -0.4, -0.02), corner(0.20, -0.35, -0.035), corner(0.20, 0.35, 0.035), corner(0.04, 0.4, 0.02)], [(0, 1, 2, 3)]))
    blades.append(kit.rod_shape((0, -0.05, 0), (0, 0.12, 0), 0.04, 20))
    fan = kit.mesh("fan", *kit.join(blades), copper)
    for i in range(24):
        a = 2 * math.pi * i / 24
        cage.append(kit.rod_shape((0.04 * math.cos(a), -0.07, 0.04 * math.sin(a)), (0.23 * math.cos(a), 0, 0.23 * math.sin(a)), 0.0025, 5))
    guard = kit.mesh("cage", *kit.join(cage), chrome, smooth=True)
    guard.location = at
    kit.mesh("stand", *kit.join([kit.rod_shape((1.62, 2.95, 0.9), (1.62, 2.95, 1.17), 0.02), kit.box_shape((1.5, 2.8, 0.9), (1.74, 3.05, 0.92))]), dark)
    kit.animate(fan, FRAMES, lambda t: (at, (0, math.radians(23 * t), 0)))

    # lights: the panel, the lamp that swings, the lamp under the hood
    kit.light("panel", "AREA", (0.55, 1.75, 2.58), 34, (1.0, 0.96, 0.90), (0.7, 0.7))
    glow = kit.emission("glow", (1.0, 0.70, 0.38), 16.0)

    def swing(t):
        a = 0.42 * math.sin(0.55 * t + 0.3)
        return (-0.35, 1.15, 2.58), (0.0, a, 0.0)

    shade = [(0.03, -0.82), (0.05, -0.84), (0.17, -0.98), (0.175, -0.98), (0.055, -0.83), (0.03, -0.80)]
    for part in (
        kit.lathe("shade", shade, cabinet, segments=40),
        kit.ball("pendant", 0.05, glow, (0, 0, -0.96), 16),
        kit.mesh("cable", *kit.rod_shape((0, 0, 0), (0, 0, -0.82), 0.005), dark),
    ):
        kit.animate(part, FRAMES, swing)
    hood = kit.light("hood", "AREA", (0.8, 2.9, 1.64), 0, (1.0, 0.93, 0.80), (0.3, 0.1))
    kit.key_every_frame(FRAMES, lambda t: 9.0 if t < 6 else 0.0, hood.data, "energy")
    kit.light("sun", "SUN", (-10, 0, 10), 5.0, (1.0, 0.90, 0.75), towards=(0.80, 0.22, -0.42), angle=math.radians(0.6))
    kit.sky((0.85, 0.92, 1.0), (0.30, 0.50, 0.9), 1.2)

    camera = kit.camera(24.0)
    kit.animate(camera, FRAMES, lambda t: kit.look((-0.25 + 0.025 * t, -0.75 + 0.01 * t, 1.45), (0.0 + 0.01 * t, 2.4, 1.22)))
    return camera
