// What stages 2 and 3 are told of a light, and a frame's guides in buffers.

struct Level {
    size: vec2u,
    // Pixels between taps.
    step: i32,
    // Guides stop the light.
    guided: u32,
    depth: f32,
    guide_noise: f32,
    normal: f32,
    // What multiplies squared differences of colours; 0: they do not count. Likewise normals that are seen.
    colour: f32,
    seen_normal: f32,
    // Squared, of the luminance stop.
    tolerance: f32,
    mirror_tolerance: f32,
    // Of the variance: pixels around that are pooled, samples that are trusted, the light's place among the counts, and
    // whether the renderer gave a variance.
    radius: i32,
    trusted_samples: f32,
    place: u32,
    given: u32,
}

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> geometry: array<vec4f>;
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
@group(0) @binding(3) var<storage, read> guide_colours: array<vec4f>;
@group(0) @binding(4) var<storage, read> seen_normals: array<vec4f>;

fn contains(pixel: vec2i) -> bool {
    return all(pixel >= vec2i(0)) && all(pixel < vec2i(level.size));
}

fn index_of(pixel: vec2i) -> u32 {
    return u32(pixel.y) * level.size.x + u32(pixel.x);
}

fn guides_at(i: u32) -> Guides {
    var guides: Guides;
    guides.geometry = geometry[i];
    guides.normal = normals[i];
    if level.colour > 0.0 || level.mirror_tolerance != level.tolerance {
        guides.colour = guide_colours[i];
    }
    if level.seen_normal > 0.0 {
        guides.seen_normal = seen_normals[i];
    }
    return guides;
}
