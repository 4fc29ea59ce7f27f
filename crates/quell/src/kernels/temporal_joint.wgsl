// Twin of temporal.rs (`blend`): a plane that is tied to a signal takes the signal's lookup, share of history and clamp.

// How one channel of a pass's history follows the clamp of its signal's: `follow` of clip.rs.
fn follow(pass_history: f32, history: f32, clamped: f32, pass_now: f32, now: f32) -> f32 {
    if clamped == history {
        return pass_history;
    }
    if tells_shares(history, clamped) {
        return pass_history * (clamped / history);
    }
    if tells_shares(now, clamped) {
        return clamped * (pass_now / now);
    }
    return 0.0;
}

// `accumulate` for a plane tied to the signal of `current` and `history`.
fn accumulate_joint(
    blend: Blend,
    pixel: vec2i,
    lookup: Lookup,
    changed: f32,
    current: texture_2d<f32>,
    history: texture_2d<f32>,
    history_length: texture_2d<f32>,
    pass_current: texture_2d<f32>,
    pass_history: texture_2d<f32>,
) -> Accumulated {
    let own = input_colour(textureLoad(pass_current, pixel, 0));
    let depth = depth_at(pixel);
    let trust = lookup.trust * moving_at(pixel, depth).confidence_in;
    let weighed = weigh(blend, trust, frames_left(blend, lookup, changed, history, history_length));
    let confidence = select(1.0, weighed.confidence, depth != BACKGROUND);
    if weighed.history <= 0.0 {
        return Accumulated(own, confidence, weighed.length, weighed.length);
    }
    let own_history = fetch_colour(lookup, pass_history);
    var held = own_history;
    if blend.clip != CLIP_OFF {
        let now = input_colour(textureLoad(current, pixel, 0));
        let fetched = fetch_colour(lookup, history);
        let within = hold_to_range(lookup, history, fetched);
        let clamped = colour_box_clamp(colour_box_at(blend, pixel, current), within);
        held = vec3f(
            follow(own_history.x, fetched.x, shareable(fetched.x, clamped.x, now.x), own.x, now.x),
            follow(own_history.y, fetched.y, shareable(fetched.y, clamped.y, now.y), own.y, now.y),
            follow(own_history.z, fetched.z, shareable(fetched.z, clamped.z, now.z), own.z, now.z),
        );
    }
    return Accumulated(weighed.history * held + (1.0 - weighed.history) * own, confidence, weighed.length, weighed.length);
}
