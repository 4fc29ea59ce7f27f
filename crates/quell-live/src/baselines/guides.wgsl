// Normal and depth of each pixel in one texel, and how both change from pixel to pixel within an object.

@group(0) @binding(1) var depth_hit: texture_2d<f32>;
@group(0) @binding(2) var normal_roughness: texture_2d<f32>;
@group(0) @binding(3) var surface_id: texture_2d<u32>;
@group(0) @binding(4) var surface_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(5) var slope_out: texture_storage_2d<rgba32float, write>;

// Normal, and view depth; BACKGROUND where there is no surface, and no normal.
fn surface_at(at: vec2i) -> vec4f {
    let depth = textureLoad(depth_hit, at, 0).x;
    let is_surface = depth > 0.0 && depth < BACKGROUND;
    let normal = textureLoad(normal_roughness, at, 0).xyz;
    return select(vec4f(0.0, 0.0, 0.0, BACKGROUND), vec4f(normal, min(depth, 0.5 * BACKGROUND)), is_surface);
}

@compute @workgroup_size(8, 8)
fn guides(@builtin(global_invocation_id) id: vec3u) {
    let at = vec2i(id.xy);
    if !is_inside(at) {
        return;
    }
    let own = surface_at(at);
    let own_id = textureLoad(surface_id, at, 0).x;
    // Of the two neighbours along an axis, the one that differs less: an edge is no slope.
    var gradient = vec2f();
    var normal_width = 0.0;
    for (var axis = 0; axis < 2; axis++) {
        var change = NONE;
        var turn = NONE;
        for (var side = -1; side <= 1; side += 2) {
            let q = at + select(vec2i(0, side), vec2i(side, 0), axis == 0);
            if !is_inside(q) || textureLoad(surface_id, q, 0).x != own_id {
                continue;
            }
            let other = surface_at(q);
            let to = f32(side) * (other.w - own.w);
            change = select(change, to, abs(to) < abs(change));
            turn = min(turn, length(other.xyz - own.xyz));
        }
        gradient[axis] = select(change, 0.0, change >= NONE);
        normal_width += select(turn, 0.0, turn >= NONE);
    }
    textureStore(surface_out, at, own);
    textureStore(slope_out, at, vec4f(gradient, normal_width, 0.0));
}
