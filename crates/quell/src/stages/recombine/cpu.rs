//! Light and colour recombined on all threads, a row at once: each step is a loop over numbers beside each other, which becomes vectors.

use super::black::BlackPixels;
use super::{factors, mirror_colour};
use crate::frame::Rgb;
use crate::par;
use crate::plane::Plane;
use crate::simd::widest;
use crate::stages::blend::Blend;
use crate::window::{LightSlot, PreparedFrame, Rows, Samples};

/// As [`super::reference::sum`].
pub(crate) fn sum(frame: &PreparedFrame, slots: &[LightSlot], colours: &Rows) -> Plane<Rgb> {
    picture(frame, slots, |slot, y, light| interleave(channels(colours, y, slot, 0), light))
}

/// As [`super::reference::input`].
pub(crate) fn input(frame: &PreparedFrame, slots: &[LightSlot], colours: &Rows) -> Plane<Rgb> {
    picture(frame, slots, |slot, y, light| {
        let mut own = par::unset_scratch(3 * light.len());
        let as_it_came = raw_row(frame, slot, 0, y, &mut own);
        interleave(if as_it_came { &own } else { channels(colours, y, slot, 0) }, light);
    })
}

/// The sum over the lights of the beauty; `of(light, y, row)` gives a row of a light.
fn picture(
    frame: &PreparedFrame,
    slots: &[LightSlot],
    of: impl Fn(&LightSlot, usize, &mut [Rgb]) + Sync + Send,
) -> Plane<Rgb> {
    let mut picture = Plane::filled(frame.features.size, [0.0; 3]);
    let width = frame.features.size.width;
    par::rows(picture.data_mut(), width, |y, row| {
        let mut light = par::unset_scratch(3 * width);
        let (light, _) = light.as_chunks_mut::<3>();
        for slot in slots.iter().filter(|slot| frame.in_beauty[slot.light]) {
            of(slot, y, light);
            widest!(add(frame, slot, y * width, light, row));
        }
    });
    picture
}

/// Adds light * weight * mirror colour of the pixels from `first` on.
#[inline(always)]
fn add(frame: &PreparedFrame, slot: &LightSlot, first: usize, light: &mut [Rgb], picture: &mut [Rgb]) {
    if let Some(weight) = frame.weights[slot.light].as_deref() {
        weight.multiply(first, light);
    }
    reflect(frame, slot, first, light);
    for (sum, light) in picture.as_flattened_mut().iter_mut().zip(light.as_flattened()) {
        *sum += light;
    }
}

/// Multiplies with the colour of mirrors.
#[inline(always)]
fn reflect(frame: &PreparedFrame, slot: &LightSlot, first: usize, light: &mut [Rgb]) {
    let Some(mirror) = mirror_colour(&frame.features, slot) else { return };
    for (x, light) in light.iter_mut().enumerate() {
        if let Some(colour) = mirror.get(first + x) {
            for c in 0..3 {
                light[c] *= colour[c];
            }
        }
    }
}

/// The three channels of a plane of a light, row `y`, one after the other.
fn channels<'a>(colours: &'a Rows, y: usize, slot: &LightSlot, k: usize) -> &'a [f32] {
    &colours.data()[colours.start(y, 3 * (slot.first + k))..][..3 * colours.size().width]
}

/// From three channels, one after the other, to colours.
#[inline(always)]
fn interleave(channels: &[f32], out: &mut [Rgb]) {
    let n = out.len();
    let (r, g, b) = (&channels[..n], &channels[n..2 * n], &channels[2 * n..3 * n]);
    for x in 0..n {
        out[x] = [r[x], g[x], b[x]];
    }
}

/// [`super::raw`] of row `y`, three channels one after the other. False, and nothing is written, where it is not kept.
pub(crate) fn raw_row(frame: &PreparedFrame, slot: &LightSlot, k: usize, y: usize, out: &mut [f32]) -> bool {
    match &frame.stored[slot.light] {
        Samples::Black => out.fill(0.0),
        Samples::Packed(plane) => frame.samples.channels(plane + k, y, out),
        Samples::Own(_) | Samples::Gone => return false,
    }
    true
}

/// Of a pixel the input's share, three gains of the filtered colour, three gains of the whole.
const SCALES: usize = 7;

/// As [`super::reference::rescale`].
pub(crate) fn rescale(
    frame: &PreparedFrame,
    slots: &[LightSlot],
    colours: &Rows,
    [before, after]: [&Plane<Rgb>; 2],
    blend: Option<&Blend>,
) -> Vec<Vec<Plane<Rgb>>> {
    let (size, width) = (frame.features.size, frame.features.size.width);
    // Of a pixel the input's share, the three gains of the filtered colour, and those of the whole.
    let scales = Rows::written(size, SCALES, |y, out| {
        for x in 0..width {
            let (own, gain, whole) = factors(before.at(x, y), after.at(x, y), blend, (x, y));
            out[x] = own;
            for c in 0..3 {
                out[(1 + c) * width + x] = gain[c];
                out[(4 + c) * width + x] = whole[c];
            }
        }
    });
    let black = BlackPixels::new(frame, slots, colours, [before, after], blend);
    let plane = |slot: &LightSlot, k: usize| {
        let mut plane = Plane::filled(size, [0.0; 3]);
        par::rows(plane.data_mut(), width, |y, out| {
            let filtered = channels(colours, y, slot, k);
            let scales = &scales.data()[scales.start(y, 0)..][..SCALES * width];
            let mut light = par::unset_scratch(3 * width);
            let has_share = scales[..width].iter().any(|own| *own > 0.0);
            if !(has_share && raw_row(frame, slot, k, y, &mut light)) {
                light.copy_from_slice(filtered);
            }
            widest!(mix(&mut light, filtered, scales));
            interleave(&light, out);
            reflect(frame, slot, y * width, out);
        });
        black.add_to(&mut plane, slot, k);
        plane
    };
    let light = |slot: &LightSlot| match slots.iter().find(|lit| lit.light == slot.light) {
        Some(lit) => (0..lit.planes).map(|k| plane(lit, k)).collect(),
        None => vec![Plane::filled(size, [0.0; 3]); slot.planes],
    };
    frame.slots.iter().map(light).collect()
}

/// From the light as it came, three channels one after the other, to what it becomes. `scales`: [`SCALES`].
#[inline(always)]
fn mix(light: &mut [f32], filtered: &[f32], scales: &[f32]) {
    let n = light.len() / 3;
    let (own, gains) = scales.split_at(n);
    let (gains, whole) = gains.split_at(3 * n);
    for c in 0..3 {
        let (light, filtered) = (&mut light[c * n..][..n], &filtered[c * n..][..n]);
        let (gain, whole) = (&gains[c * n..][..n], &whole[c * n..][..n]);
        for (x, own) in own.iter().enumerate() {
            let raw = if *own > 0.0 { light[x] } else { filtered[x] };
            light[x] = (filtered[x] + own * (raw - filtered[x]) + gain[x] * filtered[x]) * whole[x];
        }
    }
}
