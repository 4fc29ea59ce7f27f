//! References: continued from the cache to the bit, and as good as they say.

use quell::Size;
use quell_lab::cache::Cache;
use quell_lab::metrics::rel_mse;
use quell_lab::references::{ReferenceOf, ReferenceTarget, converge};
use quell_trace::{Control, RenderOptions, builtin};
use std::path::Path;

fn options() -> RenderOptions {
    RenderOptions { direct_samples: 1, ..RenderOptions::new(Size::new(32, 18)) }
}

#[test]
fn an_interrupted_reference_goes_on_where_it_stopped() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("references");
    let _ = std::fs::remove_dir_all(&folder);
    let cache = Cache::at(&folder);
    let scene = builtin("cornell-box").unwrap();
    let run = |cache: Option<&Cache>, samples: u32| {
        let mut told = Vec::new();
        let target = ReferenceTarget { samples, batch: 4, ..ReferenceTarget::default() };
        let pair = converge(
            cache,
            &ReferenceOf { scene: &scene, camera: 1, frame: 3, options: &options() },
            &target,
            &Control::default(),
            |p| told.push(*p),
        )
        .unwrap();
        (pair, told)
    };
    let (whole, told) = run(None, 8);
    assert_eq!(told.iter().map(|p| p.samples).collect::<Vec<_>>(), [0, 4, 8]);
    let (_, _) = run(Some(&cache), 4);
    let (continued, told) = run(Some(&cache), 8);
    assert_eq!((told[0].samples, told[0].cached), (4, 4));
    assert_eq!(continued, whole);
    // Once there, nothing is traced: the rays do not grow.
    let (again, told) = run(Some(&cache), 8);
    assert_eq!((again.a.rays, told.len()), (whole.a.rays, 1));
    assert_ne!(whole.a.beauty, whole.b.beauty, "the halves share no sample");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn the_stated_error_is_the_error_against_a_better_reference() {
    let scene = builtin("cornell-box").unwrap();
    let pair = |samples| {
        let target = ReferenceTarget { samples, batch: samples, ..ReferenceTarget::default() };
        converge(
            None,
            &ReferenceOf { scene: &scene, camera: 1, frame: 0, options: &options() },
            &target,
            &Control::default(),
            |_| {},
        )
        .unwrap()
    };
    let coarse = pair(8);
    // Of the same halves, but all further samples are others: 8 of 200 are shared, which the bound allows for.
    let fine = pair(200);
    let stated = coarse.rel_mse();
    let found = rel_mse(&coarse.mean().unwrap().beauty, &fine.mean().unwrap().beauty).unwrap().trimmed;
    assert!((found / stated - 1.0).abs() < 0.35, "stated {stated}, found {found}");
    // The target stops early.
    let target = ReferenceTarget { samples: 200, rel_mse: stated * 1.01, batch: 8, ..ReferenceTarget::default() };
    let early = converge(
        None,
        &ReferenceOf { scene: &scene, camera: 1, frame: 0, options: &options() },
        &target,
        &Control::default(),
        |_| {},
    )
    .unwrap();
    assert_eq!(early.a.samples, 8);
}
