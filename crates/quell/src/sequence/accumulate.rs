//! The mean of the samples met along each surface's way, its variance, and how many samples it is worth.

use super::energy::{self, Class};
use super::follow::{Tap, taps};
use super::frame::LightKind;
use super::member::Member;
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
    /// Three channels a colour plane: the means.
    pub colours: Rows,
    /// Two channels a light: variance of one sample's luminance, and the samples that the mean is worth.
    pub moments: Rows,
}

fn decay(gather: &Gather, kind: LightKind) -> f32 {
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
    let (w, planes) = (here.size.width, here.planes);
    let powers: Vec<Vec<f32>> = (here.slots.iter())
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
    let looks_through = here.guides.seen.is_some() && here.slots.iter().any(|s| Class::of(s.kind) == Class::Seen);
    let mut colours = Rows::new(here.size, 3 * planes);
    let mut moments = Rows::new(here.size, 2 * here.slots.len());
    par::two_rows(
        colours.data_mut(),
        3 * planes * w,
        moments.data_mut(),
        2 * here.slots.len() * w,
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
                for (l, slot) in here.slots.iter().enumerate() {
                    let (met, seen) = match Class::of(slot.kind) {
                        Class::Seen if here.reflects(p, slot.kind) => (&met_reflected, &seen_reflected[..]),
                        Class::Seen => (&met, &seen[..]),
                        _ => (&met, &[][..]),
                    };
                    let sums = &mut sums[..slot.planes];
                    sums.fill([0.0; 3]);
                    let (mut total, mut squares, mut second) = (0.0f32, 0.0f32, 0.0f32);
                    // Moments about the first sample: differences of large numbers lose less.
                    let start = y * w * planes + x * planes + slot.first;
                    let pivot = luminance(here.samples[start]);
                    for (k, tap) in met.iter().enumerate() {
                        let seen = seen.get(k).copied().unwrap_or(1.0);
                        let weight = tap.weight * powers[l][tap.distance as usize] * seen;
                        if weight == 0.0 {
                            continue;
                        }
                        let start = tap.pixel as usize * planes + slot.first;
                        let samples = &window[tap.frame as usize].samples[start..start + slot.planes];
                        for (sum, sample) in sums.iter_mut().zip(samples) {
                            for c in 0..3 {
                                sum[c] += weight * sample[c];
                            }
                        }
                        let off = luminance(samples[0]) - pivot;
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
    Accumulated { colours, moments }
}

/// How unlike the things are that pixel `p` shows here, and pixel `q` of another frame there, in a mirror or through
/// glass, as the exponent of a weight.
pub(super) fn seen_energy(here: &Member, p: usize, other: &Member, q: usize, gather: &Gather) -> f32 {
    let (Some(a), Some(b)) = (&here.guides.seen, &other.guides.seen) else { return 0.0 };
    let (a, b) = (&a[p], &b[q]);
    let colour = (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>() * 0.5 / (gather.seen_albedo * gather.seen_albedo);
    let cosine = a[3] * b[3] + a[4] * b[4] + a[5] * b[5];
    let has_normals = a[3..] != [0.0; 3] || b[3..] != [0.0; 3];
    colour + if has_normals { gather.seen_normal * (1.0 - cosine) } else { 0.0 }
}
