// Twin of tree.rs: a binary tree over finite emitters, descended by an estimate of the irradiance of each half. A node
// is four rows of `lights`.

struct Group {
    low: vec3f,
    sin_spread: f32,
    high: vec3f,
    cos_spread: f32,
    axis: vec3f,
    cos_emission: f32,
    intensity: f32,
    two_sided: bool,
}

const NODE_ROWS = 4u;
const IS_LEAF = 2u;

fn light_group(node: u32) -> Group {
    let at = NODE_ROWS * node;
    let low = lights[at];
    let high = lights[at + 1u];
    let axis = lights[at + 2u];
    let rest = lights[at + 3u];
    let two_sided = (bitcast<u32>(rest.y) & 1u) != 0u;
    return Group(low.xyz, low.w, high.xyz, high.w, axis.xyz, axis.w, rest.x, two_sided);
}

fn is_light_leaf(node: u32) -> bool {
    return (bitcast<u32>(lights[NODE_ROWS * node + 3u].y) & IS_LEAF) != 0u;
}

// Of a leaf its emitter, of others their second child; the first follows its parent.
fn light_link(node: u32) -> u32 {
    return bitcast<u32>(lights[NODE_ROWS * node + 3u].z);
}

// Sine and cosine of max(0, a - b).
fn angle_difference(a: vec2f, b: vec2f) -> vec2f {
    if a.y > b.y {
        return vec2f(0.0, 1.0);
    }
    return vec2f(a.x * b.y - a.y * b.x, a.y * b.y + a.x * b.x);
}

// Sine and cosine of the smallest angle between a light's normal and the way to the receiver.
fn angle_to_cone(g: Group, to_light: vec3f) -> vec2f {
    var cosine = -dot(g.axis, to_light);
    cosine = select(cosine, abs(cosine), g.two_sided);
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    return angle_difference(vec2f(sine, cosine), vec2f(g.sin_spread, g.cos_spread));
}

fn is_any_side(normal: vec3f) -> bool {
    return all(normal == vec3f());
}

fn group_irradiance(g: Group, point: vec3f, normal: vec3f) -> f32 {
    let bound = irradiance_bound(g, point, normal);
    if bound <= 0.0 {
        return 0.0;
    }
    let diagonal2 = length_squared(g.high - g.low);
    if diagonal2 <= 0.0 {
        return bound;
    }
    let typical = group_cosines(g, 0.5 * (g.low + g.high) - point, normal, 0.25 * diagonal2);
    let nearest = group_cosines(g, clamp(point, g.low, g.high) - point, normal, diagonal2);
    return g.intensity * (typical + nearest) + BOUND_SHARE * bound;
}

fn group_cosines(g: Group, way: vec3f, normal: vec3f, least2: f32) -> f32 {
    let distance2 = length_squared(way);
    if distance2 < MIN_POSITIVE {
        return 1.0 / least2;
    }
    let to_light = way / sqrt(distance2);
    let cone_cos = angle_to_cone(g, to_light).y;
    let cos_light = select(0.0, max(cone_cos, 0.0), cone_cos > g.cos_emission);
    let cos_receiver = select(max(dot(normal, to_light), 0.0), 1.0, is_any_side(normal));
    return cos_light * cos_receiver / max(distance2, least2);
}

fn irradiance_bound(g: Group, point: vec3f, normal: vec3f) -> f32 {
    let to_centre = 0.5 * (g.low + g.high) - point;
    let distance2 = length_squared(to_centre);
    let radius2 = 0.25 * length_squared(g.high - g.low);
    if distance2 <= radius2 || distance2 < MIN_POSITIVE {
        // A point on a light: an estimate so large that no other counts, but finite.
        return min(g.intensity / max(radius2, 1e-30), 1e30);
    }
    let to_light = to_centre / sqrt(distance2);
    let b = vec2f(sqrt(radius2 / distance2), sqrt(max(1.0 - radius2 / distance2, 0.0)));
    let cos_light = angle_difference(angle_to_cone(g, to_light), b).y;
    if cos_light <= g.cos_emission - CONE_SLACK {
        return 0.0;
    }
    var irradiance = g.intensity * max(cos_light, CONE_SLACK) / distance2;
    if !is_any_side(normal) {
        let cos_n = dot(normal, to_light);
        let sin_n = sqrt(max(1.0 - cos_n * cos_n, 0.0));
        let cos_receiver = angle_difference(vec2f(sin_n, cos_n), b).y;
        if cos_receiver <= -CONE_SLACK {
            return 0.0;
        }
        irradiance *= max(cos_receiver, CONE_SLACK);
    }
    return irradiance;
}

fn tree_irradiance(point: vec3f, normal: vec3f) -> f32 {
    if frame.tree_nodes == 0u {
        return 0.0;
    }
    return group_irradiance(light_group(0u), point, normal);
}

// Probability of the first child; negative where neither can shine.
fn first_probability(first: u32, second: u32, point: vec3f, normal: vec3f) -> f32 {
    // A loop: the estimate is long, and programs are inlined.
    var each = vec2f();
    for (var i = 0u; i < 2u; i++) {
        each[i] = group_irradiance(light_group(select(second, first, i == 0u)), point, normal);
    }
    return select(-1.0, each.x / (each.x + each.y), each.x + each.y > 0.0);
}

// An emitter, the probability of choosing it, and the part of 0..1 whose numbers choose it.
struct LightChoice {
    // NONE: none can shine.
    emitter: u32,
    probability: f32,
    end: f32,
}

fn tree_sample(point: vec3f, normal: vec3f, number: f32) -> LightChoice {
    let none = LightChoice(NONE, 0.0, 1.0);
    if tree_irradiance(point, normal) <= 0.0 {
        return none;
    }
    var place = 0u;
    var u = number;
    var probability = 1.0;
    var start = 0.0;
    while !is_light_leaf(place) {
        let second = light_link(place);
        let p = first_probability(place + 1u, second, point, normal);
        if p < 0.0 {
            return LightChoice(NONE, 0.0, start + probability);
        }
        if u < p {
            u /= p;
            probability *= p;
            place += 1u;
        } else {
            u = (u - p) / (1.0 - p);
            start += probability * p;
            probability *= 1.0 - p;
            place = second;
        }
        u = clamp(u, 0.0, ONE_MINUS_EPSILON);
    }
    return LightChoice(select(NONE, light_link(place), probability > 0.0), probability, start + probability);
}

// Probability with which `tree_sample` chooses an emitter, by the way from the root to it.
fn tree_probability(point: vec3f, normal: vec3f, trail: vec2u, depth: u32) -> f32 {
    if depth == NONE || tree_irradiance(point, normal) <= 0.0 {
        return 0.0;
    }
    var place = 0u;
    var probability = 1.0;
    for (var i = 0u; i < depth; i++) {
        let second = light_link(place);
        let p = first_probability(place + 1u, second, point, normal);
        if p < 0.0 {
            return 0.0;
        }
        let bit = (select(trail.x, trail.y, i >= 32u) >> (i & 31u)) & 1u;
        probability *= select(1.0 - p, p, bit == 0u);
        place = select(second, place + 1u, bit == 0u);
    }
    return probability;
}
