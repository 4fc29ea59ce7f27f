//! Stage 8 on runs of pixels: where the mirror image was, among what still shows the same reflector.

use crate::kernels::mirror_image_cpu::{
    bent_coordinates, filtered_hits, previous_reflectors, reflected_points, virtual_coordinates,
};
use crate::kernels::reproject_cpu::{Expected, Footprint, LANES, Lanes, Lookup, Reflected};
use crate::phased::guides::CpuGuides;
use crate::settings::Settings;

/// Trust in the lookup at the surface's place, negative where the reflector moved or is curved; `expected` becomes the
/// reflector of then.
#[inline(always)]
pub(crate) fn visible(
    guides: &CpuGuides,
    settings: &Settings,
    (footprint, lookup): (&Footprint, &Lookup),
    expected: &mut Expected,
    out: &mut Lanes,
) {
    let mut alive = [0; LANES];
    for i in 0..LANES {
        alive[i] = u32::from(lookup.trust[i] > 0.0);
    }
    previous_reflectors(guides, footprint, lookup, &alive, expected);
    if !settings.glossy_temporal.curvature {
        expected.bent = [0; LANES];
    }
    for i in 0..LANES {
        let plain = (expected.moved[i] | expected.bent[i]) == 0;
        out[i] = if plain { lookup.trust[i] } else { -lookup.trust[i] };
    }
}

/// The lookup at the mirror image's place. `visible`: as the function of that name returns it; `MOVED`: some are negative,
/// and `footprint` and `lookup` come in as those of the surface's own place.
#[inline(always)]
pub(crate) fn reflect<const MOVED: bool>(
    guides: &CpuGuides,
    settings: &Settings,
    (expected, visible): (&Expected, &Lanes),
    run: (usize, usize),
    footprint: &mut Footprint,
    lookup: &mut Lookup,
) {
    let mut alive = [0; LANES];
    for i in 0..LANES {
        alive[i] = u32::from(visible[i].abs() > 0.0);
    }
    let mut hit = [0.0; LANES];
    filtered_hits(guides, settings, expected, run, &mut hit);
    let mut coordinate = [[0.0; LANES]; 2];
    virtual_coordinates::<MOVED>(guides, settings, expected, &hit, &mut coordinate, &mut alive);
    if MOVED && expected.bent.iter().any(|bent| *bent != 0) {
        let there = (&*footprint, &*lookup);
        bent_coordinates(guides, settings, expected, there, &hit, &mut coordinate, &mut alive);
    }
    footprint.collect(guides, &coordinate, &alive, true);
    let mut reflected = Reflected::new();
    reflected_points(guides, settings, expected, &hit, &mut reflected);
    footprint.look_up(guides, settings, expected, Some(&reflected), lookup);
    for i in 0..LANES {
        lookup.trust[i] *= visible[i].abs();
    }
}
