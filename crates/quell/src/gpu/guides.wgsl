// Twin of border.rs (`Guides`): what a pixel shows. WGSL promises nothing of infinities and NaN, so background has depth
// 0, a hit that left the scene lies at `FAR`, and unknown motion points far off screen.
//
// The pass supplies the array `guides`.

// View depth of background.
const BACKGROUND: f32 = 0.0;
// Distances from here on are infinite.
const FAR: f32 = 1e30;

// The guides of one pixel.
struct Guide {
    normal: vec3f,
    depth: f32,
    motion: vec2f,
    roughness: f32,
    glossy_hit: f32,
    id: u32,
    confidence_in: f32,
}

// What a pixel shows: a surface point, or background.
struct Surface {
    position: vec3f,
    normal: vec3f,
    view_depth: f32,
    roughness: f32,
    id: u32,
}

// Where a pixel was sampled.
fn sample_position(pixel: vec2i) -> vec2f {
    return vec2f(pixel) + 0.5 + frame.jitter;
}

// Position of a pixel, whose depth must be finite.
fn world_of(pixel: vec2i) -> vec3f {
    return world(frame.view, sample_position(pixel), guides[index_of(pixel)].depth);
}

fn is_surface(pixel: vec2i) -> bool {
    return guides[index_of(pixel)].depth != BACKGROUND;
}

// The surface of a pixel; its position is only meaningful where it is no background.
fn surface_of(pixel: vec2i) -> Surface {
    let guide = guides[index_of(pixel)];
    return Surface(
        world(frame.view, sample_position(pixel), guide.depth),
        guide.normal,
        guide.depth,
        guide.roughness,
        guide.id,
    );
}
