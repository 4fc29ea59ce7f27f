//! The public face of the CPU back ends.

use crate::border::Sanitised;
#[cfg(feature = "cpu")]
use crate::cpu::Cpu;
use crate::error::Error;
use crate::frame::{Frame, Rgb, Signal};
use crate::history::{Ledger, PlanCache, Validity};
use crate::memory;
use crate::pipeline::{Image, Inputs, Plan, Stage};
use crate::plane::{Plane, Size};
use crate::reference::Reference;
use crate::report::{Report, StageTimes, clock};
use crate::settings::Settings;

/// Largest extent of an image: beyond it pixel coordinates lose precision in f32.
pub const MAX_EXTENT: usize = 32768;

/// Which implementation of the stages runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// The scalar specification: slow, obvious.
    Reference,
    /// The fast one (feature `cpu`; without it the reference runs).
    #[default]
    Cpu,
}

impl Backend {
    /// Bytes a pixel that a stage reads and writes on the fast back end, each plane once for every pass over it, for a
    /// frame with all planes and no passes. `None`: the stage does not run, or nobody has counted (reference).
    pub fn bytes_per_pixel(self, plan: &Plan, settings: &Settings, stage: Stage) -> Option<u32> {
        match self {
            #[cfg(feature = "cpu")]
            Self::Cpu => crate::cpu::traffic::bytes_per_pixel(plan, settings, stage),
            _ => {
                let _ = (plan, settings, stage);
                None
            }
        }
    }

    fn least_bytes_per_pixel(self) -> usize {
        match self {
            Self::Cpu if cfg!(feature = "cpu") => memory::CPU,
            _ => memory::REFERENCE,
        }
    }
}

#[derive(Clone, Debug)]
enum Runner {
    Reference(Box<Reference>),
    #[cfg(feature = "cpu")]
    Cpu(Box<Cpu>),
}

impl Runner {
    fn new(backend: Backend, size: Size) -> Self {
        match backend {
            #[cfg(feature = "cpu")]
            Backend::Cpu => Self::Cpu(Box::new(Cpu::new(size))),
            _ => Self::Reference(Box::new(Reference::new(size))),
        }
    }

    fn run(
        &mut self,
        frame: &Frame<'_>,
        settings: &Settings,
        plan: &Plan,
        valid: Validity,
        sanitised: &mut Sanitised,
        times: &mut StageTimes,
    ) -> Result<(), Error> {
        match self {
            Self::Reference(runner) => runner.run(frame, settings, plan, valid, sanitised, times),
            #[cfg(feature = "cpu")]
            Self::Cpu(runner) => runner.run(frame, settings, plan, valid, sanitised, times),
        }
    }

    fn image(&self, image: Image) -> Option<&[Plane<Rgb>]> {
        match self {
            Self::Reference(runner) => runner.image(image),
            #[cfg(feature = "cpu")]
            Self::Cpu(runner) => runner.image(image),
        }
    }

    /// Confidence and history length.
    fn temporal(&self, signal: Signal) -> Option<(&Plane<f32>, &Plane<f32>)> {
        match self {
            Self::Reference(runner) => runner.temporal(signal).map(|t| (&t.confidence, &t.length)),
            #[cfg(feature = "cpu")]
            Self::Cpu(runner) => runner.temporal(signal),
        }
    }
}

/// Filters a sequence of frames of one size. It keeps the history between calls.
#[derive(Clone, Debug)]
pub struct Denoiser {
    size: Size,
    settings: Settings,
    plans: PlanCache,
    ledger: Ledger,
    backend: Backend,
    runner: Runner,
    /// Confidence and length where no stage remembers anything.
    fresh: Option<[Plane<f32>; 2]>,
}

/// A denoised frame; it borrows from the denoiser.
#[derive(Clone, Copy, Debug)]
pub struct Output<'a> {
    /// direct + matte_weight matte + glossy_weight glossy, scene-linear; with `antialiasing` and jitter anti-aliased, so no longer
    /// exactly that sum.
    pub composite: &'a Plane<Rgb>,
    /// Direct light as composited: anti-aliased where the frame has jitter and stage 11 runs.
    pub direct: &'a Plane<Rgb>,
    /// The filtered matte signal, without its weight.
    pub matte: Option<&'a Plane<Rgb>>,
    /// The filtered glossy signal, without its weight.
    pub glossy: Option<&'a Plane<Rgb>>,
    /// 0..1, of the matte signal (glossy, where there is no matte signal): trust in history times its maturity.
    pub confidence: &'a Plane<f32>,
    /// Frames that count, at least 1, of the same signal.
    pub history_length: &'a Plane<f32>,
    /// What it cost and what was repaired.
    pub report: Report,
    matte_passes: &'a [Plane<Rgb>],
    glossy_passes: &'a [Plane<Rgb>],
}

/// A frame that a GPU denoised, read back to memory.
#[derive(Clone, Debug)]
pub struct OutputBuf {
    /// As in [`Output`]; so are the following.
    pub composite: Plane<Rgb>,
    /// Direct light as composited.
    pub direct: Plane<Rgb>,
    /// The matte signal, then its passes; empty: the frame has no such signal.
    pub matte: Vec<Plane<Rgb>>,
    /// The glossy signal, then its passes; empty: the frame has no such signal.
    pub glossy: Vec<Plane<Rgb>>,
    /// 0..1.
    pub confidence: Plane<f32>,
    /// Frames that count.
    pub history_length: Plane<f32>,
    /// What it cost and what was repaired.
    pub report: Report,
}

impl OutputBuf {
    /// As the CPU back ends hand it out.
    pub fn output(&self) -> Output<'_> {
        Output {
            composite: &self.composite,
            direct: &self.direct,
            matte: self.matte.first(),
            glossy: self.glossy.first(),
            confidence: &self.confidence,
            history_length: &self.history_length,
            report: self.report,
            matte_passes: self.matte.get(1..).unwrap_or_default(),
            glossy_passes: self.glossy.get(1..).unwrap_or_default(),
        }
    }
}

impl<'a> Output<'a> {
    /// The filtered passes tied to a signal, in the order in which the frame lists them.
    pub fn passes(&self, signal: Signal) -> &'a [Plane<Rgb>] {
        match signal {
            Signal::Matte => self.matte_passes,
            Signal::Glossy => self.glossy_passes,
        }
    }
}

impl Denoiser {
    /// A denoiser for frames of `size` on the fast back end.
    ///
    /// # Errors
    /// A size without pixels or beyond [`MAX_EXTENT`]; a setting out of its range; a size whose images the system has no
    /// memory for ([`Error::Memory`]: asked at once for all that the denoiser will hold at the least; a system that
    /// promises more than it has can still end the process later).
    pub fn new(size: Size, settings: &Settings) -> Result<Self, Error> {
        Self::with_backend(size, settings, Backend::default())
    }

    /// A denoiser on a chosen back end.
    ///
    /// # Errors
    /// As [`Denoiser::new`].
    pub fn with_backend(size: Size, settings: &Settings, backend: Backend) -> Result<Self, Error> {
        if size.width == 0 || size.height == 0 {
            return Err(Error::EmptySize { size });
        }
        if size.width > MAX_EXTENT || size.height > MAX_EXTENT {
            return Err(Error::SizeTooLarge { size, limit: MAX_EXTENT });
        }
        settings.check()?;
        memory::probe(size, backend.least_bytes_per_pixel())?;
        Ok(Self {
            size,
            settings: settings.clone(),
            plans: PlanCache::new(settings),
            ledger: Ledger::default(),
            backend,
            runner: Runner::new(backend, size),
            fresh: None,
        })
    }

    /// Size of the frames.
    pub fn size(&self) -> Size {
        self.size
    }

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Changes settings; history is kept (`history.rs` lists the exceptions).
    ///
    /// # Errors
    /// A setting out of its range; the old settings stay.
    pub fn set_settings(&mut self, settings: &Settings) -> Result<(), Error> {
        settings.check()?;
        self.settings = settings.clone();
        Ok(())
    }

    /// Forgets history: the next frame starts afresh. For cuts that the frame index does not show.
    pub fn reset(&mut self) {
        self.ledger.reset();
    }

    /// Changes the size of the frames; history is forgotten.
    ///
    /// # Errors
    /// As [`Denoiser::new`]; the old size stays.
    pub fn resize(&mut self, size: Size) -> Result<(), Error> {
        *self = Self::with_backend(size, &self.settings, self.backend)?;
        Ok(())
    }

    /// The plan for frames with these inputs: what `quell explain` prints.
    pub fn plan(&self, inputs: Inputs) -> Plan {
        Plan::new(&self.settings, inputs)
    }

    /// Filters the next frame.
    ///
    /// # Errors
    /// What [`Frame::check`] finds. History is then as it was before.
    pub fn denoise(&mut self, frame: &Frame<'_>) -> Result<Output<'_>, Error> {
        frame.check(self.size)?;
        let valid = self.ledger.open(frame);
        let plan = self.plans.get(&self.settings, Inputs::of(frame));
        let mut sanitised = Sanitised::default();
        let mut times = StageTimes::default();
        let begin = clock();
        self.runner.run(frame, &self.settings, plan, valid, &mut sanitised, &mut times)?;
        let total = begin.map_or(std::time::Duration::ZERO, |t| t.elapsed());
        times.border = total.saturating_sub(times.iter().map(|(_, t)| t).sum());
        self.ledger.close(frame, plan);

        let temporal = |signal| self.runner.temporal(signal);
        let temporal = temporal(Signal::Matte).or_else(|| temporal(Signal::Glossy));
        let (confidence, history_length) = match temporal {
            Some(planes) => planes,
            None => {
                let fresh = || [Plane::filled(self.size, 0.0), Plane::filled(self.size, 1.0)];
                let [confidence, length] = &*self.fresh.get_or_insert_with(fresh);
                (confidence, length)
            }
        };
        let plane = |image: Image| self.runner.image(image);
        let shown = |signal: Option<crate::plane::PlaneRef<'_, Rgb>>, image| signal.and_then(|_| plane(image));
        let matte = shown(frame.matte, plan.matte_output);
        let glossy = shown(frame.glossy, plan.glossy_output);

        let missing = Error::EmptySize { size: self.size };
        let report = Report {
            sanitised,
            reset_pixels: confidence.data().iter().filter(|c| **c == 0.0).count() as u64,
            had_history: valid.matte || valid.glossy,
            times,
        };
        Ok(Output {
            composite: first(plane(plan.picture_output)).ok_or_else(|| missing.clone())?,
            direct: first(plane(plan.direct_output)).ok_or(missing)?,
            matte: first(matte),
            glossy: first(glossy),
            confidence,
            history_length,
            report,
            matte_passes: matte.map_or(&[], |p| &p[1..]),
            glossy_passes: glossy.map_or(&[], |p| &p[1..]),
        })
    }
}

fn first(planes: Option<&[Plane<Rgb>]>) -> Option<&Plane<Rgb>> {
    planes.and_then(|p| p.first())
}
