//! The npm package `quell-denoise` (`packages/quell-denoise`): what it was made from is what stands in the crates, its twins of
//! settings and taps have the same bits, and it behaves, in headless Chromium, as docs/javascript.md says.

use super::browser::Browser;
use super::web::server::Server;
use super::web::{PACKAGE, await_end, browser, served, served_from};
use base64::Engine;
use quell::gpu::{Contents, Convention, Program, Role, SignalContents, Storage};
use quell::pipeline::Plan;
use quell::settings::PARAMETERS;
use quell::{Preset, Settings, Size};
use quell_host::manifest::{Choice, File, MANIFEST, files};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

fn repository_file(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// What `made/programs.js` holds.
fn made() -> Value {
    let text = repository_file("packages/quell-denoise/made/programs.js");
    let (_, json) = text.split_once("export default ").expect("a module");
    serde_json::from_str(json.trim_end().trim_end_matches(';')).expect("JSON")
}

/// The files of a program for frames with textures, of which signals have weights.
fn written(settings: &Settings, size: Size, signals: [bool; 2], jitter: bool) -> Vec<File> {
    let [matte, glossy] = signals.map(|there| there.then_some(SignalContents { weight: true, direct: false }));
    let contents = Contents { matte, glossy, jitter, textures: true, ..Contents::USUAL };
    let convention = Convention::QUELL;
    files(&Choice { settings, size, contents, convention, storage: Storage::Half, fuse: true }).expect("files")
}

fn manifest(files: &[File]) -> Value {
    let file = files.iter().find(|f| f.name == MANIFEST).expect("a manifest");
    serde_json::from_slice(&file.bytes).expect("JSON")
}

const STALE: &str = "packages/quell-denoise/made is stale: node packages/quell-denoise/make.mjs target/release/quell";

/// The text of a shader of the package.
fn code(made: &Value, shader: &Value) -> String {
    let blocks = made["shaders"][shader.as_u64().expect("a number") as usize].as_array().expect("blocks").iter();
    let blocks = blocks.map(|b| made["blocks"][b.as_u64().expect("a number") as usize].as_str().expect("text"));
    blocks.collect::<Vec<_>>().join("\n\n")
}

/// Checks the passes and resources of a manifest against the package's; the names of the passes.
fn is_current(made: &Value, choice: &str, files: &[File]) -> Vec<String> {
    let manifest = manifest(files);
    assert_eq!(made["structs"], manifest["structs"], "{STALE}");
    assert_eq!(made["format"], manifest["format"], "{STALE}");
    for expected in manifest["resources"].as_array().expect("resources") {
        let name = expected["name"].as_str().expect("a name");
        let found = &made["resources"][name];
        for (key, value) in expected.as_object().expect("an object") {
            match key.as_str() {
                // What comes out of one program is between stages in another; tables belong to a height.
                "role" if value == "output" => assert_eq!(found[key], "transient", "{name}: {STALE}"),
                "bytes" | "file" | "period" if expected["role"] == "taps" => {}
                // It has a second copy where stage 8 compares hit distances; src/program.js adds it.
                "role" if name == "guides moving" => assert_eq!(found[key], "transient", "{name}: {STALE}"),
                "copies" if name == "guides moving" => assert_eq!(found[key], 1, "{name}: {STALE}"),
                _ => assert_eq!(found[key], *value, "{name}: {key}: {STALE}"),
            }
        }
    }
    let debug = &manifest["debug"];
    let file = files.iter().find(|f| debug["file"] == f.name.as_str()).expect("a shader");
    assert!(code(made, &made["debug"]["shader"]).as_bytes() == file.bytes, "{}: {STALE}", file.name);
    for key in ["entry_point", "workgroups", "bindings", "views"] {
        assert_eq!(made["debug"][key], debug[key], "debug: {key}: {STALE}");
    }
    let mut names = Vec::new();
    for expected in manifest["dispatches"].as_array().expect("dispatches") {
        let file = files.iter().find(|f| expected["file"] == f.name.as_str()).expect("a shader");
        let pass = expected["name"].as_str().expect("a name");
        let has_code = |name: &String| {
            let shader = &made["passes"][name]["shader"];
            shader.is_u64() && code(made, shader).as_bytes() == file.bytes
        };
        let name = [pass.to_owned(), format!("{pass}, first")].into_iter().find(has_code);
        let name = name.unwrap_or_else(|| panic!("{choice}: {}: {STALE}", file.name));
        let mut expected = expected.clone();
        for binding in expected["bindings"].as_array_mut().expect("bindings") {
            for place in ["resource", "copy"] {
                binding.as_object_mut().expect("a binding").remove(place);
            }
        }
        for key in ["entry_point", "workgroups", "bindings"] {
            assert_eq!(made["passes"][&name][key], expected[key], "{choice}: {name}: {key}: {STALE}");
        }
        names.push(name);
    }
    names
}

/// Settings by name, as `--set` takes them.
type Changes = Vec<(&'static str, &'static str)>;

const SWITCHES: [&str; 7] = [
    "matte_temporal.enabled",
    "matte_prefilter.enabled",
    "disocclusion.enabled",
    "firefly.enabled",
    "matte_bilateral.enabled",
    "glossy_temporal.enabled",
    "glossy_bilateral.enabled",
];

/// Whatever changes the program: stages of either signal, what is fed back, what the median reads, levels of the filter of young
/// history. All choices of the matte stages; of the others, which share no image with them, all beside a few of those.
fn choices() -> Vec<(Changes, [bool; 2], bool)> {
    // No filter, then 3, 2, 1 and 0 of its levels.
    let young: [[&str; 3]; 5] =
        [["off", "32", "0.5"], ["on", "64", "0.4"], ["on", "10", "0.2"], ["on", "9", "0.01"], ["on", "1", "1"]];
    let mut all = Vec::new();
    let mut add = |bits: usize, feedback, input, young: [&'static str; 3], young_glossy, signals, jitter| {
        let mut changes: Changes = SWITCHES
            .iter()
            .enumerate()
            .map(|(bit, name)| (*name, if bits >> bit & 1 == 1 { "on" } else { "off" }))
            .collect();
        changes.extend([("pipeline.feedback", feedback), ("firefly.input", input), ("young_filter.matte", young[0])]);
        changes.extend([("young_filter.frames", young[1]), ("young_filter.falloff", young[2])]);
        changes.push(("young_filter.glossy", if young_glossy { "on" } else { "off" }));
        changes.push(("young_filter.matte_levels", ["3", "4", "4", "2", "1"][all.len() % 5]));
        changes.push(("young_filter.glossy_levels", ["3", "2", "1"][all.len() % 3]));
        changes.push(("young_filter.wide_frames", if all.len() % 11 == 0 { "1" } else { "9.5" }));
        // Stage 8 compares hit distances in every third.
        changes.push(("glossy_temporal.mirror_roughness", if all.len() % 3 == 0 { "0.03" } else { "0" }));
        changes.push(("glossy_temporal.virtual_reprojection", if all.len() % 5 == 0 { "off" } else { "on" }));
        changes.push(("antialiasing.enabled", if all.len() % 4 < 2 { "on" } else { "off" }));
        all.push((changes, signals, jitter));
    };
    let mut count = 0;
    for feedback in ["temporal", "prefilter", "blend", "firefly", "bilateral"] {
        for input in ["disocclusion", "temporal"] {
            for young in young {
                for matte in 0..32 {
                    // Every other choice in its turn.
                    let glossy = count % 4;
                    add(
                        matte | glossy << 5,
                        feedback,
                        input,
                        young,
                        count % 8 < 4,
                        [true, count % 3 > 0],
                        count % 2 == 0,
                    );
                    count += 1;
                }
            }
        }
    }
    for young in young {
        for bits in (0..4).map(|glossy| 0b11111 | glossy << 5).chain([0, 0b11110 | 3 << 5]) {
            for signals in [[true, true], [false, true]] {
                for jitter in [false, true] {
                    add(bits, "blend", "disocclusion", young, true, signals, jitter);
                }
            }
        }
    }
    all
}

fn set(changes: &Changes) -> Settings {
    let mut settings = Settings::default();
    changes.iter().for_each(|(name, value)| settings.set(name, value).expect("a parameter"));
    settings
}

#[test]
fn what_the_package_holds_is_current() {
    let made = made();
    let mut met = std::collections::BTreeSet::new();
    // One in a few of each kind: every pass is met.
    for (changes, signals, jitter) in choices().into_iter().step_by(7) {
        met.extend(is_current(
            &made,
            &format!("{changes:?}"),
            &written(&set(&changes), Size::new(32, 18), signals, jitter),
        ));
    }
    let held = made["passes"].as_object().expect("passes").keys().cloned().collect();
    assert_eq!(met, held, "{STALE}");

    let of_preset = |name: &str| {
        let mut settings = Settings::default();
        for (name, value) in made["presets"][name].as_object().unwrap_or_else(|| panic!("{name}: {STALE}")) {
            settings.set(name, &as_text(value)).unwrap_or_else(|e| panic!("{e}: {STALE}"));
        }
        settings
    };
    for preset in Preset::ALL {
        assert_eq!(of_preset(preset.name()), Settings::preset(preset), "{}: {STALE}", preset.name());
    }
    assert_eq!(made["presets"].as_object().map(|presets| presets.len()), Some(Preset::ALL.len()), "{STALE}");

    let default = Settings::default();
    let listed = made["parameters"].as_array().expect("parameters");
    let named = |p: &Value| p["name"].as_str().expect("a name").to_owned();
    let names: Vec<String> = listed.iter().map(named).collect();
    assert_eq!(names, PARAMETERS.iter().map(|p| p.name).collect::<Vec<_>>(), "{STALE}");
    for (found, parameter) in listed.iter().zip(PARAMETERS) {
        let value = as_text(&found["default"]);
        // The same number however it is written: 1000 and 1000.0.
        let mut set = Settings::default();
        set.set(parameter.name, &value).unwrap_or_else(|e| panic!("{e}: {STALE}"));
        assert_eq!(set, default, "{}: {STALE}", parameter.name);
        use quell::settings::Kind;
        let range = match parameter.kind() {
            Kind::Number(low, high) => json!(["number", low, high]),
            Kind::Whole(low, high) => json!(["whole", low as f32, high as f32]),
            Kind::Switch => json!(["switch"]),
            Kind::Choice(names) => json!(["choice", names]),
        };
        let number = |key: &str| found[key].as_f64().map(|v| v as f32);
        let expected = match found["kind"].as_str() {
            Some(kind @ ("number" | "whole")) => json!([kind, number("low"), number("high")]),
            Some(kind @ "choice") => json!([kind, found["choices"]]),
            kind => json!([kind]),
        };
        assert_eq!(range, expected, "{}: {STALE}", parameter.name);
        assert_eq!(found["meaning"], parameter.doc, "{}: {STALE}", parameter.name);
    }
    // Nor did somebody write into it what the command does not say.
    let types = repository_file("packages/quell-denoise/made/settings.d.ts");
    for name in names {
        assert!(types.contains(&format!("\"{name}\"?:")), "{name}: {STALE}");
    }
}

/// A value of the package as `--set` takes it.
fn as_text(value: &Value) -> String {
    match value {
        Value::Bool(on) => if *on { "on" } else { "off" }.to_owned(),
        Value::String(choice) => choice.clone(),
        number => number.to_string(),
    }
}

/// Settings that move every member of the struct, each with a size.
fn cases() -> Vec<(Size, Changes)> {
    vec![
        (Size::new(96, 54), vec![]),
        (Size::new(1920, 1080), vec![]),
        (Size::new(5120, 2880), vec![]),
        (
            Size::new(333, 217),
            vec![
                ("matte_prefilter.taps", "37"),
                ("matte_prefilter.radius", "51.3"),
                ("matte_prefilter.off_screen", "mirror"),
                ("matte_bilateral.sigma", "0.333"),
                ("matte_bilateral.turns", "13"),
                ("matte_bilateral.rotate", "off"),
                ("glossy_bilateral.radius", "constant"),
                ("glossy_bilateral.step", "3.7"),
                ("glossy_bilateral.constant_radius", "17.7"),
                ("glossy_temporal.hit_filter", "median"),
                ("glossy_temporal.alpha", "0.83"),
                ("glossy_temporal.mirror_roughness", "0.07"),
                ("glossy_temporal.hit_tolerance", "0.13"),
                ("glossy_temporal.spline_roughness", "0.35"),
                ("surface.rejection", "point"),
                ("surface.plane_distance", "0.013"),
                ("matte_temporal.clip", "box"),
                ("matte_temporal.ramp", "off"),
                ("firefly.median", "luminance"),
                ("firefly.plain", "on"),
                ("disocclusion.radius", "5"),
                ("direct_taa.motion_falloff", "3.3"),
                ("antialiasing.least", "0.13"),
                ("antialiasing.resampling", "0.7"),
                ("antialiasing.gamma", "1.3"),
                ("antialiasing.change_falloff", "23"),
                ("antialiasing.thin_radius", "2"),
                ("antialiasing.thin_depth", "0.07"),
                ("antialiasing.thin_motion", "0.7"),
                ("edge.monotone", "on"),
                ("edge.matte_gloss", "0.3"),
                ("young_filter.frames", "23.7"),
                ("young_filter.matte_levels", "4"),
                ("young_filter.glossy_levels", "2"),
                ("young_filter.wide_frames", "9.3"),
                ("young_filter.contact_noise", "0.7"),
                ("young_filter.further_contrast", "0.6"),
                ("young_filter.falloff", "0.37"),
                ("young_filter.lobe", "0.7"),
                ("young_filter.least_lobe", "0.3"),
                ("young_filter.deviations", "3.7"),
                ("young_filter.isolated", "2.3"),
                ("young_filter.matte_stays", "on"),
                ("changed_light.glossy", "on"),
                ("changed_light.fast", "0.63"),
                ("changed_light.begin", "0.7"),
                ("changed_light.certain", "2.3"),
                ("changed_light.least", "0.03"),
                ("changed_light.radius", "2"),
                ("changed_light.spacing", "3"),
            ],
        ),
        (
            Size::new(64, 1000),
            vec![
                ("matte_prefilter.taps", "1"),
                ("matte_prefilter.sigma", "0.05"),
                ("matte_bilateral.taps", "64"),
                ("matte_bilateral.radius", "0"),
                ("changed_light.matte", "on"),
                ("changed_light.begin", "3"),
                ("changed_light.certain", "1"),
            ],
        ),
    ]
}

/// A parameter's value as JavaScript has it.
fn in_javascript(text: &str) -> Value {
    match text {
        "on" => json!(true),
        "off" => json!(false),
        _ => text.parse::<f64>().map_or_else(|_| json!(text), |number| json!(number)),
    }
}

#[test]
fn settings_and_taps_have_the_bits_of_the_crate() {
    let Some(browser) = browser() else { return };
    let server = Server::start(served(&PACKAGE).into_iter().chain([empty()]).collect());
    browser.visit(&server.address("empty.html"));
    for (size, changes) in cases() {
        let mut settings = Settings::default();
        changes.iter().for_each(|(name, value)| settings.set(name, value).expect("a parameter"));
        let files = written(&settings, size, [true, true], true);
        let manifest = manifest(&files);
        let given: Value = changes.iter().map(|(name, value)| ((*name).to_owned(), in_javascript(value))).collect();
        let found = browser.awaited(&format!(
            "{{
                const {{ changed, preset, settingsStruct, TAPS }} = await import('/packages/quell-denoise/src/settings.js');
                const {{ allTaps }} = await import('/packages/quell-denoise/src/spiral.js');
                const settings = changed(preset('paper'), {given});
                const base64 = (bytes) => btoa(Array.from(new Uint8Array(bytes), (b) => String.fromCharCode(b)).join(''));
                const table = ([name, {{ stage, of }}]) => [name, base64(allTaps(of(settings), stage, {rows}))];
                return {{ settings: settingsStruct(settings, {rows}), taps: Object.fromEntries(Object.entries(TAPS).map(table)) }};
            }}",
            rows = size.height
        ));
        let expected = manifest["uniforms"][1]["values"].as_object().expect("values");
        for (group, members) in expected.iter().filter(|(group, _)| *group != "composite") {
            for (name, value) in members.as_object().expect("members") {
                let [found, expected] = [&found["settings"][group][name], value].map(|v| v.as_f64().map(|v| v as f32));
                assert_eq!(
                    found.map(f32::to_bits),
                    expected.map(f32::to_bits),
                    "{size}: {group}.{name}: {found:?}, {value}"
                );
            }
        }
        let mut tables = 0;
        for resource in manifest["resources"].as_array().expect("resources").iter().filter(|r| r["role"] == "taps") {
            let text = found["taps"][resource["name"].as_str().expect("a name")].as_str().expect("a table");
            let table = base64::engine::general_purpose::STANDARD.decode(text).expect("base64");
            let file = files.iter().find(|f| resource["file"] == f.name.as_str()).expect("a table");
            assert!(table == file.bytes, "{size}: {} differs", file.name);
            tables += 1;
        }
        assert_eq!(tables, 2);
    }
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

/// A program as `planned` of plan.js says it: what each pass binds, and what comes out.
fn planned(changes: &Changes, signals: [bool; 2], jitter: bool) -> Value {
    let signal = |there: bool| there.then_some(SignalContents { weight: true, direct: true });
    let contents =
        Contents { matte: signal(signals[0]), glossy: signal(signals[1]), jitter, textures: true, ..Contents::USUAL };
    let program = Program::new(&Plan::new(&set(changes), contents.inputs()), contents, Storage::Half, true);
    let dispatches = program.dispatches.iter().map(|dispatch| {
        let bindings = program.bindings(dispatch).filter(|(_, resource, _)| resource.role != Role::Uniform);
        let bound: Vec<Value> = bindings
            .map(|(_, resource, before)| json!([resource.slot.name(), if before { "before" } else { "this" }]))
            .collect();
        let first = if dispatch.host_input { ", first" } else { "" };
        json!([format!("{}{first}", dispatch.pass.name), bound])
    });
    let name = |index: Option<usize>| index.and_then(|index| program.resources.get(index)).map(|r| r.slot.name());
    let shown = program.shown;
    let alternating = program.resources.iter().filter(|r| r.alternates).map(|r| r.slot.name());
    let alternating: std::collections::BTreeSet<_> = alternating.collect();
    json!({
        "dispatches": dispatches.collect::<Vec<_>>(),
        "alternating": alternating,
        "outputs": {
            "composite": name(shown.composite),
            "direct": name(shown.direct),
            "matte": name(shown.matte),
            "glossy": name(shown.glossy),
            "confidence": name(shown.confidence),
            "history_length": name(shown.length),
        },
    })
}

#[test]
fn programs_of_every_choice_are_the_crates() {
    let Some(browser) = browser() else { return };
    let server = Server::start(served(&PACKAGE).into_iter().chain([empty()]).collect());
    browser.visit(&server.address("empty.html"));
    let choices = choices();
    for some in choices.chunks(200) {
        let given: Vec<Value> = some
            .iter()
            .map(|(changes, [matte, glossy], jitter)| {
                let settings: Value =
                    changes.iter().map(|(name, value)| ((*name).to_owned(), in_javascript(value))).collect();
                let signals = [("matte", *matte), ("glossy", *glossy)];
                let signals: Vec<&str> =
                    signals.into_iter().filter_map(|(name, there)| there.then_some(name)).collect();
                json!([settings, signals, jitter])
            })
            .collect();
        let found = browser.awaited(&format!(
            "{{
                const {{ changed, preset }} = await import('/packages/quell-denoise/src/settings.js');
                const {{ planned }} = await import('/packages/quell-denoise/src/plan.js');
                const {{ builtIn }} = await import('/packages/quell-denoise/src/program.js');
                return {}.map(([given, signals, jitter]) => {{
                    const settings = changed(preset('paper'), given);
                    const {{ dispatches, outputs }} = planned(settings, signals, jitter);
                    const bound = ({{ pass, bound }}) => [pass, bound.map(({{ resource, copy }}) => [resource, copy])];
                    const resources = [...builtIn(settings, signals, jitter).resources.values()];
                    const alternating = resources.filter(({{ copies }}) => copies === 2).map(({{ name }}) => name).sort();
                    return {{ dispatches: dispatches.map(bound), alternating, outputs }};
                }});
            }}",
            Value::from(given)
        ));
        for (found, (changes, signals, jitter)) in found.as_array().expect("programs").iter().zip(some) {
            assert_eq!(*found, planned(changes, *signals, *jitter), "{changes:?}, {signals:?}, {jitter}");
        }
    }
    println!("{} choices", choices.len());
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

fn empty() -> (String, Vec<u8>) {
    ("empty.html".to_owned(), b"<!doctype html><title>quell-denoise</title>".to_vec())
}

/// Runs what a module of the package's tests exports as `run` on a device; what it comes to.
fn run(module: &str, argument: &Value) -> Option<Value> {
    let browser = browser()?;
    let folders = [PACKAGE[0], PACKAGE[1], "packages/quell-denoise/test"];
    let server = Server::start(served(&folders).into_iter().chain([empty()]).collect());
    browser.visit(&server.address("empty.html"));
    // It is started, not awaited: a call of chromedriver that lasts a minute is an error.
    let _ = browser.awaited(&format!(
        "{{
            const {{ run }} = await import('/packages/quell-denoise/test/{module}');
            const adapter = await navigator.gpu.requestAdapter();
            window.state = {{ done: false }};
            adapter.requestDevice().then((device) => run(device, {argument}))
                .then((came) => {{ state.came = came; }}, (error) => {{ state.came = String(error.stack); }})
                .finally(() => {{ state.done = true; }});
        }}"
    ));
    await_end(&browser);
    assert_eq!(browser.complaints(), Vec::<String>::new());
    Some(browser.value("window.state.came"))
}

#[test]
fn errors_settings_and_sizes_leave_it_usable() {
    if let Some(wrong) = run("behaviour.js", &Value::Null) {
        assert_eq!(wrong, json!([]));
    }
}

#[test]
fn the_examples_of_the_docs_run() {
    if let Some(came) = run("examples.js", &json!(repository_file("docs/javascript.md"))) {
        assert_eq!(came["wrong"], json!([]));
        assert_eq!(came["ran"], 4);
    }
}

/// The page of `examples/three` with what npm installed beside it: the folder that `QUELL_THREE_PAGE` names, or the example's own.
fn three_page() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let named = std::env::var_os("QUELL_THREE_PAGE").map(|folder| root.join(folder));
    let mut folders = named.into_iter().chain([root.join("examples/three")]);
    let has_three = |folder: &PathBuf| folder.join(THREE[1]).is_dir() && folder.join(THREE[3]).is_dir();
    let found = folders.find(has_three);
    if found.is_none() {
        eprintln!("SKIPPED: no node_modules in examples/three (npm install there, or QUELL_THREE_PAGE)");
    }
    found
}

/// Folders of the page.
const THREE: [&str; 5] = [
    "",
    "node_modules/three/build",
    "node_modules/three/examples/jsm/controls",
    "node_modules/quell-denoise/src",
    "node_modules/quell-denoise/made",
];

/// The page after some frames, with this text in place of another in its script.
fn three_after(browser: &Browser, page: &Path, address: &str, replaced: Option<(&str, &str)>) {
    let mut files = served_from(page, &THREE);
    for (name, bytes) in &mut files {
        name.replace_range(..usize::from(name.starts_with('/')), "");
        let Some((from, to)) = replaced.filter(|_| name == "page.js") else { continue };
        let text = String::from_utf8(bytes.clone()).expect("UTF-8");
        assert!(text.contains(from), "`{from}` is not in the page");
        *bytes = text.replace(from, to).into_bytes();
    }
    browser.visit(&Server::start(files).address(address));
    await_end(browser);
    assert_eq!(browser.value("window.state.failed"), Value::Null);
}

#[test]
fn three_js_and_quell_share_a_device() {
    let (Some(page), Some(browser)) = (three_page(), browser()) else { return };
    three_after(&browser, &page, "index.html?frames=8&size=160x90&score=64&readback", None);
    // Things and camera in motion: against the same frame at 64 paths.
    let score = browser.value("window.state.score");
    println!("{score}");
    let number = |name: &str| score[name].as_f64().expect("a number");
    assert_eq!(score["finite"], true);
    assert!(number("denoised") < number("noisy") / 4.0, "{score}");
    assert!((number("energy") - 1.0).abs() < 0.05, "{score}");
    if let Some(folder) = std::env::var_os("QUELL_PICTURES") {
        browser.screenshot(&Path::new(&folder).join("three.png"));
    }
    assert_eq!(browser.complaints(), Vec::<String>::new());

    // Where things stand still, three.js' velocity is what quell makes of its depth and its cameras: the pictures are alike only if
    // quell understands all three of them.
    let still = |replaced: (&str, &str)| {
        three_after(&browser, &page, "index.html?frames=5&size=96x54&still&readback", Some(replaced));
        let picture = browser.awaited("{ return await window.picture(); }");
        picture.as_array().expect("a picture").iter().filter_map(Value::as_f64).collect::<Vec<_>>()
    };
    let off = |a: &[f64], b: &[f64]| {
        assert_eq!((a.len(), b.len()), (3 * 96 * 54, 3 * 96 * 54));
        let mean = b.iter().sum::<f64>() / b.len() as f64;
        a.iter().zip(b).map(|(p, q)| (p - q).abs() / mean).sum::<f64>() / b.len() as f64
    };
    let told = "convention: \"three\"";
    let without_motion = still(("depth, normal, motion,", "depth, normal,"));
    let right = off(&still((told, told)), &without_motion);
    let wrong =
        "convention: { motionScale: [0.5, -0.5], motionUnit: \"extents\", depth: \"device\", normalSpace: \"view\" }";
    let wrong = off(&still((told, wrong)), &without_motion);
    println!("velocity against depth and cameras: {right:.1e} of the mean apart, the other way round {wrong:.1e}");
    assert!(right < 1e-3, "{right}");
    assert!(wrong > 10.0 * right, "motion's sign went unseen: {wrong}, {right}");
}
