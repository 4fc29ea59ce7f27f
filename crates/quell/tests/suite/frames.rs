//! Synthetic frames: small scenes with exact guides and a known answer, made without a tracer.
//!
//! Rays meet planes, boxes and spheres in double precision; motion is that of the very point that the ray met. Light
//! is a function of the object's own coordinates, so it stays on a surface that moves; noise is a hash of pixel, frame
//! and seed.

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use quell::border::{Guides, Sanitised};
use quell::history::Validity;
use quell::pipeline::{Inputs, Plan};
use quell::reference::Reference;
use quell::report::StageTimes;
use quell::{Backend, Camera, Denoiser, FrameBuf, Plane, Rgb, Settings, Size};

/// Every back end that this suite must hold for.
pub const BACKENDS: [Backend; 2] = [Backend::Reference, Backend::Cpu];

/// Vertical field of view of the cameras here, radians.
const FIELD_OF_VIEW: f64 = 0.8;

/// What a ray can meet, in the object's own coordinates.
#[derive(Clone, Copy)]
pub enum Shape {
    /// z = 0, within these half extents.
    Rectangle(f64, f64),
    /// Axis-aligned, with these half extents.
    Box(DVec3),
    /// Round the origin.
    Sphere(f64),
}

/// A rigid object.
pub struct Object {
    pub shape: Shape,
    pub id: u32,
    pub roughness: f32,
    /// World from object at a time in frames.
    pub pose: Box<dyn Fn(f64) -> DAffine3>,
    /// Light that leaves it, as a function of its own coordinates and the frame.
    pub light: fn(DVec3, f64) -> Rgb,
}

/// How the signals are disturbed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise {
    /// Converged light.
    None,
    /// Light over p with probability p, else nothing: paths that seldom find the lamp.
    Sparse(f64),
    /// Light times a number from 0 to 2.
    Uniform,
}

/// A camera's place, viewing direction and jitter at a time in frames.
#[derive(Clone, Copy)]
pub struct View {
    pub position: DVec3,
    pub forward: DVec3,
    pub jitter: [f32; 2],
}

/// Objects, a camera's path, noise.
pub struct Scene {
    pub objects: Vec<Object>,
    pub view: fn(f64) -> View,
    pub noise: Noise,
    pub seed: u32,
}

/// What a ray met.
pub struct Hit {
    pub distance: f64,
    pub object: usize,
    pub position: DVec3,
    pub local: DVec3,
    pub normal: DVec3,
}

/// A number in 0..1 from integers (Wang's mix, twice).
pub fn hash(values: [u32; 4]) -> f64 {
    let mut h = 0x9e37_79b9u32;
    for v in values {
        h ^= v.wrapping_add(0x9e37_79b9).wrapping_add(h << 6).wrapping_add(h >> 2);
        h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
        h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
        h ^= h >> 16;
    }
    f64::from(h) / 4_294_967_296.0
}

impl Scene {
    /// The nearest object along a ray.
    pub fn trace(&self, origin: DVec3, direction: DVec3, time: f64) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        for (object, o) in self.objects.iter().enumerate() {
            let pose = (o.pose)(time);
            let inverse = pose.inverse();
            let (a, d) = (inverse.transform_point3(origin), inverse.transform_vector3(direction));
            let Some((t, normal)) = intersect(o.shape, a, d) else { continue };
            if best.as_ref().is_none_or(|b| t < b.distance) {
                let normal = pose.transform_vector3(normal).normalize();
                let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
                best = Some(Hit { distance: t, object, position: origin + direction * t, local: a + d * t, normal });
            }
        }
        best
    }

    /// The camera at a time.
    pub fn camera(&self, size: Size, time: f64) -> Camera {
        let v = (self.view)(time);
        let aspect = size.width as f32 / size.height as f32;
        let (position, forward) = (v.position.as_vec3().to_array(), v.forward.as_vec3().to_array());
        Camera {
            jitter: v.jitter,
            ..Camera::perspective(position, forward, [0.0, 1.0, 0.0], FIELD_OF_VIEW as f32, aspect)
        }
    }

    /// Pixel coordinate of a world point at a time, in double precision.
    pub fn project(&self, size: Size, world: DVec3, time: f64) -> DVec2 {
        let (v, axes, focal) = self.axes(size, time);
        let c = axes.transpose() * (world - v.position);
        DVec2::new(size.width as f64 * 0.5 + focal * c.x / c.z, size.height as f64 * 0.5 - focal * c.y / c.z)
    }

    /// The ray through a pixel coordinate: origin, unit direction, cosine to the camera's axis.
    pub fn ray(&self, size: Size, pixel: DVec2, time: f64) -> (DVec3, DVec3, f64) {
        let (v, axes, focal) = self.axes(size, time);
        let d =
            DVec3::new((pixel.x - size.width as f64 * 0.5) / focal, (size.height as f64 * 0.5 - pixel.y) / focal, 1.0)
                .normalize();
        (v.position, axes * d, d.z)
    }

    fn axes(&self, size: Size, time: f64) -> (View, DMat3, f64) {
        let v = (self.view)(time);
        let forward = v.forward.normalize();
        let right = forward.cross(DVec3::Y).normalize();
        (
            v,
            DMat3::from_cols(right, right.cross(forward), forward),
            size.height as f64 * 0.5 / (FIELD_OF_VIEW * 0.5).tan(),
        )
    }

    /// Frame `index`, with every guide exact. The frame before is `index - 1`, which always exists here.
    pub fn frame(&self, size: Size, index: i64) -> FrameBuf {
        let (now, then) = (index as f64, index as f64 - 1.0);
        let camera = self.camera(size, now);
        let mut frame = FrameBuf::new(size, camera);
        frame.previous_camera = self.camera(size, then);
        frame.index = index;
        let black = Plane::filled(size, [0.0f32; 3]);
        let (mut direct, mut matte, mut glossy) = (black.clone(), black.clone(), black);
        let mut depth = Plane::filled(size, f32::INFINITY);
        let mut normal = Plane::filled(size, [0.0f32; 3]);
        let mut roughness = Plane::filled(size, 1.0f32);
        let mut motion = Plane::filled(size, [0.0f32; 2]);
        let mut hit_distance = Plane::filled(size, f32::INFINITY);
        let mut id = Plane::filled(size, 0u32);
        for y in 0..size.height {
            for x in 0..size.width {
                let pixel = DVec2::new(
                    x as f64 + 0.5 + f64::from(camera.jitter[0]),
                    y as f64 + 0.5 + f64::from(camera.jitter[1]),
                );
                let (origin, direction, cosine) = self.ray(size, pixel, now);
                let Some(hit) = self.trace(origin, direction, now) else {
                    direct.set(x, y, sky(direction));
                    let m = self.project(size, (self.view)(then).position + direction, then) - pixel;
                    motion.set(x, y, m.as_vec2().to_array());
                    continue;
                };
                let object = &self.objects[hit.object];
                let before = (object.pose)(then).transform_point3(hit.local);
                motion.set(x, y, (self.project(size, before, then) - pixel).as_vec2().to_array());
                depth.set(x, y, (hit.distance * cosine) as f32);
                normal.set(x, y, hit.normal.as_vec3().to_array());
                roughness.set(x, y, object.roughness);
                id.set(x, y, object.id);
                let reflected = direction - 2.0 * direction.dot(hit.normal) * hit.normal;
                let seen = match self.trace(hit.position + hit.normal * 1e-9, reflected, now) {
                    Some(second) => {
                        hit_distance.set(x, y, second.distance as f32);
                        (self.objects[second.object].light)(second.local, now)
                    }
                    None => sky(reflected),
                };
                matte.set(x, y, self.disturb((object.light)(hit.local, now), x, y, index, 0));
                glossy.set(x, y, self.disturb(seen, x, y, index, 1));
            }
        }
        frame.direct = Some(direct);
        frame.matte = Some(matte);
        frame.glossy = Some(glossy);
        frame.matte_weight = Some(Plane::filled(size, [0.8, 0.7, 0.6]));
        frame.glossy_weight = Some(Plane::filled(size, [0.2, 0.25, 0.3]));
        frame.view_depth = Some(depth);
        frame.normal = Some(normal);
        frame.roughness = Some(roughness);
        frame.motion = Some(motion);
        frame.glossy_hit_distance = Some(hit_distance);
        frame.surface_id = Some(id);
        frame
    }

    fn disturb(&self, light: Rgb, x: usize, y: usize, index: i64, signal: u32) -> Rgb {
        let u = hash([x as u32, y as u32, (index as u32).wrapping_mul(2) + signal, self.seed]);
        let factor = match self.noise {
            Noise::None => 1.0,
            Noise::Sparse(p) => {
                if u < p {
                    1.0 / p
                } else {
                    0.0
                }
            }
            Noise::Uniform => 2.0 * u,
        };
        light.map(|c| (f64::from(c) * factor) as f32)
    }
}

fn intersect(shape: Shape, a: DVec3, d: DVec3) -> Option<(f64, DVec3)> {
    match shape {
        Shape::Rectangle(hx, hy) => {
            let t = -a.z / d.z;
            let p = a + d * t;
            (t > 1e-6 && t.is_finite() && p.x.abs() <= hx && p.y.abs() <= hy).then_some((t, DVec3::Z))
        }
        Shape::Box(half) => {
            let (t0, t1) = ((-half - a) / d, (half - a) / d);
            let near = t0.min(t1);
            let (enter, exit) = (near.max_element(), t0.max(t1).min_element());
            if enter > exit || enter <= 1e-6 {
                return None;
            }
            let normal = DVec3::new(
                f64::from(u8::from(near.x == enter)),
                f64::from(u8::from(near.y == enter)),
                f64::from(u8::from(near.z == enter)),
            );
            Some((enter, normal * -d.signum()))
        }
        Shape::Sphere(radius) => {
            let (b, c) = (a.dot(d), a.length_squared() - radius * radius);
            let root = b * b - c * d.length_squared();
            if root < 0.0 {
                return None;
            }
            let t = (-b - root.sqrt()) / d.length_squared();
            (t > 1e-6).then(|| (t, (a + d * t) / radius))
        }
    }
}

fn sky(direction: DVec3) -> Rgb {
    let t = (0.5 + 0.5 * direction.y / direction.length()) as f32;
    [0.2 + 0.3 * t, 0.3 + 0.3 * t, 0.6 + 0.4 * t]
}

// --- light ---

/// The same everywhere.
pub fn even(_: DVec3, _: f64) -> Rgb {
    [0.5, 0.5, 0.5]
}

/// Soft waves, a period of about 1.5 units.
pub fn waves(p: DVec3, _: f64) -> Rgb {
    let w = |k: f64| (0.5 + 0.4 * (4.0 * p.x + k).sin() * (4.0 * p.y + 1.0).cos()) as f32;
    [w(0.0), w(1.0), w(2.0)]
}

/// Checks of side 0.5.
pub fn checks(p: DVec3, _: f64) -> Rgb {
    let k = [p.x, p.y, p.z].map(|v| (v * 2.0 + 100.25).floor() as i64).iter().sum::<i64>();
    if k & 1 == 0 { [0.9, 0.8, 0.6] } else { [0.1, 0.15, 0.2] }
}

// --- cameras ---

/// Three units before the origin, at rest.
pub fn still(_: f64) -> View {
    View { position: DVec3::new(0.0, 0.0, 3.0), forward: -DVec3::Z, jitter: [0.0; 2] }
}

/// [`still`], jittered with a period of 8 frames.
pub fn jittered(t: f64) -> View {
    let k = (t as i64).rem_euclid(8) as u32;
    let jitter = [(k as f32 + 0.5) / 8.0 - 0.5, (k.reverse_bits() >> 29) as f32 / 8.0 - 0.4375];
    View { jitter, ..still(t) }
}

/// To the right and forward, turning a little: every degree of freedom that matters, one to two pixels a frame.
pub fn moving(t: f64) -> View {
    View {
        position: DVec3::new(0.04 * t - 0.4, 0.01 * t, 3.0 - 0.02 * t),
        forward: DVec3::new(0.003 * t, -0.05, -1.0),
        jitter: [0.0; 2],
    }
}

/// [`moving`], jittered as [`jittered`].
pub fn moving_jittered(t: f64) -> View {
    View { jitter: jittered(t).jitter, ..moving(t) }
}

/// Sideways only, under a pixel a frame at the depths used here.
pub fn creeping(t: f64) -> View {
    View { position: DVec3::new(0.013 * t - 0.1, 0.0, 3.0), forward: -DVec3::Z, jitter: [0.0; 2] }
}

// --- scenes ---

pub fn at(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
}

/// A plane that faces the camera and fills the picture.
pub fn wall(view: fn(f64) -> View, noise: Noise) -> Scene {
    let light = if matches!(noise, Noise::Sparse(_)) { even } else { waves };
    let wall = Object {
        shape: Shape::Rectangle(50.0, 50.0),
        id: 1,
        roughness: 0.5,
        pose: Box::new(|_| DAffine3::IDENTITY),
        light,
    };
    // Behind the camera: what the wall reflects.
    let lamp = Object {
        shape: Shape::Rectangle(50.0, 50.0),
        id: 2,
        roughness: 1.0,
        pose: Box::new(|_| at(0.0, 0.0, 6.0)),
        light,
    };
    Scene { objects: vec![wall, lamp], view, noise, seed: 1 }
}

/// A floor that runs to the horizon, under sky.
pub fn floor(view: fn(f64) -> View, noise: Noise) -> Scene {
    let floor = Object {
        shape: Shape::Rectangle(4000.0, 4000.0),
        id: 1,
        roughness: 0.4,
        pose: Box::new(|_| {
            at(0.0, -1.0, 0.0) * DAffine3::from_quat(DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2))
        }),
        light: even,
    };
    Scene { objects: vec![floor], view, noise, seed: 2 }
}

/// A box that moves and turns before a wall.
pub fn box_before_wall(view: fn(f64) -> View, noise: Noise) -> Scene {
    let mut scene = wall(view, noise);
    scene.objects[0].light = waves;
    scene.objects.push(Object {
        shape: Shape::Box(DVec3::new(0.4, 0.4, 0.2)),
        id: 3,
        roughness: 0.3,
        pose: Box::new(|t| at(0.05 * t - 0.5, 0.02 * t, 0.6) * DAffine3::from_rotation_z(0.03 * t)),
        light: checks,
    });
    scene
}

/// A mirror that shows a pattern above sky; the mirror rests, or moves and turns.
pub fn mirror(view: fn(f64) -> View, moves: bool, noise: Noise) -> Scene {
    let speed = if moves { 1.0 } else { 0.0 };
    let mirror = Object {
        shape: Shape::Rectangle(50.0, 50.0),
        id: 1,
        roughness: 0.0,
        pose: Box::new(move |t| {
            at(0.03 * speed * t, 0.0, 0.02 * speed * t)
                * DAffine3::from_rotation_y(0.004 * speed * t)
                * DAffine3::from_rotation_x(-0.006 * speed * t)
        }),
        light: even,
    };
    let pattern = Object {
        shape: Shape::Rectangle(1.5, 0.8),
        id: 2,
        roughness: 1.0,
        pose: Box::new(|_| at(0.2, 0.1, 4.5)),
        light: checks,
    };
    Scene { objects: vec![mirror, pattern], view, noise, seed: 3 }
}

/// A sphere that turns about its upright axis before sky.
pub fn sphere(view: fn(f64) -> View, noise: Noise) -> Scene {
    let sphere = Object {
        shape: Shape::Sphere(0.9),
        id: 7,
        roughness: 0.6,
        pose: Box::new(|t| DAffine3::from_rotation_y(0.05 * t)),
        light: waves,
    };
    Scene { objects: vec![sphere], view, noise, seed: 4 }
}

// --- running ---

/// Kernels as wide in pixels as they are at 720 rows would vanish in small pictures: this sets the radii of stages 4,
/// 7, 9 and 10 so that they reach `radius` pixels at `size`.
pub fn with_radius(mut settings: Settings, size: Size, radius: f32) -> Settings {
    let scaled = radius * quell::settings::REFERENCE_ROWS / size.height as f32;
    settings.matte_prefilter.radius = scaled.min(256.0);
    settings.matte_bilateral.radius = scaled.min(256.0);
    settings.glossy_bilateral.max_radius = scaled.min(64.0);
    settings
}

/// What the tests keep of an output.
#[derive(Clone)]
pub struct Kept {
    pub composite: Plane<Rgb>,
    pub direct: Plane<Rgb>,
    pub matte: Option<Plane<Rgb>>,
    pub glossy: Option<Plane<Rgb>>,
    pub confidence: Plane<f32>,
    pub history: Plane<f32>,
    pub matte_passes: Vec<Plane<Rgb>>,
    pub glossy_passes: Vec<Plane<Rgb>>,
    pub report: quell::Report,
}

/// Denoises one frame.
pub fn denoise(denoiser: &mut Denoiser, frame: &FrameBuf) -> Kept {
    let passes = frame.pass_views();
    let output = denoiser.denoise(&frame.frame(&passes)).unwrap();
    Kept {
        composite: output.composite.clone(),
        direct: output.direct.clone(),
        matte: output.matte.cloned(),
        glossy: output.glossy.cloned(),
        confidence: output.confidence.clone(),
        history: output.history_length.clone(),
        matte_passes: output.passes(quell::Signal::Matte).to_vec(),
        glossy_passes: output.passes(quell::Signal::Glossy).to_vec(),
        report: output.report,
    }
}

/// Denoises frames one after another; the last output.
pub fn run(backend: Backend, settings: &Settings, frames: &[FrameBuf]) -> Kept {
    let mut denoiser = Denoiser::with_backend(frames[0].size, settings, backend).unwrap();
    let mut last = None;
    for frame in frames {
        last = Some(denoise(&mut denoiser, frame));
    }
    last.unwrap()
}

/// Frames 0..count of a scene.
pub fn sequence(scene: &Scene, size: Size, count: i64) -> Vec<FrameBuf> {
    (0..count).map(|i| scene.frame(size, i)).collect()
}

/// The guides as the stages see them.
pub fn guides(frame: &FrameBuf) -> Guides {
    let settings = Settings::default().without_denoising();
    let passes = frame.pass_views();
    let borrowed = frame.frame(&passes);
    let plan = Plan::new(&settings, Inputs::of(&borrowed));
    let mut reference = Reference::new(frame.size);
    let (mut sanitised, mut times) = (Sanitised::default(), StageTimes::default());
    reference.run(&borrowed, &settings, &plan, Validity::default(), &mut sanitised, &mut times).unwrap();
    reference.guides().unwrap().clone()
}

/// Mean of all channels.
pub fn mean(plane: &Plane<Rgb>) -> f64 {
    plane.data().iter().flatten().map(|v| f64::from(*v)).sum::<f64>() / (3 * plane.data().len()) as f64
}

/// Root mean square difference over the pixels that `of` accepts.
pub fn rms(a: &Plane<Rgb>, b: &Plane<Rgb>, of: impl Fn(usize, usize) -> bool) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for y in 0..a.size().height {
        for x in 0..a.size().width {
            if of(x, y) {
                for c in 0..3 {
                    let d = f64::from(a.at(x, y)[c]) - f64::from(b.at(x, y)[c]);
                    sum += d * d;
                    n += 1.0;
                }
            }
        }
    }
    assert!(n > 0.0, "no pixel to compare");
    (sum / n).sqrt()
}

/// Largest difference, relative to the larger of the two values and 1e-3.
pub fn worst(a: &Plane<Rgb>, b: &Plane<Rgb>) -> f64 {
    a.data()
        .iter()
        .flatten()
        .zip(b.data().iter().flatten())
        .map(|(p, q)| f64::from((p - q).abs()) / f64::from(p.abs().max(q.abs()).max(1e-3)))
        .fold(0.0, |m, d| if d.is_nan() { f64::INFINITY } else { f64::max(m, d) })
}

#[test]
fn the_scenes_guides_agree_with_the_cameras() {
    // World position from depth, and motion projected by the library's own camera, against the ray caster.
    let size = Size::new(40, 24);
    for scene in [
        wall(moving, Noise::None),
        floor(moving, Noise::None),
        mirror(moving, false, Noise::None),
        wall(jittered, Noise::None),
    ] {
        let frame = scene.frame(size, 5);
        let g = guides(&frame);
        let mut seen = 0;
        for y in 0..size.height {
            for x in 0..size.width {
                let pixel = g.sample_position(x, y);
                let (motion, expected) = (
                    g.motion.at(x, y),
                    if g.is_surface(x, y) {
                        g.previous_view.pixel(g.world(x, y))
                    } else {
                        g.previous_view.pixel_of_direction(g.view.ray_direction(pixel))
                    },
                );
                let difference = (expected.unwrap() - pixel - glam::Vec2::from(motion)).length();
                // Far out on the floor a pixel is many units wide, and single precision shows.
                assert!(difference < 0.02, "({x}, {y}): {difference} at depth {}", g.depth.at(x, y));
                seen += 1;
            }
        }
        assert_eq!(seen, size.pixels());
    }
}

#[test]
fn noise_is_unbiased_and_different_every_frame() {
    let scene = wall(still, Noise::Sparse(0.1));
    let size = Size::new(64, 48);
    let frames: Vec<f64> = (0..20).map(|i| mean(scene.frame(size, i).matte.as_ref().unwrap())).collect();
    let average = frames.iter().sum::<f64>() / 20.0;
    // Standard error: 0.5 * 3 / sqrt(64 * 48 * 20) = 0.006.
    assert!((average - 0.5).abs() < 0.02, "{average}");
    assert!(frames.windows(2).all(|w| w[0] != w[1]));
}
