// Twin of temporal.rs: what stages 3 and 8 share once they know where history lies: fetch, clamp, blend.
//
// The pass supplies `current_at`, `history_at` and `history_length_at`.

// Frames after which history is counted no further.
const LONGEST_HISTORY: f32 = 4096.0;

// What stage 3 or 8 writes at one pixel.
struct Accumulated {
    colour: vec3f,
    // 0..1.
    confidence: f32,
    // Frames, at least 1.
    length: f32,
}

// How one pixel blends.
struct Weighed {
    // Share of history, 0..1.
    history: f32,
    confidence: f32,
    // New history length, frames.
    length: f32,
}

// Step 7: how much history counts, the confidence, and the new history length, from trust rho and the old length N.
fn weigh(blend: Blend, trust: f32, frames: f32) -> Weighed {
    if trust <= 0.0 || frames <= 0.0 {
        return Weighed(0.0, 0.0, 1.0);
    }
    var alpha = blend.alpha;
    if blend.ramp != 0u {
        alpha = min(blend.alpha, frames / (frames + 1.0));
    }
    return Weighed(
        trust * alpha,
        trust * min(frames / blend.confidence_frames, 1.0),
        min(trust * frames + 1.0, LONGEST_HISTORY),
    );
}

// The clamp's box at a pixel: of the surfaces within the radius, in the unfiltered current signal.
fn colour_box_at(blend: Blend, pixel: vec2i) -> ColourBox {
    let first = max(pixel - blend.clip_radius, vec2i(0));
    let last = min(pixel + blend.clip_radius, vec2i(frame.size) - 1);
    var gathered = colour_box_empty();
    for (var ty = first.y; ty <= last.y; ty++) {
        for (var tx = first.x; tx <= last.x; tx++) {
            let q = vec2i(tx, ty);
            if is_surface(q) {
                gathered = colour_box_add(gathered, current_at(index_of(q)));
            }
        }
    }
    return colour_box_of(gathered, blend.clip, blend.clip_gamma);
}

// Weighted mean of up to four previous pixels.
fn fetch(found: Lookup) -> vec3f {
    var lookup = found;
    var sum = vec3f(0.0);
    for (var k = 0; k < 4; k++) {
        if lookup.weight[k] > 0.0 {
            sum += lookup.weight[k] * history_at(lookup.index[k]);
        }
    }
    return sum;
}

// Weighted mean of the history length.
fn fetch_length(found: Lookup) -> f32 {
    var lookup = found;
    var sum = 0.0;
    for (var k = 0; k < 4; k++) {
        if lookup.weight[k] > 0.0 {
            sum += lookup.weight[k] * history_length_at(lookup.index[k]);
        }
    }
    return sum;
}

// Fetch, clamp and blend at the place that was looked up: `accumulate` of stage 3's reference.rs.
fn accumulate(blend: Blend, pixel: vec2i, lookup: Lookup) -> Accumulated {
    let now = current_at(index_of(pixel));
    let trust = lookup.trust * guides[index_of(pixel)].confidence_in;
    let weighed = weigh(blend, trust, fetch_length(lookup));
    let confidence = select(1.0, weighed.confidence, is_surface(pixel));
    if weighed.history <= 0.0 {
        return Accumulated(now, confidence, weighed.length);
    }
    let history = fetch(lookup);
    var held = history;
    if blend.clip != CLIP_OFF {
        let clamped = colour_box_clamp(colour_box_at(blend, pixel), history);
        for (var c = 0; c < 3; c++) {
            held[c] = follow_itself(history[c], shareable(history[c], clamped[c], now[c]));
        }
    }
    return Accumulated(weighed.history * held + (1.0 - weighed.history) * now, confidence, weighed.length);
}
