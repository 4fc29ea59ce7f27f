//! Light sources and the choice among them: one structure that draws a direction towards light from any point.
//!
//! Finite sources lie in a tree of bounds, which is descended by estimated irradiance; infinite ones are a
//! list. Which of the two is asked is decided by the irradiance that each is expected to give at the point.

mod patch;
pub(crate) mod tree;
mod triangle;

pub use patch::Patch;

#[cfg(feature = "gpu")]
pub(crate) use {
    patch::NEAR_RADII,
    tree::{BOUND_SHARE, CONE_SLACK},
    triangle::{MAX_SPHERICAL_SOLID_ANGLE, MIN_SPHERICAL_SOLID_ANGLE},
};

use crate::environment::Environment;
use crate::material::channel_mean;
use glam::{Vec2, Vec3};
use patch::PatchView;
use std::ops::Range;
use std::sync::Arc;
use tree::{LightBounds, LightTree};
use triangle::TriangleView;

/// A light source. Radiometric quantities are linear Rec. 709.
#[derive(Clone, Debug)]
pub enum Emitter {
    /// An emitting triangle. The front side is the one from which the vertices run counter-clockwise.
    Triangle {
        /// World space.
        vertices: [Vec3; 3],
        /// Emitted radiance.
        radiance: Vec3,
        /// Whether the back side emits as well.
        two_sided: bool,
    },
    /// Several triangles in one plane, sampled as one.
    Patch {
        /// World space.
        patch: Patch,
        /// Emitted radiance.
        radiance: Vec3,
        /// Whether the back side emits as well.
        two_sided: bool,
    },
    /// A point that shines evenly.
    Point {
        /// World space.
        position: Vec3,
        /// Power per steradian.
        intensity: Vec3,
    },
    /// A point that shines into a cone.
    Spot {
        /// World space.
        position: Vec3,
        /// Axis of the cone, from the light outwards, unit.
        direction: Vec3,
        /// Power per steradian on the axis.
        intensity: Vec3,
        /// Half angle in radians up to which intensity is full.
        inner_angle: f32,
        /// Half angle in radians from which it is 0; at most pi / 2. Between them it falls as glTF defines.
        outer_angle: f32,
    },
    /// Parallel light from infinitely far away.
    Directional {
        /// Direction in which the light travels, unit.
        direction: Vec3,
        /// Power per area facing the light.
        irradiance: Vec3,
    },
    /// Light from all around.
    Environment(Arc<Environment>),
}

/// A direction towards a light source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Direction towards the light, unit.
    pub wi: Vec3,
    /// Distance to it; +inf for infinite sources.
    pub distance: f32,
    /// Arriving radiance; of a delta light its irradiance perpendicular to `wi`. The estimate is
    /// f |cos| radiance / pdf for both.
    pub radiance: Vec3,
    /// Density per steradian including the choice of the source; of a delta light the probability of its choice.
    pub pdf: f32,
    /// A point, spot or directional light: no other sampling can find it.
    pub delta: bool,
    /// Which emitter, by its place in the list given to [`LightSampler::new`].
    pub emitter_index: usize,
    /// Where on a triangle, as weights of its vertices; 0 for other sources.
    pub barycentrics: Vec3,
}

/// Bounds of the probability of asking the infinite sources where both kinds exist and may shine: the estimates know
/// nothing of shadows.
pub(crate) const INFINITE_PROBABILITY: std::ops::RangeInclusive<f32> = 0.1..=0.9;

/// Draws directions towards light.
#[derive(Clone, Debug)]
pub struct LightSampler {
    pub(crate) emitters: Vec<Emitter>,
    /// Finite emitters of positive power.
    pub(crate) tree: LightTree,
    /// Infinite emitters of positive power and the irradiance expected of each.
    pub(crate) infinite: Vec<(usize, f32)>,
}

impl LightSampler {
    /// Builds the structure. Emitters without power or with values that are not finite are never chosen, but keep
    /// their place in the list.
    pub fn new(emitters: Vec<Emitter>) -> Self {
        let mut finite = Vec::new();
        let mut infinite = Vec::new();
        for (index, emitter) in emitters.iter().enumerate() {
            match emitter {
                Emitter::Directional { direction, irradiance } => {
                    let power = channel_mean(*irradiance);
                    if power > 0.0 && power.is_finite() && direction.is_normalized() {
                        infinite.push((index, power));
                    }
                }
                Emitter::Environment(environment) => {
                    let power = std::f32::consts::PI * channel_mean(environment.mean_radiance());
                    if power > 0.0 && power.is_finite() {
                        infinite.push((index, power));
                    }
                }
                _ => finite.extend(bounds_of(emitter).map(|bounds| (index, bounds))),
            }
        }
        let tree = LightTree::new(finite, emitters.len());
        Self { emitters, tree, infinite }
    }

    /// The emitters, as given.
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// Whether no emitter shines.
    pub fn is_empty(&self) -> bool {
        self.tree.is_empty() && self.infinite.is_empty()
    }

    /// Radiance of all environments from direction `w`: what a ray sees that leaves the scene.
    pub fn escaped_radiance(&self, w: Vec3) -> Vec3 {
        self.environments().map(|(_, environment)| environment.radiance(w)).sum()
    }

    /// The environments with their emitter indices.
    pub fn environments(&self) -> impl Iterator<Item = (usize, &Environment)> {
        self.emitters.iter().enumerate().filter_map(|(index, emitter)| match emitter {
            Emitter::Environment(environment) => Some((index, &**environment)),
            _ => None,
        })
    }

    /// A direction towards a light source from `reference_point`.
    ///
    /// `normal` (unit) is the shading normal of an opaque surface: light from below it is not drawn. Where light may
    /// come from both sides (glass) it is 0. `u.x` chooses the source, the rest places on it. `None`: no light can
    /// reach the point, or the chosen one does not; the sample then counts as black.
    pub fn sample(&self, reference_point: Vec3, normal: Vec3, u: Vec3) -> Option<LightSample> {
        let infinite_probability = self.infinite_probability(reference_point, normal);
        let place = Vec2::new(u.y, u.z);
        if u.x < infinite_probability {
            let choice = u.x / infinite_probability;
            let (emitter_index, share) = self.choose_infinite(normal, choice)?;
            return self.sample_infinite(emitter_index, normal, place, infinite_probability * share);
        }
        let choice = (u.x - infinite_probability) / (1.0 - infinite_probability);
        let (emitter_index, share) = self.tree.sample(reference_point, normal, choice)?;
        let selection = (1.0 - infinite_probability) * share;
        self.sample_finite(emitter_index, reference_point, place, selection)
    }

    /// Density per steradian, selection included, with which [`Self::sample`] draws `wi` on emitter `emitter_index`
    /// from the same point and normal; 0 for delta lights and for emitters that cannot be chosen.
    ///
    /// `wi` must meet the emitter. To weigh a ray that met it at some hit point, give the ray's origin and direction.
    pub fn pdf(&self, reference_point: Vec3, normal: Vec3, emitter_index: usize, wi: Vec3) -> f32 {
        let Some(emitter) = self.emitters.get(emitter_index) else { return 0.0 };
        let infinite_probability = || self.infinite_probability(reference_point, normal);
        match emitter {
            Emitter::Triangle { vertices, two_sided, .. } => {
                let share = self.tree.probability(reference_point, normal, emitter_index);
                if share <= 0.0 {
                    return 0.0;
                }
                let Some(view) = TriangleView::new(vertices, *two_sided, reference_point) else { return 0.0 };
                (1.0 - infinite_probability()) * share * view.pdf(wi)
            }
            Emitter::Patch { patch, two_sided, .. } => {
                let share = self.tree.probability(reference_point, normal, emitter_index);
                if share <= 0.0 {
                    return 0.0;
                }
                let Some(view) = PatchView::new(patch, *two_sided, reference_point) else { return 0.0 };
                (1.0 - infinite_probability()) * share * view.pdf(wi)
            }
            Emitter::Environment(environment) => {
                let share = self.infinite_share(normal, emitter_index);
                if share <= 0.0 {
                    return 0.0;
                }
                infinite_probability() * share * environment.pdf(normal, wi)
            }
            Emitter::Point { .. } | Emitter::Spot { .. } | Emitter::Directional { .. } => 0.0,
        }
    }

    /// Probability of asking the infinite sources.
    fn infinite_probability(&self, reference_point: Vec3, normal: Vec3) -> f32 {
        if self.infinite.is_empty() {
            return 0.0;
        }
        let infinite: f32 = self.infinite.iter().map(|&(i, power)| self.infinite_irradiance(i, power, normal)).sum();
        let finite = self.tree.irradiance(reference_point, normal);
        if infinite <= 0.0 {
            0.0
        } else if finite <= 0.0 {
            1.0
        } else {
            (infinite / (infinite + finite)).clamp(*INFINITE_PROBABILITY.start(), *INFINITE_PROBABILITY.end())
        }
    }

    /// Irradiance expected of an infinite emitter; exactly 0 for parallel light from below the surface.
    fn infinite_irradiance(&self, emitter_index: usize, power: f32, normal: Vec3) -> f32 {
        match &self.emitters[emitter_index] {
            Emitter::Directional { direction, .. } if normal != Vec3::ZERO => {
                power * (-normal.dot(*direction)).max(0.0)
            }
            _ => power,
        }
    }

    /// An infinite emitter and its probability among them.
    fn choose_infinite(&self, normal: Vec3, u: f32) -> Option<(usize, f32)> {
        let total: f32 = self.infinite.iter().map(|&(i, power)| self.infinite_irradiance(i, power, normal)).sum();
        let mut rest = u * total;
        let mut chosen = None;
        for &(index, power) in &self.infinite {
            let irradiance = self.infinite_irradiance(index, power, normal);
            if irradiance > 0.0 {
                chosen = Some((index, irradiance / total));
                if rest < irradiance {
                    break;
                }
                rest -= irradiance;
            }
        }
        chosen
    }

    /// Probability of an infinite emitter among them.
    fn infinite_share(&self, normal: Vec3, emitter_index: usize) -> f32 {
        let (mut total, mut own) = (0.0, 0.0);
        for &(index, power) in &self.infinite {
            let irradiance = self.infinite_irradiance(index, power, normal);
            total += irradiance;
            if index == emitter_index {
                own = irradiance;
            }
        }
        if total > 0.0 { own / total } else { 0.0 }
    }

    fn sample_infinite(&self, emitter_index: usize, normal: Vec3, u: Vec2, selection: f32) -> Option<LightSample> {
        match &self.emitters[emitter_index] {
            Emitter::Directional { direction, irradiance } => Some(LightSample {
                wi: -*direction,
                distance: f32::INFINITY,
                radiance: *irradiance,
                pdf: selection,
                delta: true,
                emitter_index,
                barycentrics: Vec3::ZERO,
            }),
            Emitter::Environment(environment) => {
                let sample = environment.sample(normal, u)?;
                Some(LightSample {
                    wi: sample.wi,
                    distance: f32::INFINITY,
                    radiance: sample.radiance,
                    pdf: selection * sample.pdf,
                    delta: false,
                    emitter_index,
                    barycentrics: Vec3::ZERO,
                })
            }
            _ => None,
        }
    }

    /// `None` where no light of the emitter reaches the point.
    fn view_finite(&self, emitter_index: usize, from: Vec3) -> Option<FiniteView<'_>> {
        match &self.emitters[emitter_index] {
            Emitter::Triangle { vertices, radiance, two_sided } => {
                Some(FiniteView::Triangle(TriangleView::new(vertices, *two_sided, from)?, *radiance))
            }
            Emitter::Patch { patch, radiance, two_sided } => {
                Some(FiniteView::Patch(PatchView::new(patch, *two_sided, from)?, *radiance))
            }
            Emitter::Point { position, intensity } => FiniteView::point(from, *position, *intensity),
            Emitter::Spot { position, direction, intensity, inner_angle, outer_angle } => {
                let from_light = (from - *position).try_normalize()?;
                let falloff = spot_falloff(from_light.dot(*direction), *inner_angle, *outer_angle);
                FiniteView::point(from, *position, *intensity * falloff)
            }
            Emitter::Directional { .. } | Emitter::Environment(_) => None,
        }
    }

    fn sample_finite(&self, emitter_index: usize, from: Vec3, u: Vec2, selection: f32) -> Option<LightSample> {
        self.view_finite(emitter_index, from)?.sample(emitter_index, u, selection)
    }

    /// `count` samples as [`Self::sample`] draws them with choices (i + `shift`) / `count` for i from 0 and places
    /// `place(i)`, but for a fraction of the price: the choice is made once for all. `take` is handed each sample and
    /// how many times it counts: all samples of a delta light are one.
    ///
    /// Each source gets a run of successive i, whose length is `count` times its probability but for rounding.
    pub fn sample_many(
        &self,
        reference_point: Vec3,
        normal: Vec3,
        count: u32,
        shift: f32,
        mut place: impl FnMut(u32) -> Vec2,
        mut take: impl FnMut(LightSample, f32),
    ) {
        let n = f64::from(count);
        // The first i whose choice is at least `u`.
        let first = |u: f64| (u * n - f64::from(shift)).ceil().clamp(0.0, n) as u32;
        let infinite_probability = self.infinite_probability(reference_point, normal);
        if infinite_probability > 0.0 {
            let total: f32 = self.infinite.iter().map(|&(i, power)| self.infinite_irradiance(i, power, normal)).sum();
            let mut end = 0.0;
            for &(emitter_index, power) in &self.infinite {
                let start = end;
                let selection = infinite_probability * (self.infinite_irradiance(emitter_index, power, normal) / total);
                end += f64::from(selection);
                let run = first(start)..first(end);
                if matches!(self.emitters[emitter_index], Emitter::Directional { .. }) {
                    if let (false, Some(sample)) =
                        (run.is_empty(), self.sample_infinite(emitter_index, normal, Vec2::ZERO, selection))
                    {
                        take(sample, run.len() as f32);
                    }
                } else {
                    for i in run {
                        if let Some(sample) = self.sample_infinite(emitter_index, normal, place(i), selection) {
                            take(sample, 1.0);
                        }
                    }
                }
            }
        }
        if infinite_probability < 1.0 {
            let span = f64::from(infinite_probability)..1.0;
            self.tree.runs(reference_point, normal, span, &first, &mut |emitter_index, share, run: Range<u32>| {
                let selection = (1.0 - infinite_probability) * share;
                let Some(view) = self.view_finite(emitter_index, reference_point) else { return };
                if matches!(view, FiniteView::Point { .. }) {
                    if let Some(sample) = view.sample(emitter_index, Vec2::ZERO, selection) {
                        take(sample, run.len() as f32);
                    }
                    return;
                }
                let view = if run.len() > 1 { view.prepared() } else { view };
                for i in run {
                    if let Some(sample) = view.sample(emitter_index, place(i), selection) {
                        take(sample, 1.0);
                    }
                }
            });
        }
    }
}

/// A finite emitter as seen from a point.
#[expect(
    clippy::large_enum_variant,
    reason = "one lies on the stack for a few samples; a box would be made at each point"
)]
enum FiniteView<'a> {
    Triangle(TriangleView, Vec3),
    Patch(PatchView<'a>, Vec3),
    Point { wi: Vec3, distance: f32, radiance: Vec3 },
}

impl FiniteView<'_> {
    fn point(from: Vec3, position: Vec3, intensity: Vec3) -> Option<Self> {
        let to_light = position - from;
        let distance = to_light.length();
        let radiance = intensity / (distance * distance);
        let shines = distance > 0.0 && radiance.is_finite() && radiance != Vec3::ZERO;
        shines.then(|| Self::Point { wi: to_light / distance, distance, radiance })
    }

    /// The same view, ready for many samples.
    fn prepared(self) -> Self {
        match self {
            Self::Triangle(view, radiance) => Self::Triangle(view.prepared(), radiance),
            Self::Patch(view, radiance) => Self::Patch(view.prepared(), radiance),
            point @ Self::Point { .. } => point,
        }
    }

    #[inline]
    fn sample(&self, emitter_index: usize, u: Vec2, selection: f32) -> Option<LightSample> {
        let (sample, radiance) = match self {
            Self::Triangle(view, radiance) => (view.sample(u)?, *radiance),
            Self::Patch(view, radiance) => (view.sample(u)?, *radiance),
            Self::Point { wi, distance, radiance } => {
                return Some(LightSample {
                    wi: *wi,
                    distance: *distance,
                    radiance: *radiance,
                    pdf: selection,
                    delta: true,
                    emitter_index,
                    barycentrics: Vec3::ZERO,
                });
            }
        };
        Some(LightSample {
            wi: sample.wi,
            distance: sample.distance,
            radiance,
            pdf: selection * sample.pdf,
            delta: false,
            emitter_index,
            barycentrics: sample.barycentrics,
        })
    }
}

/// Share of a spot's intensity at an angle from its axis, as `KHR_lights_punctual` recommends: the square of a ramp
/// in the cosine.
pub fn spot_falloff(cos: f32, inner_angle: f32, outer_angle: f32) -> f32 {
    let (cos_inner, cos_outer) = (inner_angle.cos(), outer_angle.cos());
    if cos <= cos_outer {
        return 0.0;
    }
    let ramp = ((cos - cos_outer) / (cos_inner - cos_outer).max(1e-4)).min(1.0);
    ramp * ramp
}

/// Bounds of a finite emitter; `None` where it has no power or no place.
fn bounds_of(emitter: &Emitter) -> Option<LightBounds> {
    use std::f32::consts::{FRAC_PI_2, PI};
    let bounds = match emitter {
        Emitter::Triangle { vertices: [a, b, c], radiance, two_sided } => {
            let cross = (*b - *a).cross(*c - *a);
            LightBounds {
                low: a.min(*b).min(*c),
                high: a.max(*b).max(*c),
                axis: cross.try_normalize()?,
                spread: 0.0,
                emission: FRAC_PI_2,
                two_sided: *two_sided,
                intensity: channel_mean(*radiance) * 0.5 * cross.length(),
            }
        }
        Emitter::Patch { patch, radiance, two_sided } => {
            let (low, high) = patch.bounds();
            LightBounds {
                low,
                high,
                axis: patch.normal(),
                spread: 0.0,
                emission: FRAC_PI_2,
                two_sided: *two_sided,
                intensity: channel_mean(*radiance) * patch.area(),
            }
        }
        Emitter::Point { position, intensity } => LightBounds {
            low: *position,
            high: *position,
            axis: Vec3::Z,
            spread: PI,
            emission: FRAC_PI_2,
            two_sided: false,
            intensity: channel_mean(*intensity),
        },
        Emitter::Spot { position, direction, intensity, inner_angle, outer_angle } => LightBounds {
            low: *position,
            high: *position,
            axis: direction.try_normalize()?,
            spread: inner_angle.clamp(0.0, FRAC_PI_2),
            emission: (outer_angle - inner_angle).clamp(0.0, FRAC_PI_2),
            two_sided: false,
            intensity: channel_mean(*intensity),
        },
        Emitter::Directional { .. } | Emitter::Environment(_) => return None,
    };
    let finite = bounds.intensity > 0.0
        && bounds.intensity.is_finite()
        && bounds.low.is_finite()
        && bounds.high.is_finite()
        && !bounds.spread.is_nan()
        && !bounds.emission.is_nan();
    finite.then_some(bounds)
}

#[cfg(test)]
mod tests;
