// How unlike two pixels' guides are, as the exponent of a weight: twin of energy.rs.

// The depth tolerance grows with the tap's distance: its part at the centre, and that of every pixel further out.
const REACH = vec2f(0.3, 0.1);
// Part of the slope's own prediction by which it may be wrong: surfaces bend.
const SLOPE_ERROR = 0.2;
// Energy between surface and background: no weight is left.
const APART = 1e9;

struct Guides {
    // Slope of 1/depth, 1/depth, noise of the depth.
    geometry: vec4f,
    // Normal and its noise.
    normal: vec4f,
    // Colour, of the surface or of what is seen there; the fourth: a mirror.
    colour: vec4f,
    seen_normal: vec4f,
}

// Of the tap `q`, `offset` pixels from `p`.
fn energy(p: Guides, q: Guides, offset: vec2f, level: Level) -> f32 {
    if level.guided == 0u {
        return 0.0;
    }
    if (p.geometry.z > 0.0) != (q.geometry.z > 0.0) {
        return APART;
    }
    let along = dot(p.geometry.xy, offset);
    let miss = q.geometry.z - p.geometry.z - along;
    let reach = level.depth * (REACH.x + REACH.y * length(offset));
    let tolerance = p.geometry.z * (reach + level.guide_noise * p.geometry.w) + SLOPE_ERROR * abs(along) + 1e-20;
    // Far beyond any weight, and its square is finite.
    let r = min(abs(miss) / tolerance, 1e9);
    // Two pixels without normals do not differ in them.
    let has_normal = any(p.normal.xyz != vec3f(0.0)) || any(q.normal.xyz != vec3f(0.0));
    let bend = select(0.0, 1.0 - dot(p.normal.xyz, q.normal.xyz), has_normal);
    var sum = r * r + level.normal * bend / (1.0 + level.guide_noise * level.normal * p.normal.w);
    let d = p.colour.xyz - q.colour.xyz;
    sum += level.colour * dot(d, d);
    if level.seen_normal > 0.0 {
        sum += level.seen_normal * (1.0 - dot(p.seen_normal.xyz, q.seen_normal.xyz));
    }
    return sum;
}
