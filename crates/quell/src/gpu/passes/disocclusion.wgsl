// Stage 5 in three dispatches: maximum, mean along rows, mean along columns with the blend.
//
// `state` holds confidence and history length.
@group(0) @binding(2) var<storage, read> state: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> widest: array<f32>;
@group(0) @binding(4) var<storage, read_write> rows: array<f32>;
@group(0) @binding(5) var<storage, read> temporal: array<vec4f>;
@group(0) @binding(6) var<storage, read> prefiltered: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> blended: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> floored: array<vec4f>;

fn confidence_at(pixel: vec2i) -> f32 {
    return state[index_of(pixel)].x;
}

fn widest_at(pixel: vec2i) -> f32 {
    return widest[index_of(pixel)];
}

fn rows_at(pixel: vec2i) -> f32 {
    return rows[index_of(pixel)];
}

@compute @workgroup_size(8, 8)
fn widen(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        widest[index_of(pixel)] = disocclusion_widest(pixel);
    }
}

@compute @workgroup_size(8, 8)
fn blur_rows(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        rows[index_of(pixel)] = disocclusion_rows(pixel);
    }
}

@compute @workgroup_size(8, 8)
fn blend(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    let i = index_of(pixel);
    let k = disocclusion_distrust(pixel);
    let least = settings.disocclusion.floor;
    let fed_back = max(least, settings.disocclusion.feedback_floor);
    blended[i] = vec4f(disocclusion(temporal[i].xyz, prefiltered[i].xyz, k, least), 0.0);
    floored[i] = vec4f(disocclusion(temporal[i].xyz, prefiltered[i].xyz, k, fed_back), 0.0);
}
