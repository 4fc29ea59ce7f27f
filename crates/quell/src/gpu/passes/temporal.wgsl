// Bindings of stages 3 and 8. States hold confidence and history length.
@group(0) @binding(2) var<storage, read> guides: array<Guide>;
@group(0) @binding(3) var<storage, read> guides_before: array<Guide>;
@group(0) @binding(4) var<storage, read> current: array<vec4f>;
@group(0) @binding(5) var<storage, read> history: array<vec4f>;
@group(0) @binding(6) var<storage, read> history_state: array<vec2f>;
@group(0) @binding(7) var<storage, read_write> output: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> state: array<vec2f>;

fn current_at(i: u32) -> vec3f {
    return current[i].xyz;
}

fn history_at(i: u32) -> vec3f {
    return history[i].xyz;
}

fn history_length_at(i: u32) -> f32 {
    return history_state[i].y;
}

fn store(pixel: vec2i, accumulated: Accumulated) {
    let i = index_of(pixel);
    output[i] = vec4f(accumulated.colour, 0.0);
    state[i] = vec2f(accumulated.confidence, accumulated.length);
}
