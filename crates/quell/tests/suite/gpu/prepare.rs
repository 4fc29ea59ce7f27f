//! Hosts' textures against the border on the CPU: every convention gives the same guides, every repair the same counts.

use super::device::{Gpu, gpu};
use super::textures::{depth_texture, half, read_counts, texture};
use crate::suite::frames::{Noise, box_before_wall, guides, hash, jittered, mirror, moving};
use glam::{Vec2, Vec3};
use quell::border::{PlaneName, Repair, Sanitised};
use quell::gpu::wgpu::{CommandEncoderDescriptor, TextureFormat as F, TextureView};
use quell::gpu::{
    self, Bindable, Channel, Convention, DepthKind, Error, FrameUniforms, GuidePlane, GuideTextures, Kernel,
    MotionUnit, NormalEncoding, NormalSpace, Options, Pass, PerFrameUniforms, PrepareUniforms, RoughnessKind, Scalar,
    SettingsUniforms, Slot, Storage, Texel, pack_guides,
};
use quell::{Backend, Camera, Denoiser, FrameBuf, Plane, Settings, Size};

const SIZE: Size = Size::new(45, 27);

/// A guide's members: normal, depth, motion, roughness, hit distance, id, confidence.
type Packed = Vec<[f32; 10]>;

/// How far each may lie off: components of the normal, depth and hit (relative), motion in pixels, roughness and trust.
#[derive(Clone, Copy)]
struct Bound {
    normal: f32,
    depth: f32,
    motion: f32,
    share: f32,
}

/// Values go through as they are.
const EXACT: Bound = Bound { normal: 0.0, depth: 0.0, motion: 0.0, share: 0.0 };
/// Directions and depths worked out in f32.
const FLOAT: Bound = Bound { normal: 2e-6, depth: 1e-5, motion: 2e-4, share: 2e-7 };
/// Half floats round to 11 bits; motion here is below 32 px.
const HALF: Bound = Bound { normal: 6e-4, depth: 5e-4, motion: 8e-3, share: 5e-4 };
/// Eight bits a channel.
const BYTES: Bound = Bound { normal: 7e-3, depth: 1e-5, motion: 2e-4, share: 2e-3 };
/// Ten bits a channel.
const TEN: Bound = Bound { normal: 2e-3, ..BYTES };

/// From what planes of 32-bit floats hold: geometry, surface, moving.
fn unpack(planes: &[Vec<f32>]) -> Packed {
    let pixel = |i: usize| {
        let (g, s, m) = (&planes[0][4 * i..], &planes[1][2 * i..], &planes[2][4 * i..]);
        [g[0], g[1], g[2], g[3], m[0], m[1], s[1], m[2], s[0], m[3]]
    };
    (0..planes[0].len() / 4).map(pixel).collect()
}

fn expected(frame: &FrameBuf) -> Packed {
    let texels = pack_guides(&guides(frame), Storage::Float);
    let floats = |bytes: &Vec<u8>| bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    unpack(&[&texels.geometry, &texels.surface, &texels.moving].map(floats))
}

/// Where the two differ; ids by their bits.
fn difference(a: &Packed, b: &Packed, bound: Bound) -> Option<String> {
    let relative = |p: f32, q: f32, most: f32| (p - q).abs() <= most * p.abs().max(q.abs());
    a.iter().zip(b).enumerate().find_map(|(i, (p, q))| {
        let near = |k: usize, most: f32| (p[k] - q[k]).abs() <= most;
        let member = if !(0..3).all(|k| near(k, bound.normal)) {
            "normal"
        } else if !relative(p[3], q[3], bound.depth) {
            "depth"
        } else if !(4..6).all(|k| near(k, bound.motion)) {
            "motion"
        } else if !near(6, bound.share) {
            "roughness"
        } else if !relative(p[7], q[7], bound.depth) {
            "hit distance"
        } else if p[8].to_bits() != q[8].to_bits() {
            "id"
        } else if !near(9, bound.share) {
            "confidence"
        } else {
            return None;
        };
        Some(format!("{member} at {}: {p:?} and {q:?}", i))
    })
}

/// A frame with background, unknown motion, ids and trust.
fn scene_frame(index: i64) -> FrameBuf {
    let mut frame = box_before_wall(moving, Noise::None).frame(SIZE, index);
    frame.confidence_in = Some(Plane::from_fn(SIZE, |x, y| ((x + 2 * y) % 5) as f32 * 0.25));
    frame.surface_id = Some(Plane::from_fn(SIZE, |x, y| (x / 9 + 7 * (y / 5)) as u32));
    frame.roughness = Some(Plane::from_fn(SIZE, |x, y| ((3 * x + y) % 16) as f32 / 15.0));
    for i in (0..SIZE.pixels()).step_by(13) {
        if let Some(p) = &mut frame.motion {
            p.data_mut()[i] = [f32::NAN; 2];
        }
        if let Some(p) = &mut frame.view_depth {
            p.data_mut()[(7 * i + 5) % SIZE.pixels()] = f32::INFINITY;
        }
    }
    frame
}

/// What a host hands over: guides, and the seven colours in the order in which their repairs are counted.
#[derive(Clone, Copy)]
struct Border<'a> {
    camera: Camera,
    previous_camera: Camera,
    planes: GuideTextures<'a>,
    colours: Option<[&'a TextureView; 7]>,
}

impl<'a> Border<'a> {
    fn frame(&self) -> gpu::Frame<'a> {
        let mut frame = gpu::Frame::new(SIZE, self.camera, self.previous_camera, 0, self.planes);
        if let Some([direct, matte, glossy, direct_matte, direct_glossy, matte_weight, glossy_weight]) = self.colours {
            let signal = |light, weight, direct| gpu::Signal { light, weight: Some(weight), direct: Some(direct) };
            frame.direct = Some(direct);
            frame.matte = Some(signal(matte, matte_weight, direct_matte));
            frame.glossy = Some(signal(glossy, glossy_weight, direct_glossy));
        }
        frame
    }
}

/// A denoiser of which only the border runs, and every stage is off.
fn border_alone(gpu: &Gpu, storage: Storage) -> gpu::Denoiser {
    let mut settings = Settings::default();
    for stage in ["matte_temporal", "matte_prefilter", "disocclusion", "firefly", "matte_bilateral"]
        .into_iter()
        .chain(["glossy_temporal", "glossy_bilateral", "direct_taa"])
    {
        settings.set(&format!("{stage}.enabled"), "off").unwrap();
    }
    let mut options = Options::new(&settings);
    (options.storage, options.count_repairs) = (storage, true);
    gpu::Denoiser::new(&gpu.device, SIZE, &options).unwrap()
}

const OUT: [Slot; 3] = [Slot::Geometry, Slot::Surface, Slot::Moving];

fn run(gpu: &Gpu, denoiser: &mut gpu::Denoiser, border: &Border<'_>) -> (Packed, Sanitised) {
    let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("test") });
    let output = denoiser.encode(&gpu.device, &mut encoder, &border.frame()).unwrap();
    gpu.queue.submit([encoder.finish()]);
    let counts = read_counts(gpu, &output.repairs.unwrap());
    (unpack(&gpu.read(SIZE, &OUT.map(|slot| denoiser.plane(slot).unwrap()))), counts)
}

/// The pass alone, from changed WGSL.
fn run_changed(gpu: &Gpu, source: &str, border: &Border<'_>) -> (Packed, Sanitised) {
    let (planes, counts) = planes_of_changed(gpu, Storage::Float, source, border);
    (unpack(&planes), counts)
}

/// The words of its three planes.
fn planes_of_changed(gpu: &Gpu, storage: Storage, source: &str, border: &Border<'_>) -> (Vec<Vec<f32>>, Sanitised) {
    use gpu::wgpu::{BufferUsages as B, TextureUsages as T};
    let kernel = Kernel::with_source(&gpu.device, Pass::PREPARE, storage, source);
    // `Guides` know the cameras only; their planes do not matter here.
    let blank = FrameBuf { previous_camera: border.previous_camera, ..FrameBuf::new(SIZE, border.camera) };
    let uniform = |bytes: &[u8]| gpu.buffer("uniforms", bytes, B::UNIFORM);
    let frame = uniform(&FrameUniforms::new(&guides(&blank), None).bytes());
    let settings = uniform(&SettingsUniforms::new(&Settings::default(), SIZE).bytes());
    let cameras = [&border.camera, &border.previous_camera];
    let prepare = uniform(&PrepareUniforms::new(cameras, SIZE, &border.planes).unwrap().bytes());
    let counts = gpu.buffer("counts", &[0; gpu::Repairs::BYTES as usize], B::STORAGE | B::COPY_SRC);
    let [depth, id] = [Texel::Number, Texel::Surface]
        .map(|texel| gpu.texture("none", texel.format(Storage::Half), Size::new(1, 1), &[0; 4]));
    let depth_buffer = depth_texture(gpu, Size::new(1, 1), |_, _| 0.0);
    let planes = &border.planes;
    let given = [
        Some(&depth_buffer),
        planes.view_depth,
        planes.normal,
        planes.motion,
        planes.roughness.map(|s| s.view),
        planes.glossy_hit_distance.map(|s| s.view),
        planes.surface_id,
        planes.confidence_in.map(|s| s.view),
    ];
    let given = given.iter().zip(GuidePlane::ALL);
    let given = given.map(|(view, plane)| view.unwrap_or(if plane == GuidePlane::SurfaceId { &id } else { &depth }));
    let out = [Texel::Geometry, Texel::Surface, Texel::Moving].map(|texel| {
        let bytes = vec![0xff; texel.bytes(storage) as usize * SIZE.pixels()];
        gpu.texture_with("guides", texel.format(storage), SIZE, &bytes, T::STORAGE_BINDING | T::COPY_SRC)
    });
    let bound: Vec<Bindable<'_>> = [Bindable::Uniform(&prepare), Bindable::Counts(&counts)]
        .into_iter()
        .chain(given.chain(&out).map(Bindable::Plane))
        .collect();
    let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("test") });
    let uniforms = PerFrameUniforms { frame: &frame, settings: &settings };
    kernel.encode(&gpu.device, &mut encoder, uniforms, &bound, SIZE).unwrap();
    gpu.queue.submit([encoder.finish()]);
    let bytes: Vec<u8> = gpu.read_buffers(&[&counts])[0].iter().flat_map(|n| n.to_le_bytes()).collect();
    (gpu.read(SIZE, &out.each_ref()), gpu::Repairs::read(&bytes).unwrap())
}

/// The host's textures of a frame.
struct Host {
    camera: Camera,
    previous_camera: Camera,
    convention: Convention,
    depth: Option<TextureView>,
    normal: Option<TextureView>,
    motion: Option<TextureView>,
    /// Roughness and trust in g and a.
    shares: Option<TextureView>,
    hit: Option<TextureView>,
    id: Option<TextureView>,
}

impl Host {
    /// In quell's own convention and full precision.
    fn new(gpu: &Gpu, frame: &FrameBuf) -> Self {
        let view = |format, at: &dyn Fn(usize, usize) -> [f32; 4]| Some(texture(gpu, format, frame.size, 3, at));
        let scalar = |p: &Option<Plane<f32>>, x, y| p.as_ref().map_or(0.0, |p| p.at(x, y));
        let shares = |x, y| [9.0, scalar(&frame.roughness, x, y), 9.0, scalar(&frame.confidence_in, x, y)];
        Self {
            camera: frame.camera,
            previous_camera: frame.previous_camera,
            convention: Convention::QUELL,
            depth: view(F::R32Float, &|x, y| [scalar(&frame.view_depth, x, y); 4]),
            normal: frame
                .normal
                .as_ref()
                .and_then(|p| view(F::Rgba32Float, &|x, y| Vec3::from(p.at(x, y)).extend(9.0).to_array())),
            motion: frame
                .motion
                .as_ref()
                .and_then(|p| view(F::Rg32Float, &|x, y| [p.at(x, y)[0], p.at(x, y)[1], 9.0, 9.0])),
            shares: view(F::Rgba32Float, &shares),
            hit: view(F::R32Float, &|x, y| [scalar(&frame.glossy_hit_distance, x, y); 4]),
            id: frame.surface_id.as_ref().and_then(|p| view(F::R32Uint, &|x, y| [p.at(x, y) as f32; 4])),
        }
    }

    fn border(&self) -> Border<'_> {
        let share = |channel| self.shares.as_ref().map(|view| Scalar { view, channel });
        Border {
            camera: self.camera,
            previous_camera: self.previous_camera,
            planes: GuideTextures {
                convention: self.convention,
                view_depth: self.depth.as_ref(),
                normal: self.normal.as_ref(),
                motion: self.motion.as_ref(),
                roughness: share(Channel::G),
                glossy_hit_distance: self.hit.as_ref().map(Scalar::from),
                surface_id: self.id.as_ref(),
                confidence_in: share(Channel::A),
            },
            colours: None,
        }
    }
}

/// Row z of a camera for device depth: near and far, reversed or not.
fn with_device_depth(camera: &mut Camera, near: f64, far: f64, reversed: bool) {
    let (a, b) = if far.is_infinite() { (1.0, -near) } else { (far / (far - near), -near * far / (far - near)) };
    for c in 0..4 {
        let w = f64::from(camera.clip_from_world[4 * c + 3]);
        let z = a * w + if c == 3 { b } else { 0.0 };
        camera.clip_from_world[4 * c + 2] = (if reversed { w - z } else { z }) as f32;
    }
}

fn device_depth(t: f32, near: f64, far: f64, reversed: bool) -> f32 {
    let t = f64::from(t);
    let z = if t.is_infinite() {
        1.0
    } else if far.is_infinite() {
        1.0 - near / t
    } else {
        far / (far - near) * (1.0 - near / t)
    };
    // What the depth test of an engine computes: reversed, small numbers keep their precision.
    let z = match (reversed, t.is_infinite(), far.is_infinite()) {
        (true, true, _) => 0.0,
        (true, _, true) => near / t,
        (true, ..) => near / (far - near) * (far / t - 1.0),
        (false, ..) => z,
    };
    z as f32
}

fn octahedral(n: [f32; 3]) -> Vec2 {
    let n = Vec3::from(n);
    let p = Vec2::new(n.x, n.y) / (n.x.abs() + n.y.abs() + n.z.abs());
    let sign = |v: f32| if v >= 0.0 { 1.0 } else { -1.0 };
    if n.z >= 0.0 { p } else { Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y)) }
}

/// How a host holds a frame, what the pass gets of it, how near the guides come, and a convention that is wrong for it.
struct Case {
    name: &'static str,
    bound: Bound,
    change: fn(&Gpu, &FrameBuf, &mut Host),
    wrong: fn(&mut Convention),
}

fn depth_at(frame: &FrameBuf, x: usize, y: usize) -> f32 {
    frame.view_depth.as_ref().unwrap().at(x, y)
}

fn motion_at(frame: &FrameBuf, x: usize, y: usize) -> Vec2 {
    Vec2::from(frame.motion.as_ref().unwrap().at(x, y))
}

fn normal_at(frame: &FrameBuf, x: usize, y: usize) -> [f32; 3] {
    frame.normal.as_ref().unwrap().at(x, y)
}

/// The four kinds of projection, and both textures that hold device depth.
fn device(gpu: &Gpu, frame: &FrameBuf, host: &mut Host, far: f64, reversed: bool, is_depth_format: bool) {
    host.convention.depth = DepthKind::Device;
    with_device_depth(&mut host.camera, 0.1, far, reversed);
    let at = |x, y| device_depth(depth_at(frame, x, y), 0.1, far, reversed);
    host.depth = Some(if is_depth_format {
        depth_texture(gpu, SIZE, at)
    } else {
        texture(gpu, F::R32Float, SIZE, 0, |x, y| [at(x, y); 4])
    });
}

fn view_depth_instead(convention: &mut Convention) {
    convention.depth = DepthKind::View;
}

const CASES: &[Case] = &[
    Case { name: "as they are", bound: EXACT, change: |_, _, _| (), wrong: |c| c.motion_scale[1] = -1.0 },
    Case {
        name: "half floats",
        bound: HALF,
        change: |gpu, frame, host| {
            host.depth = Some(texture(gpu, F::R16Float, SIZE, 0, |x, y| [depth_at(frame, x, y); 4]));
            host.motion = Some(texture(gpu, F::Rg16Float, SIZE, 0, |x, y| {
                motion_at(frame, x, y).extend(0.0).extend(0.0).to_array()
            }));
            host.normal = Some(texture(gpu, F::Rgba16Float, SIZE, 0, |x, y| {
                Vec3::from(normal_at(frame, x, y)).extend(0.0).to_array()
            }));
        },
        wrong: |c| c.motion_scale = [-1.0; 2],
    },
    Case {
        name: "reversed infinite depth",
        bound: FLOAT,
        change: |gpu, frame, host| device(gpu, frame, host, f64::INFINITY, true, true),
        wrong: view_depth_instead,
    },
    Case {
        name: "reversed finite depth",
        bound: FLOAT,
        change: |gpu, frame, host| device(gpu, frame, host, 1000.0, true, false),
        wrong: view_depth_instead,
    },
    Case {
        // Little is left of 24 bits near 1: 2^-24 t^2 / near.
        name: "finite depth",
        bound: Bound { depth: 3e-5, ..FLOAT },
        change: |gpu, frame, host| device(gpu, frame, host, 1000.0, false, true),
        wrong: view_depth_instead,
    },
    Case {
        name: "infinite depth",
        bound: Bound { depth: 3e-5, ..FLOAT },
        change: |gpu, frame, host| device(gpu, frame, host, f64::INFINITY, false, false),
        wrong: view_depth_instead,
    },
    Case {
        name: "length of the ray",
        bound: FLOAT,
        change: |gpu, frame, host| {
            host.convention.depth = DepthKind::Distance;
            let view = frame.camera.projection(SIZE).unwrap();
            let jitter = Vec2::from(frame.camera.jitter);
            host.depth = Some(texture(gpu, F::R32Float, SIZE, 0, |x, y| {
                let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + jitter;
                [depth_at(frame, x, y) * view.ray_direction(at).length(); 4]
            }));
        },
        wrong: view_depth_instead,
    },
    Case {
        name: "bytes for normals",
        bound: BYTES,
        change: |gpu, frame, host| {
            host.convention.normal = NormalEncoding::UnormXyz;
            host.normal = Some(texture(gpu, F::Rgba8Unorm, SIZE, 0, |x, y| {
                normal_at(frame, x, y)
                    .map(|v| v * 0.5 + 0.5)
                    .iter()
                    .copied()
                    .chain([0.0])
                    .collect::<Vec<_>>()
                    .try_into()
                    .unwrap()
            }));
        },
        wrong: |c| c.normal = NormalEncoding::Xyz,
    },
    Case {
        name: "ten bits for normals",
        bound: TEN,
        change: |gpu, frame, host| {
            host.convention.normal = NormalEncoding::UnormXyz;
            host.normal = Some(texture(gpu, F::Rgb10a2Unorm, SIZE, 0, |x, y| {
                (Vec3::from(normal_at(frame, x, y)) * 0.5 + 0.5).extend(0.0).to_array()
            }));
        },
        wrong: |c| c.normal_space = NormalSpace::View,
    },
    Case {
        name: "octahedral normals",
        bound: FLOAT,
        change: |gpu, frame, host| {
            host.convention.normal = NormalEncoding::Octahedral;
            host.normal = Some(texture(gpu, F::Rg32Float, SIZE, 0, |x, y| {
                octahedral(normal_at(frame, x, y)).extend(0.0).extend(0.0).to_array()
            }));
        },
        wrong: |c| c.normal = NormalEncoding::UnormOctahedral,
    },
    Case {
        name: "octahedral normals, 0..1",
        bound: Bound { normal: 2e-3, ..FLOAT },
        change: |gpu, frame, host| {
            host.convention.normal = NormalEncoding::UnormOctahedral;
            host.normal = Some(texture(gpu, F::Rg16Float, SIZE, 0, |x, y| {
                (octahedral(normal_at(frame, x, y)) * 0.5 + 0.5).extend(0.0).extend(0.0).to_array()
            }));
        },
        wrong: |c| c.normal = NormalEncoding::Octahedral,
    },
    Case {
        name: "normals of the camera's space",
        bound: FLOAT,
        change: |gpu, frame, host| {
            host.convention.normal_space = NormalSpace::View;
            let m = frame.camera.clip_from_world;
            let row = |r: usize| Vec3::new(m[r], m[4 + r], m[8 + r]).normalize();
            host.normal = Some(texture(gpu, F::Rgba32Float, SIZE, 0, |x, y| {
                let n = Vec3::from(normal_at(frame, x, y));
                [row(0).dot(n), row(1).dot(n), -row(3).dot(n), 0.0]
            }));
        },
        wrong: |c| c.normal_space = NormalSpace::World,
    },
    Case {
        name: "UV, current minus previous",
        bound: FLOAT,
        change: |gpu, frame, host| {
            host.convention.motion_unit = MotionUnit::Extents;
            host.convention.motion_scale = Convention::BEVY.motion_scale;
            let extent = Vec2::new(SIZE.width as f32, SIZE.height as f32);
            host.motion = Some(texture(gpu, F::Rg32Float, SIZE, 0, |x, y| {
                (-motion_at(frame, x, y) / extent).extend(0.0).extend(0.0).to_array()
            }));
        },
        wrong: |c| c.motion_scale = [1.0; 2],
    },
    Case {
        name: "clip space, current minus previous",
        bound: FLOAT,
        change: |gpu, frame, host| {
            (host.convention.motion_unit, host.convention.motion_scale) =
                (MotionUnit::Extents, Convention::NDC.motion_scale);
            let extent = Vec2::new(0.5 * SIZE.width as f32, -0.5 * SIZE.height as f32);
            host.motion = Some(texture(gpu, F::Rgba32Float, SIZE, 0, |x, y| {
                (-motion_at(frame, x, y) / extent).extend(0.0).extend(0.0).to_array()
            }));
        },
        wrong: |c| c.motion_unit = MotionUnit::Pixels,
    },
    Case {
        name: "jittered vectors",
        bound: FLOAT,
        change: |gpu, frame, host| {
            host.convention.motion_has_jitter = true;
            (host.camera.jitter, host.previous_camera.jitter) = ([0.25, -0.375], [-0.125, 0.5]);
            let shift = Vec2::new(0.25 + 0.125, -0.375 - 0.5);
            host.motion = Some(texture(gpu, F::Rg32Float, SIZE, 0, |x, y| {
                (motion_at(frame, x, y) + shift).extend(0.0).extend(0.0).to_array()
            }));
        },
        wrong: |c| c.motion_has_jitter = false,
    },
    Case {
        name: "GGX's alpha",
        bound: FLOAT,
        change: |gpu, frame, host| {
            host.convention.roughness = RoughnessKind::Alpha;
            host.shares = Some(texture(gpu, F::Rgba32Float, SIZE, 0, |x, y| {
                let roughness = frame.roughness.as_ref().unwrap().at(x, y);
                [0.0, roughness * roughness, 0.0, frame.confidence_in.as_ref().unwrap().at(x, y)]
            }));
        },
        wrong: |c| c.roughness = RoughnessKind::Perceptual,
    },
    Case {
        name: "ids of sixteen bits",
        bound: EXACT,
        change: |gpu, frame, host| {
            let id = frame.surface_id.as_ref().unwrap();
            host.id = Some(texture(gpu, F::R16Uint, SIZE, 0, |x, y| [id.at(x, y) as f32; 4]));
        },
        wrong: |c| c.normal = NormalEncoding::UnormXyz,
    },
];

#[test]
fn every_convention_gives_the_guides_of_the_border() {
    let Some(gpu) = gpu() else { return };
    let mut denoiser = border_alone(gpu, Storage::Float);
    let mut failures = Vec::new();
    let frame = scene_frame(2);
    let wanted = expected(&frame);
    for case in CASES {
        let mut host = Host::new(gpu, &frame);
        (case.change)(gpu, &frame, &mut host);
        let (found, repaired) = run(gpu, &mut denoiser, &host.border());
        failures.extend(difference(&wanted, &found, case.bound).map(|d| format!("{}: {d}", case.name)));
        if !repaired.is_empty() {
            failures.push(format!("{}: repaired {:?}", case.name, repaired.iter().collect::<Vec<_>>()));
        }
        (case.wrong)(&mut host.convention);
        let (found, _) = run(gpu, &mut denoiser, &host.border());
        if difference(&wanted, &found, case.bound).is_none() {
            failures.push(format!("{}: the wrong convention went unseen", case.name));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn device_depth_of_parallel_rays_is_understood() {
    let Some(gpu) = gpu() else { return };
    let mut denoiser = border_alone(gpu, Storage::Float);
    let mut frame = FrameBuf::new(SIZE, scene_frame(0).camera);
    // Along -z from z = 4, with depths from 1 to 9.
    for camera in [&mut frame.camera, &mut frame.previous_camera] {
        camera.clip_from_world = [0.3, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        camera.position = [0.0, 0.0, 4.0];
    }
    frame.view_depth = Some(Plane::from_fn(SIZE, |x, y| if x == 7 { f32::INFINITY } else { 1.5 + 0.1 * y as f32 }));
    let wanted = expected(&frame);
    for reversed in [false, true] {
        let mut host = Host::new(gpu, &frame);
        (host.shares, host.hit) = (None, None);
        host.convention.depth = DepthKind::Device;
        // Depth t = 4 - z: device (t - 1) / 8, or 1 minus that.
        let sign = if reversed { 1.0 } else { -1.0 };
        host.camera.clip_from_world[10] = sign / 8.0;
        host.camera.clip_from_world[14] = if reversed { 5.0 / 8.0 } else { 3.0 / 8.0 };
        let depth = frame.view_depth.as_ref().unwrap();
        host.depth = Some(depth_texture(gpu, SIZE, |x, y| {
            let forward = ((depth.at(x, y) - 1.0) / 8.0).min(1.0);
            if reversed { 1.0 - forward } else { forward }
        }));
        let (found, _) = run(gpu, &mut denoiser, &host.border());
        assert_eq!(difference(&wanted, &found, FLOAT), None, "reversed: {reversed}");
    }
}

#[test]
fn what_is_absent_is_as_the_contract_says() {
    let Some(gpu) = gpu() else { return };
    let mut denoiser = border_alone(gpu, Storage::Float);
    for frame in [scene_frame(3), mirror(jittered, false, Noise::None).frame(SIZE, 3)] {
        for k in 0..7 {
            let mut frame = frame.clone();
            let mut host = Host::new(gpu, &frame);
            let mut border = host.border();
            let planes = &mut border.planes;
            // Trust and roughness are zeros in the host's texture where the frame has none.
            if frame.confidence_in.is_none() {
                planes.confidence_in = None;
            }
            match k {
                0 => (frame.view_depth, planes.view_depth) = (None, None),
                1 => (frame.normal, planes.normal) = (None, None),
                2 => (frame.motion, planes.motion) = (None, None),
                3 => (frame.roughness, planes.roughness) = (None, None),
                4 => (frame.glossy_hit_distance, planes.glossy_hit_distance) = (None, None),
                5 => (frame.surface_id, planes.surface_id) = (None, None),
                _ => (frame.confidence_in, planes.confidence_in) = (None, None),
            }
            let (found, _) = run(gpu, &mut denoiser, &border);
            assert_eq!(difference(&expected(&frame), &found, FLOAT), None, "plane {k}");
            host.convention.motion_scale = [0.5; 2];
        }
    }
}

/// A frame with every wrong value in every plane.
fn wild() -> FrameBuf {
    let mut frame = scene_frame(1);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -2.5, 1e30, -1e-3, 0.0, 1.5, 2.0, -0.0];
    let value = |plane: u32, x: usize, y: usize, c: u32, good: f32| {
        let h = hash([plane, x as u32, y as u32, c]);
        if h < 0.3 { bad[(h / 0.3 * bad.len() as f64) as usize] } else { good }
    };
    let scalar = |plane, good: f32| Some(Plane::from_fn(SIZE, |x, y| value(plane, x, y, 0, good)));
    let colour = |plane| Some(Plane::from_fn(SIZE, |x, y| [0, 1, 2].map(|c| value(plane, x, y, c, 0.5))));
    frame.view_depth = scalar(1, 3.0);
    frame.roughness = scalar(2, 0.5);
    frame.glossy_hit_distance = scalar(3, 2.0);
    frame.confidence_in = scalar(4, 0.75);
    frame.motion = Some(Plane::from_fn(SIZE, |x, y| [0, 1].map(|c| value(5, x, y, c, 0.5))));
    frame.normal = Some(Plane::from_fn(SIZE, |x, y| [0, 1, 2].map(|c| value(6, x, y, c, [0.6, 0.0, 0.8][c as usize]))));
    (frame.direct, frame.matte, frame.glossy) = (colour(7), colour(8), colour(9));
    (frame.direct_matte, frame.direct_glossy) = (colour(10), colour(11));
    (frame.matte_weight, frame.glossy_weight) = (colour(12), colour(13));
    frame
}

/// Changes planted in the border's pass, each of which must be seen.
pub const PLANTED: &[(&str, &str)] = &[
    ("note(PLANE_NORMAL, NOT_UNIT);", ""),
    ("decoded = normalize(decoded);", ""),
    ("if v < 0.0 || v > 1.0 {", "if v < 0.0 {"),
    ("note(PLANE_MOTION, NOT_FINITE);", ""),
    ("if !is_finite(v) {", "if is_infinite(v) {"),
    ("guide.depth = BACKGROUND;", ""),
    ("if hit < 0.0 {", "if hit < -2.0 {"),
    ("} else if depth <= 0.0 {", "} else if depth < 0.0 {"),
    ("count > 0u", "count > 1u"),
    // guides/store.wgsl
    ("Moving(guide.motion, guide.glossy_hit,", "Moving(guide.motion.yx, guide.glossy_hit,"),
];

#[test]
fn repairs_are_those_of_the_border_and_counted_alike() {
    let Some(gpu) = gpu() else { return };
    let frame = wild();
    let host = Host::new(gpu, &frame);
    let colour = |p: &Option<Plane<quell::Rgb>>| {
        let p = p.as_ref().unwrap();
        texture(gpu, F::Rgba32Float, SIZE, 2, |x, y| [p.at(x, y)[0], p.at(x, y)[1], p.at(x, y)[2], f32::NAN])
    };
    let colours = [
        colour(&frame.direct),
        colour(&frame.matte),
        colour(&frame.glossy),
        colour(&frame.direct_matte),
        colour(&frame.direct_glossy),
        colour(&frame.matte_weight),
        colour(&frame.glossy_weight),
    ];
    let whole = Border { colours: Some(colours.each_ref()), ..host.border() };
    let mut denoiser = border_alone(gpu, Storage::Float);
    let mut reference = Denoiser::with_backend(SIZE, &Settings::default(), Backend::Reference).unwrap();
    let wanted = reference.denoise(&frame.frame(&[])).unwrap().report.sanitised;
    // Counts start afresh with every frame.
    run(gpu, &mut denoiser, &whole);
    let (found, counted) = run(gpu, &mut denoiser, &whole);
    assert_eq!(difference(&expected(&frame), &found, FLOAT), None);
    for plane in PlaneName::ALL {
        for repair in Repair::ALL {
            let [a, b] = [wanted, counted].map(|s| s.count(plane, repair));
            assert_eq!(a, b, "{} {}", plane.name(), repair.name());
        }
    }
    for plane in [PlaneName::Normal, PlaneName::ViewDepth, PlaneName::GlossyWeight] {
        assert!(counted.count(plane, Repair::NotFinite) > 0, "nothing was wild");
    }
    // A border that overlooks something is seen: of the guides' pass, which counts no colours.
    let source = Pass::PREPARE.source(Storage::Float, false);
    let of_guides = |counts: &Sanitised| -> Vec<_> {
        let planes = PlaneName::ALL.into_iter().skip(7);
        planes.flat_map(|plane| Repair::ALL.map(|repair| counts.count(plane, repair))).collect()
    };
    let (found, counted) = run_changed(gpu, &source, &whole);
    assert_eq!((difference(&expected(&frame), &found, FLOAT), of_guides(&counted)), (None, of_guides(&wanted)));
    for (from, to) in PLANTED {
        assert!(source.contains(from), "`{from}` is not there");
        let (found, counted) = run_changed(gpu, &source.replacen(from, to, 1), &whole);
        let seen = difference(&expected(&frame), &found, FLOAT).is_some() || of_guides(&counted) != of_guides(&wanted);
        assert!(seen, "`{from}` made `{to}` went unseen");
    }
}

#[test]
fn a_texture_that_does_not_fit_is_named() {
    let Some(gpu) = gpu() else { return };
    let frame = scene_frame(0);
    let host = Host::new(gpu, &frame);
    let mut denoiser = border_alone(gpu, Storage::Float);
    let mut encode = |border: &Border<'_>| -> Result<(), Error> {
        let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("test") });
        denoiser.encode(&gpu.device, &mut encoder, &border.frame()).map(drop)
    };
    let plain = |format, size| texture(gpu, format, size, 0, |_, _| [0.5; 4]);
    let small = plain(F::R32Float, Size::new(44, 27));
    let (one, ids, bytes) = (plain(F::R32Float, SIZE), plain(F::R32Uint, SIZE), plain(F::Rgba8Unorm, SIZE));
    let good = host.border();
    let planes = good.planes;
    assert_eq!(encode(&good), Ok(()));
    let mut named = |planes: GuideTextures<'_>| encode(&Border { planes, ..good }).unwrap_err().to_string();
    let error = named(GuideTextures { view_depth: Some(&small), ..planes });
    assert!(error.contains("`view_depth` is 44x27"), "{error}");
    let error = named(GuideTextures { normal: Some(&one), ..planes });
    assert!(error.contains("`normal`") && error.contains("three channels"), "{error}");
    let error = named(GuideTextures { motion: Some(&one), ..planes });
    assert!(error.contains("`motion`") && error.contains("two channels"), "{error}");
    let error = named(GuideTextures { surface_id: Some(&bytes), ..planes });
    assert!(error.contains("`surface_id`") && error.contains("unsigned integers"), "{error}");
    let error = named(GuideTextures { view_depth: Some(&ids), ..planes });
    assert!(error.contains("`view_depth`") && error.contains("R32Uint"), "{error}");
    let scalar = Scalar { view: &one, channel: Channel::G };
    let error = named(GuideTextures { roughness: Some(scalar), ..planes });
    assert!(error.contains("`roughness`") && error.contains("channel"), "{error}");
    let depth = depth_texture(gpu, SIZE, |_, _| 0.5);
    let error = named(GuideTextures { confidence_in: Some((&depth).into()), ..planes });
    assert!(error.contains("`confidence_in`") && error.contains("Depth32Float"), "{error}");
    let camera = Camera { clip_from_world: [0.0; 16], ..good.camera };
    assert!(encode(&Border { camera, ..good }).is_err());
}

#[test]
fn half_floats_of_the_tests_are_right() {
    for (value, bits) in
        [(1.0, 0x3c00), (-2.0, 0xc000), (65504.0, 0x7bff), (65520.0, 0x7c00), (6.0e-8, 1), (0.333_333, 0x3555)]
    {
        assert_eq!(half(value), bits, "{value}");
    }
}

/// Changes planted in what packs guides for half storage, each of which must be seen.
pub const PACKED: &[(&str, &str)] = &[
    ("high.x | (high.y << 16u)", "high.y | (high.x << 16u)"),
    ("(low.x << 26u) | (low.y << 29u)", "(low.x << 26u)"),
    ("normal_code(normal) & vec2u(7u)", "normal_code(normal) & vec2u(3u)"),
    ("short_id(id) | (step << 16u)", "id | (step << 16u)"),
    ("select(0u, 1u << 19u, v < 0.0)", "0u"),
    ("x | (y << 20u), (y >> 12u)", "x | (y << 20u), (y >> 11u)"),
    ("min(moves.glossy_hit / depth, HALF_MAX)", "min(moves.glossy_hit, HALF_MAX)"),
    ("(confidence << 24u)", "(240u << 24u)"),
];

#[test]
fn half_storage_packs_as_the_cpu_packs() {
    let Some(gpu) = gpu() else { return };
    let mut frame = scene_frame(2);
    // Every bit of normals, ids of more than 16 bits, hit distances without end.
    frame.normal = Some(Plane::from_fn(SIZE, |x, y| {
        let v = [0, 1, 2].map(|c| hash([x as u32, y as u32, c, 1]) as f32 - 0.5);
        Vec3::from(v).normalize_or(Vec3::Z).to_array()
    }));
    let mix = |p: &mut Plane<u32>| p.data_mut().iter_mut().step_by(3).for_each(|id| *id = *id * 77_777 + 70_000);
    frame.surface_id.iter_mut().for_each(mix);
    frame.glossy_hit_distance = Some(Plane::from_fn(SIZE, |x, _| [f32::INFINITY, 1.5, 0.25][x % 3]));
    let host = Host::new(gpu, &frame);
    let texels = pack_guides(&guides(&frame), Storage::Half);
    let planes = [
        (Texel::Geometry, &texels.geometry, 0.02),
        (Texel::Surface, &texels.surface, 0.05),
        (Texel::Moving, &texels.moving, 0.02),
    ];
    // The share of words that differ. A quotient or a root may round otherwise: the last bit of a code.
    let others = |found: &[Vec<f32>]| -> Vec<f64> {
        let other = |((_, bytes, _), found): (&(Texel, &Vec<u8>, f64), &Vec<f32>)| {
            let wanted = bytes.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b));
            wanted.zip(found).filter(|(p, q)| *p != q.to_bits()).count() as f64 / found.len() as f64
        };
        planes.iter().zip(found).map(other).collect()
    };
    let alike = |others: &[f64]| planes.iter().zip(others).all(|((.., most), other)| other <= most);
    let mut denoiser = border_alone(gpu, Storage::Half);
    let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor { label: Some("test") });
    denoiser.encode(&gpu.device, &mut encoder, &host.border().frame()).unwrap();
    gpu.queue.submit([encoder.finish()]);
    let found = others(&gpu.read(SIZE, &OUT.map(|slot| denoiser.plane(slot).unwrap())));
    println!("{found:?} of the words differ");
    assert!(alike(&found), "{found:?} of the words differ");
    let source = Pass::PREPARE.source(Storage::Half, false);
    for (from, to) in PACKED {
        assert!(source.contains(from), "`{from}` is not there");
        let planted = source.replacen(from, to, 1);
        let found = others(&planes_of_changed(gpu, Storage::Half, &planted, &host.border()).0);
        assert!(!alike(&found), "`{from}` made `{to}` went unseen: {found:?}");
    }
}
