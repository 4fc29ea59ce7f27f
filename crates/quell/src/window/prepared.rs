//! A frame made ready for the stages: a third of its size as it came.

use super::features::{Features, MotionPlanes};
use super::light_means::LightMeans;
use super::local::Class;
use super::packed::{Packed, Weight};
use super::vectors::Vectors;
use crate::error::Error;
use crate::frame::Rgb;
use crate::kernels::math::luminance;
use crate::par;
use crate::plane::Plane;
use crate::sequence::{Light, LightKind, SequenceFrame, SequenceSettings};
use std::sync::Arc;

/// A light's place among the packed samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LightSlot {
    /// What made it; noise-free light in a medium counts as [`LightKind::MatteIndirect`].
    pub kind: LightKind,
    /// Its place among the frame's lights.
    pub light: usize,
    /// First of its colour planes among all.
    pub first: usize,
    /// Its colour planes: itself and its joint planes.
    pub planes: usize,
}

/// Where a light's samples are.
#[derive(Clone)]
pub(crate) enum Samples {
    /// Nowhere: it is black all over.
    Black,
    /// Among the packed ones, from this plane on.
    Packed(usize),
    /// In full, since it comes out as it went in; nobody else reads them.
    Own(Vec<Weight>),
    /// It was [`Samples::Own`], and the frame is filtered.
    Gone,
}

/// A frame made ready for the sequence filter, or a band of its rows: a third of its size as it came. What only this frame
/// decides is decided here, so that another thread can do it.
#[derive(Clone)]
pub struct PreparedFrame {
    pub(crate) number: i64,
    pub(crate) features: Features,
    /// Every light of the frame.
    pub(crate) slots: Vec<LightSlot>,
    /// Kinds and colour planes of the lights as they came: what a neighbour must share.
    shape: Vec<(LightKind, usize)>,
    /// Of each light.
    pub(crate) stored: Vec<Samples>,
    pub(crate) samples: Packed,
    /// Means of the light around each pixel; none where `gather` does not ask.
    pub(crate) means: LightMeans,
    /// What multiplies each light back; `None`: 1.
    pub(crate) weights: Vec<Option<Arc<Weight>>>,
    pub(crate) in_beauty: Vec<bool>,
    pub(crate) alpha: Option<Plane<f32>>,
    pub(crate) variance: Option<Plane<f32>>,
    pub(crate) repeats_noise: bool,
    /// What shaders cannot be trusted with; of the whole frame, so that bands decide alike.
    pub(crate) unfit: Option<&'static str>,
    /// Colour samples that were not finite and count as 0.
    pub(crate) repaired: usize,
}

/// Inverse depths beyond it cannot be squared and divided in 32 bits without infinities, which shaders need not have.
const MOST_INVERSE_DEPTH: f32 = 1e15;

/// Variances are divided by the square of the light's weight, which may be 0.
const LEAST_WEIGHT: f32 = 1e-3;

impl PreparedFrame {
    /// Takes a frame apart. Colours that are not finite become 0 and are counted.
    ///
    /// # Errors
    /// [`Error::EmptySize`], [`Error::PlaneSize`].
    pub fn new(mut frame: SequenceFrame, settings: &SequenceSettings) -> Result<Self, Error> {
        frame.check()?;
        // Not copied: frames are large.
        let motion = MotionPlanes {
            to_previous: frame.motion_to_previous.take().map(Vectors::new),
            to_next: frame.motion_to_next.take().map(Vectors::new),
            ..MotionPlanes::default()
        };
        let features = Features { motion, ..Features::new(&frame, settings) };
        // In a medium even noise-free light behind it has noise: whether a ray gets there is chance.
        let lit = |light: &Light| par::any(light.light.data(), |colour| colour.iter().any(|&c| c > 0.0));
        let foggy = frame.lights.iter().any(|l| l.kind == LightKind::Volume && lit(l));
        let shape: Vec<_> = frame.lights.iter().map(|l| (l.kind, 1 + l.joint.len())).collect();
        let mut slots = Vec::with_capacity(frame.lights.len());
        let mut stored = Vec::with_capacity(frame.lights.len());
        let mut weights: Vec<Option<Arc<Weight>>> = Vec::with_capacity(frame.lights.len());
        let mut in_beauty = Vec::with_capacity(frame.lights.len());
        // Planes to be packed, with the question whether they are seen in mirrors.
        let mut packed: Vec<(Plane<Rgb>, bool)> = Vec::new();
        let mut shared: Vec<(Arc<Plane<Rgb>>, Arc<Weight>)> = Vec::new();
        let (mut planes, mut repaired) = (0, 0);
        for (index, light) in frame.lights.into_iter().enumerate() {
            let kind = if foggy && light.kind == LightKind::NoiseFree { LightKind::MatteIndirect } else { light.kind };
            let mut colours: Vec<_> = std::iter::once(light.light).chain(light.joint).collect();
            slots.push(LightSlot { kind, light: index, first: planes, planes: colours.len() });
            planes += colours.len();
            repaired += colours.iter_mut().map(repair).sum::<usize>();
            let black = !colours.iter().any(|plane| par::any(plane.data(), |colour| colour.iter().any(|c| *c != 0.0)));
            stored.push(if black {
                Samples::Black
            } else if kind == LightKind::NoiseFree {
                Samples::Own(colours.iter().map(Weight::new).collect())
            } else {
                let first = packed.len();
                packed.extend(colours.into_iter().map(|plane| (plane, Class::of(kind) == Class::Seen)));
                Samples::Packed(first)
            });
            weights.push(light.weight.map(|plane| {
                let known = shared.iter().find(|(other, _)| Arc::ptr_eq(other, &plane));
                let weight = known.map_or_else(|| Arc::new(Weight::new(&plane)), |(_, weight)| Arc::clone(weight));
                shared.push((plane, Arc::clone(&weight)));
                weight
            }));
            in_beauty.push(light.in_beauty);
        }
        let (w, planes) = (frame.size.width, packed.len());
        let samples = Packed::by_rows(frame.size, planes, |y, row| {
            for (k, (plane, seen)) in packed.iter().enumerate() {
                let pixels = row.chunks_exact_mut(3 * planes).zip(plane.row(y));
                if *seen && features.mirror_colour.is_some() {
                    for (x, (pixel, value)) in pixels.enumerate() {
                        let colour = features.mirror_colour_at(y * w + x);
                        for c in 0..3 {
                            pixel[c * planes + k] = value[c] / colour[c];
                        }
                    }
                } else {
                    for (pixel, value) in pixels {
                        for c in 0..3 {
                            pixel[c * planes + k] = value[c];
                        }
                    }
                }
            }
        });
        let behind: Vec<bool> = shape.iter().map(|(kind, _)| *kind == LightKind::NoiseFree).collect();
        let means = if settings.gather.frames > 0 {
            LightMeans::new(&features, &slots, &behind, &stored, &samples, &settings.gather)
        } else {
            LightMeans::default()
        };
        let unfit = if !samples.beyond.is_empty() {
            Some("colours beyond half precision")
        } else if par::any(&features.surface, |s| s.inverse_depth > MOST_INVERSE_DEPTH) {
            Some("depths next to nothing")
        } else {
            None
        };
        Ok(Self {
            unfit,
            features,
            shape,
            number: frame.number,
            slots,
            stored,
            samples,
            means,
            in_beauty,
            weights,
            alpha: frame.alpha,
            variance: frame.variance,
            repeats_noise: frame.repeats_noise,
            repaired,
        })
    }

    /// Frame number.
    pub fn number(&self) -> i64 {
        self.number
    }

    /// Feature buffers.
    pub fn features(&self) -> &Features {
        &self.features
    }

    /// Rows that motion leads up or down at most, to the frame before and to the next.
    pub fn rows_moved(&self) -> [f32; 2] {
        self.features.rows_moved()
    }

    /// True where `next` comes right after this frame and holds the same lights.
    pub(crate) fn is_followed_by(&self, next: &Self) -> bool {
        self.number.checked_add(1) == Some(next.number) && self.same_kind(next)
    }

    /// Gives back what only the frame's own estimate needs.
    pub(crate) fn estimated(&mut self) {
        self.features.albedo = None;
        self.stored.iter_mut().filter(|s| matches!(s, Samples::Own(_))).for_each(|s| *s = Samples::Gone);
        self.variance = None;
    }

    /// Gives back what nobody asks for once the frame is out.
    pub(crate) fn given_out(&mut self) {
        self.weights.clear();
    }

    /// True where `other` holds the same lights at the same extent.
    fn same_kind(&self, other: &Self) -> bool {
        let (a, b) = (&self.features, &other.features);
        a.size == b.size && a.first_row == b.first_row && self.shape == other.shape
    }

    /// Variance of a light's luminance that the renderer gave, in the light's units; NaN where it is unknown. Renderers
    /// give that of the beauty: other lights have none.
    pub(crate) fn given_variance(&self, slot: &LightSlot) -> Option<Plane<f32>> {
        let given = self.variance.as_ref().filter(|_| slot.kind == LightKind::Beauty)?;
        let weights = self.weights.get(slot.light).and_then(Option::as_deref);
        let width = self.features.size.width;
        Some(par::plane(self.features.size, |x, y| {
            let value = given.at(x, y);
            if !(value.is_finite() && value >= 0.0) {
                return f32::NAN;
            }
            let weight = weights.map_or(1.0, |weight| luminance(weight.at(y * width + x))).max(LEAST_WEIGHT);
            value / (weight * weight)
        }))
    }
}

impl std::fmt::Debug for PreparedFrame {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PreparedFrame").field("number", &self.number).finish_non_exhaustive()
    }
}

/// What is not finite becomes black; how many pixels.
fn repair(plane: &mut Plane<Rgb>) -> usize {
    par::count(plane.data_mut(), |colours| {
        // Seldom: asked of a whole piece at once first.
        let largest = colours.as_flattened().iter().fold(0, |most: u32, v| most.max(v.to_bits() & !(1 << 31)));
        if largest < f32::INFINITY.to_bits() {
            return 0;
        }
        let mut repaired = 0;
        for value in colours.iter_mut().filter(|value| !value.iter().all(|c| c.is_finite())) {
            *value = [0.0; 3];
            repaired += 1;
        }
        repaired
    })
}
