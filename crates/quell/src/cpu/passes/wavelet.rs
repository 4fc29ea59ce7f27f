//! Stage `wavelet`, level by level and row by row.

use crate::kernels::lit_blocks::LitBlocks;
use crate::par;
use crate::plane::Size;
use crate::sequence::settings::Wavelet;
use crate::simd::dispatch;
use crate::stages::wavelet::cpu::{Level, compared_row, stops_row};
use crate::stages::wavelet::{correlation, levels};
use crate::window::{LightSlot, LocalFeatures, Rows};

/// As [`crate::stages::wavelet::reference::run`].
pub(crate) fn run(local: &LocalFeatures, slots: &[LightSlot], colours: Rows, variance: Rows, s: &Wavelet) -> Rows {
    let (mut colours, mut variance) = (colours, variance);
    let most = slots.iter().map(|slot| levels(s, slot.kind)).max().unwrap_or(0);
    let mut stops: Option<Rows> = None;
    for level in 0..most {
        let lit = lit_blocks(slots, &colours, &variance);
        let compared = compared(local, slots, (&colours, &variance, &lit), s);
        let stops = &*stops.get_or_insert_with(|| self::stops(local, slots, &compared, s));
        let active: Vec<usize> = (0..slots.len()).filter(|&l| levels(s, slots[l].kind) > level).collect();
        let (step, correlation) = (1 << level, correlation(level));
        let active = &active;
        let level =
            Level { local, slots, compared: &compared, stops, step, correlation, active, lit: &lit, settings: s };
        filter(&level, &mut colours, &mut variance);
    }
    colours
}

/// Where lights have colour or variance: glass and highlights fill few pixels of most pictures, and what is black stays so.
fn lit_blocks(slots: &[LightSlot], colours: &Rows, variance: &Rows) -> LitBlocks {
    LitBlocks::new(colours.size(), slots.len(), |y, l| {
        let channels = 3 * slots[l].first..3 * (slots[l].first + slots[l].planes);
        channels.map(move |c| colours.row(y, c)).chain(std::iter::once(variance.row(y, l)))
    })
}

fn compared(
    local: &LocalFeatures,
    slots: &[LightSlot],
    (colours, variance, lit): (&Rows, &Rows, &LitBlocks),
    s: &Wavelet,
) -> Rows {
    Rows::written(local.size, 2 * slots.len(), |y, out| {
        dispatch!(crate::simd::level(), simd => compared_row(simd, local, slots, (colours, variance, lit), s, y, out));
    })
}

fn stops(local: &LocalFeatures, slots: &[LightSlot], compared: &Rows, s: &Wavelet) -> Rows {
    Rows::written(local.size, slots.len(), |y, out| {
        dispatch!(crate::simd::level(), simd => stops_row(simd, local, slots, compared, s, y, out));
    })
}

/// Rows that are filtered at once. Few in tests, so that small pictures have some.
const BAND: usize = if cfg!(test) { 8 } else { 64 };

/// Of a band.
const ROWS_OF_A_THREAD: usize = if cfg!(test) { 0 } else { 8 };

/// Filters in place: a second image of all lights would be the largest of all. A band's rows are put where they belong when the next
/// band, which still reads what they were, is done.
fn filter(level: &Level<'_>, colours: &mut Rows, variance: &mut Rows) {
    let Size { width, height } = colours.size();
    let (cw, vw) = (colours.channels() * width, variance.channels() * width);
    // As many rows as a level looks up and down.
    let band = par::band(BAND, ROWS_OF_A_THREAD).max(level.step as usize);
    let buffers = || [par::recycled(cw * band), par::recycled(vw * band)];
    let (mut done, mut next) = ([Vec::new(), Vec::new()], buffers());
    let put = |[c, v]: &[Vec<f32>; 2], first: usize, colours: &mut Rows, variance: &mut Rows| {
        let rows = first..(first + band).min(height);
        par::copy(&mut colours.data_mut()[rows.start * cw..rows.end * cw], &c[..rows.len() * cw]);
        par::copy(&mut variance.data_mut()[rows.start * vw..rows.end * vw], &v[..rows.len() * vw]);
    };
    for first in (0..height).step_by(band) {
        let rows = band.min(height - first);
        let ([c, v], before) = (&mut next, (&*colours, &*variance));
        par::two_rows(&mut c[..rows * cw], cw, &mut v[..rows * vw], vw, |y, colours, variance| {
            dispatch!(crate::simd::level(), simd => level.row(simd, before, first + y, colours, variance));
        });
        if first > 0 {
            put(&done, first - band, colours, variance);
        } else {
            done = buffers();
        }
        std::mem::swap(&mut done, &mut next);
    }
    if height > 0 {
        put(&done, (height - 1) / band * band, colours, variance);
    }
    done.into_iter().chain(next).for_each(par::recycle);
}
