//! `quell scenes`: built-in scenes and what they stress.

use crate::context::Context;
use crate::failure::Failure;
use quell_lab::report::table::Table;
use quell_trace::builtin_scenes;
use serde_json::{Map, json};

pub fn run(context: &Context) -> Result<(), Failure> {
    let mut list = Vec::new();
    let width = builtin_scenes().iter().map(|s| s.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for scene in builtin_scenes() {
        list.push(json!({
            "name": scene.name,
            "stresses": scene.stresses,
            "frames": scene.frames,
            "cameras": scene.cameras,
            "exposure": scene.exposure,
        }));
        text.push_str(&format!("{:<width$}  {}\n", scene.name, scene.stresses));
    }
    if context.verbose {
        let mut table = Table::new(["scene", "frames", "cameras", "exposure"]);
        for s in builtin_scenes() {
            table.push([s.name.to_owned(), s.frames.to_string(), s.cameras.to_string(), s.exposure.to_string()]);
        }
        text.push_str(&format!("\n{table}"));
    }
    text.push_str("\nRender one: quell render SCENE -o DIR. Look into one: quell explain SCENE.");
    let mut further = Map::new();
    further.insert("scenes".to_owned(), list.into());
    context.finish(&context.report(), further, &text)
}
