//! Debug views: dark where all is right, bright where a host makes one of the usual mistakes.

use super::device::{Gpu, gpu};
use super::textures::{HostFrame, depth_texture};
use crate::suite::frames::{Noise, Scene, box_before_wall, jittered, mirror, moving, sphere, with_radius};
use glam::Vec3;
use quell::gpu::wgpu::{CommandEncoderDescriptor, TextureFormat, TextureUsages, TextureView};
use quell::gpu::{
    self, Convention, DebugTarget, DebugView, DebugViews, DepthKind, GuideTextures, Guides, NormalSpace, Options,
    Storage,
};
use quell::pipeline::Image;
use quell::{FrameBuf, Plane, Settings, Size};

/// Every view, under the name that its picture has.
fn views(size: Size) -> Vec<(&'static str, DebugView)> {
    vec![
        ("light", DebugView::Light(Image::MatteFiltered)),
        ("input", DebugView::Light(Image::MatteInput)),
        ("depth", DebugView::Depth),
        ("normal", DebugView::Normal),
        ("roughness", DebugView::Roughness),
        ("surface_id", DebugView::SurfaceId),
        ("glossy_hit", DebugView::GlossyHit),
        ("motion", DebugView::Motion),
        ("confidence_in", DebugView::ConfidenceIn),
        ("world_grid", DebugView::WorldGrid),
        ("normal_error", DebugView::NormalError),
        ("motion_error", DebugView::MotionError),
        ("depth_error", DebugView::DepthError),
        ("confidence", DebugView::Confidence),
        ("history_length", DebugView::HistoryLength),
        ("rejection", DebugView::Rejection),
        ("weights_around", DebugView::WeightsAround([size.width as u32 / 2, size.height as u32 * 2 / 3])),
        ("weight_sum", DebugView::WeightSum),
    ]
}

/// A mistake of a host's.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mistake {
    None,
    MotionSign,
    MotionScale,
    Jitter,
    DepthKind,
    NormalSpace,
    PreviousCamera,
}

const MISTAKES: [Mistake; 7] = [
    Mistake::None,
    Mistake::MotionSign,
    Mistake::MotionScale,
    Mistake::Jitter,
    Mistake::DepthKind,
    Mistake::NormalSpace,
    Mistake::PreviousCamera,
];

struct Shown {
    gpu: &'static Gpu,
    denoiser: gpu::Denoiser,
    views: DebugViews,
    target: TextureView,
    size: Size,
}

impl Shown {
    fn new(gpu: &'static Gpu, size: Size) -> Self {
        let settings = with_radius(Settings::default(), size, 12.0);
        let format = TextureFormat::Rgba32Float;
        let usages = TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC;
        Self {
            gpu,
            denoiser: gpu::Denoiser::new(&gpu.device, size, &Options::new(&settings)).unwrap(),
            views: DebugViews::new(&gpu.device, Storage::Half, format).unwrap(),
            target: gpu.texture_with("debug", format, size, &vec![0; 16 * size.pixels()], usages),
            size,
        }
    }

    /// Encodes a frame as a host that makes a mistake would.
    fn frame(&mut self, frame: &FrameBuf, mistake: Mistake) {
        let mut frame = frame.clone();
        if mistake == Mistake::Jitter {
            // Vectors between jittered places.
            let [now, before] = [frame.camera.jitter, frame.previous_camera.jitter];
            let shift = [now[0] - before[0], now[1] - before[1]];
            frame.motion = frame
                .motion
                .map(|p| Plane::from_fn(frame.size, |x, y| [p.at(x, y)[0] + shift[0], p.at(x, y)[1] + shift[1]]));
        }
        if mistake == Mistake::NormalSpace {
            // The camera's axes, turned well away from the world's.
            let turned = glam::Quat::from_rotation_y(0.6) * glam::Quat::from_rotation_x(0.3);
            frame.normal =
                frame.normal.map(|p| Plane::from_fn(frame.size, |x, y| (turned * Vec3::from(p.at(x, y))).to_array()));
        }
        if mistake == Mistake::PreviousCamera {
            frame.previous_camera = frame.camera;
        }
        let host = HostFrame::new(self.gpu, &frame);
        // Reversed and infinite, near 0.1: what a depth buffer holds.
        let device = depth_texture(self.gpu, frame.size, |x, y| 0.1 / frame.view_depth.as_ref().unwrap().at(x, y));
        let given = host.frame(&[]);
        let Guides::Textures(planes) = given.guides else { panic!() };
        let mut camera = given.camera;
        for c in 0..4 {
            camera.clip_from_world[4 * c + 2] = if c == 3 { 0.1 } else { 0.0 };
        }
        let mut convention = Convention { depth: DepthKind::Device, ..Convention::QUELL };
        match mistake {
            Mistake::MotionSign => convention.motion_scale = [-1.0; 2],
            Mistake::MotionScale => convention.motion_scale = [0.5; 2],
            Mistake::DepthKind => convention.depth = DepthKind::View,
            _ => convention.normal_space = NormalSpace::World,
        }
        let guides = GuideTextures { convention, view_depth: Some(&device), ..planes };
        let frame = gpu::Frame { camera, guides: guides.into(), ..given };
        let mut encoder = self.gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("host") });
        self.denoiser.encode(&self.gpu.device, &mut encoder, &frame).unwrap();
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// The picture of a view, red, green, blue.
    fn picture(&self, view: DebugView) -> Vec<[f32; 3]> {
        let mut encoder = self.gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("host") });
        let target = DebugTarget { view: &self.target, scale: 1.0 };
        self.denoiser.encode_debug(&self.gpu.device, &mut encoder, &self.views, view, target).unwrap();
        self.gpu.queue.submit([encoder.finish()]);
        let texels = &self.gpu.read(self.size, &[&self.target])[0];
        texels
            .chunks_exact(4)
            .map(|c| {
                assert!(c.iter().all(|v| (0.0..=1.0).contains(v)) && c[3] == 1.0, "{view:?}: {c:?}");
                [c[0], c[1], c[2]]
            })
            .collect()
    }

    /// Median over surfaces of the brightest channel.
    fn brightness(&self, view: DebugView) -> f32 {
        let mut values: Vec<f32> = self.picture(view).iter().map(|c| c[0].max(c[1]).max(c[2])).collect();
        values.sort_by(f32::total_cmp);
        values[values.len() / 2]
    }
}

impl Shown {
    /// Begins afresh and encodes the first frames of a scene.
    fn after(&mut self, scene: &Scene, count: i64, mistake: Mistake) -> &Self {
        self.denoiser.reset();
        (0..count).for_each(|i| self.frame(&scene.frame(self.size, i), mistake));
        self
    }
}

#[test]
fn every_view_is_drawn_and_each_shows_its_mistakes() {
    let size = Size::new(60, 34);
    let scene = mirror(moving, false, Noise::Sparse(0.4));
    let Some(gpu) = gpu() else { return };
    let mut shown = Shown::new(gpu, size);
    let right = shown.after(&scene, 4, Mistake::None);
    let pictures: Vec<_> = views(size).into_iter().map(|(name, view)| (name, right.picture(view))).collect();
    for (i, (name, picture)) in pictures.iter().enumerate() {
        // Views that are dark where all is right may look alike.
        let dark = ["normal_error", "motion_error", "depth_error", "confidence_in"].contains(name);
        for (other, same) in &pictures[..i] {
            assert!(dark || picture != same, "{name} is {other}");
        }
    }
    // On the same frames, dark when right, bright when wrong.
    let jitter = mirror(jittered, false, Noise::None);
    for (mistake, view, scene) in [
        (Mistake::MotionSign, DebugView::MotionError, &scene),
        (Mistake::MotionScale, DebugView::MotionError, &scene),
        (Mistake::Jitter, DebugView::MotionError, &jitter),
        (Mistake::DepthKind, DebugView::NormalError, &scene),
        (Mistake::NormalSpace, DebugView::NormalError, &scene),
        (Mistake::PreviousCamera, DebugView::MotionError, &scene),
    ] {
        let [good, bad] = [Mistake::None, mistake].map(|m| shown.after(scene, 3, m).brightness(view));
        println!("{mistake:?} in {view:?}: {good:.3} and {bad:.3}");
        assert!(good < 0.1, "{view:?} is bright without a mistake: {good}");
        assert!(bad > good + 0.1, "{mistake:?} went unseen in {view:?}: {good} and {bad}");
    }
}

#[test]
fn what_cannot_be_shown_is_an_error() {
    let Some(gpu) = gpu() else { return };
    let size = Size::new(20, 12);
    let mut shown = Shown::new(gpu, size);
    let show = |shown: &Shown, view, target: &TextureView| {
        let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("host") });
        let target = DebugTarget { view: target, scale: 1.0 };
        shown.denoiser.encode_debug(&gpu.device, &mut encoder, &shown.views, view, target).unwrap_err().to_string()
    };
    assert!(show(&shown, DebugView::Depth, &shown.target).contains("no frame to show"));
    let shown = shown.after(&box_before_wall(moving, Noise::None), 1, Mistake::None);
    let error = show(shown, DebugView::Light(Image::Composite), &shown.target);
    assert!(error.contains("composite"), "{error}");
    let half = gpu.texture("half", TextureFormat::Rgba16Float, size, &vec![0; 8 * size.pixels()]);
    assert!(show(shown, DebugView::Depth, &half).contains("format"));
    let few = Size::new(4, 4);
    let small = gpu.texture_with("small", TextureFormat::Rgba32Float, few, &[0; 256], TextureUsages::STORAGE_BINDING);
    assert!(show(shown, DebugView::Depth, &small).contains("4x4"));
    assert!(DebugViews::new(&gpu.device, Storage::Half, TextureFormat::R32Float).is_err());
}

/// Writes the pictures of docs/media/debug as PPM into the folder that `QUELL_PICTURES` names (ImageMagick's `convert`
/// makes PNG of them): `cargo test -p quell --features gpu-native --test main debug::pictures -- --ignored`.
#[test]
#[ignore = "writes pictures"]
fn pictures() {
    let folder = std::path::PathBuf::from(std::env::var_os("QUELL_PICTURES").expect("QUELL_PICTURES names a folder"));
    let size = Size::new(192, 108);
    let mut shown = Shown::new(gpu().expect("a GPU"), size);
    let write = |name: &str, picture: &[[f32; 3]]| {
        let mut bytes = format!("P6\n{} {}\n255\n", size.width, size.height).into_bytes();
        bytes.extend(picture.iter().flatten().map(|v| (v * 255.0).round() as u8));
        std::fs::write(folder.join(format!("{name}.ppm")), bytes).unwrap();
    };
    for (scene_name, scene) in [
        ("box", box_before_wall(moving, Noise::Sparse(0.4))),
        ("mirror", mirror(moving, true, Noise::Sparse(0.4))),
        ("sphere", sphere(moving, Noise::Sparse(0.4))),
        ("jittered", mirror(jittered, false, Noise::Sparse(0.4))),
    ] {
        for mistake in MISTAKES {
            if (mistake == Mistake::Jitter) != (scene_name == "jittered") && mistake != Mistake::None {
                continue;
            }
            let shown = shown.after(&scene, 8, mistake);
            for (name, view) in views(size) {
                write(&format!("{scene_name}-{mistake:?}-{name}"), &shown.picture(view));
            }
        }
    }
}
