//! What these passes read besides planes.

use crate::gpu::sequence::uniforms::extent;
use crate::gpu::uniform::{Uniform, uniforms};
use crate::sequence::FinishJob;
use crate::stages::blend::log2;
use crate::stages::stabilise::noise_unit;
use glam::UVec2;

uniforms! {
    /// Of stages `stabilise` and `blend`, and of the layers of its net.
    pub(super) FinishUniforms as "FinishSettings" {
        /// Image of the dispatch; of the layers of the net at full size the padded one.
        pub(super) size: UVec2,
        /// The picture, of the layers at full size; of the others their image.
        pub(super) inside: UVec2,
        /// Rows of padding above the picture.
        pub(super) above: i32,
        /// Row of the picture at which this begins, and rows of the picture.
        pub(super) first_row: i32,
        pub(super) picture_height: i32,
        /// Frames in the window, the place among them of the one at work, and frames on each side that are averaged.
        pub(super) count: i32,
        pub(super) centre: i32,
        pub(super) steps: i32,
        pub(super) future: u32,
        /// There is a stabilised picture.
        pub(super) stabilised: u32,
        pub(super) every_alpha: u32,
        pub(super) camera_motion: u32,
        /// Rows up or down that a motion trajectory may lead.
        pub(super) farthest: f32,
        pub(super) nearer: f32,
        pub(super) depth_change: f32,
        pub(super) round_trip: f32,
        /// One over the noise (squared, summed over the channels) at which it may miss by one more.
        pub(super) round_trip_noise: f32,
        pub(super) round_trip_share: f32,
        pub(super) departure: f32,
        /// log2.
        pub(super) contrast: f32,
        pub(super) albedo: f32,
        pub(super) camera_albedo: f32,
        pub(super) camera_fall: f32,
        pub(super) outlier: f32,
        /// Squared, summed over the channels.
        pub(super) outlier_noise: f32,
        pub(super) strength: f32,
        pub(super) guard: f32,
        pub(super) guard_low: f32,
        pub(super) guard_noise: f32,
        pub(super) guard_input: f32,
        pub(super) visible: f32,
        pub(super) kernel: f32,
        pub(super) kernel_noise: f32,
        pub(super) kernel_contrast: f32,
    }
}

pub(in crate::gpu::sequence) fn layout() -> Uniform {
    FinishUniforms::layout()
}

impl FinishUniforms {
    pub(super) fn new(job: &FinishJob<'_>) -> Self {
        let (s, blend, (first_row, picture_height)) = (job.stabilise(), job.blend(), job.rows());
        let gather = job.gather();
        let size = extent(job.size());
        Self {
            size,
            inside: size,
            above: 0,
            first_row: first_row as i32,
            picture_height: picture_height as i32,
            count: job.len() as i32,
            centre: job.centre() as i32,
            steps: s.frames as i32,
            future: u32::from(gather.future),
            stabilised: 0,
            every_alpha: u32::from((0..job.len()).all(|place| job.frame(place).has_alpha)),
            camera_motion: u32::from(job.frame(job.centre()).camera_motion),
            farthest: gather.travel * picture_height as f32,
            nearer: s.nearer,
            depth_change: s.depth_change,
            round_trip: s.round_trip,
            round_trip_noise: noise_unit(s),
            round_trip_share: s.round_trip_share,
            departure: s.departure,
            contrast: log2(s.contrast),
            albedo: s.albedo,
            camera_albedo: s.camera_albedo,
            camera_fall: s.camera_fall,
            outlier: s.outlier,
            outlier_noise: 3.0 * s.outlier_noise * s.outlier_noise,
            strength: blend.strength,
            guard: blend.guard,
            guard_low: blend.guard_low,
            guard_noise: blend.guard_noise,
            guard_input: blend.guard_input,
            visible: blend.visible,
            kernel: blend.kernel,
            kernel_noise: blend.kernel_noise,
            kernel_contrast: blend.kernel_contrast,
        }
    }
}
