//! Every parameter of the sequence filter, declared once, and its presets.

use crate::error::Error;
use crate::parameter::{parameters, preset_named};

/// A named set of values of the sequence filter's parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SequencePreset {
    /// The least error: samples of 6 frames before and 6 after, pictures of 3.
    #[default]
    Sequence,
    /// For previews, long shots and machines with little memory: samples of 3 frames before and 3 after, pictures of 1, so that 9
    /// frames wait in memory in place of 19. Noisier where samples are few: `docs/sequence.md`.
    Short,
}

impl SequencePreset {
    /// All presets.
    pub const ALL: [Self; 2] = [Self::Sequence, Self::Short];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sequence => "sequence",
            Self::Short => "sequence-short",
        }
    }
}

impl std::str::FromStr for SequencePreset {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        preset_named(Self::ALL, Self::name, name)
    }
}

impl SequenceSettings {
    /// The values of a preset.
    pub fn preset(preset: SequencePreset) -> Self {
        match preset {
            SequencePreset::Sequence => Self::default(),
            SequencePreset::Short => Self {
                gather: Gather { frames: 3, ..Gather::default() },
                stabilise: Stabilise { frames: 1, ..Stabilise::default() },
                ..Self::default()
            },
        }
    }
}

parameters! {
    /// The value of every parameter of the sequence filter. The default is the preset `sequence`.
    SequenceSettings
    /// Every parameter, in the order of the stages.
    SEQUENCE_PARAMETERS
    /// Which pixels are mirrors or clear glass, whose light is divided by what they show.
    mirrors: Mirrors {
        specular_share: f32 = 0.1, 0.0..=1.0, "of the specular colour", "A surface whose diffuse colour is less than this share of its glossy or transmitted colour is a mirror or clear glass.",
            higher "Glossy paint counts as a mirror.", lower "Mirrors with a tint or dust do not.", source "ours; what else a pixel of a mirror's edge holds counts little";
        unknown_colour: f32 = 0.2, 0.0..=1.0, "", "Colour that is assumed where the file has none for glossy light.",
            higher "More surfaces without a glossy colour count as mirrors.", lower "Fewer.", source "ours";
        least_colour: f32 = 0.02, 1e-4..=1.0, "", "Least colour that light is divided by.",
            higher "Dark textures seen in mirrors blur.", lower "Their light is divided by next to nothing: fireflies.", source "ours";
        brightest_colour: f32 = 64.0, 1.0..=1e30, "", "Greatest colour that light is divided by; more is the sun or its glitter, which takes the colour of the pixels beside it.",
            higher "The sun seen in a mirror leaks into the pixels that it is mixed with.", lower "Lamps seen in mirrors blur.", source "ours: lamps are 21 in `hall`, 30 in `night`, glitter 1000 in `harbour`";
        edge_colour: f32 = 0.2, 0.0..=1.0, "", "Colour of reflections from which a pixel at a mirror's edge counts as part of it.",
            higher "A dotted line around mirrors.", lower "Glossy surfaces beside mirrors are divided by their picture.", source "ours";
        background_normal: f32 = 0.5, 0.0..=2.0, "", "Length of the normal seen in a mirror below which it shows the background.",
            higher "Things seen in mirrors mix with the sky.", lower "What is half sky keeps its noise.", source "ours";
        background_pixels: u32 = 3, 0..=16, "pixels", "Half the side of the window over which the background seen in a mirror is averaged before light is divided by it.",
            higher "Less noise of water under the sky.", lower "0: the divisor's noise, which is the reflection's, comes back.", source "ours: docs/sequence.md";
        background_deviations: f32 = 5.0, 0.0..=64.0, "standard deviations", "Pixels whose background differs by more do not count. The deviation is that of the direction that varies least, of four: half of the true one or less.",
            higher "Clouds seen in mirrors blur.", lower "Noise stays.", source "ours";
    }
    /// Motion of what mirrors and clear glass show, matched between neighbouring frames.
    reflections: Reflections {
        coarsest: u32 = 40, 4..=4096, "pixels", "Levels halve the picture until one side is shorter than twice this.",
            higher "Fewer levels: slow motion only.", lower "More levels: little is left to match.", source "ours";
        search: u32 = 3, 0..=8, "pixels", "Offsets tried at the coarsest level, each way.",
            higher "Faster motion is found, and more false matches.", lower "Slow motion only.", source "ours";
        patch: u32 = 3, 1..=8, "pixels", "Half the side of the compared patches.",
            higher "More reliable matches; edges of motion blur.", lower "Noisier matches.", source "ours";
        most_difference: f32 = 0.25, 1e-4..=64.0, "squared, colour and normal", "Most that one pixel of a patch may contribute: edges in a reflection occlude and disocclude.",
            higher "One edge decides a patch.", lower "What differs counts little: false matches.", source "ours";
        departure: f32 = 2e-5, 0.0..=1.0, "per squared pixel", "What a pixel of departure from the surface's motion costs.",
            higher "The surface's motion stays.", lower "Textureless reflections move at random.", source "ours";
        surface_bonus: f32 = 0.7, 0.0..=1.0, "of its cost", "Another motion than the surface's must be better by this factor.",
            higher "Reflections leave the surface's motion sooner.", lower "Later.", source "ours";
        stay: f32 = 0.95, 0.0..=1.0, "of its cost", "Another offset than the one found at the level above must be better by this factor.",
            higher "Offsets change from pixel to pixel.", lower "Fine levels correct less.", source "ours";
        least_patch: u32 = 30, 1..=1024, "pixels", "Least number of mirror pixels in a patch: thin mirrors give no reliable match.",
            higher "Thin mirrors keep the surface's motion.", lower "They are matched at random.", source "ours";
        least_share: f32 = 0.5, 0.01..=1.0, "of a coarse pixel", "Share of mirror from which a coarse pixel takes part.",
            higher "Edges of mirrors are left out.", lower "They mix with what is beside.", source "ours";
    }
    /// Samples gathered along each surface's motion trajectory through the frames around.
    gather: Gather {
        frames: u32 = 6, 0..=64, "frames", "Frames before, and after, from which samples are taken.",
            higher "Less noise, more memory and time.", lower "Quicker changes of light, more noise.", source "ours: docs/sequence.md";
        future: bool = true, (), "", "Frames after the present one are used too.",
            higher "`--history both`: no noisy first frame, less lag.", lower "`--history past`.", source "ours";
        matte_decay: f32 = 0.88, 0.0..=1.0, "per frame", "Weight of a matte sample one frame further away.",
            higher "Less noise, more lag.", lower "Follows moving shadows.", source "ours";
        glossy_direct_decay: f32 = 0.8, 0.0..=1.0, "per frame", "Weight of a highlight's sample one frame further away.",
            higher "Less noise, more smear.", lower "Noisier highlights.", source "ours";
        glossy_decay: f32 = 0.7, 0.0..=1.0, "per frame", "The same of reflections, which do not move with the surface.",
            higher "Less noise, more smear.", lower "Noisier reflections.", source "ours";
        transmission_decay: f32 = 0.6, 0.0..=1.0, "per frame", "The same of light through glass.",
            higher "Less noise, more smear.", lower "Noisier glass.", source "ours";
        seen_albedo: f32 = 0.06, 0.01..=16.0, "of the tone-mapped range", "Tolerance of the albedo seen in mirrors and through glass.",
            higher "Reflections smear.", lower "Noisier ones.", source "ours";
        seen_normal: f32 = 8.0, 0.0..=1000.0, "per 1 - cosine", "Fall of a sample's weight with the normal seen there.",
            higher "Noisier reflections.", lower "They smear.", source "ours";
        seen_alike: f32 = 0.5, 0.0..=1.0, "", "Likeness of what mirrors and glass show (albedo and normal) from which a pixel of another frame goes before a nearer one.",
            higher "Edges seen in mirrors sharpen and crumble.", lower "0: the nearest pixel, whatever it shows: edges seen in mirrors soften.", source "ours: docs/trials.md";
        plane_distance: f32 = 2.0, 0.0..=64.0, "pixel sizes at that depth", "Distance from the tangent plane at which a point of another frame is another surface.",
            higher "Samples cross small steps.", lower "Curved surfaces lose samples.", source "ours";
        camera_plane_distance: f32 = 0.5, 0.0..=64.0, "pixel sizes at that depth", "The same where motion is the camera's alone, as of files without motion vectors.",
            higher "Things that move by themselves smear.", lower "Noisier where positions are noisy.", source "ours: docs/trials.md";
        travel: f32 = 0.25, 0.0..=1.0, "of the picture's height", "How far up or down a trajectory may lead from its pixel.",
            higher "Fast vertical motion keeps more frames; bands of a picture need wider margins.", lower "It loses samples.", source "ours: docs/sequence.md";
        round_trip: f32 = 0.15, 0.0..=16.0, "pixels", "Forward-backward error of motion that is allowed for a moving surface.",
            higher "Ghosts behind moving things.", lower "Rotating things lose samples.", source "ours";
        round_trip_share: f32 = 0.05, 0.0..=1.0, "of the motion's length", "How far it may miss beyond that.",
            higher "Ghosts behind fast things.", lower "Fast things lose samples.", source "ours";
        standing_normal: f32 = 0.6, -1.0..=1.0, "cosine", "Least cosine between normals of a surface at rest, in two frames.",
            higher "Noisy normals lose samples.", lower "Samples cross creases.", source "ours";
        plane_normal: f32 = 0.9, -1.0..=1.0, "cosine", "Least cosine beyond `standing_reach`: other parts of the same plane.",
            higher "Samples are lost.", lower "Samples come from other things in the same plane.", source "ours";
        standing_reach: f32 = 6.0, 0.0..=1000.0, "pixel sizes at that depth", "Distance within which a point of the tangent plane is the same surface whatever its normal.",
            higher "Samples come from further away.", lower "Normal-mapped surfaces lose samples.", source "ours";
        moving_normal: f32 = 0.7, -1.0..=1.0, "cosine", "Least cosine between normals of a surface that moves.",
            higher "Turning things lose samples.", lower "Ghosts.", source "ours";
        moving_depth: f32 = 0.1, 0.0..=1.0, "of depth", "Most change of depth a frame of a surface that moves.",
            higher "Ghosts.", lower "What comes nearer loses samples.", source "ours";
        moving_weight: f32 = 0.7, 0.0..=1.0, "", "Weight of a sample that was matched by its motion alone.",
            higher "Less noise, more smear on what moves.", lower "Noisier.", source "ours";
        camera_moving_weight: f32 = 0.0, 0.0..=1.0, "", "The same where motion is the camera's alone: it leads nowhere on what moves by itself.",
            higher "Less noise, smear on what moves.", lower "Noisier.", source "ours: docs/trials.md";
        least_share: f32 = 0.01, 0.0..=0.25, "of a pixel", "Of the four pixels around the place that motion leads to, those with a smaller bilinear share are not taken.",
            higher "Trajectories end sooner at silhouettes.", lower "Pixels nearly one away are taken there.", source "ours";
        light_deviations: f32 = 1.0, 0.0..=64.0, "standard deviations", "How far a light's mean around the pixel may differ in another frame, in deviations of both means, where noise is weak.",
            higher "Less noise; moving shadows and highlights smear.", lower "Noisier where light changes.", source "ours: docs/sequence.md";
        light_deviations_high: f32 = 2.0, 0.0..=64.0, "standard deviations", "The same where noise is strong: at few samples a pixel there are rare bright outliers.",
            higher "Less noise; moving shadows and highlights smear.", lower "Noisier.", source "ours";
        light_noise: f32 = 0.03, 0.0..=16.0, "of the light", "Deviation of the means at which it lies half between (in squares).",
            higher "`gather.light_deviations` counts sooner.", lower "Later.", source "ours";
        light_contrast: f32 = 0.05, 0.0..=1.0, "of the light", "How far they may differ beyond that.",
            higher "Slow changes of light lag.", lower "Light without noise loses samples by rounding.", source "ours";
        mean_pixels: f32 = 8.0, 0.0..=1e6, "noise of a pixel", "Squared difference at which a pixel counts half in these means over 5x5 pixels.",
            higher "Stripes and edges of shadows mix; steadier means.", lower "They stay apart; means of few pixels.", source "ours: docs/sequence.md";
        mean_windows: f32 = 64.0, 0.0..=1e6, "noise of both", "Squared difference from which the mean of another 5x5 pixels, of those within 25x25, does not count (Tukey's biweight); the noise is that of all of them.",
            higher "Steadier means, edges of shadows mix.", lower "Windows select others that are as bright by chance: a mottled picture.", source "ours: docs/sequence.md";
        mean_strong: f32 = 0.1, 1e-3..=16.0, "of the light", "Noise of one pixel from which pixels that differ more count, too.",
            higher "Pixels select others that are as bright by chance.", lower "Stripes mix.", source "ours";
        mean_least: f32 = 1.5, 1.0..=16.0, "times", "By how much the noise of a pixel, the least of second differences along four directions, is taken larger.",
            higher "Structure is taken for noise.", lower "The variance of the means is underestimated.", source "ours";
        mean_few: f32 = 0.25, 0.0..=16.0, "times", "By how much more where noise is strong, by its ratio to `gather.mean_strong` in squares.",
            higher "Structure is taken for noise.", lower "The variance of means of few samples is underestimated.", source "ours";
        same_noise: f32 = 0.75, 0.0..=16.0, "pixels", "Where one seed was used for all frames, the noise of a pixel is repeated within this distance.",
            higher "Slow motion loses samples.", lower "The same noise counts twice.", source "ours";
    }
    /// The variance that steers the wavelet.
    variance: Variance {
        radius: u32 = 2, 0..=8, "pixels", "Window in which the variance of a sample is pooled.",
            higher "Steadier estimate.", lower "Sharper estimate.", source "ours; SVGF takes 7x7";
        confident_samples: f32 = 8.0, 1.0..=1000.0, "samples", "Samples at which the confidence that comes out is full.",
            higher "Less confidence.", lower "More.", source "ours";
        trusted_samples: f32 = 12.0, 1.0..=1000.0, "samples", "Pooled samples from which the variance over time is used alone.",
            higher "The spread over the window counts longer: more blur.", lower "Noisy estimates.", source "ours";
        least_window: f32 = 1.0, 0.0..=1000.0, "pixels", "Weight of the pixels around below which the spread of the 3x3 pixels around counts too, whatever they show: a lone pixel that few other frames show would pass as free of noise.",
            higher "Edges are taken for noise.", lower "Black specks at the rims of mirrors and glass.", source "ours: docs/trials.md";
    }
    /// Edge-avoiding a-trous wavelet (Dammertz et al. 2010) with a luminance stop (SVGF, Schied et al. 2017).
    wavelet: Wavelet {
        levels: u32 = 5, 0..=8, "", "Levels; level i has taps 2^i pixels apart.",
            higher "Smoother.", lower "Noisier.", source "ours: docs/trials.md; SVGF: 5, of 5x5 taps";
        transmission_levels: u32 = 5, 0..=8, "", "Levels for light through glass.",
            higher "Smoother.", lower "Sharper.", source "ours";
        matte: f32 = 2.2, 0.0..=64.0, "standard deviations", "Luminance stop of indirect matte light.",
            higher "Smoother; soft shadows fade.", lower "Noisier.", source "ours: docs/sequence.md; SVGF: 4";
        matte_direct: f32 = 2.2, 0.0..=64.0, "standard deviations", "Of direct matte light.",
            higher "Smoother; shadow edges soften.", lower "Noisier.", source "ours";
        glossy: f32 = 2.2, 0.0..=64.0, "standard deviations", "Of glossy light.",
            higher "Smoother reflections.", lower "Noisier ones.", source "ours";
        transmission: f32 = 2.2, 0.0..=64.0, "standard deviations", "Of light through glass, in media, and of an undivided beauty.",
            higher "Smoother.", lower "Noisier.", source "ours";
        mirror: f32 = 1.4, 0.0..=64.0, "standard deviations", "Of what mirrors and clear glass show.",
            higher "Shadows seen in mirrors fade.", lower "Noisier mirrors.", source "ours";
        low: f32 = 0.15, 0.0..=64.0, "standard deviations", "The luminance stop of all light where little noise is left.",
            higher "Smoother with many samples a pixel.", lower "Detail stays with many samples a pixel.", source "ours: docs/sequence.md";
        low_noise: f32 = 0.03, 0.0..=16.0, "of the luminance", "Deviation of a compared mean at which the stop lies half between (in squares).",
            higher "`wavelet.low` counts sooner.", lower "Later; 0: never.", source "ours";
        step: f32 = 6.0, 0.0..=1000.0, "standard deviations", "Neighbours that differ by more begin to be left out of the compared means over 3x3 pixels.",
            higher "Light leaks from lamps into the dark pixels beside them.", lower "Means are as noisy as pixels, so that noise stops itself.", source "ours: docs/sequence.md";
        variance_ratio: f32 = 4.0, 0.0..=1e6, "times a pixel's own", "The most that a neighbour's variance counts in the luminance stop.",
            higher "Light with noise leaks into light without.", lower "Fireflies stay.", source "ours";
        normal: f32 = 48.0, 0.0..=1000.0, "per 1 - cosine", "Fall of the weight between normals.",
            higher "Sharper creases, less smoothing of curved surfaces.", lower "Light leaks round corners.", source "SVGF: 128th power";
        depth: f32 = 0.01, 1e-5..=1.0, "of depth", "Tolerance of the depth that the tangent plane predicts.",
            higher "Light leaks over steps.", lower "Curved surfaces stay noisy.", source "ours";
        depth_near: f32 = 0.3, 0.0..=16.0, "of `wavelet.depth`", "Part of the depth tolerance that holds at the centre.",
            higher "Light leaks over small steps.", lower "Noisy depth stops neighbours.", source "ours";
        depth_far: f32 = 0.1, 0.0..=16.0, "of `wavelet.depth` per pixel", "Part that each pixel of a tap's distance adds.",
            higher "Light leaks over steps far away.", lower "Curved surfaces stay noisy.", source "ours";
        slope_error: f32 = 0.2, 0.0..=16.0, "of the predicted change", "How wrong the slope's prediction may be: surfaces bend.",
            higher "Light leaks along slanted edges.", lower "Slanted surfaces stay noisy.", source "ours";
        guide_noise: f32 = 1.0, 0.0..=16.0, "", "How far the noise of the guides themselves loosens their stops.",
            higher "Blurred geometry (depth of field, motion, hair) is filtered by colour alone.", lower "It stays noisy.", source "ours";
        seen_albedo: f32 = 0.15, 0.01..=16.0, "of the tone-mapped range", "Tolerance of the albedo seen in mirrors and through glass.",
            higher "Reflections blur.", lower "Noisier ones.", source "ours";
        seen_normal: f32 = 8.0, 0.0..=1000.0, "per 1 - cosine", "Fall of the weight between normals seen there.",
            higher "Sharper reflections.", lower "Smoother ones.", source "ours";
        least_contrast: f32 = 1e-3, 0.0..=1.0, "of the luminance", "Luminances that differ by less do not differ.",
            higher "Faint detail blurs.", lower "Rounding stops neighbours where nothing varies.", source "ours";
        albedo: f32 = 0.15, 0.01..=16.0, "", "Tolerance of the surface's colour where a beauty could not be divided.",
            higher "Textures blur.", lower "Noisier.", source "ours";
    }
    /// What the filtered light misses of the frame's own samples, smoothed.
    residual: Residual {
        correct: bool = true, (), "", "Low-frequency bias of the light is corrected by the residual of the frame's own samples.",
            higher "A lamp that is switched neither comes early nor leaves late.", lower "Frames around leave their light.", source "ours: docs/sequence.md; shrinkage: James and Stein 1961";
        noise: f32 = 0.03, 0.0..=16.0, "of the light", "Deviation of the frame's samples from the filtered light at which half is corrected: with less noise the other stages detect changes of light themselves.",
            higher "Only strong noise is corrected.", lower "Shapes that the filter missed are corrected, and leak into their surroundings.", source "ours: docs/sequence.md";
        most: f32 = 2.0, 1.0..=100.0, "times", "A level changes light by at most this factor, up or down.",
            higher "Light that is far too bright or too dark is corrected at once.", lower "1: nothing is corrected.", source "ours";
        sure: f32 = 4.0, 0.0..=1000.0, "times its variance", "The squared residual below which nothing is corrected.",
            higher "Less is corrected.", lower "Low frequencies of the frame's noise come back.", source "ours: docs/sequence.md";
        picture: bool = true, (), "", "The stabilised picture is corrected in the same way.",
            higher "Lamps that switch and shadows that move leave nothing in the frames around.", lower "A little steadier, with some of the light of the frames around.", source "ours: docs/sequence.md";
        picture_sure: f32 = 4.0, 0.0..=1000.0, "times its variance", "The squared residual of the stabilised picture below which nothing is corrected, but for `residual.picture_around`.",
            higher "Less is corrected.", lower "Low frequencies of the frame's noise come back.", source "ours: docs/sequence.md";
        picture_around: f32 = 1.6, 1.0..=16.0, "times its variance", "The mean squared residual of the windows around, each over its variance, above which the light is taken to change there: then a window is corrected whose own residual is below `residual.picture_sure`, too. 16: never.",
            higher "Less is corrected.", lower "Low frequencies of the frame's noise come back.", source "empirical Bayes: Efron and Morris 1973; ours: docs/sequence.md";
    }
    /// Each picture averaged with its neighbours in time, and with the pixels around that show the same.
    stabilise: Stabilise {
        net: bool = true, (), "", "A small net trained on rendered sequences sets the bandwidths of the cross-bilateral filter.",
            higher "Less error at silhouettes, wires and leaves.", lower "The version without a net: neighbours in time alone, clamped to the picture's own range in 3x3.", source "Kalantari et al. 2015; ours: docs/sequence.md";
        frames: u32 = 3, 0..=8, "frames", "Neighbours on each side.",
            higher "Steadier and smoother edges, a little softer.", lower "More flicker.", source "ours";
        decay: f32 = 0.8, 0.0..=1.0, "per frame", "Weight of a neighbour one frame further away.",
            higher "Steadier.", lower "Sharper.", source "ours";
        camera_fall: f32 = 2.0, 1.0..=16.0, "", "Where motion is the camera's alone, as of files without motion vectors: a neighbour in time that is r times brighter than `stabilise.contrast` times the second brightest that the pixel showed gets r to minus this power as a factor of its weight.",
            higher "Lamps bleed less into what is dark beside them.", lower "More.", source "ours: docs/trials.md";
        contrast: f32 = 1.2, 1.0..=1e6, "times", "How much brighter or darker than anything that a pixel showed a neighbour in time may be before it counts less.",
            higher "Lamps bleed into what is dark beside them where motion misses.", lower "A little more flicker.", source "ours: docs/trials.md";
        albedo: f32 = 1.0, 0.0..=1e6, "over the noise's relative variance", "Least bandwidth of the albedo for neighbours in time.",
            higher "Textures whose motion is unknown stay sharp.", lower "Where albedo is noisy, less flicker.", source "ours: docs/trials.md";
        camera_albedo: f32 = 30.0, 0.0..=1e6, "per squared albedo", "The same at least where motion is the camera's alone, as of files without motion vectors.",
            higher "Textures of what moves by itself stay sharp.", lower "Where albedo is noisy, less flicker.", source "ours: docs/trials.md";
        outlier: f32 = 1.5, 1.0..=1e6, "times", "How much brighter a pixel may be than those around it and than what it shows in other frames before it counts less; from twice that it counts nothing.",
            higher "Single bright pixels stay.", lower "Glints that one frame alone shows are lost.", source "ours: docs/trials.md";
        outlier_noise: f32 = 0.4, 0.0..=16.0, "of the brightness", "Deviation of the noise at which half of that is done.",
            higher "Single bright pixels stay.", lower "With many samples a pixel glints are lost.", source "ours: docs/trials.md";
        seen_albedo: f32 = 0.5, 0.01..=16.0, "of the tone-mapped range", "How far what a mirror shows around a pixel may differ in a neighbour in time.",
            higher "Moving reflections smear.", lower "They stay noisy.", source "ours";
        surface_seen_albedo: f32 = 0.0625, 0.001..=16.0, "of the tone-mapped range", "The same where the surface's motion is used in place of the reflection's.",
            higher "Moving reflections smear.", lower "They stay noisy.", source "ours";
        departure: f32 = 1.0, 0.0..=64.0, "pixels", "How far the reflection's motion may differ from the surface's for that.",
            higher "Moving reflections smear.", lower "They stay noisy.", source "ours";
        likeness: f32 = 0.5, 0.0..=64.0, "of the variance", "How far smoothed pictures may differ, squared, in variances of both pictures.",
            higher "Patterns and reflections smear.", lower "More flicker.", source "ours: docs/sequence.md";
        residue: f32 = 1.0, 0.0..=1.0, "of the noise's variance", "Share of the input's noise that is assumed to remain in the filtered picture where noise is strong.",
            higher "Patterns and reflections smear.", lower "More flicker.", source "ours";
        low_noise: f32 = 0.0, 0.0..=16.0, "of the picture", "Deviation of the noise of the frame as it came at which a quarter of `stabilise.residue` counts.",
            higher "Less is averaged with many samples a pixel.", lower "More: patterns and reflections smear.", source "ours";
        nearer: f32 = 1.02, 1.0..=4.0, "times 1/depth", "How much nearer a neighbour in 3x3 must be to count as the foreground: more than the slope of one surface gives.",
            higher "Silhouettes move with what is behind.", lower "Slanted surfaces move with their nearest pixel.", source "ours";
        depth_change: f32 = 0.5, 0.0..=1.0, "of 1/depth", "Most change of 1/depth of the nearest surface from a frame to the next. Wide, since out of focus depth is a mean over surfaces: features decide what is averaged.",
            higher "Ghosts.", lower "What comes nearer flickers.", source "ours";
        round_trip: f32 = 0.5, 0.0..=16.0, "pixels", "How far motion there and back again may miss.",
            higher "Ghosts at silhouettes.", lower "Silhouettes flicker.", source "ours";
        round_trip_noise: f32 = 0.18, 0.01..=16.0, "of the brightness", "Deviation of the noise at which it may miss by one more pixel; that grows with the deviation's fourth power.",
            higher "More flicker where motion vectors are noisy, as out of focus.", lower "Ghosts where noise is strong.", source "ours: docs/trials.md";
        round_trip_share: f32 = 0.1, 0.0..=1.0, "of the motion's length", "How far it may miss beyond that.",
            higher "Ghosts behind fast things.", lower "Fast things flicker.", source "ours";
    }
    /// Input, wavelet's picture and stabilised one blended by how far each is expected to lie from the light.
    blend: Blend {
        choose: bool = true, (), "", "The result is a mixture of input, wavelet picture and stabilised picture.",
            higher "More samples always help.", lower "The stabilised picture is the result, whatever detail it lost.", source "SURE (Li et al. 2012), Rousselle et al. 2013; ours: docs/sequence.md";
        net: bool = true, (), "", "A small net trained on rendered sequences gives the shares and the kernels.",
            higher "Less error.", lower "Thresholds give them: `blend.excess`, `blend.softness`.", source "ours: benchmarks/nets";
        kernel: f32 = 1.0, 0.0..=1.0, "", "With the net: how much of what its kernels change counts; they remove the noise of edges.",
            higher "Smooth edges.", lower "Edges are as noisy as the samples of the surfaces that meet there; 0: no kernels.", source "Bako et al. 2017; ours: docs/sequence.md";
        kernel_noise: f32 = 0.15, 0.0..=16.0, "of the brightness", "Deviation of the noise at which half of that counts.",
            higher "Edges stay as they are with many samples a pixel.", lower "Fine detail may go with the noise of edges.", source "ours: docs/trials.md";
        kernel_contrast: f32 = 4.0, 1.0..=1e6, "times", "How much brighter than a pixel those around count for its kernel.",
            higher "Lamps leak into dark pixels beside them.", lower "Edges of bright things keep their noise.", source "ours: docs/trials.md";
        excess: f32 = 0.1, 0.0..=64.0, "of the noise", "Without the net: the next more filtered picture is taken whole where its squared distance from the input exceeds the noise by less.",
            higher "Smoother, detail is lost.", lower "Noisier.", source "ours";
        softness: f32 = 0.4, 0.01..=64.0, "of the noise", "Without the net: excess over which its share falls to nothing.",
            higher "Softer changes between pictures.", lower "Harder ones.", source "ours";
        strength: f32 = 1.0, 0.0..=4.0, "", "Share of the noise removal that comes out; beyond 1 the more filtered pictures gain.",
            higher "Smoother.", lower "Grain comes back: 0 is the input.", source "ours";
        guard: f32 = 16.0, 1.0..=1000.0, "times the squared noise", "How far the result may lie from the input, squared, mean over 5x5, where noise is strong.",
            higher "The net is trusted further.", lower "What the filter removed comes back sooner.", source "ours";
        guard_low: f32 = 2.0, 1.0..=1000.0, "times the squared noise", "The same where it is weak.",
            higher "Bias stays with many samples a pixel.", lower "Noise stays with many samples a pixel.", source "ours: docs/sequence.md";
        guard_noise: f32 = 0.05, 0.0..=16.0, "of the brightness", "Deviation of the noise at which it lies half between (in squares).",
            higher "`blend.guard_low` counts sooner.", lower "Later; 0: never.", source "ours";
        guard_input: f32 = 0.25, 0.0..=1.0, "of the squared noise", "Least share of the input's own changes, along the direction in which they are least, that counts as noise: what no filter but `stabilise` removes (wires, silhouettes and what they emit) does not show in what was removed.",
            higher "The net is trusted further at wires and in fine structure.", lower "Wires and silhouettes keep their noise.", source "ours";
        visible: f32 = 0.01, 0.0..=1.0, "of the brightness", "Deviation of the noise at which half of it is left: weaker noise is invisible, and removing it is not worth a bias.",
            higher "Faint noise stays.", lower "0: bias of the filter stays at any number of samples.", source "ours: docs/sequence.md";
    }
}
