//! Light and emission that change on surfaces at rest: signs that switch, lamps and shadows that move.

use super::finding::{Diagnosis, Figure, Finding, Severity};
use super::follow::Paths;
use super::look::Look;
use crate::driver::ranges;
use crate::roles::{Mapping, Role};
use quell::sequence::LightKind;
use quell::{Plane, Rgb, Size};

/// Pixels of a block's side, and how many of it must be followed.
const BLOCK: usize = 8;
const FOLLOWED: usize = 32;
/// A block's light has changed where its mean did by so many of its standard errors, and by this part of itself.
const ERRORS: f64 = 4.0;
const PART: f64 = 0.1;
/// Differences of light (of values in 0..1) that nobody sees.
const UNSEEN: f64 = 0.005;
/// Share of the blocks from which a change is reported.
const SHARE: f64 = 0.01;
/// Emission has changed where it lies this far outside of what is around its place in the other frame.
const EMISSION_PART: f32 = 0.25;
/// Share of the pixels, and how many at least: a small lamp that a pixel sees by chance is noise.
const EMISSION_SHARE: f64 = 2e-4;
const EMISSION_LEAST: usize = 12;
/// Blocks, fewer of which say nothing.
const LEAST: usize = 20;

/// What has changed in a pair of frames.
struct Change {
    later: i64,
    /// Share of what was followed.
    share: f64,
}

/// Changes between neighbouring frames.
#[derive(Default)]
pub(super) struct Changes {
    light: Vec<Change>,
    emission: Vec<Change>,
    /// There is a pass of diffuse light.
    diffuse: bool,
}

impl Changes {
    pub fn pair(&mut self, mapping: &Mapping, earlier: &Look, later: &Look, paths: &Paths) {
        // A frame that is held, or twice there, says nothing.
        if earlier.beauty == later.beauty {
            return;
        }
        let number = later.number;
        if let (Some(a), Some(b)) = (diffuse(earlier), diffuse(later)) {
            self.diffuse = true;
            let share = blocks(paths, &a, &b);
            self.light.extend(share.map(|share| Change { later: number, share }));
        }
        if let (Some(a), Some(b)) = (emission(mapping, earlier), emission(mapping, later)) {
            self.emission.push(Change { later: number, share: switched(paths, &a, &b) });
        }
    }

    pub fn judge(&self, mapping: &Mapping, found: &mut Diagnosis) {
        if self.light.is_empty() {
            let why = if self.diffuse {
                "no neighbouring frames show enough surfaces at rest"
            } else {
                "no two neighbouring frames have a pass of diffuse light and known surfaces"
            };
            found.cannot("whether light changes on surfaces at rest", why);
        } else {
            report(
                &self.light,
                SHARE,
                Finding::new(
                    "light.changes",
                    Severity::Note,
                    "light on surfaces at rest changes: lamps or shadows move, or lamps are switched",
                )
                .channel(super::look::name_of(mapping, Role::MatteDirect)),
                "of the blocks of 8x8 pixels at rest have other diffuse light than in the frame before, beyond its noise and by more than 10 %",
                found,
            );
        }
        if !self.emission.is_empty() {
            report(
                &self.emission,
                EMISSION_SHARE,
                Finding::new(
                    "emission.changes",
                    Severity::Note,
                    "emission of surfaces at rest changes: signs, screens or lamps are switched",
                )
                .channel(super::look::name_of(mapping, Role::Emission)),
                "of the pixels at rest emit other light than in the frame before",
                found,
            );
        }
    }
}

fn report(changes: &[Change], least: f64, finding: Finding, what: &str, found: &mut Diagnosis) {
    let percent =
        |share: f64| if share < 0.001 { format!("{:.2} %", 100.0 * share) } else { format!("{:.1} %", 100.0 * share) };
    let most = changes.iter().max_by(|a, b| a.share.total_cmp(&b.share));
    let Some(most) = most else { return };
    let seen: Vec<i64> = changes.iter().filter(|c| c.share >= least).map(|c| c.later).collect();
    let Some(first) = seen.first() else {
        found.pass(finding.check, format!("at most {} {what} (frame {})", percent(most.share), most.later));
        return;
    };
    let evidence = format!(
        "{} {what} (frame {}, the most of {} pairs); it changes in frames {}",
        percent(most.share),
        most.later,
        changes.len(),
        ranges(&seen)
    );
    let figures =
        vec![Figure::new("share", most.share, ""), Figure::new("frames that change", seen.len() as f64, "frames")];
    found.findings.push(finding.frame(*first).evidence(evidence, figures).cure(
        "frames before and after show other light there and help less, so more noise is left; an old light that stays, or one \
         that comes early, is a fault of quell",
        "none needed; where everything changes at once (a lamp is switched), `denoise --cuts FRAME` separates before and after",
    ));
}

/// Brightness of all diffuse light without the surface's colour, between 0 and 1.
fn diffuse(look: &Look) -> Option<Plane<f32>> {
    let matte = |kind: LightKind| matches!(kind, LightKind::MatteDirect | LightKind::MatteIndirect);
    let lights: Vec<&Plane<Rgb>> = look.frame.lights.iter().filter(|l| matte(l.kind)).map(|l| &l.light).collect();
    if lights.is_empty() {
        return None;
    }
    Some(Plane::from_fn(look.frame.size, |x, y| {
        let sum: f32 = lights.iter().map(|light| light.at(x, y).iter().map(|v| v.max(0.0)).sum::<f32>()).sum();
        if sum.is_finite() { sum / (1.0 + sum) } else { f32::NAN }
    }))
}

fn emission(mapping: &Mapping, look: &Look) -> Option<Plane<f32>> {
    let name = &mapping.get(Role::Emission)?.name;
    let light = look.frame.lights.iter().find(|light| light.name == *name)?;
    Some(Plane::from_fn(look.frame.size, |x, y| light.light.at(x, y).iter().sum()))
}

/// Share of the blocks at rest whose light has changed.
fn blocks(paths: &Paths, earlier: &Plane<f32>, later: &Plane<f32>) -> Option<f64> {
    let Size { width, height } = later.size();
    let change = paths.change(earlier, later);
    let (mut all, mut changed) = (0usize, 0usize);
    for (by, bx) in (0..height / BLOCK).flat_map(|y| (0..width / BLOCK).map(move |x| (y, x))) {
        let (mut sum, mut light, mut count) = (0.0, 0.0, 0usize);
        let (mut squares, mut pairs) = (0.0, 0usize);
        for (y, x) in (by * BLOCK..(by + 1) * BLOCK).flat_map(|y| (bx * BLOCK..(bx + 1) * BLOCK).map(move |x| (y, x))) {
            let d = f64::from(change.at(x, y));
            if !d.is_finite() {
                continue;
            }
            sum += d;
            light += f64::from(later.at(x, y)) - 0.5 * d;
            count += 1;
            let beside = if x + 1 < (bx + 1) * BLOCK { f64::from(change.at(x + 1, y)) } else { f64::NAN };
            if beside.is_finite() {
                squares += (d - beside).powi(2);
                pairs += 1;
            }
        }
        if count < FOLLOWED || pairs == 0 {
            continue;
        }
        all += 1;
        let n = count as f64;
        let error = (squares / (2.0 * pairs as f64) / n).sqrt();
        changed += usize::from((sum / n).abs() > ERRORS * error + PART * light / n + UNSEEN);
    }
    (all >= LEAST).then(|| changed as f64 / all as f64)
}

/// Share of the pixels at rest whose emission has changed: now or before it lies outside of what is around its place in
/// the other frame.
fn switched(paths: &Paths, earlier: &Plane<f32>, later: &Plane<f32>) -> f64 {
    let Size { width, height } = later.size();
    let outside = |value: f32, other: &Plane<f32>, (x, y): (usize, usize)| {
        let (mut least, mut most) = (f32::INFINITY, 0.0f32);
        for v in y.saturating_sub(1)..(y + 2).min(height) {
            for u in x.saturating_sub(1)..(x + 2).min(width) {
                least = least.min(other.at(u, v));
                most = most.max(other.at(u, v));
            }
        }
        let limit = EMISSION_PART * value.max(most) + UNSEEN as f32;
        value > most + limit || value < least - limit
    };
    let (mut all, mut changed) = (0usize, 0usize);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let Some((u, v)) = paths.before(x, y) else { continue };
        all += 1;
        changed += usize::from(outside(later.at(x, y), earlier, (u, v)) || outside(earlier.at(u, v), later, (x, y)));
    }
    if changed < EMISSION_LEAST { 0.0 } else { changed as f64 / all.max(1) as f64 }
}
