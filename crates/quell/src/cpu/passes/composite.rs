//! The schedule of the composite: the only pass in the host's order; it cleans what it reads of the frame on the way.

use crate::border::{PlaneName, Sanitised, Tally};
use crate::frame::{Frame, Rgb};
use crate::phased::guides::clean_row;
use crate::phased::rows;
use crate::plane::{Plane, PlaneRef};
use crate::simd::dispatch;
use crate::stages::composite::cpu::add;
use fearless_simd::Level;

/// Pixels at a time.
const RUN: usize = 256;

/// `signals`: filtered matte and glossy, where there are such.
pub(crate) fn run(
    level: Level,
    frame: &Frame<'_>,
    direct: &Plane<Rgb>,
    signals: [Option<&Plane<Rgb>>; 2],
    output: &mut Plane<Rgb>,
    sanitised: &mut Sanitised,
) {
    let tallies: [Tally; 4] = Default::default();
    let weights = [frame.matte_weight, frame.glossy_weight];
    let noisy = [frame.direct_matte, frame.direct_glossy];
    let width = frame.size.width;
    rows::each(output.data_mut(), width, |y, out| {
        dispatch!(level, _simd => {
            for begin in (0..width).step_by(RUN) {
                let n = RUN.min(width - begin);
                let out = &mut out[begin..][..n];
                out.copy_from_slice(&direct.row(y)[begin..][..n]);
                let mut buffers = [[[1.0f32; 3]; RUN]; 2];
                let read = |plane: Option<PlaneRef<'_, Rgb>>, target: &mut [Rgb; RUN], tally: &Tally| {
                    if let Some(plane) = plane {
                        clean_row(&plane.row(y)[begin..][..n], &mut target[..n], tally);
                    }
                    plane.is_some()
                };
                for s in 0..2 {
                    read(weights[s], &mut buffers[s], &tallies[s]);
                }
                for s in 0..2 {
                    if let Some(signal) = signals[s] {
                        let signal = &signal.row(y)[begin..][..n];
                        add(signal.as_flattened(), buffers[s][..n].as_flattened(), out.as_flattened_mut());
                    }
                }
                for s in 0..2 {
                    let mut light = [[0.0f32; 3]; RUN];
                    if read(noisy[s], &mut light, &tallies[2 + s]) {
                        let light = light[..n].as_flattened();
                        add(light, buffers[s][..n].as_flattened(), out.as_flattened_mut());
                    }
                }
            }
        });
    });
    let names = [PlaneName::MatteWeight, PlaneName::GlossyWeight, PlaneName::DirectMatte, PlaneName::DirectGlossy];
    for (name, tally) in names.into_iter().zip(&tallies) {
        sanitised.add(name, tally);
    }
}
