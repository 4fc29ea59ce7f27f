//! Guides turned to the contract: depth along the axis, world normals on the viewer's side.

use super::camera::PixelCamera;
use super::lights::surface_colour;
use super::planes::{gather, single};
use super::{Adapter, Error};
use crate::image::{AttributeValue, ExrImage, Window};
use crate::roles::{DepthKind, Mapped, Mapping, Role, Space};
use quell::sequence::SequenceFrame;
use quell::{Plane, Size};
use rayon::prelude::*;

/// Depths from here on are the background: Blender writes 1e10, Arnold 1e30.
const FAR: f32 = 1e9;
/// The same in half floats, which end at 65504.
const FAR_HALF: f32 = 65504.0;

/// Cameras from matrices that miss positions by more than this many pixels in the median are of something else.
const CAMERA_FITS_PX: f64 = 1.0;

/// What the first frame shows of how guides are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Encodings {
    /// Normals lie in 0..1 instead of -1..1.
    pub(super) normal_unsigned: bool,
    seen_unsigned: bool,
}

impl Encodings {
    pub fn find(mapping: &Mapping, canvas: Window, images: &[ExrImage]) -> Result<Self, Error> {
        let unsigned = |role| -> Result<bool, Error> {
            let Some(pass) = mapping.get(role) else { return Ok(false) };
            let plane = gather(images, &pass.channels, canvas, [0.0; 3])?;
            let (mut outside, mut folded, mut plain, mut count) = (0, 0, 0, 0);
            for n in plane.data().iter().filter(|n| **n != [0.0; 3]) {
                count += 1;
                outside += usize::from(n.iter().any(|v| !(-1e-3..=1.0 + 1e-3).contains(v)));
                folded += usize::from((length(n.map(|v| 2.0 * v - 1.0)) - 1.0).abs() < 0.06);
                plain += usize::from((length(*n) - 1.0).abs() < 0.06);
            }
            Ok(count > 0 && outside == 0 && folded * 10 > count * 7 && folded > plain)
        };
        Ok(Self { normal_unsigned: unsigned(Role::Normal)?, seen_unsigned: unsigned(Role::SeenNormal)? })
    }
}

/// Fills the guides of a frame; returns its camera where the file has one.
pub(super) fn fill(
    adapter: &Adapter,
    frame: &mut SequenceFrame,
    images: &[ExrImage],
    notes: &mut Vec<String>,
) -> Result<Option<PixelCamera>, Error> {
    let (mapping, canvas) = (&adapter.mapping, adapter.canvas);
    let renderer = &mapping.renderer;
    frame.depth = depth(mapping, canvas, images)?;
    let position = mapping.get(Role::Position);
    let position = position.map(|p| gather(images, &p.channels, canvas, [0.0; 3])).transpose()?;
    let surface = |depth: Option<&Plane<f32>>, position: &Plane<[f32; 3]>, i: usize| {
        let here = position.data().get(i).is_some_and(|p| *p != [0.0; 3] && p.iter().all(|v| v.is_finite()));
        here && depth.is_none_or(|d| d.data().get(i).is_some_and(|d| d.is_finite()))
    };
    let world = position.as_ref().filter(|_| renderer.position == Space::World);
    let mut camera = from_header(images, canvas);
    if let (Some(found), Some(world)) = (&mut camera, world) {
        let residual = found.residual(world, |i| surface(frame.depth.as_ref(), world, i));
        found.residual_px = residual.unwrap_or(0.0);
        if found.residual_px > CAMERA_FITS_PX {
            notes.push(format!(
                "the header's camera misses the positions by {:.1} px; it is not used",
                found.residual_px
            ));
            camera = None;
        }
    }
    if let (None, Some(world)) = (&camera, world) {
        camera = PixelCamera::solve(world, |i| surface(frame.depth.as_ref(), world, i));
        match &mut camera {
            Some(found) if found.residual_px <= CAMERA_FITS_PX => {}
            Some(found) => {
                let off = found.residual_px;
                notes.push(format!("no camera explains the positions ({off:.1} px off); are they in world space?"));
                camera = None;
            }
            None => notes.push("the positions do not tell one camera".to_owned()),
        }
    }
    planar(frame, renderer.depth, camera.as_ref(), notes);
    if frame.depth.is_none()
        && let Some(position) = &position
    {
        // Camera space gives depth directly; world space through the camera.
        let depth_of = |p: [f32; 3]| match renderer.position {
            Space::World => camera.as_ref().map_or(f32::NAN, |c| c.depth(p)),
            Space::Camera => -p[2],
            Space::CameraForward => p[2],
        };
        let values = position.data().par_iter().map(|p| {
            let depth = if *p == [0.0; 3] { f32::INFINITY } else { depth_of(*p) };
            if depth > 0.0 { depth } else { f32::INFINITY }
        });
        let values: Vec<f32> = values.collect();
        if values.iter().any(|v| v.is_finite()) {
            frame.depth = Plane::from_vec(canvas.size, values).ok();
        }
    }
    frame.position = position.filter(|_| renderer.position == Space::World);
    let normal = |role, space, unsigned| -> Result<_, Error> {
        let Some(pass) = mapping.get(role) else { return Ok(None) };
        let mut plane = gather(images, &pass.channels, canvas, [0.0; 3])?;
        to_world(&mut plane, space, unsigned, camera.as_ref());
        Ok(Some(plane))
    };
    frame.normal = normal(Role::Normal, renderer.normal, adapter.guides.normal_unsigned)?;
    frame.seen_normal = normal(Role::SeenNormal, renderer.seen_normal, adapter.guides.seen_unsigned)?;
    let own = [Role::Albedo, Role::MatteColour].iter().any(|role| mapping.get(*role).is_some());
    frame.albedo = match mapping.get(Role::SeenAlbedo) {
        // What mirrors show is no colour of the surface.
        Some(_) if !own => None,
        _ => surface_colour(mapping, canvas, images)?,
    };
    if let Some(albedo) = &mut frame.albedo {
        let known = |v: f32| if v.is_finite() { v.max(0.0) } else { 0.0 };
        albedo.data_mut().par_iter_mut().for_each(|value| *value = value.map(known));
    }
    let seen = mapping.get(Role::SeenAlbedo);
    frame.seen_albedo = seen.map(|p| gather(images, &p.channels, canvas, [0.0; 3])).transpose()?;
    let one = |pass: &Mapped, outside| pass.channels.first().map(|id| single(images, *id, canvas, outside)).transpose();
    if let Some(pass) = mapping.get(Role::Roughness) {
        frame.roughness = one(pass, 1.0)?;
    }
    let alpha = mapping.get(Role::Beauty).and_then(|pass| pass.alpha);
    let alpha = alpha.or_else(|| mapping.get(Role::Alpha).and_then(|pass| pass.channels.first().copied()));
    frame.alpha = alpha.map(|id| single(images, id, canvas, 0.0)).transpose()?;
    frame.variance = variance(mapping, canvas, images)?;
    Ok(camera)
}

fn depth(mapping: &Mapping, canvas: Window, images: &[ExrImage]) -> Result<Option<Plane<f32>>, Error> {
    let Some((pass, id)) = mapping.get(Role::Depth).and_then(|pass| Some((pass, *pass.channels.first()?))) else {
        return Ok(None);
    };
    let half = images
        .get(id.file)
        .and_then(|image| image.samples(id.part, id.channel))
        .is_some_and(|samples| samples.kind() == crate::image::SampleKind::Half);
    let far = if half { FAR_HALF } else { FAR };
    let inverse = mapping.renderer.depth == DepthKind::Inverse && pass.why != "asked for";
    let mut plane = single(images, id, canvas, if inverse { 0.0 } else { f32::INFINITY })?;
    plane.data_mut().par_iter_mut().for_each(|value| {
        let depth = if inverse { 1.0 / *value } else { *value };
        // Renderers write 0, a number beyond all scenes, or an infinity where there is no surface.
        *value = if depth > 0.0 && depth < far { depth } else { f32::INFINITY };
    });
    Ok(Some(plane))
}

/// What kind of depth a file holds, measured where world positions give a camera: the kind that explains the depths,
/// at least twice as well as the next; `None` where nothing decides.
pub(crate) fn depth_kind(mapping: &Mapping, canvas: Window, images: &[ExrImage]) -> Result<Option<DepthKind>, Error> {
    let (Some(position), Some(depth)) = (mapping.get(Role::Position), mapping.get(Role::Depth)) else {
        return Ok(None);
    };
    let (Space::World, Some(id)) = (mapping.renderer.position, depth.channels.first()) else { return Ok(None) };
    let position = gather(images, &position.channels, canvas, [0.0; 3])?;
    let depth = single(images, *id, canvas, 0.0)?;
    let surface = |i: usize| {
        let here = position.data().get(i).is_some_and(|p| *p != [0.0; 3]);
        here && depth.data().get(i).is_some_and(|d| *d > 0.0 && *d < FAR_HALF)
    };
    let camera = from_header(images, canvas).or_else(|| PixelCamera::solve(&position, surface));
    let Some(camera) = camera.filter(|c| c.residual(&position, surface).is_some_and(|px| px <= CAMERA_FITS_PX)) else {
        return Ok(None);
    };
    let width = canvas.size.width;
    let mut errors: [Vec<f32>; 3] = Default::default();
    for i in (0..canvas.size.pixels()).step_by((canvas.size.pixels() / 4000).max(1)).filter(|i| surface(*i)) {
        let (found, planar) = (depth.data()[i], camera.depth(position.data()[i]));
        let ray = planar * length(camera.direction((i % width) as f32 + 0.5, (i / width) as f32 + 0.5));
        for (errors, ratio) in errors.iter_mut().zip([found / planar, found / ray, found * planar]) {
            errors.push((ratio - 1.0).abs());
        }
    }
    let medians = errors.map(|mut errors| {
        errors.sort_by(f32::total_cmp);
        errors.get(errors.len() / 2).copied().unwrap_or(f32::INFINITY)
    });
    let mut order = [(DepthKind::Planar, medians[0]), (DepthKind::Ray, medians[1]), (DepthKind::Inverse, medians[2])];
    order.sort_by(|a, b| a.1.total_cmp(&b.1));
    Ok((order[0].1 < 0.02 && order[0].1 * 2.0 < order[1].1).then_some(order[0].0))
}

/// True where frames can be brought together: vectors, or cameras from positions or the header.
pub(crate) fn has_cameras(mapping: &Mapping, canvas: Window, images: &[ExrImage]) -> bool {
    let positions = mapping.get(Role::Position).is_some() && mapping.renderer.position == Space::World;
    positions || (mapping.get(Role::Depth).is_some() && from_header(images, canvas).is_some())
}

/// Distance along the ray to distance along the axis.
fn planar(frame: &mut SequenceFrame, kind: DepthKind, camera: Option<&PixelCamera>, notes: &mut Vec<String>) {
    let (DepthKind::Ray, Some(depth)) = (kind, &mut frame.depth) else { return };
    let Some(camera) = camera else {
        notes.push("depth is the distance along the ray; without a camera it is used as it is".to_owned());
        return;
    };
    let width = frame.size.width;
    depth.data_mut().par_iter_mut().enumerate().for_each(|(i, depth)| {
        let ray = camera.direction((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
        *depth /= length(ray).max(1e-6);
    });
}

/// Normals to -1..1, to world space where a camera is known, to the viewer's side.
fn to_world(plane: &mut Plane<[f32; 3]>, space: Space, unsigned: bool, camera: Option<&PixelCamera>) {
    let width = plane.size().width;
    plane.data_mut().par_iter_mut().enumerate().for_each(|(i, normal)| {
        if *normal == [0.0; 3] {
            return;
        }
        if unsigned {
            *normal = normal.map(|v| 2.0 * v - 1.0);
        }
        if !normal.iter().all(|v| v.is_finite()) {
            *normal = [0.0; 3];
            return;
        }
        if space == Space::Camera {
            normal[2] = -normal[2];
        }
        let Some(camera) = camera else {
            return;
        };
        if space != Space::World {
            *normal = camera.world_from_camera(*normal);
        }
        let ray = camera.direction((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
        let along: f32 = (0..3).map(|c| normal[c] * ray[c]).sum();
        // Shading normals may lean away from the viewer a little at silhouettes; those that face away are turned.
        if along > 0.3 * length(*normal) * length(ray) {
            *normal = normal.map(|v| -v);
        }
    });
}

fn variance(mapping: &Mapping, canvas: Window, images: &[ExrImage]) -> Result<Option<Plane<f32>>, Error> {
    if let Some(pass) = mapping.get(Role::Variance) {
        let plane = gather(images, &pass.channels, canvas, [0.0; 3])?;
        let values = plane.data().par_iter().map(|v| {
            // Channels of a path vary together, so deviations add.
            let deviation = quell::luminance(v.map(|c| c.max(0.0).sqrt()));
            deviation * deviation
        });
        return Ok(Plane::from_vec(canvas.size, values.collect()).ok());
    }
    let (Some(a), Some(b)) = (mapping.get(Role::HalfA), mapping.get(Role::HalfB)) else { return Ok(None) };
    let [a, b] = [a, b].map(|p| gather(images, &p.channels, canvas, [0.0; 3]));
    let (a, b) = (a?, b?);
    let difference: Vec<f32> = a
        .data()
        .par_iter()
        .zip(b.data().par_iter())
        .map(|(a, b)| {
            let d = quell::luminance(std::array::from_fn(|c| a[c] - b[c]));
            // Each half has twice the variance of the mean; their difference four times.
            d * d * 0.25
        })
        .collect();
    // One sample of a variance says little: the mean over 5x5 pixels.
    let Size { width, height } = canvas.size;
    let mean = (0..width * height).into_par_iter().map(|i| {
        let (x, y) = (i % width, i / width);
        let (mut sum, mut count) = (0.0, 0.0);
        for v in y.saturating_sub(2)..(y + 3).min(height) {
            for u in x.saturating_sub(2)..(x + 3).min(width) {
                sum += difference[v * width + u];
                count += 1.0;
            }
        }
        sum / count
    });
    Ok(Plane::from_vec(canvas.size, mean.collect()).ok())
}

/// A camera from header matrices: quell's own, or the standard `worldToNDC`.
fn from_header(images: &[ExrImage], canvas: Window) -> Option<PixelCamera> {
    for name in ["quell.clip_from_world", "worldToNDC"] {
        for image in images {
            for part in image.parts() {
                for (found, value) in part.attributes() {
                    if let (true, AttributeValue::Matrix4x4(m)) = (found == name, value) {
                        let display = image.display_window();
                        let camera = PixelCamera::from_clip(&m, display.size)?;
                        let shift = |a: i32, b: i32| f64::from(a) - f64::from(b);
                        return Some(camera.shifted(shift(display.x, canvas.x), shift(display.y, canvas.y)));
                    }
                }
            }
        }
    }
    None
}

fn length(v: [f32; 3]) -> f32 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}
