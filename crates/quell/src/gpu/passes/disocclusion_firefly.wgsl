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
    @builtin(local_invocation_id) local: vec3u,
) {
    gather_distrust(group.xy, vec2i(local.xy));
    // 100 pixels for 64 invocations.
    let number = i32(local.y) * TILE + i32(local.x);
    for (var i = number; i < INNER * INNER; i += TILE * TILE) {
        let inside = vec2i(i % INNER, i / INNER);
        let pixel = inner_first + inside;
        if contains(pixel) {
            let accumulated = textureLoad(temporal, pixel, 0);
            let result = blended_at(pixel, accumulated.xyz);
            blended_tile[i] = vec4f(stored_colour(result.shown), accumulated.w);
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
