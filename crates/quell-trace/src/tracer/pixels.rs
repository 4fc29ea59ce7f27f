//! The loop over pixels.

use super::{Control, TraceError};
use crate::integrator::RayCounts;
use quell::Size;
use rayon::prelude::*;
use std::sync::atomic::Ordering;

/// Rows that are traced before the cancel flag is looked at and progress is reported.
const BAND_ROWS: usize = 16;

/// Computes all pixels on rayon's current threads, band by band, and stores them in order. Each pixel depends on
/// nothing but itself: the result has the same bits with any number of threads.
pub(super) fn for_each_pixel<T: Send>(
    size: Size,
    control: &Control<'_>,
    compute: impl Fn(usize, usize, &mut RayCounts) -> T + Sync,
    mut store: impl FnMut(usize, usize, T),
) -> Result<RayCounts, TraceError> {
    /// Pixels of a task: short enough to balance, long enough to be worth handing out.
    const TASK_PIXELS: usize = 64;
    let mut rays = RayCounts::default();
    let mut y0 = 0;
    while y0 < size.height {
        if control.cancel.is_some_and(|c| c.load(Ordering::Relaxed)) {
            return Err(TraceError::Cancelled);
        }
        let rows = BAND_ROWS.min(size.height - y0);
        let pixels = rows * size.width;
        let tasks: Vec<(Vec<T>, RayCounts)> = (0..pixels.div_ceil(TASK_PIXELS))
            .into_par_iter()
            .map(|task| {
                let mut rays = RayCounts::default();
                let range = task * TASK_PIXELS..((task + 1) * TASK_PIXELS).min(pixels);
                let values = range.map(|i| compute(i % size.width, y0 + i / size.width, &mut rays)).collect::<Vec<T>>();
                (values, rays)
            })
            .collect();
        let mut i = 0;
        for (values, task_rays) in tasks {
            rays.add(task_rays);
            for value in values {
                store(i % size.width, y0 + i / size.width, value);
                i += 1;
            }
        }
        y0 += rows;
        if let Some(progress) = control.progress {
            progress(y0 as f32 / size.height as f32);
        }
    }
    Ok(rays)
}
