// Twin of guide_distance.rs: how unlike the feature buffers of two pixels are, and the edge-stopping weight of that.

// How much each feature buffer counts.
struct GuideStops {
    // Feature buffers stop the light; media have none.
    @align(16) guided: u32,
    // Tolerance of depth, relative.
    depth: f32,
    // Part of it that holds at the centre, and that each pixel of the tap's distance adds.
    reach: vec2f,
    // How wrong the slope's prediction may be, relative.
    slope_error: f32,
    // How far the buffers' own noise loosens them.
    noise: f32,
    // Fall per 1 - cosine of normals.
    normal: f32,
    // What multiplies squared differences of colours; 0: they do not count.
    colour: f32,
    // Fall per 1 - cosine of the normals that mirrors and glass show; 0: they do not count.
    seen_normal: f32,
}

// Beyond any weight, and its square is finite.
const MOST_MISS: f32 = 1e9;

// Feature buffers of a pixel, as stage `feature_noise` leaves them.
struct Features {
    // Slope of 1/depth, 1/depth, noise of the depth.
    geometry: vec4f,
    // Normal and its noise.
    normal: vec4f,
    // Colour, of the surface or of what is seen there; the fourth: a mirror.
    colour: vec4f,
    seen_normal: vec4f,
}

// exp(-distance), nearly: (1 - distance / 16)^16.
fn weight(distance: f32) -> f32 {
    var b = max(1.0 - distance * (1.0 / FARTHEST), 0.0);
    b *= b;
    b *= b;
    b *= b;
    return b * b;
}

// Of the tap `q`, `offset` pixels from `p`.
fn guide_distance(p: Features, q: Features, offset: vec2f, stops: GuideStops) -> f32 {
    if stops.guided == 0u {
        return 0.0;
    }
    if (p.geometry.z > 0.0) != (q.geometry.z > 0.0) {
        return APART;
    }
    let along = dot(p.geometry.xy, offset);
    let miss = q.geometry.z - p.geometry.z - along;
    let reach = stops.depth * (stops.reach.x + stops.reach.y * length(offset));
    let tolerance =
        p.geometry.z * (reach + stops.noise * p.geometry.w) + stops.slope_error * abs(along) + LEAST_TOLERANCE;
    let r = min(abs(miss) / tolerance, MOST_MISS);
    // Two pixels without normals do not differ in them.
    let has_normal = any(p.normal.xyz != vec3f(0.0)) || any(q.normal.xyz != vec3f(0.0));
    let bend = select(0.0, 1.0 - dot(p.normal.xyz, q.normal.xyz), has_normal);
    var sum = r * r + stops.normal * bend / (1.0 + stops.noise * stops.normal * p.normal.w);
    let d = p.colour.xyz - q.colour.xyz;
    sum += stops.colour * dot(d, d);
    if stops.seen_normal > 0.0 {
        // The sky in a mirror has none.
        let has_seen = any(p.seen_normal.xyz != vec3f(0.0)) || any(q.seen_normal.xyz != vec3f(0.0));
        sum += select(0.0, stops.seen_normal * (1.0 - dot(p.seen_normal.xyz, q.seen_normal.xyz)), has_seen);
    }
    return sum;
}
