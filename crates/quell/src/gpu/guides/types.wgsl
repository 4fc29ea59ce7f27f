// Twin of border.rs (`Guides`): what a pixel shows. WGSL promises nothing of infinities and NaN, so background has depth
// 0, a hit that left the scene lies at `FAR`, and unknown motion points far off screen.

// All guides of one pixel.
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

// What only this frame needs to know.
struct Moving {
    motion: vec2f,
    glossy_hit: f32,
    confidence_in: f32,
}
