// Twin of cone.rs: how wide the part of the scene is that one ray stands for.

struct Cone {
    width: f32,
    spread: f32,
    sharp: bool,
}

const FINEST = Cone(0.0, 0.0, false);

fn cone_at(cone: Cone, t: f32) -> Cone {
    return Cone(cone.width + cone.spread * t, cone.spread, cone.sharp);
}

fn cone_scattered(cone: Cone, roughness: f32, delta: bool) -> Cone {
    if delta {
        return cone;
    }
    return Cone(cone.width, max(cone.spread, LOBE_SHARE * roughness * roughness), false);
}

struct Footprint {
    short: vec2f,
    long: vec2f,
    several: bool,
}

fn footprint_new(cone: Cone, a: vec3f, b: vec3f, c: vec3f, normal: vec3f, direction: vec3f) -> Footprint {
    let e1 = b - a;
    let e2 = c - a;
    let area = cross(e1, e2);
    let scale = cone.width / length_squared(area);
    let cosine = dot(normal, direction);
    let along = normalize_or(direction - normal * cosine, orthonormal_pair(normal)[1]);
    let across = cross(normal, along);
    let stretch = 1.0 / max(abs(cosine), 1e-2);
    let short = vec2f(dot(cross(across, e2), area), dot(cross(e1, across), area)) * scale;
    let long = vec2f(dot(cross(along, e2), area), dot(cross(e1, along), area)) * scale;
    return Footprint(short, long * stretch, cone.sharp);
}

struct Lookups {
    lod: f32,
    count: u32,
    step: vec2f,
}

fn log2_of(x: f32) -> f32 {
    return log2(max(x, MIN_POSITIVE));
}

fn footprint_lookups(f: Footprint, change1: vec2f, change2: vec2f) -> Lookups {
    let a = length(change1 * f.short.x + change2 * f.short.y);
    let b = length(change1 * f.long.x + change2 * f.long.y);
    let short = min(a, b);
    let long = max(a, b);
    let axis = select(f.short, f.long, a < b);
    if !f.several {
        return Lookups(0.5 * log2_of(short * long), 1u, vec2f());
    }
    let lookups = ceil(clamp(long / max(short, 1.0), 1.0, MAX_LOOKUPS));
    return Lookups(log2_of(max(short, long / lookups)), u32(lookups), axis / lookups);
}
