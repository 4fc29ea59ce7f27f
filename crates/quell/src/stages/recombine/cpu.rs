//! Light and colour recombined on all threads.

use super::{factor, mirror_colour};
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
                let mirror = mirror.map_or([1.0; 3], |m| m.at(0, y * width + x));
                for c in 0..3 {
                    value[c] += channels[c][x] * weight[c] * mirror[c];
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
    before: &Plane<Rgb>,
    after: &Plane<Rgb>,
) -> Vec<Vec<Plane<Rgb>>> {
    let (size, width) = (frame.features.size, frame.features.size.width);
    let ratio = par::plane(size, |x, y| factor(before.at(x, y), after.at(x, y)));
    let filtered = |slot: &LightSlot| {
        let mirror = mirror_colour(&frame.features, slot);
        let plane = |k: usize| {
            par::plane(size, |x, y| {
                let mirror = mirror.map_or([1.0; 3], |m| m.at(0, y * width + x));
                [0, 1, 2].map(|c| colours.row(y, 3 * k + c)[x] * mirror[c] * ratio.at(x, y)[c])
            })
        };
        (slot.first..slot.first + slot.planes).map(plane).collect()
    };
    let light = |slot: &LightSlot| match slots.iter().find(|lit| lit.light == slot.light) {
        Some(lit) => filtered(lit),
        None => vec![Plane::filled(size, [0.0; 3]); slot.planes],
    };
    frame.slots.iter().map(light).collect()
}
