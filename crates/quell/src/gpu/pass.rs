//! The passes: which pieces of WGSL make a shader, what it binds, which entry points run one after another.

/// How a pass uses a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It only reads.
    Read,
    /// It writes every pixel, and may read back what an earlier entry point of it wrote.
    Write,
}

/// A storage buffer of a pass. Its binding number is its place in the pass's list plus 2: 0 and 1 are the uniforms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Its name in WGSL.
    pub name: &'static str,
    /// How it is used.
    pub access: Access,
    /// Bytes of one element.
    pub stride: u64,
    /// It has an element for every pixel.
    pub is_plane: bool,
}

/// A pass: one or more dispatches over the whole image.
#[derive(Clone, Copy, Debug)]
pub struct Pass {
    /// The stage's name.
    pub name: &'static str,
    /// Entry points in the order in which they run.
    pub entries: &'static [&'static str],
    /// Storage buffers, from binding 2 on.
    pub bindings: &'static [Binding],
    pieces: &'static [&'static str],
}

/// Pixels along each side that one workgroup covers.
pub(super) const WORKGROUP: u32 = 8;
/// Binding of the first storage buffer.
pub(super) const FIRST_STORAGE: u32 = 2;

const fn plane(name: &'static str, access: Access, stride: u64) -> Binding {
    Binding { name, access, stride, is_plane: true }
}
const fn colour(name: &'static str) -> Binding {
    plane(name, Access::Read, 16)
}
const fn guides(name: &'static str) -> Binding {
    plane(name, Access::Read, 48)
}
const fn state(name: &'static str) -> Binding {
    plane(name, Access::Read, 8)
}
const fn written(name: &'static str) -> Binding {
    plane(name, Access::Write, 16)
}

const FRAME: &str = include_str!("frame.wgsl");
const SETTINGS: &str = include_str!("settings.wgsl");
const UNIFORMS: &str = include_str!("passes/uniforms.wgsl");
const GUIDES: &str = include_str!("guides.wgsl");
const MATH: &str = include_str!("../kernels/math.wgsl");
const EDGE: &str = include_str!("../kernels/edge.wgsl");
const SPIRAL: &str = include_str!("../kernels/spiral.wgsl");
const CLIP: &str = include_str!("../kernels/clip.wgsl");
const REPROJECT: &str = include_str!("../kernels/reproject.wgsl");
const TEMPORAL: &str = include_str!("../kernels/temporal.wgsl");
const MIRROR_IMAGE: &str = include_str!("../kernels/mirror_image.wgsl");
const TEMPORAL_PASS: &str = include_str!("passes/temporal.wgsl");

const SPARSE_BILATERAL: &[&str] = &[
    FRAME,
    SETTINGS,
    GUIDES,
    MATH,
    EDGE,
    SPIRAL,
    include_str!("../stages/matte_prefilter/shader.wgsl"),
    UNIFORMS,
    include_str!("passes/sparse_bilateral.wgsl"),
];
const SPARSE_BINDINGS: &[Binding] = &[
    guides("guides"),
    Binding { name: "spiral", access: Access::Read, stride: 16, is_plane: false },
    colour("input"),
    written("output"),
];
const GLOSSY_BILATERAL: &[&str] = &[
    FRAME,
    SETTINGS,
    GUIDES,
    MATH,
    EDGE,
    include_str!("../stages/glossy_bilateral/shader.wgsl"),
    UNIFORMS,
    include_str!("passes/glossy_bilateral.wgsl"),
];
const GLOSSY_BINDINGS: &[Binding] = &[guides("guides"), colour("input"), written("output")];
const TEMPORAL_BINDINGS: &[Binding] = &[
    guides("guides"),
    guides("guides_before"),
    colour("current"),
    colour("history"),
    state("history_state"),
    written("output"),
    plane("state", Access::Write, 8),
];

impl Pass {
    /// Stage 3. The caller may bind anything large enough as history where the frame says that there is none.
    pub const MATTE_TEMPORAL: Self = Self {
        name: "matte_temporal",
        entries: &["accumulate_matte"],
        bindings: TEMPORAL_BINDINGS,
        pieces: &[
            FRAME,
            SETTINGS,
            GUIDES,
            MATH,
            CLIP,
            REPROJECT,
            TEMPORAL,
            include_str!("../stages/matte_temporal/shader.wgsl"),
            UNIFORMS,
            TEMPORAL_PASS,
            include_str!("passes/matte_temporal.wgsl"),
        ],
    };
    /// Stage 4.
    pub const MATTE_PREFILTER: Self = Self {
        name: "matte_prefilter",
        entries: &["matte_prefilter"],
        bindings: SPARSE_BINDINGS,
        pieces: SPARSE_BILATERAL,
    };
    /// Stage 5. `widest` and `rows` are its own.
    pub const DISOCCLUSION: Self = Self {
        name: "disocclusion",
        entries: &["widen", "blur_rows", "blend"],
        bindings: &[
            state("state"),
            plane("widest", Access::Write, 4),
            plane("rows", Access::Write, 4),
            colour("temporal"),
            colour("prefiltered"),
            written("blended"),
            written("floored"),
        ],
        pieces: &[
            FRAME,
            SETTINGS,
            MATH,
            include_str!("../stages/disocclusion/shader.wgsl"),
            UNIFORMS,
            include_str!("passes/disocclusion.wgsl"),
        ],
    };
    /// Stage 6.
    pub const FIREFLY: Self = Self {
        name: "firefly",
        entries: &["suppress"],
        bindings: &[guides("guides"), colour("input"), written("output")],
        pieces: &[
            FRAME,
            SETTINGS,
            GUIDES,
            MATH,
            include_str!("../stages/firefly/shader.wgsl"),
            UNIFORMS,
            include_str!("passes/firefly.wgsl"),
        ],
    };
    /// Stage 7: stage 4's filter with its own pattern.
    pub const MATTE_BILATERAL: Self = Self {
        name: "matte_bilateral",
        entries: &["matte_bilateral"],
        bindings: SPARSE_BINDINGS,
        pieces: SPARSE_BILATERAL,
    };
    /// Stage 8, likewise.
    pub const GLOSSY_TEMPORAL: Self = Self {
        name: "glossy_temporal",
        entries: &["accumulate_glossy"],
        bindings: TEMPORAL_BINDINGS,
        pieces: &[
            FRAME,
            SETTINGS,
            GUIDES,
            MATH,
            CLIP,
            REPROJECT,
            MIRROR_IMAGE,
            TEMPORAL,
            include_str!("../stages/glossy_temporal/shader.wgsl"),
            UNIFORMS,
            TEMPORAL_PASS,
            include_str!("passes/glossy_temporal.wgsl"),
        ],
    };
    /// Stage 9.
    pub const GLOSSY_HORIZONTAL: Self = Self {
        name: "glossy_bilateral_h",
        entries: &["horizontal"],
        bindings: GLOSSY_BINDINGS,
        pieces: GLOSSY_BILATERAL,
    };
    /// Stage 10.
    pub const GLOSSY_VERTICAL: Self = Self {
        name: "glossy_bilateral_v",
        entries: &["vertical"],
        bindings: GLOSSY_BINDINGS,
        pieces: GLOSSY_BILATERAL,
    };
    /// Stage 11.
    pub const DIRECT_TAA: Self = Self {
        name: "direct_taa",
        entries: &["antialias"],
        bindings: &[guides("guides"), colour("input"), colour("history"), written("output")],
        pieces: &[
            FRAME,
            SETTINGS,
            GUIDES,
            MATH,
            CLIP,
            include_str!("../stages/direct_taa/shader.wgsl"),
            UNIFORMS,
            include_str!("passes/direct_taa.wgsl"),
        ],
    };
    /// The sum.
    pub const COMPOSITE: Self = Self {
        name: "composite",
        entries: &["composite"],
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
        pieces: &[
            FRAME,
            SETTINGS,
            include_str!("../stages/composite/shader.wgsl"),
            UNIFORMS,
            include_str!("passes/composite.wgsl"),
        ],
    };

    /// All passes in the order of the pipeline.
    pub const ALL: [Self; 10] = [
        Self::MATTE_TEMPORAL,
        Self::MATTE_PREFILTER,
        Self::DISOCCLUSION,
        Self::FIREFLY,
        Self::MATTE_BILATERAL,
        Self::GLOSSY_TEMPORAL,
        Self::GLOSSY_HORIZONTAL,
        Self::GLOSSY_VERTICAL,
        Self::DIRECT_TAA,
        Self::COMPOSITE,
    ];

    /// The shader: its pieces one after another.
    pub fn source(&self) -> String {
        self.pieces.join("\n")
    }
}
