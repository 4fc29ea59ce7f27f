//! The sequence filter's stages as their specification has them.

use crate::sequence::SequenceStages;
use crate::stages::{
    blend, feature_noise, gather, recombine, reflection_motion, residual, stabilise, variance, wavelet,
};

/// Every stage's `reference.rs`.
pub(crate) static STAGES: SequenceStages = SequenceStages {
    reflection_motion: reflection_motion::reference::run,
    gather: gather::reference::run,
    feature_noise: feature_noise::reference::run,
    variance: variance::reference::run,
    wavelet: wavelet::reference::run,
    residual: residual::reference::run,
    picture_residual: residual::reference::picture,
    sum: recombine::reference::sum,
    input: recombine::reference::input,
    likeness: stabilise::reference::likeness,
    signature: stabilise::reference::signature,
    stabilise: stabilise::reference::run,
    along: None,
    blend: blend::reference::run,
    rescale: recombine::reference::rescale,
};
