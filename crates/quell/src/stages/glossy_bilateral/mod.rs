//! Stages 9 and 10: the separable bilateral filter of the glossy signal, horizontal, then vertical.
//!
//! | | |
//! |---|---|
//! | reads | glossy temporal and passes, guides, hit distance |
//! | writes | glossy horizontal, then glossy filtered |
//! | reach | `max_radius` pixels (scaled by rows / 720) along the axis |
//! | equation | taps every `step` pixels to both sides up to the radius r; w = Gaussian(sigma r) * w_z w_n w_p w_g |
//! | source | \[S, E]; the radius \[O]: `docs/paper.md`, stages 9 and 10 |
//! | parameters | `glossy_bilateral.*`, `edge.*` |
//!
//! The radius is the footprint of the lobe on what it reflects: r = f tan(theta) / (1 + l / d + 2 f |dn|), f the focal
//! length in pixels, l the view depth, d the hit distance (their ratio averaged over 3x3), |dn| the change of the normal
//! from one pixel to the next along the axis, tan(theta) = 2 roughness^2; cut at `max_radius`, and nothing is filtered
//! below `min_radius`: a mirror is never blurred.
//!
//! A pixel further, the eye ray turns by 1 / f and so does its reflection in a plane; on a bent surface the reflection
//! turns by 2 |dn| more, and the lobe covers fewer pixels of what it reflects.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::border::Guides;
use crate::reach::Reach;
use crate::settings::{GlossyBilateral, GlossyRadius, REFERENCE_ROWS};
use glam::Vec3;

/// Direction of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Stage 9.
    Horizontal,
    /// Stage 10.
    Vertical,
}

/// tan(theta) over squared roughness, theta being half the lobe's width \[O].
pub(crate) const LOBE_SPREAD: f32 = 2.0;

/// The kernel's sizes in pixels of this image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KernelSize {
    /// Distance between taps, whole pixels.
    pub step_px: usize,
    /// Most taps to each side.
    pub reach: usize,
    /// Largest radius.
    pub max_radius_px: f32,
    /// Radius where it is constant.
    pub constant_radius_px: f32,
}

impl KernelSize {
    /// For an image of `rows` rows.
    pub fn new(settings: &GlossyBilateral, rows: usize) -> Self {
        let scale = rows as f32 / REFERENCE_ROWS;
        let step_px = ((settings.step * scale).round() as usize).max(1);
        let max_radius_px = match settings.radius {
            GlossyRadius::Footprint => settings.max_radius * scale,
            GlossyRadius::Constant => settings.constant_radius * scale,
        };
        Self {
            step_px,
            reach: (max_radius_px / step_px as f32) as usize,
            max_radius_px,
            constant_radius_px: settings.constant_radius * scale,
        }
    }
}

/// Radius at a surface pixel, in pixels; 0: pass through.
#[inline(always)]
pub fn radius_px(
    settings: &GlossyBilateral,
    size: &KernelSize,
    guides: &Guides,
    axis: Axis,
    x: usize,
    y: usize,
) -> f32 {
    let radius = match settings.radius {
        GlossyRadius::Constant => size.constant_radius_px,
        GlossyRadius::Footprint if !guides.has_roughness => size.max_radius_px,
        GlossyRadius::Footprint => {
            let roughness = guides.roughness.at(x, y);
            let spread = LOBE_SPREAD * roughness * roughness * guides.view.focal_px;
            let nearness = if guides.has_glossy_hit { mean_nearness(guides, x, y) } else { 1.0 };
            let bend = if settings.curvature { normal_change(guides, axis, x, y) } else { 0.0 };
            // Parallel rays and no hit: nearness is infinite.
            let radius = (spread / (1.0 / nearness + 2.0 * guides.view.focal_px * bend)).min(size.max_radius_px);
            if spread > 0.0 { radius } else { 0.0 }
        }
    };
    if radius < settings.min_radius { 0.0 } else { radius }
}

/// 1 / (1 + l / d) for one pixel; parallel rays: the distance itself, in units of a pixel's size over the focal length.
#[inline(always)]
fn nearness(guides: &Guides, x: usize, y: usize) -> f32 {
    let hit = guides.glossy_hit.at(x, y);
    if guides.view.perspective { 1.0 / (1.0 + guides.depth.at(x, y) / hit) } else { hit }
}

/// Mean over the 3x3 neighbours of the same object. One path's own distance goes with its own light: a kernel sized by
/// it would blur bright samples more than dark ones, which loses energy (measured: 2 % in `cornell-box`).
#[inline(always)]
fn mean_nearness(guides: &Guides, x: usize, y: usize) -> f32 {
    let id = guides.id.at(x, y);
    let (mut sum, mut count) = (0.0, 0.0);
    for ty in y.saturating_sub(1)..(y + 2).min(guides.size.height) {
        for tx in x.saturating_sub(1)..(x + 2).min(guides.size.width) {
            if guides.id.at(tx, ty) == id && guides.is_surface(tx, ty) {
                sum += nearness(guides, tx, ty);
                count += 1.0;
            }
        }
    }
    sum / count
}

/// The larger change of the normal to the two neighbours along the axis that show the same object.
#[inline(always)]
fn normal_change(guides: &Guides, axis: Axis, x: usize, y: usize) -> f32 {
    let (id, normal) = (guides.id.at(x, y), Vec3::from(guides.normal.at(x, y)));
    let neighbours = match axis {
        Axis::Horizontal => [(x.wrapping_sub(1), y), (x + 1, y)],
        Axis::Vertical => [(x, y.wrapping_sub(1)), (x, y + 1)],
    };
    let inside = |&(tx, ty): &(usize, usize)| tx < guides.size.width && ty < guides.size.height;
    let same = |&(tx, ty): &(usize, usize)| guides.id.at(tx, ty) == id && guides.is_surface(tx, ty);
    let squared = neighbours
        .iter()
        .filter(|n| inside(n) && same(n))
        .map(|&(tx, ty)| (Vec3::from(guides.normal.at(tx, ty)) - normal).length_squared())
        .fold(0.0, f32::max);
    squared.sqrt()
}

/// How far a pass looks in a picture of `rows` rows: along its axis the kernel, around the pixel what its radius depends on.
pub(crate) fn reach(s: &GlossyBilateral, axis: Axis, rows: usize) -> Reach {
    let kernel = KernelSize::new(s, rows);
    let along = kernel.max_radius_px.max(kernel.constant_radius_px).ceil() as usize + 1;
    match axis {
        Axis::Horizontal => Reach { pixels: [along, 1], ..Reach::NONE },
        Axis::Vertical => Reach { pixels: [1, along], ..Reach::NONE },
    }
}
