//! The page itself, in headless Chromium on its WebGPU in software: a folder that `web/build.sh` wrote, served as plain files,
//! used by pointer and keys. Without that folder or Chromium the test says why it did nothing; with `QUELL_REQUIRE_PAGE=1`
//! it fails.

#[expect(dead_code, reason = "the player's test uses the rest")]
#[path = "../../../quell-lab/tests/main/browser.rs"]
mod browser;
#[path = "../../../quell-lab/tests/main/web/server.rs"]
mod server;

use base64::Engine;
use browser::Browser;
use serde_json::{Value, json};
use server::Server;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Set to 1, what is missing fails the test instead of skipping it.
const REQUIRE: &str = "QUELL_REQUIRE_PAGE";
/// The folder with the page, if it is not `quell-live-web` in cargo's target folder.
const FOLDER: &str = "QUELL_PAGE";
/// Bytes of the page without scenes, at most: issue 24's bound.
const LARGEST: usize = 8 << 20;
/// Compiling kernels and tracing in software, both on one core.
const PATIENCE: Duration = Duration::from_secs(240);

/// Two pages at once would wait for each other's frames.
static ALONE: std::sync::Mutex<()> = std::sync::Mutex::new(());

/// For so long a control must have stood still.
const AT_REST: Duration = Duration::from_millis(600);

/// WebGPU in software; the last three give its canvases to a browser without a screen.
const SOFTWARE: [&str; 5] = [
    "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
    "--use-angle=vulkan",
];

fn skipped(why: &str) -> Option<Vec<(String, Vec<u8>)>> {
    assert!(std::env::var_os(REQUIRE).is_none_or(|v| v != "1"), "{REQUIRE}=1, but {why}");
    println!("SKIPPED: {why} ({REQUIRE}=1 makes this an error)");
    None
}

/// The files of the page; `None`, said aloud: it was not built.
fn files() -> Option<Vec<(String, Vec<u8>)>> {
    let usual = || Path::new(env!("CARGO_TARGET_TMPDIR")).join("../quell-live-web");
    let folder = std::env::var_os(FOLDER).map_or_else(usual, PathBuf::from);
    let Ok(entries) = std::fs::read_dir(&folder) else {
        return skipped(&format!("{} is not there: crates/quell-live/web/build.sh writes it", folder.display()));
    };
    let paths = entries.map(|entry| entry.unwrap().path());
    let named = |path: PathBuf| (path.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read(&path).unwrap());
    Some(paths.map(named).collect())
}

/// The page in a browser.
struct Page {
    browser: Browser,
    pictures: PathBuf,
}

impl Page {
    fn report(&self) -> Value {
        let text = self.browser.value("window.quell ? quell.report() : ''");
        let report = serde_json::from_str(text.as_str().unwrap_or_default()).unwrap_or(Value::Null);
        let words = self.words();
        assert!(report != Value::Null || !words.contains("fail"), "{words}");
        report
    }

    /// What stands in the place of the canvas; nothing where it is to be seen.
    fn words(&self) -> String {
        let words = self.browser.value("words.hidden ? '' : words.textContent");
        words.as_str().unwrap_or_default().to_owned()
    }

    /// The first report of which something is true.
    #[track_caller]
    fn until(&self, what: &str, mut is_so: impl FnMut(&Value) -> bool) -> Value {
        let start = Instant::now();
        loop {
            let report = self.report();
            if is_so(&report) {
                println!("{:6.1} s until {what}", start.elapsed().as_secs_f64());
                return report;
            }
            assert!(start.elapsed() < PATIENCE, "{what} did not come: {} {report}", self.words());
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// The report after so many further frames.
    #[track_caller]
    fn frames(&self, count: i64) -> Value {
        let number = |report: &Value| report["frame"].as_i64().unwrap_or(-1);
        let now = number(&self.report());
        self.until("frames", |report| number(report) >= now + count)
    }

    /// Where a control is, CSS pixels: a share of its extent.
    #[track_caller]
    fn at(&self, name: &str, x: f64, y: f64) -> (f64, f64) {
        // Lists open and scroll in their own time.
        let mut last = Value::Null;
        let mut since = Instant::now();
        let report = self.until(name, |report| {
            let place = &report["marks"][name];
            if *place != last {
                (last, since) = (place.clone(), Instant::now());
            }
            place.is_array() && since.elapsed() > AT_REST
        });
        let place = numbers(&report["marks"][name]);
        (place[0] + x * (place[2] - place[0]), place[1] + y * (place[3] - place[1]))
    }

    /// No further frames, and the last one is done: in software a frame takes seconds, and a button that is held from one to
    /// the next makes no click; nor does a busy browser give its picture in time.
    fn freeze(&self) {
        self.browser.value("quell.freeze(true)");
        let swift = "new Promise((done) => { let last = 0; const next = (now) => { \
             if (last && now - last < 150) done(true); else { last = now; requestAnimationFrame(next); } }; \
             setTimeout(() => requestAnimationFrame(next), 500); })";
        let start = Instant::now();
        while self.browser.awaited(swift) != Value::Bool(true) {
            assert!(start.elapsed() < PATIENCE, "frames do not end");
        }
    }

    fn go_on(&self) {
        self.browser.value("quell.freeze(false)");
    }

    /// From now on keeps what the page hands the browser to download.
    fn keep_downloads(&self) {
        self.browser.value(
            "(() => { const make = URL.createObjectURL, click = HTMLAnchorElement.prototype.click; window.saved = []; \
             URL.createObjectURL = (blob) => { saved.push(blob); return make.call(URL, blob); }; \
             HTMLAnchorElement.prototype.click = function () { window.savedAs = this.download; click.call(this); }; })()",
        );
    }

    /// The last of these, written beside the pictures.
    fn downloaded(&self) -> PathBuf {
        let text = self.browser.awaited(
            "saved.at(-1).arrayBuffer().then((bytes) => \
             btoa(Array.from(new Uint8Array(bytes), (c) => String.fromCharCode(c)).join('')))",
        );
        let name = self.browser.value("savedAs");
        let path = self.pictures.join(name.as_str().unwrap());
        let bytes = base64::engine::general_purpose::STANDARD.decode(text.as_str().unwrap()).unwrap();
        std::fs::create_dir_all(&self.pictures).unwrap();
        std::fs::write(&path, bytes).unwrap();
        path
    }

    /// Scrolls the controls until one of them is to be seen.
    #[track_caller]
    fn scroll_to(&self, name: &str) {
        let over = (60.0, 300.0);
        // The wheel turns what the pointer is over.
        self.browser.value(&format!(
            "document.querySelector('canvas').dispatchEvent(new MouseEvent('mousemove', {{ clientX: {}, clientY: {}, bubbles: true }}))",
            over.0, over.1
        ));
        for _ in 0..12 {
            let (_, y) = self.at(name, 0.5, 0.5);
            if (4.0..640.0).contains(&y) {
                return;
            }
            self.browser.wheel(over, if y > 0.0 { 400 } else { -400 });
        }
        panic!("{name} does not come into view");
    }

    #[track_caller]
    fn click(&self, name: &str) {
        let at = self.at(name, 0.5, 0.5);
        self.browser.drag(at, at);
    }

    /// A drag across the canvas, a step every few frames of the page: one within a single frame is none.
    fn drag(&self, from: (f64, f64), to: (f64, f64)) {
        let half = (0.5 * (from.0 + to.0), 0.5 * (from.1 + to.1));
        let steps = [
            ("MouseEvent", "mousemove", from),
            ("PointerEvent", "pointerdown", from),
            ("MouseEvent", "mousemove", half),
            ("MouseEvent", "mousemove", to),
            ("PointerEvent", "pointerup", to),
        ];
        for (kind, name, (x, y)) in steps {
            let at = format!("clientX: {x}, clientY: {y}, button: 0, buttons: 1, bubbles: true");
            let sent = self.browser.awaited(&format!(
                "document.querySelector('canvas').dispatchEvent(new {kind}('{name}', {{ {at} }})) | \
                 await new Promise((done) => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(done)), 100))"
            ));
            assert!(sent.is_number(), "{sent}");
        }
    }

    /// A picture of the frozen page; mean brightness and steps between neighbours of the last pane, or of all.
    fn look(&self, name: &str, all: bool) -> (f64, f64) {
        let path = self.pictures.join(name);
        self.browser.screenshot(&path);
        let picture = image::open(path).unwrap().into_rgb8();
        let report = self.report();
        let area = numbers(&report["marks"]["picture"]);
        let split = numbers(&report["splits"]).last().copied().filter(|_| !all).unwrap_or(0.0);
        // A picture's pixel is several of the page's.
        let pixel = (area[2] - area[0]) / report["size"][0].as_f64().unwrap();
        let at = |x: f64, y: f64| picture.get_pixel(x as u32, y as u32).0.map(f64::from);
        // A grey thing before a blue sky may be as bright.
        let step = |a: [f64; 3], b: [f64; 3]| (0..3).map(|c| (a[c] - b[c]).abs()).sum::<f64>() / 3.0;
        let (mut sum, mut steps, mut count) = (0.0, 0.0, 0.0);
        let mut y = area[1] + 24.0;
        while y < area[3] - pixel {
            let mut x = area[0] + split * (area[2] - area[0]) + 6.0;
            while x < area[2] - 2.0 * pixel {
                sum += at(x, y).iter().sum::<f64>() / 3.0;
                steps += step(at(x, y), at(x + pixel, y));
                count += 1.0;
                x += pixel;
            }
            y += pixel;
        }
        println!("{name}: light {:.1}, steps {:.2}", sum / count, steps / count);
        (sum / count, steps / count)
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap_or_else(|| panic!("{value}")).iter().map(|v| v.as_f64().unwrap()).collect()
}

/// A blue picture of 8x4 texels.
fn sky() -> Vec<u8> {
    let mut bytes = Vec::new();
    let texels = [image::Rgb([0.2_f32, 0.4, 3.0]); 32];
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&texels, 8, 4).unwrap();
    bytes
}

#[test]
fn the_page_is_opened_used_and_refuses_in_words() {
    let Some(files) = files() else { return };
    let _alone = ALONE.lock();
    let bytes: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    println!("{bytes} bytes");
    assert!(bytes < LARGEST, "the page has {bytes} bytes");
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/gltf");
    let room = std::fs::read(corpus.join("rich.glb")).unwrap();
    let further = [
        ("rooms/rich.glb".to_owned(), room.clone()),
        ("cut.glb".to_owned(), room[..room.len() / 2].to_vec()),
        ("no.gltf".to_owned(), b"{ \"asset\": ".to_vec()),
        ("sky.hdr".to_owned(), sky()),
        ("cut.exr".to_owned(), b"nothing of the kind".to_vec()),
    ];
    let server = Server::start(files.into_iter().chain(further).collect());
    let Some(browser) = Browser::start_with(640, 700, &SOFTWARE) else {
        skipped("there is no chromium");
        return;
    };
    let pictures = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("live-page");
    let _ = std::fs::remove_dir_all(&pictures);
    let page = Page { browser, pictures };

    page.browser.visit(&server.address("index.html?scene=cornell-box&size=128x72"));
    let begin = page.until("three frames", |report| report["frame"].as_i64() >= Some(3));
    assert_eq!((&begin["scene"], &begin["error"]), (&"cornell-box".into(), &Value::Null));
    assert_eq!(numbers(&begin["size"]), [128.0, 72.0]);
    assert_eq!(page.words(), "");
    // The picture has the light of a lit room, and is no even grey.
    page.freeze();
    let (light, steps) = page.look("begin.png", false);
    assert!(light > 40.0 && light < 220.0 && steps > 1.0);

    // The running frame's planes are those that were traced.
    page.keep_downloads();
    page.scroll_to("save EXR");
    page.click("save EXR");
    let said = page.until("an EXR", |report| report["said"].is_string() || report["error"].is_string());
    let path = page.downloaded();
    println!("{}: {} bytes", path.display(), std::fs::metadata(&path).unwrap().len());
    assert!(said["said"].as_str().unwrap().ends_with(path.file_name().unwrap().to_str().unwrap()), "{said}");
    let planes = quell_frames::read_frame(&path).unwrap();
    assert_eq!((planes.frame.size, planes.metadata.scene.as_str()), (quell::Size::new(128, 72), "cornell-box"));
    assert_eq!(Some(planes.frame.index), said["frame"].as_i64());
    let depth = planes.frame.view_depth.unwrap();
    assert!(depth.data().iter().filter(|d| d.is_finite() && **d > 0.0).count() > 1000);
    assert!(planes.frame.matte.unwrap().data().iter().flatten().sum::<f32>() > 100.0);

    page.scroll_to("scene");
    page.click("scene");
    page.click("scene disocclusion");
    page.until("another scene", |report| report["scene"] == "disocclusion");

    // Refused in words; what is shown stays, and goes on.
    for (file, words) in [
        ("cut.glb", "cut.glb"),
        ("no.gltf", "no.gltf"),
        ("cut.exr", "cut.exr cannot be decoded"),
        ("none.glb", "404"),
        ("cornel-box", "did you mean cornell-box"),
    ] {
        page.browser.value(&format!("quell.open('{file}')"));
        let refused = page.until(file, |report| report["error"].is_string());
        let said = refused["error"].as_str().unwrap();
        println!("{said}");
        assert!(said.contains(words), "{said}");
        assert_eq!(refused["scene"], "disocclusion");
    }
    page.look("refused.png", false);
    page.go_on();
    page.frames(2);
    page.freeze();

    // Pointer, wheel and keys.
    let before = page.report();
    page.drag(page.at("picture", 0.7, 0.3), page.at("picture", 0.8, 0.4));
    let turned = page.until("another direction", |report| report["forward"] != before["forward"]);
    assert_eq!(turned["camera"], "Orbit");
    page.browser.wheel(page.at("picture", 0.7, 0.5), -200);
    let nearer = page.until("a nearer eye", |report| report["eye"] != turned["eye"]);
    assert_eq!(nearer["camera"], "Orbit");
    // A view outlives the page.
    page.click("save view");
    page.until("a saved view", |report| report["views"] == 1);
    page.click("fly");
    page.until("a flight", |report| report["camera"] == "Fly");
    page.drag(page.at("split 1", 0.5, 0.6), page.at("picture", 0.2, 0.6));
    page.until("a split elsewhere", |report| numbers(&report["splits"])[0] < 0.4);
    // What renderers build themselves, beside it.
    page.click("a-trous");
    page.click("SVGF");
    page.go_on();
    page.frames(2);
    page.freeze();
    let used = page.report();
    assert_eq!(used["panes"], serde_json::json!(["noisy", "a-trous", "SVGF", "quell"]));
    assert_eq!(used["error"], before["error"], "nothing new is refused");
    page.look("used.png", false);

    // A file by the address, without controls; a click brings them, Tab hides them.
    let file = "index.html?scene=rooms/rich.glb&environment=sky.hdr&environment-strength=2&size=128x72&panel=off";
    page.browser.visit(&server.address(file));
    let file = page.until("a file's frames", |report| report["frame"].as_i64() >= Some(2));
    assert_eq!((&file["scene"], &file["error"]), (&"rooms/rich.glb".into(), &Value::Null));
    assert_eq!(file["environment"], "sky.hdr");
    assert!(file["marks"]["scene"].is_null());
    page.freeze();
    let (light, steps) = page.look("file.png", true);
    assert!(light > 3.0 && steps > 0.2);
    page.click("controls");
    page.until("controls", |report| report["marks"]["scene"].is_array());
    page.browser.key("\u{e004}");
    page.until("no controls", |report| report["marks"]["scene"].is_null());
    page.go_on();
    page.browser.value("quell.open('disocclusion')");
    let found = page.until("the saved view", |report| report["scene"] == "disocclusion");
    assert_eq!((&found["views"], &found["environment"]), (&1.into(), &"sky.hdr".into()));

    let complaints = page.browser.complaints();
    let others: Vec<_> = complaints.iter().filter(|c| !c.contains("none.glb")).collect();
    assert!(others.is_empty(), "{others:?}");

    // What the page cannot begin with.
    page.browser.visit(&server.address("index.html?size=0x9"));
    page.browser.wait_for("words.textContent.includes('640x360')");
    page.browser.screenshot(&page.pictures.join("parameter.png"));
    println!("pictures of the page: {}", page.pictures.display());
}

#[test]
fn a_page_that_is_reloaded_or_loses_its_device_begins_anew() {
    let Some(files) = files() else { return };
    let _alone = ALONE.lock();
    let server = Server::start(files);
    let Some(browser) = Browser::start_with(640, 420, &SOFTWARE) else { return };
    // The other test empties its own folder.
    let pictures = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("live-page-lost");
    std::fs::create_dir_all(&pictures).unwrap();
    let page = Page { browser, pictures };
    let address = server.address("index.html?scene=cornell-box&size=128x72&panel=off");
    // While it is fetched, while its kernels are compiled, while the scene's are.
    for pause in [0, 400, 1500, 3000, 6000] {
        page.browser.visit(&address);
        std::thread::sleep(Duration::from_millis(pause));
        println!("after {pause} ms: {}", page.words());
    }
    page.browser.visit(&address);
    let begun = page.until("frames", |report| report["frame"].as_i64() >= Some(2));
    assert_eq!((&begun["scene"], &begun["error"], page.words().as_str()), (&"cornell-box".into(), &Value::Null, ""));
    assert_eq!(page.browser.complaints(), Vec::<String>::new());

    // The browser's graphics process ends in the middle of a frame.
    page.browser.post("/goog/cdp/execute", json!({ "cmd": "Browser.crashGpuProcess", "params": {} }));
    page.browser.wait_for("words.textContent.includes('Reload the page')");
    println!("{}", page.words());
    page.browser.screenshot(&page.pictures.join("lost.png"));
    assert_eq!(page.browser.value("quell.report()"), "", "no further frame");
    page.browser.visit(&address);
    page.until("frames of the page that was loaded anew", |report| report["frame"].as_i64() >= Some(1));
}

#[test]
fn a_browser_without_webgpu_is_told_so() {
    let Some(files) = files() else { return };
    let server = Server::start(files);
    let Some(browser) = Browser::start_with(640, 420, &["--disable-gpu", "--disable-features=WebGPU"]) else { return };
    browser.visit(&server.address("index.html"));
    browser.wait_for("!words.hidden && words.textContent.includes('WebGPU') && words.textContent.length > 60");
    println!("{}", browser.value("words.textContent"));
    browser.screenshot(&PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("live-page/without.png"));
    assert_eq!(browser.value("typeof window.quell"), "undefined");
}
