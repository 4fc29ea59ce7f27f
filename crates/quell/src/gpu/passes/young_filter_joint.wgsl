// The levels of the filter of young history for a plane that is tied to a signal: the weights are the signal's.
fn young_light(pixel: vec2i) -> vec4f {
    let texel = textureLoad(input, pixel, 0);
    return vec4f(first_colour(texel), texel.w);
}

fn young_colour(pixel: vec2i, light: vec4f) -> vec3f {
    return first_colour(textureLoad(pass_input, pixel, 0));
}

// Whether the fast history lies beside the history length.
var<private> is_beside: bool;

fn young_length(pixel: vec2i) -> f32 {
    let texel = textureLoad(history_length, pixel, 0).x;
    return select(texel, length_beside(texel), is_beside);
}

fn matte_level(pixel: vec2i, step: i32, end: f32) {
    is_beside = looks_for_change(settings.matte_blend);
    if contains(pixel) {
        let share = young_share(pixel, end, 1.0);
        let filtered = young_filter(pixel, settings.matte_edge, step, share, settings.young.matte_contrast);
        textureStore(output, pixel, vec4f(stored_colour(filtered.colour), textureLoad(pass_input, pixel, 0).w));
    }
}

fn glossy_level(pixel: vec2i, step: i32, end: f32) {
    is_beside = looks_for_change(settings.glossy_blend);
    if contains(pixel) {
        let gain = settings.young.lobe * LOBE_SPREAD * frame.view.focal_px;
        let share = young_share(pixel, end, young_lobe(pixel, gain, step));
        let filtered = young_filter(pixel, settings.glossy_edge, step, share, settings.young.glossy_contrast);
        textureStore(output, pixel, vec4f(stored_colour(filtered.colour), textureLoad(pass_input, pixel, 0).w));
    }
}

@compute @workgroup_size(8, 8)
fn matte_young_1_joint(@builtin(global_invocation_id) id: vec3u) {
    matte_level(vec2i(id.xy), 1, settings.young.end_1);
}

@compute @workgroup_size(8, 8)
fn matte_young_3_joint(@builtin(global_invocation_id) id: vec3u) {
    matte_level(vec2i(id.xy), 3, settings.young.end_3);
}

@compute @workgroup_size(8, 8)
fn matte_young_9_joint(@builtin(global_invocation_id) id: vec3u) {
    matte_level(vec2i(id.xy), 9, settings.young.end_9);
}

@compute @workgroup_size(8, 8)
fn matte_young_27_joint(@builtin(global_invocation_id) id: vec3u) {
    matte_level(vec2i(id.xy), 27, settings.young.end_27);
}

@compute @workgroup_size(8, 8)
fn glossy_young_1_joint(@builtin(global_invocation_id) id: vec3u) {
    glossy_level(vec2i(id.xy), 1, settings.young.glossy_end_1);
}

@compute @workgroup_size(8, 8)
fn glossy_young_3_joint(@builtin(global_invocation_id) id: vec3u) {
    glossy_level(vec2i(id.xy), 3, settings.young.glossy_end_3);
}

@compute @workgroup_size(8, 8)
fn glossy_young_9_joint(@builtin(global_invocation_id) id: vec3u) {
    glossy_level(vec2i(id.xy), 9, settings.young.glossy_end_9);
}
