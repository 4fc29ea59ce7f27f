//! A scene that is being opened while another one is shown: on a thread of its own in a window, between frames in a page,
//! where there are no threads.

use crate::error::LiveError;
use crate::stage::{Stage, Turn};
use eframe::egui::DroppedFileHandle;
use quell::gpu::wgpu;
use quell_trace::RenderOptions;
use quell_trace::gpu::Kernels;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError};

/// Where a scene comes from.
#[derive(Clone, Debug)]
pub(super) enum Source {
    /// A built-in scene's name, a file's path; in a page a file's address.
    Named(String),
    /// A file that was dropped.
    Dropped(DroppedFileHandle),
}

impl Source {
    /// As a user reads it.
    pub(super) fn name(&self) -> String {
        match self {
            Self::Named(name) => name.clone(),
            Self::Dropped(file) => file.path().to_string_lossy().into_owned(),
        }
    }
}

/// A picture that surrounds the scene.
#[derive(Clone, Debug)]
pub(super) struct Sky {
    pub(super) source: Source,
    pub(super) turn: Turn,
}

impl Sky {
    /// What options or a page's parameters ask for; `sign` begins their names.
    ///
    /// # Errors
    /// A rotation or a strength of nothing.
    pub(super) fn of(
        file: Option<String>,
        degrees: Option<f32>,
        strength: Option<f32>,
        sign: &str,
    ) -> Result<Option<Self>, String> {
        let given = [(degrees.is_some(), "rotation"), (strength.is_some(), "strength")];
        if let (None, Some((_, name))) = (&file, given.iter().find(|(is_given, _)| *is_given)) {
            return Err(format!("{sign}environment-{name} needs {sign}environment"));
        }
        let turn = Turn { degrees: degrees.unwrap_or(0.0), strength: strength.unwrap_or(1.0) };
        Ok(file.map(|file| Self { source: Source::Named(file), turn }))
    }
}

/// A scene on the device, and what a user should know of it.
pub(super) type Opened = Result<(Stage, Vec<String>), LiveError>;

/// A scene that is on its way.
pub(super) struct Opening {
    pub(super) name: String,
    pub(super) source: Source,
    pub(super) sky: Option<Sky>,
    /// The scene that is shown, in other surroundings: the camera stays.
    pub(super) is_same_scene: bool,
    arrives: Receiver<Opened>,
}

/// What a scene is made ready for.
pub(super) struct Place {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) kernels: Arc<Kernels>,
    pub(super) options: RenderOptions,
}

impl Place {
    pub(super) fn stage(&self, scene: quell_trace::Scene) -> Result<Stage, LiveError> {
        Stage::new(&self.device, &self.queue, &self.kernels, scene, &self.options)
    }
}

impl Opening {
    /// Begins; whatever was being opened before arrives nowhere.
    pub(super) fn begin(source: Source, sky: Option<Sky>, is_same_scene: bool, place: Place) -> Self {
        let name = source.name();
        let begun = (source.clone(), sky.clone());
        let (send, arrives) = std::sync::mpsc::channel();
        #[cfg(not(target_arch = "wasm32"))]
        {
            let source = name.clone();
            std::thread::spawn(move || {
                let open = || {
                    let around = sky.map(|Sky { source, turn }| {
                        crate::Surroundings::open(std::path::Path::new(&source.name()), turn)
                    });
                    let (scene, notes) = crate::open(&source, around.transpose()?)?;
                    Ok((place.stage(scene)?, notes))
                };
                let opened = open();
                // Nobody waits for it any more where another scene was asked for meanwhile.
                let _ = send.send(opened);
            });
        }
        #[cfg(target_arch = "wasm32")]
        wasm_bindgen_futures::spawn_local(async move {
            let _ = send.send(super::page::opened(source, sky, place).await);
        });
        let (source, sky) = begun;
        Self { name, source, sky, is_same_scene, arrives }
    }

    /// The scene, once it is there.
    pub(super) fn arrived(&self) -> Option<Opened> {
        match self.arrives.try_recv() {
            Ok(opened) => Some(opened),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                Some(Err(LiveError::Device(format!("opening {} ended without a word", self.name))))
            }
        }
    }
}
