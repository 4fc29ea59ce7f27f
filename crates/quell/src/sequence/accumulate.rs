//! The mean of the samples met along each surface's way, its variance, and how many samples it is worth.

use super::energy::{self, Class};
use super::follow::{Tap, taps};
use super::frame::LightKind;
use super::member::{Member, Slot, Stored};
use super::rows::Rows;
use super::settings::Gather;
use crate::frame::Rgb;
use crate::par;

/// Luminance of linear Rec. 709.
pub(super) fn luminance(c: Rgb) -> f32 {
    0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
}

/// What is known of every light before any filter over the image.
pub(super) struct Accumulated {
    /// The lights that are not black all over the window, with their places in the images below.
    pub slots: Vec<Slot>,
    /// Three channels a colour plane: the means.
    pub colours: Rows,
    /// Two channels a light: variance of one sample's luminance, and the samples that the mean is worth.
    pub moments: Rows,
}

pub(super) fn decay(gather: &Gather, kind: LightKind) -> f32 {
    match kind {
        LightKind::GlossyDirect => gather.glossy_direct_decay,
        LightKind::GlossyIndirect => gather.glossy_decay,
        LightKind::Transmission => gather.transmission_decay,
        LightKind::Steady => 0.0,
        LightKind::MatteDirect | LightKind::MatteIndirect | LightKind::Volume | LightKind::Beauty => gather.matte_decay,
    }
}

/// Means over the window for every light of `window[centre]`.
///
/// A tap is a pixel of some frame with weight w; the mean is worth n = (sum w)^2 / sum w^2 samples, and the variance of
/// one sample is the weighted spread times n / (n - 1).
pub(super) fn accumulate(window: &[&Member], centre: usize, gather: &Gather) -> Accumulated {
    let here = window[centre];
    let slots = lit(window, centre);
    let w = here.size.width;
    let planes = slots.iter().map(|s| s.planes).sum::<usize>();
    let powers: Vec<Vec<f32>> = (slots.iter())
        .map(|s| {
            (0..=gather.frames)
                .scan(1.0, |p, _| {
                    let now = *p;
                    *p *= decay(gather, s.kind);
                    Some(now)
                })
                .collect()
        })
        .collect();
    // Of each light, where each frame of the window has it.
    let places: Vec<Vec<Place>> = (slots.iter())
        .map(|slot| {
            let place = |m: &&Member| match m.stored[slot.light] {
                Stored::Packed(first) => Place::At(first),
                Stored::Black => Place::Black,
                Stored::Own(_) | Stored::Gone => Place::Unknown,
            };
            window.iter().map(place).collect()
        })
        .collect();
    let looks_through = here.guides.seen.is_some() && slots.iter().any(|s| Class::of(s.kind) == Class::Seen);
    let mut colours = Rows::new(here.size, 3 * planes);
    let mut moments = Rows::new(here.size, 2 * slots.len());
    par::two_rows(
        colours.data_mut(),
        3 * planes * w,
        moments.data_mut(),
        2 * slots.len() * w,
        |y, colours, moments| {
            // Along the surface's way, and along that of what a mirror shows.
            let (mut met, mut met_reflected): (Vec<Tap>, Vec<Tap>) = (Vec::new(), Vec::new());
            let mut sums = vec![[0.0f32; 3]; planes];
            let (mut seen, mut seen_reflected): (Vec<f32>, Vec<f32>) = (Vec::new(), Vec::new());
            for x in 0..w {
                let p = y * w + x;
                taps(window, centre, p, false, gather, &mut met);
                let likeness =
                    |t: &Tap| energy::weight(seen_energy(here, p, window[t.frame as usize], t.pixel as usize, gather));
                seen.clear();
                if looks_through {
                    seen.extend(met.iter().map(likeness));
                }
                if here.specular(p) {
                    taps(window, centre, p, true, gather, &mut met_reflected);
                    seen_reflected.clear();
                    seen_reflected.extend(met_reflected.iter().map(likeness));
                }
                for (l, slot) in slots.iter().enumerate() {
                    if let Stored::Own(own) = &here.stored[slot.light] {
                        for (k, plane) in own.iter().enumerate() {
                            for (c, value) in plane.data()[p].into_iter().enumerate() {
                                colours[(3 * (slot.first + k) + c) * w + x] = value;
                            }
                        }
                        moments[(2 * l + 1) * w + x] = 1.0;
                        continue;
                    }
                    let (met, seen) = match Class::of(slot.kind) {
                        Class::Seen if here.reflects(p, slot.kind) => (&met_reflected, &seen_reflected[..]),
                        Class::Seen => (&met, &seen[..]),
                        _ => (&met, &[][..]),
                    };
                    let sums = &mut sums[..slot.planes];
                    sums.fill([0.0; 3]);
                    let (mut total, mut squares, mut second) = (0.0f32, 0.0f32, 0.0f32);
                    // Moments about the first sample: differences of large numbers lose less.
                    let pivot = match places[l][centre] {
                        Place::At(first) => luminance(here.samples.at(first, y * w + x)),
                        _ => 0.0,
                    };
                    for (k, tap) in met.iter().enumerate() {
                        let seen = seen.get(k).copied().unwrap_or(1.0);
                        let weight = tap.weight * powers[l][tap.distance as usize] * seen;
                        if weight == 0.0 {
                            continue;
                        }
                        let (frame, pixel) = (tap.frame as usize, tap.pixel as usize);
                        let mut off = -pivot;
                        if places[l][frame] == Place::Unknown {
                            continue;
                        }
                        if let Place::At(first) = places[l][frame] {
                            let samples = &window[frame].samples;
                            let sample = samples.at(first, pixel);
                            off = luminance(sample) - pivot;
                            for c in 0..3 {
                                sums[0][c] += weight * sample[c];
                            }
                            for (k, sum) in sums.iter_mut().enumerate().skip(1) {
                                let sample = samples.at(first + k, pixel);
                                for c in 0..3 {
                                    sum[c] += weight * sample[c];
                                }
                            }
                        }
                        second += weight * off * off;
                        total += weight;
                        squares += weight * weight;
                    }
                    for (k, sum) in sums.iter().enumerate() {
                        for c in 0..3 {
                            colours[(3 * (slot.first + k) + c) * w + x] = sum[c] / total;
                        }
                    }
                    let count = total * total / squares;
                    let mean = luminance(sums[0].map(|s| s / total)) - pivot;
                    let spread = (second / total - mean * mean).max(0.0);
                    moments[2 * l * w + x] = if count > 1.01 { spread * count / (count - 1.0) } else { 0.0 };
                    moments[(2 * l + 1) * w + x] = count;
                }
            }
        },
    );
    Accumulated { slots, colours, moments }
}

/// Where a frame of the window has a light.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    /// It is black there.
    Black,
    /// Among its samples, from this plane on.
    At(usize),
    /// It was clean there and is not kept.
    Unknown,
}

/// The lights that are not black all over the window, packed one after the other.
pub(super) fn lit(window: &[&Member], centre: usize) -> Vec<Slot> {
    let black = |m: &Member, light: usize| matches!(m.stored[light], Stored::Black);
    let mut first = 0;
    let lit = window[centre].slots.iter().filter(|slot| match slot.kind {
        LightKind::Steady => !black(window[centre], slot.light),
        _ => window.iter().any(|m| !black(m, slot.light)),
    });
    let packed = lit.map(|slot| {
        let slot = Slot { first, ..*slot };
        first += slot.planes;
        slot
    });
    packed.collect()
}

/// How unlike the things are that pixel `p` shows here, and pixel `q` of another frame there, in a mirror or through
/// glass, as the exponent of a weight.
pub(super) fn seen_energy(here: &Member, p: usize, other: &Member, q: usize, gather: &Gather) -> f32 {
    let (Some(a), Some(b)) = (&here.guides.seen, &other.guides.seen) else { return 0.0 };
    // Light that was divided by what it shows never mixes with light that was not.
    if here.specular(p) != other.specular(q) {
        return 1e9;
    }
    let (ca, cb) = (a.at(0, p), b.at(0, q));
    let (na, nb) = (a.at(1, p), b.at(1, q));
    let colour = (0..3).map(|c| (ca[c] - cb[c]).powi(2)).sum::<f32>() * 0.5 / (gather.seen_albedo * gather.seen_albedo);
    let cosine = na[0] * nb[0] + na[1] * nb[1] + na[2] * nb[2];
    let has_normals = na != [0.0; 3] || nb != [0.0; 3];
    colour + if has_normals { gather.seen_normal * (1.0 - cosine) } else { 0.0 }
}
