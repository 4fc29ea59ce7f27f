//! The sequence filter's stages on all threads and wide vectors.

use super::passes;
use crate::frame::Rgb;
use crate::plane::Plane;
use crate::sequence::SequenceStages;
use crate::sequence::settings::{Gather, Reflections, Stabilise, Variance, Wavelet};
use crate::stages::feature_noise;
use crate::stages::gather::{self, Gathered};
use crate::stages::recombine;
use crate::stages::reflection_motion::{self, ReflectionMotion};
use crate::stages::stabilise::StabiliseFrame;
use crate::window::{Features, LightSlot, LocalFeatures, PreparedFrame, Rows};

/// Every stage's `cpu.rs`, under the schedules of `passes/`.
pub(crate) struct Cpu;

impl SequenceStages for Cpu {
    fn reflection_motion(&self, previous: &Features, next: &Features, s: &Reflections) -> Option<ReflectionMotion> {
        reflection_motion::cpu::run(previous, next, s)
    }

    fn gather(&self, window: &[&PreparedFrame], centre: usize, s: &Gather) -> Gathered {
        gather::cpu::run(window, centre, s)
    }

    fn feature_noise(&self, features: &Features) -> LocalFeatures {
        feature_noise::cpu::run(features)
    }

    fn variance(
        &self,
        local: &LocalFeatures,
        gathered: &Gathered,
        given: &[Option<Plane<f32>>],
        s: &Variance,
        wavelet: &Wavelet,
    ) -> Rows {
        passes::variance::run(local, gathered, given, s, wavelet)
    }

    fn wavelet(&self, local: &LocalFeatures, slots: &[LightSlot], colours: Rows, variance: Rows, s: &Wavelet) -> Rows {
        passes::wavelet::run(local, slots, colours, variance, s)
    }

    fn sum(&self, frame: &PreparedFrame, slots: &[LightSlot], colours: &Rows) -> Plane<Rgb> {
        recombine::cpu::sum(frame, slots, colours)
    }

    fn stabilise(
        &self,
        window: &[StabiliseFrame<'_>],
        centre: usize,
        gather: &Gather,
        s: &Stabilise,
    ) -> (Plane<Rgb>, Option<Plane<f32>>) {
        passes::stabilise::run(window, centre, gather, s)
    }

    fn rescale(
        &self,
        frame: &PreparedFrame,
        slots: &[LightSlot],
        colours: &Rows,
        before: &Plane<Rgb>,
        after: &Plane<Rgb>,
    ) -> Vec<Vec<Plane<Rgb>>> {
        recombine::cpu::rescale(frame, slots, colours, before, after)
    }
}
