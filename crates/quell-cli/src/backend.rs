//! Which back end runs: from `--backend` and `--device` to one that is ready, and why it is that one.

use crate::args::values::BackendChoice;
use crate::failure::Failure;
use quell_lab::backend::Backend;
use std::sync::{Arc, OnceLock};

/// What the user asked for, and the back end once a command has needed it: opening a device takes time.
#[derive(Clone, Debug)]
pub struct Choice {
    asked: BackendChoice,
    device: Option<String>,
    chosen: Arc<OnceLock<Chosen>>,
}

/// A back end, and why it was taken.
#[derive(Clone, Debug)]
pub struct Chosen {
    pub backend: Backend,
    /// A sentence.
    pub why: String,
}

impl Choice {
    /// Checks that the options go together; nothing is opened.
    pub fn new(asked: Option<BackendChoice>, device: Option<String>) -> Result<Self, Failure> {
        let asked = asked.unwrap_or_default();
        if device.is_some() && matches!(asked, BackendChoice::Cpu | BackendChoice::Reference) {
            let why = "--device names a GPU, but the back end asked for runs on the CPU; leave one of them away";
            return Err(Failure::Usage(why.to_owned()));
        }
        Ok(Self { asked, device, chosen: Arc::default() })
    }

    /// The back end; it is looked for at the first call.
    pub fn get(&self) -> Result<&Chosen, Failure> {
        if let Some(chosen) = self.chosen.get() {
            return Ok(chosen);
        }
        let found = match self.asked {
            BackendChoice::Cpu => Chosen::cpu("as asked for"),
            BackendChoice::Reference => {
                Chosen { backend: Backend::Cpu(quell::Backend::Reference), why: "as asked for".to_owned() }
            }
            BackendChoice::Gpu => device::gpu(self.device.as_deref())?,
            BackendChoice::Auto => device::auto(self.device.as_deref())?,
        };
        Ok(self.chosen.get_or_init(|| found))
    }

    /// What was found, where a command has needed it.
    pub fn found(&self) -> Option<&Chosen> {
        self.chosen.get()
    }

    /// As on the command line: of what was found, else of what was asked for.
    pub fn name(&self) -> &'static str {
        self.found().map_or(self.asked.name(), |chosen| chosen.backend.name())
    }

    /// Whether it was `gpu` that was asked for, not whatever there is.
    pub fn asks_for_gpu(&self) -> bool {
        self.asked == BackendChoice::Gpu
    }

    /// For commands whose results must not depend on the machine unless a GPU was asked for.
    pub fn prefers_cpu(&self) {
        if self.asked == BackendChoice::Auto && self.device.is_none() {
            self.chosen.get_or_init(|| Chosen::cpu("auto: the same bits on every machine; --backend gpu takes a GPU"));
        }
    }
}

impl Chosen {
    fn cpu(why: &str) -> Self {
        Self { backend: Backend::Cpu(quell::Backend::Cpu), why: why.to_owned() }
    }
}

pub use device::adapters;

#[cfg(feature = "gpu")]
mod device {
    use super::{Backend, Chosen, Failure};
    use quell_host::{Error, Gpu, Wanted};
    use std::sync::Arc;

    fn open(device: Option<&str>, why: &str) -> Result<Chosen, Error> {
        let gpu = Gpu::open(device.map_or(Wanted::Any, Wanted::Named))?;
        Ok(Chosen { backend: Backend::Gpu(Arc::new(gpu)), why: why.to_owned() })
    }

    pub fn gpu(device: Option<&str>) -> Result<Chosen, Failure> {
        open(device, "as asked for").map_err(|e| quell_lab::Error::Gpu(e).into())
    }

    /// A device that was named must be had; else what is there decides.
    pub fn auto(device: Option<&str>) -> Result<Chosen, Failure> {
        match open(device, "auto takes a GPU where there is one") {
            Err(error) if device.is_none() => Ok(Chosen::cpu(&format!("auto: {error}"))),
            other => other.map_err(|e| quell_lab::Error::Gpu(e).into()),
        }
    }

    /// Every adapter, a line each.
    pub fn adapters() -> Vec<String> {
        quell_host::adapters().iter().map(ToString::to_string).collect()
    }
}

#[cfg(not(feature = "gpu"))]
mod device {
    use super::{Chosen, Failure};

    const WITHOUT: &str = "this program was built without its feature `gpu`";

    pub fn gpu(_: Option<&str>) -> Result<Chosen, Failure> {
        Err(Failure::Usage(format!("{WITHOUT}; there are the back ends cpu and reference")))
    }

    pub fn auto(device: Option<&str>) -> Result<Chosen, Failure> {
        if device.is_some() { gpu(device) } else { Ok(Chosen::cpu(&format!("auto: {WITHOUT}"))) }
    }

    pub fn adapters() -> Vec<String> {
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_that_do_not_go_together_are_refused() {
        let name = || Some("llvmpipe".to_owned());
        for asked in [BackendChoice::Cpu, BackendChoice::Reference] {
            let Err(Failure::Usage(message)) = Choice::new(Some(asked), name()) else { panic!("{asked:?}") };
            assert!(message.contains("--device"), "{message}");
        }
        let named = Choice::new(None, name()).unwrap();
        let asked = Choice::new(Some(BackendChoice::Gpu), None).unwrap();
        // Nothing was opened for that.
        assert_eq!((named.name(), asked.name()), ("auto", "gpu"));
    }

    #[test]
    fn a_filter_that_prefers_the_cpu_has_it_unless_a_gpu_is_asked_for() {
        let name = || Some("llvmpipe".to_owned());
        for (asked, device, name) in [
            (None, None, "cpu"),
            (Some(BackendChoice::Auto), name(), "auto"),
            (Some(BackendChoice::Gpu), None, "gpu"),
            (Some(BackendChoice::Cpu), None, "cpu"),
        ] {
            let choice = Choice::new(asked, device).unwrap();
            choice.prefers_cpu();
            assert_eq!(choice.name(), name);
        }
    }

    #[test]
    fn what_was_asked_for_is_what_is_found() {
        for (asked, name) in [(BackendChoice::Cpu, "cpu"), (BackendChoice::Reference, "reference")] {
            let choice = Choice::new(Some(asked), None).unwrap();
            assert_eq!(choice.get().unwrap().backend.name(), name);
            assert_eq!(choice.name(), name);
        }
    }
}
