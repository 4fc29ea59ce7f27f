//! The cross-bilateral weight (`edge.rs`) on runs of pixels, in the form that costs least there.
//!
//! Rays are affine in the pixel, so a tap that lies (dx, dy) pixels away has the offset dX = D s + v_p (z_q - z_p),
//! D the change of ray over (dx, dy), the same for all pixels, v_p the centre's ray direction, s = z_q (perspective) or
//! 1 (orthographic). With a = n_p.v_p and k = n_p.D: dX.n_p = k s + a (z_q - z_p), and the distance in depth to p's
//! tangent plane is dX.n_p / (n_p.v_q). No world position is needed, and nothing cancels.

use super::edge::{COINCIDENT_PX, GLOSS_SCALE, closeness, contact_stop};
use super::math::three;
use crate::camera::Projection;
use crate::settings::Edge;
use glam::Vec3;

/// Pixels whose weights are computed together.
pub(crate) const RUN: usize = 320;

/// Cuts a row of `count` pixels into runs of about equal length, whole vectors where possible.
#[inline(always)]
pub(crate) fn run_length(count: usize) -> usize {
    const VECTOR: usize = 16;
    let runs = count.div_ceil(RUN).max(1);
    count.div_ceil(runs).next_multiple_of(VECTOR).clamp(1, RUN)
}

/// One value for each pixel of a run.
pub(crate) type Run = [f32; RUN];

/// The gains of the weight for one lobe.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gains {
    depth: f32,
    normal: f32,
    /// Twice Kp.
    plane: f32,
    /// Ten times Kg.
    gloss: f32,
    /// 1 / a^2 of the contact stop; 0: no such stop.
    contact: f32,
}

impl Gains {
    /// For stages 4 and 7.
    pub fn matte(edge: &Edge) -> Self {
        Self {
            depth: edge.depth,
            normal: edge.normal,
            plane: 2.0 * edge.plane,
            gloss: GLOSS_SCALE * edge.matte_gloss,
            contact: if edge.contact > 0.0 { 1.0 / (edge.contact * edge.contact) } else { 0.0 },
        }
    }

    /// For stages 9 and 10.
    pub fn glossy(edge: &Edge) -> Self {
        Self { gloss: GLOSS_SCALE * edge.glossy_gloss, contact: 0.0, ..Self::matte(edge) }
    }

    /// Roughness takes part.
    pub fn reads_roughness(&self) -> bool {
        self.gloss != 0.0
    }

    /// There is a contact stop.
    pub fn stops_at_contacts(&self) -> bool {
        self.contact > 0.0
    }
}

/// Guides of a run of pixels, as slices of equal length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GuideRun<'a> {
    pub depth: &'a [f32],
    pub normal: [&'a [f32]; 3],
    pub roughness: &'a [f32],
    pub id: &'a [u32],
}

/// What the weights need of the centre pixels.
#[derive(Debug)]
#[repr(align(64))] // vectors that straddle cache lines cost twice
pub(crate) struct Centres {
    depth: Run,
    /// Kz / z_p.
    depth_gain: Run,
    normal: [Run; 3],
    /// v_p: displacement of one unit of view depth.
    ray: [Run; 3],
    /// a = n_p.v_p.
    facing: Run,
    /// n_p . change of ray for one pixel to the right, and down.
    along: [Run; 2],
    /// Squared distance under which a tap has no direction.
    coincident: Run,
    roughness: Run,
    id: [u32; RUN],
    /// K of the contact stop, of meaning where weights hold it.
    pub nearest: Run,
}

impl Centres {
    pub fn new() -> Self {
        Self {
            depth: [1.0; RUN],
            depth_gain: [1.0; RUN],
            normal: [[0.0; RUN]; 3],
            ray: [[0.0; RUN]; 3],
            facing: [0.0; RUN],
            along: [[0.0; RUN]; 2],
            coincident: [0.0; RUN],
            roughness: [0.0; RUN],
            id: [0; RUN],
            nearest: [0.0; RUN],
        }
    }

    /// Fills in the run whose pixel i was sampled at (u + 4 i, v).
    #[inline(always)]
    pub fn fill(&mut self, view: &Projection, gains: &Gains, guides: &GuideRun<'_>, u: f32, v: f32) {
        let n = guides.depth.len();
        let step = change_of_ray(view);
        let row = view.direction[0] + view.direction[2] * v;
        let across = view.direction[1];
        let pixel_size = view.pixel_size(1.0);
        self.depth[..n].copy_from_slice(guides.depth);
        self.roughness[..n].copy_from_slice(guides.roughness);
        self.id[..n].copy_from_slice(guides.id);
        for c in 0..3 {
            self.normal[c][..n].copy_from_slice(guides.normal[c]);
        }
        for i in 0..n.next_multiple_of(16).min(RUN) {
            let column = u + (4 * i) as f32;
            let ray = [row.x + across.x * column, row.y + across.y * column, row.z + across.z * column];
            let normal = [self.normal[0][i], self.normal[1][i], self.normal[2][i]];
            for c in 0..3 {
                self.ray[c][i] = ray[c];
            }
            self.facing[i] = dot(normal, ray);
            for axis in 0..2 {
                self.along[axis][i] = dot(normal, step[axis].to_array());
            }
            let scale = if view.perspective { self.depth[i] } else { 1.0 };
            let coincident = COINCIDENT_PX * pixel_size * scale;
            self.coincident[i] = coincident * coincident;
            self.depth_gain[i] = gains.depth / self.depth[i];
        }
    }
}

/// A tap of all pixels of a run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tap {
    /// Pixels to the right.
    pub dx: f32,
    /// Pixels down.
    pub dy: f32,
    /// D: change of ray over (dx, dy).
    pub delta: [f32; 3],
}

impl Tap {
    pub fn new(view: &Projection, dx: i32, dy: i32) -> Self {
        let step = change_of_ray(view);
        let (dx, dy) = (dx as f32, dy as f32);
        Self { dx, dy, delta: (step[0] * dx + step[1] * dy).to_array() }
    }
}

/// What one pixel to the right, and one down, changes: the direction of a perspective camera's ray, the origin of an
/// orthographic one's.
#[inline(always)]
fn change_of_ray(view: &Projection) -> [Vec3; 2] {
    if view.perspective { [view.direction[1], view.direction[2]] } else { [view.origin[1], view.origin[2]] }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// One instruction on every machine; a NaN in `a` gives 0.
#[inline(always)]
fn at_least_0(a: f32) -> f32 {
    if a > 0.0 { a } else { 0.0 }
}

/// 1 / sqrt(x) to 5e-6, x > 0: two steps of Newton from the well-known guess. The machine's own square root and
/// division would take most of the time of a weight, and its fast approximation differs from maker to maker.
#[inline(always)]
fn inverse_root(x: f32) -> f32 {
    const GUESS: u32 = 0x5f37_5a86; // Lomont, "Fast inverse square root", 2003
    let half = 0.5 * x;
    let y = f32::from_bits(GUESS.wrapping_sub(x.to_bits() >> 1));
    let y = y * (1.5 - half * y * y);
    y * (1.5 - half * y * y)
}

/// Edge weights, 0..1, of the taps `q` for the centres from lane `first` on; `out` is as long as `q`. `CONTACT`: times the contact stop
/// of stages 4 and 7.
#[inline(always)]
pub(crate) fn weights<const PERSPECTIVE: bool, const GLOSS: bool, const CONTACT: bool>(
    centres: &Centres,
    first: usize,
    q: &GuideRun<'_>,
    tap: &Tap,
    gains: &Gains,
    out: &mut [f32],
) {
    let n = out.len();
    // Slices of one known length: no bounds check is left in the loop, which is what lets it become vectors.
    #[inline(always)]
    fn lanes<T>(run: &[T; RUN], first: usize, n: usize) -> &[T] {
        &run[first..][..n]
    }
    let (p_depth, p_depth_gain) = (lanes(&centres.depth, first, n), lanes(&centres.depth_gain, first, n));
    let [p_nx, p_ny, p_nz] = three(|c| lanes(&centres.normal[c], first, n));
    let [p_rx, p_ry, p_rz] = three(|c| lanes(&centres.ray[c], first, n));
    let p_facing = lanes(&centres.facing, first, n);
    let (p_ax, p_ay) = (lanes(&centres.along[0], first, n), lanes(&centres.along[1], first, n));
    let (p_coincident, p_id) = (lanes(&centres.coincident, first, n), lanes(&centres.id, first, n));
    let (p_roughness, p_nearest) = (lanes(&centres.roughness, first, n), lanes(&centres.nearest, first, n));
    let (q_depth, q_id, q_roughness) = (&q.depth[..n], &q.id[..n], &q.roughness[..n]);
    let [q_nx, q_ny, q_nz] = [&q.normal[0][..n], &q.normal[1][..n], &q.normal[2][..n]];
    let (dx, dy, delta) = (tap.dx, tap.dy, tap.delta);
    for i in 0..n {
        let z = q_depth[i];
        let rise = z - p_depth[i];
        let scale = if PERSPECTIVE { z } else { 1.0 };
        let k = p_ax[i] * dx + p_ay[i] * dy;
        let out_of_p = k * scale + p_facing[i] * rise;
        let q_facing = if PERSPECTIVE { p_facing[i] + k } else { p_facing[i] };
        let beyond = out_of_p / q_facing;
        let w_depth = at_least_0(1.0 - beyond.abs() * p_depth_gain[i]);
        let w_depth = if z - beyond > 0.0 { w_depth } else { 0.0 };

        let cosine = at_least_0(p_nx[i] * q_nx[i] + p_ny[i] * q_ny[i] + p_nz[i] * q_nz[i]);
        let squared = cosine * cosine;
        let w_normal = at_least_0(1.0 - gains.normal * (1.0 - squared * squared));

        let ox = delta[0] * scale + p_rx[i] * rise;
        let oy = delta[1] * scale + p_ry[i] * rise;
        let oz = delta[2] * scale + p_rz[i] * rise;
        let out_of_q = (ox * q_nx[i] + oy * q_ny[i] + oz * q_nz[i]).abs();
        let out_of_p = out_of_p.abs();
        let out_of_plane = if out_of_p > out_of_q { out_of_p } else { out_of_q };
        let squared = ox * ox + oy * oy + oz * oz;
        let w = at_least_0(1.0 - gains.plane * out_of_plane * inverse_root(squared));
        let w_plane = if squared < p_coincident[i] { 1.0 } else { w * w };

        let mut weight = w_depth * w_normal * w_plane;
        if GLOSS {
            weight *= at_least_0(1.0 - gains.gloss * (q_roughness[i] - p_roughness[i]).abs());
        }
        if CONTACT {
            weight *= contact_stop(squared, p_nearest[i], gains.contact);
        }
        // Background has an infinite depth.
        let same = (q_id[i] == p_id[i]) & (z < f32::INFINITY);
        out[i] = if same { weight } else { 0.0 };
    }
}

/// [`closeness`] of what lies `tap` away to the centres from lane `first` on; `depth`: of what lies there.
#[inline(always)]
pub(crate) fn closeness_to_centres<const PERSPECTIVE: bool>(
    centres: &Centres,
    first: usize,
    depth: &[f32],
    tap: &Tap,
    out: &mut [f32],
) {
    let n = out.len();
    let (depth, p_depth, p_facing) = (&depth[..n], &centres.depth[first..][..n], &centres.facing[first..][..n]);
    let (p_ax, p_ay) = (&centres.along[0][first..][..n], &centres.along[1][first..][..n]);
    let [p_rx, p_ry, p_rz] = three(|c| &centres.ray[c][first..][..n]);
    let (dx, dy, delta) = (tap.dx, tap.dy, tap.delta);
    for i in 0..n {
        let z = depth[i];
        let rise = z - p_depth[i];
        let scale = if PERSPECTIVE { z } else { 1.0 };
        let above = (p_ax[i] * dx + p_ay[i] * dy) * scale + p_facing[i] * rise;
        let ox = delta[0] * scale + p_rx[i] * rise;
        let oy = delta[1] * scale + p_ry[i] * rise;
        let oz = delta[2] * scale + p_rz[i] * rise;
        let h = closeness(above, ox * ox + oy * oy + oz * oz);
        out[i] = if z < f32::INFINITY { h } else { 0.0 };
    }
}

/// [`closeness`] of what lies twice as far as `tap` to what lies there, by the centres' normals; depths of both.
#[inline(always)]
pub(crate) fn closeness_beyond<const PERSPECTIVE: bool>(
    centres: &Centres,
    first: usize,
    (near, far): (&[f32], &[f32]),
    tap: &Tap,
    out: &mut [f32],
) {
    let n = out.len();
    let (near, far, p_facing) = (&near[..n], &far[..n], &centres.facing[first..][..n]);
    let (p_ax, p_ay) = (&centres.along[0][first..][..n], &centres.along[1][first..][..n]);
    let [p_rx, p_ry, p_rz] = three(|c| &centres.ray[c][first..][..n]);
    let (dx, dy, delta) = (tap.dx, tap.dy, tap.delta);
    for i in 0..n {
        let (q, r) = (near[i], far[i]);
        let rise = r - q;
        let scale = if PERSPECTIVE { 2.0 * r - q } else { 1.0 };
        let above = (p_ax[i] * dx + p_ay[i] * dy) * scale + p_facing[i] * rise;
        let ox = delta[0] * scale + p_rx[i] * rise;
        let oy = delta[1] * scale + p_ry[i] * rise;
        let oz = delta[2] * scale + p_rz[i] * rise;
        let h = closeness(above, ox * ox + oy * oy + oz * oz);
        out[i] = if (q < f32::INFINITY) & (r < f32::INFINITY) { h } else { 0.0 };
    }
}

/// [`contact_stop`] of the centres and what lies `tap` away, an axis; `depth`: of what lies there, `to_p` and `to_q`: what is close to
/// either of the pair.
#[inline(always)]
pub(crate) fn contact_stops<const PERSPECTIVE: bool>(
    centres: &Centres,
    depth: &[f32],
    tap: &Tap,
    (to_p, to_q, gains): (&[f32], &[f32], &Gains),
    out: &mut [f32],
) {
    let n = out.len();
    let (depth, p_depth) = (&depth[..n], &centres.depth[..n]);
    let (to_p, to_q) = (&to_p[..n], &to_q[..n]);
    let [p_rx, p_ry, p_rz] = three(|c| &centres.ray[c][..n]);
    let delta = tap.delta;
    for i in 0..n {
        let z = depth[i];
        let rise = z - p_depth[i];
        let scale = if PERSPECTIVE { z } else { 1.0 };
        let ox = delta[0] * scale + p_rx[i] * rise;
        let oy = delta[1] * scale + p_ry[i] * rise;
        let oz = delta[2] * scale + p_rz[i] * rise;
        let nearest = if to_p[i] > to_q[i] { to_p[i] } else { to_q[i] };
        let stop = contact_stop(ox * ox + oy * oy + oz * oz, nearest, gains.contact);
        out[i] = if z < f32::INFINITY { stop } else { 1.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_root_is_as_good_as_it_says() {
        let mut x = 1e-30f32;
        while x < 1e30 {
            let exact = 1.0 / f64::from(x).sqrt();
            assert!((f64::from(inverse_root(x)) / exact - 1.0).abs() < 5e-6, "{x}");
            x *= 1.01;
        }
        assert_eq!(0.0 * inverse_root(0.0), 0.0);
    }

    #[test]
    fn runs_cover_a_row() {
        assert!(run_length(0) > 0);
        for count in 1..3000 {
            let length = run_length(count);
            assert!(length <= RUN && length * count.div_ceil(RUN) >= count, "{count} {length}");
        }
    }
}
