//! Constants that the shaders share with Rust: WGSL gets each from where it is declared, so none is typed twice.

use super::guides::{self, half};
use super::sequence;
use crate::border::COLOUR_LIMIT;
use crate::kernels::{change, clip, conv, edge, guide_distance, math, mirror_image, reproject, spiral, temporal};
use crate::stages::{
    blend, feature_noise, firefly, gather, glossy_bilateral, residual, stabilise, wavelet, young_filter,
};
use std::collections::HashSet;

/// A constant as WGSL declares it.
#[derive(Clone, Copy, Debug)]
enum Number {
    F32(f32),
    Vec2([f32; 2]),
    Vec3([f32; 3]),
    I32(i32),
    U32(u32),
}

use Number::{F32, I32, U32, Vec2, Vec3};

/// Name in WGSL and value. Names are those of Rust, with the stage's before it where two share one.
const ALL: &[(&str, Number)] = &[
    ("LUMINANCE", Vec3(math::LUMINANCE)),
    ("COLOUR_LIMIT", F32(COLOUR_LIMIT)),
    ("BACKGROUND", F32(guides::BACKGROUND)),
    ("FAR", F32(guides::FAR)),
    ("UNKNOWN_MOTION", F32(guides::UNKNOWN_MOTION)),
    // Planes in half precision.
    ("EXACT_SAME_NORMAL", F32(mirror_image::SAME_NORMAL)),
    ("NORMAL_STEPS", F32(half::NORMAL_STEPS)),
    ("NORMAL_CENTRE", I32(half::NORMAL_CENTRE)),
    ("NORMAL_LOW_BITS", U32(half::NORMAL_LOW_BITS)),
    ("ROUGHNESS_STEPS", F32(half::ROUGHNESS_STEPS)),
    ("MOTION_LEAST", F32(half::MOTION_LEAST)),
    ("MOTION_MOST", F32(half::MOTION_MOST)),
    ("CONFIDENCE_STEPS", F32(half::CONFIDENCE_STEPS)),
    ("HALF_MAX", F32(half::HALF_MAX)),
    // The real-time filter.
    ("CLIP_LEAST_SHARE", F32(clip::LEAST_SHARE)),
    ("CHANGE_CELL", I32(change::CELL as i32)),
    ("CHANGE_OWN", F32(change::OWN)),
    ("CHANGE_DARKEST", U32(change::DARKEST)),
    ("CHANGE_LEAST_TAPS", F32(change::LEAST_TAPS)),
    ("CHANGE_LEAST_VARIANCE", F32(change::LEAST_VARIANCE)),
    ("CHANGE_MOST_LIGHT", F32(change::MOST_LIGHT)),
    ("COINCIDENT_PX", F32(edge::COINCIDENT_PX)),
    ("GLOSS_SCALE", F32(edge::GLOSS_SCALE)),
    ("CONTACT_NEAR", I32(edge::CONTACT_STEPS[0])),
    ("CONTACT_FAR", I32(edge::CONTACT_STEPS[1])),
    ("SAME_PLANE_PX", F32(mirror_image::SAME_PLANE_PX)),
    ("JITTERED_TURN", F32(mirror_image::JITTERED_TURN)),
    ("LEAST_BENT_DETERMINANT", F32(mirror_image::LEAST_BENT_DETERMINANT)),
    ("LEAST_FOOTPRINT", F32(reproject::LEAST_FOOTPRINT)),
    ("PERIOD", I32(spiral::PERIOD as i32)),
    ("LONGEST_HISTORY", F32(temporal::LONGEST_HISTORY)),
    ("FIREFLY_MIDDLE", U32(firefly::MIDDLE as u32)),
    ("LOBE_SPREAD", F32(glossy_bilateral::LOBE_SPREAD)),
    ("YOUNG_SAME_LIGHT", F32(young_filter::SAME_LIGHT)),
    ("YOUNG_LEAST_VARIANCE", F32(young_filter::LEAST_VARIANCE)),
    ("YOUNG_LEAST_NEIGHBOURS", F32(young_filter::LEAST_NEIGHBOURS)),
    ("YOUNG_OF_A_FRAME", F32(young_filter::OF_A_FRAME)),
    ("YOUNG_NOISE_ALIKE", F32(young_filter::NOISE_ALIKE)),
    // The sequence filter.
    ("FARTHEST", F32(guide_distance::FARTHEST)),
    ("APART", F32(guide_distance::APART)),
    ("LEAST_TOLERANCE", F32(guide_distance::LEAST_TOLERANCE)),
    ("DIVIDED", F32(feature_noise::DIVIDED)),
    ("LEAST_COUNT", F32(gather::LEAST_COUNT)),
    ("FREE_COUNT", F32(gather::FREE_COUNT)),
    ("LEAST_NOISE", F32(gather::LEAST_NOISE)),
    ("TENT", Vec2(wavelet::TENT)),
    ("LEAST_VARIANCE", F32(wavelet::LEAST_VARIANCE)),
    ("HAS_TO_PREVIOUS", U32(sequence::HAS_TO_PREVIOUS)),
    ("HAS_TO_NEXT", U32(sequence::HAS_TO_NEXT)),
    ("HAS_REFLECTION_TO_PREVIOUS", U32(sequence::HAS_REFLECTION_TO_PREVIOUS)),
    ("HAS_REFLECTION_TO_NEXT", U32(sequence::HAS_REFLECTION_TO_NEXT)),
    ("HAS_SEEN", U32(sequence::HAS_SEEN)),
    ("HAS_REPEATED_NOISE", U32(sequence::HAS_REPEATED_NOISE)),
    ("PLANE_THERE", U32(sequence::PLANE_THERE)),
    ("PLANE_UNKNOWN", U32(sequence::PLANE_UNKNOWN)),
    ("SEEN_COLOURS", U32(sequence::SEEN_COLOURS)),
    ("SEEN_NORMALS", U32(sequence::SEEN_NORMALS)),
    ("HAS_SEEN_COLOUR", U32(sequence::HAS_SEEN_COLOUR)),
    ("HAS_SEEN_NORMAL", U32(sequence::HAS_SEEN_NORMAL)),
    ("HAS_SURFACE_COLOUR", U32(sequence::HAS_SURFACE_COLOUR)),
    ("FOLLOWED_FRAMES", I32(blend::FRAMES as i32)),
    ("DIFFERENCES_NEAR", I32(blend::NEAR as i32)),
    ("DIFFERENCES_WIDE", I32(blend::WIDE as i32)),
    ("NOISE_NEAR", I32(blend::NOISE_NEAR as i32)),
    ("NOISE_WIDE", I32(blend::NOISE_WIDE as i32)),
    ("BLEND_LEAST", F32(blend::LEAST)),
    ("LEAST_BRIGHTNESS", F32(blend::LEAST_BRIGHTNESS)),
    ("LEAST_SEEN", F32(blend::LEAST_SEEN)),
    ("MOST_CHANGE", F32(blend::MOST_CHANGE)),
    ("MOST_RATIO", F32(blend::MOST_RATIO)),
    ("DEPTH_STEP", F32(blend::DEPTH_STEP)),
    ("LEAST_COSINE", F32(blend::LEAST_COSINE)),
    ("HIGH_PASS", F32(blend::HIGH_PASS)),
    ("SECOND_DIFFERENCE", F32(blend::SECOND_DIFFERENCE)),
    ("MOST_NUMBER", F32(blend::MOST_NUMBER)),
    ("KERNEL_MOST", F32(blend::kernel::MOST)),
    ("KERNEL_LEAST", F32(blend::kernel::LEAST)),
    ("LOG2_E", F32(std::f32::consts::LOG2_E)),
    ("CONV_LEAK", F32(conv::LEAK)),
    ("MOST_INPUT", F32(conv::MOST_INPUT)),
    ("LAST_LAYER", U32(sequence::LAST_LAYER)),
    ("SHARE_NET", U32(sequence::SHARE_NET)),
    ("MOST_VISITS", U32(sequence::MOST_VISITS)),
    ("SIGNATURE_WIDE", I32(stabilise::WIDE as i32)),
    ("TAP_RADIUS", I32(stabilise::TAP_RADIUS as i32)),
    ("DARK", F32(stabilise::DARK)),
    ("LEAST_OWN", F32(stabilise::LEAST_OWN)),
    ("LEAST_DEVIATION", F32(stabilise::LEAST_DEVIATION)),
    ("LEAST_NOISE_OF_ALBEDO", F32(stabilise::LEAST_NOISE_OF_ALBEDO)),
    ("MOST_BANDWIDTH", F32(stabilise::MOST)),
    ("RESIDUAL_LEAST", F32(residual::LEAST)),
    ("RESIDUAL_LEAST_VARIANCE", F32(residual::LEAST_VARIANCE)),
    ("RESIDUAL_MOST_SURE", F32(residual::MOST_SURE)),
    ("RESIDUAL_LEAST_SHOWN", F32(residual::LEAST_SHOWN)),
    ("RESIDUAL_COARSEST", I32(residual::LEVELS[0].0 as i32)),
    ("SHOWS_LIGHT", U32(sequence::SHOWS_LIGHT)),
    ("SHOWS_DEVIATION", U32(sequence::SHOWS_DEVIATION)),
    ("SHOWS_COUNT", U32(sequence::SHOWS_COUNT)),
    ("SHOWS_SAMPLES", U32(sequence::SHOWS_SAMPLES)),
    ("SHOWS_DEPTH", U32(sequence::SHOWS_DEPTH)),
    ("SHOWS_NOISE", U32(sequence::SHOWS_NOISE)),
    ("SHOWS_COLOUR", U32(sequence::SHOWS_COLOUR)),
];

/// Declarations of the constants that the WGSL names.
pub(super) fn declared(wgsl: &str) -> String {
    let used: HashSet<&str> = wgsl.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').collect();
    ALL.iter().filter(|(name, _)| used.contains(name)).map(|(name, number)| number.declared(name)).collect()
}

impl Number {
    /// Rust writes the shortest number that reads back as the same float; WGSL rounds it to the nearest.
    fn declared(self, name: &str) -> String {
        match self {
            F32(v) => format!("const {name}: f32 = {v:?};\n"),
            Vec2([x, y]) => format!("const {name}: vec2f = vec2f({x:?}, {y:?});\n"),
            Vec3([x, y, z]) => format!("const {name}: vec3f = vec3f({x:?}, {y:?}, {z:?});\n"),
            I32(v) => format!("const {name}: i32 = {v};\n"),
            U32(v) => format!("const {name}: u32 = {v}u;\n"),
        }
    }
}
