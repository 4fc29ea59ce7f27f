// Twin of clip.rs: the colour clamp of stages 3, 8, 11 and `antialiasing`, per channel in YCoCg.

// Minimum and maximum per YCoCg channel, gathered neighbour by neighbour.
struct ColourBox {
    low: vec3f,
    high: vec3f,
    sum: vec3f,
    squares: vec3f,
    count: f32,
}

fn colour_box_empty() -> ColourBox {
    return ColourBox(vec3f(FAR), vec3f(-FAR), vec3f(0.0), vec3f(0.0), 0.0);
}

fn colour_box_add(bounds: ColourBox, rgb: vec3f) -> ColourBox {
    let c = ycocg_from_rgb(rgb);
    return ColourBox(
        min(bounds.low, c),
        max(bounds.high, c),
        bounds.sum + c,
        bounds.squares + c * c,
        bounds.count + 1.0,
    );
}

fn colour_box_of(gathered: ColourBox, clip: u32, gamma: f32) -> ColourBox {
    var bounds = gathered;
    if clip == CLIP_SIGMA && bounds.count > 0.0 {
        let mean = bounds.sum / bounds.count;
        let deviation = sqrt(max(bounds.squares / bounds.count - mean * mean, vec3f(0.0)));
        bounds.low = mean - gamma * deviation;
        bounds.high = mean + gamma * deviation;
    }
    return bounds;
}

// `rgb` held to the box. A channel that only the clamp made negative becomes 0.
fn colour_box_clamp(bounds: ColourBox, rgb: vec3f) -> vec3f {
    let c = ycocg_from_rgb(rgb);
    if all(c >= bounds.low) && all(c <= bounds.high) {
        return rgb; // not even rounding may change what needs no clamp
    }
    let clamped = rgb_from_ycocg(min(max(c, bounds.low), bounds.high));
    return select(clamped, vec3f(0.0), (clamped < vec3f(0.0)) & (rgb >= vec3f(0.0)));
}

fn tells_shares(value: f32, wanted: f32) -> bool {
    return abs(value) > CLIP_LEAST_SHARE * abs(wanted);
}

// How one channel of the beauty's history follows its clamp, by the same ratio as its passes would.
fn follow_itself(history: f32, clamped: f32) -> f32 {
    if clamped == history {
        return history;
    }
    if tells_shares(history, clamped) {
        return history * (clamped / history);
    }
    return clamped;
}

// The clamped beauty, with 0 where neither history nor the current signal says how passes would share a value.
fn shareable(history: f32, clamped: f32, now: f32) -> f32 {
    let known = clamped == history || tells_shares(history, clamped) || tells_shares(now, clamped);
    return select(0.0, clamped, known);
}
