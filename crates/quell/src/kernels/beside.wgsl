// How the fast history lies beside the history length (change.rs).
//
// Where light's changes are looked for, a texel of the history length holds both: the upper 21 bits of the length's float, which are
// all of a rounded length, and in the lower 11 the code of the rounded fast history (change.rs). 0: there is none.

const LENGTH_BITS: u32 = 0xfffff800u;
const CODE_BITS: u32 = 0x7ffu;

fn looks_for_change(blend: Blend) -> bool {
    return blend.fast_frames > 0.0;
}

// The history length of a texel that holds both.
fn length_beside(texel: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(texel) & LENGTH_BITS);
}
