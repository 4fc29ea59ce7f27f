//! Light and colour recombined on all threads.

use super::{factors, mirror_colour, raw};
use crate::frame::Rgb;
use crate::par;
use crate::plane::Plane;
use crate::window::{LightSlot, PreparedFrame, Rows};

/// As [`super::reference::sum`].
pub(crate) fn sum(frame: &PreparedFrame, slots: &[LightSlot], colours: &Rows) -> Plane<Rgb> {
    let mut picture = Plane::filled(frame.features.size, [0.0; 3]);
    let width = frame.features.size.width;
    par::rows(picture.data_mut(), width, |y, row| {
        for slot in slots.iter().filter(|slot| frame.in_beauty[slot.light]) {
            let channels = [0, 1, 2].map(|c| colours.row(y, 3 * slot.first + c));
            let weights = frame.weights[slot.light].as_deref();
            let mirror = mirror_colour(&frame.features, slot);
            for (x, value) in row.iter_mut().enumerate() {
                let weight = weights.map_or([1.0; 3], |w| w.at(y * width + x));
                let mirror = mirror.and_then(|m| m.get(y * width + x)).unwrap_or([1.0; 3]);
                for c in 0..3 {
                    value[c] += channels[c][x] * weight[c] * mirror[c];
                }
            }
        }
    });
    picture
}

/// As [`super::reference::input`].
pub(crate) fn input(frame: &PreparedFrame, slots: &[LightSlot], colours: &Rows) -> Plane<Rgb> {
    let mut picture = Plane::filled(frame.features.size, [0.0; 3]);
    let width = frame.features.size.width;
    par::rows(picture.data_mut(), width, |y, row| {
        for slot in slots.iter().filter(|slot| frame.in_beauty[slot.light]) {
            let weights = frame.weights[slot.light].as_deref();
            let mirror = mirror_colour(&frame.features, slot);
            for (x, value) in row.iter_mut().enumerate() {
                let p = y * width + x;
                let light = raw(frame, slot, 0, p).unwrap_or_else(|| colours.colour(x, y, 3 * slot.first));
                let weight = weights.map_or([1.0; 3], |w| w.at(p));
                let mirror = mirror.and_then(|m| m.get(p)).unwrap_or([1.0; 3]);
                for c in 0..3 {
                    value[c] += light[c] * weight[c] * mirror[c];
                }
            }
        }
    });
    picture
}

/// As [`super::reference::rescale`].
pub(crate) fn rescale(
    frame: &PreparedFrame,
    slots: &[LightSlot],
    colours: &Rows,
    [before, after]: [&Plane<Rgb>; 2],
    shares: Option<&Plane<[f32; 3]>>,
) -> Vec<Vec<Plane<Rgb>>> {
    let (size, width) = (frame.features.size, frame.features.size.width);
    let share = |x: usize, y: usize| shares.map_or([0.0, 0.0, 1.0], |shares| shares.at(x, y));
    let gain = par::plane(size, |x, y| factors(before.at(x, y), after.at(x, y), share(x, y)).1);
    let filtered = |slot: &LightSlot| {
        let mirror = mirror_colour(&frame.features, slot);
        let plane = |k: usize| {
            par::plane(size, |x, y| {
                let p = y * width + x;
                let mirror = mirror.and_then(|m| m.get(p)).unwrap_or([1.0; 3]);
                let (filtered, own) = (colours.colour(x, y, 3 * (slot.first + k)), share(x, y)[0]);
                let raw = if own > 0.0 { raw(frame, slot, k, p).unwrap_or(filtered) } else { filtered };
                let gain = gain.at(x, y);
                [0, 1, 2].map(|c| (filtered[c] + own * (raw[c] - filtered[c]) + gain[c] * filtered[c]) * mirror[c])
            })
        };
        (0..slot.planes).map(plane).collect()
    };
    let light = |slot: &LightSlot| match slots.iter().find(|lit| lit.light == slot.light) {
        Some(lit) => filtered(lit),
        None => vec![Plane::filled(size, [0.0; 3]); slot.planes],
    };
    frame.slots.iter().map(light).collect()
}
