fn change_at(column: f32, row: f32) -> vec3f {
    return changes[i32(row) * settings.cells.x + i32(column)].xyz;
}

// A colour of a pixel, corrected, whose first plane is `light`: what came out as it went in stays.
fn corrected(pixel: vec2i, light: vec3f, colour: vec3f) -> vec3f {
    if all(light == own_at(pixel)) {
        return colour;
    }
    let x = between(0, pixel.x, settings.cells.x);
    let y = between(settings.first_row, pixel.y, settings.cells.y);
    let above = mix(change_at(x.x, y.x), change_at(x.y, y.x), x.z);
    let below = mix(change_at(x.x, y.y), change_at(x.y, y.y), x.z);
    return colour * (1.0 + mix(above, below, y.z));
}
