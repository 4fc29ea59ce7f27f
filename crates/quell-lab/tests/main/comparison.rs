//! The page of a comparison: what it holds, and that it works in a browser.

use crate::browser::Browser;
use quell::{Plane, Rgb, Size};
use quell_lab::metrics::FrameScores;
use quell_lab::report::Spread;
use quell_lab::report::comparison::{ComparisonPage, Panel, write};
use quell_lab::report::figures::ComparedMethod;
use quell_lab::report::json::NumberedScores;
use quell_lab::scorecard::{Score, Scores};
use quell_lab::tone::{Picture, Tone};
use std::path::{Path, PathBuf};

const SIZE: Size = Size::new(240, 136);
const FRAMES: usize = 6;
const ROWS: [usize; 3] = [34, 68, 102];
const METHODS: [&str; 5] = ["none", "temporal", "quell:paper", "svgf", "oidn:high"];

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// A flat colour for each sequence, so that a test knows what it sees, with a bar that moves.
fn plane(sequence: usize, frame: usize) -> Plane<Rgb> {
    let colours = [[0.2, 0.2, 0.2], [0.25, 0.05, 0.05], [0.05, 0.25, 0.05], [0.05, 0.05, 0.25], [0.2, 0.2, 0.05]];
    let bar = 20 + 12 * frame;
    Plane::from_fn(SIZE, |x, _| if (bar..bar + 8).contains(&x) { [0.9; 3] } else { colours[sequence % 5] })
}

fn panel(sequence: usize, name: &str) -> Panel {
    let picture = |f: usize| Tone::default().picture(&plane(sequence, f));
    // Error 1 in the left half, 0 in the right.
    let map = || Some(Plane::from_fn(SIZE, |x, _| if x < 120 { 1.0 } else { 0.0 }));
    let slice = |row: usize| {
        let size = Size::new(SIZE.width, FRAMES);
        let rows = (0..FRAMES).flat_map(|f| picture(f).rgb[3 * row * SIZE.width..3 * (row + 1) * SIZE.width].to_vec());
        Picture { size, rgb: rows.collect() }
    };
    Panel {
        name: name.to_owned(),
        pictures: (0..FRAMES).map(|f| (sequence > 0 || f > 0).then(|| picture(f))).collect(),
        maps: if sequence == 0 { Vec::new() } else { (0..FRAMES).map(|_| map()).collect() },
        slices: ROWS.into_iter().map(slice).collect(),
    }
}

fn scores(error: f64) -> FrameScores {
    let json = serde_json::json!({
        "rel_mse": 2.0 * error, "rel_mse_trimmed": error, "fireflies": 0.5, "psnr": 20.0 - error, "energy": 1.0 - 0.1 * error,
        "hdr_flip": error, "ssim": 1.0 - error, "flip": error,
    });
    serde_json::from_value(json).unwrap()
}

fn data() -> ComparisonPage {
    let method = |i: usize| {
        let error = [0.4, 0.2, 0.1, 0.12][i];
        let mut card = Scores::all_null("nothing moves");
        card.noise = Score::of(error / 2.0);
        card.flicker = Score::of(error / 3.0);
        card.blur = if i == 3 { Score::null("too little signal") } else { Score::of(0.3 * i as f64) };
        ComparedMethod {
            method: METHODS[i].to_owned(),
            mean: Some(scores(error)),
            frames: (0..FRAMES).map(|f| NumberedScores { frame: 100 + f as i64, scores: scores(error) }).collect(),
            scorecard: Some(card),
            milliseconds: Spread::of([[0.5, 3.0, 22.0, 60.0][i]]),
            time_ratio: Some([0.02, 0.14, 1.0, 2.7][i]),
            peak_bytes: Some((i as u64 + 1) << 22),
            ..ComparedMethod::default()
        }
    };
    let mut methods: Vec<ComparedMethod> = (0..4).map(method).collect();
    methods.push(ComparedMethod {
        method: METHODS[4].to_owned(),
        reason: Some("Open Image Denoise is not installed".to_owned()),
        ..ComparedMethod::default()
    });
    let mut panels = vec![panel(0, "reference")];
    panels.extend((0..4).map(|i| panel(i + 1, METHODS[i])));
    ComparisonPage {
        title: "glossy-room </script> & <b>".to_owned(),
        subtitle: "240x136, 6 frames".to_owned(),
        frame_numbers: (100..100 + FRAMES as i64).collect(),
        frames_per_second: 24.0,
        panels,
        slice_rows: ROWS.to_vec(),
        slice_frames: (100..100 + FRAMES as i64).collect(),
        methods,
        notes: vec!["The references' own trimmed relMSE is 1e-4.".to_owned()],
        command: "quell compare glossy-room -o out".to_owned(),
    }
}

#[test]
fn the_page_is_one_file_without_any_other() {
    let path = folder("comparison-alone").join("index.html");
    assert_eq!(write(&path, &data()).unwrap(), None);
    let page = std::fs::read_to_string(&path).unwrap();
    for outside in ["http:", "https:", "src=\"", "@import", "url("] {
        assert!(!page.contains(outside), "the page has {outside}");
    }
    assert_eq!(page.matches("</script>").count(), 2, "a title must not end the script element");
    assert!(!page.contains("{{"), "a placeholder is left");
    let mut odd = data();
    odd.panels[1].pictures[0] = Some(Picture { size: Size::new(1, 1), rgb: vec![0; 3] });
    assert!(write(&path, &odd).is_err());
}

/// The colour of the canvas at a part of its width and height.
fn colour_at(browser: &Browser, x: f64, y: f64) -> [i64; 3] {
    let value = browser.value(&format!(
        "(() => {{ const c = document.getElementById('canvas'); const p = c.getContext('2d').getImageData(\
         Math.floor(c.width * {x}), Math.floor(c.height * {y}), 1, 1).data; return [p[0], p[1], p[2]]; }})()"
    ));
    std::array::from_fn(|i| value[i].as_i64().unwrap())
}

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

fn settle() {
    std::thread::sleep(std::time::Duration::from_millis(200));
}

#[test]
fn the_page_works_in_a_browser() {
    let Some(browser) = Browser::start(1440, 1100) else { return };
    let place_of_page = folder("comparison-browser");
    let path = place_of_page.join("index.html");
    let data = data();
    write(&path, &data).unwrap();
    let shown = |sequence: usize| {
        let picture = Tone::default().picture(&plane(sequence, 5));
        [0, 1, 2].map(|c| i64::from(picture.rgb[3 * 200 + c]))
    };
    browser.open(&path);
    browser.wait_for("document.body.dataset.ready === 'true'");
    assert_eq!(browser.value("document.getElementById('title').textContent"), data.title);
    browser.screenshot(&place_of_page.join("grid.png"));

    // The grid shows every method that has pictures; the absent one is struck out, with its reason.
    browser.wait_for("document.body.dataset.panels === '5' && document.body.dataset.frame === '105'");
    assert_eq!(browser.value("document.querySelectorAll('.chip').length"), 5);
    assert_eq!(browser.value("document.querySelectorAll('#chips button:disabled').length"), 1);
    browser.click("#chips button:nth-child(2)");
    browser.wait_for("document.body.dataset.panels === '4'");
    browser.click("#chips button:nth-child(2)");
    browser.wait_for("document.body.dataset.panels === '5'");

    // Stepping; the reference lacks the first frame.
    browser.key("\u{e014}");
    browser.wait_for("document.body.dataset.frame === '100' && document.querySelectorAll('.absent span').length === 1");
    browser.key("\u{e012}");
    browser.wait_for("document.body.dataset.frame === '105'");
    browser.click("#step-back");
    browser.wait_for("document.body.dataset.frame === '104'");
    browser.click("#step-forward");
    browser.wait_for("document.body.dataset.frame === '105'");

    // One method; flipping in place.
    browser.key("4");
    browser.wait_for("document.body.dataset.mode === 'one' && document.querySelectorAll('.chip').length === 1");
    settle();
    close(colour_at(&browser, 0.85, 0.5), shown(3), "the fourth alone");
    browser.key("]");
    settle();
    close(colour_at(&browser, 0.85, 0.5), shown(4), "the next one");

    // FLIP maps: 1 is the lightest colour of the map, 0 its darkest (JPEG keeps them within a few steps).
    browser.key("e");
    browser.wait_for("document.body.dataset.errors === 'true' && !document.getElementById('legend').hidden");
    std::thread::sleep(std::time::Duration::from_millis(400));
    close(colour_at(&browser, 0.4, 0.5), [252, 253, 191], "error 1");
    close(colour_at(&browser, 0.6, 0.5), [0, 0, 4], "error 0");
    browser.key("g");
    settle();
    browser.screenshot(&place_of_page.join("maps.png"));
    browser.click("#errors");
    browser.wait_for("document.body.dataset.errors === 'false'");

    // The wipe between any two: by mouse and keyboard.
    browser.key("w");
    browser.wait_for("document.body.dataset.mode === 'wipe' && !document.getElementById('divider').hidden");
    settle();
    close(colour_at(&browser, 0.3, 0.5), shown(1), "left of the wipe: the noisy input");
    close(colour_at(&browser, 0.85, 0.5), shown(2), "right of the wipe: the first method");
    let choose = "(() => { const s = document.getElementById('wipe-b'); s.value = '4'; \
                  s.dispatchEvent(new Event('change')); return true; })()";
    assert_eq!(browser.value(choose), true);
    settle();
    close(colour_at(&browser, 0.85, 0.5), shown(4), "another one");
    browser.drag(place(&browser, "divider", 0.5, 0.5), place(&browser, "viewer", 0.25, 0.5));
    browser.wait_for("document.getElementById('divider').getAttribute('aria-valuenow') < 40");
    let at = browser.value("+document.getElementById('divider').getAttribute('aria-valuenow')").as_f64().unwrap();
    browser.key("\u{e014}");
    browser.wait_for(&format!("document.getElementById('divider').getAttribute('aria-valuenow') > {at}"));
    assert_eq!(browser.value("document.body.dataset.frame"), "105", "arrows move the divider that has the focus");
    browser.screenshot(&place_of_page.join("wipe.png"));

    // Zoom is common to all.
    browser.key("g");
    browser.wait_for("document.body.dataset.mode === 'grid'");
    let before = browser.value("+document.body.dataset.zoom").as_f64().unwrap();
    browser.wheel(place(&browser, "viewer", 0.2, 0.2), -240);
    browser.wait_for(&format!("+document.body.dataset.zoom > {before} * 1.4"));
    browser.click("#zoom-in");
    browser.key("f");
    browser.wait_for(&format!("Math.abs(+document.body.dataset.zoom - {before}) < 0.01"));

    // Slices: the bar moves to the right as time runs down.
    browser.key("x");
    browser.wait_for("document.body.dataset.mode === 'slice' && document.querySelectorAll('.chip').length === 5");
    settle();
    let bar = "(() => { const c = document.getElementById('canvas'); const g = c.getContext('2d'); const w = \
               Math.floor(c.width / 3), h = Math.floor(c.height / 2); const at = (y) => { const d = g.getImageData(0, \
               Math.floor(h * y), w, 1).data; for (let i = 20; i < w; i++) if (d[4 * i] > 200 && d[4 * i + 1] > 200) \
               return i / w; return -1; }; return [at(0.3), at(0.75)]; })()";
    let found = browser.value(bar);
    assert!(found[1].as_f64().unwrap() > found[0].as_f64().unwrap() + 0.05, "{found}");
    browser.screenshot(&place_of_page.join("slices.png"));
    browser.key("s");
    browser.key(" ");
    browser.wait_for("document.body.classList.contains('playing')");
    browser.wait_for("document.body.dataset.frame === '101'");
    browser.key(" ");
    browser.wait_for("!document.body.classList.contains('playing')");

    // Tables: the best is marked, what is missing has its reason, a row leads to its pictures.
    assert_eq!(browser.value("document.querySelectorAll('#table-pictures tbody tr').length"), 5);
    assert_eq!(browser.value("document.querySelectorAll('#table-scorecard th').length"), 11);
    let best =
        "document.querySelector('#table-pictures tr[data-method=\"quell:paper\"]').querySelectorAll('.best').length";
    assert!(browser.value(best).as_i64().unwrap() >= 4);
    let reasons = browser.value("document.getElementById('missing').textContent");
    for expected in ["not installed", "blur of svgf", "nothing moves"] {
        assert!(reasons.as_str().unwrap().contains(expected), "{reasons}");
    }
    browser.click("#table-scorecard tr[data-method=\"svgf\"]");
    browser.wait_for("document.body.dataset.mode === 'one' && document.getElementById('one-method').value === '4'");
    // The plot: one point a method with a time, but for the noisy input; another figure, other points.
    assert_eq!(browser.value("document.querySelectorAll('#plot circle').length"), 3);
    let y = "document.querySelector('#plot svg').getAttribute('aria-label')";
    let before = browser.value(y);
    let choose = "(() => { const s = document.getElementById('plot-figure'); s.value = 'blur'; \
                  s.dispatchEvent(new Event('change')); return document.querySelectorAll('#plot circle').length; })()";
    assert_eq!(browser.value(choose), 2);
    assert_ne!(browser.value(y), before);
    browser.value("document.getElementById('scores').scrollIntoView()");
    browser.screenshot(&place_of_page.join("tables.png"));

    let unnamed = browser.value(
        "[...document.querySelectorAll('button, input, select, [role=slider]')].filter((e) => \
         !(e.textContent.trim() || e.getAttribute('aria-label'))).length",
    );
    assert_eq!(unnamed, 0);
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

#[test]
fn the_page_fits_a_narrow_window() {
    let Some(browser) = Browser::start(500, 880) else { return };
    let path = folder("comparison-narrow").join("index.html");
    write(&path, &data()).unwrap();
    browser.open(&path);
    browser.wait_for("document.body.dataset.ready === 'true'");
    browser.screenshot(&folder("comparison-narrow").join("narrow.png"));
    assert_eq!(browser.value("document.documentElement.scrollWidth <= window.innerWidth"), true, "nothing sticks out");
    assert_eq!(browser.complaints(), Vec::<String>::new());
}
