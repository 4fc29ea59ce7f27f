//! The player page: what it holds, and that it works in a browser.

use crate::browser::Browser;
use quell::{Plane, Rgb, Size};
use quell_lab::report::player::{PlayerData, PlayerSequence, write};
use quell_lab::report::table::Table;
use quell_lab::tone::{Picture, Tone};
use std::path::{Path, PathBuf};

const SIZE: Size = Size::new(240, 136);
const FRAMES: usize = 6;
/// The only frame with a reference.
const REFERENCE_FRAME: usize = 3;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// A ball on a chequered floor; moves with time.
fn scene(x: usize, y: usize, frame: usize) -> Rgb {
    let (u, v) = (x as f32 / SIZE.width as f32, y as f32 / SIZE.height as f32);
    let aspect = SIZE.width as f32 / SIZE.height as f32;
    let (dx, dy) = ((u - 0.3 - 0.06 * frame as f32) * aspect, v - 0.5);
    let r2 = (dx * dx + dy * dy) / 0.0784;
    if r2 < 1.0 {
        let shade = ((1.0 - r2).sqrt() * 0.8 - dx - dy).max(0.05);
        return [0.9 * shade, 0.35 * shade, 0.2 * shade];
    }
    if v > 0.62 {
        let depth = 0.2 / (v - 0.55);
        let tile = ((u - 0.5) * depth * 8.0 + 40.0) as usize + (depth * 3.0) as usize;
        let shade = if tile.is_multiple_of(2) { 0.6 } else { 0.15 };
        return [shade, shade * 0.95, shade * 0.85];
    }
    [0.12 + 0.3 * u, 0.16 + 0.25 * u, 0.25 + 0.1 * v]
}

fn data() -> PlayerData {
    let clean = |f: usize| Plane::from_fn(SIZE, |x, y| scene(x, y, f));
    let mut state = 1u32;
    let mut grain = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let v = (state >> 8) as f32 / 16_777_216.0;
        if v < 0.25 { 4.0 * v * 3.2 } else { 0.2 }
    };
    let mut noisy = |f: usize| {
        Plane::from_fn(SIZE, |x, y| {
            let k = grain() + 0.1;
            scene(x, y, f).map(|v| v * k)
        })
    };
    let picture = |plane: &Plane<Rgb>| Some(Tone::default().picture(plane));
    let only = |f: usize, picture: Option<Picture>| if f == REFERENCE_FRAME { picture } else { None };
    // The error map is 1 in the left half and 0 in the right: a colour that the test knows.
    let map = |f: usize| (f == REFERENCE_FRAME).then(|| Plane::from_fn(SIZE, |x, _| if x < 120 { 1.0 } else { 0.0 }));
    let sequence = |name: &str, description: &str, pictures: Vec<Option<Picture>>, errors: Vec<Option<Plane<f32>>>| {
        PlayerSequence { name: name.to_owned(), description: description.to_owned(), pictures, error_maps: errors }
    };
    let mut metrics = Table::new(["method", "relMSE", "trimmed", "lower by", "PSNR dB", "HDR-FLIP", "energy"]);
    let cells = |row: [&str; 7]| row.map(str::to_owned);
    metrics.push(cells(["noisy", "0.911", "0.842", "1.0x", "18.20", "0.4311", "1.0004"]));
    metrics.push(cells(["quell:paper", "0.0132", "0.0124", "67.9x", "33.06", "0.0712", "0.9991"]));
    let mut stages = Table::new(["stage", "paper", "median ms", "min", "max", "bytes/pixel", "floor ms"]);
    for (name, stage, ms) in [
        ("matte_temporal", "3", "2.41"),
        ("matte_prefilter", "4", "3.02"),
        ("matte_bilateral", "7", "9.87"),
        ("glossy_temporal", "8", "4.40"),
        ("sum", "", "19.70"),
    ] {
        stages.push([name, stage, ms, ms, ms, "48", "0.31"].map(str::to_owned));
    }
    PlayerData {
        title: "glossy-room </script> & <b>".to_owned(),
        subtitle: "240x136, 6 frames, 1 matte and 1 glossy path a pixel, preset paper".to_owned(),
        frame_numbers: (0..FRAMES).map(|f| 101 + f as i64).collect(),
        frames_per_second: 24.0,
        sequences: vec![
            sequence(
                "noisy",
                "one matte and one glossy path a pixel, as the renderer made it",
                (0..FRAMES).map(|f| picture(&noisy(f))).collect(),
                (0..FRAMES).map(map).collect(),
            ),
            sequence(
                "denoised",
                "the same, filtered",
                (0..FRAMES).map(|f| picture(&clean(f))).collect(),
                (0..FRAMES).map(map).collect(),
            ),
            sequence(
                "reference",
                "4096 paths a pixel",
                (0..FRAMES).map(|f| only(f, picture(&clean(f)))).collect(),
                vec![],
            ),
        ],
        metrics,
        stages,
        notes: vec!["Only frame 104 has a reference.".to_owned()],
        command: "quell demo -o quell-demo".to_owned(),
    }
}

#[test]
fn the_page_is_one_file_without_any_other() {
    let path = folder("player-alone").join("index.html");
    let written = write(&path, &data()).unwrap();
    let page = std::fs::read_to_string(&path).unwrap();
    assert_eq!((written.bytes, written.reduced), (page.len(), None));
    for outside in ["http:", "https:", "src=\"", "@import", "url("] {
        assert!(!page.contains(outside), "the page has {outside}");
    }
    assert_eq!(page.matches("</script>").count(), 2, "a title must not end the script element");
    assert!(!page.contains("{{"), "a placeholder is left");
    assert!(write(&path, &PlayerData::default()).is_err());
    let mut odd = data();
    odd.sequences[1].pictures[0] = Some(Picture { size: Size::new(1, 1), rgb: vec![0; 3] });
    assert!(write(&path, &odd).is_err());
}

/// JavaScript: the colour of the canvas at a part of its width and height.
fn colour_at(browser: &Browser, x: f64, y: f64) -> [i64; 3] {
    let value = browser.value(&format!(
        "(() => {{ const c = document.getElementById('canvas'); const p = c.getContext('2d').getImageData(\
         Math.floor(c.width * {x}), Math.floor(c.height * {y}), 1, 1).data; return [p[0], p[1], p[2]]; }})()"
    ));
    std::array::from_fn(|i| value[i].as_i64().unwrap())
}

/// Window coordinates of a part of an element.
fn place(browser: &Browser, id: &str, x: f64, y: f64) -> (f64, f64) {
    let b = browser.value(&format!(
        "(() => {{ const b = document.getElementById('{id}').getBoundingClientRect(); \
         return [b.left, b.top, b.width, b.height]; }})()"
    ));
    let at = |i: usize| b[i].as_f64().unwrap();
    (at(0) + at(2) * x, at(1) + at(3) * y)
}

#[track_caller]
fn close(found: [i64; 3], expected: [i64; 3], what: &str) {
    let far = found.iter().zip(&expected).any(|(a, b)| (a - b).abs() > 6);
    assert!(!far, "{what}: {found:?}, expected {expected:?}");
}

#[test]
fn the_page_works_in_a_browser() {
    let Some(browser) = Browser::start(1440, 1200) else { return };
    let path = folder("player-browser").join("index.html");
    let data = data();
    write(&path, &data).unwrap();
    let shown = |sequence: usize, frame: usize, x: usize, y: usize| {
        let picture = data.sequences[sequence].pictures[frame].as_ref().unwrap();
        let at = 3 * (y * SIZE.width + x);
        [0, 1, 2].map(|c| i64::from(picture.rgb[at + c]))
    };
    browser.open(&path);
    browser.wait_for("document.body.dataset.ready === 'true'");
    assert_eq!(browser.value("document.getElementById('title').textContent"), data.title);
    let pictures = folder("player-browser");
    browser.screenshot(&pictures.join("side.png"));

    // It opens on the frame that has everything, side by side. In a wall without texture all panels agree.
    browser.wait_for("document.body.dataset.frame === '104' && document.body.dataset.mode === 'side'");
    close(colour_at(&browser, 0.5, 0.3), shown(1, 3, 120, 41), "middle of the middle panel");
    assert_eq!(browser.value("document.querySelectorAll('.chip').length"), 3);
    assert_eq!(browser.value("document.querySelectorAll('.absent').length"), 0);
    assert_eq!(browser.value("document.querySelectorAll('#ticks i').length"), 1);

    // The next frame has no reference: the page says so and leads back.
    browser.key("\u{e014}");
    browser.wait_for("document.body.dataset.frame === '105'");
    browser.screenshot(&pictures.join("absent.png"));
    browser.click(".absent button");
    browser.wait_for("document.body.dataset.frame === '104'");
    browser.key("\u{e012}");
    browser.wait_for("document.body.dataset.frame === '103'");
    browser.click("#step-forward");
    browser.wait_for("document.body.dataset.frame === '104'");

    // One picture alone.
    browser.key("3");
    browser.wait_for("document.body.dataset.mode === 'one' && document.querySelectorAll('.chip').length === 1");
    close(colour_at(&browser, 0.5, 0.3), shown(2, 3, 120, 41), "reference alone");
    browser.key("4");
    browser.wait_for("document.body.dataset.mode === 'side'");

    // Error maps: 1 is the lightest colour of the map, 0 its darkest.
    browser.key("e");
    browser.wait_for("document.body.dataset.errors === 'true' && !document.getElementById('legend').hidden");
    browser.key("2");
    browser.wait_for("document.body.dataset.mode === 'one'");
    std::thread::sleep(std::time::Duration::from_millis(300));
    close(colour_at(&browser, 0.4, 0.5), [252, 253, 191], "error 1");
    close(colour_at(&browser, 0.6, 0.5), [0, 0, 4], "error 0");
    browser.screenshot(&pictures.join("errors.png"));
    browser.click("#errors");
    browser.wait_for("document.body.dataset.errors === 'false'");

    // The wipe: noisy left, denoised right; the divider moves with the mouse and with the keyboard.
    browser.key("w");
    browser.wait_for("document.body.dataset.mode === 'wipe' && !document.getElementById('divider').hidden");
    close(colour_at(&browser, 0.7, 0.3), shown(1, 3, 168, 41), "right of the wipe");
    browser.screenshot(&pictures.join("wipe.png"));
    browser.drag(place(&browser, "divider", 0.5, 0.5), place(&browser, "viewer", 0.25, 0.5));
    browser.wait_for("Math.abs(document.getElementById('divider').getAttribute('aria-valuenow') - 25) <= 1");
    browser.key("\u{e014}");
    browser.wait_for("Math.abs(document.getElementById('divider').getAttribute('aria-valuenow') - 27) <= 1");
    assert_eq!(browser.value("document.body.dataset.frame"), "104", "arrows move the divider that has the focus");
    let right_of_divider = colour_at(&browser, 0.35, 0.3);

    // Zoom: by wheel about the pointer, by button and key; pixels become squares of one colour.
    let before = browser.value("+document.body.dataset.zoom").as_f64().unwrap();
    browser.wheel(place(&browser, "viewer", 0.35, 0.3), -240);
    browser.wait_for(&format!("+document.body.dataset.zoom > {before} * 1.5"));
    close(colour_at(&browser, 0.35, 0.3), right_of_divider, "the point under the pointer stays");
    browser.key("1");
    browser.wait_for("document.body.dataset.mode === 'one'");
    for _ in 0..6 {
        browser.click("#zoom-in");
    }
    browser.key("+");
    browser.wait_for("+document.body.dataset.zoom > 40");
    let colours = browser.value(
        "(() => { const c = document.getElementById('canvas'); const d = c.getContext('2d').getImageData(0, 200, \
         c.width, 1).data; const s = new Set(); for (let i = 0; i < d.length; i += 4) s.add(d[i] + ',' + d[i + 1]); \
         return [s.size, c.width]; })()",
    );
    let (distinct, width) = (colours[0].as_f64().unwrap(), colours[1].as_f64().unwrap());
    assert!(distinct > 4.0 && distinct < width / 20.0, "{distinct} colours over {width} pixels are no squares");
    browser.screenshot(&pictures.join("zoom.png"));
    // Dragging moves the pictures.
    let colour = colour_at(&browser, 0.5, 0.5);
    browser.drag(place(&browser, "viewer", 0.5, 0.5), place(&browser, "viewer", 0.6, 0.5));
    browser.wait_for("!document.getElementById('viewer').classList.contains('dragging')");
    std::thread::sleep(std::time::Duration::from_millis(100));
    close(colour_at(&browser, 0.6, 0.5), colour, "the pixel moved with the mouse");
    let at = browser.value("document.getElementById('readout').textContent");
    assert!(at.as_str().unwrap().starts_with("pixel "), "{at}");
    browser.key("f");
    browser.wait_for("+document.body.dataset.zoom < 10");

    // The slice over time, then playing.
    browser.key("x");
    browser.wait_for("document.body.dataset.mode === 'slice'");
    std::thread::sleep(std::time::Duration::from_millis(200));
    close(colour_at(&browser, 0.5, 0.75), shown(1, 4, 120, 68), "row 68 of frame 105");
    browser.screenshot(&pictures.join("slice.png"));
    browser.key("s");
    browser.key(" ");
    browser.wait_for("document.body.classList.contains('playing')");
    browser.wait_for("document.body.dataset.frame === '106'");
    browser.wait_for("document.body.dataset.frame === '101'");
    browser.key(" ");
    browser.wait_for("!document.body.classList.contains('playing')");
    let frame = browser.value("document.body.dataset.frame");
    std::thread::sleep(std::time::Duration::from_millis(200));
    assert_eq!(browser.value("document.body.dataset.frame"), frame, "paused");

    // Tables and texts, as text.
    assert_eq!(browser.value("document.querySelectorAll('#metrics tbody tr').length"), 2);
    assert_eq!(browser.value("document.querySelectorAll('#stages tbody tr').length"), 5);
    assert_eq!(browser.value("document.getElementById('command').textContent"), data.command);
    // Every control can be named by a screen reader.
    let unnamed = browser.value(
        "[...document.querySelectorAll('button, input, select, [role=slider]')].filter((e) => \
         !(e.textContent.trim() || e.getAttribute('aria-label'))).length",
    );
    assert_eq!(unnamed, 0);
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

#[test]
fn the_page_fits_a_narrow_window() {
    let Some(browser) = Browser::start(500, 900) else { return };
    let path = folder("player-narrow").join("index.html");
    write(&path, &data()).unwrap();
    browser.open(&path);
    browser.wait_for("document.body.dataset.ready === 'true'");
    browser.screenshot(&folder("player-narrow").join("narrow.png"));
    assert_eq!(browser.value("document.documentElement.scrollWidth <= window.innerWidth"), true, "nothing sticks out");
    assert_eq!(browser.complaints(), Vec::<String>::new());
}
