// Filtered pictures of the frames of a window: a layer of the array is a frame.
fn frame_at(place: i32) -> WindowFrame {
    return frames[place];
}

// The colour and the coverage.
fn picture_of(there: WindowFrame, pixel: vec2i) -> vec4f {
    return textureLoad(pictures, pixel, there.picture, 0);
}

fn sum_of(colour: vec3f) -> f32 {
    return colour.x + colour.y + colour.z;
}
