//! The sequence filter's passes: what each binds, and its pieces of WGSL.

use crate::gpu::pass::{Binding, BindingKind, Element, Pass};

pub(super) const fn settings(name: &'static str) -> Binding {
    Binding { name: "settings", kind: BindingKind::Uniform(name) }
}
pub(super) const fn frames(name: &'static str) -> Binding {
    Binding { name, kind: BindingKind::Frames }
}
pub(super) const fn read(name: &'static str) -> Binding {
    Binding { name, kind: BindingKind::Read(Element::Four) }
}
pub(super) const fn written(name: &'static str) -> Binding {
    Binding { name, kind: BindingKind::Write(Element::Four) }
}
const COMPARED: &str = "compared";

pub(super) const IMAGE: &str = include_str!("image.wgsl");
pub(super) const HAS: &str = include_str!("has.wgsl");
pub(super) const FRAMES: &str = include_str!("frames.wgsl");
const FEATURES: &str = include_str!("features.wgsl");
const MATH: &str = include_str!("../../kernels/math.wgsl");
const GUIDE_DISTANCE: &str = include_str!("../../kernels/guide_distance.wgsl");
const WAVELET: &str = include_str!("../../stages/wavelet/shader.wgsl");

/// Colour planes that one dispatch of stage 1 takes.
pub(super) const TOGETHER: usize = 4;

pub(super) const fn pass(
    name: &'static str,
    entry: &'static str,
    bindings: &'static [Binding],
    pieces: &'static [&'static str],
) -> Pass {
    Pass { name, stages: &[], per_frame: false, entry, bindings, pieces }
}

impl Pass {
    /// The sequence filter's feature buffers of a frame: slopes of the depth, noise.
    pub const FEATURE_NOISE: Self = pass(
        "feature_noise",
        "local_features",
        &[
            settings("FeatureSettings"),
            frames("surfaces"),
            frames("surface_normals"),
            frames("seen_colours"),
            frames("seen_normals"),
            written("geometry"),
            written("normals"),
            written("local_seen_colours"),
            written("local_seen_normals"),
        ],
        &[IMAGE, include_str!("../../stages/feature_noise/shader.wgsl"), include_str!("../passes/feature_noise.wgsl")],
    );

    /// Stage 1 of the sequence filter, four colour planes at a time.
    pub const GATHER: Self = pass(
        "gather",
        "gather_samples",
        &[
            settings("GatherSettings"),
            frames("surfaces"),
            frames("surface_normals"),
            frames("seen_colours"),
            frames("seen_normals"),
            frames("to_previous"),
            frames("to_next"),
            frames("reflection_to_previous"),
            frames("reflection_to_next"),
            frames("samples_0"),
            frames("samples_1"),
            frames("samples_2"),
            frames("samples_3"),
            frames("light_0"),
            frames("light_1"),
            frames("light_2"),
            frames("light_3"),
            Binding { name: "frames", kind: BindingKind::Read(Element::Struct("WindowFrame")) },
            written("mean_0"),
            written("mean_1"),
            written("mean_2"),
            written("mean_3"),
            written("counts"),
            Binding { name: "most", kind: BindingKind::Write(Element::One) },
        ],
        &[
            IMAGE,
            MATH,
            GUIDE_DISTANCE,
            HAS,
            FRAMES,
            include_str!("../../stages/gather/shader.wgsl"),
            include_str!("../passes/gather.wgsl"),
        ],
    );

    /// Stage 2 of the sequence filter, for one light.
    pub const VARIANCE: Self = pass(
        "variance",
        "variance",
        &[
            settings("LightSettings"),
            read("geometry"),
            read("normals"),
            read("feature_colours"),
            read("seen_normals"),
            read("light"),
            read("counts"),
            Binding { name: "given", kind: BindingKind::Read(Element::One) },
            written("pooled"),
        ],
        &[
            IMAGE,
            MATH,
            GUIDE_DISTANCE,
            FEATURES,
            include_str!("../../stages/variance/shader.wgsl"),
            include_str!("../passes/variance.wgsl"),
        ],
    );

    /// Stage 3 of the sequence filter: what the luminance stop compares at a level, for one light.
    pub const WAVELET_COMPARE: Self = pass(
        "wavelet_compare",
        "compare",
        &[
            settings("LightSettings"),
            read("geometry"),
            read("normals"),
            read("feature_colours"),
            read("seen_normals"),
            read("light"),
            Binding { name: COMPARED, kind: BindingKind::Write(Element::Four) },
        ],
        &[IMAGE, MATH, GUIDE_DISTANCE, FEATURES, WAVELET, include_str!("../passes/wavelet_compare.wgsl")],
    );

    /// Stage 3 of the sequence filter: a level of one colour plane.
    pub const WAVELET: Self = pass(
        "wavelet",
        "filter_level",
        &[
            settings("LightSettings"),
            read("geometry"),
            read("normals"),
            read("feature_colours"),
            read("seen_normals"),
            read("light"),
            Binding { name: COMPARED, kind: BindingKind::Read(Element::Four) },
            written("filtered"),
        ],
        &[IMAGE, MATH, GUIDE_DISTANCE, FEATURES, WAVELET, include_str!("../passes/wavelet.wgsl")],
    );

    /// All of the sequence filter, in order.
    pub const SEQUENCE: [Self; 5] =
        [Self::FEATURE_NOISE, Self::GATHER, Self::VARIANCE, Self::WAVELET_COMPARE, Self::WAVELET];
}
