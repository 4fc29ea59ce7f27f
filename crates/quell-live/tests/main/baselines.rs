//! The a-trous wavelet and SVGF on the device against those of the lab, on the same frames.

use super::device::{choice, device, sight};
use quell::{Frame, Plane, Rgb, Size};
use quell_lab::methods::{Input, Method, atrous, svgf};
use quell_lab::tone::Tone;
use quell_live::{AtrousConstants, BaselineConstants, Choice, Engine, Pane, SvgfConstants};

const SIZE: Size = Size::new(64, 36);
const FRAMES: u32 = 6;

/// Both beside each other: SVGF left, a-trous right.
fn both() -> Choice {
    let mut choice = Choice { panes: vec![Pane::Svgf, Pane::Atrous], splits: vec![0.5], ..choice() };
    // Direct light as traced, which is what the lab's methods show.
    choice.settings.set("direct_taa.enabled", "off").unwrap();
    choice
}

/// Share of the values of one half of the picture (0: left) that differ by more than `by` of 255.
fn beyond(shown: &[u8], expected: &Plane<Rgb>, exposure: f32, half: usize, by: u8) -> f64 {
    let expected = Tone { exposure }.picture(expected).rgb;
    let columns = half * SIZE.width / 2..(half + 1) * SIZE.width / 2;
    let pixels = (0..SIZE.height).flat_map(|y| columns.clone().map(move |x| y * SIZE.width + x));
    let values: Vec<(u8, u8)> = pixels
        .flat_map(|i| (0..3).map(move |c| (4 * i + c, 3 * i + c)))
        .map(|(a, b)| (shown[a], expected[b]))
        .collect();
    values.iter().filter(|(a, b)| a.abs_diff(*b) > by).count() as f64 / values.len() as f64
}

fn denoised(method: &mut dyn Method, frame: &Frame<'_>) -> Plane<Rgb> {
    method.denoise(&Input { frame, halves: None }).unwrap()
}

/// The lab's methods with the same constants.
fn of_lab(constants: &BaselineConstants) -> (svgf::Constants, atrous::Constants) {
    let SvgfConstants { colour_alpha, moments_alpha, levels, feedback, sigma_z, sigma_l } = constants.svgf;
    let (levels, feedback) = (levels as usize, feedback as usize);
    let svgf = svgf::Constants { colour_alpha, moments_alpha, levels, feedback, sigma_z, sigma_l };
    let AtrousConstants { levels, colour, normal, position } = constants.atrous;
    (svgf, atrous::Constants { levels: levels as usize, colour, normal, position })
}

#[test]
fn constants_are_those_of_the_lab() {
    let of_svgf = |svgf| of_lab(&BaselineConstants { svgf, ..BaselineConstants::default() }).0;
    let presets = SvgfConstants::PRESETS.map(|(name, svgf)| (name, of_svgf(svgf)));
    assert_eq!(presets, svgf::VARIANTS);
    assert_eq!(of_lab(&BaselineConstants::default()), (svgf::Constants::PAPER, atrous::Constants::default()));
}

/// Runs both on the device and in the lab, which must agree at every frame; at the last one the planted differences must be
/// seen: half of the picture, name, method, and whether it forgets its history before every frame.
fn compare(constants: &BaselineConstants, frames: u32, mut planted: Vec<(usize, &str, Box<dyn Method>, bool)>) {
    let Some(device) = device() else { return };
    let mut engine = device.engine(SIZE);
    let exposure = engine.stage().unwrap().scene().exposure;
    let (svgf, atrous) = of_lab(constants);
    let mut lab = [Box::new(svgf::Svgf::new("svgf", svgf)) as Box<dyn Method>, Box::new(atrous::Atrous::new(atrous))];
    for number in 0..frames {
        let sight = sight(&engine, f64::from(number));
        device.show(&mut engine, &sight, &Choice { baselines: *constants, ..both() }).unwrap();
        let shown = device.picture(&engine);
        let planes = device.planes(&engine).frame;
        let frame = planes.frame(&[]);
        for (half, method) in lab.iter_mut().enumerate() {
            let expected = denoised(method.as_mut(), &frame);
            let [few, more] = [1, 4].map(|by| beyond(&shown, &expected, exposure, half, by));
            println!(
                "frame {number}, {}: {few:.4} of the values differ by more than 1 of 255, {more:.4} by more than 4",
                method.name()
            );
            assert!(few < 0.002 && more < 0.0005, "frame {number}, {}: {few} {more}", method.name());
            let noisy = beyond(&shown, &frame.composite(), exposure, half, 4);
            assert!(noisy > 0.3, "nothing was filtered: {noisy}");
        }
        for (half, name, method, forgets) in &mut planted {
            if *forgets {
                method.reset();
            }
            let wrong = denoised(method.as_mut(), &frame);
            let seen = beyond(&shown, &wrong, exposure, *half, 1);
            println!("frame {number}, planted {name}: {seen:.4}");
            assert!(number + 1 < frames || seen > 0.01, "planted {name} was not seen: {seen}");
        }
    }
}

#[test]
fn baselines_are_those_of_the_lab() {
    let paper = svgf::Constants::PAPER;
    let fitted = atrous::Constants::default();
    // Differences that must be seen: constants, and history that is forgotten.
    let planted: Vec<(usize, &str, Box<dyn Method>, bool)> = vec![
        (0, "sigma_l", Box::new(svgf::Svgf::new("svgf", svgf::Constants { sigma_l: 8.0, ..paper })), false),
        (0, "alpha", Box::new(svgf::Svgf::new("svgf", svgf::Constants { colour_alpha: 0.6, ..paper })), false),
        (0, "feedback", Box::new(svgf::Svgf::new("svgf", svgf::Constants { feedback: 1, ..paper })), false),
        (0, "levels", Box::new(svgf::Svgf::new("svgf", svgf::Constants { levels: 4, ..paper })), false),
        (0, "history", Box::new(svgf::Svgf::new("svgf", paper)), true),
        (1, "colour", Box::new(atrous::Atrous::new(atrous::Constants { colour: 10.0, ..fitted })), false),
        (1, "normal", Box::new(atrous::Atrous::new(atrous::Constants { normal: 0.03, ..fitted })), false),
        (1, "position", Box::new(atrous::Atrous::new(atrous::Constants { position: 0.03, ..fitted })), false),
    ];
    compare(&BaselineConstants::default(), FRAMES, planted);
}

/// The later constants of SVGF's authors and other ones of a-trous; then ones at which the last level is the history.
#[test]
fn other_constants_reach_the_shaders() {
    let atrous = AtrousConstants { levels: 3, colour: 8.0, normal: 0.1, position: 0.02 };
    let (later, other) = of_lab(&BaselineConstants { svgf: SvgfConstants::LATER, atrous });
    let planted: Vec<(usize, &str, Box<dyn Method>, bool)> = vec![
        (0, "alpha", Box::new(svgf::Svgf::new("svgf", svgf::Constants { colour_alpha: 0.4, ..later })), false),
        (0, "feedback", Box::new(svgf::Svgf::new("svgf", svgf::Constants { feedback: 0, ..later })), false),
        (0, "sigma_l", Box::new(svgf::Svgf::new("svgf", svgf::Constants { sigma_l: 4.0, ..later })), false),
        (1, "levels", Box::new(atrous::Atrous::new(atrous::Constants { levels: 1, ..other })), false),
        (1, "fitted", Box::new(atrous::Atrous::default()), false),
    ];
    compare(&BaselineConstants { svgf: SvgfConstants::LATER, atrous }, FRAMES, planted);
    let svgf =
        SvgfConstants { levels: 2, feedback: 1, sigma_z: 0.3, sigma_l: 2.0, colour_alpha: 0.4, moments_alpha: 0.6 };
    let (few, _) = of_lab(&BaselineConstants { svgf, atrous });
    let planted: Vec<(usize, &str, Box<dyn Method>, bool)> = vec![
        (0, "moments", Box::new(svgf::Svgf::new("svgf", svgf::Constants { moments_alpha: 0.2, ..few })), false),
        (0, "sigma_z", Box::new(svgf::Svgf::new("svgf", svgf::Constants { sigma_z: 20.0, ..few })), false),
    ];
    let atrous = AtrousConstants { levels: 6, ..AtrousConstants::default() };
    compare(&BaselineConstants { svgf, atrous }, 5, planted);
}

/// A frame's picture, four bytes a pixel.
fn shown(device: &super::device::Device, engine: &mut Engine, choice: &Choice) -> Vec<u8> {
    let sight = sight(engine, 0.0);
    device.show(engine, &sight, choice).unwrap();
    device.picture(engine)
}

#[test]
fn history_begins_anew_where_frames_do_not_follow() {
    let Some(device) = device() else { return };
    let size = Size::new(32, 18);
    let only = Choice { panes: vec![Pane::Svgf], splits: vec![], ..both() };
    let other = Choice { panes: vec![Pane::Noisy], splits: vec![], ..both() };
    // The same frame number, after other pasts.
    let picture = |past: &dyn Fn(&mut Engine)| {
        let mut engine = device.engine(size);
        for _ in 0..3 {
            shown(device, &mut engine, &only);
        }
        past(&mut engine);
        shown(device, &mut engine, &only)
    };
    let followed = picture(&|engine| drop(shown(device, engine, &only)));
    let hidden = picture(&|engine| drop(shown(device, engine, &other)));
    let cut = picture(&|engine| {
        shown(device, engine, &only);
        engine.reset();
    });
    let scene = picture(&|engine| {
        shown(device, engine, &only);
        let stage = device.stage(super::device::scene(), engine);
        engine.set_stage(stage);
    });
    let resized = picture(&|engine| {
        shown(device, engine, &only);
        engine.resize(Size::new(16, 9)).unwrap();
        engine.resize(size).unwrap();
    });
    assert!(followed != hidden, "there was no history");
    for (name, other) in [("cut", cut), ("scene", scene), ("resized", resized)] {
        assert!(other == hidden, "{name}: history stayed");
    }
}

#[test]
fn memory_is_taken_only_while_a_pane_shows_them() {
    let Some(device) = device() else { return };
    let size = Size::new(32, 18);
    let mut engine = device.engine(size);
    let mut memory = |panes: &[Pane]| {
        shown(device, &mut engine, &Choice { panes: panes.to_vec(), ..choice() });
        engine.memory()[2].1
    };
    let none = memory(&[Pane::Noisy, Pane::Quell]);
    let atrous = memory(&[Pane::Atrous]);
    let svgf = memory(&[Pane::Svgf]);
    let both = memory(&Pane::ALL);
    assert!(none < atrous && atrous < svgf && svgf < both);
    assert_eq!(memory(&[Pane::Quell]), none);
}
