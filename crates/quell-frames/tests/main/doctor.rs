//! `quell doctor`: good sequences get no finding, sequences broken in one way get that one.
//!
//! The good sequence is a room made by formulas: floor, wall and a ball that rolls, a camera that moves and turns, Blender's
//! passes, noise of its own in every frame. The strengths are those at which `quell denoise` begins to suffer
//! (docs/doctor.md).

use crate::{Folder, shared_frames};
use exr::prelude::*;
use quell_frames::doctor::{CHECKS, Diagnosis, DoctorOptions, Severity, examine};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

const WIDTH: usize = 112;
const HEIGHT: usize = 72;
/// Focal length in pixels.
const FOCAL: f64 = 100.0;

type V = [f64; 3];

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Right, up and back of the camera, and where it is, at a time.
fn camera(t: f64) -> ([V; 3], V) {
    let (yaw, pitch) = (0.35 + 0.025 * t, -0.22);
    let (sy, cy, sp, cp) = (f64::sin(yaw), f64::cos(yaw), f64::sin(pitch), f64::cos(pitch));
    let (right, back) = ([cy, 0.0, -sy], [sy * cp, -sp, cy * cp]);
    let up = [
        back[1] * right[2] - back[2] * right[1],
        back[2] * right[0] - back[0] * right[2],
        back[0] * right[1] - back[1] * right[0],
    ];
    ([right, up, back], [1.6 + 0.05 * t, 1.5, 2.2 - 0.1 * t])
}

fn project(p: V, t: f64) -> [f64; 2] {
    let (axes, eye) = camera(t);
    let d = [p[0] - eye[0], p[1] - eye[1], p[2] - eye[2]];
    let [x, y, z] = axes.map(|axis| dot(axis, d));
    [WIDTH as f64 * 0.5 - FOCAL * x / z, HEIGHT as f64 * 0.5 + FOCAL * y / z]
}

fn ball(t: f64) -> V {
    [0.6 + 0.09 * t, 0.5, -1.2]
}

/// What a pixel sees.
struct Hit {
    position: V,
    normal: V,
    depth: f64,
    colour: V,
    /// Where the same point was and will be, in pixels.
    before: [f64; 2],
    after: [f64; 2],
}

fn hit(x: f64, y: f64, t: f64) -> Option<Hit> {
    let (axes, eye) = camera(t);
    let local = [(x - WIDTH as f64 * 0.5) / FOCAL, -(y - HEIGHT as f64 * 0.5) / FOCAL, -1.0];
    let ray: V = std::array::from_fn(|c| local[0] * axes[0][c] + local[1] * axes[1][c] + local[2] * axes[2][c]);
    let at = |s: f64| -> V { std::array::from_fn(|c| eye[c] + s * ray[c]) };
    let mut best: Option<(f64, V, bool)> = None;
    let mut meet = |s: f64, normal: V, moves: bool| {
        if s > 1e-6 && best.is_none_or(|(b, ..)| s < b) {
            best = Some((s, normal, moves));
        }
    };
    if ray[1] < 0.0 {
        meet(-eye[1] / ray[1], [0.0, 1.0, 0.0], false);
    }
    // A wall at the back, which ends above: sky.
    let s = (-4.0 - eye[2]) / ray[2];
    if s > 0.0 && at(s)[1] < 2.6 {
        meet(s, [0.0, 0.0, 1.0], false);
    }
    let s = (-3.0 - eye[0]) / ray[0];
    if s > 0.0 && at(s)[1] < 2.6 {
        meet(s, [1.0, 0.0, 0.0], false);
    }
    let middle = ball(t);
    let o: V = std::array::from_fn(|c| eye[c] - middle[c]);
    let (a, b, c) = (dot(ray, ray), dot(o, ray), dot(o, o) - 0.25);
    if b * b > a * c {
        let s = (-b - (b * b - a * c).sqrt()) / a;
        let p = at(s);
        meet(s, std::array::from_fn(|c| (p[c] - middle[c]) * 2.0), true);
    }
    let (s, normal, moves) = best?;
    let position = at(s);
    let of = |dt: f64| -> V {
        let (a, b) = (ball(t + dt), ball(t));
        if moves { std::array::from_fn(|c| position[c] + a[c] - b[c]) } else { position }
    };
    // A texture that is smooth over pixels, with edges here and there.
    let q = if moves { [position[0] - middle[0], position[1], position[2] - middle[2]] } else { position };
    let tile = (q[0].floor() + q[1].floor() + q[2].floor()).rem_euclid(2.0);
    let wave = 0.05 * (9.0 * q[0]).sin() * (7.0 * q[2] + 5.0 * q[1]).cos();
    let colour = [0.25 + 0.4 * tile + wave, 0.5 + wave, 0.75 - 0.4 * tile + wave];
    Some(Hit {
        position,
        normal,
        depth: s,
        colour,
        before: project(of(-1.0), t - 1.0),
        after: project(of(1.0), t + 1.0),
    })
}

/// Noise between 0 and 1.
fn random(x: usize, y: usize, seed: u64) -> f64 {
    let mut h = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    h = (h ^ seed.wrapping_mul(0x1656_67b1_9e37_79f9)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    h = (h ^ (h >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    ((h ^ (h >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// A frame as it is written: channels by name.
#[derive(Clone)]
struct Frame {
    size: (usize, usize),
    channels: BTreeMap<String, Vec<f32>>,
    half: Vec<String>,
    compression: Compression,
}

impl Frame {
    fn plane(&mut self, name: &str) -> &mut Vec<f32> {
        self.channels.get_mut(name).unwrap_or_else(|| panic!("{name}"))
    }

    fn each(&mut self, names: &[&str], change: impl Fn(usize, f32) -> f32) {
        for name in names {
            for (i, v) in self.plane(name).iter_mut().enumerate() {
                *v = change(i, *v);
            }
        }
    }

    fn keep(&mut self, passes: &[&str]) {
        self.channels.retain(|name, _| passes.iter().any(|p| name.starts_with(&format!("ViewLayer.{p}."))));
    }

    fn drop(&mut self, pass: &str) {
        self.channels.retain(|name, _| !name.starts_with(&format!("ViewLayer.{pass}.")));
    }

    fn rename(&mut self, from: &str, to: &str) {
        let old = std::mem::take(&mut self.channels);
        self.channels =
            old.into_iter().map(|(name, v)| (name.replace(&format!(".{from}."), &format!(".{to}.")), v)).collect();
    }

    /// The beauty from its passes, as Blender adds them.
    fn add_up(&mut self) {
        for c in ["R", "G", "B"] {
            let get = |name: &str| self.channels[&format!("ViewLayer.{name}.{c}")].clone();
            let (direct, indirect, colour, sky) = (get("DiffDir"), get("DiffInd"), get("DiffCol"), get("Env"));
            let sum = (0..direct.len()).map(|i| (direct[i] + indirect[i]) * colour[i] + sky[i]).collect();
            self.channels.insert(format!("ViewLayer.Combined.{c}"), sum);
        }
    }

    fn write(&self, path: &Path) {
        let channels: Vec<AnyChannel<FlatSamples>> = self
            .channels
            .iter()
            .map(|(name, values)| {
                let half = self.half.iter().any(|h| name.contains(h.as_str()));
                let samples = if half {
                    FlatSamples::F16(values.iter().map(|v| f16::from_f32(*v)).collect())
                } else {
                    FlatSamples::F32(values.clone())
                };
                AnyChannel::new(name.as_str(), samples)
            })
            .collect();
        let encoding = Encoding { compression: self.compression, ..Encoding::FAST_LOSSLESS };
        let layer = Layer::new(self.size, LayerAttributes::default(), encoding, AnyChannels::sort(channels.into()));
        Image::from_layer(layer).write().non_parallel().to_file(path).unwrap();
    }
}

const LIGHT: [&str; 6] = [
    "ViewLayer.DiffDir.R",
    "ViewLayer.DiffDir.G",
    "ViewLayer.DiffDir.B",
    "ViewLayer.DiffInd.R",
    "ViewLayer.DiffInd.G",
    "ViewLayer.DiffInd.B",
];
const VECTOR: [&str; 4] = ["ViewLayer.Vector.X", "ViewLayer.Vector.Y", "ViewLayer.Vector.Z", "ViewLayer.Vector.W"];
const NORMAL: [&str; 3] = ["ViewLayer.Normal.X", "ViewLayer.Normal.Y", "ViewLayer.Normal.Z"];

/// The room at time `t`, with noise of `seed`, seen through pixels that are `jitter` beside their centres.
fn room(t: f64, seed: u64, jitter: [f64; 2]) -> Frame {
    let mut channels: BTreeMap<String, Vec<f32>> = BTreeMap::new();
    let mut put = |name: &str, v: f64| channels.entry(format!("ViewLayer.{name}")).or_default().push(v as f32);
    for i in 0..WIDTH * HEIGHT {
        let (x, y) = (i % WIDTH, i / WIDTH);
        let (px, py) = (x as f64 + 0.5, y as f64 + 0.5);
        let seen = hit(px + jitter[0], py + jitter[1], t);
        // Vectors are measured without jitter.
        let steady = if jitter == [0.0; 2] { None } else { hit(px, py, t) };
        let still = steady.as_ref().or(seen.as_ref());
        let (nothing, sky) = (seen.is_none(), if seen.is_none() { 1.0 } else { 0.0 });
        for (c, letter) in ["R", "G", "B"].into_iter().enumerate() {
            // Few paths: an exponential deviate; sun or shade.
            let smooth = seen.as_ref().map_or(0.0, |h| 0.4 + 0.2 * (h.position[0] * 0.7).sin() + 0.15 * h.normal[1]);
            let path = -(1.0 - random(x, y, seed * 3 + 1)).ln();
            let other = -(1.0 - random(x, y, seed * 3 + 2)).ln();
            put(&format!("DiffDir.{letter}"), smooth * (0.3 + 0.7 * path));
            put(&format!("DiffInd.{letter}"), smooth * 0.4 * other * (1.0 - 0.1 * c as f64));
            put(&format!("DiffCol.{letter}"), seen.as_ref().map_or(0.0, |h| h.colour[c]));
            put(&format!("Env.{letter}"), sky * [0.5, 0.7, 1.0][c]);
        }
        for (c, letter) in ["X", "Y", "Z"].into_iter().enumerate() {
            put(&format!("Normal.{letter}"), seen.as_ref().map_or(0.0, |h| h.normal[c]));
            put(&format!("Position.{letter}"), seen.as_ref().map_or(0.0, |h| h.position[c]));
        }
        put("Depth.Z", seen.as_ref().map_or(1e10, |h| h.depth));
        let vectors = still
            .filter(|_| !nothing)
            .map_or([0.0; 4], |h| [h.before[0] - px, -(h.before[1] - py), -(h.after[0] - px), h.after[1] - py]);
        for (letter, v) in ["X", "Y", "Z", "W"].into_iter().zip(vectors) {
            put(&format!("Vector.{letter}"), v);
        }
    }
    let half = vec![".Diff".to_owned(), ".Combined".to_owned(), ".Env".to_owned()];
    let mut frame = Frame { size: (WIDTH, HEIGHT), channels, half, compression: Compression::ZIP16 };
    frame.add_up();
    frame
}

/// Frames 1 to 6 of the room, made once.
fn good() -> &'static [Frame] {
    static FRAMES: std::sync::OnceLock<Vec<Frame>> = std::sync::OnceLock::new();
    FRAMES.get_or_init(|| (1..=6).map(|t| room(f64::from(t), t as u64, [0.0; 2])).collect())
}

fn file(folder: &Folder, n: i64) -> PathBuf {
    folder.file(&format!("room.{n:04}.exr"))
}

/// Writes the six frames, each changed.
fn write(folder: &Folder, mut change: impl FnMut(i64, &mut Frame)) {
    for (n, frame) in (1..).zip(good()) {
        let mut frame = frame.clone();
        change(n, &mut frame);
        frame.write(&file(folder, n));
    }
}

fn look(path: &Path) -> Diagnosis {
    look_with(path, DoctorOptions::default())
}

fn look_with(path: &Path, options: DoctorOptions) -> Diagnosis {
    let found =
        examine(&DoctorOptions { inputs: vec![path.to_owned()], ..options }, &|_, _| {}, &AtomicBool::new(false))
            .unwrap();
    for f in &found.findings {
        assert!(CHECKS.contains(&f.check), "{} is not in the list", f.check);
        assert!(!f.evidence.is_empty() && !f.remedy.is_empty() && !f.spoils.is_empty(), "{f:?}");
    }
    found
}

fn names(found: &Diagnosis) -> Vec<&'static str> {
    let mut names: Vec<&str> = found.findings.iter().map(|f| f.check).collect();
    names.dedup();
    names
}

fn told(found: &Diagnosis) -> String {
    let lines = found.findings.iter().map(|f| format!("{} {:?}: {}; {}", f.check, f.frame, f.what, f.evidence));
    lines.chain(found.passed.iter().map(|p| format!("  good {}: {}", p.check, p.text))).collect::<Vec<_>>().join("\n")
}

/// Writes a sequence broken in one way and expects that finding, and no other.
fn broken(name: &str, expected: &str, severity: Severity, change: impl FnMut(i64, &mut Frame)) -> Diagnosis {
    let folder = Folder::new(&format!("doctor-{name}"));
    write(&folder, change);
    let found = look(&folder.0);
    assert_eq!(names(&found), [expected], "{name}:\n{}", told(&found));
    assert_eq!(found.findings[0].severity, severity, "{name}:\n{}", told(&found));
    found
}

#[test]
fn good_sequences_get_no_finding() {
    let folder = Folder::new("doctor-good");
    write(&folder, |_, _| {});
    let found = look(&folder.0);
    assert!(found.findings.is_empty(), "{}", told(&found));
    println!("{}", told(&found));
    assert!(found.not_examined.is_empty(), "{:?}", found.not_examined);
    assert!(found.passed.len() >= 8 && found.examined == [1, 2, 3, 4, 5, 6], "{:?}", found.examined);
    // With fewer passes less is examined, and nothing invented.
    write(&folder, |_, f| f.drop("Position"));
    let found = look(&folder.0);
    assert!(found.findings.is_empty(), "{}", told(&found));
    write(&folder, |_, f| {
        f.rename("DiffCol", "albedo");
        f.keep(&["Combined", "albedo", "Normal", "Depth", "Vector"]);
    });
    let found = look(&folder.0);
    assert!(found.findings.is_empty(), "{}", told(&found));
}

#[test]
fn vectors_that_are_wrong() {
    use Severity::{Fault, Warning};
    let negative = |letters: &'static [usize]| {
        move |_: i64, f: &mut Frame| letters.iter().for_each(|i| f.each(&[VECTOR[*i]], |_, v| -v))
    };
    broken("sign-x", "motion.sign", Fault, negative(&[0, 2]));
    let found = broken("sign-y", "motion.sign", Fault, negative(&[1, 3]));
    assert!(
        found.findings[0].what.contains("vertical") && found.findings[0].remedy.contains("--motion"),
        "{}",
        told(&found)
    );
    broken("sign-both", "motion.direction", Fault, negative(&[0, 1, 2, 3]));
    broken("direction", "motion.direction", Fault, |_, f| {
        for (a, b) in [(0, 2), (1, 3)] {
            let (p, q) = (f.plane(VECTOR[a]).clone(), f.plane(VECTOR[b]).clone());
            *f.plane(VECTOR[a]) = q.iter().map(|v| -v).collect();
            *f.plane(VECTOR[b]) = p.iter().map(|v| -v).collect();
        }
    });
    broken("axis", "motion.axis", Fault, |_, f| {
        for (a, b) in [(0, 1), (2, 3)] {
            let (p, q) = (f.plane(VECTOR[a]).clone(), f.plane(VECTOR[b]).clone());
            *f.plane(VECTOR[a]) = q;
            *f.plane(VECTOR[b]) = p;
        }
    });
    let unit = |factor: f32| {
        move |_: i64, f: &mut Frame| {
            f.each(&[VECTOR[0], VECTOR[2]], |_, v| v * factor / WIDTH as f32);
            f.each(&[VECTOR[1], VECTOR[3]], |_, v| v * factor / HEIGHT as f32);
        }
    };
    broken("unit-uv", "motion.unit", Fault, unit(1.0));
    broken("unit-ndc", "motion.unit", Fault, unit(2.0));
    for factor in [0.85, 1.15, 0.5, 2.0] {
        let found = broken("scale", "motion.scale", Fault, |_, f| f.each(&VECTOR, |_, v| v * factor));
        let measured = found.findings[0].figures[0].value;
        assert!((measured * f64::from(factor) - 1.0).abs() < 0.03, "{measured} for {factor}");
    }
    broken("scale-blind", "motion.scale", Fault, |_, f| {
        f.each(&VECTOR, |_, v| v * 0.8);
        f.drop("Position");
    });
    broken("zero", "motion.zero", Warning, |_, f| f.each(&VECTOR, |_, _| 0.0));
    broken("zero-blind", "motion.zero", Fault, |_, f| {
        f.each(&VECTOR, |_, _| 0.0);
        f.drop("Position");
    });
    broken("noise", "motion.unexplained", Fault, |n, f| {
        f.each(&VECTOR, |i, _| (random(i, n as usize, 5) * 20.0 - 10.0) as f32)
    });
    // Noise in vectors makes a factor in least squares; that is no wrong length.
    let folder = Folder::new("doctor-noisy-vectors");
    write(&folder, |n, f| f.each(&VECTOR, |i, v| v + (random(i, n as usize, 6) * 2.0 - 1.0) as f32));
    let found = look(&folder.0);
    assert!(!names(&found).contains(&"motion.scale"), "{}", told(&found));
    broken("none", "motion.missing", Fault, |_, f| {
        f.drop("Vector");
        f.drop("Position");
    });
    broken("none-seen", "motion.missing", Warning, |_, f| f.drop("Vector"));
}

#[test]
fn guides_that_are_jittered() {
    let halton = |n: usize, base: usize| {
        let (mut n, mut f, mut r) = (n, 1.0, 0.0);
        while n > 0 {
            f /= base as f64;
            r += f * (n % base) as f64;
            n /= base;
        }
        r - 0.5
    };
    let folder = Folder::new("doctor-jitter");
    for n in 1..=6usize {
        // Half of what temporal anti-aliasing uses.
        let jitter = [0.6 * halton(n, 2), 0.6 * halton(n, 3)];
        let mut frame = room(n as f64, n as u64, jitter);
        frame.drop("Position");
        frame.write(&file(&folder, n as i64));
    }
    let found = look(&folder.0);
    assert_eq!(names(&found), ["guides.jitter"], "{}", told(&found));
    assert!(
        found.worst() == Some(Severity::Warning) && found.findings[0].what.contains("jittered"),
        "{}",
        told(&found)
    );
}

#[test]
fn guides_that_are_stored_otherwise() {
    use Severity::{Note, Warning};
    broken("normal-01", "normal.encoded", Note, |_, f| {
        let background: Vec<bool> = f.plane("ViewLayer.Depth.Z").iter().map(|d| *d > 1e9).collect();
        f.each(&NORMAL, |i, v| if background[i] { 0.0 } else { v * 0.5 + 0.5 });
    });
    broken("normal-half", "normal.length", Warning, |_, f| f.each(&NORMAL, |_, v| v * 0.5));
    broken("normal-camera", "normal.space", Warning, |n, f| {
        let (axes, _) = camera(n as f64);
        let planes = NORMAL.map(|name| f.plane(name).clone());
        for (name, axis) in NORMAL.into_iter().zip(axes) {
            f.each(&[name], |i, _| dot(axis, planes.each_ref().map(|p| f64::from(p[i]))) as f32);
        }
    });
    let along = |f: &mut Frame| {
        f.each(&["ViewLayer.Depth.Z"], |i, v| {
            let (x, y) =
                ((i % WIDTH) as f64 + 0.5 - WIDTH as f64 / 2.0, (i / WIDTH) as f64 + 0.5 - HEIGHT as f64 / 2.0);
            if v > 1e9 { v } else { v * (1.0 + (x * x + y * y) / (FOCAL * FOCAL)).sqrt() as f32 }
        });
    };
    broken("depth-ray", "depth.ray", Note, |_, f| along(f));
    broken("depth-ray-blind", "depth.ray", Warning, |_, f| {
        along(f);
        f.drop("Position");
    });
    broken("depth-inverse-blind", "depth.kind", Warning, |_, f| {
        f.each(&["ViewLayer.Depth.Z"], |_, v| if v > 1e9 { 0.0 } else { 1.0 / v });
        f.drop("Position");
    });
    broken("albedo", "albedo.above_one", Severity::Fault, |_, f| {
        f.rename("DiffCol", "albedo");
        f.keep(&["Combined", "albedo", "Normal", "Depth", "Vector"]);
        f.each(&["ViewLayer.albedo.R"], |_, v| if v > 0.6 { v * 2.0 } else { v });
    });
    // The user's word against it is the end of it.
    let folder = Folder::new("doctor-albedo");
    write(&folder, |_, f| {
        f.rename("DiffCol", "albedo");
        f.keep(&["Combined", "albedo", "Normal", "Depth", "Vector"]);
        f.each(&["ViewLayer.albedo.R"], |_, v| if v > 0.6 { v * 2.0 } else { v });
    });
    let map = quell_frames::MapOptions { map: vec!["albedo=none".to_owned()], ..quell_frames::MapOptions::default() };
    let found = look_with(&folder.0, DoctorOptions { map, ..DoctorOptions::default() });
    assert!(found.findings.is_empty(), "{}", told(&found));
    broken("b44", "codec.lossy", Warning, |_, f| {
        // Only half floats are damaged by it.
        f.half = vec![".Normal".to_owned(), ".Vector".to_owned(), ".Position".to_owned(), ".Depth".to_owned()];
        f.each(&["ViewLayer.Depth.Z"], |_, v| v.min(65504.0));
        f.compression = Compression::B44;
    });
}

/// A Gaussian of `s` pixels over a plane.
fn blurred(plane: &[f32], s: f64) -> Vec<f32> {
    let radius = (3.0 * s).ceil() as isize;
    let weights: Vec<f64> = (-radius..=radius).map(|k| (-0.5 * (k as f64 / s).powi(2)).exp()).collect();
    let mut now: Vec<f64> = plane.iter().map(|v| f64::from(*v)).collect();
    for (dx, dy) in [(1, 0), (0, 1)] {
        now = (0..plane.len())
            .map(|i| {
                let (mut sum, mut all) = (0.0, 0.0);
                for (k, w) in (-radius..=radius).zip(&weights) {
                    let (x, y) = ((i % WIDTH) as isize + k * dx, (i / WIDTH) as isize + k * dy);
                    if x >= 0 && y >= 0 && (x as usize) < WIDTH && (y as usize) < HEIGHT {
                        sum += w * now[y as usize * WIDTH + x as usize];
                        all += w;
                    }
                }
                sum / all
            })
            .collect();
    }
    now.into_iter().map(|v| v as f32).collect()
}

#[test]
fn noise_that_is_not_as_it_should_be() {
    use Severity::Fault;
    let blur = |s: f64| {
        move |_: i64, f: &mut Frame| {
            for name in LIGHT {
                let new = blurred(f.plane(name), s);
                *f.plane(name) = new;
            }
            f.add_up();
        }
    };
    broken("splat", "filter.splatted", Fault, blur(0.5));
    broken("denoised", "input.denoised", Fault, blur(2.0));
    let folder = Folder::new("doctor-seed");
    for n in 1..=6 {
        room(f64::from(n), 1, [0.0; 2]).write(&file(&folder, i64::from(n)));
    }
    let found = look(&folder.0);
    assert_eq!(names(&found), ["seed.repeated"], "{}", told(&found));
    assert!(found.findings[0].remedy.contains("use_animated_seed"), "{}", told(&found));
    broken("inside", "light.colour", Fault, |_, f| {
        for c in ["R", "G", "B"] {
            let colour = f.plane(&format!("ViewLayer.DiffCol.{c}")).clone();
            for pass in ["DiffDir", "DiffInd"] {
                f.each(&[&format!("ViewLayer.{pass}.{c}")], |i, v| v * colour[i]);
            }
        }
        f.drop("Combined");
    });
}

/// Light with fine detail of its own and little noise, as at many samples: sunlight through leaves.
fn detailed(n: i64, f: &mut Frame, noise: f64) {
    for i in 0..WIDTH * HEIGHT {
        let (x, y) = (i % WIDTH, i / WIDTH);
        let Some(h) = hit(x as f64 + 0.5, y as f64 + 0.5, n as f64) else { continue };
        let [p, q, r] = h.position;
        let leaves = 1.0 + 0.2 * (16.0 * p + 3.0 * q).sin() * (14.0 * r + 9.0 * q).sin();
        for (c, letter) in ["R", "G", "B"].into_iter().enumerate() {
            let path = 1.0 + noise * (random(x, y, (n * 7) as u64 + c as u64) - 0.5);
            f.plane(&format!("ViewLayer.DiffDir.{letter}"))[i] = (0.5 * leaves * path) as f32;
            f.plane(&format!("ViewLayer.DiffInd.{letter}"))[i] = 0.1;
        }
    }
    f.add_up();
}

#[test]
fn fine_detail_is_no_noise_that_neighbours_share() {
    let folder = Folder::new("doctor-detail");
    let ratio = |found: &Diagnosis| -> f64 {
        let all =
            found.passed.iter().find(|p| p.check == "filter.splatted").map_or_else(String::new, |p| p.text.clone());
        let percent = all.split("are ").nth(1).and_then(|rest| rest.split(' ').next()).and_then(|n| n.parse().ok());
        percent.unwrap_or_else(|| panic!("{all}"))
    };
    write(&folder, |n, f| detailed(n, f, 0.3));
    let found = look(&folder.0);
    assert!(found.findings.is_empty(), "{}", told(&found));
    println!("{}", told(&found));
    // Differences within one frame alone would have said so.
    assert!(ratio(&found) < 78.0, "{}", told(&found));
    // One frame cannot be judged by its detail, and is not.
    let alone = Folder::new("doctor-detail-one");
    let mut frame = good()[0].clone();
    detailed(1, &mut frame, 0.6);
    frame.write(&file(&alone, 1));
    let one = look(&alone.0);
    assert!(
        one.findings.is_empty() && one.not_examined.iter().any(|n| n.why.contains("fine detail")),
        "{}",
        told(&one)
    );
    // Canary: the same detail with noise that is shared.
    let blur = |n: i64, f: &mut Frame| {
        detailed(n, f, 0.8);
        let clean = {
            let mut clean = f.clone();
            detailed(n, &mut clean, 0.0);
            clean
        };
        for name in &LIGHT[..3] {
            let calm = clean.channels[*name].clone();
            let noise: Vec<f32> = f.plane(name).iter().zip(&calm).map(|(a, b)| a - b).collect();
            *f.plane(name) = blurred(&noise, 0.6).iter().zip(&calm).map(|(a, b)| a + b).collect();
        }
        f.add_up();
    };
    broken("detail-splat", "filter.splatted", Severity::Fault, blur);
}

#[test]
fn light_and_emission_that_change_on_surfaces_at_rest() {
    use Severity::Note;
    // A tenth of the light more, everywhere: less than what is reported.
    let lamp = |more: f32| {
        move |n: i64, f: &mut Frame| {
            let place = f.plane("ViewLayer.Position.X").clone();
            f.each(&LIGHT[..3], |i, v| if n >= 4 && place[i] < 0.2 { v * more } else { v });
            f.add_up();
        }
    };
    let found = broken("lamp", "light.changes", Note, lamp(2.0));
    assert_eq!(found.findings[0].frame, Some(4), "{}", told(&found));
    assert!(found.findings[0].evidence.contains("changes in frames 4"), "{}", told(&found));
    let folder = Folder::new("doctor-lamp-still");
    write(&folder, lamp(1.05));
    let found = look(&folder.0);
    assert!(found.findings.is_empty(), "{}", told(&found));
    // A sign on the wall at the back that blinks.
    let sign = |blinks: bool| {
        move |n: i64, f: &mut Frame| {
            let at = |f: &mut Frame, c: &str| f.plane(&format!("ViewLayer.Position.{c}")).clone();
            let (x, y, z) = (at(f, "X"), at(f, "Y"), at(f, "Z"));
            let lit = !blinks || n % 2 == 0;
            let on = |i: usize| z[i] < -3.9 && (0.2..0.7).contains(&x[i]) && (0.9..1.3).contains(&y[i]);
            for c in ["R", "G", "B"] {
                let values: Vec<f32> = (0..x.len()).map(|i| if lit && on(i) { 2.0 } else { 0.0 }).collect();
                let sum = f.plane(&format!("ViewLayer.Combined.{c}")).iter().zip(&values).map(|(a, b)| a + b).collect();
                f.channels.insert(format!("ViewLayer.Combined.{c}"), sum);
                f.channels.insert(format!("ViewLayer.Emit.{c}"), values);
            }
        }
    };
    let found = broken("sign", "emission.changes", Note, sign(true));
    assert_eq!(found.findings[0].channel, "ViewLayer.Emit", "{}", told(&found));
    let folder = Folder::new("doctor-sign-still");
    write(&folder, sign(false));
    let found = look(&folder.0);
    assert!(found.findings.is_empty(), "{}", told(&found));
}

#[test]
fn how_much_noise_there_is_is_measured() {
    let folder = Folder::new("doctor-level");
    // Even noise of full width `noise` deviates by noise / sqrt(12); of it three channels are averaged, and a sixth of the
    // light has none.
    let measured = |noise: f64| {
        write(&folder, |n, f| detailed(n, f, noise));
        let found = look(&folder.0);
        let level =
            found.noise.iter().find(|n| n.pass == "ViewLayer.DiffDir").unwrap_or_else(|| panic!("{:?}", found.noise));
        level.relative / (noise / 12f64.sqrt() / 3f64.sqrt())
    };
    for noise in [0.8, 0.4] {
        let ratio = measured(noise);
        assert!((0.75..1.35).contains(&ratio), "{noise}: {ratio}");
    }
}

#[test]
fn values_that_are_none() {
    use Severity::Warning;
    let some = |i: usize, share: f64| random(i, 3, 77) < share;
    broken("nan", "values.nan", Warning, |_, f| {
        f.each(&["ViewLayer.DiffInd.G"], |i, v| if i == 777 { f32::NAN } else { v });
    });
    broken("infinite", "values.infinite", Warning, |n, f| {
        f.each(&["ViewLayer.DiffInd.G"], |i, v| if i == 777 && n == 3 { f32::INFINITY } else { v });
    });
    let found = broken("negative", "values.negative", Warning, |_, f| {
        f.each(&LIGHT, |i, v| if some(i, 2e-3) { -v - 0.5 } else { v });
        f.add_up();
    });
    assert!(found.findings[0].evidence.contains("the least is"), "{}", told(&found));
    broken("fireflies", "values.fireflies", Warning, |_, f| {
        f.each(&LIGHT, |i, v| if i == 4321 { v + 300.0 } else { v });
        f.add_up();
    });
}

#[test]
fn frames_that_are_missing_twice_there_or_others() {
    use Severity::Fault;
    let folder = Folder::new("doctor-files");
    let fresh = || write(&folder, |_, _| {});
    let expect = |expected: &str, frame: i64| {
        let found = look(&folder.0);
        assert_eq!(names(&found), [expected], "{}", told(&found));
        assert_eq!((found.findings[0].severity, found.findings[0].frame), (Fault, Some(frame)), "{}", told(&found));
    };
    fresh();
    std::fs::remove_file(file(&folder, 3)).unwrap();
    expect("frames.missing", 3);
    // What the user leaves out is not missing.
    let options = DoctorOptions { frames: Some(vec![1, 2, 4, 5]), ..DoctorOptions::default() };
    assert!(look_with(&folder.0, options).findings.is_empty());
    for n in [2, 4, 6] {
        let _ = std::fs::remove_file(file(&folder, n));
    }
    good()[2].write(&file(&folder, 3));
    expect("frames.step", 2);
    fresh();
    std::fs::copy(file(&folder, 4), file(&folder, 5)).unwrap();
    expect("frames.repeated", 5);
    fresh();
    let bytes = std::fs::read(file(&folder, 4)).unwrap();
    std::fs::write(file(&folder, 4), &bytes[..bytes.len() / 2]).unwrap();
    expect("frames.unreadable", 4);
    std::fs::write(file(&folder, 4), b"no EXR").unwrap();
    expect("frames.unreadable", 4);
    fresh();
    let mut small = good()[5].clone();
    small.size = (WIDTH, HEIGHT / 2);
    small.channels.values_mut().for_each(|v| v.truncate(WIDTH * (HEIGHT / 2)));
    small.write(&file(&folder, 6));
    expect("frames.size", 6);
    fresh();
    let mut other = good()[5].clone();
    other.drop("Depth");
    other.write(&file(&folder, 6));
    expect("frames.layout", 6);
    assert!(look(&folder.0).findings[0].evidence.contains("ViewLayer.Depth.Z"));
}

#[test]
fn animation_on_twos() {
    use Severity::Fault;
    let held = |n: i64| if n % 2 == 0 { n - 1 } else { n };
    let found = broken("twos", "frames.on_twos", Fault, |n, f| *f = good()[held(n) as usize - 1].clone());
    assert!(found.findings[0].evidence.contains("bit for bit"), "{}", told(&found));
    let folder = Folder::new("doctor-hold");
    for n in 1..=6 {
        room(held(n) as f64, n as u64, [0.0; 2]).write(&file(&folder, n));
    }
    let found = look(&folder.0);
    assert_eq!(names(&found), ["frames.on_twos"], "{}", told(&found));
}

#[test]
fn passes_with_other_names() {
    use Severity::{Fault, Warning};
    let found = broken("renamed", "passes.renamed", Fault, |_, f| f.rename("Vector", "Vectors"));
    assert!(found.findings[0].remedy.contains("--map motion=Vectors"), "{}", told(&found));
    broken("renamed-normal", "passes.renamed", Fault, |_, f| f.rename("Normal", "Normal001"));
    broken("no-normal", "passes.missing", Warning, |_, f| f.drop("Normal"));
    broken("sum", "passes.sum", Warning, |_, f| f.drop("DiffInd"));
}

#[test]
fn what_cannot_be_examined_is_said() {
    let folder = Folder::new("doctor-little");
    let why = |found: &Diagnosis, what: &str| {
        let all: Vec<String> = found.not_examined.iter().map(|n| format!("{} because {}", n.what, n.why)).collect();
        assert!(all.iter().any(|n| n.contains(what)), "{all:?}");
    };
    good()[0].write(&file(&folder, 1));
    let found = look(&folder.0);
    assert!(found.findings.is_empty(), "{}", told(&found));
    why(&found, "one frame only");
    // No guides at all.
    write(&folder, |_, f| f.keep(&["Combined"]));
    let found = look(&folder.0);
    assert_eq!(names(&found), ["motion.missing", "passes.missing"], "{}", told(&found));
    // Files that are no EXR.
    (1..=6).for_each(|n| std::fs::write(file(&folder, n), "a picture").unwrap());
    let found = look(&folder.0);
    assert_eq!(names(&found), ["frames.unreadable"], "{}", told(&found));
    why(&found, "passes, pixels and motion");
    // Two sequences in one folder.
    write(&folder, |_, _| {});
    good()[0].write(&folder.file("elsewhere.0001.exr"));
    let found = look(&folder.0);
    assert_eq!(names(&found), ["frames.mixed"], "{}", told(&found));
    why(&found, "headers, passes, pixels");
    let nothing = DoctorOptions { inputs: vec![folder.file("none.####.exr")], ..DoctorOptions::default() };
    assert!(examine(&nothing, &|_, _| {}, &AtomicBool::new(false)).is_err());
}

#[test]
fn frames_of_other_renderers() {
    let Some(frames) = shared_frames() else { return };
    let hall = look(&frames.join("hall/noisy"));
    assert!(hall.worst() <= Some(Severity::Note), "{}", told(&hall));
    let mut found = names(&look(&frames.join("mitsuba_box/noisy")));
    found.sort_unstable();
    assert_eq!(found, ["albedo.above_one", "depth.ray", "motion.missing"]);
    let dwa = look(&frames.join("exr_aov/blender50_multipart_dwaa.exr"));
    assert!(names(&dwa).contains(&"codec.lossy"), "{}", told(&dwa));
}
