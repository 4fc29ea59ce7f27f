// How debug views of either filter show numbers. The pass supplies the uniform `debug` with the member `scale`.

const BLACK: vec3f = vec3f(0.0);
const NOWHERE: vec3f = vec3f(0.05, 0.05, 0.12);

fn encoded(light: vec3f) -> vec3f {
    let c = clamp(light, vec3f(0.0), vec3f(1.0));
    return select(1.055 * pow(c, vec3f(1.0 / 2.4)) - 0.055, 12.92 * c, c <= vec3f(0.0031308));
}

// Light of any brightness within a display's range.
fn shown_light(light: vec3f) -> vec3f {
    let held = max(light * debug.scale, vec3f(0.0));
    return encoded(held / (1.0 + held));
}

// Black, red, yellow, white.
fn heat(v: f32) -> vec3f {
    return clamp(vec3f(3.0 * v, 3.0 * v - 1.0, 3.0 * v - 2.0), vec3f(0.0), vec3f(1.0));
}
