//! The public face: every name that a user of the crate can reach stands in `public-names.txt`, so that growth is seen.
//!
//! Made from the sources, since rustdoc's JSON is not on the stable toolchain: modules, types, functions, constants and traits;
//! no methods, fields or variants. What a re-export only shows at a second place counts once. Items behind `internals`
//! are not public. The sources are formatted by rustfmt, on which the reading relies: an item of a module begins a line.
//!
//! After a change: `QUELL_WRITE_DOCS=1 cargo test -p quell public_names`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A module's items that are `pub`, by name; `pub mod`s with what is in them.
#[derive(Default)]
struct Module {
    names: BTreeSet<String>,
    /// Where re-exported names come from: path below the crate or this module, without the name.
    reexports: Vec<(Vec<String>, String)>,
    modules: BTreeMap<String, Module>,
}

const KINDS: [&str; 8] = ["fn", "struct", "enum", "trait", "const", "static", "type", "union"];

/// The name behind `pub fn`, `pub const fn`, `pub struct` ...
fn item(line: &str) -> Option<&str> {
    let mut words =
        line.strip_prefix("pub ")?.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|w| !w.is_empty());
    let kind = words.next().filter(|kind| KINDS.contains(kind))?;
    let name = words.next()?;
    if kind == "const" && name == "fn" { words.next() } else { Some(name) }
}

/// `a::{b, c::D as E}` as paths; the name that is seen is the last word.
fn paths(tree: &str) -> Vec<(Vec<String>, String)> {
    let (head, inner) = match tree.split_once('{') {
        Some((head, inner)) => (head, inner.rsplit_once('}').map_or(inner, |(inner, _)| inner)),
        None => ("", tree),
    };
    let prefix: Vec<String> = head.split("::").map(str::trim).filter(|s| !s.is_empty()).map(str::to_owned).collect();
    let each = inner.split(',').map(str::trim).filter(|part| !part.is_empty()).map(|part| {
        let (path, seen) = part.split_once(" as ").unwrap_or((part, part));
        let mut segments = prefix.clone();
        segments.extend(path.split("::").map(|s| s.trim().to_owned()));
        segments.pop();
        (segments, seen.rsplit("::").next().unwrap_or(seen).trim().to_owned())
    });
    each.collect()
}

/// Names that the crate's own macros declare: `parameters!`, `choices!` and `uniforms!`.
fn declared(module: &mut Module, kind: &str, lines: &[&str]) {
    for line in lines {
        let Some(text) = line.strip_prefix("    ").filter(|text| text.starts_with(|c: char| c.is_alphabetic())) else {
            continue;
        };
        let text = text.strip_prefix("pub struct ").unwrap_or(text);
        // `group: Group {` or a name alone.
        let name = text.split_once(": ").map_or(text, |(_, name)| name).trim_end_matches(['{', ' ']);
        if name.chars().all(|c| c.is_alphanumeric() || c == '_') {
            module.names.insert(name.to_owned());
        } else {
            assert!(!["parameters", "choices"].contains(&kind), "{kind}! declares `{line}`");
        }
    }
}

fn read(file: &Path) -> Module {
    let text =
        std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display())).replace("\r\n", "\n");
    let lines: Vec<&str> = text.lines().collect();
    let folder = match file.file_name().and_then(|name| name.to_str()) {
        Some("lib.rs" | "mod.rs") => file.parent().unwrap().to_owned(),
        _ => file.with_extension(""),
    };
    let mut module = Module::default();
    let mut hidden = false;
    for (i, line) in lines.iter().enumerate() {
        if line.starts_with("#[") {
            hidden |= line.contains("cfg(test)") || line.contains("feature = \"internals\"") && !line.contains("not(");
            continue;
        }
        let skip = std::mem::take(&mut hidden);
        if skip {
            continue;
        }
        if let Some(name) = line.strip_prefix("pub mod ").and_then(|rest| rest.strip_suffix(';')) {
            let files: [PathBuf; 2] = [folder.join(format!("{name}.rs")), folder.join(name).join("mod.rs")];
            let file = files.iter().find(|file| file.exists()).expect("a module has a file");
            module.modules.insert(name.to_owned(), read(file));
        } else if let Some(start) = line.strip_prefix("pub use ") {
            let mut tree = start.to_owned();
            for more in &lines[i + 1..] {
                if tree.contains(';') {
                    break;
                }
                tree.push_str(more);
            }
            module.reexports.extend(paths(tree.trim_end_matches(';')));
        } else if let Some(name) = item(line) {
            module.names.insert(name.to_owned());
        } else if let Some(kind) =
            line.strip_suffix("! {").filter(|kind| ["parameters", "choices", "uniforms"].contains(kind))
        {
            let end = lines[i..].iter().position(|line| *line == "}").expect("a macro ends");
            declared(&mut module, kind, &lines[i + 1..i + end]);
        }
    }
    module
}

/// Whether `path` leads to a public module that holds `name` itself.
fn holds(root: &Module, path: &[String], name: &str) -> bool {
    let found = path.iter().try_fold(root, |module, segment| module.modules.get(segment));
    found.is_some_and(|module| module.names.contains(name))
}

fn list(root: &Module, module: &Module, place: &[String], out: &mut Vec<String>) {
    let full = |name: &str| place.iter().map(String::as_str).chain([name]).collect::<Vec<_>>().join("::");
    out.extend(module.names.iter().map(|name| full(name)));
    for (path, name) in &module.reexports {
        let elsewhere = match path.first().map(String::as_str) {
            Some("crate") => holds(root, &path[1..], name),
            _ => holds(module, path, name),
        };
        if !elsewhere {
            out.push(full(name));
        }
    }
    for (name, inner) in &module.modules {
        out.push(full(name) + "::");
        list(root, inner, &[place, std::slice::from_ref(name)].concat(), out);
    }
}

#[test]
fn public_names_are_those_of_the_list() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crate_root = read(&root.join("src/lib.rs"));
    let mut names = Vec::new();
    list(&crate_root, &crate_root, &[], &mut names);
    names.sort();
    names.dedup();
    let (modules, items): (Vec<&String>, Vec<&String>) = names.iter().partition(|name| name.ends_with("::"));
    let gpu = items.iter().filter(|name| name.starts_with("gpu::")).count();
    let counted = format!(
        "{} names, {gpu} more with the feature `gpu`, in {} modules (`::` at the end)\n{}\n",
        items.len() - gpu,
        modules.len(),
        names.join("\n")
    );
    let path = root.join("public-names.txt");
    if std::env::var_os("QUELL_WRITE_DOCS").is_some() {
        std::fs::write(&path, &counted).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default().replace("\r\n", "\n");
    let (new, old): (BTreeSet<&str>, BTreeSet<&str>) = (counted.lines().collect(), found.lines().collect());
    let (added, gone): (Vec<_>, Vec<_>) = (new.difference(&old).collect(), old.difference(&new).collect());
    assert!(
        added.is_empty() && gone.is_empty(),
        "new: {added:?}, gone: {gone:?}; if that is meant: `QUELL_WRITE_DOCS=1 cargo test -p quell public_names`"
    );
}

#[test]
fn public_names_are_read_as_rust_has_them() {
    for (line, name) in [
        ("pub fn run(a: u8) {", Some("run")),
        ("pub const fn at() {", Some("at")),
        ("pub const LARGEST: u8 = 1;", Some("LARGEST")),
        ("pub struct Plane<T> {", Some("Plane")),
        ("pub(crate) fn hidden() {", None),
        ("    pub fn method() {", None),
    ] {
        assert_eq!(item(line), name, "{line}");
    }
    let found = paths("frame::{Frame, deep::Rgb as Colour}");
    let path = |words: &[&str]| words.iter().map(|w| (*w).to_owned()).collect::<Vec<String>>();
    assert_eq!(found, [(path(&["frame"]), "Frame".to_owned()), (path(&["frame", "deep"]), "Colour".to_owned())]);
    assert_eq!(paths("camera::Camera"), [(path(&["camera"]), "Camera".to_owned())]);
}
