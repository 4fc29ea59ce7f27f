// The levels of the filter of young history, one pixel an invocation. The fourth value is the signal's confidence: later
// stages read it.
fn young_input(pixel: vec2i) -> vec3f {
    return first_colour(textureLoad(input, pixel, 0));
}

fn young_length(pixel: vec2i) -> f32 {
    return textureLoad(history_length, pixel, 0).x;
}

fn store(pixel: vec2i, colour: vec3f) {
    textureStore(output, pixel, vec4f(stored_colour(colour), textureLoad(input, pixel, 0).w));
}

fn matte_level(pixel: vec2i, step: i32, end: f32) {
    if contains(pixel) {
        store(pixel, young_filter(pixel, settings.matte_edge, step, young_share(pixel, end, 1.0)));
    }
}

fn glossy_level(pixel: vec2i, step: i32, end: f32) {
    if contains(pixel) {
        let gain = settings.young.lobe * LOBE_SPREAD * frame.view.focal_px;
        let share = young_share(pixel, end, young_lobe(pixel, gain, step));
        store(pixel, young_filter(pixel, settings.glossy_edge, step, share));
    }
}

@compute @workgroup_size(8, 8)
fn matte_young_1(@builtin(global_invocation_id) id: vec3u) {
    matte_level(vec2i(id.xy), 1, settings.young.end_1);
}

@compute @workgroup_size(8, 8)
fn matte_young_3(@builtin(global_invocation_id) id: vec3u) {
    matte_level(vec2i(id.xy), 3, settings.young.end_3);
}

@compute @workgroup_size(8, 8)
fn matte_young_9(@builtin(global_invocation_id) id: vec3u) {
    matte_level(vec2i(id.xy), 9, settings.young.end_9);
}

@compute @workgroup_size(8, 8)
fn glossy_young_1(@builtin(global_invocation_id) id: vec3u) {
    glossy_level(vec2i(id.xy), 1, settings.young.end_1);
}

@compute @workgroup_size(8, 8)
fn glossy_young_3(@builtin(global_invocation_id) id: vec3u) {
    glossy_level(vec2i(id.xy), 3, settings.young.end_3);
}

@compute @workgroup_size(8, 8)
fn glossy_young_9(@builtin(global_invocation_id) id: vec3u) {
    glossy_level(vec2i(id.xy), 9, settings.young.end_9);
}
