//! Edge-avoiding a-trous levels with a luminance stop: Dammertz, Sewtz, Hanika, Lensch (HPG 2010), and the stop by
//! estimated variance of SVGF (Schied et al., HPG 2017).
//!
//! Ours: the compared luminances are means over 3x3 of the same surface, and their squared difference is counted only
//! beyond the variance that both bring along, so that noise alone stops nothing; levels share the weights of guides
//! between all lights.

use super::energy::{Class, Offset, energies, weight};
use super::frame::LightKind;
use super::guides::Local;
use super::member::{Member, Slot};
use super::rows::Rows;
use super::settings::Wavelet;
use super::simd::widest;
use crate::par;
use crate::plane::Size;

/// Half of the B3 spline's kernel, from the centre outwards.
const SPLINE: [f32; 3] = [0.375, 0.25, 0.0625];
/// Luminances of one pixel that differ by less than this share do not differ.
const LEAST_CONTRAST: f32 = 1e-3;

pub(super) fn levels(s: &Wavelet, kind: LightKind) -> u32 {
    match kind {
        LightKind::Steady => 0,
        LightKind::Transmission => s.transmission_levels,
        _ => s.levels,
    }
}

pub(super) fn tolerance(s: &Wavelet, kind: LightKind) -> f32 {
    match kind {
        LightKind::MatteDirect => s.matte_direct,
        LightKind::MatteIndirect | LightKind::Steady => s.matte,
        LightKind::GlossyDirect | LightKind::GlossyIndirect => s.glossy,
        LightKind::Transmission | LightKind::Volume | LightKind::Beauty => s.transmission,
    }
}

/// Filters every light; returns the colours, channels as in [`super::accumulate::Accumulated`].
pub(super) fn wavelet(
    member: &Member,
    local: &Local,
    slots: &[Slot],
    colours: Rows,
    variance: Rows,
    s: &Wavelet,
) -> Rows {
    let size = member.size;
    let (mut colours, mut variance) = (colours, variance);
    let most = slots.iter().map(|slot| levels(s, slot.kind)).max().unwrap_or(0);
    for level in 0..most {
        let compared = compared(size, local, slots, &colours, &variance, s);
        let active: Vec<usize> = (0..slots.len()).filter(|&l| levels(s, slots[l].kind) > level).collect();
        let (step, compared) = (1 << level, &compared);
        let (colours_then, variance_then) = Level {
            member,
            size,
            local,
            slots,
            colours: &colours,
            variance: &variance,
            compared,
            step,
            active: &active,
            settings: s,
        }
        .filter();
        (colours, variance) = (colours_then, variance_then);
    }
    colours
}

/// Two channels a light: mean luminance over 3x3 of the same surface, and its variance.
fn compared(size: Size, local: &Local, slots: &[Slot], colours: &Rows, variance: &Rows, s: &Wavelet) -> Rows {
    let lights = slots.len();
    let mut out = Rows::new(size, 2 * lights);
    par::rows(out.data_mut(), (2 * lights * size.width).max(1), |y, out| {
        widest!(compared_row(size, local, slots, colours, variance, s, y, out));
    });
    out
}

#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "one row of one image, and all that it reads")]
fn compared_row(
    size: Size,
    local: &Local,
    slots: &[Slot],
    colours: &Rows,
    variance: &Rows,
    s: &Wavelet,
    y: usize,
    out: &mut [f32],
) {
    let (w, h) = (size.width, size.height);
    let lights = slots.len();
    let classes: Vec<usize> = slots.iter().map(|s| Class::of(s.kind) as usize).collect();
    let wanted = Class::ALL.map(|c| classes.contains(&(c as usize)));
    let mut energy: [Vec<f32>; 4] = std::array::from_fn(|_| vec![0.0; w]);
    let mut total = vec![0.0f32; lights * w];
    for dy in -1..=1isize {
        for dx in -1..=1isize {
            let Some(o) = Offset::new(w, h, y, dx, dy) else { continue };
            if dx == 0 && dy == 0 {
                energy.iter_mut().for_each(|e| e.fill(0.0));
            } else {
                energies(local, w, &o, s, wanted, &mut energy);
            }
            let share = [2.0, 1.0][dx.unsigned_abs()] * [2.0, 1.0][dy.unsigned_abs()];
            let n = o.to - o.from;
            for (l, slot) in slots.iter().enumerate() {
                let rgb = [0, 1, 2].map(|c| &o.taps(colours.row(o.qy, 3 * slot.first + c))[..n]);
                let var = &o.taps(variance.row(o.qy, l))[..n];
                let energy = &energy[classes[l]][..n];
                let (mean, spread) = out[2 * l * w..][..2 * w].split_at_mut(w);
                let (mean, spread) = (&mut mean[o.from..o.to], &mut spread[o.from..o.to]);
                let total = &mut total[l * w + o.from..][..n];
                for i in 0..n {
                    let g = share * weight(energy[i]);
                    total[i] += g;
                    mean[i] += g * (0.2126 * rgb[0][i] + 0.7152 * rgb[1][i] + 0.0722 * rgb[2][i]);
                    spread[i] += g * g * var[i];
                }
            }
        }
    }
    for l in 0..lights {
        for x in 0..w {
            let total = total[l * w + x];
            out[2 * l * w + x] /= total;
            out[(2 * l + 1) * w + x] /= total * total;
        }
    }
}

/// What one level reads.
struct Level<'a> {
    member: &'a Member,
    size: Size,
    local: &'a Local,
    slots: &'a [Slot],
    colours: &'a Rows,
    variance: &'a Rows,
    compared: &'a Rows,
    step: isize,
    /// The lights that take part.
    active: &'a [usize],
    settings: &'a Wavelet,
}

impl Level<'_> {
    /// The colours and variances after it.
    fn filter(&self) -> (Rows, Rows) {
        let size = self.size;
        let lights = self.slots.len();
        let mut colours = Rows::new(size, self.colours.channels());
        let mut variance = Rows::new(size, lights);
        let (cw, vw) = (self.colours.channels() * size.width, lights * size.width);
        par::two_rows(colours.data_mut(), cw, variance.data_mut(), vw, |y, colours, variance| {
            widest!(self.row(y, colours, variance));
        });
        (colours, variance)
    }

    #[inline(always)]
    fn row(&self, y: usize, out: &mut [f32], out_variance: &mut [f32]) {
        let Self { member, size, local, slots, colours, variance, compared, step, active, settings: s } = *self;
        let (w, h) = (size.width, size.height);
        let lights = slots.len();
        let classes: Vec<usize> = slots.iter().map(|s| Class::of(s.kind) as usize).collect();
        let wanted = Class::ALL.map(|c| active.iter().any(|&l| classes[l] == c as usize));
        for l in (0..lights).filter(|l| !active.contains(l)) {
            let slot = &slots[l];
            for c in 3 * slot.first..3 * (slot.first + slot.planes) {
                out[c * w..][..w].copy_from_slice(colours.row(y, c));
            }
            out_variance[l * w..][..w].copy_from_slice(variance.row(y, l));
        }
        let mut energy: [Vec<f32>; 4] = std::array::from_fn(|_| vec![0.0; w]);
        let mut total = vec![0.0f32; lights * w];
        let mut weights = vec![0.0f32; w];
        // Squared, of every light at every pixel.
        let mut tolerances = vec![0.0f32; lights * w];
        for &l in active {
            let kind = slots[l].kind;
            for (x, squared) in tolerances[l * w..][..w].iter_mut().enumerate() {
                let k = if member.reflects(y * w + x, kind) { s.mirror } else { tolerance(s, kind) };
                *squared = k * k;
            }
        }
        for dy in -2..=2isize {
            for dx in -2..=2isize {
                let Some(o) = Offset::new(w, h, y, dx * step, dy * step) else { continue };
                let n = o.to - o.from;
                let share = SPLINE[dx.unsigned_abs()] * SPLINE[dy.unsigned_abs()];
                let centre = dx == 0 && dy == 0;
                if !centre {
                    energies(local, w, &o, s, wanted, &mut energy);
                }
                for &l in active {
                    let slot = &slots[l];
                    let weights = &mut weights[..n];
                    if centre {
                        weights.fill(share);
                    } else {
                        let squared = &o.centres(&tolerances[l * w..][..w])[..n];
                        let energy = &energy[classes[l]][..n];
                        let mean = |y: usize| compared.row(y, 2 * l);
                        let spread = |y: usize| compared.row(y, 2 * l + 1);
                        let (mp, mq) = (&o.centres(mean(y))[..n], &o.taps(mean(o.qy))[..n]);
                        let (vp, vq) = (&o.centres(spread(y))[..n], &o.taps(spread(o.qy))[..n]);
                        for i in 0..n {
                            let d = mp[i] - mq[i];
                            let v = vp[i] + vq[i];
                            let contrast = LEAST_CONTRAST * mp[i];
                            let stop = (d * d - v).max(0.0) / (squared[i] * v + contrast * contrast + 1e-12);
                            weights[i] = share * weight(energy[i] + stop);
                        }
                    }
                    let total = &mut total[l * w + o.from..][..n];
                    let var = &o.taps(variance.row(o.qy, l))[..n];
                    let sum = &mut out_variance[l * w + o.from..][..n];
                    for i in 0..n {
                        total[i] += weights[i];
                        sum[i] += weights[i] * weights[i] * var[i];
                    }
                    for c in 3 * slot.first..3 * (slot.first + slot.planes) {
                        let colour = &o.taps(colours.row(o.qy, c))[..n];
                        let sum = &mut out[c * w + o.from..][..n];
                        for i in 0..n {
                            sum[i] += weights[i] * colour[i];
                        }
                    }
                }
            }
        }
        for &l in active {
            let slot = &slots[l];
            for x in 0..w {
                let scale = 1.0 / total[l * w + x];
                out_variance[l * w + x] *= scale * scale;
                for c in 3 * slot.first..3 * (slot.first + slot.planes) {
                    out[c * w + x] *= scale;
                }
            }
        }
    }
}
