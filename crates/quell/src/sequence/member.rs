//! A frame of the window, made ready: what the stages need of it and no more.

use super::energy::Class;
use super::frame::{Light, LightKind, SequenceFrame};
use super::guides::{Guides, Local};
use crate::frame::Rgb;
use crate::plane::{Plane, Size};

/// A light's place among the packed samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    pub kind: LightKind,
    /// First of its colour planes among all.
    pub first: usize,
    /// Its colour planes: itself and its joint planes.
    pub planes: usize,
}

/// A frame of the window.
pub(super) struct Member {
    pub number: i64,
    pub size: Size,
    pub slots: Vec<Slot>,
    /// Kinds and colour planes of the lights as they came: what a neighbour must share.
    shape: Vec<(LightKind, usize)>,
    /// Colour planes in all.
    pub planes: usize,
    /// All colour planes of all lights, pixel by pixel: a tap reads one run of memory.
    pub samples: Vec<Rgb>,
    /// What multiplies each light back; `None`: 1.
    pub weights: Vec<Option<Plane<Rgb>>>,
    /// What reflections and refractions were divided by: the colour of what a mirror or a glass shows. `None`: nothing.
    pub seen_colour: Option<Vec<Rgb>>,
    pub in_beauty: Vec<bool>,
    pub guides: Guides,
    pub motion_to_previous: Option<Plane<[f32; 2]>>,
    pub motion_to_next: Option<Plane<[f32; 2]>>,
    /// Likewise of what mirrors and glass show; elsewhere the surface's. `None`: the surface's everywhere.
    pub reflection_to_previous: Option<Plane<[f32; 2]>>,
    pub reflection_to_next: Option<Plane<[f32; 2]>>,
    pub alpha: Option<Plane<f32>>,
    pub variance: Option<Plane<f32>>,
    pub repeats_noise: bool,
}

impl Member {
    /// Takes the frame apart. What is not finite becomes 0 and is counted.
    pub(super) fn new(frame: SequenceFrame) -> (Self, usize) {
        let mut guides = Guides::new(&frame);
        let mut slots = Vec::with_capacity(frame.lights.len());
        let mut planes = 0;
        // In a medium even what is steady behind it has noise: whether a ray gets there is chance.
        let lit = |light: &Light| light.light.data().iter().flatten().any(|&c| c > 0.0);
        let foggy = frame.lights.iter().any(|l| l.kind == LightKind::Volume && lit(l));
        for light in &frame.lights {
            let kind = if foggy && light.kind == LightKind::Steady { LightKind::MatteIndirect } else { light.kind };
            slots.push(Slot { kind, first: planes, planes: 1 + light.joint.len() });
            planes += 1 + light.joint.len();
        }
        let mut samples = vec![[0.0; 3]; frame.size.pixels() * planes];
        let mut repaired = 0;
        let colours = frame.lights.iter().flat_map(|l| std::iter::once(&l.light).chain(&l.joint));
        for (k, plane) in colours.enumerate() {
            for (value, sample) in plane.data().iter().zip(samples.iter_mut().skip(k).step_by(planes)) {
                if value.iter().all(|c| c.is_finite()) {
                    *sample = *value;
                } else {
                    repaired += 1;
                }
            }
        }
        let seen_colour = seen_colour(&frame);
        if let Some(seen) = &seen_colour {
            guides.set_apart(seen);
            for slot in slots.iter().filter(|s| Class::of(s.kind) == Class::Seen) {
                for (pixel, colour) in samples.chunks_exact_mut(planes).zip(seen) {
                    for sample in &mut pixel[slot.first..slot.first + slot.planes] {
                        for c in 0..3 {
                            sample[c] /= colour[c];
                        }
                    }
                }
            }
        }
        let member = Self {
            seen_colour,
            shape: frame.lights.iter().map(|l| (l.kind, 1 + l.joint.len())).collect(),
            number: frame.number,
            size: frame.size,
            slots,
            planes,
            samples,
            in_beauty: frame.lights.iter().map(|l| l.in_beauty).collect(),
            weights: frame.lights.into_iter().map(|l| l.weight).collect(),
            guides,
            motion_to_previous: frame.motion_to_previous,
            motion_to_next: frame.motion_to_next,
            reflection_to_previous: None,
            reflection_to_next: None,
            alpha: frame.alpha,
            variance: frame.variance,
            repeats_noise: frame.repeats_noise,
        };
        (member, repaired)
    }

    /// Gives back what only the frame's own estimate needs.
    pub(super) fn estimated(&mut self) {
        self.guides.local = Local::default();
        self.weights.iter_mut().for_each(|w| *w = None);
        self.variance = None;
    }

    /// True where pixel `p` is a mirror or glass.
    pub(super) fn specular(&self, p: usize) -> bool {
        self.seen_colour.as_ref().is_some_and(|s| s[p] != [1.0; 3])
    }

    /// True where light of that kind is the image of other things in a mirror or glass: it moves by its own motion.
    pub(super) fn reflects(&self, p: usize, kind: LightKind) -> bool {
        matches!(kind, LightKind::GlossyIndirect | LightKind::Transmission) && self.specular(p)
    }

    /// True where `other` holds the same lights at the same extent.
    pub(super) fn same_kind(&self, other: &Self) -> bool {
        self.size == other.size && self.shape == other.shape
    }

    /// Motion to the next frame from that frame's motion to this one: each of its pixels tells where it was; of those
    /// that meet in a pixel the nearest to the eye wins.
    pub(super) fn derive_motion_to_next(&mut self, next: &Self) {
        let (w, h) = (self.size.width, self.size.height);
        let Some(back) = &next.motion_to_previous else { return };
        let mut motion = Plane::filled(self.size, [f32::NAN; 2]);
        let mut nearest = vec![f32::MIN; w * h];
        for y in 0..h {
            for x in 0..w {
                let m = back.at(x, y);
                let (px, py) = ((x as f32 + m[0]).round(), (y as f32 + m[1]).round());
                if !(px >= 0.0 && py >= 0.0 && px < w as f32 && py < h as f32) {
                    continue;
                }
                let p = py as usize * w + px as usize;
                let closeness = next.guides.surface[y * w + x].inverse_depth;
                if closeness > nearest[p] {
                    nearest[p] = closeness;
                    motion.data_mut()[p] = [-m[0], -m[1]];
                }
            }
        }
        self.motion_to_next = Some(motion);
    }
}

/// A surface whose matte colour is less than this share of its glossy or transmitted colour is a mirror or glass: what
/// else a pixel of its edge holds counts little.
const SPECULAR_SHARE: f32 = 0.1;
/// Colour that is assumed where glossy light has none of its own.
const UNKNOWN_COLOUR: f32 = 0.2;
/// Least colour that light is divided by.
const LEAST_COLOUR: f32 = 0.02;

/// The colour of what is seen in mirrors and through glass; 1 elsewhere. Divided by it, a reflection is as smooth as the
/// light on the things reflected. Where a surface has a diffuse colour of its own (what multiplies matte light, or else the
/// albedo), the renderer's `seen` albedo is that colour, which the reflection does not carry.
fn seen_colour(frame: &SequenceFrame) -> Option<Vec<Rgb>> {
    let matte = |l: &&Light| matches!(l.kind, LightKind::MatteDirect | LightKind::MatteIndirect);
    let diffuse = frame.lights.iter().filter(matte).find_map(|l| l.weight.as_ref());
    let (seen, diffuse) = (frame.seen_albedo.as_ref()?, diffuse.or(frame.albedo.as_ref())?);
    let mut specular = vec![0.0f32; frame.size.pixels()];
    for light in frame.lights.iter().filter(|l| Class::of(l.kind) == Class::Seen) {
        match &light.weight {
            Some(weight) => {
                for (specular, w) in specular.iter_mut().zip(weight.data()) {
                    *specular = w.iter().copied().fold(*specular, f32::max);
                }
            }
            None => specular.iter_mut().for_each(|s| *s = s.max(UNKNOWN_COLOUR)),
        }
    }
    let pixel = |((seen, diffuse), specular): ((&Rgb, &Rgb), &f32)| {
        let specular = diffuse.iter().all(|&c| c < SPECULAR_SHARE * specular);
        let lit = seen.iter().all(|c| c.is_finite()) && seen.iter().any(|&c| c > 0.0);
        if specular && lit { seen.map(|c| c.max(LEAST_COLOUR)) } else { [1.0; 3] }
    };
    let mut colours: Vec<Rgb> = seen.data().iter().zip(diffuse.data()).zip(&specular).map(pixel).collect();
    divide_edges(frame, &mut colours);
    Some(colours)
}

/// Colour of reflections and refractions from which a pixel at a mirror's edge counts as part of it.
const PARTLY_SPECULAR: f32 = 0.2;

/// A pixel at the edge of a mirror shows mirror and frame, so it has a diffuse colour; its reflection is the mirror's
/// all the same, and is divided by what its neighbours in the mirror were: else light that was divided would be mixed with
/// light that was not (a dotted white line around mirrors).
fn divide_edges(frame: &SequenceFrame, colours: &mut [Rgb]) {
    let (w, h) = (frame.size.width, frame.size.height);
    let inner = colours.to_vec();
    let weights: Vec<&Plane<Rgb>> =
        frame.lights.iter().filter(|l| Class::of(l.kind) == Class::Seen).filter_map(|l| l.weight.as_ref()).collect();
    for y in 0..h {
        for x in 0..w {
            let reflects = || weights.iter().any(|plane| plane.at(x, y).iter().any(|&c| c > PARTLY_SPECULAR));
            if inner[y * w + x] != [1.0; 3] || !reflects() {
                continue;
            }
            let (mut sum, mut count) = ([0.0; 3], 0.0);
            for v in y.saturating_sub(1)..(y + 2).min(h) {
                for near in &inner[v * w + x.saturating_sub(1)..v * w + (x + 2).min(w)] {
                    if *near != [1.0; 3] {
                        count += 1.0;
                        for c in 0..3 {
                            sum[c] += near[c];
                        }
                    }
                }
            }
            if count > 0.0 {
                colours[y * w + x] = sum.map(|c| c / count);
            }
        }
    }
}
