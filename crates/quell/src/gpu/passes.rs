//! Every pass: its entry point, what it binds, its pieces of WGSL.

use super::pass::{Binding, BindingKind, Pass, Sample};
use super::repairs::COUNTS;
use super::storage::Texel;
use crate::pipeline::Stage;

const fn read(name: &'static str, texel: Texel) -> Binding {
    Binding { name, kind: BindingKind::Sampled(texel) }
}
const fn colour(name: &'static str) -> Binding {
    read(name, Texel::Colour)
}
const fn number(name: &'static str) -> Binding {
    read(name, Texel::Number)
}
const fn written(name: &'static str) -> Binding {
    Binding { name, kind: BindingKind::Stored(Texel::Colour) }
}
const fn counted(name: &'static str) -> Binding {
    Binding { name, kind: BindingKind::Stored(Texel::Number) }
}

const GEOMETRY: Binding = read("geometry", Texel::Geometry);
const SURFACE: Binding = read("surface", Texel::Surface);
const MOVING: Binding = read("moving", Texel::Moving);
const GEOMETRY_BEFORE: Binding = read("geometry_before", Texel::Geometry);
const SURFACE_BEFORE: Binding = read("surface_before", Texel::Surface);
const MOVING_BEFORE: Binding = read("moving_before", Texel::Moving);

const GUIDES: &str = include_str!("guides/depth.wgsl");
const GUIDES_SURFACE: &str = include_str!("guides/surface.wgsl");
const GUIDES_MOVING: &str = include_str!("guides/moving.wgsl");
const GUIDES_BEFORE: &str = include_str!("guides/before.wgsl");
const HIT_BEFORE: &str = include_str!("guides/hit_before.wgsl");
const MATH: &str = include_str!("../kernels/math.wgsl");
const EDGE: &str = include_str!("../kernels/edge.wgsl");
const SPIRAL: &str = include_str!("../kernels/spiral.wgsl");
const CLIP: &str = include_str!("../kernels/clip.wgsl");
const REPROJECT: &str = include_str!("../kernels/reproject.wgsl");
const BESIDE: &str = include_str!("../kernels/beside.wgsl");
const CHANGE: &str = include_str!("../kernels/change.wgsl");
const TEMPORAL: &str = include_str!("../kernels/temporal.wgsl");
const MIRROR_IMAGE: &str = include_str!("../kernels/mirror_image.wgsl");
const MATTE_TEMPORAL: &str = include_str!("../stages/matte_temporal/shader.wgsl");
const GLOSSY_TEMPORAL: &str = include_str!("../stages/glossy_temporal/shader.wgsl");
const DISOCCLUSION: &str = include_str!("../stages/disocclusion/shader.wgsl");
const FIREFLY: &str = include_str!("../stages/firefly/shader.wgsl");
const ACCUMULATED: &str = include_str!("passes/accumulated.wgsl");
const TEMPORAL_JOINT: &str = include_str!("../kernels/temporal_joint.wgsl");
const DISTRUST: &str = include_str!("passes/distrust.wgsl");

const SPARSE_BILATERAL: &[&str] = &[
    GUIDES,
    GUIDES_SURFACE,
    MATH,
    EDGE,
    SPIRAL,
    include_str!("../stages/matte_prefilter/shader.wgsl"),
    include_str!("passes/sparse_bilateral.wgsl"),
];
const SPARSE_BINDINGS: &[Binding] =
    &[GEOMETRY, SURFACE, Binding { name: "spiral", kind: BindingKind::Taps }, colour("input"), written("output")];
const GLOSSY_BILATERAL: &[&str] = &[
    GUIDES,
    GUIDES_SURFACE,
    GUIDES_MOVING,
    MATH,
    EDGE,
    include_str!("../stages/glossy_bilateral/shader.wgsl"),
    include_str!("passes/glossy_bilateral.wgsl"),
];
const YOUNG_BINDINGS: &[Binding] =
    &[GEOMETRY, SURFACE, colour("input"), number("history_length"), colour("accumulated"), written("output")];
const YOUNG_JOINT_BINDINGS: &[Binding] =
    &[GEOMETRY, SURFACE, colour("input"), number("history_length"), colour("pass_input"), written("output")];
const YOUNG: &[&str] = &[
    GUIDES,
    GUIDES_SURFACE,
    MATH,
    EDGE,
    BESIDE,
    include_str!("../stages/young_filter/shader.wgsl"),
    include_str!("passes/young_filter.wgsl"),
];
const YOUNG_JOINT: &[&str] = &[
    GUIDES,
    GUIDES_SURFACE,
    MATH,
    EDGE,
    BESIDE,
    include_str!("../stages/young_filter/shader.wgsl"),
    include_str!("passes/young_filter_joint.wgsl"),
];
/// The same of a plane that is tied to a signal.
const fn young_joint(stage: Stage, name: &'static str) -> Pass {
    Pass { bindings: YOUNG_JOINT_BINDINGS, pieces: YOUNG_JOINT, ..young(stage, name) }
}
/// A level of the filter of young history; its entry point has its name.
const fn young(stage: Stage, name: &'static str) -> Pass {
    let stages: &[Stage] = match stage {
        Stage::MatteYoung3 => &[Stage::MatteYoung3],
        Stage::MatteYoung9 => &[Stage::MatteYoung9],
        Stage::MatteYoung27 => &[Stage::MatteYoung27],
        Stage::GlossyYoung1 => &[Stage::GlossyYoung1],
        Stage::GlossyYoung3 => &[Stage::GlossyYoung3],
        Stage::GlossyYoung9 => &[Stage::GlossyYoung9],
        _ => &[Stage::MatteYoung1],
    };
    Pass { name, stages, per_frame: true, entry: name, bindings: YOUNG_BINDINGS, pieces: YOUNG }
}
const GLOSSY_BINDINGS: &[Binding] = &[GEOMETRY, SURFACE, MOVING, colour("input"), written("output")];
const TEMPORAL_BINDINGS: &[Binding] = &[
    GEOMETRY,
    SURFACE,
    MOVING,
    GEOMETRY_BEFORE,
    SURFACE_BEFORE,
    colour("current"),
    colour("history"),
    number("history_length"),
    written("output"),
    counted("new_length"),
];
const GLOSSY_TEMPORAL_BINDINGS: &[Binding] = &[
    GEOMETRY,
    SURFACE,
    MOVING,
    GEOMETRY_BEFORE,
    SURFACE_BEFORE,
    MOVING_BEFORE,
    colour("current"),
    colour("history"),
    number("history_length"),
    written("output"),
    counted("new_length"),
];

/// A plane that is tied to a signal, beside that signal's own images.
const TEMPORAL_JOINT_BINDINGS: &[Binding] = &[
    GEOMETRY,
    SURFACE,
    MOVING,
    GEOMETRY_BEFORE,
    SURFACE_BEFORE,
    colour("current"),
    colour("history"),
    number("history_length"),
    colour("pass_current"),
    colour("pass_history"),
    written("output"),
];
const GLOSSY_TEMPORAL_JOINT_BINDINGS: &[Binding] = &[
    GEOMETRY,
    SURFACE,
    MOVING,
    GEOMETRY_BEFORE,
    SURFACE_BEFORE,
    MOVING_BEFORE,
    colour("current"),
    colour("history"),
    number("history_length"),
    colour("pass_current"),
    colour("pass_history"),
    written("output"),
];

const BORDER: &str = include_str!("passes/prepare.wgsl");
const REPAIRS: Binding = Binding { name: "repairs", kind: BindingKind::Counts(COUNTS as u32) };
const fn host(name: &'static str, sample: Sample) -> Binding {
    Binding { name, kind: BindingKind::Host(sample) }
}
const fn guide(name: &'static str, texel: Texel) -> Binding {
    Binding { name, kind: BindingKind::Stored(texel) }
}

impl Pass {
    /// The border: makes the guides of every stage from the host's textures, whichever there are, and counts what it
    /// repairs ([`super::Repairs`]).
    pub const PREPARE: Self = Self {
        name: "prepare",
        stages: &[],
        per_frame: true,
        entry: "prepare_guides",
        bindings: &[
            Binding { name: "prepare", kind: BindingKind::Uniform("Prepare") },
            REPAIRS,
            host("depth_texture", Sample::Depth),
            host("view_depth_texture", Sample::Float),
            host("normal_texture", Sample::Float),
            host("motion_texture", Sample::Float),
            host("roughness_texture", Sample::Float),
            host("glossy_hit_texture", Sample::Float),
            host("id_texture", Sample::Uint),
            host("confidence_texture", Sample::Float),
            guide("geometry_out", Texel::Geometry),
            guide("surface_out", Texel::Surface),
            guide("moving_out", Texel::Moving),
        ],
        pieces: &[include_str!("guides/store.wgsl"), BORDER, include_str!("passes/prepare_guides.wgsl")],
    };
    /// Counts what stages repair as they load the host's colours.
    pub const COUNT_REPAIRS: Self = Self {
        name: "count_repairs",
        stages: &[],
        per_frame: true,
        entry: "count_colours",
        bindings: &[
            REPAIRS,
            colour("direct"),
            colour("matte"),
            colour("glossy"),
            colour("direct_matte"),
            colour("direct_glossy"),
            colour("matte_weight"),
            colour("glossy_weight"),
        ],
        pieces: &[BORDER, include_str!("passes/count_colours.wgsl")],
    };
    /// Stage 3. The caller may bind anything as history where the frame says that there is none.
    pub const MATTE_TEMPORAL: Self = Self {
        name: "matte_temporal",
        stages: &[Stage::MatteTemporal],
        per_frame: true,
        entry: "accumulate_matte",
        bindings: TEMPORAL_BINDINGS,
        pieces: &[
            GUIDES,
            GUIDES_SURFACE,
            GUIDES_MOVING,
            GUIDES_BEFORE,
            MATH,
            CLIP,
            REPROJECT,
            BESIDE,
            CHANGE,
            TEMPORAL,
            MATTE_TEMPORAL,
            ACCUMULATED,
            include_str!("passes/matte_temporal.wgsl"),
        ],
    };
    /// Level 0 of the filter of young history, matte signal.
    pub const MATTE_YOUNG_1: Self = young(Stage::MatteYoung1, "matte_young_1");
    /// Level 1 of the filter of young history, matte signal.
    pub const MATTE_YOUNG_3: Self = young(Stage::MatteYoung3, "matte_young_3");
    /// Level 2 of the filter of young history, matte signal.
    pub const MATTE_YOUNG_9: Self = young(Stage::MatteYoung9, "matte_young_9");
    /// Level 3 of the filter of young history, matte signal.
    pub const MATTE_YOUNG_27: Self = young(Stage::MatteYoung27, "matte_young_27");
    /// Level 0 of the filter of young history, glossy signal.
    pub const GLOSSY_YOUNG_1: Self = young(Stage::GlossyYoung1, "glossy_young_1");
    /// Level 1 of the filter of young history, glossy signal.
    pub const GLOSSY_YOUNG_3: Self = young(Stage::GlossyYoung3, "glossy_young_3");
    /// Level 2 of the filter of young history, glossy signal.
    pub const GLOSSY_YOUNG_9: Self = young(Stage::GlossyYoung9, "glossy_young_9");
    /// Stage 4.
    pub const MATTE_PREFILTER: Self = Self {
        name: "matte_prefilter",
        stages: &[Stage::MattePrefilter],
        per_frame: true,
        entry: "matte_prefilter",
        bindings: SPARSE_BINDINGS,
        pieces: SPARSE_BILATERAL,
    };
    /// Stage 5.
    pub const DISOCCLUSION: Self = Self {
        name: "disocclusion",
        stages: &[Stage::Disocclusion],
        per_frame: true,
        entry: "blend",
        bindings: &[colour("temporal"), colour("prefiltered"), written("blended"), written("floored")],
        pieces: &[MATH, DISOCCLUSION, DISTRUST, include_str!("passes/disocclusion.wgsl")],
    };
    /// Stage 6.
    pub const FIREFLY: Self = Self {
        name: "firefly",
        stages: &[Stage::Firefly],
        per_frame: true,
        entry: "suppress",
        bindings: &[GEOMETRY, colour("input"), written("output")],
        pieces: &[GUIDES, MATH, FIREFLY, include_str!("passes/firefly.wgsl")],
    };
    /// Stage 7: stage 4's filter with its own pattern.
    pub const MATTE_BILATERAL: Self = Self {
        name: "matte_bilateral",
        stages: &[Stage::MatteBilateral],
        per_frame: true,
        entry: "matte_bilateral",
        bindings: SPARSE_BINDINGS,
        pieces: SPARSE_BILATERAL,
    };
    /// Stage 8.
    pub const GLOSSY_TEMPORAL: Self = Self {
        name: "glossy_temporal",
        stages: &[Stage::GlossyTemporal],
        per_frame: true,
        entry: "accumulate_glossy",
        bindings: GLOSSY_TEMPORAL_BINDINGS,
        pieces: &[
            GUIDES,
            GUIDES_SURFACE,
            GUIDES_MOVING,
            GUIDES_BEFORE,
            MATH,
            CLIP,
            REPROJECT,
            HIT_BEFORE,
            MIRROR_IMAGE,
            BESIDE,
            CHANGE,
            TEMPORAL,
            GLOSSY_TEMPORAL,
            ACCUMULATED,
            include_str!("passes/glossy_temporal.wgsl"),
        ],
    };
    /// Stage 9.
    pub const GLOSSY_HORIZONTAL: Self = Self {
        name: "glossy_bilateral_h",
        stages: &[Stage::GlossyHorizontal],
        per_frame: true,
        entry: "horizontal",
        bindings: GLOSSY_BINDINGS,
        pieces: GLOSSY_BILATERAL,
    };
    /// Stage 10.
    pub const GLOSSY_VERTICAL: Self = Self {
        name: "glossy_bilateral_v",
        stages: &[Stage::GlossyVertical],
        per_frame: true,
        entry: "vertical",
        bindings: GLOSSY_BINDINGS,
        pieces: GLOSSY_BILATERAL,
    };
    /// Stage 11.
    pub const DIRECT_TAA: Self = Self {
        name: "direct_taa",
        stages: &[Stage::DirectTaa],
        per_frame: true,
        entry: "antialias",
        bindings: &[GEOMETRY, MOVING, colour("input"), colour("history"), written("output")],
        pieces: &[
            GUIDES,
            GUIDES_MOVING,
            MATH,
            CLIP,
            include_str!("../stages/direct_taa/shader.wgsl"),
            include_str!("passes/direct_taa.wgsl"),
        ],
    };
    /// The sum.
    pub const COMPOSITE: Self = Self {
        name: "composite",
        stages: &[Stage::Composite],
        per_frame: true,
        entry: "composite",
        bindings: &[
            colour("direct"),
            colour("matte"),
            colour("glossy"),
            colour("direct_matte"),
            colour("direct_glossy"),
            colour("matte_weight"),
            colour("glossy_weight"),
            written("output"),
        ],
        pieces: &[include_str!("../stages/composite/shader.wgsl"), include_str!("passes/composite.wgsl")],
    };
    /// Temporal anti-aliasing of the sum.
    pub const ANTIALIASING: Self = Self {
        name: "antialiasing",
        stages: &[Stage::Antialiasing],
        per_frame: true,
        entry: "antialias",
        bindings: &[GEOMETRY, MOVING, colour("input"), colour("history"), written("kept"), written("output")],
        pieces: &[
            GUIDES,
            GUIDES_MOVING,
            MATH,
            CLIP,
            include_str!("../stages/antialiasing/shader.wgsl"),
            include_str!("passes/antialiasing.wgsl"),
        ],
    };
    /// Stages 3 and 8: both read the same guides.
    pub const TEMPORAL: Self = Self {
        name: "matte_temporal+glossy_temporal",
        stages: &[Stage::MatteTemporal, Stage::GlossyTemporal],
        per_frame: true,
        entry: "accumulate_both",
        bindings: &[
            GEOMETRY,
            SURFACE,
            MOVING,
            GEOMETRY_BEFORE,
            SURFACE_BEFORE,
            MOVING_BEFORE,
            colour("matte_current"),
            colour("matte_history"),
            number("matte_history_length"),
            written("matte_output"),
            counted("matte_length"),
            colour("glossy_current"),
            colour("glossy_history"),
            number("glossy_history_length"),
            written("glossy_output"),
            counted("glossy_length"),
        ],
        pieces: &[
            GUIDES,
            GUIDES_SURFACE,
            GUIDES_MOVING,
            GUIDES_BEFORE,
            MATH,
            CLIP,
            REPROJECT,
            HIT_BEFORE,
            MIRROR_IMAGE,
            BESIDE,
            CHANGE,
            TEMPORAL,
            MATTE_TEMPORAL,
            GLOSSY_TEMPORAL,
            ACCUMULATED,
            include_str!("passes/temporal.wgsl"),
        ],
    };
    /// Stages 5 and 6: what stage 5 shows never leaves workgroup memory.
    pub const DISOCCLUSION_FIREFLY: Self = Self {
        name: "disocclusion+firefly",
        stages: &[Stage::Disocclusion, Stage::Firefly],
        per_frame: true,
        entry: "blend_and_suppress",
        bindings: &[colour("temporal"), colour("prefiltered"), written("floored"), written("output")],
        pieces: &[MATH, DISOCCLUSION, FIREFLY, DISTRUST, include_str!("passes/disocclusion_firefly.wgsl")],
    };

    /// Stage 3 of a plane that is tied to the matte signal: the same lookup, share of history and clamp.
    pub const MATTE_TEMPORAL_JOINT: Self = Self {
        name: "matte_temporal_joint",
        stages: &[Stage::MatteTemporal],
        per_frame: true,
        entry: "accumulate_matte_joint",
        bindings: TEMPORAL_JOINT_BINDINGS,
        pieces: &[
            GUIDES,
            GUIDES_SURFACE,
            GUIDES_MOVING,
            GUIDES_BEFORE,
            MATH,
            CLIP,
            REPROJECT,
            BESIDE,
            CHANGE,
            TEMPORAL,
            TEMPORAL_JOINT,
            MATTE_TEMPORAL,
            ACCUMULATED,
            include_str!("passes/matte_temporal_joint.wgsl"),
        ],
    };
    /// Stage 6 of a plane that is tied to the matte signal: the same pixels.
    pub const FIREFLY_JOINT: Self = Self {
        name: "firefly_joint",
        stages: &[Stage::Firefly],
        per_frame: true,
        entry: "suppress_joint",
        bindings: &[GEOMETRY, colour("input"), colour("pass_input"), written("output")],
        pieces: &[GUIDES, MATH, FIREFLY, include_str!("passes/firefly_joint.wgsl")],
    };
    /// Stage 8 of a plane that is tied to the glossy signal.
    pub const GLOSSY_TEMPORAL_JOINT: Self = Self {
        name: "glossy_temporal_joint",
        stages: &[Stage::GlossyTemporal],
        per_frame: true,
        entry: "accumulate_glossy_joint",
        bindings: GLOSSY_TEMPORAL_JOINT_BINDINGS,
        pieces: &[
            GUIDES,
            GUIDES_SURFACE,
            GUIDES_MOVING,
            GUIDES_BEFORE,
            MATH,
            CLIP,
            REPROJECT,
            HIT_BEFORE,
            MIRROR_IMAGE,
            BESIDE,
            CHANGE,
            TEMPORAL,
            TEMPORAL_JOINT,
            GLOSSY_TEMPORAL,
            ACCUMULATED,
            include_str!("passes/glossy_temporal_joint.wgsl"),
        ],
    };

    /// Level 0 of the filter of young history for a plane that is tied to the matte signal.
    pub const MATTE_YOUNG_1_JOINT: Self = young_joint(Stage::MatteYoung1, "matte_young_1_joint");
    /// Level 1 of the filter of young history for a plane that is tied to the matte signal.
    pub const MATTE_YOUNG_3_JOINT: Self = young_joint(Stage::MatteYoung3, "matte_young_3_joint");
    /// Level 2 of the filter of young history for a plane that is tied to the matte signal.
    pub const MATTE_YOUNG_9_JOINT: Self = young_joint(Stage::MatteYoung9, "matte_young_9_joint");
    /// Level 3 of the filter of young history for a plane that is tied to the matte signal.
    pub const MATTE_YOUNG_27_JOINT: Self = young_joint(Stage::MatteYoung27, "matte_young_27_joint");
    /// Level 0 of the filter of young history for a plane that is tied to the glossy signal.
    pub const GLOSSY_YOUNG_1_JOINT: Self = young_joint(Stage::GlossyYoung1, "glossy_young_1_joint");
    /// Level 1 of the filter of young history for a plane that is tied to the glossy signal.
    pub const GLOSSY_YOUNG_3_JOINT: Self = young_joint(Stage::GlossyYoung3, "glossy_young_3_joint");
    /// Level 2 of the filter of young history for a plane that is tied to the glossy signal.
    pub const GLOSSY_YOUNG_9_JOINT: Self = young_joint(Stage::GlossyYoung9, "glossy_young_9_joint");

    /// One stage each, in the order of the pipeline.
    pub const SINGLE: [Self; 17] = [
        Self::MATTE_TEMPORAL,
        Self::MATTE_YOUNG_1,
        Self::MATTE_YOUNG_3,
        Self::MATTE_YOUNG_9,
        Self::MATTE_PREFILTER,
        Self::DISOCCLUSION,
        Self::FIREFLY,
        Self::MATTE_BILATERAL,
        Self::GLOSSY_TEMPORAL,
        Self::GLOSSY_YOUNG_1,
        Self::GLOSSY_YOUNG_3,
        Self::GLOSSY_YOUNG_9,
        Self::GLOSSY_HORIZONTAL,
        Self::GLOSSY_VERTICAL,
        Self::DIRECT_TAA,
        Self::COMPOSITE,
        Self::ANTIALIASING,
    ];
    /// Several stages each.
    pub const FUSED: [Self; 2] = [Self::TEMPORAL, Self::DISOCCLUSION_FIREFLY];

    /// What planes that are tied to a signal need instead of the signal's own pass; their other stages are the signal's.
    pub const JOINT: [Self; 9] = [
        Self::MATTE_TEMPORAL_JOINT,
        Self::MATTE_YOUNG_1_JOINT,
        Self::MATTE_YOUNG_3_JOINT,
        Self::MATTE_YOUNG_9_JOINT,
        Self::FIREFLY_JOINT,
        Self::GLOSSY_TEMPORAL_JOINT,
        Self::GLOSSY_YOUNG_1_JOINT,
        Self::GLOSSY_YOUNG_3_JOINT,
        Self::GLOSSY_YOUNG_9_JOINT,
    ];

    /// What comes before the stages.
    pub const BORDER: [Self; 2] = [Self::PREPARE, Self::COUNT_REPAIRS];

    /// All passes of both filters, and the debug views.
    pub fn all() -> impl Iterator<Item = Self> {
        let real_time = Self::BORDER.into_iter().chain(Self::SINGLE).chain(Self::FUSED).chain(Self::JOINT);
        real_time.chain(Self::SEQUENCE).chain(Self::RESIDUAL).chain(Self::FINISH).chain(Self::DEBUG)
    }

    /// The pass that runs one stage alone.
    pub const fn of(stage: Stage) -> Self {
        match stage {
            Stage::MatteTemporal => Self::MATTE_TEMPORAL,
            Stage::MatteYoung1 => Self::MATTE_YOUNG_1,
            Stage::MatteYoung3 => Self::MATTE_YOUNG_3,
            Stage::MatteYoung9 => Self::MATTE_YOUNG_9,
            Stage::MatteYoung27 => Self::MATTE_YOUNG_27,
            Stage::GlossyYoung1 => Self::GLOSSY_YOUNG_1,
            Stage::GlossyYoung3 => Self::GLOSSY_YOUNG_3,
            Stage::GlossyYoung9 => Self::GLOSSY_YOUNG_9,
            Stage::MattePrefilter => Self::MATTE_PREFILTER,
            Stage::Disocclusion => Self::DISOCCLUSION,
            Stage::Firefly => Self::FIREFLY,
            Stage::MatteBilateral => Self::MATTE_BILATERAL,
            Stage::GlossyTemporal => Self::GLOSSY_TEMPORAL,
            Stage::GlossyHorizontal => Self::GLOSSY_HORIZONTAL,
            Stage::GlossyVertical => Self::GLOSSY_VERTICAL,
            Stage::DirectTaa => Self::DIRECT_TAA,
            Stage::Composite => Self::COMPOSITE,
            Stage::Antialiasing => Self::ANTIALIASING,
        }
    }
}
