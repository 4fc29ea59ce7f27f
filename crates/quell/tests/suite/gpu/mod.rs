//! The GPU back end against the reference, pass by pass, and its shaders without a GPU.
//!
//! Without an adapter the tests that need one print why they did nothing; with `QUELL_REQUIRE_GPU=1` they fail.

mod agreement;
mod bisect;
mod canaries;
mod debug;
mod device;
mod finish;
mod half;
mod hosts;
mod inputs;
mod kernel;
mod loss;
mod precision;
mod prepare;
mod program;
mod sequence;
mod sequence_views;
mod shaders;
mod textures;
mod timing;
mod wavelet;
mod window;
