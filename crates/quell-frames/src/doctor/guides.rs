//! Normals, depth and albedo: how they are stored, and whether that is what the renderer's table says.

use super::finding::{Diagnosis, Figure, Finding, Severity};
use super::look::{Look, name_of};
use super::warp::positions;
use crate::adapt::noise::smooth;
use crate::adapt::{Adapter, PixelCamera};
use crate::roles::{DepthKind, Mapping, Role, Space};
use quell::sequence::SequenceFrame;
use quell::{Plane, Size};

/// Lengths of normals that count as 1: half floats, and means over a pixel's samples.
const UNIT: f32 = 0.06;
/// With fewer normals of unit length the pass is no normal, or scaled.
const UNIT_SHARE: f64 = 0.5;
/// Normals of another length count where so many have the same one: in fog and at edges lengths are mixed.
const SAME_LENGTH_SHARE: f64 = 0.7;
/// Normals and positions that fit each other have a cosine of this in the median (bump maps included).
const FITS: f64 = 0.97;
/// A space must fit this much better than another.
const BETTER: f64 = 0.03;
/// Albedo above this is more than rounding.
const ALBEDO: f32 = 1.02;
/// ... in this share of the pixels.
const ALBEDO_SHARE: f64 = 1e-3;
/// ... and in this share it costs more than the albedo is worth: `mitsuba_box` (7 %) loses a quarter in HDR-FLIP by it.
const ALBEDO_SPOILS: f64 = 0.01;

#[derive(Debug, Default)]
pub(super) struct GuideChecks {
    /// The first frame that was looked at.
    first: Option<i64>,
    lengths: Option<Lengths>,
    /// Medians of |cosine| of normals and positions: world, camera, camera with z into the scene.
    spaces: Vec<(i64, [f64; 3])>,
    depths: Vec<(i64, Bend)>,
    /// Frame, role, share of the pixels above 1, largest.
    albedo: Option<(i64, Role, f64, f64)>,
}

#[derive(Clone, Copy, Debug)]
struct Lengths {
    frame: i64,
    count: usize,
    unit: f64,
    folded: f64,
    median: f64,
    /// Share of lengths near the median.
    same: f64,
}

impl GuideChecks {
    pub fn look(&mut self, adapter: &Adapter, look: &Look) {
        self.first = self.first.or(Some(look.number));
        if let Some(normal) = &look.raw.normal {
            let new = lengths(normal, look.number);
            if self.lengths.is_none_or(|old| new.unit < old.unit) && new.count > 0 {
                self.lengths = Some(new);
            }
            if let Some(camera) = &look.camera {
                let made;
                let position = match &look.frame.position {
                    Some(position) => Some(position),
                    None => {
                        made = positions(&look.frame, camera);
                        made.as_ref()
                    }
                };
                let unsigned = adapter.normals_unsigned();
                self.spaces.extend(
                    position.and_then(|p| spaces(normal, unsigned, p, camera, &look.frame)).map(|s| (look.number, s)),
                );
            }
        }
        if let Some(depth) = &look.raw.depth {
            self.depths.extend(bend(depth, look.raw.depth_half, &look.frame).map(|b| (look.number, b)));
        }
        if let Some((role, albedo)) = &look.raw.albedo {
            let (mut above, mut most) = (0usize, 0.0f32);
            for (i, pixel) in albedo.data().iter().enumerate() {
                // Renderers write the sky's radiance there; it is divided out and multiplied back.
                if look.frame.depth.as_ref().and_then(|d| d.data().get(i)).is_some_and(|d| !d.is_finite()) {
                    continue;
                }
                let largest = pixel.iter().copied().filter(|v| v.is_finite()).fold(0.0, f32::max);
                above += usize::from(largest > ALBEDO);
                most = most.max(largest);
            }
            let share = above as f64 / albedo.data().len().max(1) as f64;
            if self.albedo.is_none_or(|(_, _, s, _)| share > s) {
                self.albedo = Some((look.number, *role, share, f64::from(most)));
            }
        }
    }

    /// `table` is the mapping before anything was measured.
    pub fn judge(&self, adapter: &Adapter, table: &Mapping, found: &mut Diagnosis) {
        self.normals(adapter, table, found);
        self.depth(adapter, table, found);
        self.albedo(table, found);
    }

    fn normals(&self, adapter: &Adapter, table: &Mapping, found: &mut Diagnosis) {
        let Some(lengths) = self.lengths else { return };
        let name = name_of(table, Role::Normal);
        let before = found.findings.len();
        if adapter.normals_unsigned() {
            found.findings.push(
                Finding::new("normal.encoded", Severity::Note, "normals are stored in 0..1 instead of -1..1")
                    .frame(lengths.frame)
                    .channel(&name)
                    .evidence(
                        format!(
                            "no value is negative, and 2 n - 1 has length 1 in {:.0} % of the pixels",
                            lengths.folded * 100.0
                        ),
                        vec![Figure::new("unit after decoding", lengths.folded * 100.0, "%")],
                    )
                    .cure(
                        "nothing: quell decodes them; values of 8 bits would be too coarse for smooth surfaces",
                        "none needed; better written as they are, in half or float",
                    ),
            );
        } else if lengths.unit < UNIT_SHARE && lengths.same > SAME_LENGTH_SHARE {
            found.findings.push(
                Finding::new("normal.length", Severity::Warning, "normals are not of length 1")
                    .frame(lengths.frame)
                    .channel(&name)
                    .evidence(
                        format!(
                            "{:.0} % of {} normals have length 1; {:.0} % have length {:.3}",
                            lengths.unit * 100.0,
                            lengths.count,
                            lengths.same * 100.0,
                            lengths.median
                        ),
                        vec![Figure::new("unit normals", lengths.unit * 100.0, "%"), Figure::new("median length", lengths.median, "")],
                    )
                    .cure(
                        "quell makes them unit; where the pass is something else (a tangent, a colour), surfaces are told apart wrongly",
                        "check that the pass is the shading normal, not scaled or colour-managed; --map normal=CHANNEL names another, \
                         --map normal=none leaves it out",
                    ),
            );
        }
        let used = table.renderer.normal;
        let Some((frame, fits)) = self.middle() else {
            found.cannot(
                "the space of the normals",
                "no camera is known (no world positions, no matrices in the header), or no surface is smooth enough",
            );
            return;
        };
        let order = [Space::World, Space::Camera, Space::CameraForward];
        let of =
            |space: Space| order.iter().position(|s| *s == space).and_then(|i| fits.get(i)).copied().unwrap_or(0.0);
        let best = order.into_iter().max_by(|a, b| of(*a).total_cmp(&of(*b))).unwrap_or(used);
        let word = |space: Space| match space {
            Space::World => "world space",
            Space::Camera => "camera space (z towards the viewer)",
            Space::CameraForward => "camera space (z into the scene)",
        };
        let key = match best {
            Space::World => "world",
            Space::Camera => "camera",
            Space::CameraForward => "camera_forward",
        };
        if of(best) >= FITS && of(best) - of(used) > BETTER {
            let renderer = &table.renderer.name;
            found.findings.push(
                Finding::new("normal.space", Severity::Warning, format!("normals are in {}, not in {}", word(best), word(used)))
                    .frame(frame)
                    .channel(&name)
                    .evidence(
                        format!(
                            "the cosine between them and the surfaces that positions or depth make is {:.3} in the median there, {:.3} here",
                            of(best),
                            of(used)
                        ),
                        vec![Figure::new("cosine, this space", of(best), ""), Figure::new("cosine, expected space", of(used), "")],
                    )
                    .cure(
                        "some are turned as if they faced away, and the same wall has another normal in every frame that the camera turns in",
                        format!(
                            "write world-space normals, or say so in a file for --aliases: [[renderer]] name = \"{renderer}\" normal = \"{key}\""
                        ),
                    ),
            );
        }
        if found.findings.len() == before {
            found.pass(
                "normal",
                format!(
                    "{:.0} % of length 1; cosine to the surfaces {:.3} in {}",
                    lengths.unit * 100.0,
                    of(used),
                    word(used)
                ),
            );
        }
    }

    fn middle(&self) -> Option<(i64, [f64; 3])> {
        let first = self.spaces.first()?.0;
        let median = |c: usize| {
            let mut all: Vec<f64> = self.spaces.iter().map(|(_, s)| s[c]).collect();
            all.sort_by(f64::total_cmp);
            all.get(all.len() / 2).copied().unwrap_or(0.0)
        };
        Some((first, [median(0), median(1), median(2)]))
    }

    fn depth(&self, adapter: &Adapter, table: &Mapping, found: &mut Diagnosis) {
        let name = name_of(table, Role::Depth);
        if name.is_empty() {
            return;
        }
        let word = |kind: DepthKind| match kind {
            DepthKind::Planar => "the distance along the camera's axis",
            DepthKind::Ray => "the distance along the ray",
            DepthKind::Inverse => "1 / distance",
        };
        // Positions decide: the adapter has measured it.
        let measured = adapter.mapping().renderer.depth;
        let from_positions = adapter.has_positions();
        let kind = if from_positions { Some(measured) } else { self.bent() };
        let Some(kind) = kind else {
            found.cannot(
                "the kind of depth (along the axis, along the ray, 1 / z)",
                "there are no world positions, and too few flat surfaces that recede",
            );
            return;
        };
        let expected = table.renderer.depth;
        let handled = from_positions || kind == expected;
        let camera = from_positions || adapter.has_cameras();
        if kind == DepthKind::Planar && expected == kind {
            found.pass("depth.kind", format!("`{name}` is {}", word(kind)));
            return;
        }
        if kind == expected && kind == DepthKind::Inverse {
            found.pass("depth.kind", format!("`{name}` is {}, as {} writes it", word(kind), table.renderer.name));
            return;
        }
        let key = match kind {
            DepthKind::Planar => "planar",
            DepthKind::Ray => "ray",
            DepthKind::Inverse => "inverse",
        };
        let id = if kind == DepthKind::Ray { "depth.ray" } else { "depth.kind" };
        let copes = handled && (kind != DepthKind::Ray || camera);
        let evidence = if from_positions {
            format!("world positions say so ({} is what {} is expected to write)", word(expected), table.renderer.name)
        } else {
            let bend = self.depths.first().map_or([0.0; 3], |(_, b)| b.medians);
            format!(
                "flat surfaces bend by {:.2e} where it is read as distance along the axis, {:.2e} as distance along the ray, {:.2e} as 1 / distance \
                 (relative, over {FLAT_PX} px)",
                bend[0], bend[1], bend[2]
            )
        };
        let figures = self.depths.first().map_or_else(Vec::new, |(_, b)| {
            vec![
                Figure::new("bend as planar", b.medians[0], ""),
                Figure::new("bend as ray", b.medians[1], ""),
                Figure::new("bend as inverse", b.medians[2], ""),
            ]
        });
        let renderer = &table.renderer.name;
        found.findings.push(
            Finding::new(
                id,
                if copes { Severity::Note } else { Severity::Warning },
                format!("depth is {}, not {}", word(kind), if kind == DepthKind::Planar { word(expected) } else { word(DepthKind::Planar) }),
            )
            .frame(self.first.unwrap_or_default())
            .channel(&name)
            .evidence(evidence, figures)
            .cure(
                if copes { "nothing: quell turns it" } else { "surfaces seem bent: tolerances around them are too tight at the picture's rim" },
                if copes {
                    "none needed".to_owned()
                } else {
                    format!(
                        "write the distance along the axis, or add a world position pass, or say so in a file for --aliases: [[renderer]] \
                         name = \"{renderer}\" depth = \"{key}\""
                    )
                },
            ),
        );
    }

    /// The kind that leaves flat surfaces flat, by the sum over frames.
    fn bent(&self) -> Option<DepthKind> {
        let mut sums = [0.0; 3];
        for (_, bend) in &self.depths {
            for (sum, median) in sums.iter_mut().zip(bend.medians) {
                *sum += median;
            }
        }
        if self.depths.is_empty() {
            return None;
        }
        let [planar, ray, inverse] = sums;
        // Another kind must leave half of the bend at most: planar is what most programs write.
        if inverse < 0.5 * planar.min(ray) {
            Some(DepthKind::Inverse)
        } else if ray < 0.5 * planar {
            Some(DepthKind::Ray)
        } else if planar < 0.5 * inverse {
            Some(DepthKind::Planar)
        } else {
            None
        }
    }

    fn albedo(&self, table: &Mapping, found: &mut Diagnosis) {
        let Some((frame, role, share, most)) = self.albedo else { return };
        // Lamps have their radiance in Blender's denoising albedo, by design.
        if share <= if role == Role::Albedo { ALBEDO_SHARE } else { ALBEDO_SPOILS } {
            found.pass("albedo.above_one", format!("at most {most:.2}; {:.2} % of the pixels above 1", share * 100.0));
            return;
        }
        let severity = if share > ALBEDO_SPOILS { Severity::Fault } else { Severity::Warning };
        found.findings.push(
            Finding::new("albedo.above_one", severity, "albedo is larger than 1")
                .frame(frame)
                .channel(name_of(table, role))
                .evidence(
                    format!("in {:.1} % of the pixels, up to {most:.2}; no surface reflects more light than it gets", share * 100.0),
                    vec![Figure::new("pixels above 1", share * 100.0, "%"), Figure::new("largest", most, "")],
                )
                .cure(
                    "light cannot be divided by it: quell takes surfaces that it belongs to for white; where it does not find them (no normals) it \
                     leaves the albedo out, and textures that it alone shows are blurred",
                    format!(
                        "write the surface's colour alone (no emission, no division by small densities), clamped to 1; \
                         --map {role}=none leaves it out in any case"
                    ),
                ),
        );
    }
}

fn lengths(normal: &Plane<[f32; 3]>, frame: i64) -> Lengths {
    let (mut count, mut unit, mut folded, mut all) = (0usize, 0usize, 0usize, Vec::new());
    for n in normal.data().iter().filter(|n| **n != [0.0; 3] && n.iter().all(|v| v.is_finite())) {
        let length = |n: [f32; 3]| (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        count += 1;
        unit += usize::from((length(*n) - 1.0).abs() < UNIT);
        folded += usize::from((length(n.map(|v| 2.0 * v - 1.0)) - 1.0).abs() < UNIT);
        all.push(length(*n));
    }
    all.sort_by(f32::total_cmp);
    let share = |n: usize| n as f64 / count.max(1) as f64;
    let median = all.get(all.len() / 2).copied().map_or(0.0, f64::from);
    let near = all.iter().filter(|l| (f64::from(**l) - median).abs() < f64::from(UNIT) * median).count();
    Lengths { frame, count, unit: share(unit), folded: share(folded), median, same: share(near) }
}

/// Median |cosine| between a file's normals, read in each of the three spaces, and the surfaces that positions make.
fn spaces(
    normal: &Plane<[f32; 3]>,
    unsigned: bool,
    position: &Plane<[f32; 3]>,
    camera: &PixelCamera,
    frame: &SequenceFrame,
) -> Option<[f64; 3]> {
    let Size { width, height } = normal.size();
    let step = (normal.size().pixels() / 20_000).max(1);
    let mut cosines: [Vec<f64>; 3] = Default::default();
    for i in (0..normal.size().pixels()).step_by(step) {
        let (x, y) = (i % width, i / width);
        if x < 2 || y < 2 || x + 2 >= width || y + 2 >= height || !smooth(frame, x, y) {
            continue;
        }
        let n = normal.at(x, y).map(|v| if unsigned { 2.0 * v - 1.0 } else { v });
        let here = position.at(x, y);
        let near = [position.at(x - 2, y), position.at(x + 2, y), position.at(x, y - 2), position.at(x, y + 2)];
        if here == [0.0; 3] || near.contains(&[0.0; 3]) || !n.iter().all(|v| v.is_finite()) {
            continue;
        }
        let to = |p: [f32; 3], q: [f32; 3]| (glam::Vec3::from(q) - glam::Vec3::from(p)).as_dvec3();
        let [a, b, c, d] = near;
        // One plane: the middle of the ends lies where the pixel's own point is.
        let bent = |p: [f32; 3], q: [f32; 3]| (to(here, p) + to(here, q)).length() > 0.05 * to(p, q).length();
        if bent(a, b) || bent(c, d) {
            continue;
        }
        let surface = to(a, b).cross(to(c, d)).normalize_or_zero();
        let candidates = [n, camera.world_from_camera([n[0], n[1], -n[2]]), camera.world_from_camera(n)];
        for (all, n) in cosines.iter_mut().zip(candidates) {
            let n = glam::Vec3::from(n).as_dvec3().normalize_or_zero();
            all.push(n.dot(surface).abs());
        }
    }
    if cosines[0].len() < 200 {
        return None;
    }
    Some(cosines.map(|mut all| {
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(0.0)
    }))
}

/// Half the distance over which flat surfaces are tried, in pixels.
const FLAT_PX: usize = 12;
/// Angles of view that are tried for distances along the ray: focal lengths in widths of the picture.
const FOCAL: [f64; 8] = [0.4, 0.55, 0.75, 1.0, 1.35, 1.8, 2.5, 4.0];

/// Three depths on a line over a flat surface, and their places from the picture's middle, in pixels.
type Line = ([f64; 3], [[f64; 2]; 3]);

/// How far flat surfaces seem bent by each reading of depth: medians of relative second differences.
#[derive(Clone, Copy, Debug)]
struct Bend {
    medians: [f64; 3],
}

/// 1 / planar depth is linear over a plane's picture. Looks at lines of equal normals on which depth changes.
fn bend(depth: &Plane<f32>, half: bool, frame: &SequenceFrame) -> Option<Bend> {
    let normal = frame.normal.as_ref()?;
    let Size { width, height } = depth.size();
    if width <= 2 * FLAT_PX || height <= 2 * FLAT_PX {
        return None;
    }
    let far = if half { 65504.0 } else { 1e9 };
    let known = |v: f32| v > 0.0 && v < far;
    let step = (depth.size().pixels() / 30_000).max(1);
    let mut lines: Vec<Line> = Vec::new();
    for i in (0..depth.size().pixels()).step_by(step) {
        let (x, y) = (i % width, i / width);
        if x < FLAT_PX || y < FLAT_PX || x + FLAT_PX >= width || y + FLAT_PX >= height {
            continue;
        }
        for (dx, dy) in [(FLAT_PX, 0), (0, FLAT_PX)] {
            let at = |k: usize| match k {
                0 => (x - dx, y - dy),
                1 => (x, y),
                _ => (x + dx, y + dy),
            };
            let half_way = [(x - dx / 2, y - dy / 2), (x + dx / 2, y + dy / 2)];
            let n = normal.at(x, y);
            let flat = [at(0), at(2), half_way[0], half_way[1]].iter().all(|p| {
                let m = normal.at(p.0, p.1);
                (0..3).all(|c| (m[c] - n[c]).abs() < 0.01)
            });
            if n == [0.0; 3] || !flat {
                continue;
            }
            let d: [f32; 3] = std::array::from_fn(|k| depth.at(at(k).0, at(k).1));
            // Surfaces that lie straight before the camera say little, and half floats are coarse.
            if !d.iter().all(|v| known(*v)) || (d[2] - d[0]).abs() < 0.01 * d[1] || (d[2] - d[0]).abs() > 0.5 * d[1] {
                continue;
            }
            let middle = [width as f64 * 0.5, height as f64 * 0.5];
            let places = [0, 1, 2].map(|k| [at(k).0 as f64 + 0.5 - middle[0], at(k).1 as f64 + 0.5 - middle[1]]);
            lines.push((d.map(f64::from), places));
        }
    }
    if lines.len() < 300 {
        return None;
    }
    let median = |bend: &dyn Fn(&Line) -> [f64; 3]| {
        let mut all: Vec<f64> = lines
            .iter()
            .map(|line| {
                let [a, b, c] = bend(line);
                (a + c - 2.0 * b).abs() / b.abs().max(1e-30)
            })
            .collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(f64::INFINITY)
    };
    let planar = median(&|(d, _)| d.map(|v| 1.0 / v));
    let inverse = median(&|(d, _)| *d);
    let ray = FOCAL
        .iter()
        .map(|f| {
            let f = f * width as f64;
            median(&|(d, at)| {
                std::array::from_fn(|k| (1.0 + (at[k][0].powi(2) + at[k][1].powi(2)) / (f * f)).sqrt() / d[k])
            })
        })
        .fold(f64::INFINITY, f64::min);
    // Rounding alone bends: depths of half floats by 1e-3.
    let floor = if half { 1e-3 } else { 1e-5 };
    Some(Bend { medians: [planar.max(floor), ray.max(floor), inverse.max(floor)] })
}
