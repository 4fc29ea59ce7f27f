//! Stage 8 on runs of pixels: where the mirror image was, among what still shows the same reflector.

use crate::cpu::guides::CpuGuides;
use crate::kernels::reproject_cpu::{
    Expected, Footprint, LANES, Lookup, filtered_hits, previous_reflectors, virtual_coordinates,
};
use crate::settings::Settings;

/// From the lookup at the surface's place to that at the mirror image's.
#[inline(always)]
pub(crate) fn reflect(
    guides: &CpuGuides,
    settings: &Settings,
    expected: &mut Expected,
    run: (usize, usize),
    footprint: &mut Footprint,
    lookup: &mut Lookup,
) {
    let visible = lookup.trust;
    let mut alive = [0; LANES];
    for i in 0..LANES {
        alive[i] = u32::from(visible[i] > 0.0);
    }
    previous_reflectors(guides, footprint, lookup, &alive, expected);
    let mut hit = [0.0; LANES];
    filtered_hits(guides, settings.glossy_temporal.hit_filter, expected, run, &mut hit);
    let mut coordinate = [[0.0; LANES]; 2];
    virtual_coordinates(guides, settings, expected, &hit, &mut coordinate, &mut alive);
    footprint.collect(guides, &coordinate, &alive, true);
    footprint.look_up(guides, settings, expected, true, lookup);
    for i in 0..LANES {
        lookup.trust[i] *= visible[i];
    }
}
