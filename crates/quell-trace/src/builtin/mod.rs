//! Scenes made by code. Each stresses one thing; each has cameras 1 to 5 on different paths.

mod cornell_box;
mod disocclusion;
mod furnace;
mod glossy_room;
mod lights_out;
mod mirror_ball;
mod mirror_hall;
mod moving_lamps;
mod parts;
mod soft_bodies;
mod thin_things;

use crate::scene::{Scene, SceneError};

/// What is known of a built-in scene before it is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneInfo {
    /// Name on the command line.
    pub name: &'static str,
    /// What the scene is for, in one line.
    pub stresses: &'static str,
    /// Frames of the sequence by default.
    pub frames: usize,
    /// Suggested exposure: multiplies light before the tone curve.
    pub exposure: f32,
    /// Number of cameras, counted from 1.
    pub cameras: usize,
}

/// A scene's description, the function that makes it, and its source text, which its identity is hashed from.
struct Builtin {
    info: SceneInfo,
    build: fn() -> Scene,
    sources: &'static [&'static str],
}

const BUILTIN: &[Builtin] = &[
    Builtin { info: cornell_box::INFO, build: cornell_box::build, sources: &[include_str!("cornell_box.rs")] },
    Builtin { info: glossy_room::INFO, build: glossy_room::build, sources: &[include_str!("glossy_room.rs")] },
    Builtin { info: mirror_hall::INFO, build: mirror_hall::build, sources: &[include_str!("mirror_hall.rs")] },
    Builtin { info: disocclusion::INFO, build: disocclusion::build, sources: &[include_str!("disocclusion.rs")] },
    Builtin { info: lights_out::INFO, build: lights_out::build, sources: &[include_str!("lights_out.rs")] },
    Builtin { info: thin_things::INFO, build: thin_things::build, sources: &[include_str!("thin_things.rs"), PARTS] },
    Builtin {
        info: moving_lamps::INFO,
        build: moving_lamps::build,
        sources: &[include_str!("moving_lamps.rs"), PARTS],
    },
    Builtin { info: soft_bodies::INFO, build: soft_bodies::build, sources: &[include_str!("soft_bodies.rs"), PARTS] },
    Builtin { info: mirror_ball::INFO, build: mirror_ball::build, sources: &[include_str!("mirror_ball.rs"), PARTS] },
    Builtin { info: furnace::INFO, build: furnace::build, sources: &[include_str!("furnace.rs")] },
];

const PARTS: &str = include_str!("parts.rs");

/// What all built-in scenes are made with: a change there changes them.
const SHARED_SOURCES: [&str; 2] = [include_str!("../shapes.rs"), include_str!("../pattern.rs")];

static INFOS: [SceneInfo; BUILTIN.len()] = {
    let mut infos = [BUILTIN[0].info; BUILTIN.len()];
    let mut i = 0;
    while i < BUILTIN.len() {
        infos[i] = BUILTIN[i].info;
        i += 1;
    }
    infos
};

/// All built-in scenes, in the order of `evaluation.md`.
pub fn builtin_scenes() -> &'static [SceneInfo] {
    &INFOS
}

/// Makes a built-in scene.
///
/// # Errors
/// [`SceneError::UnknownScene`] with the nearest names.
pub fn builtin(name: &str) -> Result<Scene, SceneError> {
    let Some(found) = BUILTIN.iter().find(|b| b.info.name == name) else {
        let mut by_distance: Vec<_> =
            INFOS.iter().map(|info| (edit_distance(&name.to_lowercase(), info.name), info.name)).collect();
        by_distance.sort();
        let limit = (name.chars().count() / 2).max(2);
        let nearest = by_distance
            .iter()
            .filter(|(distance, known)| *distance <= limit || (!name.is_empty() && known.contains(name)))
            .map(|(_, known)| (*known).to_owned())
            .take(3)
            .collect();
        let known = INFOS.map(|info| info.name).join(", ");
        return Err(SceneError::UnknownScene { name: name.to_owned(), nearest, known });
    };
    let mut scene = (found.build)();
    scene.name = found.info.name.to_owned();
    scene.frames = found.info.frames;
    scene.exposure = found.info.exposure;
    let mut identity = crate::hash::Hash::new();
    for source in SHARED_SOURCES.iter().chain(found.sources) {
        identity.text(&without_defaults(source));
    }
    scene.identity = identity.finish();
    Ok(scene)
}

/// A source text without the places where a literal fills the rest with defaults: a field that a type gains later does
/// not change the scenes that do not set it.
fn without_defaults(source: &str) -> String {
    const REST: &str = "..Default::default()";
    let inline = format!(", {REST}");
    source.lines().filter(|line| line.trim() != REST).map(|line| line.replace(&inline, "") + "\n").collect()
}

/// Fewest insertions, deletions and replacements of a character that turn one name into the other.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let replace = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = replace.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_names_are_answered_with_the_nearest() {
        let Err(SceneError::UnknownScene { nearest, known, .. }) = builtin("cornel-box") else {
            unreachable!("the name does not exist")
        };
        assert_eq!(nearest, ["cornell-box"]);
        assert!(known.contains("cornell-box"));
        assert!(builtin("").is_err());
    }

    #[test]
    fn every_scene_is_as_described() {
        for info in builtin_scenes() {
            let scene = builtin(info.name).unwrap();
            assert_eq!(scene.cameras.len(), info.cameras, "{}", info.name);
            assert_eq!(info.cameras, 5, "{}", info.name);
            assert!(info.frames >= 64, "{}", info.name);
            assert!(info.stresses.len() < 100 && !info.stresses.is_empty());
            assert_ne!(scene.identity, 0);
        }
    }
}
