//! `include/quell.h` is written by hand: every function, struct, number and type of a callback in it must be what the library has.
//!
//! Both sides are read as text and written the same way, as C. Structs are `repr(C)`: the same members in the same order with the same
//! types lie at the same places.

use std::collections::BTreeMap;
use std::path::Path;

/// What is declared, by kind and name, each written as C with single spaces.
type Declared = BTreeMap<String, String>;

const TYPES: [(&str, &str); 9] = [
    ("c_char", "char"),
    ("c_void", "void"),
    ("c_int", "int"),
    ("u32", "uint32_t"),
    ("i64", "int64_t"),
    ("usize", "size_t"),
    ("isize", "ptrdiff_t"),
    ("f32", "float"),
    ("quell_status", "quell_status"),
];

fn without_comments(text: &str) -> String {
    let mut left = String::new();
    let mut rest = text;
    while let Some(at) = rest.find('/') {
        left.push_str(&rest[..at]);
        rest = &rest[at..];
        let end = match rest.as_bytes().get(1) {
            Some(b'*') => rest.find("*/").expect("a comment that ends") + 2,
            Some(b'/') => rest.find('\n').unwrap_or(rest.len()),
            _ => {
                left.push('/');
                1
            }
        };
        rest = &rest[end..];
    }
    left + rest
}

/// Words and marks with one space between them.
fn spaced(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        let mark = !(c.is_alphanumeric() || c == '_' || c.is_whitespace());
        if mark {
            out.push(' ');
        }
        out.push(c);
        if mark {
            out.push(' ');
        }
    }
    out.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The text between `open`, which `text` begins with, and its partner; and what follows.
fn inside(text: &str, open: char, close: char) -> (&str, &str) {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        depth += i32::from(c == open) - i32::from(c == close);
        if depth == 0 {
            return (&text[1..at], &text[at + 1..]);
        }
    }
    panic!("`{open}` without `{close}`: {text}");
}

/// Splits at commas that stand in no brackets.
fn parts(list: &str) -> Vec<&str> {
    let (mut depth, mut from, mut out) = (0, 0, Vec::new());
    for (at, c) in list.char_indices() {
        match c {
            '(' | '[' | '<' => depth += 1,
            ')' | ']' | '>' => depth -= 1,
            ',' if depth == 0 => {
                out.push(&list[from..at]);
                from = at + 1;
            }
            _ => {}
        }
    }
    out.push(&list[from..]);
    out.into_iter().map(str::trim).filter(|part| !part.is_empty()).collect()
}

/// `name: type` of Rust as C declares it.
fn c_member(member: &str) -> String {
    let (name, kind) = member.trim_start_matches("pub ").split_once(':').expect("name: type");
    c_declaration(kind.trim(), name.trim().trim_end_matches('_'))
}

fn c_declaration(kind: &str, name: &str) -> String {
    if let Some(to) = kind.strip_prefix("*const ") {
        return format!("const {}", c_declaration(to, &format!("* {name}")));
    }
    if let Some(to) = kind.strip_prefix("*mut ") {
        return c_declaration(to, &format!("* {name}"));
    }
    if let Some(array) = kind.strip_prefix('[') {
        let (of, count) = array.trim_end_matches(']').split_once(';').expect("[type; count]");
        return c_declaration(of, &format!("{name}[{}]", count.trim()));
    }
    let kind = kind.rsplit("::").next().unwrap();
    let in_c = TYPES.iter().find(|(rust, _)| *rust == kind).map(|(_, c)| *c);
    spaced(&format!("{} {name}", in_c.unwrap_or(kind)))
}

/// Parameters and result, from `(` on, of a function that C calls `name`.
fn c_function(signature: &str, name: &str) -> String {
    let (list, rest) = inside(signature, '(', ')');
    let list: Vec<String> = parts(list).into_iter().map(c_member).collect();
    let list = if list.is_empty() { "void".to_owned() } else { list.join(", ") };
    let result = rest.trim().strip_prefix("->").map_or("void", str::trim);
    spaced(&c_declaration(result, &format!("{name}({list})")))
}

fn of_library(sources: &[String]) -> Declared {
    let mut found = Declared::new();
    for source in sources {
        let source = without_comments(source);
        for part in source.split("#[unsafe(no_mangle)]").skip(1) {
            let part = part.trim().strip_prefix("pub extern \"C\" fn ").expect("an entry point");
            let (name, rest) = part.split_at(part.find('(').unwrap());
            let signature = rest.split('{').next().unwrap();
            found.insert(format!("function {name}"), c_function(signature, name));
        }
        for part in source.split("#[repr(C)]").skip(1) {
            let Some(at) = part.find("pub struct quell_") else { continue };
            let part = &part[at + "pub struct ".len()..];
            let (name, rest) = part.split_at(part.find(' ').unwrap());
            let members: Vec<String> = parts(inside(rest.trim_start(), '{', '}').0).into_iter().map(c_member).collect();
            found.insert(format!("struct {name}"), members.join(" ; "));
        }
        for part in source.split("pub struct quell_").skip(1) {
            let name = part.split(' ').next().unwrap();
            if !found.contains_key(&format!("struct quell_{name}")) {
                found.insert(format!("type quell_{name}"), "opaque".to_owned());
            }
        }
        for part in source.split("pub const QUELL_").skip(1) {
            let (name, rest) = part.split_once(':').unwrap();
            let (kind, value) = rest.split(';').next().unwrap().split_once('=').unwrap();
            let unsigned = if kind.trim() == "u32" { "u" } else { "" };
            found.insert(format!("number QUELL_{name}"), format!("{}{unsigned}", value.trim()));
        }
        for part in source.split("pub type ").skip(1) {
            let (name, kind) = part.split(';').next().unwrap().split_once('=').unwrap();
            let kind = kind.split_whitespace().collect::<Vec<_>>().join(" ");
            let written = match kind.strip_prefix("Option<unsafe extern \"C\" fn") {
                Some(signature) => c_function(signature.trim_end_matches('>'), &format!("(*{})", name.trim())),
                None if kind.starts_with("Handle<") => "opaque".to_owned(),
                None => c_declaration(&kind, name.trim()),
            };
            found.insert(format!("type {}", name.trim()), written);
        }
    }
    found
}

fn of_header(header: &str) -> Declared {
    let header = without_comments(header);
    let mut found = Declared::new();
    let mut statements = String::new();
    for line in header.lines() {
        if let Some(number) = line.strip_prefix("#define QUELL_") {
            if let Some((name, value)) = number.split_once(' ') {
                found.insert(format!("number QUELL_{name}"), value.trim().to_owned());
            }
        } else if !line.starts_with('#') {
            statements.push_str(line);
            statements.push('\n');
        }
    }
    let mut rest = statements.trim_start().strip_prefix("extern \"C\" {").expect("for C++").trim_start();
    while !rest.starts_with('}') {
        let end = rest.find([';', '{']).expect("a declaration that ends");
        let head = spaced(&rest[..end]);
        let words: Vec<&str> = head.split(' ').collect();
        if rest[end..].starts_with('{') {
            let (members, after) = inside(&rest[end..], '{', '}');
            let members: Vec<String> = members.split(';').map(spaced).filter(|member| !member.is_empty()).collect();
            found.insert(format!("struct {}", words[2]), members.join(" ; "));
            rest = &after[after.find(';').unwrap() + 1..];
        } else {
            if words.starts_with(&["typedef", "struct"]) {
                // Programs do not see into it.
                found.insert(format!("type {}", words[2]), "opaque".to_owned());
            } else if let Some(of) = head.strip_prefix("typedef ") {
                let callback = of.find("( * ").map(|at| of[at + 4..].split(' ').next().unwrap());
                found.insert(format!("type {}", callback.unwrap_or(words[words.len() - 1])), of.to_owned());
            } else {
                let name = head.split(" (").next().unwrap().rsplit(' ').next().unwrap();
                found.insert(format!("function {name}"), head.clone());
            }
            rest = &rest[end + 1..];
        }
        rest = rest.trim_start();
    }
    found
}

fn differences(header: &str, sources: &[String]) -> Vec<String> {
    let (header, library) = (of_header(header), of_library(sources));
    let mut out = Vec::new();
    for (what, in_library) in &library {
        match header.get(what) {
            None => out.push(format!("{what} is not in the header")),
            Some(in_header) if in_header != in_library => {
                out.push(format!("{what}\n  header:  {in_header}\n  library: {in_library}"));
            }
            Some(_) => {}
        }
    }
    out.extend(
        header.keys().filter(|what| !library.contains_key(*what)).map(|what| format!("{what} is not in the library")),
    );
    out
}

fn files() -> (String, Vec<String>) {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &Path| std::fs::read_to_string(path).unwrap();
    let mut sources = Vec::new();
    for entry in std::fs::read_dir(here.join("src")).unwrap() {
        sources.push(read(&entry.unwrap().path()));
    }
    (read(&here.join("include/quell.h")), sources)
}

#[test]
fn the_header_declares_what_the_library_has() {
    let (header, sources) = files();
    let found = differences(&header, &sources);
    assert!(found.is_empty(), "{}", found.join("\n"));
    // All kinds were found at all.
    let declared = of_header(&header);
    for (kind, least) in [("function", 17), ("struct", 7), ("number", 8), ("type", 6)] {
        let count = declared.keys().filter(|what| what.starts_with(kind)).count();
        assert!(count >= least, "{count} of kind {kind}: {declared:#?}");
    }
}

#[test]
fn a_header_that_differs_is_found() {
    let (header, sources) = files();
    for (from, to) in [
        ("    uint32_t width;\n    uint32_t height;", "    uint32_t height;\n    uint32_t width;"),
        ("ptrdiff_t row_stride", "size_t row_stride"),
        ("float jitter[2]", "float jitter[3]"),
        ("    const char *role;\n", ""),
        ("#define QUELL_BUSY 2", "#define QUELL_BUSY 3"),
        ("size_t index, uint32_t *channels", "uint32_t *channels, size_t index"),
        ("typedef struct quell_realtime quell_realtime;", ""),
        ("typedef int (*quell_ready)", "typedef void (*quell_ready)"),
        ("void quell_realtime_free(quell_realtime *denoiser);", ""),
        ("const quell_target *target);", "quell_target *target);"),
        ("const char *quell_version(void);", "const char *quell_version(void);\nint quell_more(void);"),
    ] {
        let changed = header.replacen(from, to, 1);
        assert_ne!(changed, header, "`{from}` is not in the header");
        let found = differences(&changed, &sources);
        assert_eq!(found.len(), 1, "`{from}` as `{to}`: {found:?}");
    }
}
