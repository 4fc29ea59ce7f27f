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
    var held = fetch(lookup, pass_history);
    if blend.clip != CLIP_OFF {
        let now = input_colour(textureLoad(current, pixel, 0));
        let fetched = fetch(lookup, history);
        let clamped = colour_box_clamp(colour_box_at(blend, pixel, current), fetched);
        for (var c = 0; c < 3; c++) {
            held[c] = follow(held[c], fetched[c], shareable(fetched[c], clamped[c], now[c]), own[c], now[c]);
        }
    }
    return Accumulated(weighed.history * held + (1.0 - weighed.history) * own, confidence, weighed.length, weighed.length);
}
