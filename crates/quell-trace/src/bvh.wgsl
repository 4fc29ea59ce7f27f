// Twin of bvh.rs and geometry.rs: the walks through the eight-wide hierarchy, over the CPU's own nodes.

struct Hit {
    // INFINITE: nothing is met.
    t: f32,
    triangle: u32,
    barycentric: vec2f,
}

// Which of the surfaces that are partly there a ray meets: all that are not fully clear, or each with its opacity as
// probability, chosen by the seed.
struct Veils {
    all: bool,
    seed: vec2u,
}

struct Slabs {
    origin: vec3f,
    inverse: vec3f,
    // Which planes are met first, by axis.
    near: vec3u,
}

fn slabs_new(origin: vec3f, direction: vec3f) -> Slabs {
    let inverse = 1.0 / select(direction, vec3f(LEAST_COMPONENT), abs(direction) < vec3f(LEAST_COMPONENT));
    return Slabs(origin, inverse, vec3u(0u, 2u, 4u) + select(vec3u(0u), vec3u(1u), inverse < vec3f()));
}

struct Boxes {
    near: array<vec4f, 2>,
    hit: array<vec4<bool>, 2>,
}

fn slabs_meet(slabs: Slabs, node: u32, limit: f32) -> Boxes {
    var boxes: Boxes;
    for (var half = 0u; half < 2u; half++) {
        let x0 = (nodes[node].planes[2u * slabs.near.x + half] - slabs.origin.x) * slabs.inverse.x;
        let y0 = (nodes[node].planes[2u * slabs.near.y + half] - slabs.origin.y) * slabs.inverse.y;
        let z0 = (nodes[node].planes[2u * slabs.near.z + half] - slabs.origin.z) * slabs.inverse.z;
        let x1 = (nodes[node].planes[2u * (slabs.near.x ^ 1u) + half] - slabs.origin.x) * slabs.inverse.x;
        let y1 = (nodes[node].planes[2u * (slabs.near.y ^ 1u) + half] - slabs.origin.y) * slabs.inverse.y;
        let z1 = (nodes[node].planes[2u * (slabs.near.z ^ 1u) + half] - slabs.origin.z) * slabs.inverse.z;
        let near = max(max(x0, y0), max(z0, vec4f()));
        let far = min(min(x1, y1), min(z1, vec4f(limit)));
        boxes.near[half] = near;
        boxes.hit[half] = near <= far * SLACK;
    }
    return boxes;
}

// Ray parameter and barycentric coordinates; a parameter of INFINITE: not met.
fn intersect(triangle: u32, origin: vec3f, direction: vec3f, limit: f32) -> vec3f {
    let missed = vec3f(INFINITE, 0.0, 0.0);
    let a = triangles[triangle].a - origin;
    let b = triangles[triangle].b - origin;
    let c = triangles[triangle].c - origin;
    let e0 = c - a;
    let e1 = a - b;
    let e2 = b - c;
    let u = dot(cross(e0, c + a), direction);
    let v = dot(cross(e1, a + b), direction);
    let w = dot(cross(e2, b + c), direction);
    if !((u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0)) {
        return missed;
    }
    let normal = cross(e1, e0);
    let along = dot(normal, direction);
    let sum = u + v + w;
    if along == 0.0 || sum == 0.0 {
        return missed;
    }
    let t = dot(normal, a) / along;
    return select(missed, vec3f(t, u / sum, v / sum), t > 0.0 && t <= limit);
}

// Whether a surface that covers a part of its points is there at this one.
fn is_there(triangle: u32, weights: vec2f, veils: Veils) -> bool {
    let instance = triangles[triangle].instance;
    let flags = instances[instance].flags;
    if !has_flag(flags, MASKED | BLENDED) {
        return true;
    }
    let opacity = spot_opacity(spot_new(triangle, weights));
    if has_flag(flags, MASKED) {
        return opacity >= instances[instance].cutoff;
    }
    if veils.all {
        return opacity > 0.0;
    }
    let key = vec2u(triangles[triangle].number, instance);
    let chance = f32(mix64(veils.seed ^ mix64(key)).y >> 8u) / 16777216.0;
    return chance < opacity;
}

fn ranks_before(a: u32, b: u32) -> bool {
    let x = triangles[a].instance;
    let y = triangles[b].instance;
    return x < y || (x == y && triangles[a].number < triangles[b].number);
}

// What is still to be visited: where the ray enters it, and its link.
struct Entry {
    near: f32,
    link: u32,
}

// The nearest surface along a unit direction before `limit`. `any`: any surface there.
fn walk_hierarchy(start: vec3f, direction: vec3f, farthest: f32, any: bool, veils: Veils) -> Hit {
    var best = Hit(INFINITE, NONE, vec2f());
    if frame.triangle_count == 0u || !(max_element(abs(start)) < INFINITE) || !(max_element(abs(direction)) < INFINITE) {
        // The CPU takes rays that are no rays for shadowed.
        best.triangle = select(0u, NONE, frame.triangle_count == 0u || !any);
        return best;
    }
    let origin = start * frame.inner_from_world;
    let slabs = slabs_new(origin, direction);
    var limit = farthest;
    var stack: array<Entry, STACK>;
    var depth = 0u;
    var next = Entry(0.0, 0u);
    loop {
        if next.near <= limit * SLACK {
            let index = next.link >> 2u;
            let count = next.link & 3u;
            for (var triangle = index; triangle < index + count; triangle++) {
                let met = intersect(triangle, origin, direction, limit);
                if met.x < INFINITE && (!HAS_COVERAGE || is_there(triangle, met.yz, veils)) {
                    if any {
                        best.triangle = triangle;
                        return best;
                    }
                    if met.x < best.t || (met.x == best.t && ranks_before(triangle, best.triangle)) {
                        best = Hit(met.x, triangle, met.yz);
                    }
                    limit = met.x;
                }
            }
            if count == 0u {
                let boxes = slabs_meet(slabs, index, limit);
                let begin = depth;
                for (var slot = 0u; slot < 8u; slot++) {
                    if !boxes.hit[slot >> 2u][slot & 3u] {
                        continue;
                    }
                    let entry = Entry(boxes.near[slot >> 2u][slot & 3u], nodes[index].links[slot >> 2u][slot & 3u]);
                    // Nearest on top.
                    var place = depth;
                    while place > begin && stack[place - 1u].near < entry.near {
                        stack[place] = stack[place - 1u];
                        place -= 1u;
                    }
                    stack[place] = entry;
                    depth += 1u;
                }
            }
        }
        if depth == 0u {
            break;
        }
        depth -= 1u;
        next = stack[depth];
    }
    if best.triangle != NONE {
        best.t *= frame.world_from_inner;
    }
    return best;
}

fn closest(origin: vec3f, direction: vec3f, veils: Veils) -> Hit {
    return walk_hierarchy(origin, direction, INFINITE, false, veils);
}

fn occluded(origin: vec3f, direction: vec3f, distance: f32, veils: Veils) -> bool {
    let limit = select(INFINITE, distance * SHADOW_END * frame.inner_from_world, distance < INFINITE);
    return walk_hierarchy(origin, direction, limit, true, veils).triangle != NONE;
}
