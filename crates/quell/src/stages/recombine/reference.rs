//! The specification of what makes a picture of light, and passes of a picture.

use super::black::BlackPixels;
use super::{factors, mirror_colour_at, raw, weight_at};
use crate::frame::Rgb;
use crate::plane::Plane;
use crate::stages::blend::Blend;
use crate::window::{LightSlot, PreparedFrame, Rows};

/// The picture: the sum over the lights of the beauty. `colours`: three channels a plane, as `slots` place them.
pub fn sum(frame: &PreparedFrame, slots: &[LightSlot], colours: &Rows) -> Plane<Rgb> {
    let size = frame.features.size;
    Plane::from_fn(size, |x, y| {
        let mut picture = [0.0f64; 3];
        for slot in slots.iter().filter(|slot| frame.in_beauty[slot.light]) {
            let p = y * size.width + x;
            let light = colours.colour(x, y, 3 * slot.first);
            let weight = weight_at(frame, slot, p);
            let mirror = mirror_colour_at(&frame.features, slot, p);
            for c in 0..3 {
                picture[c] += f64::from(light[c]) * f64::from(weight[c]) * f64::from(mirror[c]);
            }
        }
        picture.map(|v| v as f32)
    })
}

/// The same of the light as it came; light that is not kept comes out as it went in, and lies in `colours`.
pub fn input(frame: &PreparedFrame, slots: &[LightSlot], colours: &Rows) -> Plane<Rgb> {
    let mut unfiltered = colours.clone();
    let size = frame.features.size;
    for slot in slots {
        for p in 0..size.pixels() {
            if let Some(light) = raw(frame, slot, 0, p) {
                for (c, value) in light.into_iter().enumerate() {
                    unfiltered.set(p % size.width, p / size.width, 3 * slot.first + c, value);
                }
            }
        }
    }
    sum(frame, slots, &unfiltered)
}

/// Every plane of every light of the frame, without its weight, as the picture is made of input, wavelet's picture (`before`) and
/// stabilised one (`after`); without shares it is the last. Lights that are black all over the window are black.
pub fn rescale(
    frame: &PreparedFrame,
    slots: &[LightSlot],
    colours: &Rows,
    [before, after]: [&Plane<Rgb>; 2],
    blend: Option<&Blend>,
) -> Vec<Vec<Plane<Rgb>>> {
    let size = frame.features.size;
    let black = BlackPixels::new(frame, slots, colours, [before, after], blend);
    let mut lights: Vec<Vec<Plane<Rgb>>> =
        frame.slots.iter().map(|slot| vec![Plane::filled(size, [0.0; 3]); slot.planes]).collect();
    for slot in slots {
        for (k, plane) in lights[slot.light].iter_mut().enumerate() {
            for (p, value) in plane.data_mut().iter_mut().enumerate() {
                let filtered = colours.colour(p % size.width, p / size.width, 3 * (slot.first + k));
                let unfiltered = raw(frame, slot, k, p).unwrap_or(filtered);
                let mirror = mirror_colour_at(&frame.features, slot, p);
                let at = (p % size.width, p / size.width);
                let (own, gain, whole) = factors(before.data()[p], after.data()[p], blend, at);
                *value = [0, 1, 2].map(|c| {
                    let mixture = filtered[c] + own * (unfiltered[c] - filtered[c]) + gain[c] * filtered[c];
                    mixture * whole[c] * mirror[c]
                });
            }
            black.add_to(plane, slot, k);
        }
    }
    lights
}
