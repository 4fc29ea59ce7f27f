"""A workshop: for fitting constants, never reported. Of the hall's kind, but another room.

Bench, shelves and rods; a polished steel cylinder, brass, glass jars, a varnished rough floor and a polished plate on it;
brick and planks; two tube lights, a bulb, sun and sky through one window; a crate that slides and turns; the camera
walks sideways and turns.
"""
import math
import random

import kit

FRAMES = 8


def build():
    rng = random.Random(7)
    planks = kit.principled("planks", kit.noise((0.34, 0.20, 0.10), (0.16, 0.09, 0.05), 5.0, (0.35, 4, 1)), 0.38)
    plate = kit.principled("plate", (0.20, 0.22, 0.24), 0.12)
    tiles = kit.diffuse("brick", kit.bricks((0.42, 0.20, 0.13), (0.33, 0.14, 0.09), (0.62, 0.60, 0.55), 2.6, (math.pi / 2, 0, 0)))
    plaster = kit.diffuse("plaster", kit.noise((0.66, 0.63, 0.55), (0.56, 0.55, 0.50), 2.0))
    blue = kit.diffuse("blue", (0.12, 0.22, 0.42))
    white = kit.diffuse("white", (0.80, 0.79, 0.76))
    oak = kit.principled("oak", kit.noise((0.42, 0.27, 0.14), (0.28, 0.16, 0.07), 6.0, (4, 0.4, 1)), 0.5)
    steel = kit.principled("steel", (0.80, 0.81, 0.83), 0.05, metal=1.0)
    brass = kit.principled("brass", (0.89, 0.68, 0.30), 0.28, metal=1.0)
    iron = kit.principled("iron", (0.35, 0.35, 0.37), 0.45, metal=1.0)
    clear = kit.glass("glass", (0.97, 0.99, 1.0))
    crate_mat = kit.principled("crate", kit.checker((0.75, 0.30, 0.08), (0.10, 0.32, 0.36), 7.0), 0.33)
    bulb = kit.emission("bulb", (1.0, 0.72, 0.42), 14.0)

    # the room: x -3.5..3.5, y 0..9, z 0..3.1; a window in the left wall
    kit.box("floor", (-3.7, -0.2, -0.2), (3.7, 9.2, 0.0), planks)
    kit.box("plate", (-0.4, 2.4, 0.0), (2.9, 4.3, 0.012), plate)
    kit.box("ceiling", (-3.7, -0.2, 3.1), (3.7, 9.2, 3.3), white)
    kit.box("back", (-3.5, 9.0, 0.0), (3.5, 9.2, 3.1), tiles)
    kit.box("front", (-3.5, -0.2, 0.0), (3.5, 0.0, 3.1), plaster)
    kit.box("right", (3.5, -0.2, 0.0), (3.7, 9.2, 3.1), blue)
    for i, (low, high) in enumerate([((-0.2, 0), (9.2, 1.0)), ((-0.2, 2.5), (9.2, 3.1)), ((-0.2, 1.0), (3.6, 2.5)), ((6.4, 1.0), (9.2, 2.5))]):
        kit.box(f"left{i}", (-3.7, low[0], low[1]), (-3.5, high[0], high[1]), plaster)
    for i, y in enumerate((4.3, 5.0, 5.7)):
        kit.box(f"bar{i}", (-3.62, y - 0.025, 1.0), (-3.57, y + 0.025, 2.5), white)
    kit.box("sill", (-3.5, 3.5, 0.95), (-3.3, 6.5, 1.0), white)
    kit.box("street", (-40, -30, -0.4), (-3.7, 40, -0.35), kit.diffuse("street", (0.25, 0.24, 0.22)))
    kit.box("house", (-16, -8, -0.4), (-15, 24, 1.9), kit.diffuse("house", (0.5, 0.32, 0.22)))

    # bench and what stands on it
    kit.box("bench", (-2.7, 5.4, 0.86), (0.9, 6.3, 0.93), oak)
    for x in (-2.62, 0.74):
        for y in (5.45, 6.17):
            kit.box("leg", (x, y, 0.0), (x + 0.08, y + 0.08, 0.86), oak)
    kit.lathe("cylinder", [(0.001, 0.0), (0.21, 0.0), (0.21, 0.52), (0.001, 0.52)], steel, (-1.75, 5.8, 0.93), 64)
    kit.lathe("vase", [(0.001, 0), (0.11, 0.0), (0.17, 0.10), (0.13, 0.24), (0.06, 0.32), (0.09, 0.40), (0.08, 0.40), (0.05, 0.32)],
              brass, (-0.95, 5.7, 0.93), 48)
    for i, (x, y, r, h) in enumerate([(-0.42, 5.65, 0.10, 0.26), (-0.12, 5.9, 0.13, 0.18)]):
        kit.lathe(f"jar{i}", [(0.001, 0.0), (r, 0.0), (r, h), (r - 0.012, h), (r - 0.012, 0.012), (0.001, 0.012)], clear, (x, y, 0.931), 48)
    kit.ball("marble", 0.07, clear, (0.22, 5.6, 0.931))
    for i in range(5):
        x, s = 0.35 + 0.1 * i, 0.03 + 0.03 * rng.random()
        kit.box(f"block{i}", (x, 5.85, 0.93), (x + s, 5.95, 0.98 + 0.15 * rng.random()), white if i % 2 else brass)

    # shelves with boxes along the right wall, thin posts
    for z in (0.4, 1.0, 1.6, 2.2):
        kit.box("board", (2.95, 4.6, z), (3.45, 8.6, z + 0.03), oak)
        y = 4.7
        while y < 8.3:
            w, h, d = 0.12 + 0.3 * rng.random(), 0.12 + 0.34 * rng.random(), 0.2 + 0.2 * rng.random()
            color = [0.08 + 0.7 * rng.random() for _ in range(3)]
            kit.box("carton", (3.45 - d, y, z + 0.03), (3.45, y + w, z + 0.03 + h), kit.diffuse("carton", color))
            y += w + 0.03 + 0.2 * rng.random()
    rods = [kit.rod_shape((2.97, y, 0), (2.97, y, 2.6), 0.018) for y in (4.65, 5.95, 7.25, 8.55)]
    kit.mesh("posts", *kit.join(rods), iron, smooth=True)
    # tools hanging from the brick wall, a ladder
    tools = [kit.rod_shape((-2.8 + 0.28 * i, 8.95, 1.5), (-2.8 + 0.28 * i, 8.95, 1.9 + 0.3 * rng.random()), 0.02) for i in range(9)]
    kit.mesh("tools", *kit.join(tools), iron, smooth=True)
    ladder = [kit.rod_shape((1.3 + s, 7.9, 0), (1.3 + s, 8.9, 2.7), 0.022) for s in (0, 0.45)]
    ladder += [kit.rod_shape((1.3, 7.9 + t, 2.7 * t), (1.75, 7.9 + t, 2.7 * t), 0.015) for t in (i / 10 + 0.05 for i in range(10))]
    kit.mesh("ladder", *kit.join(ladder), oak)
    kit.mesh("cord", *kit.rod_shape((0.4, 6.6, 2.32), (0.4, 6.6, 3.1), 0.006), iron)
    kit.ball("bulb", 0.06, bulb, (0.4, 6.6, 2.2), 16)

    crate = kit.box("crate", (-0.3, -0.3, -0.3), (0.3, 0.3, 0.3), crate_mat)
    kit.animate(crate, FRAMES, lambda t: ((1.9 - 0.12 * t, 3.9 + 0.03 * t, 0.55 + 0.04 * math.sin(0.6 * t)),
                                          (0.03 * t, math.radians(15 + 4 * t), math.radians(20 + 8 * t))))

    kit.light("tube_a", "AREA", (-1.2, 3.6, 3.05), 90, (0.92, 0.97, 1.0), (0.18, 1.4))
    kit.light("tube_b", "AREA", (1.6, 6.4, 3.05), 90, (0.92, 0.97, 1.0), (0.18, 1.4))
    kit.light("sun", "SUN", (-10, 5, 10), 8.0, (1.0, 0.90, 0.75), towards=(0.74, 0.08, -0.50), angle=math.radians(1.0))
    kit.sky((0.95, 0.96, 1.0), (0.25, 0.45, 0.9), 2.4)

    camera = kit.camera(26.0)
    kit.animate(camera, FRAMES, lambda t: ((-0.6 + 0.055 * t, 1.0 + 0.02 * t, 1.55),
                                           (math.radians(81.0), 0.0, math.radians(-6 + 0.5 * t))))
    return camera
