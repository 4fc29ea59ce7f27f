//! How a run ends badly, and with which exit status.

/// Why a command did not do all that was asked.
#[derive(Debug)]
pub enum Failure {
    /// The command line asks for something that there is not: exit status 2.
    Usage(String),
    /// Nothing, or not the whole, was done: exit status 1. The message names the file.
    Failed(String),
    /// Some frames failed and the others are written: exit status 3.
    SomeFrames(String),
    /// `quell doctor` found what would spoil the result, and has said so: no message, exit status 4.
    Faults,
    /// Ctrl-C or SIGTERM: exit status 130.
    Interrupted(String),
    /// Whoever read standard output has gone, as `head` does: no message, exit status 0.
    NobodyListens,
}

impl Failure {
    /// What happened, in words.
    pub fn message(&self) -> &str {
        match self {
            Self::Usage(message) | Self::Failed(message) | Self::SomeFrames(message) | Self::Interrupted(message) => {
                message
            }
            Self::NobodyListens | Self::Faults => "",
        }
    }

    /// Writes it to standard error.
    pub fn tell(&self) {
        match self {
            Self::Usage(message) => eprintln!("error: {message}\n\nFor more information, try '--help'."),
            Self::Failed(message) | Self::SomeFrames(message) => eprintln!("error: {message}"),
            Self::Interrupted(message) => eprintln!("interrupted: {message}"),
            Self::NobodyListens | Self::Faults => {}
        }
    }

    /// The exit status.
    pub fn exit_status(&self) -> u8 {
        match self {
            Self::NobodyListens => 0,
            Self::Failed(_) => 1,
            Self::Usage(_) => 2,
            Self::SomeFrames(_) => 3,
            Self::Faults => 4,
            Self::Interrupted(_) => 130,
        }
    }
}

impl From<quell::Error> for Failure {
    fn from(error: quell::Error) -> Self {
        match error {
            // What the user named does not exist or cannot have this value.
            quell::Error::UnknownParameter { .. }
            | quell::Error::ParameterValue { .. }
            | quell::Error::UnknownPreset { .. }
            | quell::Error::EmptySize { .. }
            | quell::Error::SizeTooLarge { .. } => Self::Usage(error.to_string()),
            _ => Self::Failed(error.to_string()),
        }
    }
}

impl From<quell_trace::SceneError> for Failure {
    fn from(error: quell_trace::SceneError) -> Self {
        use quell_trace::SceneError;
        match error {
            SceneError::UnknownScene { .. } | SceneError::UnknownCamera { .. } | SceneError::Size { .. } => {
                Self::Usage(error.to_string())
            }
            _ => Self::Failed(error.to_string()),
        }
    }
}

impl From<quell_trace::gltf::GltfError> for Failure {
    fn from(error: quell_trace::gltf::GltfError) -> Self {
        match error.problem {
            quell_trace::gltf::Problem::Choice { .. } => Self::Usage(error.to_string()),
            _ => Self::Failed(error.to_string()),
        }
    }
}

impl From<quell_trace::TraceError> for Failure {
    fn from(error: quell_trace::TraceError) -> Self {
        match error {
            quell_trace::TraceError::Scene(error) => error.into(),
            quell_trace::TraceError::Cancelled => Self::Interrupted(error.to_string()),
            _ => Self::Failed(error.to_string()),
        }
    }
}

impl From<quell_frames::Error> for Failure {
    fn from(error: quell_frames::Error) -> Self {
        match error {
            quell_frames::Error::Memory { .. } => Self::Usage(error.to_string()),
            error => Self::Failed(error.to_string()),
        }
    }
}

impl From<quell_lab::Error> for Failure {
    fn from(error: quell_lab::Error) -> Self {
        match error {
            quell_lab::Error::UnknownMethod { .. } => Self::Usage(error.to_string()),
            quell_lab::Error::Quell(error) => error.into(),
            quell_lab::Error::Trace(error) => error.into(),
            #[cfg(feature = "gpu")]
            quell_lab::Error::Gpu(error) => gpu(error),
            error => Self::Failed(error.to_string()),
        }
    }
}

#[cfg(feature = "gpu")]
fn gpu(error: quell_host::Error) -> Failure {
    use quell_host::Error;
    match error {
        Error::Denoiser(quell::gpu::Error::Denoiser(error)) => error.into(),
        Error::UnknownDevice { .. } | Error::Denoiser(quell::gpu::Error::Size { .. }) => {
            Failure::Usage(error.to_string())
        }
        error => Failure::Failed(error.to_string()),
    }
}
