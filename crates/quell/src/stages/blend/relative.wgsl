// Differences relative to a brightness.

// Relative differences beyond it count as it: squares stay finite.
const MOST_RELATIVE: f32 = 1e15;

fn relative_to(v: vec3f, bright: f32) -> vec3f {
    return clamp(v / bright, vec3f(-MOST_RELATIVE), vec3f(MOST_RELATIVE));
}

fn squared(v: vec3f) -> f32 {
    return dot(v, v);
}
