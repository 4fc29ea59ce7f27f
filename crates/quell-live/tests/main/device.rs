//! A device for the tests, an engine on it, and what it shows.

use quell::{Plane, Rgb, Size};
use quell_host::{Gpu, Wanted};
use quell_live::{Choice, Engine, LiveError, Made, Mode, Pilot, Shot, Sight, Stage};
use quell_trace::gpu::Kernels;
use quell_trace::{Rendered, Scene, builtin};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

pub struct Device {
    pub gpu: Gpu,
    /// Compiled once for all tests.
    pub kernels: Arc<Kernels>,
}

pub fn device() -> Option<&'static Device> {
    static DEVICE: OnceLock<Option<Device>> = OnceLock::new();
    let open = || match Gpu::open(Wanted::Named("")) {
        Ok(gpu) => Some(Device { gpu, kernels: Arc::default() }),
        Err(error) => {
            assert!(std::env::var_os("QUELL_REQUIRE_GPU").is_none(), "{error}");
            println!("SKIPPED: {error}");
            None
        }
    };
    DEVICE.get_or_init(open).as_ref()
}

/// The scene of all tests: the smallest kernels.
pub fn scene() -> Scene {
    builtin("cornell-box").unwrap()
}

/// A choice that costs little.
pub fn choice() -> Choice {
    let mut choice = Choice::default();
    choice.tracing.direct_samples = 4;
    choice
}

impl Device {
    pub fn engine(&self, size: Size) -> Engine {
        let mut engine = Engine::new(self.gpu.device(), self.gpu.queue(), size).unwrap();
        engine.set_stage(self.stage(scene(), &engine));
        engine
    }

    pub fn stage(&self, scene: Scene, engine: &Engine) -> Stage {
        let options = engine.options(choice().tracing);
        Stage::new(self.gpu.device(), self.gpu.queue(), &self.kernels, scene, &options).unwrap()
    }

    /// A frame, submitted.
    pub fn show(&self, engine: &mut Engine, sight: &Sight, choice: &Choice) -> Result<Made, LiveError> {
        let mut encoder = self.gpu.encoder("test");
        let made = engine.encode(&mut encoder, sight, choice)?;
        self.gpu.run(encoder, "a live frame").unwrap();
        Ok(made)
    }

    /// The picture's bytes, four a pixel.
    pub fn picture(&self, engine: &Engine) -> Vec<u8> {
        let mut encoder = self.gpu.encoder("test");
        let shot = Shot::new(self.gpu.device(), &mut encoder, engine.picture().texture());
        assert_eq!(shot.size(), engine.size());
        assert!(shot.take().is_none(), "nothing was submitted");
        self.gpu.run(encoder, "a shot").unwrap();
        handed_over(|| shot.take())
    }

    /// The converged picture.
    pub fn converged(&self, engine: &Engine) -> Plane<Rgb> {
        let read = self.gpu.read_textures(&[engine.converged().texture()], "the mean").unwrap();
        let numbers: Vec<f32> = bytemuck::pod_collect_to_vec(&read[0]);
        let size = engine.size();
        Plane::from_fn(size, |x, y| [0, 1, 2].map(|c| numbers[4 * (y * size.width + x) + c]))
    }

    pub fn planes(&self, engine: &Engine) -> Rendered {
        let mut shot = engine.planes_of_last().unwrap();
        self.gpu.run(self.gpu.encoder("test"), "planes").unwrap();
        let planes = handed_over(|| shot.take()).unwrap();
        assert!(shot.take().is_none(), "it was taken");
        planes
    }
}

/// What the device has made. Another test's thread, which polls the same device, may be about to hand it over.
fn handed_over<T>(mut take: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = take() {
            return found;
        }
        assert!(begun.elapsed() < Duration::from_secs(10), "it was waited for");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The scene's own camera at a time.
pub fn sight(engine: &Engine, time: f64) -> Sight {
    let scene = engine.stage().unwrap().scene();
    let camera = Pilot::at(scene, 1, time, Mode::Path).unwrap().view(scene, time, engine.size()).unwrap();
    Sight { camera, time, pointer: [0; 2] }
}
