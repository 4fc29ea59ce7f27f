//! The net's form of the stage, row by row.

use super::cpu::{Fronts, Track, Tracks};
use super::{
    BOUNDED, BRIGHTNESS, BandwidthLanes, Bounds, LEAST_OWN, LIGHT, PARTS, ShownLanes, StabiliseFrame, TAP_RADIUS,
    bandwidth_lanes, log_brightness, own_weight, restored,
};
#[cfg(feature = "internals")]
use super::{Signature, signature_at};
use crate::frame::Rgb;
use crate::kernels::bands_cpu::{Band, around as rows_around, bands, mean_colours};
use crate::kernels::lanes::{BLOCK, exp2, inside, load, load_halves, load_halves_within, load_within, whole};
use crate::par;
use crate::plane::{Plane, Size};
use crate::sequence::settings::{Gather, Stabilise};
use crate::simd::{dispatch, widest};
use crate::stages::blend::BlendFrame;
use crate::stages::blend::statistics::PictureNoise;
use crate::stages::firefly::cpu::median;
use crate::window::{Features, HalfRows, Rows};
use fearless_simd::{Simd, f32x16, prelude::*};
use half::{f16, slice::HalfFloatSliceExt};
use std::ops::Range;

/// As [`super::reference::signature`].
pub(crate) fn signature(features: &Features, picture: &Plane<Rgb>) -> Rows {
    let size = picture.size();
    let w = size.width;
    let channels = super::SIGNATURE;
    let mut out = Rows::unset(size, channels);
    for rows in bands(size.height) {
        let wide = mean_colours(picture, super::WIDE, &rows);
        let sums = padded_sums(picture, &rows);
        let normals = padded_normals(features, &rows);
        par::rows(&mut out.data_mut()[channels * rows.start * w..channels * rows.end * w], channels * w, |y, row| {
            let y = rows.start + y;
            let lines = [y.saturating_sub(1), y, (y + 1).min(size.height - 1)];
            let (near, rest) = row.split_at_mut(3 * w);
            widest!(binomial_row(lines.map(|y| picture.row(y)), near));
            let (window, rest) = rest.split_at_mut(3 * w);
            window.copy_from_slice(wide.channels(y));
            let (albedo, rest) = rest.split_at_mut(3 * w);
            match &features.albedo_around {
                Some(around) => around.channels(0, y, albedo),
                None => albedo.fill(0.0),
            }
            // Rows that there are.
            let lines = &lines[usize::from(y == 0)..3 - usize::from(y + 1 == size.height)];
            for (c, out) in rest[..3 * w].chunks_exact_mut(w).enumerate() {
                widest!(mean_row(lines.iter().map(|y| normals.row(*y, c)), out));
            }
            let around = [y.saturating_sub(1), y, (y + 1).min(size.height - 1)].map(|y| sums.row(y, 0));
            dispatch!(crate::simd::level(), simd => brightness(simd, &around, &mut row[BRIGHTNESS * w..]));
        });
    }
    out
}

/// Binomial 3x3 of a row, channel by channel; beyond the border the border counts.
#[inline(always)]
fn binomial_row(lines: [&[Rgb]; 3], out: &mut [f32]) {
    let w = lines[0].len();
    let last = w - 1;
    let mut sums = par::scratch(3 * w);
    for (line, v) in lines.into_iter().zip([0.25, 0.5, 0.25]) {
        let line = line.as_flattened();
        let (ends, share) = ([&line[..3], &line[3 * last..]], 0.25 * v);
        sums[..3].iter_mut().zip(ends[0]).for_each(|(sum, value)| *sum += share * value);
        sums[3..].iter_mut().zip(line).for_each(|(sum, value)| *sum += share * value);
        let middle = 0.5 * v;
        sums.iter_mut().zip(line).for_each(|(sum, value)| *sum += middle * value);
        sums[..3 * last].iter_mut().zip(&line[3..]).for_each(|(sum, value)| *sum += share * value);
        sums[3 * last..].iter_mut().zip(ends[1]).for_each(|(sum, value)| *sum += share * value);
    }
    let (red, rest) = out.split_at_mut(w);
    let (green, blue) = rest.split_at_mut(w);
    for (x, sum) in sums.as_chunks::<3>().0.iter().enumerate() {
        (red[x], green[x], blue[x]) = (sum[0], sum[1], sum[2]);
    }
}

/// The normals that [`normal_at`] gives of these rows and those around, channel by channel, with a zero more at either end.
fn padded_normals(features: &Features, rows: &Range<usize>) -> Band {
    let (w, h) = (features.size.width, features.size.height);
    Band::filled(&rows_around(rows, 1, h), w + 2, 3, |y, out| {
        let mut seen_there = par::unset_scratch(3 * w);
        let seen = match (&features.seen, features.has_seen[1]) {
            (Some(seen), true) => {
                seen.channels(1, y, &mut seen_there);
                Some(&seen_there[..])
            }
            _ => None,
        };
        for (c, out) in out.chunks_exact_mut(w + 2).enumerate() {
            (out[0], out[w + 1]) = (0.0, 0.0);
            let out = &mut out[1..=w];
            match seen {
                Some(seen) => out.copy_from_slice(&seen[c * w..][..w]),
                None => {
                    for (out, surface) in out.iter_mut().zip(&features.surface[y * w..]) {
                        *out = surface.normal[c];
                    }
                }
            }
        }
    })
}

/// The mean over three columns of some padded rows, of those that lie in the picture.
#[inline(always)]
fn mean_row<'a>(lines: impl ExactSizeIterator<Item = &'a [f32]>, out: &mut [f32]) {
    let (w, rows) = (out.len(), lines.len() as f32);
    out.fill(0.0);
    for line in lines {
        for dx in 0..3 {
            out.iter_mut().zip(&line[dx..]).for_each(|(sum, value)| *sum += value);
        }
    }
    for (x, out) in out.iter_mut().enumerate() {
        let columns = 3.0 - f32::from(u8::from(x == 0)) - f32::from(u8::from(x + 1 == w));
        *out /= rows * columns;
    }
}

/// Red + green + blue of these rows and those around, with a pixel more at either end: beyond the border the border counts.
fn padded_sums(picture: &Plane<Rgb>, rows: &Range<usize>) -> Band {
    let (w, h) = (picture.size().width, picture.size().height);
    Band::filled(&rows_around(rows, 1, h), w + 2, 1, |y, out| {
        for (out, colour) in out[1..=w].iter_mut().zip(picture.row(y)) {
            *out = colour[0] + colour[1] + colour[2];
        }
        (out[0], out[w + 1]) = (out[1], out[w]);
    })
}

/// A row of the brightness of signatures, of the padded rows above, here and below.
#[inline(always)]
fn brightness<S: Simd>(_: S, around: &[&[f32]; 3], out: &mut [f32]) {
    let w = out.len();
    let [above, here, below] = [&around[0][..w + 2], &around[1][..w + 2], &around[2][..w + 2]];
    for x in 0..w {
        out[x] = log_brightness(median([
            above[x],
            above[x + 1],
            above[x + 2],
            here[x],
            here[x + 1],
            here[x + 2],
            below[x],
            below[x + 1],
            below[x + 2],
        ]));
    }
}

/// As [`super::reference::run`] with the net.
pub(crate) fn run(
    window: &[StabiliseFrame<'_>],
    centre: usize,
    gather: &Gather,
    settings: &Stabilise,
) -> (Plane<Rgb>, Option<Plane<f32>>) {
    let here = &window[centre];
    let size = here.picture.size();
    let w = size.width;
    let mut out = par::plane(size, |x, y| here.picture.at(x, y));
    let has_alpha = has_alpha(window);
    let mut coverage = Plane::filled(if has_alpha { size } else { Size::new(0, 0) }, 0.0);
    let fronts = fronts(window, settings);
    for rows in bands(size.height) {
        let joint = Joint::new((window, &fronts), centre, gather, settings, rows.clone());
        let pixels = rows.start * w..rows.end * w;
        let (out, strip) = (&mut out.data_mut()[pixels.clone()], STRIP * w);
        if has_alpha {
            par::two_rows(out, strip, &mut coverage.data_mut()[pixels], strip, |k, strip, coverage| {
                dispatch!(crate::simd::level(), simd => joint.strip(simd, rows.start + STRIP * k, strip, coverage));
            });
        } else {
            par::rows(out, strip, |k, strip| {
                dispatch!(crate::simd::level(), simd => joint.strip(simd, rows.start + STRIP * k, strip, &mut []));
            });
        }
    }
    (out, if has_alpha { Some(coverage) } else { here.alpha.cloned() })
}

/// What is in front, frame by frame.
pub(crate) fn fronts(window: &[StabiliseFrame<'_>], settings: &Stabilise) -> Vec<Fronts> {
    window.iter().map(|frame| Fronts::new(frame.features, settings.nearer)).collect()
}

/// Coverage is averaged too: every frame has it.
fn has_alpha(window: &[StabiliseFrame<'_>]) -> bool {
    window.iter().all(|f| f.alpha.is_some())
}

/// Some rows of a picture, its neighbours in time, and what its pixels are compared by.
pub(crate) struct Joint<'a> {
    window: &'a [StabiliseFrame<'a>],
    /// Of every frame of the window.
    fronts: &'a [Fronts],
    centre: usize,
    has_alpha: bool,
    gather: &'a Gather,
    settings: &'a Stabilise,
    noise: PictureNoise,
    visits: Vec<Visit>,
    /// The window once more, for its outliers.
    frames: Vec<BlendFrame<'a>>,
    /// Mean over 5x5 of the input.
    input: Band,
    /// Of the rows around, too, channel by channel: signatures, colours, the input's, coverage where it is averaged.
    around: Band,
}

/// Where colours, those of the input and coverage lie in [`Joint::around`].
const COLOUR: usize = super::SIGNATURE;
const RAW: usize = COLOUR + 3;
const COVERAGE: usize = RAW + 3;

impl<'a> Joint<'a> {
    pub(crate) fn new(
        (window, fronts): (&'a [StabiliseFrame<'a>], &'a [Fronts]),
        centre: usize,
        gather: &'a Gather,
        settings: &'a Stabilise,
        rows: Range<usize>,
    ) -> Self {
        let frames: Vec<_> = window.iter().map(BlendFrame::from).collect();
        let here = &window[centre];
        let size = here.picture.size();
        let w = size.width;
        let alpha = here.alpha.filter(|_| has_alpha(window));
        let channels = COVERAGE + usize::from(alpha.is_some());
        let around = Band::filled(&rows_around(&rows, TAP_RADIUS, size.height), w, channels, |y, out| {
            if let Some(signature) = here.signature {
                for (c, out) in out.chunks_exact_mut(w).take(COLOUR).enumerate() {
                    signature.row(y, c).convert_to_f32_slice(out);
                    out.iter_mut().for_each(|value| *value = restored(c, *value));
                }
            }
            let mut set = |c: usize, x: usize, value: f32| out[c * w + x] = value;
            for (first, plane) in [(COLOUR, here.picture), (RAW, here.input)] {
                for (x, colour) in plane.row(y).iter().enumerate() {
                    colour.iter().enumerate().for_each(|(c, value)| set(first + c, x, *value));
                }
            }
            if let Some(alpha) = alpha {
                alpha.row(y).iter().enumerate().for_each(|(x, value)| set(COVERAGE, x, *value));
            }
        });
        Self {
            around,
            window,
            fronts,
            centre,
            has_alpha: has_alpha(window),
            gather,
            settings,
            visits: Visit::all(window, centre, gather.future, settings.frames as usize),
            input: mean_colours(window[centre].input, super::WIDE, &rows),
            noise: PictureNoise::new(&frames, centre, window[centre].picture, (gather, settings.nearer), rows),
            frames,
        }
    }

    /// Some rows, from row `first` on: a run of blocks after the other, each in all rows, so that what its taps read is still near in the next row.
    #[inline(always)]
    fn strip<S: Simd>(&self, simd: S, first: usize, out: &mut [Rgb], coverage: &mut [f32]) {
        let here = &self.window[self.centre];
        let w = here.features.size.width;
        if here.signature.is_none() {
            return;
        }
        let mut blocks = Vec::with_capacity(RUN);
        let mut found = vec![Found::NONE; RUN * self.visits.len()];
        for start in (0..w).step_by(RUN * BLOCK) {
            let columns = start..(start + RUN * BLOCK).min(w);
            for (k, row) in out.chunks_exact_mut(w).enumerate() {
                let y = first + k;
                self.averaged(simd, (columns.clone(), y), &mut blocks, &mut found);
                for block in &blocks {
                    let (x, own) = (block.x, self.colours::<true, _>(simd, (block.x as isize, y), block.lanes.raw));
                    let total = f32x16::from_slice(simd, &block.sums[4]);
                    let mut found = [[0.0; BLOCK]; 4];
                    for c in 0..4 {
                        (own[c] + f32x16::from_slice(simd, &block.sums[c]) / total).store_slice(&mut found[c]);
                    }
                    for (i, colour) in row[x..x + block.count].iter_mut().enumerate() {
                        *colour = [found[0][i], found[1][i], found[2][i]];
                    }
                    if let Some(coverage) = coverage.get_mut(k * w + x..k * w + x + block.count) {
                        coverage.copy_from_slice(&found[3][..block.count]);
                    }
                }
            }
        }
    }

    /// The sums of a run of blocks of a row.
    #[inline(always)]
    fn averaged<S: Simd>(
        &self,
        simd: S,
        (columns, y): (Range<usize>, usize),
        blocks: &mut Vec<Pixels<'a, S>>,
        found: &mut [Found],
    ) {
        let here = &self.window[self.centre];
        let w = here.features.size.width;
        blocks.truncate(columns.len().div_ceil(BLOCK));
        for (k, x) in columns.clone().step_by(BLOCK).enumerate() {
            let count = BLOCK.min(columns.end - x);
            let statistics = self.noise.lanes(simd, (x, y));
            let mut lanes = bandwidth_lanes(simd, &statistics, self.settings, here.features.camera_motion);
            let noise = statistics.0.noise(simd, 1);
            let believed = self.believed(simd, (x, y), count, lanes.raw, noise);
            if let Some(believed) = &believed {
                let believed = f32x16::from_slice(simd, believed);
                for parts in &mut lanes.parts {
                    for part in 0..LIGHT {
                        parts[part] *= believed;
                    }
                }
            }
            let block = Pixels::new(simd, (x, count), (lanes, noise), believed);
            match blocks.get_mut(k) {
                Some(before) => *before = Pixels { mirrors: std::mem::take(&mut before.mirrors), ..block },
                None => blocks.push(block),
            }
        }
        let reach = TAP_RADIUS as isize;
        for block in &mut *blocks {
            let x = block.x;
            let mut sums = if whole(x as isize - reach, w) && whole(x as isize + reach, w) {
                self.sums_around::<false, _>(simd, (x, y), &block.lanes)
            } else {
                self.sums_around::<true, _>(simd, (x, y), &block.lanes)
            };
            for (total, believed) in sums[4].iter_mut().zip(block.believed.iter().flatten()) {
                *total += believed.max(LEAST_OWN) - 1.0;
            }
            block.sums = sums;
        }
        self.follow(simd, y, blocks, found);
        for (visit, found) in self.visits.iter().zip(found.chunks_exact_mut(RUN)) {
            for (block, found) in blocks.iter_mut().zip(found) {
                self.add_in_time(simd, y, block, visit, found);
            }
        }
    }

    /// [`own_weight`] of sixteen pixels; `None`: 1.
    #[inline(always)]
    fn believed<S: Simd>(
        &self,
        _: S,
        (x, y): (usize, usize),
        count: usize,
        raw: f32x16<S>,
        noise: f32x16<S>,
    ) -> Option<[f32; BLOCK]> {
        let (raw, noise): ([f32; BLOCK], [f32; BLOCK]) = (raw.into(), noise.into());
        let (mut believed, mut all) = ([1.0; BLOCK], true);
        for i in 0..count {
            let window = (&self.frames[..], self.centre);
            believed[i] = own_weight(window, (x + i, y), (raw[i], noise[i]), (self.gather, self.settings));
            all &= believed[i] == 1.0;
        }
        (!all).then_some(believed)
    }

    /// What sixteen pixels are compared by, from column `x` on.
    #[inline(always)]
    fn own<const EDGE: bool, S: Simd>(&self, simd: S, (x, y): (usize, usize)) -> [f32x16<S>; super::SIGNATURE] {
        let mut own = [f32x16::splat(simd, 0.0); super::SIGNATURE];
        for c in 0..super::SIGNATURE {
            let row = if super::INPUT.contains(&c) {
                self.input.row(y, c - super::INPUT.start)
            } else {
                self.around.row(y, c)
            };
            own[c] = load::<EDGE, _>(simd, row, x as isize);
        }
        own
    }

    /// The colours that sixteen pixels of the frame bring, from column `x` on, where `raw` is the input's share; then coverage.
    #[inline(always)]
    fn colours<const EDGE: bool, S: Simd>(&self, simd: S, (x, y): (isize, usize), raw: f32x16<S>) -> [f32x16<S>; 4] {
        let row = self.around.channels(y);
        let w = self.window[self.centre].features.size.width;
        let mut found = [f32x16::splat(simd, 0.0); 4];
        for c in 0..3 {
            let filtered = channel::<EDGE, _>(simd, row, w, COLOUR + c, x);
            found[c] = filtered + raw * (channel::<EDGE, _>(simd, row, w, RAW + c, x) - filtered);
        }
        if self.has_alpha {
            found[3] = channel::<EDGE, _>(simd, row, w, COVERAGE, x);
        }
        found
    }

    /// Of sixteen pixels the sums over the pixels around them: colours, coverage and weights.
    #[inline(always)]
    fn sums_around<const EDGE: bool, S: Simd>(
        &self,
        simd: S,
        (x, y): (usize, usize),
        lanes: &BandwidthLanes<S>,
    ) -> [[f32; BLOCK]; 5] {
        let here = &self.window[self.centre];
        let (w, h) = (here.features.size.width, here.features.size.height);
        let zero = f32x16::splat(simd, 0.0);
        let own = self.own::<EDGE, _>(simd, (x, y));
        let parts = &lanes.parts[0];
        let (by_distance, raw) = (lanes.offset[0], lanes.raw);
        let own_colour = self.colours::<EDGE, _>(simd, (x as isize, y), raw);
        let (mut sums, mut total) = ([zero; 4], f32x16::splat(simd, 1.0));
        let r = TAP_RADIUS as isize;
        for dy in -r..=r {
            let qy = y as isize + dy;
            if qy < 0 || qy >= h as isize {
                continue;
            }
            let row = self.around.channels(qy as usize);
            for dx in -r..=r {
                if (dx, dy) == (0, 0) {
                    continue;
                }
                let there = Around::<EDGE> { row, w, x: x as isize + dx };
                let distance = distance(simd, &there, &own, parts);
                let offset = (dx * dx + dy * dy) as f32;
                let weight = exp2(simd, -(distance + by_distance * offset));
                let colour = self.colours::<EDGE, _>(simd, (x as isize + dx, qy as usize), raw);
                if EDGE {
                    let inside: f32x16<S> = inside(x as isize + dx, w).simd_into(simd);
                    let inside = inside.simd_gt(zero);
                    for c in 0..4 {
                        sums[c] += inside.select(weight * (colour[c] - own_colour[c]), zero);
                    }
                    total += inside.select(weight, zero);
                } else {
                    // Without coverage that is 0.
                    for c in 0..4 {
                        sums[c] += weight * (colour[c] - own_colour[c]);
                    }
                    total += weight;
                }
            }
        }
        let mut found = [[0.0; BLOCK]; 5];
        for (found, sum) in found.iter_mut().zip(sums.into_iter().chain([total])) {
            sum.store_slice(found);
        }
        found
    }

    /// Follows the pixels of a run of blocks through the other frames.
    #[inline(always)]
    fn follow<S: Simd>(&self, simd: S, y: usize, blocks: &mut [Pixels<'a, S>], found: &mut [Found]) {
        let here = &self.window[self.centre];
        let w = here.features.size.width;
        let start = (here.features, &self.fronts[self.centre]);
        for block in &mut *blocks {
            let mut own = [0.0; BLOCK];
            for (sum, colour) in own.iter_mut().zip(&here.input.row(y)[block.x..block.x + block.count]) {
                *sum = colour[0] + colour[1] + colour[2];
            }
            block.shown = ShownLanes::new(load::<true, _>(simd, self.around.row(y, BRIGHTNESS), block.x as isize));
            block.shown.add(simd, &own, &[1.0; BLOCK]);
        }
        for (visit, found) in self.visits.iter().zip(found.chunks_exact_mut(RUN)) {
            let (from, other) = (self.window[visit.from].features, &self.window[visit.frame]);
            let there = (other.features, &self.fronts[visit.frame]);
            for (block, found) in blocks.iter_mut().zip(found) {
                if visit.away == 1 {
                    let noises: [f32; BLOCK] = block.noise.into();
                    let mut wanted = [0.0; BLOCK];
                    block.mirrors.clear();
                    for i in 0..block.count {
                        // What mirrors show moves by its own motion, and seldom fills a row.
                        let x = block.x + i;
                        if here.features.is_mirror(y * w + x) {
                            let track = Track::new(start, (x, y), noises[i], self.gather, self.settings);
                            block.mirrors.push((i, track));
                        } else {
                            wanted[i] = 1.0;
                        }
                    }
                    let at = (block.x, y);
                    block.surfaces =
                        Some(Tracks::new(simd, start, at, (&wanted, block.noise), self.gather, self.settings));
                }
                found.lanes = 0;
                let (mut inputs, mut known) = ([0.0; BLOCK], [0.0; BLOCK]);
                let mut meet = |i: usize, at: [f32; 2], column: f32, row: f32| {
                    (found.at[0][i], found.at[1][i]) = (at[0], at[1]);
                    let (column, row) = (column as isize, row as isize);
                    found.places[i] = (column as i32 - i as i32, row as i32);
                    found.lanes |= 1 << i;
                    if let Some(row) = other.features.row_here(row) {
                        let colour = other.input.at(column as usize, row);
                        (inputs[i], known[i]) = (colour[0] + colour[1] + colour[2], 1.0);
                    }
                };
                let reached = match &mut block.surfaces {
                    Some(surfaces) => surfaces.step(simd, from, there, visit.forward),
                    None => None,
                };
                if let Some(reached) = reached {
                    for i in 0..block.count {
                        if reached.found[i] > 0.0 {
                            meet(i, [reached.at[0][i], reached.at[1][i]], reached.column[i], reached.row[i]);
                        }
                    }
                }
                let mut k = 0;
                while let Some((i, track)) = block.mirrors.get_mut(k) {
                    if track.step(from, there, visit.forward).is_none() {
                        block.mirrors.swap_remove(k);
                        continue;
                    }
                    let (column, row) = track.at;
                    meet(*i, [column, row], column.round(), row.round());
                    k += 1;
                }
                block.shown.add(simd, &inputs, &known);
            }
        }
    }

    /// Adds the taps of a block in another frame. Pixels beside each other mostly move alike: their taps lie side by side, too.
    #[inline(always)]
    fn add_in_time<S: Simd>(&self, simd: S, y: usize, block: &mut Pixels<'a, S>, visit: &Visit, found: &mut Found) {
        let here = self.window[self.centre].features;
        let other = &self.window[visit.frame];
        let Some(signatures) = other.signature else { return };
        let (x, bounds) = (block.x, block.shown.bounds(self.settings, here.camera_motion));
        // Those that moved alike at once.
        while found.lanes != 0 {
            let place = found.places[found.lanes.trailing_zeros() as usize];
            let mut alike = [0.0; BLOCK];
            for i in 0..block.count {
                if found.lanes >> i & 1 == 1 && found.places[i] == place {
                    alike[i] = 1.0;
                    found.lanes &= !(1 << i);
                }
            }
            let place = (place.0 as isize, place.1 as isize);
            let there = Alike { place, other, signatures, away: visit.away, at: &found.at, alike: &alike };
            if there.within() && whole(x as isize, here.size.width) {
                self.add_taps::<false, _>(simd, (x, y), &there, (&block.lanes, bounds), &mut block.sums);
            } else {
                self.add_taps::<true, _>(simd, (x, y), &there, (&block.lanes, bounds), &mut block.sums);
            }
        }
    }

    /// Adds the taps of those of sixteen pixels that moved alike.
    #[inline(always)]
    fn add_taps<const EDGE: bool, S: Simd>(
        &self,
        simd: S,
        (x, y): (usize, usize),
        &Alike { place, other, signatures, away, at, alike }: &Alike<'_>,
        (lanes, bounds): (&BandwidthLanes<S>, Bounds<f32x16<S>>),
        sums: &mut [[f32; BLOCK]; 5],
    ) {
        const R: isize = TAP_RADIUS as isize;
        const WIDTH: usize = BLOCK + 2 * TAP_RADIUS;
        let w = other.features.size.width;
        let zero = f32x16::splat(simd, 0.0);
        let alike = f32x16::from_slice(simd, alike).simd_gt(zero);
        let own = self.own::<EDGE, _>(simd, (x, y));
        let (parts, by_distance, raw) = (&lanes.parts[1], lanes.offset[1], lanes.raw);
        let between = lanes.away * (away - 1) as f32;
        let Bounds { low, high, fall } = bounds;
        let own_colour = self.colours::<EDGE, _>(simd, (x as isize, y), raw);
        let mut sum = [zero; 5];
        for k in 0..5 {
            sum[k] = f32x16::from_slice(simd, &sums[k]);
        }
        let (at_x, at_y) = (f32x16::from_slice(simd, &at[0]), f32x16::from_slice(simd, &at[1]));
        let lane = f32x16::from_slice(simd, &LANE);
        // Three of the picture, of the input, and coverage; 0 beyond the picture.
        let mut colours = [[0.0; 2 * BLOCK]; 7];
        for dy in -R..=R {
            let Some(row) = other.features.row_here(place.1 + dy) else { continue };
            let (filtered, input) = (other.picture.row(row), other.input.row(row));
            if EDGE {
                for j in 0..WIDTH {
                    let column = place.0 - R + j as isize;
                    if (0..w as isize).contains(&column) {
                        for k in 0..3 {
                            colours[k][j] = filtered[column as usize][k];
                            colours[3 + k][j] = input[column as usize][k];
                        }
                    }
                }
            } else {
                let first = (place.0 - R) as usize;
                let run = (filtered[first..].first_chunk::<WIDTH>(), input[first..].first_chunk::<WIDTH>());
                let (Some(filtered), Some(input)) = run else { continue };
                for j in 0..WIDTH {
                    for k in 0..3 {
                        colours[k][j] = filtered[j][k];
                        colours[3 + k][j] = input[j][k];
                    }
                }
            }
            if let (true, Some(alpha)) = (self.has_alpha, other.alpha) {
                for j in 0..WIDTH {
                    if let Some(value) = alpha.row(row).get((place.0 - R + j as isize) as usize) {
                        colours[6][j] = *value;
                    }
                }
            }
            let signature = signatures.channels_of(row);
            let off_y = f32x16::splat(simd, (place.1 + dy) as f32) - at_y;
            for dx in -R..=R {
                let column = place.0 + dx;
                let there = InTime::<EDGE> { row: signature, w, x: column };
                let distance = distance(simd, &there, &own, parts);
                let off_x = (lane + column as f32) - at_x;
                let offset = off_x * off_x + off_y * off_y;
                let shown = there.at(simd, BRIGHTNESS);
                let beyond = ((shown - high) * fall).max(low - shown).max(zero);
                let weight = exp2(simd, -(distance + by_distance * offset + between + beyond));
                let weight = alike.select(weight, zero);
                let weight = if EDGE {
                    let inside: f32x16<S> = inside(column, w).simd_into(simd);
                    inside.simd_gt(zero).select(weight, zero)
                } else {
                    weight
                };
                let first = (dx + R) as usize;
                let at = |c: usize| f32x16::from_slice(simd, &colours[c][first..first + BLOCK]);
                for c in 0..3 {
                    let filtered = at(c);
                    sum[c] += weight * ((filtered + raw * (at(3 + c) - filtered)) - own_colour[c]);
                }
                if self.has_alpha {
                    sum[3] += weight * (at(6) - own_colour[3]);
                }
                sum[4] += weight;
            }
        }
        for k in 0..5 {
            sum[k].store_slice(&mut sums[k]);
        }
    }

    /// Visits the pixels around and those of other frames, but for the pixel itself.
    #[cfg(feature = "internals")]
    fn taps(&self, x: usize, y: usize, visit: &mut impl FnMut(&Signature, Tap)) {
        let here = &self.window[self.centre];
        let (w, h) = (here.features.size.width, here.features.size.height);
        let Some(signatures) = here.signature else { return };
        let mut own = signature_at(signatures, x, y);
        own[super::INPUT].copy_from_slice(&self.input.colour(x, y, 0));
        let r = TAP_RADIUS;
        for qy in y.saturating_sub(r)..(y + r + 1).min(h) {
            for qx in x.saturating_sub(r)..(x + r + 1).min(w) {
                if (qx, qy) != (x, y) {
                    let (dx, dy) = (qx as f32 - x as f32, qy as f32 - y as f32);
                    let (pixel, offset) = (qy * w + qx, dx * dx + dy * dy);
                    let signature = signature_at(signatures, qx, qy);
                    visit(&own, Tap { frame: self.centre, pixel, signature, offset, away: 0 });
                }
            }
        }
        self.taps_in_time(x, y, &own, visit);
    }

    /// Visits the pixels of other frames.
    #[cfg(feature = "internals")]
    fn taps_in_time(&self, x: usize, y: usize, own: &Signature, visit: &mut impl FnMut(&Signature, Tap)) {
        let here = &self.window[self.centre];
        let w = here.features.size.width;
        for forward in [false, true] {
            if forward && !self.gather.future {
                continue;
            }
            let ahead = if forward { self.window.len() - 1 - self.centre } else { self.centre };
            let start = (here.features, &self.fronts[self.centre]);
            let mut track = Track::new(start, (x, y), self.noise.at(x, y).0.noise(1), self.gather, self.settings);
            for away in 1..=ahead.min(self.settings.frames as usize) {
                let (from, frame) = if forward {
                    (self.centre + away - 1, self.centre + away)
                } else {
                    (self.centre + 1 - away, self.centre - away)
                };
                let other = &self.window[frame];
                let there = (other.features, &self.fronts[frame]);
                let Some(_) = track.step(self.window[from].features, there, forward) else { break };
                let Some(signatures) = other.signature else { break };
                let (cx, cy) = (track.at.0.round() as isize, track.at.1.round() as isize);
                let r = TAP_RADIUS as isize;
                for qy in cy - r..=cy + r {
                    let Some(row) = other.features.row_here(qy) else { continue };
                    for qx in (cx - r).max(0)..=(cx + r).min(w as isize - 1) {
                        let (dx, dy) = (qx as f32 - track.at.0, qy as f32 - track.at.1);
                        let (pixel, offset) = (row * w + qx as usize, dx * dx + dy * dy);
                        let signature = signature_at(signatures, qx as usize, row);
                        visit(own, Tap { frame, pixel, signature, offset, away });
                    }
                }
            }
        }
    }
}

/// Signatures beside each other.
trait Signatures {
    /// Channel `c` of sixteen pixels.
    fn at<S: Simd>(&self, simd: S, c: usize) -> f32x16<S>;
}

/// All channels of a row of [`Joint::around`], each `w` long, from column `x` on.
struct Around<'a, const EDGE: bool> {
    row: &'a [f32],
    w: usize,
    x: isize,
}

impl<const EDGE: bool> Signatures for Around<'_, EDGE> {
    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, c: usize) -> f32x16<S> {
        channel::<EDGE, _>(simd, self.row, self.w, c, self.x)
    }
}

/// The same of another frame, as [`kept`](super::kept) keeps it.
struct InTime<'a, const EDGE: bool> {
    row: &'a [f16],
    w: usize,
    x: isize,
}

impl<const EDGE: bool> Signatures for InTime<'_, EDGE> {
    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, c: usize) -> f32x16<S> {
        let from = c * self.w;
        let kept = if EDGE {
            load_halves::<true, _>(simd, &self.row[from..from + self.w], self.x)
        } else {
            load_halves_within(simd, self.row, (from as isize + self.x) as usize)
        };
        if c < BOUNDED { kept * kept.abs() } else { kept }
    }
}

/// Channel `c` of a row of channels that are `w` long, from column `x` on.
#[inline(always)]
fn channel<const EDGE: bool, S: Simd>(simd: S, row: &[f32], w: usize, c: usize, x: isize) -> f32x16<S> {
    if EDGE {
        load::<true, _>(simd, &row[c * w..(c + 1) * w], x)
    } else {
        load_within(simd, row, ((c * w) as isize + x) as usize)
    }
}

/// [`distance`](super::distance) of sixteen pixels, in its order.
#[inline(always)]
fn distance<S: Simd>(
    simd: S,
    there: &impl Signatures,
    own: &[f32x16<S>; super::SIGNATURE],
    parts: &[f32x16<S>; PARTS],
) -> f32x16<S> {
    // No loop: it would be kept as one, with its squares in memory.
    let a = squares(simd, there, own, parts, 0);
    let b = squares(simd, there, own, parts, 1);
    let c = squares(simd, there, own, parts, 2);
    let d = squares(simd, there, own, parts, 3);
    (a + c) + (b + d)
}

/// Squared differences of every fourth channel from `first` on, times the bandwidths of their parts.
#[inline(always)]
fn squares<S: Simd>(
    simd: S,
    there: &impl Signatures,
    own: &[f32x16<S>; super::SIGNATURE],
    parts: &[f32x16<S>; PARTS],
    first: usize,
) -> f32x16<S> {
    let (second, third) = (first + 4, first + 8);
    let a = own[first] - there.at(simd, first);
    let b = own[second] - there.at(simd, second);
    let c = own[third] - there.at(simd, third);
    parts[first / 3] * (a * a) + parts[second / 3] * (b * b) + parts[third / 3] * (c * c)
}

/// Blocks of a row that meet the other frames one after the other, so that few runs of memory are read at a time; their sums wait meanwhile.
/// Few in tests, so that small pictures have several runs.
const RUN: usize = if cfg!(test) { 2 } else { 32 };

/// Rows that a run's pixels are averaged in, one after the other, before those of the next.
const STRIP: usize = if cfg!(test) { 3 } else { 8 };

/// A block of a run.
struct Pixels<'a, S: Simd> {
    /// Its first column, and the pixels that there are.
    x: usize,
    count: usize,
    lanes: BandwidthLanes<S>,
    noise: f32x16<S>,
    /// See [`Joint::believed`].
    believed: Option<[f32; BLOCK]>,
    /// Colours, coverage and weights.
    sums: [[f32; BLOCK]; 5],
    shown: ShownLanes<S>,
    /// Where its pixels lie in the frame that was met last; those of mirrors with their lanes.
    surfaces: Option<Tracks<'a, S>>,
    mirrors: Vec<(usize, Track<'a>)>,
}

impl<S: Simd> Pixels<'_, S> {
    #[inline(always)]
    fn new(
        simd: S,
        (x, count): (usize, usize),
        (lanes, noise): (BandwidthLanes<S>, f32x16<S>),
        believed: Option<[f32; BLOCK]>,
    ) -> Self {
        let shown = ShownLanes::new(f32x16::splat(simd, 0.0));
        let (sums, mirrors) = ([[0.0; BLOCK]; 5], Vec::new());
        Self { x, count, lanes, noise, believed, sums, shown, surfaces: None, mirrors }
    }
}

/// A frame that trajectories meet.
struct Visit {
    forward: bool,
    /// Frames between, and one.
    away: usize,
    /// The frame met before it.
    from: usize,
    frame: usize,
}

impl Visit {
    /// Frames before, from the nearest on, then those after.
    fn all(window: &[StabiliseFrame<'_>], centre: usize, future: bool, most: usize) -> Vec<Self> {
        let mut visits = Vec::new();
        for forward in [false, true] {
            let ahead = match forward {
                false => centre,
                true if future => window.len() - 1 - centre,
                true => 0,
            };
            for away in 1..=ahead.min(most) {
                let at = |away: usize| if forward { centre + away } else { centre - away };
                if window[at(away)].signature.is_none() {
                    break;
                }
                visits.push(Self { forward, away, from: at(away - 1), frame: at(away) });
            }
        }
        visits
    }
}

/// Where sixteen pixels lie in another frame.
#[derive(Clone, Copy)]
struct Found {
    at: [[f32; BLOCK]; 2],
    /// Of the i-th the pixel nearest to it, less i columns.
    places: [(i32, i32); BLOCK],
    /// Bit i: it was found.
    lanes: u32,
}

impl Found {
    const NONE: Self = Self { at: [[0.0; BLOCK]; 2], places: [(0, 0); BLOCK], lanes: 0 };
}

/// Those of sixteen pixels whose taps in another frame lie side by side.
struct Alike<'a> {
    /// Column and row of the first pixel's.
    place: (isize, isize),
    other: &'a StabiliseFrame<'a>,
    signatures: &'a HalfRows,
    /// Frames between.
    away: usize,
    /// Where the pixels lie there.
    at: &'a [[f32; BLOCK]; 2],
    /// Which of them it is: 1, else 0.
    alike: &'a [f32; BLOCK],
}

impl Alike<'_> {
    /// True where no tap lies beyond the ends of a row.
    #[inline(always)]
    fn within(&self) -> bool {
        let (w, reach) = (self.other.features.size.width, TAP_RADIUS as isize);
        whole(self.place.0 - reach, w) && whole(self.place.0 + reach, w)
    }
}

const LANE: [f32; BLOCK] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];

/// A pixel that is compared with another.
#[cfg(feature = "internals")]
pub(crate) struct Tap {
    pub frame: usize,
    pub pixel: usize,
    pub signature: Signature,
    /// Squared distance in pixels from where it should lie.
    pub offset: f32,
    /// Frames between.
    pub away: usize,
}

/// What the net's form reads of chosen pixels, for its training: see [`TRAINING_CHANNELS`].
#[cfg(feature = "internals")]
pub(crate) fn training_taps(joint: &Joint<'_>, chosen: &[(usize, usize)]) -> (Vec<half::f16>, Vec<f32>) {
    let taps_each = super::taps(joint.settings);
    let mut out = vec![half::f16::ZERO; chosen.len() * taps_each * TRAINING_CHANNELS];
    par::rows(&mut out, taps_each * TRAINING_CHANNELS, |i, out| {
        let (x, y) = chosen[i];
        let scale = joint.noise.inverse(x, y);
        let mut taps = out.chunks_exact_mut(TRAINING_CHANNELS);
        let mut write = |[colour, input]: [Rgb; 2], parts: [f32; PARTS], offset: f32, away: f32| {
            let colour = colour.into_iter().chain(input).map(|v| v * scale);
            let [near, wide, rest @ ..] = parts;
            let parts = [near * scale * scale, wide * scale * scale].into_iter().chain(rest);
            for (out, v) in taps.next().into_iter().flatten().zip(colour.chain(parts).chain([offset, away])) {
                *out = half::f16::from_f32(v.clamp(-6e4, 6e4));
            }
        };
        let here = &joint.window[joint.centre];
        write([here.picture.at(x, y), here.input.at(x, y)], [0.0; super::PARTS], 0.0, 0.5);
        joint.taps(x, y, &mut |own: &Signature, tap: Tap| {
            let frame = &joint.window[tap.frame];
            write(
                [frame.picture.data()[tap.pixel], frame.input.data()[tap.pixel]],
                super::parts(own, &tap.signature),
                tap.offset,
                1.0 + tap.away as f32,
            );
        });
    });
    (out, chosen.iter().map(|(x, y)| joint.noise.inverse(*x, *y)).collect())
}

/// Of a tap, the pixel itself first: colour and the input's over brightness, squared differences of the signature's
/// parts (the first two over the squared brightness), squared distance, and 1 + frames between (0.5: the pixel itself;
/// 0: no tap).
#[cfg(feature = "internals")]
pub(crate) const TRAINING_CHANNELS: usize = 6 + PARTS + 2;
