//! Guides of one frame made ready for the filters: inverse depth with its slope, unit normals, and how noisy the
//! guides are themselves.
//!
//! Guides of other renderers are means over the pixel's samples (or one sample of it) and may be absent. Planes in
//! space are linear in 1/z over the image, so a slope of 1/z predicts a neighbour's depth without any camera.

use super::energy::Class;
use super::frame::SequenceFrame;
use super::packed::Packed;
use crate::frame::Rgb;
use crate::par;
use crate::plane::Size;

/// What the filters ask of a pixel's guides.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Surface {
    /// 1 / depth; 0: background, or no depth at all.
    pub inverse_depth: f32,
    /// Unit normal, or zeros.
    pub normal: [f32; 3],
    /// World position, or zeros.
    pub position: [f32; 3],
}

/// Guides that only the filters within one frame ask for; rows of width w, one after the other.
pub(super) struct Local {
    /// Change of inverse depth over one pixel to the right, and one down.
    pub slope: [Vec<f32>; 2],
    /// Inverse depth.
    pub inverse_depth: Vec<f32>,
    /// Noise of the depth guide, relative.
    pub depth_noise: Vec<f32>,
    /// Unit normals, component by component.
    pub normal: [Vec<f32>; 3],
    /// Noise of the normal guide: 1 - cosine that neighbours differ by whatever the direction.
    pub normal_noise: Vec<f32>,
    /// Tone-mapped albedo seen in mirrors and through glass, and the normal there. Empty: absent.
    pub seen_albedo: [Vec<f32>; 3],
    pub seen_normal: [Vec<f32>; 3],
    /// Colour of the surface. Empty: absent.
    pub albedo: [Vec<f32>; 3],
}

/// A frame's guides, as they wait in the window.
#[derive(Clone)]
pub(super) struct Guides {
    pub surface: Vec<Surface>,
    /// Tone-mapped albedo and unit normal seen in mirrors and through glass; `None`: absent.
    pub seen: Option<Packed>,
    /// Which of the two there are.
    has_seen: [bool; 2],
    /// That albedo's mean over 3x3: what a mirror shows there, its own aliasing apart.
    pub seen_around: Option<Packed>,
    /// Tone-mapped colour of the surface, where a light asks for it.
    pub albedo: Option<Packed>,
    /// World-space size of a pixel per unit of depth; 0 where positions are unknown.
    pub pixel_angle: f32,
}

/// Depths beyond it are background, whatever a renderer writes there (Cycles: 1e10).
const FAR: f32 = 1e9;

impl Guides {
    pub(super) fn new(frame: &SequenceFrame) -> Self {
        let (w, h) = (frame.size.width, frame.size.height);
        let mut surface = vec![Surface::default(); frame.size.pixels()];
        par::rows(&mut surface, w, |y, row| {
            for (x, s) in row.iter_mut().enumerate() {
                if let Some(depth) = &frame.depth {
                    let z = depth.at(x, y);
                    s.inverse_depth = if z > 0.0 && z < FAR { 1.0 / z } else { 0.0 };
                }
                s.normal = frame.normal.as_ref().map_or([0.0; 3], |n| unit(n.at(x, y)));
                if let Some(position) = &frame.position {
                    let p = position.at(x, y);
                    if p.iter().all(|c| c.is_finite()) {
                        s.position = p;
                    }
                }
            }
        });
        let pixel_angle = if frame.position.is_some() { pixel_angle(&surface, w, h) } else { 0.0 };
        let (albedo, normal) = (frame.seen_albedo.as_ref(), frame.seen_normal.as_ref());
        let has_seen = [albedo.is_some(), normal.is_some()];
        let seen = has_seen.contains(&true).then(|| {
            Packed::new(frame.size, 2, |k, i| {
                if k == 0 {
                    albedo.map_or([0.0; 3], |p| tone_mapped(p.data()[i]))
                } else {
                    normal.map_or([0.0; 3], |p| unit(p.data()[i]))
                }
            })
        });
        let seen_around = seen.as_ref().filter(|_| has_seen[0]).map(|seen| {
            Packed::new(frame.size, 1, |_, i| {
                let (x, y) = (i % w, i / w);
                let (mut sum, mut n) = ([0.0f32; 3], 0.0);
                for qy in y.saturating_sub(1)..(y + 2).min(h) {
                    for qx in x.saturating_sub(1)..(x + 2).min(w) {
                        let colour = seen.at(0, qy * w + qx);
                        for c in 0..3 {
                            sum[c] += colour[c];
                        }
                        n += 1.0;
                    }
                }
                sum.map(|s| s / n)
            })
        });
        let coloured = frame.lights.iter().any(|light| Class::of(light.kind) == Class::Coloured);
        let albedo = frame.albedo.as_ref().filter(|_| coloured);
        let albedo = albedo.map(|p| Packed::new(frame.size, 1, |_, i| tone_mapped(p.data()[i])));
        Self { surface, seen, has_seen, seen_around, albedo, pixel_angle }
    }

    /// Whether there are the colours, and the normals, that mirrors and glass show.
    pub(super) fn has_seen(&self) -> [bool; 2] {
        self.has_seen
    }

    /// What the filters within the frame ask for.
    /// `divisor`: what reflections were divided by.
    pub(super) fn local(&self, size: Size, divisor: Option<&Packed>) -> Local {
        Local::new(self, size, divisor)
    }
}

/// Added to the albedo seen in mirrors and glass: a difference that no tolerance bridges. Light that was divided by what it
/// shows never mixes with light that was not.
const APART: f32 = 8.0;

impl Local {
    fn new(guides: &Guides, size: Size, divisor: Option<&Packed>) -> Self {
        let (w, h) = (size.width, size.height);
        let surface = &guides.surface;
        let plane = |f: &(dyn Fn(usize, usize) -> f32 + Sync)| -> Vec<f32> { par::plane(size, f).into_vec() };
        let at = |x: usize, y: usize| &surface[y * w + x];
        // Of the two one-sided differences the smaller: the other may cross an edge.
        let slope = |here: f32, back: Option<f32>, forward: Option<f32>| -> f32 {
            let known = |v: &f32| here > 0.0 && *v > 0.0;
            match (back.filter(known).map(|v| here - v), forward.filter(known).map(|v| v - here)) {
                (Some(a), Some(b)) => {
                    if a.abs() < b.abs() {
                        a
                    } else {
                        b
                    }
                }
                (Some(a), None) | (None, Some(a)) => a,
                (None, None) => 0.0,
            }
        };
        let inverse = |x: usize, y: usize| at(x, y).inverse_depth;
        let dx = plane(&|x, y| {
            let (back, forward) = ((x > 0).then(|| inverse(x - 1, y)), (x + 1 < w).then(|| inverse(x + 1, y)));
            slope(inverse(x, y), back, forward)
        });
        let dy = plane(&|x, y| {
            let (back, forward) = ((y > 0).then(|| inverse(x, y - 1)), (y + 1 < h).then(|| inverse(x, y + 1)));
            slope(inverse(x, y), back, forward)
        });
        // Along an edge a clean guide is smooth; where it is smooth in no direction the guide is noisy.
        let calmest = |x: usize, y: usize, rough: &dyn Fn(&Surface, &Surface, &Surface) -> f32| -> f32 {
            if x == 0 || y == 0 || x + 1 >= w || y + 1 >= h {
                return 0.0;
            }
            [(1isize, 0isize), (0, 1), (1, 1), (1, -1)].into_iter().fold(f32::MAX, |least, (i, j)| {
                let a = at((x as isize - i) as usize, (y as isize - j) as usize);
                let b = at((x as isize + i) as usize, (y as isize + j) as usize);
                least.min(rough(a, at(x, y), b))
            })
        };
        let depth_noise = plane(&|x, y| {
            calmest(x, y, &|a, p, b| {
                if p.inverse_depth > 0.0 {
                    (a.inverse_depth + b.inverse_depth - 2.0 * p.inverse_depth).abs() / (2.0 * p.inverse_depth)
                } else {
                    0.0
                }
            })
        });
        let normal_noise = plane(&|x, y| {
            calmest(x, y, &|a, p, b| {
                let middle = [0, 1, 2].map(|c| 0.5 * (a.normal[c] + b.normal[c]));
                0.5 * (0..3).map(|c| (middle[c] - p.normal[c]).powi(2)).sum::<f32>()
            })
        });
        let component = |c: usize| surface.iter().map(|s| s.normal[c]).collect();
        let three = |packed: Option<&Packed>, k: usize| match packed {
            None => [Vec::new(), Vec::new(), Vec::new()],
            Some(packed) => [0, 1, 2].map(|c| plane(&|x, y| packed.at(k, y * w + x)[c])),
        };
        let seen = |k: usize| three(guides.seen.as_ref().filter(|_| guides.has_seen[k]), k);
        let mut seen_albedo = seen(0);
        if let Some(divisor) = divisor {
            let apart = |(i, mark): (usize, &mut f32)| {
                if divisor.at(0, i) != [1.0; 3] {
                    *mark += APART;
                }
            };
            seen_albedo[0].iter_mut().enumerate().for_each(apart);
        }
        Self {
            slope: [dx, dy],
            inverse_depth: surface.iter().map(|s| s.inverse_depth).collect(),
            depth_noise,
            normal: [component(0), component(1), component(2)],
            normal_noise,
            seen_albedo,
            seen_normal: seen(1),
            albedo: three(guides.albedo.as_ref(), 0),
        }
    }
}

/// Colour in 0..2.
fn tone_mapped(colour: Rgb) -> Rgb {
    colour.map(|v| if v.is_finite() && v > 0.0 { 2.0 * (v / (1.0 + v)) } else { 0.0 })
}

fn unit(n: [f32; 3]) -> [f32; 3] {
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    if length > 1e-3 && length.is_finite() { n.map(|c| c / length) } else { [0.0; 3] }
}

/// World-space distance of neighbouring pixels over their depth, of the surfaces that face the camera most directly.
fn pixel_angle(surface: &[Surface], w: usize, h: usize) -> f32 {
    let mut ratios: Vec<f32> = Vec::new();
    for y in (0..h).step_by(4) {
        for x in (0..w.saturating_sub(1)).step_by(3) {
            let (a, b) = (&surface[y * w + x], &surface[y * w + x + 1]);
            let d = (0..3).map(|c| (a.position[c] - b.position[c]).powi(2)).sum::<f32>().sqrt();
            let ratio = d * a.inverse_depth;
            if ratio > 0.0 && ratio.is_finite() {
                ratios.push(ratio);
            }
        }
    }
    if ratios.is_empty() {
        return 0.0;
    }
    let rank = ratios.len() / 10;
    *ratios.select_nth_unstable_by(rank, f32::total_cmp).1
}
