// Twin of reference.rs: one level, in three passes: sums of cells, what each is multiplied by, and that interpolated between them.
//
// The pass supplies `settings` (cells of `side` pixels, `reach` of the triangle to each side).

// Of a cell and its three channels: sums of the light, of the residual, and of its square.
struct Sums {
    light: vec3f,
    residual: vec3f,
    squared: vec3f,
}

// The squared relative noise of a pixel, summed over the channels.
fn relative_noise(sums: Sums) -> f32 {
    let light = sums.light + RESIDUAL_LEAST;
    let r = f32(settings.side * settings.side) * sums.squared / (light * light);
    return r.x + r.y + r.z;
}

// The triangle's weight so many cells from its middle.
fn triangle(d: i32) -> f32 {
    let side = f32(settings.reach + 1);
    return (side - f32(d)) / (side * side);
}

// The two cells between which pixel `at` lies, and the share of the second. `first`: row or column of the whole picture at 0.
fn between(first: i32, at: i32, cells: i32) -> vec3f {
    let cell = settings.side;
    let twice = 2 * (first % cell + at) + 1;
    if twice <= cell {
        return vec3f(0.0);
    }
    let before = (twice - cell) / (2 * cell);
    let rest = (twice - cell) % (2 * cell);
    return vec3f(f32(min(before, cells - 1)), f32(min(before + 1, cells - 1)), f32(rest) / f32(2 * cell));
}

fn finite(v: f32) -> bool {
    return abs(v) <= 3.4e38;
}

// The relative residual of smoothed sums.
fn residual_of(smoothed: Sums) -> vec3f {
    return smoothed.residual / (smoothed.light + RESIDUAL_LEAST);
}

// Its variance, for the windows around; `least`: the least noise of a pixel.
fn variance_of(smoothed: Sums, ratio: vec3f, least: f32) -> f32 {
    let light = smoothed.light + RESIDUAL_LEAST;
    let shown = clamp(1.0 + ratio, vec3f(RESIDUAL_LEAST_SHOWN), vec3f(1.0 / RESIDUAL_LEAST_SHOWN));
    let of_pixels = smoothed.squared / (light * light * shown);
    let noise = max(f32(settings.side * settings.side) * (of_pixels.x + of_pixels.y + of_pixels.z), least);
    return settings.squares * noise / f32(settings.side * settings.side) + RESIDUAL_LEAST_VARIANCE;
}

// What a cell is multiplied by, less 1, within its limits.
fn limited(change: vec3f) -> vec3f {
    return clamp(change, vec3f(settings.least_change), vec3f(settings.most_change));
}

// What a cell is multiplied by, less 1, by its own smoothed sums; `around`: the least noise.
fn change_of(smoothed: Sums, around: f32) -> vec3f {
    let ratio = residual_of(smoothed);
    let noise = max(relative_noise(smoothed), around);
    let size = dot(ratio, ratio);
    let doubt = settings.sure * settings.squares * noise / f32(settings.side * settings.side);
    if !finite(noise) || !(doubt < size) {
        return vec3f(0.0);
    }
    let share = noise / (noise + 3.0 * (settings.noise + RESIDUAL_LEAST));
    return limited(ratio * ((1.0 - doubt / size) * share));
}
