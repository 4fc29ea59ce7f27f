//! Several files a frame: which pass each of them is, by what their names do not share.

use super::names::Stem;
use crate::error::Error;
use crate::roles::Aliases;

/// Signs between the words of a name. The zero stands for the frame number.
const SEPARATORS: [char; 5] = ['.', '_', '-', '/', '\0'];

/// The pass of each stem, or nothing where names say none.
pub(super) fn tell(stems: &[&Stem]) -> Result<Option<Vec<String>>, Error> {
    let aliases = Aliases::built_in()?;
    let texts: Vec<String> = stems
        .iter()
        .map(|stem| {
            let folder = stem.folder.to_string_lossy().replace('\\', "/");
            let after = stem.after.strip_suffix(".exr").unwrap_or(&stem.after);
            let before = stem.before.strip_suffix(".exr").unwrap_or(&stem.before);
            format!("/{folder}/{before}\0{after}")
        })
        .collect();
    // Words that all share may still be part of a pass (`shot.diffuse_direct`, `shot.diffuse_indirect`): every cut at a
    // separator is tried, and the one wins by which most names are known.
    let prefix = shared(&texts, |text| text.chars().collect());
    let suffix = shared(&texts, |text| text.chars().rev().collect());
    let cuts = |shared: &[char]| -> Vec<usize> {
        let mut cuts: Vec<usize> =
            (0..shared.len()).filter(|i| SEPARATORS.contains(&shared[*i])).map(|i| i + 1).collect();
        cuts.insert(0, 0);
        cuts.reverse();
        // A name without a pass ends where the others go on.
        cuts.insert(0, shared.len());
        cuts.truncate(6);
        cuts
    };
    let mut best: Option<(usize, Vec<String>)> = None;
    for head in cuts(&prefix) {
        for tail in cuts(&suffix) {
            let passes: Vec<String> = texts
                .iter()
                .map(|text| {
                    let all: Vec<char> = text.chars().collect();
                    let to = all.len().saturating_sub(tail).max(head.min(all.len()));
                    let middle: String = all.get(head..to).unwrap_or_default().iter().collect();
                    middle.trim_matches(SEPARATORS).replace(['/', '\0'], ".")
                })
                .collect();
            let mut different = passes.clone();
            different.sort();
            different.dedup();
            if different.len() != passes.len() {
                continue;
            }
            if !passes.iter().any(|pass| aliases.knows(pass)) {
                continue;
            }
            // One word says more than a path that ends in one; one file may be without a word.
            let points = |pass: &String| match pass {
                pass if pass.is_empty() => 1,
                pass if !aliases.knows(pass) => 0,
                pass if pass.contains('.') => 1,
                _ => 2,
            };
            let points = passes.iter().map(points).sum();
            if best.as_ref().is_none_or(|(most, _)| points > *most) {
                best = Some((points, passes));
            }
        }
    }
    Ok(best.map(|(_, passes)| passes))
}

/// The characters with which all texts begin.
fn shared(texts: &[String], order: impl Fn(&str) -> Vec<char>) -> Vec<char> {
    let mut texts = texts.iter().map(|text| order(text));
    let mut shared = texts.next().unwrap_or_default();
    for text in texts {
        let same = shared.iter().zip(&text).take_while(|(a, b)| a == b).count();
        shared.truncate(same);
    }
    shared
}
