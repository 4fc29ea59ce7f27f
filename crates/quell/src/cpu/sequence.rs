//! The sequence filter's stages on all threads and wide vectors.

use super::passes;
use crate::sequence::SequenceStages;
use crate::stages::{blend, feature_noise, gather, recombine, reflection_motion, residual, stabilise};

/// Every stage's `cpu.rs`, under the schedules of `passes/`.
pub(crate) static STAGES: SequenceStages = SequenceStages {
    reflection_motion: reflection_motion::cpu::run,
    gather: gather::cpu::run,
    feature_noise: feature_noise::cpu::run,
    variance: passes::variance::run,
    wavelet: passes::wavelet::run,
    residual: residual::cpu::run,
    picture_residual: residual::cpu::picture,
    sum: recombine::cpu::sum,
    input: recombine::cpu::input,
    likeness: stabilise::likeness::run,
    signature: stabilise::joint::signature,
    stabilise: passes::stabilise::run,
    along: Some(blend::over_time::along),
    blend: blend::cpu::run,
    rescale: recombine::cpu::rescale,
};
