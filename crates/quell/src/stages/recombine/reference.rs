//! The specification of what makes a picture of light, and passes of a picture.

use super::{factor, mirror_colour};
use crate::frame::Rgb;
use crate::plane::Plane;
use crate::window::{LightSlot, PreparedFrame, Rows};

/// The picture: the sum over the lights of the beauty. `colours`: three channels a plane, as `slots` place them.
pub fn sum(frame: &PreparedFrame, slots: &[LightSlot], colours: &Rows) -> Plane<Rgb> {
    let size = frame.features.size;
    Plane::from_fn(size, |x, y| {
        let mut picture = [0.0f64; 3];
        for slot in slots.iter().filter(|slot| frame.in_beauty[slot.light]) {
            let p = y * size.width + x;
            let light = colours.colour(x, y, 3 * slot.first);
            let weight = frame.weights[slot.light].as_ref().map_or([1.0; 3], |weight| weight.at(p));
            let mirror = mirror_colour(&frame.features, slot).map_or([1.0; 3], |colour| colour.at(0, p));
            for c in 0..3 {
                picture[c] += f64::from(light[c]) * f64::from(weight[c]) * f64::from(mirror[c]);
            }
        }
        picture.map(|v| v as f32)
    })
}

/// Every plane of every light of the frame, without its weight, scaled by what `stabilise` made of the picture (`before`,
/// `after`). Lights that are black all over the window are black.
pub fn rescale(
    frame: &PreparedFrame,
    slots: &[LightSlot],
    colours: &Rows,
    before: &Plane<Rgb>,
    after: &Plane<Rgb>,
) -> Vec<Vec<Plane<Rgb>>> {
    let size = frame.features.size;
    let mut lights: Vec<Vec<Plane<Rgb>>> =
        frame.slots.iter().map(|slot| vec![Plane::filled(size, [0.0; 3]); slot.planes]).collect();
    for slot in slots {
        for (k, plane) in lights[slot.light].iter_mut().enumerate() {
            for y in 0..size.height {
                for x in 0..size.width {
                    let p = y * size.width + x;
                    let light = colours.colour(x, y, 3 * (slot.first + k));
                    let mirror = mirror_colour(&frame.features, slot).map_or([1.0; 3], |colour| colour.at(0, p));
                    let factor = factor(before.data()[p], after.data()[p]);
                    plane.data_mut()[p] = [0, 1, 2].map(|c| light[c] * mirror[c] * factor[c]);
                }
            }
        }
    }
    lights
}
