//! The specification of stage 8.

use crate::border::Guides;
use crate::frame::Rgb;
use crate::kernels::mirror_image::{
    Reflected, bent_coordinate, filtered_hit, previous_reflector, reflector_lookup, virtual_coordinate,
};
use crate::kernels::reproject::{Lookup, expected_surface, surface_lookup};
use crate::kernels::temporal::Blend;
use crate::plane::Plane;
use crate::settings::Settings;
use crate::stages::matte_temporal::reference::{Remembered, Temporal, accumulate};

/// Runs stage 8 on the whole image; `current`: the signal, then its passes.
pub fn run(current: &[Plane<Rgb>], history: Option<Remembered<'_>>, now: &Guides, settings: &Settings) -> Temporal {
    let glossy = &settings.glossy_temporal;
    let weights = Blend::glossy(settings);
    accumulate(current, history, now, &weights, |before, x, y| {
        let Some(expected) = expected_surface(now, before, &settings.surface, x, y) else {
            return Lookup::default();
        };
        let visible = surface_lookup(now, before, &settings.surface, &expected, x, y);
        if !(glossy.virtual_reprojection && now.has_glossy_hit) || visible.trust <= 0.0 {
            return visible;
        }
        let expected = previous_reflector(now, before, &expected, &visible, x, y);
        let hit = filtered_hit(now, glossy, x, y);
        let bent = if glossy.curvature { bent_coordinate(now, before, &expected, &visible, hit, x, y) } else { None };
        let Some(coordinate) = bent.or_else(|| virtual_coordinate(now, glossy, &expected, hit, x, y)) else {
            return Lookup::default();
        };
        let mut reflected =
            reflector_lookup(now, before, settings, &expected, coordinate, &Reflected::new(now, hit, x, y), x, y);
        reflected.trust *= visible.trust;
        reflected
    })
}
