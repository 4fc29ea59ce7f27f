//! Every parameter, declared once: name, unit, range, default, what higher and lower values do, source. The command
//! line (`--set stage.parameter=value`), `quell explain` and `docs/parameters.md` are made from this table.
//!
//! Sources: \[S] the talk's slides, \[A] the paper's abstract, \[E] the authors' engine, \[I] inferred, \[O] open: a choice
//! of ours, recorded in `docs/paper.md`. Radii in pixels are meant at 720 rows and scale with the image's height;
//! lengths are relative to view depth, or to the size of a pixel at that depth.

use crate::error::Error;
pub use crate::parameter::{Kind, Parameter, nearest};
use crate::parameter::{choices, parameters, preset_named};

/// Rows at which radii in pixels are meant.
pub const REFERENCE_ROWS: f32 = 720.0;

/// A named set of parameter values. The default is what programs run where nobody chooses; a parameter's own default, and with it
/// [`Settings::default`], is the paper's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// The algorithm of 2017 as far as known; departures in `docs/paper.md`.
    Paper,
    /// Ours, on the paper's backbone: light of few frames is filtered in space by the history's length. `docs/quality.md`.
    #[default]
    Quality,
}

impl Preset {
    /// All presets.
    pub const ALL: [Self; 2] = [Self::Paper, Self::Quality];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Quality => "quality",
        }
    }
}

impl std::str::FromStr for Preset {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        preset_named(Self::ALL, Self::name, name)
    }
}

choices! {
    /// Which image of this frame is the matte history of the next.
    Feedback {
        /// Stage 3's own output: plain temporal accumulation.
        Temporal = "temporal",
        /// After stage 4.
        Prefilter = "prefilter",
        /// Stage 5's blend of temporal and prefiltered, with at least `disocclusion.feedback_floor` of the latter.
        Blend = "blend",
        /// After stage 6.
        Firefly = "firefly",
        /// After stage 7.
        Bilateral = "bilateral",
    }
    /// How history is clamped to the current signal's neighbourhood.
    Clip {
        /// Not at all.
        Off = "off",
        /// To the minimum and maximum, per channel in YCoCg.
        Box = "box",
        /// To mean +- gamma standard deviations, per channel in YCoCg.
        Sigma = "sigma",
    }
    /// Which distance between the surface now and the one remembered rejects history.
    Rejection {
        /// Never rejected by distance (identity and normals still count).
        Off = "off",
        /// Distance to the tangent plane.
        Plane = "plane",
        /// Distance of the points (the engine's; rejects floors at grazing views).
        Point = "point",
    }
    /// What is done to the glossy hit distance before it moves the virtual point.
    HitFilter {
        /// Nothing.
        Off = "off",
        /// Minimum over 3x3.
        Min = "min",
        /// Median over 3x3.
        Median = "median",
    }
    /// What the median filter chooses.
    Median {
        /// The median of each channel (the engine's).
        Channel = "channel",
        /// The pixel of median luminance, for all channels.
        Luminance = "luminance",
    }
    /// What the median filter reads.
    FireflyInput {
        /// Stage 5's output.
        Disocclusion = "disocclusion",
        /// Stage 3's output.
        Temporal = "temporal",
    }
    /// What happens to taps that leave the image.
    OffScreen {
        /// They are left out.
        Skip = "skip",
        /// They are mirrored back in.
        Mirror = "mirror",
    }
    /// How the glossy kernel is sized.
    GlossyRadius {
        /// By the lobe's footprint: roughness and hit distance.
        Footprint = "footprint",
        /// The same everywhere.
        Constant = "constant",
    }
}

parameters! {
    /// The value of every parameter. The default is the preset `paper`.
    Settings
    /// Every parameter, in the order of the pipeline.
    PARAMETERS
    /// What concerns the order of the stages.
    pipeline: Pipeline {
        feedback: Feedback = Feedback::Blend, (), "",
            "Image of this frame that is the next frame's matte history.",
            higher "Later images are smoother, and blur once a frame.", lower "Earlier ones keep detail and noise.",
            source "[S] a spatially filtered image is fed back; [O] which: ours by measurement, `docs/paper.md`";
    }
    /// When history counts as the same surface: shared by stages 3 and 8.
    surface: SurfaceSettings {
        rejection: Rejection = Rejection::Plane, (), "",
            "Distance that rejects history.",
            higher "`plane` keeps floors at grazing views.", lower "`off` ghosts, `point` is the engine's.",
            source "[E] point distance; ours: plane";
        plane_distance: f32 = 0.005, 0.0..=1.0, "of view depth",
            "Plane distance at which trust begins to fall (never under `pixel_distance`).",
            higher "More ghosting.", lower "More history is lost, more noise.", source "[O]";
        pixel_distance: f32 = 1.0, 0.0..=16.0, "pixel sizes at that depth",
            "Least plane distance at which trust begins to fall.",
            higher "Silhouettes of the distance blend.", lower "Distant surfaces lose history.", source "[O]";
        point_distance: f32 = 0.01, 0.0..=1.0, "of view depth",
            "Point distance at which trust begins to fall, where `rejection` is `point`.",
            higher "More ghosting.", lower "More history is lost.", source "[E] 0.05 m, taken at 5 m";
        falloff: f32 = 1.4, 1.0..=10.0, "of the distance above",
            "Distance at which trust is 0.",
            higher "Softer decision.", lower "Harder decision.", source "[E] 0.07 m over 0.05 m";
        normal_min: f32 = 0.5, -1.0..=1.0, "cosine",
            "Least cosine between the normals now and then.",
            higher "History is lost on rotating and bumpy surfaces.", lower "Light crosses creases.", source "[O]";
        static_motion: f32 = 1.0, 0.0..=16.0, "pixels",
            "A surface counts as unmoved where its motion differs from the camera's own by less.",
            higher "Slow objects are tested as if they stood still.", lower "Rounding counts as movement.",
            source "[I] under a pixel's size";
        moving_depth: f32 = 0.1, 0.0..=10.0, "of view depth",
            "How far in depth a moving surface may have come from.",
            higher "What it uncovers may ghost where ids are missing.", lower "Fast approach loses history.",
            source "[O]";
        guard_band: f32 = 0.0, 0.0..=64.0, "pixels",
            "Border of the previous image that is not trusted.",
            higher "Fresh noise at the edges of the picture.", lower "None.", source "[E]";
        lost_footprint: f32 = 0.0, 0.0..=64.0, "",
            "Where only the part f of the bilinear footprint shows the surface, trust is times f / (f + this (1 - f)).",
            higher "At creases and silhouettes of what moves history is shorter: noisier, but not drawn in from the side.",
            lower "There it is fetched from up to a pixel beside, frame after frame: contact shadows fade.", source "ours: `docs/quality.md`";
        confidence_frames: f32 = 4.0, 1.0..=64.0, "frames",
            "History length at which confidence is full.",
            higher "Stage 5 helps for longer.", lower "Stage 5 lets go earlier.", source "[O] algorithm, 3.7";
    }
    /// Stage 3.
    matte_temporal: MatteTemporal {
        enabled: bool = true, (), "", "Switch of the stage.",
            higher "On.", lower "The ablation without temporal filters.", source "[S]";
        alpha: f32 = 0.98, 0.0..=0.999, "share of history",
            "Most that history may count. The window is 1 / (1 - alpha) frames.",
            higher "Less noise and boiling, more lag.", lower "Quicker, noisier.",
            source "[I] a third party's implementation; the engine's generic default is 0.9";
        ramp: bool = true, (), "",
            "History of N frames counts at most N / (N + 1): a plain mean at first.",
            higher "Quick start.", lower "As in the paper: the first sample keeps most of the weight for long.",
            source "ours, named departure";
        clip: Clip = Clip::Off, (), "",
            "Clamp of history to the current signal's neighbourhood.",
            higher "Less ghosting of light; loses energy where light is sparse.", lower "Light changes lag.",
            source "[O] off: stage 3 costs less than stage 8, and the box of raw noise loses energy";
        clip_radius: u32 = 2, 1..=4, "pixels", "Radius of the clamp's window.",
            higher "Looser clamp.", lower "Tighter clamp, more noise.", source "[I] 1 in the paper, [S] 2 in the final images";
        clip_gamma: f32 = 1.5, 0.0..=16.0, "standard deviations", "Width of the clamp where `clip` is `sigma`.",
            higher "Looser clamp.", lower "Tighter clamp.", source "[O]";
    }
    /// Where stages 3 and 8 find that light has changed, they shorten history: a fast history of luminance beside the long one.
    changed_light: ChangedLight {
        matte: bool = false, (), "", "Shortens the matte history where light has changed.",
            higher "Follows lamps that switch or move; noisier while they do.", lower "Light changes lag.",
            source "ours: `docs/quality.md`; shortening history by the change of light: A-SVGF (Schied et al. 2018)";
        glossy: bool = false, (), "", "Shortens the glossy history where light has changed.",
            higher "Follows lamps that switch or move; noisier while they do.", lower "Light changes lag.",
            source "ours: `docs/quality.md`";
        fast: f32 = 0.6, 0.0..=0.95, "share of history", "Most that history counts in the fast mean. Its window is 1 / (1 - fast) frames.",
            higher "Finds smaller changes, later.", lower "Finds large changes earlier.", source "ours: `docs/quality.md`";
        begin: f32 = 1.5, 0.0..=64.0, "standard deviations", "Difference between the fast and the long history, both averaged over the window, from which history gets shorter.",
            higher "Small changes lag.", lower "Chance shortens history: more noise.", source "ours: `docs/quality.md`";
        certain: f32 = 2.0, 0.0..=64.0, "standard deviations", "Difference at which nothing is left of history; at least `begin`.",
            higher "History is shortened more softly.", lower "Quicker, harder.", source "ours: `docs/quality.md`";
        least: f32 = 0.03, 0.0..=10.0, "of the sum of both means", "A difference that counts as one deviation whatever the noise.",
            higher "Only large changes count.", lower "Chance and small changes shorten history where noise is low.", source "ours: `docs/quality.md`";
        radius: u32 = 3, 1..=3, "cells of 8x8 pixels", "Half the width of the window around the pixel, which falls off as a tent.",
            higher "Finds smaller changes, in more noise.", lower "Sees less of the neighbourhood: what changes in small places only.", source "ours: `docs/quality.md`";
        spacing: u32 = 1, 1..=4, "pixels", "Distance between the taps of a cell along both axes.",
            higher "Faster, and noisier.", lower "Every pixel counts.", source "ours: `docs/quality.md`";
    }
    /// Levels of filters in space where history is short: between stages 3 and 4, and between 8 and 9. Not in the paper.
    young_filter: YoungFilter {
        matte: bool = false, (), "", "Filters the matte signal after stage 3.",
            higher "First frames and what was uncovered are smooth.", lower "They are noisy.",
            source "ours: `docs/quality.md`";
        glossy: bool = false, (), "", "Filters the glossy signal after stage 8.",
            higher "Reflections are smooth, and blurred, at first.", lower "They are noisy at first.",
            source "ours: `docs/quality.md`";
        frames: f32 = 32.0, 1.0..=256.0, "frames", "History length at which the finest level has faded out.",
            higher "Smoother and flatter for longer.", lower "Sharper and noisier earlier.",
            source "ours; SVGF (Schied et al. 2017) filters in space below 4 frames";
        falloff: f32 = 0.5, 0.01..=1.0, "of the level before's frames", "When the levels of 3 and 9 pixels fade out.",
            higher "Wider for longer.", lower "Narrower earlier.", source "ours: `docs/quality.md`";
        matte_levels: u32 = 3, 0..=4, "", "Levels of the matte signal; their taps lie 1, 3, 9 and 27 pixels apart.",
            higher "First frames are smoother, and flatter.", lower "They are noisier.", source "ours: `docs/quality.md`";
        glossy_levels: u32 = 3, 0..=3, "", "Levels of the glossy signal: 1, 3 and 9 pixels.",
            higher "First reflections on rough surfaces are smoother.", lower "Faster.", source "ours: `docs/quality.md`";
        wide_frames: f32 = 12.0, 0.0..=256.0, "frames", "History length at which the matte level of 27 pixels has faded out, with `matte_stays` too; at most 1: there is no such level.",
            higher "Smoother and flatter for longer.", lower "Sharper and noisier earlier.", source "ours: `docs/quality.md`";
        matte_stays: bool = false, (), "", "The first three matte levels do not fade out; `deviations` should be above 0.",
            higher "What matures stays smooth: the luminance stop closes as the noise falls.", lower "Levels fade out as history grows.",
            source "ours: `docs/quality.md`";
        lobe: f32 = 1.0, 0.0..=64.0, "of the lobe's footprint", "Glossy only: a level fades out where its taps lie farther apart than this.",
            higher "Reflections are smoother and blurrier at first.", lower "Sharper and noisier ones.",
            source "ours: `docs/quality.md`";
        least_lobe: f32 = 0.0, 0.0..=64.0, "pixels", "Glossy only: the least footprint that counts, of mirrors too.",
            higher "Mirrors are smoother and blurrier at first.", lower "Sharper and noisier ones.",
            source "ours: `docs/quality.md`";
        deviations: f32 = 0.0, 0.0..=64.0, "standard deviations of the noise", "From the second level on, a neighbour whose luminance differs by as much counts nothing; 0: no such stop.",
            higher "Smoother, flatter.", lower "Contact shadows and soft edges of light stay, and some noise.",
            source "ours: `docs/quality.md`; a luminance stop that knows the noise: SVGF (Schied et al. 2017) 4.3";
        matte_contrast: f32 = 0.0, 0.0..=64.0, "of the mean, for one frame", "Matte only, first level: a neighbour whose luminance differs by this times the pair's mean and the root of 1 / N_p + 1 / N_q counts nothing (which none does before half its square in frames), others less; 0: no such stop.",
            higher "Fireflies spread, shadows are flatter.", lower "Sparse light is not smoothed, and loses energy to stage 6.",
            source "ours: `docs/quality.md`";
        glossy_contrast: f32 = 0.0, 0.0..=64.0, "of the mean, for one frame", "The same for the glossy signal.",
            higher "Lamps in mirrors leak into the pixels beside them.", lower "Reflections are noisier at first.",
            source "ours: `docs/quality.md`";
        further_contrast: f32 = 0.0, 0.0..=8.0, "of the first level's contrast", "From the second level on, noise counts for `deviations` as far as this part of `matte_contrast` and `glossy_contrast` allows, or as it is found at both pixels; 0: as far as it is found at either.",
            higher "Bright pixels are copied to 3, 9 and 27 pixels away.", lower "Sparse light is not smoothed, and loses energy.",
            source "ours: `docs/quality.md`";
        contact_noise: f32 = 0.0, 0.0..=64.0, "of the squared mean of a pair", "Variance of a pair's difference in luminance from which the contact stop is off; 0: it acts whatever the noise.",
            higher "Contact shadows from the first frames on, and noisy corners.", lower "Smooth corners, whose shadows come later.", source "ours: `docs/quality.md`";
        isolated: f32 = 0.0, 0.0..=64.0, "frames", "First level: as far as the weights of the eight neighbours add up to less than 1, all of them count, whatever surface they show, by up to this many frames less the pixel's own.",
            higher "Wires and leaves take the light of what is around them while their history is short.", lower "They keep the noise of their few paths.",
            source "ours: `docs/quality.md`";
    }
    /// The cross-bilateral weight that stages 4, 7, 9 and 10 share. Geometry only.
    edge: Edge {
        depth: f32 = 5.0, 0.0..=1000.0, "per relative depth", "Kz: fall of the weight with the distance in depth from the tangent plane.",
            higher "Sharper edges, less smoothing of curved surfaces.", lower "Light leaks over steps.",
            source "[E] 1 per metre; ours relative, 5 at 5 m";
        normal: f32 = 1.0, 0.0..=100.0, "", "Kn: fall of the weight with 1 - cosine^4 of the normals.",
            higher "Sharper creases, less smoothing.", lower "Light leaks round corners.", source "[E] 1; 1.5 in 2018";
        plane: f32 = 1.0, 0.0..=100.0, "", "Kp: fall of the weight with the sine of the angle out of the tangent planes.",
            higher "Sharper steps.", lower "Light leaks over steps.", source "[E] 1; 1.5 in 2018";
        matte_gloss: f32 = 0.0, 0.0..=100.0, "", "Kg of the matte stages: fall of the weight with the difference in smoothness.",
            higher "Matte light stops at changes of gloss.", lower "Matte light ignores gloss.", source "[E] 0";
        glossy_gloss: f32 = 1.0, 0.0..=100.0, "", "Kg of the glossy stages.",
            higher "Reflections stop at changes of gloss.", lower "Reflections bleed over them.", source "[O] 1";
        monotone: bool = false, (), "", "Along a separable kernel's line, outwards, the weight may only fall.",
            higher "Stops leaks across thin foreground objects.", lower "Each tap is judged alone.", source "[E] optional";
        contact: f32 = 0.0, 0.0..=16.0, "",
            "Matte stages 4 and 7, and the filter by history: where another surface meets the one that a pair of pixels shows, the pair counts nothing from this closeness on, less before; 0: no such stop.",
            higher "Contact shadows and corners fade.", lower "Noise stays beside corners.",
            source "ours: `docs/quality.md`; light changes as fast as surfaces are near: Ward et al. (SIGGRAPH 1988)";
    }
    /// Stage 4.
    matte_prefilter: MattePrefilter {
        enabled: bool = true, (), "", "Switch of the stage.",
            higher "On.", lower "The ablation without spatial filters (with stages 7, 9 and 10).", source "[S]";
        taps: u32 = 24, 1..=64, "", "Taps of the spiral.",
            higher "Smoother, slower.", lower "Grainier, faster.", source "[O] about 25 to 50 taps fit 3.3 ms of 2017";
        radius: f32 = 32.0, 0.0..=256.0, "pixels at 720 rows", "Radius of the spiral.",
            higher "Smoother, flatter.", lower "Noisier, sharper.", source "[O]";
        sigma: f32 = 0.5, 0.05..=10.0, "of the radius", "Gaussian over the spiral.",
            higher "Wider.", lower "Narrower.", source "[O] 1/2 or 1/3";
        turns: u32 = 0, 0..=63, "", "Turns of the spiral; 0: the best known for the number of taps.",
            higher "Another arrangement of the taps.", lower "Another arrangement of the taps.",
            source "[E] 19:7, 24:7, 32:7, 36:11, 48:11";
        rotate: bool = true, (), "", "The pattern changes from frame to frame.",
            higher "Pattern noise averages out over time.", lower "The pattern stands still.", source "[O] engine default on";
        off_screen: OffScreen = OffScreen::Skip, (), "", "Taps beyond the image's edge.",
            higher "`mirror`: as many taps at the edge as inside.", lower "`skip`: fewer.", source "[O]";
    }
    /// Stage 5.
    disocclusion: Disocclusion {
        enabled: bool = true, (), "", "Switch of the stage.",
            higher "On.", lower "The ablation without the disocclusion filter.", source "[S] that it exists; [O] what it does";
        radius: u32 = 3, 0..=8, "pixels", "Radius of the maximum of distrust.",
            higher "Wider bands of the smooth estimate.", lower "Noise at moving silhouettes.", source "[O] 5x5 or 7x7";
        blur: u32 = 3, 0..=8, "pixels", "Radius of the blur of distrust after its maximum.",
            higher "Softer borders.", lower "Visible borders.", source "[O]";
        floor: f32 = 0.0, 0.0..=1.0, "share of stage 4", "Least share of the prefiltered image in the output.",
            higher "Smoother everywhere.", lower "Trusted pixels keep the temporal value.", source "[O]";
        feedback_floor: f32 = 0.1, 0.0..=1.0, "share of stage 4",
            "Least share of the prefiltered image in what `pipeline.feedback = blend` feeds back.",
            higher "Less noise, wider steady blur.", lower "More detail, more noise.", source "[O] 0.1";
    }
    /// Stage 6.
    firefly: Firefly {
        enabled: bool = true, (), "", "Switch of the stage.",
            higher "On.", lower "Fireflies pass.", source "[S] 3x3 median";
        median: Median = Median::Channel, (), "", "What the median chooses.",
            higher "`luminance` keeps hue.", lower "`channel` shifts it a little.", source "[E] per channel";
        threshold: f32 = 2.0, 1.0..=100.0, "of the median",
            "A value is replaced only where it exceeds the median by this factor.",
            higher "Only extremes go; energy and detail stay.",
            lower "1: every value above it. A plain median, which also lifts dark pixels, is `plain`.",
            source "ours: the plain median keeps 0.98 of sparse light's energy, this all of it";
        plain: bool = false, (), "", "Every value becomes the median, as in the engine.",
            higher "Smoother, loses 2 % of sparse light and fine detail.", lower "Only fireflies are replaced.",
            source "[E] plain; ours off";
        input: FireflyInput = FireflyInput::Disocclusion, (), "", "What the median reads.",
            higher "`disocclusion`.", lower "`temporal` ignores stages 4 and 5.", source "[I]";
    }
    /// Stage 7.
    matte_bilateral: MatteBilateral {
        enabled: bool = true, (), "", "Switch of the stage.",
            higher "On.", lower "The ablation without spatial filters (with stages 4, 9 and 10).", source "[S]";
        taps: u32 = 24, 1..=64, "", "Taps of the spiral.",
            higher "Smoother, slower.", lower "Grainier, faster.", source "[O]";
        radius: f32 = 32.0, 0.0..=256.0, "pixels at 720 rows", "Radius of the spiral.",
            higher "Smoother, flatter.", lower "Noisier, sharper.", source "[O]";
        sigma: f32 = 0.5, 0.05..=10.0, "of the radius", "Gaussian over the spiral.",
            higher "Wider.", lower "Narrower.", source "[O] 1/2 or 1/3";
        turns: u32 = 0, 0..=63, "", "Turns of the spiral; 0: the best known for the number of taps.",
            higher "Another arrangement of the taps.", lower "Another arrangement of the taps.", source "[E]";
        rotate: bool = true, (), "", "The pattern changes from frame to frame.",
            higher "Flickers where taps are few.", lower "The pattern stands still, and may show.", source "[O]";
        off_screen: OffScreen = OffScreen::Skip, (), "", "Taps beyond the image's edge.",
            higher "`mirror`: as many taps at the edge as inside.", lower "`skip`: fewer.", source "[O]";
    }
    /// Stage 8.
    glossy_temporal: GlossyTemporal {
        enabled: bool = true, (), "", "Switch of the stage.",
            higher "On.", lower "The ablation without temporal filters.", source "[S]";
        virtual_reprojection: bool = true, (), "", "History is fetched where the reflected image was, not the surface.",
            higher "On.", lower "The ablation without virtual glossy reprojection: reflections smear.", source "[S]";
        alpha: f32 = 0.9, 0.0..=0.999, "share of history", "Most that history may count.",
            higher "Less noise, more smear: every fetch blurs a little.", lower "Quicker, noisier.", source "[O] 0.9, 0.95, 0.98: by measurement, `docs/paper.md`";
        ramp: bool = true, (), "", "History of N frames counts at most N / (N + 1).",
            higher "Quick start.", lower "As in the paper.", source "ours, named departure";
        clip: Clip = Clip::Sigma, (), "", "Clamp of history to the current signal's neighbourhood.",
            higher "Less ghosting of reflections; a small `box` loses energy where light is sparse.", lower "Reflections lag.",
            source "[S] on in the final images; the kind is ours by measurement, `docs/paper.md`";
        clip_radius: u32 = 4, 1..=4, "pixels", "Radius of the clamp's window.",
            higher "Looser clamp.", lower "Tighter clamp, more noise; below 4, sparse light loses energy.",
            source "[S] 2 in the final images; ours 4";
        clip_gamma: f32 = 1.5, 0.0..=16.0, "standard deviations", "Width of the clamp where `clip` is `sigma`.",
            higher "Looser clamp.", lower "Tighter clamp.", source "[O]";
        hit_filter: HitFilter = HitFilter::Min, (), "", "Filter of the hit distance over 3x3 before use.",
            higher "`min` and `median` keep the virtual point from jittering.", lower "`off`.", source "[I]";
        mirror_roughness: f32 = 0.0, 0.0..=1.0, "perceptual roughness",
            "Below it a surface is a mirror: its hit distances are taken as they are, without `hit_filter`, and `hit_tolerance` acts.",
            higher "Rough reflections, whose hit distances are noisy, lose history.", lower "0: no surface is a mirror; reflected silhouettes lag.",
            source "ours";
        hit_tolerance: f32 = 0.08, 0.0..=10.0, "of the distance",
            "On mirrors trust falls where the previous pixel's reflected ray ended nearer or farther than the reflected point by this; at `surface.falloff` times it nothing is left. Never under `surface.pixel_distance`.",
            higher "What came into view in the mirror takes light from what hid it.", lower "Slanting surfaces in mirrors lose history.",
            source "ours; a match of hit distances as part of a confidence: Zhdan, GDC 2020 (talk)";
        spline_roughness: f32 = 0.0, 0.0..=1.0, "perceptual roughness",
            "Below it history is fetched by Catmull and Rom's spline, from 4x4 pixels, where all four around the place show the reflector. Needs `clip`.",
            higher "Rougher reflections stay sharp as well, and cost more.", lower "0: always from 2x2 pixels: every fetch blurs what polished surfaces show.",
            source "Catmull and Rom 1974; for history: Karis, SIGGRAPH 2014";
        curvature: bool = true, (), "", "On curved reflectors history is fetched where the previous surface reflected the same point.",
            higher "Curved mirrors keep their images.", lower "As in the paper: every reflector counts as plane, images in curved ones smear.",
            source "ours, named departure: `docs/paper.md`";
        max_hit_distance: f32 = 1000.0, 0.0..=1e6, "of view depth", "Hit distances beyond it count as it.",
            higher "Distant reflections move by rotation only.", lower "They move with the surface.", source "[E] 1000 units";
        reflector_normal_min: f32 = 0.9, -1.0..=1.0, "cosine", "Least cosine between normals for taps to lie on the same reflector.",
            higher "Curved mirrors lose history.", lower "Reflections cross creases.", source "[O]";
        reflector_roughness: f32 = 0.1, 0.0..=1.0, "perceptual roughness", "Most by which the roughness of taps on the same reflector may differ.",
            higher "Reflections cross changes of gloss.", lower "Textured gloss loses history.", source "[O]";
    }
    /// Stages 9 and 10.
    glossy_bilateral: GlossyBilateral {
        enabled: bool = true, (), "", "Switch of both passes.",
            higher "On.", lower "The ablation without spatial filters (with stages 4 and 7).", source "[S]";
        radius: GlossyRadius = GlossyRadius::Footprint, (), "", "How the kernel is sized.",
            higher "`footprint` keeps mirrors sharp.", lower "`constant` blurs every gloss alike.", source "[O]; [E] constant";
        curvature: bool = true, (), "", "The footprint shrinks where the surface bends along the axis.",
            higher "Curved glossy surfaces keep their reflections.", lower "They are blurred like plane ones.",
            source "ours, named departure: `docs/paper.md`";
        max_radius: f32 = 12.0, 0.0..=64.0, "pixels at 720 rows", "Largest radius.",
            higher "Smoother rough reflections.", lower "Noisier ones.", source "[O] 12";
        min_radius: f32 = 0.5, 0.0..=8.0, "pixels", "Below it nothing is filtered.",
            higher "Sharper near-mirrors.", lower "Softer ones.", source "[O] 0.5";
        step: f32 = 2.0, 0.5..=8.0, "pixels at 720 rows", "Distance between taps.",
            higher "Faster, coarser.", lower "Slower for the same radius.", source "[E] 2";
        sigma: f32 = 0.75, 0.05..=10.0, "of the radius", "Gaussian over the kernel.",
            higher "Wider.", lower "Narrower.", source "[E] 3 taps for R <= 4";
        constant_radius: f32 = 8.0, 0.0..=64.0, "pixels at 720 rows", "Radius where `radius` is `constant`.",
            higher "Smoother.", lower "Sharper.", source "[E] 4 taps of 2 pixels";
    }
    /// Stage 11.
    direct_taa: DirectTaa {
        enabled: bool = true, (), "", "Switch of the stage. It acts only on frames with jitter.",
            higher "On.", lower "Jittered edges crawl.", source "[S]";
        history: f32 = 0.6, 0.0..=0.99, "share of history", "Most that history may count.",
            higher "Smoother edges.", lower "Crisper, more aliasing.", source "[E] 0.6";
        motion_falloff: f32 = 8.0, 0.1..=1000.0, "pixels at 720 rows", "Motion at which history counts nothing.",
            higher "Blur in motion.", lower "Aliasing in motion.", source "[E] falls with motion; [O] how fast";
        clamp_falloff: f32 = 1.0, 0.0..=100.0, "per relative change", "Fall of history's share with the amount that the clamp changed.",
            higher "Less ghosting.", lower "Smoother edges.", source "[E] falls with the amount clamped; [O] how fast";
    }
    /// Temporal anti-aliasing of the picture, indirect light included.
    antialiasing: Antialiasing {
        enabled: bool = false, (), "", "Switch of the stage. It acts only on frames with jitter, and takes the place of stage 11.",
            higher "The whole picture is anti-aliased.", lower "Its direct light alone (stage 11), as in the paper.",
            source "temporal anti-aliasing: Karis, SIGGRAPH 2014 (course); of the picture after denoising: SVGF";
        least: f32 = 0.08, 0.01..=1.0, "share of the new frame", "Least that the new frame counts, where nothing moves.",
            higher "Quicker, more shimmer.", lower "Smoother.", source "[O], fitted: `docs/quality.md`";
        resampling: f32 = 0.6, 0.0..=1.0, "share of the new frame", "What is added to `least` where history is fetched half way between pixels on both axes.",
            higher "Sharper in motion.", lower "Smoother and more blurred in motion: every fetch between pixels blurs.", source "ours";
        gamma: f32 = 1.5, 0.0..=16.0, "standard deviations", "History is held to the mean of 3x3 pixels plus and minus so many.",
            higher "Thin things keep more history; more ghosting.", lower "Less ghosting, more shimmer.",
            source "mean and deviation: Salvi, GDC 2016 (talk), who clips towards the mean; here each channel of YCoCg is clamped";
        change_falloff: f32 = 40.0, 0.0..=1000.0, "per relative change", "Frames of history are divided by 1 plus this times the share of its luminance that the clamp changed.",
            higher "Light that moves lags less.", lower "Smoother.", source "ours";
        thin_radius: u32 = 3, 0..=3, "pixels", "History may also show the colours of what is nearer, within so many pixels; 0: not.",
            higher "Wires that the samples of a frame miss stay whole.", lower "They become rows of dots; less work.", source "ours";
        thin_depth: f32 = 0.4, 0.001..=1.0, "of the depth", "By so much must it be nearer than the farthest surface of 3x3 pixels.",
            higher "Only what stands far before its background.", lower "Floors count, too, and light that moves over them lags.", source "ours";
        thin_motion: f32 = 0.5, 0.0..=16.0, "pixels", "Its motion may differ by so much from that which history is fetched by.",
            higher "What moves leaves copies behind.", lower "Only what moves exactly alike.", source "ours";
    }
}

impl GlossyTemporal {
    /// Whether hit distances are compared with those of the frame before.
    pub(crate) fn compares_hits(&self) -> bool {
        self.virtual_reprojection && self.mirror_roughness > 0.0
    }

    /// The roughness below which history is fetched by a spline.
    pub(crate) fn spline_below(&self) -> f32 {
        if self.clip == Clip::Off { 0.0 } else { self.spline_roughness }
    }
}

impl Settings {
    /// The values of a preset.
    pub fn preset(preset: Preset) -> Self {
        match preset {
            Preset::Paper => Self::default(),
            Preset::Quality => Self::quality(),
        }
    }

    /// The preset `quality`: what each value is measured to do stands in `docs/quality.md`.
    fn quality() -> Self {
        Self {
            pipeline: Pipeline { feedback: Feedback::Temporal },
            young_filter: YoungFilter {
                matte: true,
                glossy: true,
                frames: 64.0,
                falloff: 0.4,
                matte_levels: 4,
                glossy_levels: 2,
                wide_frames: 12.0,
                matte_stays: true,
                lobe: 0.1,
                least_lobe: 0.005,
                deviations: 4.5,
                matte_contrast: 8.0,
                glossy_contrast: 6.0,
                further_contrast: 0.5,
                contact_noise: 4.0,
                isolated: 1.5,
            },
            surface: SurfaceSettings { lost_footprint: 0.5, ..SurfaceSettings::default() },
            changed_light: ChangedLight { matte: true, glossy: true, fast: 0.3, ..ChangedLight::default() },
            // Blades and wires find neighbours of their own surface; contact shadows stay.
            edge: Edge { plane: 0.3, contact: 0.5, ..Edge::default() },
            glossy_temporal: GlossyTemporal {
                alpha: 0.85,
                mirror_roughness: 0.03,
                hit_tolerance: 0.02,
                spline_roughness: 0.2,
                ..GlossyTemporal::default()
            },
            // What is young is filtered already; mature light stays sharp.
            matte_prefilter: MattePrefilter { enabled: false, ..MattePrefilter::default() },
            disocclusion: Disocclusion { enabled: false, ..Disocclusion::default() },
            // Its input is smooth already.
            matte_bilateral: MatteBilateral { taps: 16, ..MatteBilateral::default() },
            antialiasing: Antialiasing { enabled: true, ..Antialiasing::default() },
            ..Self::default()
        }
    }

    /// Every spatial filter off: the talk's ablation "without spatial filters".
    #[must_use]
    pub fn without_spatial_filters(mut self) -> Self {
        self.young_filter.matte = false;
        self.young_filter.glossy = false;
        self.matte_prefilter.enabled = false;
        self.matte_bilateral.enabled = false;
        self.glossy_bilateral.enabled = false;
        self
    }

    /// Every temporal filter off: the talk's ablation "without temporal filters".
    #[must_use]
    pub fn without_temporal_filters(mut self) -> Self {
        self.matte_temporal.enabled = false;
        self.glossy_temporal.enabled = false;
        self.direct_taa.enabled = false;
        self.antialiasing.enabled = false;
        self
    }

    /// Every stage but the composite off: output equals input.
    #[must_use]
    pub fn without_denoising(self) -> Self {
        let mut off = self.without_spatial_filters().without_temporal_filters();
        off.disocclusion.enabled = false;
        off.firefly.enabled = false;
        off
    }
}

/// The settings with one part of the system switched off.
#[derive(Clone, Copy, Debug)]
pub struct Ablation {
    /// As in `quell:paper+no-virtual`.
    pub name: &'static str,
    /// As on a page.
    pub title: &'static str,
    /// Switches the part off.
    pub apply: fn(Settings) -> Settings,
}

/// The talk's ablations, and the one of stage 6.
pub const ABLATIONS: &[Ablation] = &[
    Ablation { name: "no-denoising", title: "Without denoising", apply: Settings::without_denoising },
    Ablation { name: "no-spatial", title: "Without spatial filters", apply: Settings::without_spatial_filters },
    Ablation { name: "no-temporal", title: "Without temporal filters", apply: Settings::without_temporal_filters },
    Ablation {
        name: "no-disocclusion",
        title: "Without disocclusion detection",
        apply: |mut s| {
            s.disocclusion.enabled = false;
            s
        },
    },
    Ablation {
        name: "no-firefly",
        title: "Without firefly suppression",
        apply: |mut s| {
            s.firefly.enabled = false;
            s
        },
    },
    Ablation {
        name: "no-virtual",
        title: "Without virtual reprojection",
        apply: |mut s| {
            s.glossy_temporal.virtual_reprojection = false;
            s
        },
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_round_trips_and_is_documented() {
        let mut names = std::collections::HashSet::new();
        for p in PARAMETERS {
            assert!(names.insert(p.name), "{} twice", p.name);
            for text in [p.doc, p.higher, p.lower, p.source] {
                assert!(!text.is_empty(), "{}", p.name);
            }
            let mut settings = Settings::default();
            let default = settings.get(p.name).unwrap();
            settings.set(p.name, &default).unwrap();
            assert_eq!(settings, Settings::default(), "{}", p.name);
            let kind_fits = match p.kind() {
                Kind::Number(a, b) => p.range() == format!("a number from {a} to {b}"),
                Kind::Whole(a, b) => p.range() == format!("a whole number from {a} to {b}"),
                Kind::Switch => p.range() == "on or off",
                Kind::Choice(names) => p.samples() == names,
            };
            assert!(kind_fits, "{}", p.name);
            for sample in p.samples() {
                settings.set(p.name, &sample).unwrap();
                assert_eq!(settings.get(p.name).unwrap(), sample, "{}", p.name);
            }
            assert!(settings.set(p.name, "no such value").is_err());
        }
        Settings::default().check().unwrap();
    }

    #[test]
    fn unknown_names_offer_the_nearest() {
        let error = Settings::default().set("matte_temporal.alhpa", "0.5").unwrap_err();
        assert!(error.to_string().contains("matte_temporal.alpha"), "{error}");
        let error = Settings::default().set("taps", "5").unwrap_err();
        assert!(error.to_string().contains("matte_prefilter.taps"), "{error}");
        let error = Settings::default().set("matte_temporal.alpha", "7").unwrap_err();
        assert!(error.to_string().contains("from 0 to 0.999"), "{error}");
    }
}
