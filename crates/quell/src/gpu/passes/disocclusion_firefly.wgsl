// Stages 5 and 6 in one: what stage 5 shows stays in workgroup memory, a pixel further than the tile on each side.
const BORDER: i32 = 1;

// Colour; a negative fourth value is background.
var<workgroup> blended_tile: array<vec4f, INNER * INNER>;

fn blended_slot(pixel: vec2i) -> i32 {
    let at = pixel - inner_first;
    return at.y * INNER + at.x;
}

fn firefly_input(pixel: vec2i) -> vec3f {
    return blended_tile[blended_slot(pixel)].xyz;
}

fn firefly_is_surface(pixel: vec2i) -> bool {
    return blended_tile[blended_slot(pixel)].w >= 0.0;
}

@compute @workgroup_size(8, 8)
fn blend_and_suppress(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    gather_distrust(group.xy, i32(local));
    for (var i = i32(local); i < INNER * INNER; i += INVOCATIONS) {
        let pixel = pixel_in(inner_first, i, INNER);
        if contains(pixel) {
            let accumulated = textureLoad(temporal, pixel, 0);
            let result = blended_at(pixel, accumulated.xyz);
            blended_tile[i] = vec4f(stored_colour(result.shown), accumulated.w);
            let inside = pixel - inner_first;
            if all(inside >= vec2i(BORDER)) && all(inside < vec2i(BORDER + TILE)) {
                textureStore(floored, pixel, vec4f(stored_colour(result.floored), 0.0));
            }
        }
    }
    workgroupBarrier();
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        textureStore(output, pixel, vec4f(stored_colour(firefly(pixel)), 0.0));
    }
}
