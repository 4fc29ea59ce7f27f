//! From channels to roles: what each pass is, and why.

use super::aliases::{Aliases, Found, Renderer, role_names};
use super::names::{Pass, collect};
use super::role::Role;
use crate::error::Error;
use crate::image::ExrImage;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// One channel of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ChannelId {
    /// Which of the frame's files.
    pub file: usize,
    /// Which part of it.
    pub part: usize,
    /// Which channel of that.
    pub channel: usize,
}

/// A pass that has a role.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapped {
    /// What it is.
    pub role: Role,
    /// Its name in the file, layer and view included.
    pub name: String,
    /// Its channels: R, G, B or X, Y, Z (, W) or one.
    pub channels: Vec<ChannelId>,
    /// The alpha beside a colour.
    pub alpha: Option<ChannelId>,
    /// Why: the alias and whose it is, or the user.
    pub why: String,
}

/// What the user asked for.
#[derive(Clone, Debug, Default)]
pub struct MapOptions {
    /// Only this view layer.
    pub layer: Option<String>,
    /// Only this stereo view.
    pub view: Option<String>,
    /// `ROLE=PASS` or `ROLE=CHANNEL,CHANNEL,CHANNEL`, or `ROLE=none`.
    pub map: Vec<String>,
    /// A table asked before the crate's own.
    pub aliases: Option<std::path::PathBuf>,
    /// Whose names and conventions the passes have; absent: found out.
    pub renderer: Option<String>,
}

/// What the passes of one view layer and one stereo view are.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapping {
    /// The view layer; empty where names have none.
    pub layer: String,
    /// The stereo view; empty where there is one only.
    pub view: String,
    /// The renderer's names and conventions.
    pub renderer: Renderer,
    /// How the renderer was recognised.
    pub renderer_why: String,
    /// The passes with a role.
    pub passes: Vec<Mapped>,
    /// Names of passes without a role: they go through untouched.
    pub others: Vec<String>,
}

impl Mapping {
    /// The pass of a role; of repeated roles the first, of several beauties the one that is read.
    pub fn get(&self, role: Role) -> Option<&Mapped> {
        self.passes.iter().find(|pass| pass.role == role)
    }

    /// The picture that the renderer denoised itself, beside the raw one that is read: Blender's `Combined` where there
    /// is a `Noisy Image`, which it writes with denoising on only.
    pub fn denoised(&self) -> Option<&Mapped> {
        let mut pictures = self.all(Role::Beauty);
        let raw = pictures.next()?;
        pictures.next().filter(|_| raw.name.to_ascii_lowercase().ends_with("noisy image"))
    }

    /// All passes of a role.
    pub fn all(&self, role: Role) -> impl Iterator<Item = &Mapped> {
        self.passes.iter().filter(move |pass| pass.role == role)
    }

    /// Every channel that [`crate::adapt`] reads: the others need not be read.
    pub fn channels(&self) -> BTreeSet<ChannelId> {
        let read = self.passes.iter().filter(|p| !matches!(p.role, Role::Cryptomatte | Role::SteadyPart | Role::Id));
        read.flat_map(|p| p.channels.iter().chain(&p.alpha)).copied().collect()
    }

    /// Lines for `-v` and for the attribute `quell.mapping`.
    pub fn describe(&self) -> String {
        let mut text = format!("renderer = {} ({})\n", self.renderer.name, self.renderer_why);
        for (word, value) in [("layer", &self.layer), ("view", &self.view)] {
            if !value.is_empty() {
                text += &format!("{word} = {value}\n");
            }
        }
        for pass in &self.passes {
            let name = if pass.name.is_empty() { "R G B" } else { &pass.name };
            text += &format!("{} = {name} ({})\n", pass.role, pass.why);
        }
        if !self.others.is_empty() {
            text += &format!("untouched = {}\n", self.others.join(", "));
        }
        text
    }
}

/// Finds what every pass is; one mapping for each view layer and stereo view.
///
/// `files` are the files of one frame with the pass name that each file's name holds (empty: none); headers are enough.
///
/// # Errors
/// [`Error::Invalid`] where two passes claim one role (both are named), where a role, layer, view, renderer or channel of
/// `options` is unknown (the known ones are listed), or where there is neither a beauty nor a complete set of lights.
pub fn map_roles(files: &[(String, &ExrImage)], options: &MapOptions) -> Result<Vec<Mapping>, Error> {
    let aliases = match &options.aliases {
        Some(path) => Aliases::with_file(path)?,
        None => Aliases::built_in()?,
    };
    let path = files.first().map_or_else(|| Path::new("").to_owned(), |(_, image)| image.path().to_owned());
    let passes = collect(files);
    let mut texts = Vec::new();
    for part in files.iter().flat_map(|(_, image)| image.parts()) {
        for (name, value) in part.attributes() {
            if let crate::image::AttributeValue::Text(text) = &value {
                texts.push(crate::exr_file::string(text));
            }
            texts.push(name);
        }
    }
    // Of files per pass the file's name decides.
    let name = |p: &Pass| if p.path.is_empty() { p.outer.clone() } else { p.path.clone() };
    let paths: Vec<Vec<String>> = passes.iter().map(name).collect();
    let (renderer, renderer_why) = match &options.renderer {
        Some(name) => (name.as_str(), "asked for".to_owned()),
        None => aliases.detect(&texts, &paths),
    };
    let known: Vec<String> = aliases.renderers().iter().map(|renderer| renderer.name.clone()).collect();
    if !known.iter().any(|name| name == renderer) {
        return Err(unknown(&path, "renderer", renderer, &known));
    }
    let renderer = aliases.renderer(renderer).cloned();
    let Some(renderer) = renderer else { return Err(Error::invalid(&path, "the alias table has no renderer `any`")) };

    let found: Vec<(Option<Found>, &Pass)> = passes
        .iter()
        .map(|pass| {
            let outer: Vec<String> = pass.outer.iter().chain(&pass.path).cloned().collect();
            let own = aliases.find(&renderer.name, &pass.path).filter(|f| f.words > 0);
            (own.or_else(|| aliases.find(&renderer.name, &outer)), pass)
        })
        .collect();
    let mut mappings = Vec::new();
    for (layer, view) in layers_and_views(&found, &path, options)? {
        let only = found.iter().filter(|(f, p)| p.view == view && in_layer(f.as_ref(), p, &layer.all)).collect();
        mappings.push(one_layer(&path, only, layer.name, view, &renderer, &renderer_why, files, options)?);
    }
    Ok(mappings)
}

/// A view layer, and the names before passes that count for it.
struct Layer {
    name: String,
    all: Vec<String>,
}

fn layer_of(found: Option<&Found>, pass: &Pass) -> String {
    let words = found.map_or(1, |f| f.words).min(pass.path.len());
    pass.path.get(..pass.path.len() - words).unwrap_or_default().join(".")
}

fn in_layer(found: Option<&Found>, pass: &Pass, layers: &[String]) -> bool {
    layers.contains(&layer_of(found, pass))
}

fn layers_and_views(
    found: &[(Option<Found>, &Pass)],
    path: &Path,
    options: &MapOptions,
) -> Result<Vec<(Layer, String)>, Error> {
    let mut views: Vec<String> = Vec::new();
    let mut layers: Vec<String> = Vec::new();
    let mut with_beauty: Vec<String> = Vec::new();
    for (f, pass) in found {
        let layer = layer_of(f.as_ref(), pass);
        if !views.contains(&pass.view) {
            views.push(pass.view.clone());
        }
        if f.as_ref().is_some_and(|f| f.role == Role::Beauty) && !with_beauty.contains(&layer) {
            with_beauty.push(layer.clone());
        }
        if !layers.contains(&layer) {
            layers.push(layer);
        }
    }
    // Blender's compositor writes its result beside the layers that it was made from.
    if with_beauty.len() > 1 {
        with_beauty.retain(|layer| layer != "Composite");
        layers.retain(|layer| layer != "Composite");
    }
    // A view with names and planes without any view beside it: those belong to every view.
    if views.len() > 1 {
        views.retain(|view| !view.is_empty());
    }
    if let Some(wanted) = &options.view {
        if !views.contains(wanted) {
            return Err(unknown(path, "view", wanted, &views));
        }
        views.retain(|view| view == wanted);
    }
    let mut chosen: Vec<Layer> = if with_beauty.len() > 1 {
        with_beauty.into_iter().map(|name| Layer { all: vec![name.clone()], name }).collect()
    } else {
        let name = with_beauty.pop().or_else(|| layers.first().cloned()).unwrap_or_default();
        vec![Layer { name, all: layers.clone() }]
    };
    if let Some(wanted) = &options.layer {
        if let Some(at) = chosen.iter().position(|layer| &layer.name == wanted) {
            chosen = vec![chosen.swap_remove(at)];
        } else if layers.contains(wanted) {
            chosen = vec![Layer { name: wanted.clone(), all: vec![wanted.clone()] }];
        } else {
            return Err(unknown(path, "view layer", wanted, &layers));
        }
    }
    let mut all = Vec::new();
    for view in views {
        all.extend(chosen.iter().map(|l| (Layer { name: l.name.clone(), all: l.all.clone() }, view.clone())));
    }
    Ok(all)
}

fn unknown(path: &Path, kind: &str, wanted: &str, known: &[String]) -> Error {
    let known: Vec<String> = known.iter().map(|name| format!("`{name}`")).collect();
    Error::invalid(path, format!("there is no {kind} `{wanted}`; there are {}", known.join(", ")))
}

#[expect(clippy::too_many_arguments, reason = "one caller; what a layer's mapping is made from")]
fn one_layer(
    path: &Path,
    found: Vec<&(Option<Found>, &Pass)>,
    layer: String,
    view: String,
    renderer: &Renderer,
    renderer_why: &str,
    files: &[(String, &ExrImage)],
    options: &MapOptions,
) -> Result<Mapping, Error> {
    let mut chosen: Vec<(Mapped, usize)> = Vec::new();
    let mut asked: BTreeSet<Role> = BTreeSet::new();
    for wish in &options.map {
        let (role, mapped) = wished(path, wish, &found, files)?;
        asked.insert(role);
        chosen.extend(mapped.map(|m| (m, 0)));
    }
    let mut others = Vec::new();
    for (f, pass) in &found {
        let taken = |m: &Mapped| pass.components.values().any(|c| m.channels.contains(c));
        if chosen.iter().any(|(m, _)| m.why == "asked for" && taken(m)) {
            continue;
        }
        let Some(f) = f.as_ref().filter(|f| !asked.contains(&f.role)) else {
            others.push(pass.name.clone());
            continue;
        };
        let Some((channels, alpha)) = components(f.role, &pass.components) else {
            others.push(pass.name.clone());
            continue;
        };
        let why = if f.alias.is_empty() {
            "channels without a layer".to_owned()
        } else {
            format!("`{}` of {}", f.alias, f.renderer)
        };
        let mapped = Mapped { role: f.role, name: pass.name.clone(), channels, alpha, why };
        if f.role.repeats() {
            chosen.push((mapped, f.rank));
            continue;
        }
        match chosen.iter().position(|(m, _)| m.role == f.role) {
            None => chosen.push((mapped, f.rank)),
            Some(at) => {
                let rank = chosen[at].1;
                if rank == f.rank {
                    let reason = format!(
                        "`{}` and `{}` may both be the {}; choose with --map {}=NAME",
                        chosen[at].0.name, mapped.name, f.role, f.role
                    );
                    return Err(Error::invalid(path, reason));
                }
                if f.role == Role::Beauty {
                    // Both are the picture (Blender's own denoised `Combined` beside `Noisy Image`): the better one is
                    // read, and both are written.
                    let better = if rank > f.rank { at } else { chosen.len() };
                    chosen.insert(better, (mapped, f.rank));
                } else if rank > f.rank {
                    others.push(std::mem::replace(&mut chosen[at], (mapped, f.rank)).0.name);
                } else {
                    others.push(mapped.name);
                }
            }
        }
    }
    let mut passes: Vec<Mapped> = chosen.into_iter().map(|(m, _)| m).collect();
    if !passes.iter().any(|p| p.role == Role::Beauty) && !asked.contains(&Role::Beauty) {
        // The only colour that has no role is the picture (Mitsuba's own name for it, say).
        let mut colours = found
            .iter()
            .filter(|(f, pass)| f.is_none() && ["r", "g", "b"].iter().all(|c| pass.components.contains_key(*c)));
        if let (Some((_, pass)), None) = (colours.next(), colours.next())
            && let Some((channels, alpha)) = components(Role::Beauty, &pass.components)
        {
            let why = "the only colour without another role".to_owned();
            others.retain(|name| name != &pass.name);
            passes.push(Mapped { role: Role::Beauty, name: pass.name.clone(), channels, alpha, why });
        }
    }
    if !passes.iter().any(|p| p.role == Role::Beauty || p.role.light().is_some()) {
        let names: Vec<String> = found.iter().take(12).map(|(_, p)| format!("`{}`", p.name)).collect();
        let reason =
            format!("no beauty and no light pass; there are {}; name one with --map beauty=NAME", names.join(", "));
        return Err(Error::invalid(path, reason));
    }
    passes.sort_by_key(|p| p.role);
    Ok(Mapping { layer, view, renderer: renderer.clone(), renderer_why: renderer_why.to_owned(), passes, others })
}

/// One `ROLE=NAME`.
fn wished(
    path: &Path,
    wish: &str,
    found: &[&(Option<Found>, &Pass)],
    files: &[(String, &ExrImage)],
) -> Result<(Role, Option<Mapped>), Error> {
    let Some((role, names)) = wish.split_once('=') else {
        return Err(Error::invalid(path, format!("`{wish}` is not ROLE=CHANNEL")));
    };
    let Some(role) = Role::from_name(role) else {
        return Err(Error::invalid(path, format!("`{role}` is no role; roles are {}", role_names())));
    };
    if names.trim() == "none" {
        return Ok((role, None));
    }
    let same = |a: &str| a.eq_ignore_ascii_case(names.trim());
    let by_pass = found.iter().find(|(_, p)| same(&p.name) || p.path.last().is_some_and(|last| same(last)));
    if let Some((_, pass)) = by_pass
        && let Some((channels, alpha)) = components(role, &pass.components)
    {
        let why = "asked for".to_owned();
        return Ok((role, Some(Mapped { role, name: pass.name.clone(), channels, alpha, why })));
    }
    let mut channels = Vec::new();
    for name in names.split(',').map(str::trim) {
        let mut all = files.iter().enumerate().flat_map(|(file, (_, image))| {
            image.parts().iter().enumerate().filter_map(move |(part, p)| {
                let channel = p.find(name)?;
                Some(ChannelId { file, part, channel })
            })
        });
        // Of a stereo file only this view's.
        let here = |id: &ChannelId| found.iter().any(|(_, p)| p.components.values().any(|c| c == id));
        let Some(id) = all.find(here) else {
            let known: Vec<String> = found.iter().take(40).map(|(_, p)| format!("`{}`", p.name)).collect();
            let reason = format!("--map {wish}: there is no channel or pass `{name}`; passes are {}", known.join(", "));
            return Err(Error::invalid(path, reason));
        };
        channels.push(id);
    }
    let [least, most] = role.channels();
    if channels.len() < least || channels.len() > most {
        let reason = format!("--map {wish}: {role} has {least} to {most} channels, not {}", channels.len());
        return Err(Error::invalid(path, reason));
    }
    let name = names.trim().to_owned();
    Ok((role, Some(Mapped { role, name, channels, alpha: None, why: "asked for".to_owned() })))
}

/// Names of components, without case, in order.
const COMPONENTS: [&[&str]; 6] =
    [&["r", "g", "b"], &["red", "green", "blue"], &["x", "y", "z", "w"], &["u", "v"], &["r", "g"], &["x", "y"]];

/// The channels of a role among a pass's components, and the alpha beside them.
fn components(role: Role, all: &BTreeMap<String, ChannelId>) -> Option<(Vec<ChannelId>, Option<ChannelId>)> {
    let [least, most] = role.channels();
    let alpha = ["a", "alpha"].iter().find_map(|a| all.get(*a)).copied();
    if most == 1 {
        // One number, whatever its letter; of a colour its first.
        let only =
            if all.len() == 1 { all.values().next() } else { ["z", "y", "v", "r"].iter().find_map(|c| all.get(*c)) };
        return only.map(|id| (vec![*id], None));
    }
    for names in COMPONENTS {
        let found: Vec<ChannelId> = names.iter().map_while(|name| all.get(*name)).copied().take(most).collect();
        let whole = if names.len() == 4 { found.len() >= 2 } else { found.len() == names.len().min(most) };
        if whole && found.len() >= least {
            return Some((found, alpha));
        }
    }
    // A grey picture.
    (least == 1 && !all.is_empty() && all.len() <= 2)
        .then(|| all.iter().find(|(name, _)| *name != "a" && *name != "alpha").map(|(_, id)| (vec![*id], alpha)))
        .flatten()
}
