// Twin of reference.rs: stage 6.
//
// The pass supplies `firefly_input` and `firefly_is_surface`.

// Which of nine values is the median; of equal values the first in reading order.
fn firefly_median(values: array<f32, 9>) -> u32 {
    var ranked = values;
    for (var i = 0u; i < 9u; i++) {
        var rank = 0u;
        for (var j = 0u; j < 9u; j++) {
            if ranked[j] < ranked[i] || (ranked[j] == ranked[i] && j < i) {
                rank++;
            }
        }
        if rank == FIREFLY_MIDDLE {
            return i;
        }
    }
    return FIREFLY_MIDDLE;
}

// The pixel whose value is taken; `own`: this one.
fn firefly_pick(neighbours: array<vec2i, 9>, values: array<f32, 9>, own: vec2i, own_value: f32) -> vec2i {
    var pixels = neighbours;
    var candidates = values;
    let k = firefly_median(values);
    let is_firefly = own_value > settings.firefly.threshold * candidates[k];
    return select(own, pixels[k], settings.firefly.plain != 0u || is_firefly);
}

// The pixel that stage 6 takes for each channel.
fn firefly_choice(pixel: vec2i) -> array<vec2i, 3> {
    let centre = firefly_input(pixel);
    if !firefly_is_surface(pixel) {
        return array(pixel, pixel, pixel);
    }
    var neighbours: array<vec2i, 9>;
    var colours: array<vec3f, 9>;
    for (var k = 0; k < 9; k++) {
        let q = pixel + vec2i(k % 3, k / 3) - 1;
        var chosen = pixel;
        if contains(q) {
            chosen = select(pixel, q, firefly_is_surface(q));
        }
        neighbours[k] = chosen;
        colours[k] = firefly_input(chosen);
    }
    var values: array<f32, 9>;
    if settings.firefly.luminance != 0u {
        for (var k = 0; k < 9; k++) {
            values[k] = luminance(colours[k]);
        }
        let picked = firefly_pick(neighbours, values, pixel, luminance(centre));
        return array(picked, picked, picked);
    }
    var picked: array<vec2i, 3>;
    for (var c = 0; c < 3; c++) {
        for (var k = 0; k < 9; k++) {
            values[k] = colours[k][c];
        }
        picked[c] = firefly_pick(neighbours, values, pixel, centre[c]);
    }
    return picked;
}

// Stage 6 at one pixel.
fn firefly(pixel: vec2i) -> vec3f {
    var chosen = firefly_choice(pixel);
    var colour: vec3f;
    for (var c = 0; c < 3; c++) {
        colour[c] = firefly_input(chosen[c])[c];
    }
    return colour;
}
