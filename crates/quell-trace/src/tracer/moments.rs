//! Mean and variance of streams of colours.

use glam::Vec3;

/// Mean and variance of the mean of a stream of colours.
#[derive(Clone, Copy, Default)]
pub(super) struct Moments {
    count: f32,
    pub(super) mean: Vec3,
    squares: Vec3,
}

impl Moments {
    pub(super) fn push(&mut self, value: Vec3) {
        self.count += 1.0;
        let delta = value - self.mean;
        self.mean += delta / self.count;
        self.squares += delta * (value - self.mean);
    }

    pub(super) fn variance_of_mean(&self) -> Vec3 {
        if self.count > 1.0 { self.squares / (self.count * (self.count - 1.0)) } else { Vec3::ZERO }
    }
}

/// [`Moments`] in double precision, for many samples.
#[derive(Clone, Copy, Default)]
pub(super) struct Moments64 {
    count: f64,
    mean: glam::DVec3,
    squares: glam::DVec3,
}

impl Moments64 {
    pub(super) fn push(&mut self, value: Vec3) {
        let value = value.as_dvec3();
        self.count += 1.0;
        let delta = value - self.mean;
        self.mean += delta / self.count;
        self.squares += delta * (value - self.mean);
    }

    pub(super) fn mean(&self) -> Vec3 {
        self.mean.as_vec3()
    }

    pub(super) fn variance_of_mean(&self) -> Vec3 {
        if self.count > 1.0 { (self.squares / (self.count * (self.count - 1.0))).as_vec3() } else { Vec3::ZERO }
    }
}
