//! A frame of the window, made ready: what the stages need of it and no more.

use super::energy::Class;
use super::frame::{Light, LightKind, SequenceFrame};
use super::guides::Guides;
use super::packed::{Packed, Weight};
use crate::frame::Rgb;
use crate::plane::{Plane, Size};
use std::sync::Arc;

/// A light's place among the packed samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
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
pub(super) enum Stored {
    /// Nowhere: it is black all over.
    Black,
    /// Among the packed ones, from this plane on.
    Packed(usize),
    /// In full, since it comes out as it went in; nobody else reads them.
    Own(Vec<Plane<Rgb>>),
    /// It was [`Stored::Own`], and the frame is filtered.
    Gone,
}

/// A frame of the window, or a band of its rows.
#[derive(Clone)]
pub(super) struct Member {
    pub number: i64,
    /// Extent of what is here.
    pub size: Size,
    /// Row of the picture at which it begins, and rows of the picture.
    pub first_row: usize,
    pub picture_height: usize,
    /// Every light of the frame.
    pub slots: Vec<Slot>,
    /// Kinds and colour planes of the lights as they came: what a neighbour must share.
    shape: Vec<(LightKind, usize)>,
    /// Of each light.
    pub stored: Vec<Stored>,
    pub samples: Packed,
    /// What multiplies each light back; `None`: 1.
    pub weights: Vec<Option<Arc<Weight>>>,
    /// What reflections and refractions were divided by: the colour of what a mirror or a glass shows. `None`: nothing.
    pub seen_colour: Option<Packed>,
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
    /// What shaders cannot be trusted with; of the whole frame, so that bands decide alike.
    pub unfit: Option<&'static str>,
}

/// Inverse depths beyond it cannot be squared and divided in 32 bits without infinities, which shaders need not have.
const MOST_INVERSE_DEPTH: f32 = 1e15;

impl Member {
    /// Takes the frame apart. What is not finite becomes 0 and is counted.
    pub(super) fn new(frame: SequenceFrame) -> (Self, usize) {
        let guides = Guides::new(&frame);
        // In a medium even what is steady behind it has noise: whether a ray gets there is chance.
        let lit = |light: &Light| light.light.data().iter().flatten().any(|&c| c > 0.0);
        let foggy = frame.lights.iter().any(|l| l.kind == LightKind::Volume && lit(l));
        let seen_colour = seen_colour(&frame);
        let shape = frame.lights.iter().map(|l| (l.kind, 1 + l.joint.len())).collect();
        let mut slots = Vec::with_capacity(frame.lights.len());
        let mut stored = Vec::with_capacity(frame.lights.len());
        let mut weights: Vec<Option<Arc<Weight>>> = Vec::with_capacity(frame.lights.len());
        let mut in_beauty = Vec::with_capacity(frame.lights.len());
        // Planes to be packed, with the question whether they are seen in mirrors.
        let mut packed: Vec<(Plane<Rgb>, bool)> = Vec::new();
        let mut shared: Vec<(Arc<Plane<Rgb>>, Arc<Weight>)> = Vec::new();
        let (mut planes, mut repaired) = (0, 0);
        for (index, light) in frame.lights.into_iter().enumerate() {
            let kind = if foggy && light.kind == LightKind::Steady { LightKind::MatteIndirect } else { light.kind };
            let mut colours: Vec<_> = std::iter::once(light.light).chain(light.joint).collect();
            slots.push(Slot { kind, light: index, first: planes, planes: colours.len() });
            planes += colours.len();
            repaired += colours.iter_mut().map(repair).sum::<usize>();
            let black = colours.iter().all(|plane| plane.data().iter().flatten().all(|c| *c == 0.0));
            stored.push(if black {
                Stored::Black
            } else if kind == LightKind::Steady {
                Stored::Own(colours)
            } else {
                let first = packed.len();
                packed.extend(colours.into_iter().map(|plane| (plane, Class::of(kind) == Class::Seen)));
                Stored::Packed(first)
            });
            weights.push(light.weight.map(|plane| {
                let known = shared.iter().find(|(other, _)| Arc::ptr_eq(other, &plane));
                let weight = known.map_or_else(|| Arc::new(Weight::new(&plane)), |(_, weight)| Arc::clone(weight));
                shared.push((plane, Arc::clone(&weight)));
                weight
            }));
            in_beauty.push(light.in_beauty);
        }
        let samples = Packed::new(frame.size, packed.len(), |k, i| {
            let (plane, seen) = &packed[k];
            let value = plane.data()[i];
            match seen_colour.as_ref().filter(|_| *seen) {
                None => value,
                Some(colour) => {
                    let colour = colour.at(0, i);
                    [0, 1, 2].map(|c| value[c] / colour[c])
                }
            }
        });
        let unfit = if !samples.beyond.is_empty() {
            Some("colours beyond half precision")
        } else if guides.surface.iter().any(|s| s.inverse_depth > MOST_INVERSE_DEPTH) {
            Some("depths next to nothing")
        } else {
            None
        };
        let member = Self {
            unfit,
            seen_colour,
            shape,
            number: frame.number,
            size: frame.size,
            first_row: 0,
            picture_height: frame.size.height,
            slots,
            stored,
            samples,
            in_beauty,
            weights,
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
        self.guides.albedo = None;
        self.stored.iter_mut().filter(|s| matches!(s, Stored::Own(_))).for_each(|s| *s = Stored::Gone);
        self.variance = None;
    }

    /// True where pixel `p` is a mirror or glass.
    pub(super) fn specular(&self, p: usize) -> bool {
        self.seen_colour.as_ref().is_some_and(|s| s.at(0, p) != [1.0; 3])
    }

    /// True where light of that kind is the image of other things in a mirror or glass: it moves by its own motion.
    pub(super) fn reflects(&self, p: usize, kind: LightKind) -> bool {
        Self::can_reflect(kind) && self.specular(p)
    }

    /// True where mirrors and glass show light of that kind.
    pub(super) fn can_reflect(kind: LightKind) -> bool {
        matches!(kind, LightKind::GlossyIndirect | LightKind::Transmission)
    }

    /// Gives back what nobody asks for once the frame is out.
    pub(super) fn given_out(&mut self) {
        self.weights.clear();
    }

    /// Rows that motion leads up or down at most, to the frame before and to the next, as far as it stays in the picture.
    pub(super) fn rows_moved(&self) -> [f32; 2] {
        let height = self.picture_height as f32;
        let most = |motion: &Option<Plane<[f32; 2]>>| {
            let Some(motion) = motion else { return 0.0 };
            let moved = motion.data().iter().enumerate().map(|(i, m)| {
                let y = (self.first_row + i / self.size.width) as f32 + m[1];
                if y > -2.0 && y < height + 1.0 { m[1].abs() } else { 0.0 }
            });
            moved.fold(0.0, f32::max)
        };
        [
            most(&self.motion_to_previous).max(most(&self.reflection_to_previous)),
            most(&self.motion_to_next).max(most(&self.reflection_to_next)),
        ]
    }

    /// The row here of a row of the picture, where it is here.
    #[inline(always)]
    pub(super) fn row_here(&self, y: isize) -> Option<usize> {
        let here = y - self.first_row as isize;
        (here >= 0 && here < self.size.height as isize).then_some(here as usize)
    }

    /// True where `other` holds the same lights at the same extent.
    pub(super) fn same_kind(&self, other: &Self) -> bool {
        self.size == other.size && self.first_row == other.first_row && self.shape == other.shape
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
        match &mut self.motion_to_next {
            None => self.motion_to_next = Some(motion),
            Some(known) => {
                for (known, found) in known.data_mut().iter_mut().zip(motion.data()) {
                    if known.iter().any(|v| v.is_nan()) {
                        *known = *found;
                    }
                }
            }
        }
    }

    /// True where motion to the next frame is unknown somewhere: files hold none for the sky.
    pub(super) fn lacks_motion_to_next(&self) -> bool {
        self.motion_to_next.as_ref().is_none_or(|motion| motion.data().iter().flatten().any(|v| v.is_nan()))
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
fn seen_colour(frame: &SequenceFrame) -> Option<Packed> {
    let matte = |l: &&Light| matches!(l.kind, LightKind::MatteDirect | LightKind::MatteIndirect);
    let diffuse = frame.lights.iter().filter(matte).find_map(|l| l.weight.as_deref());
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
    Some(Packed::new(frame.size, 1, |_, i| colours[i]))
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
        frame.lights.iter().filter(|l| Class::of(l.kind) == Class::Seen).filter_map(|l| l.weight.as_deref()).collect();
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

/// What is not finite becomes black; how many pixels.
fn repair(plane: &mut Plane<Rgb>) -> usize {
    let mut repaired = 0;
    for value in plane.data_mut().iter_mut().filter(|value| !value.iter().all(|c| c.is_finite())) {
        *value = [0.0; 3];
        repaired += 1;
    }
    repaired
}
