//! The one table of channel names: what quell writes, what it reads, and what each channel means.
//!
//! Blender's short names where Blender has the pass, so that other programs find them; everything else begins with
//! `quell.`. Light passes come without their colour, as Blender's do, and the passes add up:
//!
//! ```text
//! R G B = DiffCol (DiffDir + DiffInd) + GlossCol (GlossDir + GlossInd) + Emit
//! ```
//!
//! `Emit` holds quell's whole `direct` plane: noise-free direct light, emission and background in one, because the
//! frame contract does not part them. `DiffDir` and `GlossDir` are the *noisy* direct light of the lobes and are
//! written only where a frame has them. So the sum above holds in every program that knows Blender's rule, and no
//! light is stored twice.

/// Composite: direct light plus every signal times its weight.
pub const COMPOSITE: &str = "";
/// Coverage.
pub const ALPHA: &str = "A";
/// `direct`: radiance that needs no filter.
pub const DIRECT: &str = "Emit";
/// `direct_matte`.
pub const DIRECT_MATTE: &str = "DiffDir";
/// `direct_glossy`.
pub const DIRECT_GLOSSY: &str = "GlossDir";
/// `matte`.
pub const MATTE: &str = "DiffInd";
/// `glossy`.
pub const GLOSSY: &str = "GlossInd";
/// `matte_weight`.
pub const MATTE_WEIGHT: &str = "DiffCol";
/// `glossy_weight`.
pub const GLOSSY_WEIGHT: &str = "GlossCol";
/// `view_depth`, one channel `Z`; +inf: background.
pub const DEPTH: &str = "Depth.Z";
/// `normal`, channels `X Y Z`, world space.
pub const NORMAL: &str = "Normal";
/// Motion, channels `X Y Z W`, in pixels with y **up** as Blender has it: the surface point at (x, y) was at
/// (x + X, y - Y) in the frame before and will be at (x - Z, y + W) in the next. So X = `motion.x`,
/// Y = -`motion.y`. Z and W are written only where the motion of the next frame is known.
pub const VECTOR: &str = "Vector";
/// `roughness`, perceptual.
pub const ROUGHNESS: &str = "quell.roughness";
/// `matte_hit_distance`.
pub const MATTE_HIT_DISTANCE: &str = "quell.matte_hit_distance";
/// `glossy_hit_distance`.
pub const GLOSSY_HIT_DISTANCE: &str = "quell.glossy_hit_distance";
/// `surface_id`, unsigned integers.
pub const SURFACE_ID: &str = "quell.surface_id";
/// `matte_variance`: of the pixel's mean, luminance.
pub const MATTE_VARIANCE: &str = "quell.variance.matte";
/// `glossy_variance`: of the pixel's mean, luminance.
pub const GLOSSY_VARIANCE: &str = "quell.variance.glossy";
/// `confidence_in`: the host's trust in history.
pub const CONFIDENCE_IN: &str = "quell.confidence_in";
/// The denoiser's confidence, 0..1.
pub const CONFIDENCE: &str = "quell.confidence";
/// The denoiser's history length, frames.
pub const HISTORY: &str = "quell.history";
/// Joint passes: `quell.pass.<signal>.<name>.R`; their order stands in the header.
pub const PASS: &str = "quell.pass";
/// The two independent halves: `quell.half_a.composite.R`, `quell.half_a.matte.R` and so on.
pub const HALVES: [&str; 2] = ["quell.half_a", "quell.half_b"];

/// The three components of a colour.
pub const RGB: [&str; 3] = ["R", "G", "B"];
/// The three components of a vector.
pub const XYZ: [&str; 3] = ["X", "Y", "Z"];

/// `layer.component`, or the component alone where the layer has no name.
pub fn channel(layer: &str, component: &str) -> String {
    if layer.is_empty() { component.to_owned() } else { format!("{layer}.{component}") }
}
