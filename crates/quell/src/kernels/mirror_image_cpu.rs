//! Mirror images (`mirror_image.rs`) on runs of pixels, in the reference's order of operations.

use super::math::three;
use super::mirror_image::{FARTHEST_BENT_PX, JITTERED_TURN, LEAST_BENT_DETERMINANT, SAME_NORMAL, SAME_PLANE_PX};
use super::reproject_cpu::{Expected, Footprint, LANES, Lanes, Lookup, Reflected, Screen, dot, lane};
use crate::camera::Projection;
use crate::phased::guides::{CpuGuides, field};
use crate::phased::layout::copy;
use crate::settings::{HitFilter, REFERENCE_ROWS, Settings};

/// The reflectors as the four pixels at their old places show them, where `alive`: `visible` is the lookup of
/// `footprint`. Reflectors at rest stay as they are, the others become the mean of the four.
#[inline(always)]
pub(crate) fn previous_reflectors(
    guides: &CpuGuides,
    footprint: &Footprint,
    visible: &Lookup,
    alive: &[u32; LANES],
    e: &mut Expected,
) {
    let jittered = guides.now.jitter != guides.before.jitter;
    for i in 0..LANES {
        let (mut position, mut normal) = ([0.0; 3], [0.0; 3]);
        for k in 0..4 {
            let weight = visible.weight[k][i];
            let there = lane(&footprint.position[k], i);
            for c in 0..3 {
                position[c] = if weight > 0.0 { position[c] + weight * there[c] } else { position[c] };
                normal[c] = if weight > 0.0 { normal[c] + weight * footprint.normal[k][c][i] } else { normal[c] };
            }
        }
        let mut first = [0.0; 3];
        for k in [3, 2, 1, 0] {
            let seen = visible.weight[k][i] > 0.0;
            first = three(|c| if seen { footprint.normal[k][c][i] } else { first[c] });
        }
        let scale = 1.0 / dot(normal, normal).sqrt();
        let known = (scale > 0.0) & (scale < f32::INFINITY);
        let normal = three(|c| if known { normal[c] * scale } else { 0.0 });
        let squared_distance = |n: [f32; 3]| {
            let d = three(|c| n[c] - normal[c]);
            dot(d, d)
        };
        let mut spread = 0.0;
        for k in 0..4 {
            let d = squared_distance(lane(&footprint.normal[k], i));
            let same = (footprint.depth[k][i] < f32::INFINITY) & (footprint.id[k][i] == e.id[i]);
            let counts = (visible.weight[k][i] > 0.0) | (jittered & same);
            spread = if counts & (d > spread) { d } else { spread };
        }
        let spread = spread.sqrt();
        let (turn, slack) = if jittered { (JITTERED_TURN * spread, spread) } else { (spread, 0.0) };
        let mut bent = false;
        for k in 0..4 {
            let difference = three(|c| footprint.normal[k][c][i] - first[c]);
            bent |= (visible.weight[k][i] > 0.0) & (dot(difference, difference).sqrt() > SAME_NORMAL);
        }
        e.bent[i] = u32::from(bent) & alive[i];
        let turned = squared_distance(lane(&e.normal, i)).sqrt() > turn + SAME_NORMAL;
        let offset = three(|c| e.position[c][i] - position[c]);
        let shifted = dot(offset, normal).abs() > (SAME_PLANE_PX + slack) * guides.now.view.pixel_size(e.depth[i]);
        let moved = (e.moved[i] != 0) | turned | shifted;
        e.moved[i] = u32::from(moved) & alive[i];
        for c in 0..3 {
            e.was_at[c][i] = if moved { position[c] } else { e.was_at[c][i] };
            e.was_facing[c][i] = if moved { normal[c] } else { e.was_facing[c][i] };
        }
    }
}

/// Glossy light: where the mirror images of the lanes were, into `coordinate`; `alive` goes to 0 where that is
/// unknown or off screen. `hit`: filtered hit distances. `MOVED`: lanes may have moved.
#[inline(always)]
pub(crate) fn virtual_coordinates<const MOVED: bool>(
    guides: &CpuGuides,
    settings: &Settings,
    e: &Expected,
    hit: &Lanes,
    coordinate: &mut [Lanes; 2],
    alive: &mut [u32; LANES],
) {
    let (now, previous) = (&guides.now, Screen::new(&guides.previous_view));
    let (width, height) = (guides.phases.size.width as f32, guides.phases.size.height as f32);
    let (guard, furthest) = (settings.surface.guard_band, settings.glossy_temporal.max_hit_distance);
    let v = e.y as f32 + 0.5 + now.jitter.y;
    let d = &now.view.direction;
    for i in 0..LANES {
        let u = e.x[i] + 0.5 + now.jitter.x;
        let ray = three(|c| d[0][c] + d[1][c] * u + d[2][c] * v);
        let scale = 1.0 / dot(ray, ray).sqrt();
        let ray = three(|c| ray[c] * scale);
        let limit = furthest * e.depth[i];
        let finite = hit[i] < f32::INFINITY;
        let distance = if limit < hit[i] { limit } else { hit[i] };
        let (position, normal) = (lane(&e.position, i), lane(&e.normal, i));
        // At rest: the image of a plane mirror lies behind it, on the eye ray. Else mirrored in the plane of then.
        let moved = MOVED & (e.moved[i] != 0);
        let (was_at, was_facing) = (lane(&e.was_at, i), lane(&e.was_facing, i));
        let twice = 2.0 * dot(ray, normal);
        let reflected = three(|c| ray[c] - twice * normal[c]);
        let direction = three(|c| if moved { reflected[c] } else { ray[c] });
        let point = three(|c| position[c] + direction[c] * distance);
        let from_plane = three(|c| if finite { point[c] - was_at[c] } else { direction[c] });
        let twice = 2.0 * dot(from_plane, was_facing);
        let unmirrored = three(|c| if finite { point[c] } else { direction[c] });
        let mirrored = three(|c| if moved { unmirrored[c] - twice * was_facing[c] } else { unmirrored[c] });
        let (px, py, ahead) = previous.pixel(mirrored, if finite { 1.0 } else { 0.0 });
        let (cx, cy) = (px - now.jitter.x, py - now.jitter.y);
        coordinate[0][i] = cx;
        coordinate[1][i] = cy;
        let on_screen = (cx >= guard) & (cy >= guard) & (cx <= width - guard) & (cy <= height - guard);
        alive[i] &= u32::from(ahead & on_screen);
    }
}

/// `bent_coordinate` of lanes that show a curved reflector, over what `coordinate` holds for plane ones. `footprint`
/// and `visible` are those of the surface's own place; `hit`: filtered hit distances.
#[inline(always)]
pub(crate) fn bent_coordinates(
    guides: &CpuGuides,
    settings: &Settings,
    e: &Expected,
    (footprint, visible): (&Footprint, &Lookup),
    hit: &Lanes,
    coordinate: &mut [Lanes; 2],
    alive: &mut [u32; LANES],
) {
    let (now, before) = (&guides.now, &guides.before);
    let (width, height) = (guides.phases.size.width as f32, guides.phases.size.height as f32);
    let guard = settings.surface.guard_band;
    let farthest = FARTHEST_BENT_PX * height / REFERENCE_ROWS;
    let direction = |view: &Projection, u: f32, v: f32| {
        let d = &view.direction;
        let ray = three(|c| d[0][c] + d[1][c] * u + d[2][c] * v);
        let scale = 1.0 / dot(ray, ray).sqrt();
        three(|c| ray[c] * scale)
    };
    let v = e.y as f32 + 0.5 + now.jitter.y;
    let jittered = now.jitter != before.jitter;
    // Where the reflected previous eye rays miss the hit points, at each of the four pixels.
    let mut misses = [[[0.0; LANES]; 3]; 4];
    let mut reflected = [[0.0; LANES]; 3];
    let mut hits = [[0.0; LANES]; 3];
    for i in 0..LANES {
        let ray = direction(&now.view, e.x[i] + 0.5 + now.jitter.x, v);
        let normal = lane(&e.normal, i);
        let twice = 2.0 * dot(ray, normal);
        for c in 0..3 {
            reflected[c][i] = ray[c] - twice * normal[c];
            hits[c][i] = e.position[c][i] + reflected[c][i] * hit[i];
        }
    }
    for (k, miss) in misses.iter_mut().enumerate() {
        for i in 0..LANES {
            let (u, v) = (footprint.column[k][i] + 0.5 + before.jitter.x, footprint.row[k][i] + 0.5 + before.jitter.y);
            let ray = direction(&before.view, u, v);
            let normal = lane(&footprint.normal[k], i);
            let twice = 2.0 * dot(ray, normal);
            let to_hit = three(|c| hits[c][i] - footprint.position[k][c][i]);
            let scale = 1.0 / dot(to_hit, to_hit).sqrt();
            let finite = hit[i] < f32::INFINITY;
            for c in 0..3 {
                let wanted = if finite { to_hit[c] * scale } else { reflected[c][i] };
                miss[c][i] = wanted - (ray[c] - twice * normal[c]);
            }
        }
    }
    for i in 0..LANES {
        let [f0, f1, f2, f3] = [0, 1, 2, 3].map(|k| lane(&misses[k], i));
        let middle = three(|c| 0.25 * ((f0[c] + f1[c]) + (f2[c] + f3[c])));
        let du = three(|c| 0.5 * ((f1[c] - f0[c]) + (f3[c] - f2[c])));
        let dv = three(|c| 0.5 * ((f2[c] - f0[c]) + (f3[c] - f1[c])));
        let (a, b, c) = (dot(du, du), dot(du, dv), dot(dv, dv));
        let (sx, sy) = (e.coordinate[0][i], e.coordinate[1][i]);
        let ray = direction(&before.view, sx + now.jitter.x, sy + now.jitter.y);
        let normal = lane(&e.normal, i);
        let twice = 2.0 * dot(ray, normal);
        let rests = jittered & (e.moved[i] == 0);
        let miss = three(|c| if rests { reflected[c][i] - (ray[c] - twice * normal[c]) } else { middle[c] });
        let (p, q) = (dot(du, miss), dot(dv, miss));
        let determinant = a * c - b * b;
        let from_x = if rests { sx } else { (sx - 0.5).floor() + 1.0 + before.jitter.x - now.jitter.x };
        let from_y = if rests { sy } else { (sy - 0.5).floor() + 1.0 + before.jitter.y - now.jitter.y };
        let x = from_x + (b * q - c * p) / determinant;
        let y = from_y + (b * p - a * q) / determinant;
        let (dx, dy) = (x - sx, y - sy);
        let whole = (visible.weight[0][i] > 0.0)
            & (visible.weight[1][i] > 0.0)
            & (visible.weight[2][i] > 0.0)
            & (visible.weight[3][i] > 0.0);
        let solved = (determinant > LEAST_BENT_DETERMINANT * a * c) & ((dx * dx + dy * dy).sqrt() <= farthest);
        let (x, y) = if whole & solved { (x, y) } else { (sx, sy) };
        let bent = e.bent[i] != 0;
        coordinate[0][i] = if bent { x } else { coordinate[0][i] };
        coordinate[1][i] = if bent { y } else { coordinate[1][i] };
        let on_screen = (x >= guard) & (y >= guard) & (x <= width - guard) & (y <= height - guard);
        alive[i] = if bent { u32::from((visible.trust[i] > 0.0) & on_screen) } else { alive[i] };
    }
}

/// The glossy hit distances of the lanes after the 3x3 filter over the same reflector.
#[inline(always)]
pub(crate) fn filtered_hits(
    guides: &CpuGuides,
    settings: &Settings,
    e: &Expected,
    (phase, first): (usize, usize),
    hits: &mut Lanes,
) {
    let (phases, size) = (&guides.phases, guides.phases.size);
    let filter = settings.glossy_temporal.hit_filter;
    let row = |y: usize| &guides.glossy_hit[y * size.width..][..size.width];
    let begin = phases.range(phase).start + first;
    copy::<LANES, _>(&mut hits[..e.n], &row(e.y)[begin..][..e.n]);
    let mut values = [[0.0f32; LANES]; 9];
    let mut counts = [[0u32; LANES]; 9];
    if filter == HitFilter::Off {
        return;
    }
    for k in 0..9 {
        let (dx, ty) = (k as i32 % 3 - 1, (e.y + k / 3).wrapping_sub(1));
        if ty >= size.height {
            continue;
        }
        let Some(span) = phases.shifted(phase, first, e.n, dx) else { continue };
        let n = span.len;
        let source = &row(ty)[span.source..][..n];
        let depth = &field(&guides.now.depth, size.width, 1, ty, 0)[span.source..][..n];
        let id = &field(&guides.now.id, size.width, 1, ty, 0)[span.source..][..n];
        let ids = &e.id[span.first..][..n];
        if filter == HitFilter::Min {
            let hits = &mut hits[span.first..][..n];
            for i in 0..n {
                let counts = (depth[i] < f32::INFINITY) & (id[i] == ids[i]) & (source[i] < hits[i]);
                hits[i] = if counts { source[i] } else { hits[i] };
            }
        } else {
            values[k][span.first..][..n].copy_from_slice(source);
            let counts = &mut counts[k][span.first..][..n];
            for i in 0..n {
                counts[i] = u32::from((depth[i] < f32::INFINITY) & (id[i] == ids[i]));
            }
        }
    }
    if filter == HitFilter::Median {
        for i in 0..e.n {
            let mut around = [0.0; 9];
            let mut count = 0;
            for k in 0..9 {
                if counts[k][i] != 0 {
                    around[count] = values[k][i];
                    count += 1;
                }
            }
            around[..count].sort_unstable_by(f32::total_cmp);
            hits[i] = around[..count].get(count / 2).copied().unwrap_or(hits[i]);
        }
    }
    let mirror_roughness = settings.glossy_temporal.mirror_roughness;
    if mirror_roughness > 0.0 {
        let mut own = [0.0; LANES];
        copy::<LANES, _>(&mut own[..e.n], &row(e.y)[begin..][..e.n]);
        for i in 0..LANES {
            hits[i] = if e.roughness[i] < mirror_roughness { own[i] } else { hits[i] };
        }
    }
}

/// What the lanes reflect. `hit`: filtered hit distances.
#[inline(always)]
pub(crate) fn reflected_points(
    guides: &CpuGuides,
    settings: &Settings,
    e: &Expected,
    hit: &Lanes,
    reflected: &mut Reflected,
) {
    let mirror_roughness = settings.glossy_temporal.mirror_roughness;
    if mirror_roughness <= 0.0 {
        reflected.any = false;
        return;
    }
    let mut any = 0;
    for i in 0..LANES {
        reflected.mirror[i] = u32::from((e.depth[i] < f32::INFINITY) & (e.roughness[i] < mirror_roughness));
        any |= reflected.mirror[i];
    }
    reflected.any = any != 0;
    if !reflected.any {
        return;
    }
    reflected.distance = *hit;
    let (d, jitter) = (&guides.now.view.direction, guides.now.jitter);
    let v = e.y as f32 + 0.5 + jitter.y;
    for i in 0..LANES {
        let u = e.x[i] + 0.5 + jitter.x;
        let ray = three(|c| d[0][c] + d[1][c] * u + d[2][c] * v);
        let scale = 1.0 / dot(ray, ray).sqrt();
        let ray = three(|c| ray[c] * scale);
        let normal = lane(&e.normal, i);
        let twice = 2.0 * dot(ray, normal);
        for c in 0..3 {
            reflected.point[c][i] = e.position[c][i] + (ray[c] - twice * normal[c]) * hit[i];
        }
    }
}
