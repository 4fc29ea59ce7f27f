//! What pixels show in mirrors and through glass, and how alike that is, eight pixels at once.

use super::LANES;
use crate::kernels::guide_distance::{FARTHEST, LEAST_BASE};
use crate::kernels::halves::widen_eight;
use crate::sequence::settings::Gather;
use crate::window::{Features, Packed};
use fearless_simd::{Simd, f32x8, prelude::*, u16x8};
use half::f16;

/// What a frame shows in mirrors and through glass.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    shown: &'a Packed,
    /// [`Features::mirror_bits`]
    mirrors: &'a [u64],
}

impl<'a> Seen<'a> {
    /// `None` where the frame has no such buffers.
    pub(super) fn new(features: &'a Features, mirrors: &'a [u64]) -> Option<Self> {
        features.seen.as_ref().map(|shown| Self { shown, mirrors })
    }
}

/// What eight pixels show.
#[derive(Clone, Copy, Default)]
pub(super) struct Eight {
    /// Albedo and normal one after the other, channel by channel.
    shown: [[f32; LANES]; 6],
    /// Which of them are mirrors or clear glass.
    mirrors: [bool; LANES],
}

impl Eight {
    #[inline(always)]
    pub(super) fn new<S: Simd>(simd: S, of: Seen<'_>, places: &[i32; LANES]) -> Self {
        Self { shown: of_eight(simd, of.shown, places), mirrors: mirrors_of_eight(of.mirrors, places) }
    }

    /// How alike the things are that these pixels and others, at `places`, show, as weights: [`super::seen_distance`] on lanes.
    #[inline(always)]
    pub(super) fn likeness<S: Simd>(&self, simd: S, s: &Gather, there: Seen<'_>, places: &[i32; LANES]) -> f32x8<S> {
        let shown = of_eight(simd, there.shown, places);
        // Light that was divided by what it shows never mixes with light that was not.
        let mut apart = [0.0f32; LANES];
        let others = mirrors_of_eight(there.mirrors, places);
        for (apart, (own, other)) in apart.iter_mut().zip(self.mirrors.iter().zip(others)) {
            *apart = f32::from(u8::from(*own != other));
        }
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let load = |v: &[f32; LANES]| -> f32x8<S> { (*v).simd_into(simd) };
        let (tolerance, mut squared, mut cosine) = (s.seen_albedo * s.seen_albedo, zero, zero);
        let mut has_normals = zero.simd_lt(zero);
        for c in 0..3 {
            let d = load(&self.shown[2 * c]) - load(&shown[2 * c]);
            squared += d * d;
            let (a, normal) = (load(&self.shown[2 * c + 1]), load(&shown[2 * c + 1]));
            cosine = if c == 0 { a * normal } else { cosine + a * normal };
            has_normals |= !a.simd_eq(zero) | !normal.simd_eq(zero);
        }
        let bend = has_normals.select((one - cosine) * s.seen_normal, zero);
        let distance = squared * 0.5 / tolerance + bend;
        // `guide_distance::weight`
        let b = one - distance * (1.0 / FARTHEST);
        let mut b = b.simd_ge(f32x8::splat(simd, LEAST_BASE)).select(b, zero);
        for _ in 0..4 {
            b *= b;
        }
        let apart: f32x8<S> = apart.simd_into(simd);
        apart.simd_gt(zero).select(zero, b)
    }
}

/// Which of eight pixels are mirrors or clear glass, from [`Features::mirror_bits`].
#[inline(always)]
fn mirrors_of_eight(bits: &[u64], places: &[i32; LANES]) -> [bool; LANES] {
    let mut found = [false; LANES];
    if bits.is_empty() {
        return found;
    }
    for (found, place) in found.iter_mut().zip(places) {
        let place = *place as usize;
        *found = match bits.get(place / 64) {
            Some(word) => word >> (place % 64) & 1 == 1,
            None => false,
        };
    }
    found
}

/// What eight pixels show in mirrors and through glass: albedo and normal one after the other, channel by channel.
#[inline(always)]
fn of_eight<S: Simd>(simd: S, seen: &Packed, places: &[i32; LANES]) -> [[f32; LANES]; 6] {
    let row = |i: usize| -> u16x8<S> { of_each(seen, places[i] as usize).simd_into(simd) };
    // Eight rows of a pixel each become six columns of a channel each, by three rounds that interleave.
    let (a, b) = (interleaved(row(0), row(4)), interleaved(row(2), row(6)));
    let (c, d) = (interleaved(row(1), row(5)), interleaved(row(3), row(7)));
    let (even, odd) = (interleaved(a[0], b[0]), interleaved(c[0], d[0]));
    let (first, second) = (interleaved(even[0], odd[0]), interleaved(even[1], odd[1]));
    let third = interleaved(a[1].zip_low(b[1]), c[1].zip_low(d[1]));
    let widened = |halves: u16x8<S>| -> [f32; LANES] {
        let halves: [u16; LANES] = halves.into();
        widen_eight(simd, bytemuck::cast(halves)).into()
    };
    [widened(first[0]), widened(first[1]), widened(second[0]), widened(second[1]), widened(third[0]), widened(third[1])]
}

#[inline(always)]
fn interleaved<S: Simd>(a: u16x8<S>, b: u16x8<S>) -> [u16x8<S>; 2] {
    [a.zip_low(b), a.zip_high(b)]
}

/// What a pixel shows in mirrors and through glass: albedo and normal one after the other, and two halves that mean nothing.
#[inline(always)]
fn of_each(seen: &Packed, pixel: usize) -> [u16; LANES] {
    // That the sum does not overflow is plain to the compiler so.
    let at = (6 * pixel) & (usize::MAX >> 1);
    match seen.data.get(at..at + LANES) {
        Some(run) => bytemuck::cast(*run.first_chunk::<LANES>().unwrap_or(&[f16::ZERO; LANES])),
        None => last_of_each(&seen.data, at),
    }
}

/// Of the last pixel, with nothing behind it.
#[cold]
fn last_of_each(data: &[f16], at: usize) -> [u16; LANES] {
    let mut found = [0; LANES];
    found.iter_mut().zip(data.iter().skip(at)).for_each(|(found, half)| *found = half.to_bits());
    found
}
