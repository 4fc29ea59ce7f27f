//! Which passes there are: missing ones, names that nearly fit, sums that do not add up, colour where there should be none.

use super::finding::{Diagnosis, Figure, Finding, Severity};
use super::look::{Look, name_of};
use crate::adapt::Adapter;
use crate::roles::{Aliases, MapOptions, Mapping, Role};
use quell::sequence::LightKind;
use quell::{Plane, Rgb, Size};

/// Light that follows the surface's colour with this slope (of logarithms) holds it; 0: does not.
const SLOPE: f64 = 0.5;
/// Pixels on whose two sides the colour differs.
const EDGES: usize = 200;

/// Guides that are missing, and names that nearly fit.
///
/// Returns the roles that a misnamed pass may have.
pub(super) fn names(mapping: &Mapping, options: &MapOptions, found: &mut Diagnosis) -> Vec<Role> {
    let aliases = match &options.aliases {
        Some(path) => Aliases::with_file(path),
        None => Aliases::built_in(),
    };
    let before = found.findings.len();
    // What the user has decided is no finding.
    let decided = options.map.iter().filter_map(|wish| Role::from_name(wish.split_once('=')?.0));
    let mut explained: Vec<Role> = decided.collect();
    let asked = explained.len();
    if let Ok(aliases) = aliases {
        let known = aliases.names(&mapping.renderer.name);
        for other in &mapping.others {
            let last = other.rsplit('.').next().unwrap_or(other);
            let Some((role, alias)) = near_miss(last, &known, mapping) else { continue };
            if explained.contains(&role) || beside(mapping, role) {
                continue;
            }
            explained.push(role);
            let severity = if matches!(
                role,
                Role::Motion | Role::MotionPrevious | Role::MotionNext | Role::Beauty | Role::Normal | Role::Depth
            ) {
                Severity::Fault
            } else {
                Severity::Warning
            };
            found.findings.push(
                Finding::new("passes.renamed", severity, format!("`{other}` may be the {role}: it is not used"))
                    .channel(other)
                    .evidence(format!("its name is nearly `{alias}`, and no pass is the {role}"), Vec::new())
                    .cure(
                        "the filter does without it",
                        format!("--map {role}={last}, or give the pass its usual name"),
                    ),
            );
        }
    }
    let guide = |roles: &[Role]| roles.iter().any(|r| mapping.get(*r).is_some() || explained.contains(r));
    let normal = guide(&[Role::Normal]);
    let depth = guide(&[Role::Depth, Role::Position]);
    let colour = guide(&[Role::Albedo, Role::MatteColour, Role::SeenAlbedo]);
    let lacks: Vec<&str> = [(normal, "normal"), (depth, "depth or position"), (colour, "albedo or colour")]
        .into_iter()
        .filter(|(there, _)| !there)
        .map(|(_, name)| name)
        .collect();
    if !lacks.is_empty() {
        let severity = if lacks.len() == 3 { Severity::Fault } else { Severity::Warning };
        found.findings.push(
            Finding::new("passes.missing", severity, format!("there is no {}", lacks.join(", no ")))
                .evidence(
                    format!("passes that were found: {}", listed(mapping)),
                    vec![Figure::new("missing guides", lacks.len() as f64, "passes")],
                )
                .cure(
                    "edges that only this pass shows are blurred, or kept noisy",
                    "switch the passes on (Blender: View Layer > Passes > Data: Combined, Z, Normal, Vector, Denoising Data; Light: all), or name \
                     them with --map ROLE=CHANNEL",
                ),
        );
    }
    if mapping.passes.iter().any(|p| p.role == Role::Beauty && p.name.ends_with("Noisy Image")) {
        found.findings.push(
            Finding::new(
                "input.denoised_beside",
                Severity::Note,
                "the renderer denoised, and kept the noisy picture beside its result",
            )
            .channel(name_of(mapping, Role::Beauty))
            .evidence("`Noisy Image` is in the file: quell filters that, and writes it to `Combined` too", Vec::new())
            .cure("nothing; it costs rendering time", "switch denoising off: Render > Sampling > Render > Denoise"),
        );
    }
    if found.findings.len() == before {
        found.pass("passes", format!("{} passes have a role: {}", mapping.passes.len(), listed(mapping)));
    }
    explained.split_off(asked)
}

fn listed(mapping: &Mapping) -> String {
    let mut roles: Vec<&str> = mapping.passes.iter().map(|p| p.role.name()).collect();
    roles.dedup();
    roles.join(", ")
}

/// True where the role is there under another role's name: depth beside positions, sums beside their parts.
fn beside(mapping: &Mapping, role: Role) -> bool {
    if mapping.get(role).is_some() {
        return true;
    }
    let twins: &[Role] = match role {
        Role::Motion => &[Role::MotionPrevious, Role::MotionNext],
        Role::MotionPrevious | Role::MotionNext => &[Role::Motion],
        Role::Albedo => &[Role::MatteColour],
        _ => &[],
    };
    twins.iter().any(|twin| mapping.get(*twin).is_some())
}

/// The role whose usual name is nearly this one, where no pass has that role.
fn near_miss<'a>(name: &str, known: &[(Role, &'a str)], mapping: &Mapping) -> Option<(Role, &'a str)> {
    let plain = |word: &str| -> Vec<char> {
        word.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
    };
    let here = plain(name);
    let mut best: Option<(usize, Role, &str)> = None;
    for (role, alias) in known {
        if alias.contains('*') || mapping.get(*role).is_some() || role.repeats() {
            continue;
        }
        let there = plain(alias);
        // Names of one or two letters are near to everything.
        if there.len() < 4 || here.len() < 3 {
            continue;
        }
        let digits = here.iter().rev().take_while(|c| c.is_ascii_digit()).count();
        let stem = here.get(..here.len() - digits).unwrap_or(&here);
        let contains = (here.starts_with(&there) || here.ends_with(&there)) && here.len() <= there.len() + 6;
        let allowed = if there.len() < 7 { 1 } else { 2 };
        let distance = distance(stem, &there);
        let score = if stem == there.as_slice() {
            0
        } else if distance <= allowed {
            distance
        } else if contains {
            3
        } else {
            continue;
        };
        if best.is_none_or(|(s, ..)| score < s) {
            best = Some((score, *role, alias));
        }
    }
    best.map(|(_, role, alias)| (role, alias))
}

/// Letters to insert, leave out, change or swap with the next one (Damerau and Levenshtein).
fn distance(a: &[char], b: &[char]) -> usize {
    let width = b.len() + 1;
    let mut rows: Vec<Vec<usize>> = vec![(0..width).collect()];
    for i in 1..=a.len() {
        let mut row = vec![i; width];
        for j in 1..width {
            let change = usize::from(a[i - 1] != b[j - 1]);
            let mut least = (rows[i - 1][j] + 1).min(row[j - 1] + 1).min(rows[i - 1][j - 1] + change);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(rows[i - 2][j - 2] + 1);
            }
            row[j] = least;
        }
        rows.push(row);
    }
    rows.last().and_then(|row| row.last()).copied().unwrap_or(usize::MAX)
}

/// Do the passes add up, and is the surface's colour where it is expected?
pub(super) fn sums(adapter: &Adapter, table: &Mapping, look: &Look, found: &mut Diagnosis) {
    let rule = adapter.rule();
    let expected = table.renderer.colour_inside;
    let renderer = &table.renderer.name;
    let place = |inside: bool| if inside { "holds the surface's colour" } else { "is without the surface's colour" };
    if let Some([outside, inside]) = rule.residual
        && rule.factored
    {
        let figures = vec![
            Figure::new("difference, colours multiplied", outside * 100.0, "%"),
            Figure::new("difference, light alone", inside * 100.0, "%"),
        ];
        let text = format!(
            "the sum of passes differs from the beauty by {:.2} % with colours multiplied, {:.2} % without (tone-mapped, mean)",
            outside * 100.0,
            inside * 100.0
        );
        if !rule.complete {
            let denoised = table.all(Role::Beauty).count() == 1 && found.has("input.denoised");
            let why = if denoised {
                "the beauty was denoised, its passes were not"
            } else {
                "a pass is missing, or one holds something else"
            };
            found.findings.push(
                Finding::new("passes.sum", Severity::Warning, "the light passes do not add up to the beauty")
                    .frame(look.number)
                    .channel(name_of(table, Role::Beauty))
                    .evidence(format!("{text}; {why}"), figures)
                    .cure(
                        "what is missing is filtered as one more light, without a colour of its own: textures in it blur",
                        "switch every light pass on, or name those that were not recognised with --map; `quell denoise --dry-run` lists what was taken \
                         for what",
                    ),
            );
        } else if expected.is_some_and(|e| e != rule.colour_inside) && (outside - inside).abs() > 0.02 {
            found.findings.push(
                Finding::new(
                    "light.colour",
                    Severity::Note,
                    format!("light {}, unlike what {renderer} usually writes", place(rule.colour_inside)),
                )
                .frame(look.number)
                .evidence(text, figures)
                .cure("nothing: quell has noticed from the beauty", "none needed"),
            );
        } else {
            found.pass("passes.sum", text);
        }
        return;
    }
    if !rule.factored || table.get(Role::Beauty).is_some() {
        return;
    }
    // Without a beauty nothing says which rule holds, but light that follows the colour's edges does.
    let Some((slope, pixels)) = slope(look) else {
        found.cannot(
            "whether light passes hold the surface's colour",
            "there is no beauty to add them up to, and too few edges of colour on smooth surfaces",
        );
        return;
    };
    // The slope is measured on light as quell would filter it: it should have none.
    if slope.abs() < SLOPE {
        found.pass(
            "light.colour",
            format!("light that is filtered follows the surface's colour with a slope of {slope:.2} (none: 0)"),
        );
        return;
    }
    let inside = slope > 0.0;
    found.findings.push(
        Finding::new("light.colour", Severity::Fault, format!("light {}, and nothing says so", place(inside)))
            .frame(look.number)
            .evidence(
                format!("across edges of colour on one surface, light changes with the colour by a power of {slope:.2} ({pixels} pairs of pixels; expected 0)"),
                vec![Figure::new("slope", slope, "")],
            )
            .cure(
                if inside { "textures are blurred with the noise, and colour counts twice in the sum" } else { "textures are pressed into the light, and filtered away" },
                format!(
                    "write the beauty too: it tells; or say so in a file for --aliases: [[renderer]] name = \"{renderer}\" colour_inside = {inside}"
                ),
            ),
    );
}

/// Slope of log light against log colour across edges of colour where geometry is smooth; of diffuse light.
fn slope(look: &Look) -> Option<(f64, usize)> {
    let frame = &look.frame;
    let albedo = frame.albedo.as_ref()?;
    let matte = frame.lights.iter().filter(|l| matches!(l.kind, LightKind::MatteDirect | LightKind::MatteIndirect));
    let mut light: Option<Plane<Rgb>> = None;
    let mut colour: Option<&Plane<Rgb>> = None;
    for one in matte {
        colour = colour.or(one.weight.as_deref());
        match &mut light {
            None => light = Some(one.light.clone()),
            Some(sum) => {
                for (a, b) in sum.data_mut().iter_mut().zip(one.light.data()) {
                    *a = [0, 1, 2].map(|c| a[c] + b[c]);
                }
            }
        }
    }
    let (light, colour) = (light?, colour.unwrap_or(albedo));
    let Size { width, height } = frame.size;
    let (mut xy, mut xx, mut count) = (0.0, 0.0, 0usize);
    // Means of 3x3 on both sides: noise averages out, and is the same for both signs of the edge anyway.
    let mean = |plane: &Plane<Rgb>, x: usize, y: usize, c: usize| {
        let mut sum = 0.0;
        for v in y - 1..=y + 1 {
            for u in x - 1..=x + 1 {
                let value = plane.at(u, v)[c];
                sum += if value.is_finite() { value.max(0.0) } else { 0.0 };
            }
        }
        f64::from(sum / 9.0)
    };
    let step = (frame.size.pixels() / 60_000).max(1);
    for i in (0..frame.size.pixels()).step_by(step) {
        let (x, y) = (i % width, i / width);
        if x < 6 || y < 6 || x + 6 >= width || y + 6 >= height {
            continue;
        }
        for (dx, dy) in [(3, 0), (0, 3)] {
            let (p, q) = ((x - dx, y - dy), (x + dx, y + dy));
            let one_surface = |a: (usize, usize), b: (usize, usize)| {
                let n = frame
                    .normal
                    .as_ref()
                    .is_none_or(|n| (0..3).all(|c| (n.at(a.0, a.1)[c] - n.at(b.0, b.1)[c]).abs() < 0.05));
                let d = frame.depth.as_ref().is_none_or(|d| {
                    let (a, b) = (d.at(a.0, a.1), d.at(b.0, b.1));
                    a.is_finite() && b.is_finite() && (a - b).abs() < 0.05 * a
                });
                n && d
            };
            if !one_surface(p, q) || !one_surface((x, y), p) {
                continue;
            }
            for c in 0..3 {
                let [ca, cb] = [p, q].map(|s| mean(colour, s.0, s.1, c));
                let [la, lb] = [p, q].map(|s| mean(&light, s.0, s.1, c));
                if ca.min(cb) < 0.02 || la.min(lb) <= 1e-4 {
                    continue;
                }
                let edge = (ca / cb).ln();
                if edge.abs() < 0.3 {
                    continue;
                }
                let change = (la / lb).ln().clamp(-3.0, 3.0);
                xy += edge * change;
                xx += edge * edge;
                count += 1;
            }
        }
    }
    (count >= EDGES).then(|| (xy / xx, count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_words() {
        let d = |a: &str, b: &str| distance(&a.chars().collect::<Vec<_>>(), &b.chars().collect::<Vec<_>>());
        assert_eq!(
            (d("normal", "normal"), d("normall", "normal"), d("noraml", "normal"), d("vector", "vectors")),
            (0, 1, 1, 1)
        );
        assert_eq!((d("", "abc"), d("abc", "")), (3, 3));
    }
}
