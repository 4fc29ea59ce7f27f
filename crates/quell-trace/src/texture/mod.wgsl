// Twin of mod.rs and level.rs: images looked up by texture coordinate and footprint. All texels of all levels lie in one
// array texture, one after the other, and are filtered here: so a lookup has the CPU's wraps and colours, and no image
// needs a binding of its own.

// Texel coordinates beyond this have lost their fraction anyway.
const FAR_TEXEL = 1e9;

struct Level {
    first: u32,
    extent: vec2i,
}

fn image_level(texture: TextureRef, index: u32) -> Level {
    let at = texture.levels + 3u * index;
    return Level(attributes[at], vec2i(i32(attributes[at + 1u]), i32(attributes[at + 2u])));
}

fn wrapped(index: i32, extent: i32, wrap: u32) -> i32 {
    if index >= 0 && index < extent {
        return index;
    }
    switch wrap {
        case WRAP_CLAMP: {
            return clamp(index, 0, extent - 1);
        }
        case WRAP_MIRROR: {
            let folded = ((index % (2 * extent)) + 2 * extent) % (2 * extent);
            return select(2 * extent - 1 - folded, folded, folded < extent);
        }
        default: {
            return ((index % extent) + extent) % extent;
        }
    }
}

fn texel_codes(level: Level, x: i32, y: i32) -> vec4u {
    let index = level.first + u32(y) * u32(level.extent.x) + u32(x);
    let row = index / HEAP_WIDTH;
    return textureLoad(texels, vec2u(index % HEAP_WIDTH, row % HEAP_WIDTH), row / HEAP_WIDTH, 0);
}

fn texel(level: Level, x: i32, y: i32, srgb: bool) -> vec4f {
    let codes = texel_codes(level, x, y);
    let linear = vec4f(codes) * (1.0 / 255.0);
    if !srgb {
        return linear;
    }
    // The curve of sRGB is a table at the beginning of the attributes.
    let color = vec3u(attributes[codes.x], attributes[codes.y], attributes[codes.z]);
    return vec4f(bitcast<vec3f>(color), linear.w);
}

fn level_filtered(level: Level, uv: vec2f, lookup: u32, nearest: bool, srgb: bool) -> vec4f {
    let wrap_s = (lookup >> 2u) & 3u;
    let wrap_t = (lookup >> 4u) & 3u;
    let scaled = uv * vec2f(level.extent);
    if nearest {
        let at = vec2i(floor(clamp(scaled, vec2f(-FAR_TEXEL), vec2f(FAR_TEXEL))));
        return texel(level, wrapped(at.x, level.extent.x, wrap_s), wrapped(at.y, level.extent.y, wrap_t), srgb);
    }
    let position = clamp(scaled - 0.5, vec2f(-FAR_TEXEL), vec2f(FAR_TEXEL));
    let first = floor(position);
    let share = position - first;
    let index = vec2i(first);
    let x0 = wrapped(index.x, level.extent.x, wrap_s);
    let x1 = wrapped(index.x + 1, level.extent.x, wrap_s);
    let y0 = wrapped(index.y, level.extent.y, wrap_t);
    let y1 = wrapped(index.y + 1, level.extent.y, wrap_t);
    let top = mix(texel(level, x0, y0, srgb), texel(level, x1, y0, srgb), share.x);
    let bottom = mix(texel(level, x0, y1, srgb), texel(level, x1, y1, srgb), share.x);
    return mix(top, bottom, share.y);
}

fn image_sample(texture: TextureRef, uv: vec2f, lod: f32, srgb: bool) -> vec4f {
    if !(lod > 0.0) {
        return level_filtered(image_level(texture, 0u), uv, texture.lookup, (texture.lookup & 1u) != 0u, srgb);
    }
    let limited = min(lod, f32(texture.level_count - 1u));
    let fine = u32(floor(limited));
    let share = limited - floor(limited);
    let nearest = (texture.lookup & 2u) != 0u;
    var value = level_filtered(image_level(texture, fine), uv, texture.lookup, nearest, srgb);
    if share > 0.0 {
        value = mix(value, level_filtered(image_level(texture, fine + 1u), uv, texture.lookup, nearest, srgb), share);
    }
    return value;
}
