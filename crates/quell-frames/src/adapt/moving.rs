//! Motion in pixels: from the file's vectors, or from two cameras.

use super::camera::PixelCamera;
use super::guides::fill;
use super::noise::Trace;
use super::planes::gather;
use super::{Adapter, Error, MotionPlanes};
use crate::image::ExrImage;
use crate::motion::{Direction, MotionConvention};
use crate::roles::Role;
use quell::Plane;
use quell::sequence::SequenceFrame;
use rayon::prelude::*;

/// The vectors of a frame, and what `--motion auto` compares.
pub(super) fn for_motion(adapter: &Adapter, images: &[ExrImage], role: Role) -> Result<MotionPlanes, Error> {
    let mut frame = SequenceFrame::new(0, adapter.canvas.size);
    fill(adapter, &mut frame, images, &mut Vec::new())?;
    let channels = adapter.mapping.get(role).map_or(&[][..], |pass| &pass.channels);
    Ok(MotionPlanes {
        vectors: gather(images, channels, adapter.canvas, [f32::NAN; 2])?,
        position: frame.position,
        depth: frame.depth,
        normal: frame.normal,
        albedo: frame.albedo,
    })
}

/// Fills the motion of a frame.
pub(super) fn motion(
    adapter: &Adapter,
    frame: &mut SequenceFrame,
    images: &[ExrImage],
    camera: Option<&PixelCamera>,
    last: Option<&Trace>,
    notes: &mut Vec<String>,
) -> Result<(), Error> {
    let mut planes: [Option<Plane<[f32; 2]>>; 2] = [None, None];
    let display = adapter.display.size;
    let slot = |c: &MotionConvention| usize::from(c.direction == Direction::Next);
    if let Some(conventions) = adapter.vectors {
        let mapping = &adapter.mapping;
        let mut read = |channels: &[crate::roles::ChannelId], convention: &MotionConvention| -> Result<(), Error> {
            let mut plane = gather(images, channels, adapter.canvas, [f32::NAN; 2])?;
            plane.data_mut().par_iter_mut().for_each(|v| *v = convention.offset(*v, display));
            planes[slot(convention)] = Some(plane);
            Ok(())
        };
        if let Some(pass) = mapping.get(Role::Motion) {
            let pairs = pass.channels.chunks_exact(2).zip(&conventions);
            // Three numbers are a vector in space whose third is not for the picture.
            let pairs = pairs.take(if pass.channels.len() == 4 { 2 } else { 1 });
            for (channels, convention) in pairs {
                read(channels, convention)?;
            }
        }
        for (role, direction) in [(Role::MotionPrevious, Direction::Previous), (Role::MotionNext, Direction::Next)] {
            let convention = conventions.iter().find(|c| c.direction == direction);
            if let (Some(pass), Some(convention)) = (mapping.get(role), convention) {
                read(pass.channels.get(..2).unwrap_or(&pass.channels), convention)?;
            }
        }
    }
    let zero = |plane: &Plane<[f32; 2]>| plane.data().iter().all(|v| v.iter().all(|v| *v == 0.0 || !v.is_finite()));
    if planes.iter().flatten().all(zero)
        && planes.iter().any(Option::is_some)
        && last.is_some_and(|last| last.guides_changed(frame))
    {
        planes = [None, None];
        notes.push(format!(
            "frame {}: the motion vectors are zero everywhere, though the picture moves: they count as missing (Blender \
             writes such when motion blur is on)",
            frame.number
        ));
    }
    let before = last.and_then(|last| last.camera.as_ref());
    let [mut previous, mut next] = planes;
    if previous.is_none() && next.is_none() {
        previous = from_cameras(frame, camera, before);
        frame.camera_motion = previous.is_some();
    }
    let width = frame.size.width;
    let depth = frame.depth.as_ref();
    for (plane, other) in [(&mut previous, before), (&mut next, None)] {
        let Some(plane) = plane else { continue };
        plane.data_mut().par_iter_mut().enumerate().for_each(|(i, v)| {
            let background = depth.and_then(|d| d.data().get(i)).is_some_and(|d| d.is_infinite());
            if background && *v == [0.0; 2] {
                let at = [(i % width) as f32 + 0.5, (i / width) as f32 + 0.5];
                *v = match (camera, other) {
                    (Some(camera), Some(other)) => {
                        let there = other.pixel_of_direction(camera.direction(at[0], at[1]));
                        [there[0] - at[0], there[1] - at[1]]
                    }
                    _ => [f32::NAN; 2],
                };
            } else if !v.iter().all(|v| v.is_finite()) {
                *v = [f32::NAN; 2];
            }
        });
    }
    frame.motion_to_previous = previous;
    frame.motion_to_next = next;
    Ok(())
}

/// Motion of a scene that stands still, from two cameras.
fn from_cameras(
    frame: &SequenceFrame,
    camera: Option<&PixelCamera>,
    before: Option<&PixelCamera>,
) -> Option<Plane<[f32; 2]>> {
    let (camera, before) = (camera?, before?);
    let (position, depth) = (frame.position.as_ref(), frame.depth.as_ref());
    if position.is_none() && depth.is_none() {
        return None;
    }
    let width = frame.size.width;
    let values = (0..frame.size.pixels()).into_par_iter().map(|i| {
        let at = [(i % width) as f32 + 0.5, (i / width) as f32 + 0.5];
        let ray = camera.direction(at[0], at[1]);
        let far = depth.and_then(|d| d.data().get(i)).copied().unwrap_or(f32::INFINITY);
        let world = match position.and_then(|p| p.data().get(i)) {
            Some(p) if *p != [0.0; 3] && (depth.is_none() || far.is_finite()) => Some((*p, camera.pixel(*p))),
            _ if far.is_finite() => {
                let p = std::array::from_fn(|c| camera.eye[c] + ray[c] * far);
                Some((p, at))
            }
            _ => None,
        };
        // A position that is a mean over samples lies beside the pixel's centre: the difference of both projections is
        // what moves.
        let (there, here) = match world {
            Some((p, here)) => (before.pixel(p), here),
            None => (before.pixel_of_direction(ray), at),
        };
        let v = [there[0] - here[0], there[1] - here[1]];
        if v.iter().all(|v| v.is_finite()) { v } else { [f32::NAN; 2] }
    });
    Plane::from_vec(frame.size, values.collect()).ok()
}
