//! Motion vectors: is one frame found again in its neighbour where they lead?

use super::finding::{Diagnosis, Figure, Finding, Severity};
use super::look::{Look, name_of};
use super::warp::{Residual, Warp};
use crate::adapt::Adapter;
use crate::motion::{Direction, MotionConvention, MotionEvidence, MotionGuides, Unit, find_motion};
use crate::roles::{Mapping, Role};
use quell::Plane;
use std::collections::BTreeMap;

/// The reading in force is wrong where another leaves less than this part of its difference...
const MUCH_BETTER: f64 = 0.7;
/// ... or where the one in force explains less than this part of what another explains (depth and normals alone change
/// little over a wall, so much is left by any)...
const GAIN: f64 = 0.5;
/// ... and at least this much less (of 1: every pixel another surface).
const LESS: f64 = 0.02;
/// Vectors explain the motion where they leave less than this part of the difference without any.
const EXPLAINS: f64 = 0.95;
/// A reading explains something where it leaves at most this part of the difference without motion. Half a pixel of
/// rounding alone leaves 0.15 to 0.2.
const GOOD: f64 = 0.9;
/// Mean length of vectors that can be meant, in widths of the picture.
const FARTHEST: f64 = 0.2;
/// Vectors that leave this much more than no motion at all lead nowhere.
const NOWHERE: f64 = 1.25;
/// The picture moves where doing nothing leaves this much difference.
const MOVES: f64 = 0.03;
/// Vectors that are this much too short or too long cost 5 % of HDR-FLIP at 2 pixels a frame (docs/doctor.md).
const SCALE: f64 = 0.08;
/// ... and are off by this many pixels at least, in the mean.
const SCALE_PX: f64 = 0.15;
/// Guides that lie this far beside where the vectors lead, in pixels: docs/doctor.md.
const OFFSET_PX: f64 = 0.15;

/// Where no preset has the right reading.
const AUTO: &str = "`quell denoise --motion auto` finds this reading; or set the renderer's motion pass right";

/// What one pair of neighbouring frames shows.
#[derive(Debug)]
struct Pair {
    later: i64,
    /// Of the file's pairs of numbers: role, which pair, the reading in force, what all readings leave.
    readings: Vec<(Role, usize, MotionConvention, MotionEvidence)>,
    /// How the vectors in force lead astray.
    residual: Option<Residual>,
    /// Guides changed.
    moves: bool,
    /// Mean length of the vectors in force, pixels.
    length: f64,
    same_picture: bool,
}

/// Everything that pairs show of motion.
#[derive(Debug, Default)]
pub(super) struct Motion {
    pairs: Vec<Pair>,
    zero_vectors: Vec<i64>,
    frames: usize,
}

impl Motion {
    pub fn look(&mut self, look: &Look) {
        self.frames += 1;
        let zero = |plane: &Plane<[f32; 2]>| plane.data().iter().all(|v| v.iter().all(|v| *v == 0.0 || !v.is_finite()));
        if !look.raw.vectors.is_empty() && look.raw.vectors.iter().all(|(_, _, plane)| zero(plane)) {
            self.zero_vectors.push(look.number);
        }
    }

    /// `earlier` and `later` are neighbours.
    pub fn pair(&mut self, adapter: &Adapter, earlier: &Look, later: &Look) {
        let mut readings = Vec::new();
        for (role, pair, plane) in &later.raw.vectors {
            let Some((_, _, before)) = earlier.raw.vectors.iter().find(|(r, p, _)| (r, p) == (role, pair)) else {
                continue;
            };
            let Some(convention) = in_force(adapter, *role, *pair) else { continue };
            let mut evidence = find_motion(&guides(earlier, before), &guides(later, plane));
            if let Some(evidence) = &mut evidence {
                evidence.errors.retain(|(c, _)| *c == convention || plausible(c, plane));
            }
            readings.extend(evidence.map(|e| (*role, *pair, convention, e)));
        }
        let motion = later.frame.motion_to_previous.as_ref();
        let from_file = !later.raw.vectors.is_empty() && !self.zero_vectors.contains(&later.number);
        let residual = motion.filter(|_| from_file).and_then(|m| Warp::new(&earlier.frame, &later.frame)?.residual(m));
        let length = motion.map_or(0.0, mean_length);
        let moves = earlier.trace.guides_changed(&later.frame);
        let same_picture = earlier.beauty == later.beauty;
        self.pairs.push(Pair { later: later.number, readings, residual, moves, length, same_picture });
    }

    /// Pairs of frames that are the same, bit for bit.
    pub fn same_pictures(&self) -> Vec<(i64, i64)> {
        self.pairs.iter().filter(|p| p.same_picture).map(|p| (p.later - 1, p.later)).collect()
    }

    /// True where frames that move and frames that stand still take turns.
    pub fn has_turns(&self) -> bool {
        !self.turns().is_empty()
    }

    pub fn judge(&self, adapter: &Adapter, several: bool, renamed: bool, found: &mut Diagnosis) {
        let cameras = adapter.has_cameras();
        let mapping = adapter.mapping();
        self.on_twos(mapping, found);
        let roles = [Role::Motion, Role::MotionPrevious, Role::MotionNext];
        let Some(role) = roles.into_iter().find(|r| mapping.get(*r).is_some()) else {
            if renamed {
                found.cannot("motion", "the pass that may hold it is not used");
                return;
            }
            return missing(cameras, several, found);
        };
        if self.pairs.is_empty() {
            let why = if several { "no two neighbouring frames could be read" } else { "there is one frame only" };
            found.cannot("motion vectors: sign, axes, unit, direction, length", why);
            return;
        }
        let name = name_of(mapping, role);
        if self.zero(&name, cameras, found) || found.has("frames.on_twos") {
            return;
        }
        if adapter.vectors().is_none() {
            let best = self.pairs.first().and_then(|p| p.readings.first());
            let text = best.map_or_else(String::new, |(_, _, _, e)| format!("best: {e}"));
            return self.nothing_fits(&name, text, found);
        }
        let before = found.findings.len();
        self.readings(mapping, found);
        if found.findings.len() == before {
            self.residuals(&name, found);
        }
    }

    fn zero(&self, name: &str, cameras: bool, found: &mut Diagnosis) -> bool {
        let moving: Vec<&Pair> =
            self.pairs.iter().filter(|p| p.moves && self.zero_vectors.contains(&p.later)).collect();
        if moving.is_empty() {
            if self.zero_vectors.len() == self.frames && self.frames > 0 {
                found
                    .cannot("motion vectors", "they are all zero, and nothing moves in the frames that were looked at");
                return true;
            }
            return false;
        }
        let (severity, spoils) = if cameras {
            (
                Severity::Warning,
                "quell follows what stands still by the cameras (from positions); what moves by itself smears or stays noisy",
            )
        } else {
            (Severity::Fault, "no frame finds its neighbours: each is filtered by itself and flickers")
        };
        let first = moving.first().map_or(0, |p| p.later);
        found.findings.push(
            Finding::new("motion.zero", severity, "the motion vectors are zero everywhere, though the picture moves")
                .frame(first)
                .channel(name)
                .evidence(
                    format!(
                        "all vectors of {} of {} frames are exactly 0, while surfaces changed place in {} of {} pairs of frames",
                        self.zero_vectors.len(),
                        self.frames,
                        moving.len(),
                        self.pairs.len()
                    ),
                    vec![Figure::new("frames without vectors", self.zero_vectors.len() as f64, "frames")],
                )
                .cure(
                    spoils,
                    "Blender writes such where motion blur is on: switch it off (Render > Motion Blur) and blur afterwards with the \
                     compositor's Vector Blur node; elsewhere check that the motion pass is computed",
                ),
        );
        true
    }

    /// The longest run of pairs in which still and moving take turns.
    fn turns(&self) -> &[Pair] {
        let mut best: &[Pair] = &[];
        let mut from = 0;
        for to in 1..=self.pairs.len() {
            let follows = self.pairs.get(to).zip(self.pairs.get(to - 1));
            let ends = follows.is_none_or(|(a, b)| b.later.checked_add(1) != Some(a.later) || a.moves == b.moves);
            if ends {
                let run = self.pairs.get(from..to).unwrap_or_default();
                if run.len() > best.len() {
                    best = run;
                }
                from = to;
            }
        }
        // Once may be a frame that was copied.
        if best.len() >= 3 && best.iter().filter(|p| !p.moves).count() >= 2 { best } else { &[] }
    }

    fn on_twos(&self, mapping: &Mapping, found: &mut Diagnosis) {
        let best = self.turns();
        let held: Vec<&Pair> = best.iter().filter(|p| !p.moves).collect();
        if held.is_empty() {
            return;
        }
        let same = held.iter().filter(|p| p.same_picture).count();
        let wrong = held.iter().filter(|p| p.length > 0.05).count();
        let moved_off = best
            .iter()
            .filter(|p| p.moves)
            .filter_map(|p| p.residual)
            .any(|r| (r.scale - 1.0).abs() > SCALE && r.certain());
        let severity = if wrong > 0 || moved_off || same > 0 { Severity::Fault } else { Severity::Note };
        let length = held.iter().map(|p| p.length).fold(0.0, f64::max);
        let first = held.first().map_or(0, |p| p.later);
        found.findings.push(
            Finding::new("frames.on_twos", severity, "the animation is on twos: every second frame shows what the one before showed")
                .frame(first)
                .channel(["motion", "motion_previous"].iter().filter_map(|r| Role::from_name(r)).find_map(|r| mapping.get(r)).map_or_else(String::new, |p| p.name.clone()))
                .evidence(
                    format!(
                        "in frames {} to {} surfaces move in every other frame only; {same} of {} held frames are equal to the one before, bit \
                         for bit, and in {wrong} vectors say {length:.2} px of motion",
                        best.first().map_or(0, |p| p.later - 1),
                        best.last().map_or(0, |p| p.later),
                        held.len()
                    ),
                    vec![
                        Figure::new("equal frames", same as f64, "frames"),
                        Figure::new("motion in held frames", length, "px"),
                    ],
                )
                .cure(
                    if severity == Severity::Note {
                        "nothing: the vectors say so, too"
                    } else {
                        "vectors that span one frame lead beside the surface, and a frame twice holds its noise twice: blur, and noise that stays"
                    },
                    "denoise the frames before each is held for two, and hold them afterwards; or render every frame",
                ),
        );
    }

    fn nothing_fits(&self, name: &str, text: String, found: &mut Diagnosis) {
        if found.has("motion.unexplained") {
            return;
        }
        let Some(first) = self.pairs.iter().find(|p| p.moves) else {
            found.cannot("what the motion vectors mean", "nothing moves in the frames that were looked at");
            return;
        };
        if text.is_empty() {
            found.cannot(
                "what the motion vectors mean",
                "there is no position, depth, normal or albedo to compare frames by",
            );
            return;
        }
        found.findings.push(
            Finding::new("motion.unexplained", Severity::Fault, "the motion vectors lead nowhere, whatever they are taken for")
                .frame(first.later)
                .channel(name)
                .evidence(text, self.figures())
                .cure(
                    "quell does not use them: each frame is filtered by itself and flickers",
                    "check that the pass holds motion between neighbouring frames; if you know its convention, name it with --motion",
                ),
        );
    }

    fn figures(&self) -> Vec<Figure> {
        let e = self.pairs.first().and_then(|p| p.readings.first()).map(|r| &r.3);
        e.map_or_else(Vec::new, |e| {
            vec![
                Figure::new("difference, best reading", e.error, ""),
                Figure::new("difference without motion", e.still, ""),
            ]
        })
    }

    /// Sign, axes, unit, direction: sums over all pairs of frames, for each of the file's pairs of numbers.
    fn readings(&self, mapping: &Mapping, found: &mut Diagnosis) {
        let mut slots: BTreeMap<(Role, usize), Sums> = BTreeMap::new();
        for pair in &self.pairs {
            for (role, which, convention, evidence) in &pair.readings {
                let sums = slots.entry((*role, *which)).or_insert_with(|| Sums::new(*convention, pair.later));
                sums.add(evidence);
            }
        }
        if slots.is_empty() {
            found.cannot(
                "motion vectors: sign, axes, unit, direction, length",
                "there is no position, depth, normal or albedo to compare frames by",
            );
            return;
        }
        for ((role, which), sums) in &slots {
            let name = name_of(mapping, *role);
            let which = if *which == 0 { "" } else { ", second pair of numbers" };
            let n = sums.pairs.max(1) as f64;
            let (used, still) = (sums.used / n, sums.still / n);
            let Some((best, error)) = sums.best() else { continue };
            let error = error / n;
            if still < MOVES {
                found.cannot(
                    format!("motion vectors (`{name}`{which}): sign, axes, unit, direction"),
                    format!("hardly anything moves: without any motion {:.1} % of the surfaces differ", still * 100.0),
                );
                continue;
            }
            let gains = still - used < GAIN * (still - error);
            if (error < used * MUCH_BETTER || gains) && used - error > LESS && error <= still * GOOD {
                let new = wrong_reading(mapping, &name, which, sums, (used, error, still), best);
                match found.findings.iter_mut().find(|f| f.check == new.check && f.channel == new.channel) {
                    // Blender's second pair of numbers, wrong in the same way.
                    Some(old) => {
                        old.evidence += &format!(
                            "; the second pair of numbers, too ({:.1} %, {:.1} %)",
                            used * 100.0,
                            error * 100.0
                        );
                        old.remedy = AUTO.to_owned();
                    }
                    None => found.findings.push(new),
                }
            } else if used > still * NOWHERE && error > still * GOOD && !found.has("motion.") {
                let text = format!(
                    "{used:.3} of the surfaces differ along the vectors, {still:.3} without any motion; best reading {error:.3} ({best})"
                );
                self.nothing_fits(&name, text, found);
            } else if used < still * EXPLAINS {
                found.pass(
                    "motion.convention",
                    format!(
                        "`{name}`{which}: {:.1} % of the surfaces differ along the vectors, {:.1} % without motion",
                        used * 100.0,
                        still * 100.0
                    ),
                );
            }
        }
    }

    /// Length, and jitter: how far beside the vectors surfaces are found.
    fn residuals(&self, name: &str, found: &mut Diagnosis) {
        let certain: Vec<(&Pair, Residual)> =
            self.pairs.iter().filter_map(|p| Some((p, p.residual.filter(Residual::certain)?))).collect();
        if certain.is_empty() {
            found.cannot(
                "the length of the motion vectors, and jitter left in the guides",
                "guides are too noisy or too smooth to tell fractions of a pixel",
            );
            return;
        }
        let before = found.findings.len();
        // A factor that accounts for nothing is none.
        let factor = |r: &Residual| if r.explains() { r.scale } else { 1.0 };
        let known = certain.iter().filter(|(p, r)| p.length > 0.3 && r.scale_error < 0.05);
        let mut scales: Vec<f64> = known.map(|(_, r)| factor(r)).collect();
        scales.sort_by(f64::total_cmp);
        let scale = scales.get(scales.len() / 2).copied();
        if let Some(scale) = scale
            && (scale - 1.0).abs() > SCALE
            && let Some((pair, _)) = certain.iter().find(|(p, _)| p.length * (scale - 1.0).abs() > SCALE_PX)
        {
            let twos = if (scale - 2.0).abs() < 0.15 {
                " Twice as long: frames may be rendered on twos while vectors span one frame."
            } else if (scale - 0.5).abs() < 0.05 {
                " Half as long: vectors may span two frames, or the shutter."
            } else {
                ""
            };
            found.findings.push(
                Finding::new("motion.scale", Severity::Fault, format!("the motion vectors must be multiplied by {scale:.2}"))
                    .frame(pair.later)
                    .channel(name)
                    .evidence(
                        format!(
                            "surfaces lie {:.2} px beside where the vectors lead, {scale:.3} times as far away (least squares over {} pairs of \
                             frames).{twos}",
                            pair.length * (scale - 1.0).abs(),
                            scales.len()
                        ),
                        vec![Figure::new("factor", scale, ""), Figure::new("miss", pair.length * (scale - 1.0).abs(), "px")],
                    )
                    .cure(
                        "blur, and noise where surfaces are not found again: 10 % too short costs 2 % of HDR-FLIP at 2 px a frame, half as long \
                         a third",
                        "let the renderer write motion for one whole frame in pixels of this size (Blender: no resolution scaling afterwards; \
                         elsewhere: shutter and motion scale 1); `--motion none` where there are positions",
                    ),
            );
        }
        let mut offsets: Vec<(f64, &Pair, Residual)> =
            certain.iter().map(|(p, r)| (r.offset[0].hypot(r.offset[1]), *p, *r)).collect();
        offsets.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((middle, ..)) = offsets.get(offsets.len() / 2)
            && *middle > OFFSET_PX
            && found.findings.len() == before
            && offsets.iter().filter(|o| o.2.explains()).count() * 2 > offsets.len()
            && let Some((largest, pair, residual)) = offsets.last()
        {
            let first = certain.first().map_or([0.0; 2], |(_, r)| r.offset);
            let steady =
                certain.iter().all(|(_, r)| r.offset[0] * first[0] + r.offset[1] * first[1] > 0.0) && certain.len() > 2;
            let (what, remedy) = if steady {
                (
                    "surfaces lie beside where the vectors lead, by the same way in every frame",
                    "check that vectors are measured from pixel centres, and that passes are not resized",
                )
            } else {
                (
                    "guides are jittered: they move by fractions of a pixel from frame to frame, and the vectors do not say so",
                    "switch the camera's jitter off for data passes (temporal anti-aliasing, `jitter`), or write vectors that contain it",
                )
            };
            found.findings.push(
                Finding::new("guides.jitter", Severity::Warning, what)
                    .frame(pair.later)
                    .evidence(
                        format!(
                            "all surfaces together lie {largest:.2} px ({:+.2}, {:+.2}) beside where the vectors lead, {middle:.2} px in the middle of \
                             {} pairs of frames (uncertain by {:.3} px)",
                            residual.offset[0],
                            residual.offset[1],
                            offsets.len(),
                            residual.offset_error
                        ),
                        vec![Figure::new("offset", *largest, "px"), Figure::new("median offset", *middle, "px")],
                    )
                    .cure("edges of surfaces tremble; from about a pixel on they are averaged across, and less history fits", remedy),
            );
        }
        if found.findings.len() == before {
            let middle = offsets.get(offsets.len() / 2).map_or(0.0, |o| o.0);
            let scale = scale.map_or_else(String::new, |s| format!("lengths fit by a factor {s:.3}; "));
            found.pass("motion.residual", format!("{scale}surfaces lie {middle:.3} px beside where the vectors lead"));
        }
    }
}

/// Sums of what readings leave over pairs of frames.
struct Sums {
    convention: MotionConvention,
    first: i64,
    pairs: usize,
    used: f64,
    still: f64,
    errors: Vec<(MotionConvention, f64)>,
}

impl Sums {
    const fn new(convention: MotionConvention, first: i64) -> Self {
        Self { convention, first, pairs: 0, used: 0.0, still: 0.0, errors: Vec::new() }
    }

    fn add(&mut self, evidence: &MotionEvidence) {
        self.pairs += 1;
        self.still += evidence.still;
        self.used += evidence.errors.iter().find(|(c, _)| *c == self.convention).map_or(evidence.still, |(_, e)| *e);
        if self.pairs == 1 {
            self.errors.clone_from(&evidence.errors);
            return;
        }
        // Only readings that are plausible in every pair.
        self.errors.retain(|(c, _)| evidence.errors.iter().any(|(other, _)| other == c));
        for (convention, sum) in &mut self.errors {
            *sum += evidence.errors.iter().find(|(c, _)| c == convention).map_or(0.0, |(_, e)| *e);
        }
    }

    fn best(&self) -> Option<(MotionConvention, f64)> {
        let same = |c: &MotionConvention| {
            // Of readings that warp alike the one that departs least from the one in force.
            usize::from(c.direction != self.convention.direction)
                + usize::from(c.swapped != self.convention.swapped)
                + usize::from(c.unit != self.convention.unit)
                + usize::from(c.sign != self.convention.sign)
        };
        let least = self.errors.iter().map(|(_, e)| *e).min_by(f64::total_cmp)?;
        let near = self.errors.iter().filter(|(_, e)| *e <= least * 1.1 + 1e-3 * self.pairs as f64);
        near.min_by(|a, b| same(&a.0).cmp(&same(&b.0)).then(a.1.total_cmp(&b.1))).copied()
    }
}

fn wrong_reading(
    mapping: &Mapping,
    name: &str,
    which: &str,
    sums: &Sums,
    (used, error, still): (f64, f64, f64),
    best: MotionConvention,
) -> Finding {
    let now = sums.convention;
    let both = [-now.sign[0], -now.sign[1]];
    let (check, what) = if best.swapped != now.swapped {
        (
            "motion.axis",
            "the motion vectors' first number is vertical, not horizontal (or the other way round)".to_owned(),
        )
    } else if best.unit != now.unit {
        let name = |u| match u {
            Unit::Pixels => "pixels",
            Unit::Uv => "parts of the picture (0..1)",
            Unit::Ndc => "halves of the picture (-1..1)",
        };
        ("motion.unit", format!("the motion vectors are in {}, not in {}", name(best.unit), name(now.unit)))
    } else if best.direction != now.direction || best.sign == both {
        let frame = |d| if d == Direction::Previous { "the frame before" } else { "the next frame" };
        let other = if now.direction == Direction::Previous { Direction::Next } else { Direction::Previous };
        (
            "motion.direction",
            format!(
                "the motion vectors lead to {}, not to {}; or both their signs are the other way round, which is the same where motion is \
                 smooth",
                frame(other),
                frame(now.direction)
            ),
        )
    } else {
        let axis = if best.sign[0] == now.sign[0] { "vertical" } else { "horizontal" };
        ("motion.sign", format!("the {axis} motion has the wrong sign"))
    };
    let preset = MotionConvention::PRESETS.iter().find(|p| MotionConvention::preset(p).is_some_and(|c| c[0] == best));
    let remedy = preset.map_or_else(
        || AUTO.to_owned(),
        |p| format!("`quell denoise --motion {p}`, or `--motion auto`; or set the renderer's motion pass right"),
    );
    Finding::new(check, Severity::Fault, what)
        .frame(sums.first)
        .channel(name)
        .evidence(
            format!(
                "over {} pairs of frames {:.1} % of the surfaces differ where the vectors lead by the reading of {} ({now}){which}, {:.1} % \
                 without any motion, {:.1} % by the reading {best}",
                sums.pairs,
                used * 100.0,
                mapping.renderer.name,
                still * 100.0,
                error * 100.0
            ),
            vec![
                Figure::new("difference", used * 100.0, "%"),
                Figure::new("difference without motion", still * 100.0, "%"),
                Figure::new("difference by the best reading", error * 100.0, "%"),
            ],
        )
        .cure("history is taken from other surfaces: blur along the motion, ghosts, and twice the error", remedy)
}

fn missing(cameras: bool, several: bool, found: &mut Diagnosis) {
    if !several {
        found.cannot("motion", "there is one frame only, and no motion vectors");
        return;
    }
    let (severity, text, spoils) = if cameras {
        (
            Severity::Warning,
            "no pass is called like motion; positions or header matrices give the cameras",
            "what stands still is followed by the cameras; what moves by itself smears or stays noisy",
        )
    } else {
        (
            Severity::Fault,
            "no pass is called like motion, and neither positions nor header matrices give the cameras",
            "each frame is filtered by itself: noise that is left flickers",
        )
    };
    found.findings.push(
        Finding::new("motion.missing", severity, "there are no motion vectors").evidence(text, Vec::new()).cure(
            spoils,
            "switch the motion pass on (Blender: View Layer > Data > Vector, motion blur off; Arnold: motionvector; RenderMan: backward), \
             or name it with --map motion=CHANNEL",
        ),
    );
}

/// True where a reading leaves most of the picture in sight: else it is wrong by half everywhere, which may be less than
/// what vectors of twice the length are.
fn plausible(convention: &MotionConvention, plane: &Plane<[f32; 2]>) -> bool {
    let (mut sum, mut count) = (0.0, 0usize);
    for v in plane.data().iter().filter(|v| v.iter().all(|v| v.is_finite())) {
        let [x, y] = convention.offset(*v, plane.size());
        sum += f64::from(x.hypot(y));
        count += 1;
    }
    sum <= FARTHEST * plane.size().width as f64 * count as f64
}

fn in_force(adapter: &Adapter, role: Role, pair: usize) -> Option<MotionConvention> {
    let known = adapter.vectors()?;
    match role {
        Role::Motion => known.get(pair).copied(),
        Role::MotionPrevious => known.into_iter().find(|c| c.direction == Direction::Previous),
        Role::MotionNext => known.into_iter().find(|c| c.direction == Direction::Next),
        _ => None,
    }
}

fn guides<'a>(look: &'a Look, vectors: &'a Plane<[f32; 2]>) -> MotionGuides<'a> {
    MotionGuides {
        vectors,
        position: look.frame.position.as_ref(),
        depth: look.frame.depth.as_ref(),
        normal: look.frame.normal.as_ref(),
        // What glass and mirrors show moves otherwise, but on all else it is the surface's colour.
        albedo: look.frame.albedo.as_ref().or(look.frame.seen_albedo.as_ref()),
    }
}

fn mean_length(motion: &Plane<[f32; 2]>) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for v in motion.data().iter().filter(|v| v.iter().all(|v| v.is_finite())) {
        sum += f64::from(v[0].hypot(v[1]));
        count += 1;
    }
    if count == 0 { 0.0 } else { sum / count as f64 }
}
