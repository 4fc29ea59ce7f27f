// What statistics are made of, of the frame at work.
fn input_at(q: vec2i) -> vec3f {
    return input_of(frame_at(settings.centre), q);
}

fn picture_at(q: vec2i) -> vec3f {
    return picture_of(frame_at(settings.centre), q).xyz;
}

fn brightness_at(q: vec2i) -> f32 {
    return brightness[index_of(q)];
}

fn followed_at(q: vec2i) -> vec4f {
    return differences[index_of(q)];
}

fn known_at(q: vec2i) -> vec4f {
    return known[index_of(q)];
}
