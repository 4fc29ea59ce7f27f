//! Passes of the stages after the filtered light: what each binds, and its pieces of WGSL.

use crate::gpu::pass::{Binding, BindingKind, Element, Pass};
use crate::gpu::sequence::passes::{FRAMES, HAS, IMAGE, frames, pass, read, settings, written};

/// Of activations and of signatures.
pub(super) const ACTIVATIONS: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;
pub(super) const SIGNATURES: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

const fn many(name: &'static str) -> Binding {
    Binding { name, kind: BindingKind::Read(Element::Fours) }
}
const fn layers(name: &'static str, format: wgpu::TextureFormat) -> Binding {
    Binding { name, kind: BindingKind::Layers(format) }
}

const SETTINGS: Binding = settings("FinishSettings");
const WINDOW: Binding = Binding { name: "frames", kind: BindingKind::Read(Element::Struct("WindowFrame")) };
const BRIGHTNESS: Binding = Binding { name: "brightness", kind: BindingKind::Read(Element::One) };

const PICTURES: &str = include_str!("../pictures.wgsl");
const INPUTS: &str = include_str!("../inputs.wgsl");
const STATISTICS_AT: &str = include_str!("../statistics_at.wgsl");
const FAST_LOG: &str = include_str!("../../../kernels/fast_log.wgsl");
const RELATIVE: &str = include_str!("../../../stages/blend/relative.wgsl");
const STATISTICS: &str = include_str!("../../../stages/blend/statistics.wgsl");
const SIGNATURE: &str = include_str!("../../../stages/stabilise/signature.wgsl");
const GUIDES: &str = include_str!("../../../stages/blend/guides.wgsl");
const BLEND: &str = include_str!("../../../stages/blend/shader.wgsl");
const CONV: &str = include_str!("../../../kernels/conv.wgsl");
const CONV_PLAIN: &str = include_str!("../../passes/conv_plain.wgsl");
const CONV_HALVED: &str = include_str!("../../passes/conv_halved.wgsl");
const CONV_BESIDE: &str = include_str!("../../passes/conv_beside.wgsl");
const CONVOLVE: &str = include_str!("../../passes/conv.wgsl");

const CONV_BINDINGS: &[Binding] = &[SETTINGS, frames("layer_read"), many("weights"), layers("written", ACTIVATIONS)];

impl Pass {
    /// What stage `stabilise` compares pixels by, of one frame.
    pub const SIGNATURE: Self = pass(
        "signature",
        "signatures",
        &[
            SETTINGS,
            WINDOW,
            frames("surface_normals"),
            frames("seen_colours"),
            frames("seen_normals"),
            frames("surface_colours"),
            frames("pictures"),
            layers("signature_0", SIGNATURES),
            layers("signature_1", SIGNATURES),
            layers("signature_2", SIGNATURES),
            layers("signature_3", SIGNATURES),
        ],
        &[IMAGE, PICTURES, FAST_LOG, HAS, GUIDES, SIGNATURE, include_str!("../../passes/signature.wgsl")],
    );

    /// What the trajectories of pixels say of their noise, and outliers, for stages `stabilise` and `blend`.
    pub const FOLLOW: Self = pass(
        "follow",
        "follow_pixels",
        &[
            SETTINGS,
            WINDOW,
            frames("surfaces"),
            frames("surface_normals"),
            frames("to_previous"),
            frames("to_next"),
            frames("reflection_to_previous"),
            frames("reflection_to_next"),
            frames("pictures"),
            frames("inputs"),
            written("differences"),
            written("known"),
        ],
        &[
            IMAGE,
            HAS,
            FRAMES,
            PICTURES,
            INPUTS,
            include_str!("../../../stages/blend/follow.wgsl"),
            include_str!("../../passes/follow.wgsl"),
        ],
    );

    /// What statistics of stages `stabilise` and `blend` are relative to.
    pub const BRIGHTNESS: Self = pass(
        "brightness",
        "brightness_around",
        &[
            SETTINGS,
            WINDOW,
            frames("pictures"),
            read("steady"),
            Binding { name: "brightness", kind: BindingKind::Write(Element::One) },
        ],
        &[IMAGE, PICTURES, include_str!("../../passes/brightness.wgsl")],
    );

    /// Stage `stabilise`.
    pub const STABILISE: Self = pass(
        "stabilise",
        "stabilise",
        &[
            SETTINGS,
            WINDOW,
            frames("surfaces"),
            frames("surface_normals"),
            frames("to_previous"),
            frames("to_next"),
            frames("reflection_to_previous"),
            frames("reflection_to_next"),
            frames("pictures"),
            frames("inputs"),
            frames("signature_0"),
            frames("signature_1"),
            frames("signature_2"),
            frames("signature_3"),
            many("net"),
            read("differences"),
            read("known"),
            BRIGHTNESS,
            written("steady"),
        ],
        &[
            IMAGE,
            HAS,
            FRAMES,
            PICTURES,
            INPUTS,
            FAST_LOG,
            STATISTICS_AT,
            RELATIVE,
            STATISTICS,
            include_str!("../../../stages/stabilise/shader.wgsl"),
            include_str!("../../passes/stabilise.wgsl"),
        ],
    );

    /// Stage `blend`: what its net reads, and the net's first layer.
    pub const BLEND_READ: Self = pass(
        "blend_read",
        "read_by_net",
        &[
            SETTINGS,
            WINDOW,
            frames("surfaces"),
            frames("surface_normals"),
            frames("seen_colours"),
            frames("seen_normals"),
            frames("surface_colours"),
            frames("pictures"),
            frames("inputs"),
            many("weights"),
            read("differences"),
            read("known"),
            read("steady"),
            BRIGHTNESS,
            written("judged"),
            layers("written", ACTIVATIONS),
        ],
        &[
            IMAGE,
            PICTURES,
            INPUTS,
            FAST_LOG,
            STATISTICS_AT,
            RELATIVE,
            STATISTICS,
            HAS,
            GUIDES,
            include_str!("../../passes/blend_read.wgsl"),
        ],
    );

    /// Stage `blend`: the net's second layer.
    pub const BLEND_NET_FULL: Self = pass(
        "blend_net_full",
        "convolve",
        CONV_BINDINGS,
        &[IMAGE, "const READS = 4u;\nconst WRITES = 4u;\n", CONV, CONV_PLAIN, CONVOLVE],
    );

    /// The third, at half the size.
    pub const BLEND_NET_HALF: Self = pass(
        "blend_net_half",
        "convolve",
        CONV_BINDINGS,
        &[IMAGE, "const READS = 4u;\nconst WRITES = 8u;\n", CONV, CONV_HALVED, CONVOLVE],
    );

    /// The fourth, at a quarter.
    pub const BLEND_NET_QUARTER: Self = pass(
        "blend_net_quarter",
        "convolve",
        CONV_BINDINGS,
        &[IMAGE, "const READS = 8u;\nconst WRITES = 8u;\n", CONV, CONV_HALVED, CONVOLVE],
    );

    /// The fifth, at a quarter.
    pub const BLEND_NET_DEEP: Self = pass(
        "blend_net_deep",
        "convolve",
        CONV_BINDINGS,
        &[IMAGE, "const READS = 8u;\nconst WRITES = 8u;\n", CONV, CONV_PLAIN, CONVOLVE],
    );

    /// The sixth, at half the size again.
    pub const BLEND_NET_UP: Self = pass(
        "blend_net_up",
        "convolve",
        &[SETTINGS, frames("layer_read"), frames("layer_half"), many("weights"), layers("written", ACTIVATIONS)],
        &[IMAGE, "const READS = 16u;\nconst WRITES = 8u;\nconst WHOLE = 8u;\n", CONV, CONV_BESIDE, CONVOLVE],
    );

    /// The last two: shares that the net wants, the expected error, the kernel.
    pub const BLEND_OUTPUTS: Self = pass(
        "blend_outputs",
        "net_outputs",
        &[SETTINGS, frames("layer_read"), frames("layer_half"), many("weights"), layers("written", ACTIVATIONS)],
        &[
            "const READS = 12u;\nconst WRITES = 4u;\nconst WHOLE = 4u;\n",
            FAST_LOG,
            BLEND,
            CONV,
            CONV_BESIDE,
            include_str!("../../passes/blend_outputs.wgsl"),
        ],
    );

    /// Stage `blend`: shares and mixture.
    pub const BLEND_MIX: Self = pass(
        "blend_mix",
        "mix_candidates",
        &[
            SETTINGS,
            WINDOW,
            frames("pictures"),
            frames("inputs"),
            frames("outputs"),
            read("steady"),
            read("judged"),
            written("shares"),
            written("mixture"),
        ],
        &[IMAGE, PICTURES, INPUTS, FAST_LOG, RELATIVE, BLEND, include_str!("../../passes/blend_mix.wgsl")],
    );

    /// Stage `blend`: what the kernel changes.
    pub const BLEND_CHANGE: Self = pass(
        "blend_change",
        "change_by_kernel",
        &[SETTINGS, frames("outputs"), read("mixture"), written("changed")],
        &[IMAGE, FAST_LOG, BLEND, include_str!("../../passes/blend_change.wgsl")],
    );

    /// Stage `blend`: what of that is kept.
    pub const BLEND_GAIN: Self = pass(
        "blend_gain",
        "gain",
        &[SETTINGS, read("mixture"), read("changed"), read("judged"), written("gains")],
        &[IMAGE, FAST_LOG, RELATIVE, BLEND, include_str!("../../passes/blend_gain.wgsl")],
    );

    /// All of them, in order.
    pub const FINISH: [Self; 14] = [
        Self::SIGNATURE,
        Self::FOLLOW,
        Self::BRIGHTNESS,
        Self::STABILISE,
        Self::BLEND_READ,
        Self::BLEND_NET_FULL,
        Self::BLEND_NET_HALF,
        Self::BLEND_NET_QUARTER,
        Self::BLEND_NET_DEEP,
        Self::BLEND_NET_UP,
        Self::BLEND_OUTPUTS,
        Self::BLEND_MIX,
        Self::BLEND_CHANGE,
        Self::BLEND_GAIN,
    ];
}
