//! `KHR_lights_punctual`. Intensities are taken as radiometric numbers in the unit of radiance.

use super::error::{Fault, Place, item};
use super::nodes::{Pose, Rig};
use super::report::Warnings;
use super::schema::{Light, Root};
use crate::scene::PointlikeLight;
use crate::track::Track;
use glam::{DAffine3, DVec3, Vec3};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};
use std::sync::Arc;

/// What a light is wherever it stands.
#[derive(Clone, Copy)]
enum Kind {
    Point,
    Spot { inner: f32, outer: f32 },
    Directional,
}

/// The light at a node; `None`, with a warning, where it does not shine.
pub(super) fn read(
    root: &Root,
    rig: &Arc<Rig>,
    rest: &Pose,
    node: usize,
    light: usize,
    warnings: &mut Warnings,
) -> Result<Option<Track<PointlikeLight>>, Fault> {
    let lights = root.extensions.lights.as_ref().map_or(&[] as &[Light], |l| &l.lights);
    let (nodes, list) = (Place::root("nodes"), Place::root("extensions.KHR_lights_punctual.lights"));
    let from = nodes.item(node);
    let data = item(lights, light, "light", &from.field("extensions.KHR_lights_punctual.light"))?;
    let place = list.item(light);
    let power = Vec3::from(data.color.unwrap_or([1.0; 3])) * data.intensity.unwrap_or(1.0);
    if !(power.is_finite() && power.min_element() >= 0.0) {
        warnings.push(&place, "colour and intensity must be finite and not negative: the light is left out");
        return Ok(None);
    }
    if power == Vec3::ZERO {
        warnings.push(&place, "is black: the light is left out");
        return Ok(None);
    }
    if data.range.is_some() {
        warnings.ignore(&place.field("range"), "not used: light falls with the square of the distance and never ends");
    }
    let kind = match data.kind.as_str() {
        "point" => Kind::Point,
        "directional" => Kind::Directional,
        "spot" => {
            let outer = data.spot.outer_cone_angle.unwrap_or(FRAC_PI_4);
            let inner = data.spot.inner_cone_angle.unwrap_or(0.0);
            if !(outer > 0.0 && outer <= FRAC_PI_2 && inner >= 0.0 && inner <= outer) {
                warnings.push(&place.field("spot"), "needs 0 <= inner <= outer <= pi / 2: the light is left out");
                return Ok(None);
            }
            Kind::Spot { inner, outer }
        }
        _ => {
            warnings.push(&place.field("type"), "is unknown: the light is left out");
            return Ok(None);
        }
    };
    Ok(Some(if rig.moves(node) {
        let rig = Arc::clone(rig);
        Track::function(move |frame| placed(kind, power, rig.pose(frame).world(node)))
    } else {
        placed(kind, power, rest.world(node)).into()
    }))
}

/// Lights shine along -z of their node; its scale does not count.
fn placed(kind: Kind, power: Vec3, world: DAffine3) -> PointlikeLight {
    let position = world.translation.as_vec3();
    let direction = (-world.matrix3.z_axis).normalize_or(DVec3::NEG_Z).as_vec3();
    match kind {
        Kind::Point => PointlikeLight::Point { position, intensity: power },
        Kind::Spot { inner, outer } => PointlikeLight::Spot { position, direction, intensity: power, inner, outer },
        Kind::Directional => PointlikeLight::Directional { direction, irradiance: power },
    }
}
