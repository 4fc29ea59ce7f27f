// Twin of mod.rs and sources.rs: all light sources, and the choice among them.

struct Emitter {
    kind: u32,
    two_sided: bool,
    radiance: vec3f,
    // Its way from the tree's root, and how long that is; NONE: it is not in the tree.
    trail: vec2u,
    depth: u32,
    // Triangle of the geometry whose radiance varies, or NONE.
    varying_triangle: u32,
    // Row of a lamp's first triangle, and their number.
    corners: u32,
    count: u32,
    // Points and spots: where they are and where to they shine; parallel light: its direction. Lamps of several
    // triangles: the middle of their box and their normal.
    centre: vec3f,
    normal: vec3f,
    // Spots: cosines of the inner and of the outer angle.
    cosines: vec2f,
    area: f32,
    // Nearer than this to the centre, they are sampled by solid angle.
    near: f32,
    is_parallelogram: bool,
    corner: vec3f,
    edge1: vec3f,
    edge2: vec3f,
}

const EMITTER_ROWS = 7u;

fn emitter_at(index: u32) -> Emitter {
    let at = frame.emitters + EMITTER_ROWS * index;
    let r0 = lights[at];
    let r1 = bitcast<vec4u>(lights[at + 1u]);
    let r2 = lights[at + 2u];
    let r3 = lights[at + 3u];
    let r4 = lights[at + 4u];
    let r5 = lights[at + 5u];
    let r6 = lights[at + 6u];
    var e: Emitter;
    let bits = bitcast<u32>(r0.w);
    e.radiance = r0.xyz;
    e.kind = bits & 0xffu;
    e.two_sided = (bits & 0x100u) != 0u;
    e.is_parallelogram = (bits & 0x200u) != 0u;
    e.count = bits >> 16u;
    e.trail = r1.xy;
    e.depth = r1.z;
    e.varying_triangle = r1.w;
    e.centre = r2.xyz;
    e.corners = bitcast<u32>(r2.w);
    e.normal = r3.xyz;
    e.area = r3.w;
    e.near = r4.w;
    e.cosines = vec2f(r5.w, r6.w);
    e.corner = r4.xyz;
    e.edge1 = r5.xyz;
    e.edge2 = r6.xyz;
    return e;
}

// A direction towards light; a density of 0: there is none.
struct LightSample {
    wi: vec3f,
    distance: f32,
    radiance: vec3f,
    pdf: f32,
    delta: bool,
}

const DARK = LightSample(vec3f(), 0.0, vec3f(), 0.0, false);

fn sources_can_be_hit() -> bool {
    return frame.has_area != 0u || has_environment();
}

fn sources_are_empty() -> bool {
    return frame.tree_nodes == 0u && frame.infinite_count == 0u;
}

// An infinite emitter: its number and the irradiance expected of it.
fn infinite_power(i: u32) -> f32 {
    return lights[frame.infinite + i].y;
}

fn infinite_emitter(i: u32) -> u32 {
    return bitcast<u32>(lights[frame.infinite + i].x);
}

fn infinite_irradiance(i: u32, normal: vec3f) -> f32 {
    let power = infinite_power(i);
    let emitter = infinite_emitter(i);
    if emitter == frame.environment_emitter || is_any_side(normal) {
        return power;
    }
    return power * max(-dot(normal, emitter_at(emitter).normal), 0.0);
}

fn infinite_total(normal: vec3f) -> f32 {
    var total = 0.0;
    for (var i = 0u; i < frame.infinite_count; i++) {
        total += infinite_irradiance(i, normal);
    }
    return total;
}

// Probability of asking the infinite sources.
fn infinite_probability(point: vec3f, normal: vec3f) -> f32 {
    if !HAS_INFINITE || frame.infinite_count == 0u {
        return 0.0;
    }
    let infinite = infinite_total(normal);
    let finite = tree_irradiance(point, normal);
    if infinite <= 0.0 {
        return 0.0;
    }
    if finite <= 0.0 {
        return 1.0;
    }
    return clamp(infinite / (infinite + finite), INFINITE_PROBABILITY.x, INFINITE_PROBABILITY.y);
}

// An emitter by a number in 0..1, with its probability and the end of the part of 0..1 that chooses it.
fn choose_emitter(point: vec3f, normal: vec3f, number: f32) -> LightChoice {
    let infinite = infinite_probability(point, normal);
    if HAS_INFINITE && number < infinite {
        let total = infinite_total(normal);
        let target_ = number / infinite * total;
        var choice = LightChoice(NONE, 0.0, infinite);
        var sum = 0.0;
        for (var i = 0u; i < frame.infinite_count; i++) {
            let irradiance = infinite_irradiance(i, normal);
            if irradiance > 0.0 {
                sum += irradiance;
                choice = LightChoice(infinite_emitter(i), infinite * irradiance / total, infinite * sum / total);
                if target_ < sum {
                    break;
                }
            }
        }
        return choice;
    }
    let choice = tree_sample(point, normal, (number - infinite) / (1.0 - infinite));
    let finite = 1.0 - infinite;
    return LightChoice(choice.emitter, finite * choice.probability, infinite + finite * choice.end);
}

// What all samples of one emitter from one point share.
fn view_of(e: Emitter, point: vec3f) -> LampView {
    if e.kind == TRIANGLE || e.kind == PATCH {
        return lamp_view(e, point);
    }
    return LampView(true, false, 0.0, 0.0);
}

fn is_delta_light(e: Emitter) -> bool {
    return e.kind == POINT || e.kind == SPOT || e.kind == DIRECTIONAL;
}

// A direction towards a chosen emitter. `normal` is 0 where light may come from both sides.
fn sample_emitter(
    e: Emitter, view: LampView, selection: f32, point: vec3f, normal: vec3f, u: vec2f,
) -> LightSample {
    var light = DARK;
    switch e.kind {
        case TRIANGLE, PATCH: {
            if view.lit {
                let s = lamp_sample(e, view, point, u);
                light = LightSample(s.wi, s.distance, e.radiance, selection * s.pdf, false);
                if VARYING && e.varying_triangle != NONE && s.pdf > 0.0 {
                    light.radiance = radiance_of(e.varying_triangle, s.barycentrics);
                }
            }
        }
        case POINT, SPOT: {
            let to_light = e.centre - point;
            let distance = length(to_light);
            var falloff = 1.0;
            if e.kind == SPOT {
                let ramp = (dot(-to_light, e.normal) / distance - e.cosines.y) / max(e.cosines.x - e.cosines.y, 1e-4);
                falloff = saturate(ramp) * saturate(ramp);
            }
            let radiance = e.radiance * falloff / (distance * distance);
            if distance > 0.0 && max_element(radiance) < INFINITE {
                light = LightSample(to_light / distance, distance, radiance, selection, true);
            }
        }
        case DIRECTIONAL: {
            light = LightSample(-e.normal, INFINITE, e.radiance, selection, true);
        }
        default: {
            if has_environment() {
                let wi = environment_sample(normal, u);
                light = LightSample(wi, INFINITE, environment_radiance(wi), selection * environment_pdf(normal, wi), false);
            }
        }
    }
    if !(light.pdf > 0.0 && light.pdf < INFINITE) {
        light = DARK;
    }
    return light;
}

// A direction towards light, from a point with this normal (0: light may come from both sides).
fn sample_light(point: vec3f, normal: vec3f, u: vec3f) -> LightSample {
    let choice = choose_emitter(point, normal, u.x);
    if choice.emitter == NONE || choice.probability <= 0.0 {
        return DARK;
    }
    let e = emitter_at(choice.emitter);
    return sample_emitter(e, view_of(e, point), choice.probability, point, normal, u.yz);
}

// Density with which light sampling finds an emissive triangle that the direction meets.
fn pdf_of_triangle(point: vec3f, normal: vec3f, triangle: u32, wi: vec3f) -> f32 {
    let emitter = triangles[triangle].emitter;
    if emitter == NONE {
        return 0.0;
    }
    let e = emitter_at(emitter);
    let share = tree_probability(point, normal, e.trail, e.depth);
    let view = lamp_view(e, point);
    if share <= 0.0 || !view.lit {
        return 0.0;
    }
    return (1.0 - infinite_probability(point, normal)) * share * lamp_pdf(e, view, point, wi);
}

// Density with which light sampling finds the environment in this direction.
fn pdf_of_environment(point: vec3f, normal: vec3f, wi: vec3f) -> f32 {
    if !has_environment() {
        return 0.0;
    }
    let total = infinite_total(normal);
    if total <= 0.0 {
        return 0.0;
    }
    var own = 0.0;
    for (var i = 0u; i < frame.infinite_count; i++) {
        if infinite_emitter(i) == frame.environment_emitter {
            own = infinite_power(i);
        }
    }
    return infinite_probability(point, normal) * (own / total) * environment_pdf(normal, wi);
}
