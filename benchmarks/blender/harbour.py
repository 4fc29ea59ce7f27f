"""A harbour, for fitting constants: waves on the water, sails that bend, ropes, a sun low over the sea that glitters in it.

Water and sails are deformed by shape keys, one a frame. Boats and a buoy roll with the waves; a lantern at the pier's end
swings. The camera moves sideways over the quay.
"""
import math

import kit

FRAMES = 12
# amplitude, wave number in x and y, radians a frame
WAVES = ((0.050, 0.9, 1.7, 0.42), (0.030, -2.1, 2.3, 0.55), (0.016, 4.7, 3.1, -0.70), (0.008, 7.3, -8.9, 0.90))


def height(x, y, t):
    return sum(a * math.sin(kx * x + ky * y + w * t) for a, kx, ky, w in WAVES)


def sea(mat):
    """Cells that grow with the distance, so that near waves are smooth."""
    nx, ny = 130, 130
    places = []
    for j in range(ny):
        y = 0.6 + 60.0 * (j / (ny - 1)) ** 2.6
        width = 3.5 + 1.1 * y
        places += [(width * (2 * i / (nx - 1) - 1), y) for i in range(nx)]
    at = lambda t: [(x, y, height(x, y, t) * min(1.0, 14.0 / (y + 4))) for x, y in places]
    faces = [(j * nx + i, j * nx + i + 1, (j + 1) * nx + i + 1, (j + 1) * nx + i) for j in range(ny - 1) for i in range(nx - 1)]
    found = kit.mesh("sea", at(0), faces, mat, smooth=True)
    kit.deform(found, FRAMES, at)


def sail(name, corners, depth, phase, mat, place):
    """A triangle of cloth between three corners whose belly fills and slackens, and moves with its boat."""
    n = 14
    a, b, c = corners
    grid = [(u / n, v / n) for u in range(n + 1) for v in range(n + 1 - u)]
    index = {(round(u * n), round(v * n)): k for k, (u, v) in enumerate(grid)}
    faces = []
    for i in range(n):
        for j in range(n - i):
            faces.append((index[i, j], index[i + 1, j], index[i, j + 1]))
            if i + j < n - 1:
                faces.append((index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]))

    def at(t):
        points = []
        for u, v in grid:
            w = 1 - u - v
            p = [w * a[k] + u * b[k] + v * c[k] for k in range(3)]
            belly = 27 * u * v * w * depth * (1 + 0.5 * math.sin(0.7 * t + phase)) + 0.05 * u * math.sin(9 * v - 1.1 * t + phase)
            points.append((p[0], p[1] + belly, p[2]))
        return points

    found = kit.mesh(name, at(0), faces, mat, smooth=True)
    kit.deform(found, FRAMES, at)
    kit.animate(found, FRAMES, place)


def boat(name, x, y, heading, size, hull_mat, wood, cloth, rope, phase):
    def place(t):
        z = height(x, y, t)
        return (x, y, z), (0.05 * math.sin(0.5 * t + phase), 0.03 * math.sin(0.37 * t + phase), heading)

    s = size
    half = [(-1.2, 0.36, 0.42), (-0.4, 0.46, 0.38), (0.5, 0.40, 0.42), (1.3, 0.02, 0.55)]
    points, faces = [], []
    for px, w, h in half:
        points += [(s * px, -s * w, s * h), (s * px * 0.92, -s * w * 0.7, -0.1 * s), (s * px * 0.92, s * w * 0.7, -0.1 * s), (s * px, s * w, s * h)]
    for k in range(3):
        faces += [(4 * k + i, 4 * k + i + 1, 4 * k + i + 5, 4 * k + i + 4) for i in range(3)]
        faces.append((4 * k + 3, 4 * k, 4 * k + 4, 4 * k + 7))
    faces.append((0, 1, 2, 3))
    parts = [kit.mesh(f"{name}_hull", points, faces, hull_mat)]
    spars = [kit.rod_shape((0.15 * s, 0, 0.3 * s), (0.15 * s, 0, 3.1 * s), 0.03 * s), kit.rod_shape((0.15 * s, 0, 0.75 * s), (-1.15 * s, 0, 0.70 * s), 0.022 * s)]
    parts.append(kit.mesh(f"{name}_spars", *kit.join(spars), wood, smooth=True))
    top = (0.15 * s, 0, 3.05 * s)
    ropes = [kit.rod_shape(top, p, 0.007, 5) for p in ((1.28 * s, 0, 0.52 * s), (-1.18 * s, 0, 0.45 * s), (0.1 * s, 0.43 * s, 0.4 * s), (0.1 * s, -0.43 * s, 0.4 * s))]
    ropes += [kit.rod_shape((0.1 * s + 0.05 * s * k / 6, 0.43 * s * (1 - k / 7), 0.4 * s + 2.65 * s * k / 7), (0.1 * s + 0.05 * s * k / 6, -0.43 * s * (1 - k / 7), 0.4 * s + 2.65 * s * k / 7), 0.005, 5) for k in range(1, 6)]
    parts.append(kit.mesh(f"{name}_ropes", *kit.join(ropes), rope))
    for part in parts:
        kit.animate(part, FRAMES, place)
    sail(f"{name}_main", ((0.12 * s, 0, 0.80 * s), (-1.1 * s, 0, 0.76 * s), (0.13 * s, 0, 2.95 * s)), 0.18 * s, phase, cloth, place)
    sail(f"{name}_jib", ((0.25 * s, 0, 0.70 * s), (1.2 * s, 0, 0.60 * s), (0.2 * s, 0, 2.7 * s)), 0.14 * s, phase + 1, cloth, place)


def build():
    water = kit.principled("water", (0.012, 0.045, 0.055), 0.04)
    cloth = kit.leaf("cloth", (0.80, 0.76, 0.66), 0.45)
    red_cloth = kit.leaf("red_cloth", (0.55, 0.14, 0.08), 0.40)
    wood = kit.principled("wood", kit.noise((0.34, 0.20, 0.10), (0.18, 0.10, 0.05), 6.0, (4, 0.4, 1)), 0.45)
    rope = kit.diffuse("rope", (0.45, 0.38, 0.26))
    white, blue = kit.principled("white", (0.80, 0.80, 0.78), 0.3, coat=1.0), kit.principled("blue", (0.05, 0.14, 0.32), 0.25, coat=1.0)
    stone = kit.diffuse("stone", kit.noise((0.36, 0.34, 0.31), (0.20, 0.19, 0.18), 4.0))
    iron = kit.principled("iron", (0.35, 0.33, 0.32), 0.4, metal=1.0)
    orange = kit.principled("orange", (0.75, 0.20, 0.03), 0.35)

    sea(water)
    kit.box("bed", (-90, -10, -3.0), (90, 90, -1.0), kit.diffuse("bed", (0.02, 0.05, 0.05)))
    kit.box("quay", (-8, -6, -1.0), (8, 0.75, 0.35), stone)
    # a pier of planks on posts, with a rail of ropes
    planks = [kit.box_shape((1.5, 0.8 + 0.26 * i, 0.42), (2.7, 1.02 + 0.26 * i, 0.47)) for i in range(24)]
    kit.mesh("planks", *kit.join(planks), wood)
    posts = [kit.rod_shape((x, y, -1.0), (x, y, 1.15), 0.07, 10) for x in (1.5, 2.7) for y in (1.2, 3.0, 4.8, 6.8)]
    kit.mesh("posts", *kit.join(posts), wood, smooth=True)
    sagging = []
    for y0, y1 in ((1.2, 3.0), (3.0, 4.8), (4.8, 6.8)):
        for x in (1.5, 2.7):
            for z in (1.05, 0.80):
                line = [(x, y0 + (y1 - y0) * k / 8, z - 0.5 * (k / 8) * (1 - k / 8)) for k in range(9)]
                sagging += [kit.rod_shape(p, q, 0.012, 6) for p, q in zip(line, line[1:])]
    kit.mesh("rail", *kit.join(sagging), rope, smooth=True)
    # mooring line, nets on the quay
    line = [(-1.2 + 0.28 * k, 0.7 + 0.35 * k, 0.38 - 0.6 * (k / 8) * (1 - k / 8)) for k in range(9)]
    kit.mesh("mooring", *kit.join([kit.rod_shape(p, q, 0.014, 6) for p, q in zip(line, line[1:])]), rope, smooth=True)
    net = [kit.rod_shape((-3.0 + 0.12 * k, 0.5, 0.36), (-2.8 + 0.12 * k, 0.72, 1.25), 0.006, 5) for k in range(10)]
    net += [kit.rod_shape((-2.9 + 0.12 * k, 0.5, 0.36), (-3.1 + 0.12 * k, 0.72, 1.25), 0.006, 5) for k in range(10)]
    kit.mesh("net", *kit.join(net), rope)
    kit.lathe("bollard", [(0.001, 0.0), (0.12, 0.0), (0.09, 0.2), (0.14, 0.28), (0.001, 0.30)], iron, (-1.25, 0.55, 0.35), 24)

    boat("near", 0.1, 4.2, math.radians(200), 0.85, blue, wood, cloth, rope, 0.0)
    boat("far", -4.6, 10.5, math.radians(-25), 1.2, white, wood, red_cloth, rope, 2.0)
    boat("third", 6.5, 16.0, math.radians(160), 1.3, white, wood, cloth, rope, 4.0)
    buoy = kit.lathe("buoy", [(0.001, -0.2), (0.22, -0.1), (0.24, 0.1), (0.08, 0.45), (0.05, 0.75), (0.001, 0.78)], orange, (0, 0, 0), 24)
    kit.animate(buoy, FRAMES, lambda t: ((-1.5, 3.4, height(-1.5, 3.4, t)), (0.15 * math.sin(0.6 * t), 0.12 * math.cos(0.5 * t), 0)))
    lantern = kit.box("lantern", (-0.07, -0.07, -0.2), (0.07, 0.07, 0.0), kit.emission("lantern", (1.0, 0.65, 0.3), 12.0))
    kit.animate(lantern, FRAMES, lambda t: ((1.5, 1.2, 1.45), (0.25 * math.sin(0.8 * t), 0.2 * math.cos(0.8 * t), 0)))
    kit.mesh("hook", *kit.rod_shape((1.5, 1.2, 1.15), (1.5, 1.2, 1.46), 0.015), iron)
    kit.box("headland", (-60, 50, -1.0), (-14, 62, 4.0), kit.diffuse("headland", (0.10, 0.11, 0.08)))

    kit.light("sun", "SUN", (0, 0, 10), 3.0, (1.0, 0.70, 0.42), towards=(0.17, -0.95, -0.20), angle=math.radians(0.53))
    kit.sky((0.95, 0.72, 0.52), (0.18, 0.30, 0.60), 0.9, clouds=0.5)

    camera = kit.camera(28.0)
    kit.animate(camera, FRAMES, lambda t: kit.look((-0.9 + 0.05 * t, -2.6, 1.55), (0.1 + 0.02 * t, 5.0, 0.85)))
    return camera
