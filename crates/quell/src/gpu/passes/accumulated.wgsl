// What stages 3 and 8 store: colour and confidence, the latter negative for background, so that whoever reads the image
// knows surfaces without the guides.
fn texel_of(accumulated: Accumulated, on_surface: bool) -> vec4f {
    let confidence = select(-accumulated.confidence, accumulated.confidence, on_surface);
    return vec4f(stored_colour(accumulated.colour), stored_colour(vec3f(confidence)).x);
}
