// Twin of environment.rs: light from infinitely far away. A texel of the map is a row of `lights`: radiance, and the
// probability with which the texel is drawn. Cumulated probabilities follow, four to a row.

fn has_environment() -> bool {
    return HAS_ENVIRONMENT && frame.environment_emitter != NONE;
}

fn has_map() -> bool {
    return HAS_MAP && frame.map_extent.x != 0u;
}

fn environment_radiance(w: vec3f) -> vec3f {
    var radiance = frame.environment_color;
    if has_map() {
        radiance = map_lookup(w).xyz;
    }
    if in_sun(w) {
        radiance += frame.sun_radiance;
    }
    return radiance;
}

fn in_sun(w: vec3f) -> bool {
    return frame.sun_probability > 0.0 && 0.5 * length_squared(w - frame.sun_direction) <= frame.sun_one_minus_cos;
}

fn environment_sample(normal: vec3f, numbers: vec2f) -> vec3f {
    var u = numbers;
    if u.x < frame.sun_probability {
        u.x /= frame.sun_probability;
        // Slightly inside, so that rounding never puts a sample outside of the disc.
        return about(frame.sun_direction, uniform_cone(u, frame.sun_one_minus_cos * 0.99999));
    }
    u.x = min((u.x - frame.sun_probability) / (1.0 - frame.sun_probability), ONE_MINUS_EPSILON);
    if has_map() {
        return map_sample(u);
    }
    if is_any_side(normal) {
        return uniform_cone(u, 2.0);
    }
    return about(normal, cosine_hemisphere(u));
}

fn environment_pdf(normal: vec3f, wi: vec3f) -> f32 {
    var background = 0.25 / PI;
    if has_map() {
        background = map_pdf(wi);
    } else if !is_any_side(normal) {
        background = cosine_hemisphere_pdf(dot(normal, wi));
    }
    let sun = select(0.0, 1.0 / (TAU * frame.sun_one_minus_cos), in_sun(wi));
    return select(background, frame.sun_probability * sun + (1.0 - frame.sun_probability) * background, frame.sun_probability > 0.0);
}

// Radiance and probability between the four texels about a direction. Columns wrap, rows are clamped.
fn map_lookup(w: vec3f) -> vec4f {
    let angle = atan2_precise(w.x, -w.z) + frame.map_rotation;
    let turn = 0.5 + angle * (0.5 / PI);
    let u = min(turn - floor(turn), ONE_MINUS_EPSILON);
    let v = clamp(atan2_precise(length(w.xz), w.y) / PI, 0.0, ONE_MINUS_EPSILON);
    let extent = vec2i(frame.map_extent);
    let at = vec2f(u, v) * vec2f(extent) - 0.5;
    let first = floor(at);
    let f = at - first;
    let x0 = wrapped(i32(first.x), extent.x, WRAP_REPEAT);
    let x1 = wrapped(i32(first.x) + 1, extent.x, WRAP_REPEAT);
    let y0 = clamp(i32(first.y), 0, extent.y - 1);
    let y1 = clamp(i32(first.y) + 1, 0, extent.y - 1);
    return map_texel(x0, y0) * (1.0 - f.x) * (1.0 - f.y) + map_texel(x1, y0) * f.x * (1.0 - f.y)
        + map_texel(x0, y1) * (1.0 - f.x) * f.y + map_texel(x1, y1) * f.x * f.y;
}

fn map_texel(x: i32, y: i32) -> vec4f {
    return lights[frame.environment + u32(y) * frame.map_extent.x + u32(x)];
}

fn map_pdf(w: vec3f) -> f32 {
    let sine = max(length(w.xz), MIN_POLAR_SIN);
    let extent = vec2f(frame.map_extent);
    return map_lookup(w).w * (extent.x * extent.y) / (2.0 * PI * PI * sine);
}

fn map_sample(u: vec2f) -> vec3f {
    let row = invert_cdf(frame.row_cdf, 0u, frame.map_extent.y, u.x);
    let stride = frame.map_extent.x + 1u;
    let column = invert_cdf(frame.column_cdf, u32(row.x) * stride, frame.map_extent.x, u.y);
    let x = (column.x + 0.5 + tent(column.y)) / f32(frame.map_extent.x);
    var y = abs((row.x + 0.5 + tent(row.y)) / f32(frame.map_extent.y));
    y = select(y, 2.0 - y, y > 1.0);
    let azimuth = (x - 0.5) * TAU - frame.map_rotation;
    let sine = sin(PI * y);
    return normalize(vec3f(sine * sin(azimuth), cos(PI * y), -sine * cos(azimuth)));
}

// A number in (-1, 1) with density 1 - |x|.
fn tent(u: f32) -> f32 {
    return select(1.0 - sqrt(2.0 * (1.0 - u)), sqrt(2.0 * u) - 1.0, u < 0.5);
}

fn cdf_at(rows: u32, index: u32) -> f32 {
    return lights[rows + index / 4u][index & 3u];
}

// The interval of `count` that `u` falls in, and where within it. Never one of probability 0.
fn invert_cdf(rows: u32, begin: u32, count: u32, u: f32) -> vec2f {
    // The number of values that are at most `u`.
    var low = 0u;
    var high = count + 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if cdf_at(rows, begin + middle) <= u {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    let i = clamp(low, 1u, count) - 1u;
    let start = cdf_at(rows, begin + i);
    let width = cdf_at(rows, begin + i + 1u) - start;
    let within = select(0.0, (u - start) / width, width > 0.0);
    return vec2f(f32(i), clamp(within, 0.0, ONE_MINUS_EPSILON));
}
