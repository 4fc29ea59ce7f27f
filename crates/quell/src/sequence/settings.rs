//! Every parameter of the sequence filter, declared once; the preset `sequence`.

use crate::parameter::parameters;

parameters! {
    /// The value of every parameter of the sequence filter. The default is the preset `sequence`.
    SequenceSettings
    /// Every parameter, in the order of the stages.
    SEQUENCE_PARAMETERS
    /// Samples gathered along each surface's way through the frames around.
    gather: Gather {
        frames: u32 = 8, 0..=64, "frames", "Frames before, and after, from which samples are taken.",
            higher "Less noise, more memory and time.", lower "Quicker changes of light, more noise.", source "ours: docs/sequence.md";
        future: bool = true, (), "", "Frames after the present one are used too.",
            higher "`--history both`: no noisy first frame, less lag.", lower "`--history past`.", source "ours";
        matte_decay: f32 = 0.97, 0.0..=1.0, "per frame", "Weight of a matte sample one frame further away.",
            higher "Less noise, more lag.", lower "Follows moving shadows.", source "ours";
        glossy_direct_decay: f32 = 0.8, 0.0..=1.0, "per frame", "Likewise of highlights.",
            higher "Less noise, more smear.", lower "Noisier highlights.", source "ours";
        glossy_decay: f32 = 0.7, 0.0..=1.0, "per frame", "Likewise of reflections, which do not move with the surface.",
            higher "Less noise, more smear.", lower "Noisier reflections.", source "ours";
        transmission_decay: f32 = 0.6, 0.0..=1.0, "per frame", "Likewise of light through glass.",
            higher "Less noise, more smear.", lower "Noisier glass.", source "ours";
        seen_albedo: f32 = 0.06, 0.01..=16.0, "of the tone-mapped range", "Tolerance of the albedo seen in mirrors and through glass.",
            higher "Reflections smear.", lower "Noisier ones.", source "ours";
        seen_normal: f32 = 8.0, 0.0..=1000.0, "per 1 - cosine", "Fall of a sample's weight with the normal seen there.",
            higher "Noisier reflections.", lower "They smear.", source "ours";
        plane_distance: f32 = 2.0, 0.0..=64.0, "pixel sizes at that depth", "Distance from the tangent plane at which a point of another frame is another surface.",
            higher "Samples cross small steps.", lower "Curved surfaces lose samples.", source "ours";
        travel: f32 = 0.25, 0.0..=1.0, "of the picture's height", "How far up or down a way may lead from its pixel.",
            higher "Fast vertical motion keeps more frames; bands of a picture need wider margins.", lower "It loses samples.", source "ours: docs/sequence.md";
        round_trip: f32 = 0.15, 0.0..=16.0, "pixels", "How far there and back again may miss for a surface that moves.",
            higher "Ghosts behind moving things.", lower "Rotating things lose samples.", source "ours";
    }
    /// The variance that steers the wavelet.
    variance: Variance {
        radius: u32 = 2, 0..=8, "pixels", "Window in which the variance of a sample is pooled.",
            higher "Steadier estimate.", lower "Sharper estimate.", source "ours; SVGF takes 7x7";
        trusted_samples: f32 = 12.0, 1.0..=1000.0, "samples", "Pooled samples at which the variance over time is believed alone.",
            higher "The spread over the window counts longer: more blur.", lower "Noisy estimates.", source "ours";
    }
    /// Edge-avoiding a-trous wavelet (Dammertz et al. 2010) with a luminance stop (SVGF, Schied et al. 2017).
    wavelet: Wavelet {
        levels: u32 = 5, 0..=8, "", "Levels; level i has taps 2^i pixels apart.",
            higher "Smoother.", lower "Noisier.", source "SVGF: 5";
        transmission_levels: u32 = 4, 0..=8, "", "Levels for light through glass.",
            higher "Smoother.", lower "Sharper.", source "ours";
        matte: f32 = 4.0, 0.0..=64.0, "standard deviations", "Luminance stop of indirect matte light.",
            higher "Smoother; soft shadows fade.", lower "Noisier.", source "SVGF: 4";
        matte_direct: f32 = 4.0, 0.0..=64.0, "standard deviations", "Of direct matte light.",
            higher "Smoother; shadow edges soften.", lower "Noisier.", source "ours";
        glossy: f32 = 4.0, 0.0..=64.0, "standard deviations", "Of glossy light.",
            higher "Smoother reflections.", lower "Noisier ones.", source "ours";
        transmission: f32 = 4.0, 0.0..=64.0, "standard deviations", "Of light through glass, in media, and of an undivided beauty.",
            higher "Smoother.", lower "Noisier.", source "ours";
        mirror: f32 = 2.5, 0.0..=64.0, "standard deviations", "Of what mirrors and clear glass show.",
            higher "Shadows seen in mirrors fade.", lower "Noisier mirrors.", source "ours";
        normal: f32 = 48.0, 0.0..=1000.0, "per 1 - cosine", "Fall of the weight between normals.",
            higher "Sharper creases, less smoothing of curved surfaces.", lower "Light leaks round corners.", source "SVGF: 128th power";
        depth: f32 = 0.01, 1e-5..=1.0, "of depth", "Tolerance of the depth that the tangent plane predicts.",
            higher "Light leaks over steps.", lower "Curved surfaces stay noisy.", source "ours";
        guide_noise: f32 = 1.0, 0.0..=16.0, "", "How far the noise of the guides themselves loosens their stops.",
            higher "Blurred geometry (depth of field, motion, hair) is filtered by colour alone.", lower "It stays noisy.", source "ours";
        seen_albedo: f32 = 0.15, 0.01..=16.0, "of the tone-mapped range", "Tolerance of the albedo seen in mirrors and through glass.",
            higher "Reflections blur.", lower "Noisier ones.", source "ours";
        seen_normal: f32 = 8.0, 0.0..=1000.0, "per 1 - cosine", "Fall of the weight between normals seen there.",
            higher "Sharper reflections.", lower "Smoother ones.", source "ours";
        albedo: f32 = 0.15, 0.01..=16.0, "", "Tolerance of the surface's colour where a beauty could not be divided.",
            higher "Textures blur.", lower "Noisier.", source "ours";
    }
    /// Each picture averaged with its neighbours in time, limited to its own local range.
    stabilise: Stabilise {
        frames: u32 = 2, 0..=8, "frames", "Neighbours on each side.",
            higher "Steadier and smoother edges, a little softer.", lower "More flicker.", source "ours";
        decay: f32 = 0.8, 0.0..=1.0, "per frame", "Weight of a neighbour one frame further away.",
            higher "Steadier.", lower "Sharper.", source "ours";
        seen_albedo: f32 = 0.5, 0.01..=16.0, "of the tone-mapped range", "How far what a mirror shows around a pixel may differ in a neighbour in time.",
            higher "Moving reflections smear.", lower "They stay noisy.", source "ours";
    }
}
