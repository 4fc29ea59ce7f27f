//! Sequences of a comparison: rendered, kept, read.

use quell::Size;
use quell_frames::{Content, FrameToWrite, Metadata, WriteOptions, frame_path, write_frame};
use quell_lab::Error;
use quell_lab::compare::scene::SequenceProgress;
use quell_lab::compare::{FolderSource, SceneSource, Sequence};
use quell_lab::references::ReferenceTarget;
use quell_lab::tracer::TraceOn;
use quell_trace::{RenderOptions, Scene, builtin};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

const SIZE: Size = Size::new(32, 18);

fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    path
}

fn source<'a>(scene: &'a Scene, samples: u32, place: Option<&'a Path>) -> SceneSource<'a> {
    SceneSource {
        scene,
        camera: 1,
        frames: (0..4).collect(),
        options: RenderOptions { samples, direct_samples: 2, seed: 7, ..RenderOptions::new(SIZE) },
        target: ReferenceTarget { samples: 2, batch: 2, ..ReferenceTarget::default() },
        references: vec![2, 3],
        on: &TraceOn::Cpu,
        cache: None,
        folder: place,
    }
}

fn load(source: &SceneSource<'_>) -> Sequence {
    source.load(None, &|_| {}).unwrap()
}

#[test]
fn a_sequence_that_lies_in_files_is_the_one_that_was_rendered() {
    let scene = builtin("cornell-box").unwrap();
    let place = folder("compare-sequence");
    let rendered = load(&source(&scene, 2, Some(&place)));
    assert_eq!((rendered.numbers.len(), &rendered.scored[..]), (4, &[2, 3][..]));
    let path = frame_path(&place.join("noisy"), "noisy", 2);
    let written = std::fs::metadata(&path).unwrap().modified().unwrap();
    let again = load(&source(&scene, 2, Some(&place)));
    assert_eq!(std::fs::metadata(&path).unwrap().modified().unwrap(), written, "it was rendered once more");
    for i in 0..4 {
        let (a, b) = (rendered.frame(i).unwrap(), again.frame(i).unwrap());
        assert_eq!((&a.frame, &a.halves), (&b.frame, &b.halves));
        // The frame's signals are the mean of its halves.
        let [one, two] = a.halves.as_ref().unwrap();
        for ((m, p), q) in a.frame.matte.as_ref().unwrap().data().iter().zip(one.matte.data()).zip(two.matte.data()) {
            for c in 0..3 {
                assert!((m[c] - 0.5 * (p[c] + q[c])).abs() <= 1e-5 * m[c].abs().max(1e-3));
            }
        }
    }
    // Another number of samples is another sequence: those files are replaced.
    let one = load(&source(&scene, 1, Some(&place)));
    assert!(one.frame(0).unwrap().halves.is_none() && one.identity != again.identity);
    // Other seeds, other noise, the same references.
    let mut other = source(&scene, 1, None);
    other.options.seed = 8;
    let other = load(&other);
    assert_ne!(other.frame(3).unwrap().frame.matte, one.frame(3).unwrap().frame.matte);
    assert_eq!(other.reference(3), one.reference(3));
    assert!(one.reference_error().unwrap() > 0.0);
}

#[test]
fn progress_rises_to_the_end_and_a_stop_is_an_error() {
    let scene = builtin("cornell-box").unwrap();
    let shares = std::sync::Mutex::new(vec![0.0]);
    let told = |p: &SequenceProgress| shares.lock().unwrap().push(p.share);
    source(&scene, 1, None).load(None, &told).unwrap();
    let shares = shares.into_inner().unwrap();
    assert!(shares.windows(2).all(|w| w[0] <= w[1]) && (shares[shares.len() - 1] - 1.0).abs() < 1e-3, "{shares:?}");
    let stop = AtomicBool::new(true);
    let stopped = source(&scene, 1, None).load(Some(&stop), &|_| {});
    assert!(matches!(stopped, Err(Error::Trace(quell_trace::TraceError::Cancelled))));
}

#[test]
fn a_folder_is_read_and_what_does_not_fit_is_named() {
    let scene = builtin("cornell-box").unwrap();
    let place = folder("compare-folder");
    let rendered = load(&source(&scene, 2, Some(&place)));
    let open = |references: Option<PathBuf>| {
        FolderSource { folder: place.clone(), references, frames: None, reference_frames: None }.load()
    };
    let message = |result: Result<Sequence, Error>| result.err().map(|e| e.to_string()).unwrap_or_default();
    assert!(message(open(None)).contains("holds no files reference.0001.exr"));

    let write = |folder: &str, number: i64, brightness: f32, size: Size| {
        let reference = rendered.reference(3).unwrap();
        let mut frame = rendered.frame(3).unwrap().frame.clone();
        frame.index = number;
        let picture = quell::Plane::from_fn(size, |x, y| {
            reference.mean.at(x.min(SIZE.width - 1), y.min(SIZE.height - 1)).map(|v| v * brightness)
        });
        let empty = quell::Frame::new(size, frame.camera);
        let file = FrameToWrite {
            composite: Some(picture.view()),
            metadata: Metadata { content: Content::Reference, ..Metadata::default() },
            ..FrameToWrite::new(empty)
        };
        let path = frame_path(&place.join(folder).join("reference"), "reference", number);
        write_frame(&path, &file, &WriteOptions::default()).unwrap();
        place.join(folder)
    };
    let good = open(Some(write("good", 3, 1.0, SIZE))).unwrap();
    assert_eq!((good.numbers.len(), &good.scored[..]), (4, &[3][..]));
    assert_eq!(good.reference(3).unwrap().mean, rendered.reference(3).unwrap().mean);
    // One picture without halves: its own error is not known.
    assert_eq!(good.reference_error(), None);
    let (a, b) = (good.frame(1).unwrap(), rendered.frame(1).unwrap());
    assert_eq!((&a.frame.matte, &a.halves), (&b.frame.matte, &b.halves));

    assert!(message(open(Some(write("late", 9, 1.0, SIZE)))).contains("frames are 0 to 3, references in"));
    assert!(message(open(Some(write("large", 3, 1.0, Size::new(40, 18))))).contains("is 40x18, but the noisy"));
    let dark = open(Some(write("dark", 3, 0.25, SIZE))).unwrap();
    assert!(dark.notes.iter().any(|n| n.contains("same exposure")), "{:?}", dark.notes);
    assert!(!good.notes.iter().any(|n| n.contains("same exposure")), "{:?}", good.notes);
    let missing =
        FolderSource { folder: place.clone(), references: None, frames: Some(vec![17]), reference_frames: None };
    assert!(message(missing.load()).contains("no frame 17"));
}
