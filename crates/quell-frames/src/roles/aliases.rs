//! The alias table: which names mean what.

use super::role::Role;
use crate::error::Error;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// The table that comes with the crate.
pub const ALIASES: &str = include_str!("aliases.toml");

/// Directions of a normal or a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Space {
    /// World space.
    #[default]
    World,
    /// Camera space: x right, y up, z towards the viewer.
    Camera,
    /// Camera space: x right, y up, z into the scene.
    CameraForward,
}

/// What a depth channel holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthKind {
    /// Distance along the camera's axis.
    #[default]
    Planar,
    /// Distance along the pixel's ray.
    Ray,
    /// 1 / planar distance.
    Inverse,
}

/// One renderer: its names and its conventions.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Renderer {
    /// Its name.
    pub name: String,
    /// Texts in header attributes that identify it.
    #[serde(default)]
    pub attributes: Vec<String>,
    /// Pass names that identify it.
    #[serde(default)]
    pub marks: Vec<String>,
    /// Is the surface's colour in the light passes?
    pub colour_inside: Option<bool>,
    /// Space of normals.
    #[serde(default)]
    pub normal: Space,
    /// Space of `seen_normal`.
    #[serde(default)]
    pub seen_normal: Space,
    /// Space of positions.
    #[serde(default)]
    pub position: Space,
    /// Kind of depth.
    #[serde(default)]
    pub depth: DepthKind,
    /// Motion preset.
    #[serde(default)]
    pub motion: String,
    #[serde(default)]
    roles: BTreeMap<String, Vec<String>>,
}

/// All renderers.
#[derive(Clone, Debug, PartialEq)]
pub struct Aliases {
    renderers: Vec<Renderer>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    renderer: Vec<Renderer>,
}

/// A name found in the table.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Found {
    pub role: Role,
    /// Position in the role's list, those of the renderer before those of any; smaller is better.
    pub rank: usize,
    pub renderer: String,
    pub alias: String,
    /// Words of the path that the alias took.
    pub words: usize,
    /// What stood for the `*`.
    pub rest: String,
}

impl Aliases {
    /// The table that comes with the crate.
    ///
    /// # Errors
    /// None in practice: a test reads it.
    pub fn built_in() -> Result<Self, Error> {
        Self::parse(ALIASES, Path::new("aliases.toml"))
    }

    /// A table of the user's own, asked before the one of the crate.
    ///
    /// # Errors
    /// [`Error::Invalid`] where it is no such table, [`Error::Io`].
    pub fn with_file(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, "read", e))?;
        let mut own = Self::parse(&text, path)?;
        for renderer in Self::built_in()?.renderers {
            match own.renderers.iter_mut().find(|r| r.name == renderer.name) {
                None => own.renderers.push(renderer),
                Some(mine) => {
                    for (role, names) in renderer.roles {
                        mine.roles.entry(role).or_default().extend(names);
                    }
                    mine.marks.extend(renderer.marks);
                    mine.attributes.extend(renderer.attributes);
                }
            }
        }
        Ok(own)
    }

    fn parse(text: &str, path: &Path) -> Result<Self, Error> {
        let table: Table = toml::from_str(text).map_err(|e| Error::invalid(path, e.to_string()))?;
        for renderer in &table.renderer {
            if let Some(unknown) = renderer.roles.keys().find(|role| Role::from_name(role).is_none()) {
                let reason =
                    format!("renderer `{}`: `{unknown}` is no role; roles are {}", renderer.name, role_names());
                return Err(Error::invalid(path, reason));
            }
        }
        Ok(Self { renderers: table.renderer })
    }

    /// Every name that a renderer, or any, may give a pass, with its role.
    pub(crate) fn names(&self, renderer: &str) -> Vec<(Role, &str)> {
        let tables = self.renderers.iter().filter(|r| r.name == renderer || r.name == "any");
        let roles = tables.flat_map(|r| &r.roles);
        roles
            .filter_map(|(role, names)| Some((Role::from_name(role)?, names)))
            .flat_map(|(role, names)| names.iter().map(move |name| (role, name.as_str())))
            .collect()
    }

    /// The renderers that the table knows.
    pub fn renderers(&self) -> &[Renderer] {
        &self.renderers
    }

    /// The renderer of that name.
    pub fn renderer(&self, name: &str) -> Option<&Renderer> {
        self.renderers.iter().find(|r| r.name == name)
    }

    /// Who wrote a file: by texts of header attributes first, then by most marks among the pass names.
    pub(super) fn detect(&self, attributes: &[String], passes: &[Vec<String>]) -> (&str, String) {
        for renderer in &self.renderers {
            for text in &renderer.attributes {
                if let Some(found) = attributes.iter().find(|a| a.to_lowercase().contains(text)) {
                    let found: String = found.chars().take(60).collect();
                    return (&renderer.name, format!("header says `{found}`"));
                }
            }
        }
        let marks = |renderer: &Renderer| -> Vec<String> {
            renderer
                .marks
                .iter()
                .filter(|mark| {
                    // Marks are few and short: case separates `Ns` of pbrt from `ns` of anybody.
                    let words: Vec<&str> = mark.split('.').collect();
                    passes.iter().any(|path| path.len() >= words.len() && path[path.len() - words.len()..] == words[..])
                })
                .cloned()
                .collect()
        };
        let mut best: (&str, Vec<String>) = ("any", Vec::new());
        for renderer in &self.renderers {
            let found = marks(renderer);
            // One name alone is not enough to identify a renderer.
            if found.len() > best.1.len().max(1) {
                best = (&renderer.name, found);
            }
        }
        let why =
            if best.1.is_empty() { "nothing tells it".to_owned() } else { format!("passes {}", best.1.join(", ")) };
        (best.0, why)
    }

    /// What a pass is by the last words of its path, for a renderer and then for any.
    pub(super) fn find(&self, renderer: &str, path: &[String]) -> Option<Found> {
        let mut best: Option<Found> = None;
        for (penalty, table) in [(0, renderer), (1000, "any")] {
            let Some(table) = self.renderer(table) else { continue };
            for (role, names) in &table.roles {
                let Some(role) = Role::from_name(role) else { continue };
                for (rank, alias) in names.iter().enumerate() {
                    let Some((words, rest)) = matches(alias, path) else { continue };
                    let found = Found {
                        role,
                        rank: rank + penalty,
                        renderer: table.name.clone(),
                        alias: alias.clone(),
                        words,
                        rest,
                    };
                    // A longer and more exact name says more: `Combined` before `Combined_*`.
                    let key = |f: &Found| (f.words, f.rest.is_empty());
                    if best.as_ref().is_none_or(|b| key(&found) > key(b)) {
                        best = Some(found);
                    }
                }
            }
            if best.is_some() {
                return best;
            }
        }
        best
    }

    /// True where some renderer has motion under that name.
    pub(crate) fn is_motion(&self, pass: &str) -> bool {
        let path: Vec<String> = pass.split('.').map(str::to_owned).collect();
        self.renderers.iter().any(|r| self.find(&r.name, &path).is_some_and(|found| found.role == Role::Motion))
    }

    /// True where some renderer has a pass of that name.
    pub(crate) fn knows(&self, pass: &str) -> bool {
        let path: Vec<String> = pass.split('.').map(str::to_owned).collect();
        !pass.is_empty() && self.renderers.iter().any(|r| self.find(&r.name, &path).is_some())
    }
}

pub(super) fn role_names() -> String {
    Role::ALL.iter().map(|r| r.name()).collect::<Vec<_>>().join(", ")
}

fn plain(word: &str) -> String {
    word.chars().filter(|c| !matches!(c, ' ' | '_' | '-')).flat_map(char::to_lowercase).collect()
}

/// How many words of the path's end the alias takes, and what stands for its `*`.
fn matches(alias: &str, path: &[String]) -> Option<(usize, String)> {
    if alias.is_empty() {
        return path.is_empty().then(|| (0, String::new()));
    }
    let words: Vec<&str> = alias.split('.').collect();
    let tail = path.len().checked_sub(words.len()).and_then(|from| path.get(from..))?;
    let mut rest = String::new();
    for (i, (word, found)) in words.iter().zip(tail).enumerate() {
        if let (true, Some(stem)) = (i + 1 == words.len(), word.strip_suffix('*')) {
            let found_plain = plain(found);
            let behind = found_plain.strip_prefix(&plain(stem))?;
            if behind.is_empty() {
                return None;
            }
            // The group's own name with its case and signs, where the stem stands unchanged.
            rest = found.get(stem.len()..).unwrap_or(behind).to_owned();
        } else if plain(word) != plain(found) {
            return None;
        }
    }
    Some((words.len(), rest))
}
