//! Cameras at nodes, and one that frames a scene without any.

use super::error::{Fault, Place, item};
use super::nodes::{Pose, Rig};
use super::report::{CameraInfo, Warnings};
use super::schema::Root;
use crate::scene::CameraPath;
use crate::track::Track;
use glam::{DAffine3, DVec3, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

/// Vertical angle of the camera that frames a scene.
const FRAMING_FOV: f32 = 0.7;
/// From where it looks: right, above, in front.
const FRAMING_FROM: Vec3 = Vec3::new(0.5, 0.35, 1.0);

/// Eye, a point on the axis, and upwards.
#[derive(Clone, Copy)]
struct View {
    eye: Vec3,
    target: Vec3,
    up: Vec3,
}

/// Cameras look along -z of their node, y upwards; its scale does not count.
fn view(world: DAffine3) -> View {
    let eye = world.translation;
    // By cross products: a node may be sheared by the scales above it.
    let back = world.matrix3.z_axis.normalize_or(DVec3::Z);
    let right = world.matrix3.y_axis.cross(back).normalize_or(back.any_orthonormal_vector());
    // Far enough that single precision keeps the direction wherever the eye is.
    let target = eye - back * (1.0 + eye.length());
    View { eye: eye.as_vec3(), target: target.as_vec3(), up: back.cross(right).as_vec3() }
}

/// The camera at a node; `None`, with a warning, where it cannot be used.
pub(super) fn read(
    root: &Root,
    rig: &Arc<Rig>,
    rest: &Pose,
    node: usize,
    camera: usize,
    warnings: &mut Warnings,
) -> Result<Option<(CameraPath, CameraInfo)>, Fault> {
    let (nodes, cameras) = (Place::root("nodes"), Place::root("cameras"));
    let from = nodes.item(node);
    let data = item(&root.cameras, camera, "camera", &from.field("camera"))?;
    let place = cameras.item(camera);
    let (fov, height, aspect) = match (&data.perspective, &data.orthographic) {
        (Some(lens), _) if data.kind != "orthographic" => (lens.yfov, None, lens.aspect_ratio),
        (_, Some(lens)) if data.kind == "orthographic" => (0.0, Some(2.0 * lens.ymag), Some(lens.xmag / lens.ymag)),
        _ => {
            warnings.push(&place, "has no lens that fits its type: the camera is left out");
            return Ok(None);
        }
    };
    let usable = match height {
        None => fov > 0.0 && fov < PI,
        Some(height) => height > 0.0 && height.is_finite(),
    };
    if !usable {
        warnings.push(&place, "its angle or height is out of range: the camera is left out");
        return Ok(None);
    }
    let moves = rig.moves(node);
    let path = if moves {
        let track = |pick: fn(View) -> Vec3| {
            let rig = Arc::clone(rig);
            Track::function(move |frame| pick(view(rig.pose(frame).world(node))))
        };
        CameraPath {
            name: String::new(),
            position: track(|v| v.eye),
            target: track(|v| v.target),
            up: track(|v| v.up),
            vertical_fov: fov.into(),
            orthographic_height: height,
        }
    } else {
        let View { eye, target, up } = view(rest.world(node));
        CameraPath {
            name: String::new(),
            position: eye.into(),
            target: target.into(),
            up: up.into(),
            vertical_fov: fov.into(),
            orthographic_height: height,
        }
    };
    let names = [root.nodes.get(node).and_then(|n| n.name.clone()), data.name.clone()];
    let mut names = names.into_iter().flatten().filter(|n| !n.is_empty());
    let name = names.next().unwrap_or_else(|| format!("camera {camera}"));
    let other_name = names.next().filter(|other| *other != name);
    let aspect = aspect.filter(|a| a.is_finite() && *a > 0.0);
    let info = CameraInfo { name: name.clone(), other_name, perspective: height.is_none(), aspect, moves };
    Ok(Some((CameraPath { name, ..path }, info)))
}

/// A camera that sees a whole box from outside.
pub(super) fn framing(low: Vec3, high: Vec3) -> CameraPath {
    let centre = (low + high) * 0.5;
    let radius = ((high - low).length() * 0.5).max(1e-3);
    let distance = radius / (FRAMING_FOV * 0.5).sin();
    let eye = centre + FRAMING_FROM.normalize_or(Vec3::Z) * distance;
    CameraPath { name: "framing".to_owned(), ..CameraPath::fixed(eye, centre, FRAMING_FOV.to_degrees()) }
}
