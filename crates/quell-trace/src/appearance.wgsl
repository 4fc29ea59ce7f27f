// Twin of appearance.rs: what textures and vertex colours make of a surface at a point.

// A point of a triangle and where the attributes of its corners lie.
struct Spot {
    surface: u32,
    instance: u32,
    corners: vec3u,
    weights: vec2f,
}

fn spot_new(triangle: u32, weights: vec2f) -> Spot {
    let instance = triangles[triangle].instance;
    return Spot(instances[instance].surface, instance, corners_of(triangle), weights);
}

fn corners_of(triangle: u32) -> vec3u {
    let at = instances[triangles[triangle].instance].corners + 3u * triangles[triangle].number;
    return vec3u(attributes[at], attributes[at + 1u], attributes[at + 2u]);
}

// Transformed texture coordinates of the corners.
fn spot_coordinates(spot: Spot, texture: TextureRef) -> array<vec2f, 3> {
    let first = select(instances[spot.instance].uvs1, instances[spot.instance].uvs, texture.uv_set == 0u);
    var uv: array<vec2f, 3>;
    for (var k = 0u; k < 3u; k++) {
        var at = vec2f();
        if first != NONE {
            at = attribute2(first, spot.corners[k]);
        }
        uv[k] = texture.matrix.xy * at.x + texture.matrix.zw * at.y + texture.offset;
    }
    return uv;
}

fn between2(v: array<vec2f, 3>, weights: vec2f) -> vec2f {
    return v[0] * (1.0 - weights.x - weights.y) + v[1] * weights.x + v[2] * weights.y;
}

// The texture's value, averaged over the footprint, or at the finest level.
fn spot_value(spot: Spot, texture: TextureRef, filtered: bool, footprint: Footprint, srgb: bool) -> vec4f {
    let uv = spot_coordinates(spot, texture);
    var lookups = Lookups(0.0, 1u, vec2f());
    if filtered {
        lookups = footprint_lookups(footprint, (uv[1] - uv[0]) * texture.extent, (uv[2] - uv[0]) * texture.extent);
    }
    let middle = 0.5 * (f32(lookups.count) - 1.0);
    var sum = vec4f();
    for (var i = 0u; i < lookups.count; i++) {
        let weights = spot.weights + lookups.step * (f32(i) - middle);
        sum += image_sample(texture, between2(uv, weights), lookups.lod, srgb);
    }
    return sum / f32(lookups.count);
}

fn spot_vertex_color(spot: Spot) -> vec4f {
    let colors = instances[spot.instance].colors;
    if colors == NONE {
        return vec4f(1.0);
    }
    return attribute4(colors, spot.corners.x) * (1.0 - spot.weights.x - spot.weights.y)
        + attribute4(colors, spot.corners.y) * spot.weights.x
        + attribute4(colors, spot.corners.z) * spot.weights.y;
}

// Opacity, 0..1, at the finest level.
fn spot_opacity(spot: Spot) -> f32 {
    var opacity = surfaces[spot.surface].alpha_factor * spot_vertex_color(spot).w;
    let texture = surfaces[spot.surface].textures[BASE_COLOR_TEXTURE];
    if texture.levels != NONE {
        let uv = between2(spot_coordinates(spot, texture), spot.weights);
        let nearest = (texture.lookup & 1u) != 0u;
        opacity *= level_filtered(image_level(texture, 0u), uv, texture.lookup, nearest, false).w;
    }
    return saturate(opacity);
}

fn shining_texture(surface: u32) -> u32 {
    return select(EMISSIVE_TEXTURE, BASE_COLOR_TEXTURE, has_flag(surfaces[surface].flags, UNLIT));
}

// What emission is multiplied by here.
fn spot_emission(spot: Spot, filtered: bool, footprint: Footprint) -> vec3f {
    var emission = vec3f(1.0);
    let texture = surfaces[spot.surface].textures[shining_texture(spot.surface)];
    if texture.levels != NONE {
        emission = spot_value(spot, texture, filtered, footprint, true).xyz;
    }
    if has_flag(surfaces[spot.surface].flags, UNLIT) {
        emission *= spot_vertex_color(spot).xyz;
    }
    return emission;
}

struct Painted {
    material: Material,
    // What the normal map holds; 0: there is none.
    mapped: vec3f,
}

// Multiplies textures and vertex colours into a material that holds their factors. One loop over the textures, so that
// there is one lookup in the program.
fn spot_paint(spot: Spot, factors: Material, footprint: Footprint, cone: Cone) -> Painted {
    var painted = Painted(factors, vec3f());
    let flags = surfaces[spot.surface].flags;
    let unlit = has_flag(flags, UNLIT);
    let color = spot_vertex_color(spot).xyz;
    if unlit {
        painted.material.emission *= color;
    } else {
        painted.material.base_color *= color;
    }
    let shining = shining_texture(spot.surface);
    for (var slot = 0u; slot < TEXTURES; slot++) {
        let texture = surfaces[spot.surface].textures[slot];
        if texture.levels == NONE {
            continue;
        }
        let emits = slot == shining;
        if emits && max_element(factors.emission) <= 0.0 {
            continue;
        }
        if unlit && !emits && slot != NORMAL_TEXTURE {
            continue;
        }
        let srgb = slot == BASE_COLOR_TEXTURE || slot == EMISSIVE_TEXTURE || slot == SPECULAR_COLOR_TEXTURE;
        let v = spot_value(spot, texture, !emits || cone.sharp, footprint, srgb);
        if emits {
            painted.material.emission *= v.xyz;
            continue;
        }
        switch slot {
            case BASE_COLOR_TEXTURE: {
                painted.material.base_color *= v.xyz;
            }
            case METALLIC_ROUGHNESS_TEXTURE: {
                painted.material.roughness *= v.y;
                painted.material.metallic *= v.z;
            }
            case TRANSMISSION_TEXTURE: {
                painted.material.transmission *= v.x;
            }
            case SPECULAR_TEXTURE: {
                painted.material.specular *= v.w;
            }
            case SPECULAR_COLOR_TEXTURE: {
                painted.material.specular_color *= v.xyz;
            }
            case NORMAL_TEXTURE: {
                painted.mapped = v.xyz * 2.0 - 1.0;
            }
            default: {}
        }
    }
    return painted;
}

// The mapped normal of a point, on the side of `n`. `a`, `b`, `c` are the triangle's corners.
fn mapped_normal(spot: Spot, v: vec3f, n: vec3f, a: vec3f, b: vec3f, c: vec3f) -> vec3f {
    var tangent = vec3f();
    var bitangent = vec3f();
    let instance = spot.instance;
    let tangents = instances[instance].tangents;
    if tangents != NONE {
        let w = 1.0 - spot.weights.x - spot.weights.y;
        let first = attribute4(tangents, spot.corners.x);
        let given = first.xyz * w + attribute4(tangents, spot.corners.y).xyz * spot.weights.x
            + attribute4(tangents, spot.corners.z).xyz * spot.weights.y;
        let along = instances[instance].world_from_mesh * given;
        tangent = normalize_or(along - n * dot(n, along), vec3f());
        let handedness = select(1.0, -1.0, has_flag(instances[instance].flags, MIRRORED));
        bitangent = cross(n, tangent) * select(1.0, -1.0, first.w < 0.0) * handedness;
    } else {
        let uv = spot_coordinates(spot, surfaces[spot.surface].textures[NORMAL_TEXTURE]);
        let d1 = uv[1] - uv[0];
        let d2 = uv[2] - uv[0];
        let determinant = d1.x * d2.y - d1.y * d2.x;
        if determinant == 0.0 || abs(determinant) >= INFINITE {
            return n;
        }
        let side = sign(determinant);
        let along_u = ((b - a) * d2.y - (c - a) * d1.y) * side;
        let along_v = ((c - a) * d1.x - (b - a) * d2.x) * side;
        tangent = normalize_or(along_u - n * dot(n, along_u), vec3f());
        bitangent = cross(n, tangent);
        bitangent = select(bitangent, -bitangent, dot(bitangent, along_v) > 0.0);
    }
    if length_squared(tangent) == 0.0 {
        return n;
    }
    let slope = v.xy * surfaces[spot.surface].normal_scale;
    return normalize_or(tangent * slope.x + bitangent * slope.y + n * max(v.z, 1e-3), n);
}

// A mapped normal turned back towards the true one until its mirror direction leaves the surface; all on one side.
fn usable_normal(mapped: vec3f, geometric: vec3f, wo: vec3f) -> vec3f {
    let aside = normalize_or(mapped - geometric * dot(geometric, mapped), vec3f());
    let a = dot(wo, aside);
    let c = max(dot(wo, geometric), 0.0);
    let r = length(vec2f(a, c));
    if r <= 0.0 || length_squared(aside) == 0.0 {
        return geometric;
    }
    let least = min(MIRROR_COS.y * c, MIRROR_COS.x);
    let largest = 0.5 * (atan2_precise(a, c) + acos_precise(clamp(least / r, -1.0, 1.0)));
    if atan2_precise(dot(mapped, aside), dot(mapped, geometric)) <= largest {
        return mapped;
    }
    return normalize_or(geometric * cos(largest) + aside * sin(largest), geometric);
}
