//! From the names of channels, parts and files to passes with their components.

use super::mapping::ChannelId;
use crate::image::ExrImage;
use std::collections::{BTreeMap, BTreeSet};

/// A pass as names describe it, before it has a role.
#[derive(Debug)]
pub(super) struct Pass {
    /// Words of the channel's own path, layer first, without view and component.
    pub path: Vec<String>,
    /// Words of the part's or the file's name, where the path does not begin with them.
    pub outer: Vec<String>,
    pub view: String,
    pub components: BTreeMap<String, ChannelId>,
    /// As the file spells it.
    pub name: String,
}

/// Passes of all files.
pub(super) fn collect(files: &[(String, &ExrImage)]) -> Vec<Pass> {
    let mut passes: Vec<Pass> = Vec::new();
    for (file, (file_pass, image)) in files.iter().enumerate() {
        for (part, p) in image.parts().iter().enumerate() {
            let views = p.multi_view();
            let names: BTreeSet<&str> = p.channels().iter().map(|c| c.name()).collect();
            for (channel, c) in p.channels().iter().enumerate() {
                let id = ChannelId { file, part, channel };
                let mut words: Vec<String> = c.name().split('.').map(str::to_owned).collect();
                let component = take_component(&mut words, &names);
                let mut view = p.view().unwrap_or_default();
                if let Some(at) = words.iter().position(|word| views.contains(word)) {
                    view = words.remove(at);
                } else if !views.is_empty() && view.is_empty() {
                    // The first view of `multiView` is the default one, whose name is left out.
                    view = views.first().cloned().unwrap_or_default();
                }
                let mut part_name = p.name();
                if let Some(stem) = part_name.strip_suffix(&view).and_then(|n| n.strip_suffix(['-', '.', '_'])) {
                    part_name = stem.to_owned();
                }
                let mut outer: Vec<String> = Vec::new();
                for name in [file_pass.as_str(), part_name.as_str()] {
                    if !name.is_empty() && !words.join(".").starts_with(name) {
                        outer.extend(name.split('.').map(str::to_owned));
                    }
                }
                let name = if words.is_empty() { outer.join(".") } else { words.join(".") };
                let same = |pass: &&mut Pass| {
                    pass.path == words
                        && pass.outer == outer
                        && pass.view == view
                        && !pass.components.contains_key(&component)
                };
                match passes.iter_mut().find(same) {
                    Some(pass) => {
                        pass.components.insert(component, id);
                    }
                    None => {
                        let components = BTreeMap::from([(component, id)]);
                        passes.push(Pass { path: words, outer, view, components, name });
                    }
                }
            }
        }
    }
    passes
}

/// Takes the component off a channel's words: what is left is the pass.
fn take_component(words: &mut Vec<String>, names: &BTreeSet<&str>) -> String {
    let last = words.last().map(|w| w.to_lowercase()).unwrap_or_default();
    if words.len() > 1 {
        words.pop();
        return last;
    }
    if ["r", "g", "b", "a", "y", "red", "green", "blue", "alpha"].contains(&last.as_str()) {
        words.clear();
        return last;
    }
    // A file of its own for a vector: beside `X` and `Y` a `Z` is no depth.
    let has = |letter: &str| names.iter().any(|name| name.eq_ignore_ascii_case(letter));
    if ["x", "y", "z", "w"].contains(&last.as_str()) && has("x") && has("y") && !has("r") {
        words.clear();
        return last;
    }
    // `Px Py Pz`, `Nsx ..` of older pbrt: three names that differ in the last letter.
    let name = words.first().cloned().unwrap_or_default();
    if let Some(stem) = name.strip_suffix(['x', 'y', 'z']).filter(|stem| !stem.is_empty())
        && ["x", "y", "z"].iter().all(|letter| names.contains(format!("{stem}{letter}").as_str()))
    {
        let component = name.get(stem.len()..).unwrap_or_default().to_owned();
        *words = vec![stem.to_owned()];
        return component;
    }
    // A name without component, such as `Z`: one number.
    "value".to_owned()
}
