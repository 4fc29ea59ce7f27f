//! What can go wrong between a host and its device.

/// Every error of the host.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No adapter that would be taken without being named.
    #[error("there is no GPU: {found}")]
    NoGpu {
        /// What there is instead, and what to do.
        found: String,
    },
    /// No adapter has this name.
    #[error("no adapter is called `{asked}`; {found}")]
    UnknownDevice {
        /// As it was asked for.
        asked: String,
        /// Those that there are.
        found: String,
    },
    /// The driver gives no device with WebGPU's default limits.
    #[error("{adapter} gives no device: {reason}")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// The driver's answer.
        reason: String,
    },
    /// Memory ran out on the device.
    #[error("{adapter} has not memory enough for {what}; choose a smaller size, or --backend cpu")]
    OutOfMemory {
        /// Its name.
        adapter: String,
        /// What it was doing.
        what: String,
    },
    /// The device has gone: reset, taken out, stopped by its driver.
    #[error("{adapter} was lost during {what}: {reason}")]
    Lost {
        /// Its name.
        adapter: String,
        /// What it was doing.
        what: String,
        /// The driver's words.
        reason: String,
    },
    /// A mistake of quell or of the driver.
    #[error("{adapter} refused {what}; this is a fault of quell or of the driver, please report it: {reason}")]
    Refused {
        /// Its name.
        adapter: String,
        /// What it was doing.
        what: String,
        /// What wgpu says.
        reason: String,
    },
    /// Nothing was uploaded that could run.
    #[error("no frame was uploaded: call `upload` before `run`")]
    NoFrame,
    /// The denoiser refused a size, a setting or a buffer.
    #[error(transparent)]
    Denoiser(#[from] quell::gpu::Error),
}
