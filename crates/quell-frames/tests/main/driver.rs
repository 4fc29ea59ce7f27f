//! Whole jobs on small sequences: any split gives the same files, and whatever goes wrong leaves whole files.

use crate::Folder;
use quell::sequence::{Accelerator, WaveletJob};
use quell::{Camera, FrameBuf, Plane, Size};
use quell_frames::driver::{Destination, Event, Existing, Fate, Job, JobOptions, Outcome};
use quell_frames::image::read_headers;
use quell_frames::{AdaptOptions, Error, FrameToWrite, MapOptions, WriteOptions, frame_path, write_frame};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

const FRAMES: i64 = 9;

/// A wall that is seen to move, and noise on it.
pub fn make(folder: &Path, number: i64) {
    make_of(folder, number, Size::new(40, 24));
}

fn make_of(folder: &Path, number: i64, size: Size) {
    let camera = Camera::perspective([0.0; 3], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 0.8, 40.0 / 24.0);
    let mut frame = FrameBuf::new(size, camera);
    frame.index = number;
    let mut state = (number as u64 + 11).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 40) as f32 / 16_777_216.0) * 1.6 + 0.2
    };
    let stripe = |x: usize| (x as i64 + 2 * number).rem_euclid(8) < 4;
    frame.matte = Some(Plane::from_fn(size, |_, _| [noise(), noise(), noise()]));
    frame.matte_weight = Some(Plane::from_fn(size, |x, _| if stripe(x) { [0.8, 0.5, 0.2] } else { [0.1, 0.3, 0.6] }));
    frame.view_depth = Some(Plane::from_fn(size, |x, y| 3.0 + 0.01 * (x + y) as f32));
    frame.normal = Some(Plane::filled(size, [0.0, 0.0, 1.0]));
    frame.motion = Some(Plane::filled(size, [2.0, if size.height > 100 { 0.75 } else { 0.0 }]));
    let path = frame_path(folder, "shot", number);
    write_frame(&path, &FrameToWrite::new(frame.frame(&[])), &WriteOptions::default()).unwrap();
}

struct Case {
    folder: Folder,
    events: Mutex<Vec<Event>>,
}

impl Case {
    fn new(name: &str) -> Self {
        let folder = Folder::new(&format!("driver-{name}"));
        (1..=FRAMES).for_each(|number| make(&folder.file("in"), number));
        Self { folder, events: Mutex::default() }
    }

    fn input(&self, number: i64) -> PathBuf {
        frame_path(&self.folder.file("in"), "shot", number)
    }

    fn output(&self, to: &str, number: i64) -> PathBuf {
        frame_path(&self.folder.file(to), "shot", number)
    }

    fn options(&self, to: &str) -> JobOptions {
        let mut settings = quell::sequence::SequenceSettings::default();
        settings.gather.frames = 2;
        settings.stabilise.frames = 1;
        JobOptions {
            inputs: vec![self.folder.file("in")],
            destination: Destination::parse(&self.folder.file(to)).unwrap(),
            existing: Existing::Ours,
            frames: None,
            shot: None,
            cuts: None,
            map: MapOptions::default(),
            adapt: AdaptOptions::default(),
            settings,
            max_memory: None,
            bands: None,
            backend: quell::Backend::default(),
            accelerator: None,
            measure_noise: false,
        }
    }

    fn run(&self, options: JobOptions) -> Outcome {
        self.run_until(options, &|_| false)
    }

    /// Stops the run at the first event for which `stops` is true.
    fn run_until(&self, options: JobOptions, stops: &(dyn Fn(&Event) -> bool + Sync)) -> Outcome {
        let stop = AtomicBool::new(false);
        let told = |event| {
            if stops(&event) {
                stop.store(true, Ordering::SeqCst);
            }
            self.events.lock().unwrap().push(event);
        };
        Job::open(options).unwrap().run(&stop, &told).unwrap()
    }

    fn written(&self, to: &str) -> Vec<i64> {
        (1..=FRAMES).filter(|number| self.output(to, *number).exists()).collect()
    }
}

#[test]
fn every_split_and_every_number_of_threads_gives_the_same_files() {
    let case = Case::new("split");
    assert_eq!(case.run(case.options("whole")).written(), FRAMES as usize);
    let whole: Vec<Vec<u8>> = (1..=FRAMES).map(|n| fs::read(case.output("whole", n)).unwrap()).collect();
    for (i, (part, threads)) in
        [(vec![1, 2], 1), (vec![3], 3), (vec![4, 6, 8], 8), (vec![5, 7, 9], 2)].iter().enumerate()
    {
        let to = format!("part{i}");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(*threads).build().unwrap();
        let options = JobOptions { frames: Some(part.clone()), ..case.options(&to) };
        pool.install(|| case.run(options));
        assert_eq!(case.written(&to), *part);
        for number in part {
            let same = fs::read(case.output(&to, *number)).unwrap() == whole[*number as usize - 1];
            assert!(same, "frame {number} of {part:?}");
        }
    }
    // The comparison can fail: without its neighbours a frame is another.
    let mut alone = case.options("alone");
    alone.settings.gather.frames = 1;
    case.run(JobOptions { frames: Some(vec![5]), ..alone });
    assert_ne!(fs::read(case.output("alone", 5)).unwrap(), whole[4]);
    // And something was filtered.
    assert_ne!(fs::read(case.input(5)).unwrap(), whole[4]);
}

#[test]
fn a_cut_given_or_a_gap_restarts_history() {
    let case = Case::new("cut");
    case.run(JobOptions { cuts: Some(vec![5]), ..case.options("cut") });
    fs::remove_file(case.input(4)).unwrap();
    let job = Job::open(case.options("gap")).unwrap();
    assert!(job.notes().iter().any(|note| note.contains("frame 4 is missing")), "{:?}", job.notes());
    assert_eq!(case.run(case.options("gap")).written(), FRAMES as usize - 1);
    let picture = |to: &str, n: i64| quell_frames::read_picture(&case.output(to, n)).unwrap();
    assert_eq!(picture("cut", 6), picture("gap", 6));
    assert_ne!(picture("cut", 3), picture("gap", 2));
}

#[test]
fn what_is_done_is_left_alone_as_far_as_asked() {
    let case = Case::new("resume");
    case.run(JobOptions { frames: Some(vec![1, 2, 3]), ..case.options("out") });
    let time = |n: i64| fs::metadata(case.output("out", n)).unwrap().modified().unwrap();
    let before = time(2);
    // The same job goes on.
    let resumed = JobOptions { existing: Existing::Resume, ..case.options("out") };
    let job = Job::open(resumed.clone()).unwrap();
    assert_eq!((job.done_before(), job.plan().wanted()), (&[1, 2, 3][..], FRAMES as usize - 3));
    case.run(resumed.clone());
    assert_eq!((time(2), case.written("out").len()), (before, FRAMES as usize));
    assert_eq!(Job::open(resumed.clone()).unwrap().plan().wanted(), 0);
    // Other settings are another job.
    let mut other = resumed;
    other.settings.wavelet.levels = 2;
    assert_eq!(Job::open(other).unwrap().plan().wanted(), FRAMES as usize);
    // Whoever wrote it, it is there.
    fs::write(case.output("out", 4), "not ours").unwrap();
    let skipping = JobOptions { existing: Existing::Skip, ..case.options("out") };
    assert_eq!(Job::open(skipping).unwrap().plan().wanted(), 0);
    let plain = case.options("out");
    assert!(matches!(Job::open(plain), Err(Error::Foreign { path }) if path == case.output("out", 4)));
    let over = JobOptions { existing: Existing::Overwrite, frames: Some(vec![4]), ..case.options("out") };
    assert_eq!(case.run(over).written(), 1);
    // An input is never an output.
    for existing in [Existing::Ours, Existing::Overwrite] {
        let onto_itself = JobOptions { existing, ..case.options("in") };
        let Err(error) = Job::open(onto_itself) else { panic!("it was accepted") };
        assert!(error.to_string().contains("never replaced"), "{error}");
    }
}

/// Leaves light as it is, or fails from a frame on.
#[derive(Debug)]
struct Elsewhere {
    name: &'static str,
    frames_before_it_fails: AtomicUsize,
}

impl Elsewhere {
    fn some(name: &'static str, frames: usize) -> Option<Arc<dyn Accelerator>> {
        Some(Arc::new(Self { name, frames_before_it_fails: AtomicUsize::new(frames) }))
    }
}

impl Accelerator for Elsewhere {
    fn name(&self) -> String {
        self.name.to_owned()
    }

    fn wavelet(&self, _: &mut WaveletJob<'_>) -> Result<(), String> {
        let left = |n: usize| n.checked_sub(1);
        let frames = self.frames_before_it_fails.fetch_update(Ordering::SeqCst, Ordering::SeqCst, left);
        frames.map(|_| ()).map_err(|_| "it was pulled out".to_owned())
    }
}

#[test]
fn files_say_which_back_end_made_them_and_another_is_another_job() {
    let case = Case::new("backend");
    assert_eq!(case.run(case.options("out")).written(), FRAMES as usize);
    let signed = |number| {
        let image = read_headers(&case.output("out", number)).unwrap();
        image.text("quell.backend")
    };
    assert_eq!(signed(1).as_deref(), Some("cpu"));
    let with = |name| JobOptions {
        existing: Existing::Resume,
        accelerator: Elsewhere::some(name, 1000),
        ..case.options("out")
    };
    let wanted = |name| Job::open(with(name)).unwrap().plan().wanted();
    assert_eq!(wanted("gpu: a"), FRAMES as usize);
    assert_eq!(case.run(with("gpu: a")).written(), FRAMES as usize);
    assert_eq!(signed(2).as_deref(), Some("gpu: a"));
    assert_eq!((wanted("gpu: a"), wanted("gpu: b")), (0, FRAMES as usize));
}

#[test]
fn where_the_accelerator_fails_the_run_ends_and_says_why() {
    for bands in [None, Some(2)] {
        let case = Case::new(&format!("pulled-{bands:?}"));
        let options = || JobOptions { accelerator: Elsewhere::some("gpu: a", 4), bands, ..case.options("out") };
        let outcome = case.run(options());
        assert_eq!(outcome.ended.as_deref(), Some("gpu: a: it was pulled out"));
        let failed = |fate: &Fate| matches!(fate, Fate::Failed(why) if why.contains("it was pulled out"));
        assert!(outcome.frames.iter().any(|(_, fate)| failed(fate)), "{:?}", outcome.frames);
        assert_eq!(outcome.frames.len(), FRAMES as usize);
        // Those whose wavelet was done before are whole, and no other is there.
        assert_eq!(outcome.written(), case.written("out").len());
        assert!(outcome.written() < 4, "{:?}", outcome.frames);
    }
}

#[test]
fn a_truncated_frame_fails_alone_or_with_its_neighbours() {
    let case = Case::new("truncated");
    let whole = fs::read(case.input(5)).unwrap();
    fs::write(case.input(5), &whole[..whole.len() * 2 / 3]).unwrap();
    let outcome = case.run(case.options("out"));
    assert_eq!(case.written("out"), [1, 2, 3, 4, 6, 7, 8, 9]);
    let failed: Vec<_> = outcome.frames.iter().filter(|(_, fate)| *fate != Fate::Written).collect();
    assert!(matches!(failed[..], [(5, Fate::Failed(why))] if why.contains("shot.0005.exr")), "{failed:?}");
    // In a shot that must be whole, what would have seen it fails too.
    let shot = JobOptions { shot: Some((1..=FRAMES).collect()), ..case.options("shot") };
    case.run(shot.clone());
    assert_eq!(case.written("shot"), [1, 9]);
    fs::remove_file(case.input(5)).unwrap();
    let Err(error) = Job::open(shot) else { panic!("it was accepted") };
    assert!(error.to_string().contains("missing: 5"), "{error}");
}

#[test]
fn a_frame_that_vanishes_on_the_way_fails_alone() {
    let case = Case::new("vanishes");
    let gone = AtomicBool::new(false);
    let outcome = case.run_until(case.options("out"), &|event| {
        if *event == Event::Read(1) && !gone.swap(true, Ordering::SeqCst) {
            fs::remove_file(case.input(8)).unwrap();
        }
        false
    });
    assert_eq!(outcome.written(), FRAMES as usize - 1);
    assert!(matches!(&outcome.frames[7], (8, Fate::Failed(why)) if why.contains("shot.0008.exr")), "{outcome:?}");
}

#[test]
fn asked_to_stop_it_leaves_whole_files_and_resumes() {
    let case = Case::new("stop");
    let outcome = case.run_until(case.options("out"), &|event| *event == Event::Written(3));
    assert_eq!(outcome.ended.as_deref(), Some(""));
    let written = case.written("out");
    assert!(written.len() >= 3 && written.len() < FRAMES as usize, "{written:?}");
    // Nothing half written, nothing hidden.
    assert_eq!(fs::read_dir(case.folder.file("out")).unwrap().count(), written.len());
    for number in &written {
        quell_frames::read_image(&case.output("out", *number)).unwrap();
    }
    case.run(JobOptions { existing: Existing::Resume, ..case.options("out") });
    case.run(case.options("whole"));
    for number in 1..=FRAMES {
        let (a, b) = (case.output("out", number), case.output("whole", number));
        assert!(fs::read(a).unwrap() == fs::read(b).unwrap(), "frame {number}");
    }
}

#[test]
#[cfg(unix)]
fn a_folder_that_cannot_be_written_ends_the_run() {
    use std::os::unix::fs::PermissionsExt;
    let case = Case::new("read-only");
    let folder = case.folder.file("locked");
    fs::create_dir(&folder).unwrap();
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(folder.join("probe"), "").is_ok() {
        println!("skipped: this user may write everywhere");
        return;
    }
    for bands in [None, Some(2)] {
        let options = JobOptions { bands, ..case.options("locked") };
        let result = Job::open(options).unwrap().run(&AtomicBool::new(false), &|_| {});
        let why = match result {
            Ok(outcome) => outcome.ended.unwrap(),
            Err(error) => error.to_string(),
        };
        assert!(why.contains("locked") && why.contains("choose a folder"), "{why}");
    }
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn nothing_to_read_is_an_error_that_names_it() {
    let case = Case::new("nothing");
    let missing = JobOptions { inputs: vec![case.folder.file("elsewhere")], ..case.options("out") };
    assert!(Job::open(missing).unwrap_err().to_string().contains("elsewhere"));
    let none = JobOptions { frames: Some(vec![100, 101]), ..case.options("out") };
    assert!(Job::open(none).unwrap_err().to_string().contains("100-101"));
    // The output folder is a file.
    fs::write(case.folder.file("blocked"), "").unwrap();
    let outcome = case.run(case.options("blocked/out"));
    assert_eq!(outcome.written(), 0);
    assert!(outcome.ended.as_ref().is_some_and(|why| why.contains("blocked")), "{outcome:?}");
}

/// Frames that are high enough for bands, and a filter whose margins are narrow.
struct Tall(Case);

impl Tall {
    fn new(name: &str) -> Self {
        let case = Case { folder: Folder::new(&format!("driver-{name}")), events: Mutex::default() };
        (1..=FRAMES).for_each(|number| make_of(&case.folder.file("in"), number, Size::new(24, 400)));
        Self(case)
    }

    fn options(&self, to: &str, bands: Option<usize>) -> JobOptions {
        let mut options = self.0.options(to);
        options.settings.wavelet.levels = 2;
        options.settings.wavelet.transmission_levels = 2;
        JobOptions { bands, ..options }
    }

    /// What lies in a folder, hidden files too.
    fn files(&self, to: &str) -> Vec<String> {
        fs::read_dir(self.0.folder.file(to)).map_or_else(
            |_| Vec::new(),
            |entries| entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect(),
        )
    }
}

#[test]
fn bands_give_the_same_files_and_leave_nothing_behind() {
    let case = Tall::new("bands");
    let whole = case.0.run(case.options("whole", None));
    assert_eq!(whole.written(), FRAMES as usize);
    for bands in [2, 3, 9] {
        let to = format!("bands{bands}");
        let outcome = case.0.run(case.options(&to, Some(bands)));
        assert_eq!((outcome.written(), outcome.ended), (FRAMES as usize, None));
        for number in 1..=FRAMES {
            let (a, b) = (case.0.output("whole", number), case.0.output(&to, number));
            assert!(fs::read(a).unwrap() == fs::read(b).unwrap(), "frame {number} in {bands} bands");
        }
        assert_eq!(case.files(&to).len(), FRAMES as usize, "{:?}", case.files(&to));
    }
    let events = case.0.events.lock().unwrap();
    assert!(events.contains(&Event::Band(8, 9)), "{events:?}");
    // Every frame is written once, and reported once.
    assert_eq!(events.iter().filter(|e| **e == Event::Written(4)).count(), 4);
}

#[test]
fn in_bands_bad_frames_cuts_and_ctrl_c_are_as_without() {
    let case = Tall::new("bands-bad");
    let whole = fs::read(case.0.input(5)).unwrap();
    fs::write(case.0.input(5), &whole[..whole.len() * 2 / 3]).unwrap();
    for (to, bands) in [("a", None), ("b", Some(3))] {
        let options = JobOptions { cuts: Some(vec![3]), ..case.options(to, bands) };
        let outcome = case.0.run(options);
        let failed: Vec<_> = outcome.frames.iter().filter(|(_, fate)| *fate != Fate::Written).collect();
        assert!(matches!(failed[..], [(5, Fate::Failed(why))] if why.contains("shot.0005.exr")), "{failed:?}");
        let times = [outcome.times.reading, outcome.times.filtering, outcome.times.writing];
        assert!(times.iter().all(|time| time.cpu.is_some() == cfg!(unix)), "{times:?}");
    }
    for number in case.0.written("a") {
        let (a, b) = (case.0.output("a", number), case.0.output("b", number));
        assert!(fs::read(a).unwrap() == fs::read(b).unwrap(), "frame {number}");
    }
    // Stopped while bands wait: no frame is there, and no folder of files that waited.
    let outcome = case.0.run_until(case.options("c", Some(4)), &|event| *event == Event::Band(2, 4));
    assert_eq!((outcome.ended.as_deref(), outcome.written()), (Some(""), 0));
    assert_eq!(case.files("c"), [""; 0]);
    // And while frames are written: whole ones stay.
    let in_two = JobOptions { cuts: Some(vec![3]), ..case.options("d", Some(2)) };
    let outcome = case.0.run_until(in_two.clone(), &|event| *event == Event::Written(2));
    assert_eq!(outcome.ended.as_deref(), Some(""));
    assert_eq!(case.files("d").len(), outcome.written());
    case.0.run(JobOptions { existing: Existing::Resume, ..in_two });
    let (a, d) = (case.0.output("a", 9), case.0.output("d", 9));
    assert!(fs::read(a).unwrap() == fs::read(d).unwrap());
}

#[test]
fn memory_is_estimated_and_a_limit_that_cannot_be_kept_says_what_it_takes() {
    let case = Tall::new("memory");
    let job = Job::open(JobOptions { max_memory: Some(4 << 30), ..case.options("out", None) }).unwrap();
    let memory = job.memory().unwrap();
    assert_eq!((memory.bands, memory.limit), (1, Some((4 << 30, true))));
    assert_eq!(memory.bytes, memory.whole);
    assert!(job.describe().contains("the whole picture at once; the limit is 4.0 GiB"), "{}", job.describe());
    // Most of what so small a job takes does not depend on it, and of the rest bands save 27.34 % at most: they have rows around them, and
    // some rows of what `blend` holds.
    let tight = memory.whole - (memory.whole - (96 << 20)) / 4;
    let job = Job::open(JobOptions { max_memory: Some(tight), ..case.options("out", None) }).unwrap();
    let memory = job.memory().unwrap();
    assert!(memory.bands > 1 && memory.bytes <= tight, "{memory:?}");
    assert!(job.describe().contains("bands of rows"), "{}", job.describe());
    let error = Job::open(JobOptions { max_memory: Some(1 << 20), ..case.options("out", None) }).unwrap_err();
    assert!(matches!(error, Error::Memory { limit: 0x0010_0000, .. }), "{error}");
    assert!(error.to_string().contains("--max-memory"), "{error}");
}

/// A limit between what bands take where nothing moves and where things move as they do: a dry run must not accept it.
#[test]
fn what_a_dry_run_accepts_a_run_keeps() {
    let case = Tall::new("dry");
    let stop = AtomicBool::new(false);
    let open = |limit: u64, to: &str| {
        let mut options = JobOptions { max_memory: Some(limit), ..case.options(to, None) };
        // Many frames in the window: then bands are what takes most.
        options.settings.gather.frames = 6;
        Job::open(options)
    };
    let Err(Error::Memory { needed: least, .. }) = open(1 << 20, "x") else { panic!("1 MiB was accepted") };
    let job = open(least, "x").unwrap();
    let Err(Error::Memory { needed, .. }) = job.measure(&stop) else {
        panic!("{least} bytes were accepted: {:?}", job.memory())
    };
    assert!(needed > least, "{needed} {least}");
    // The run refuses it with the same figure, and writes nothing.
    let Err(Error::Memory { needed: run, .. }) = open(least, "x").unwrap().run(&stop, &|_| {}) else {
        panic!("the run accepted {least} bytes")
    };
    assert_eq!(run, needed);
    // What is asked for is enough for both.
    let job = open(needed, "y").unwrap();
    job.measure(&stop).unwrap();
    let memory = job.memory().unwrap();
    assert!(memory.bytes <= needed && memory.bands > 1, "{memory:?}");
    let outcome = job.run(&stop, &|_| {}).unwrap();
    assert_eq!(outcome.written(), outcome.frames.len());
}

/// The pass `quell.noise` is there where it was asked for, in bands to the same bits, and adds to no other channel.
#[test]
fn the_expected_error_is_a_pass_and_a_report() {
    let case = Tall::new("error");
    let stop = AtomicBool::new(false);
    let run = |to: &str, bands: Option<usize>, noise_pass: bool| {
        let mut options = JobOptions { measure_noise: noise_pass, ..case.options(to, bands) };
        options.adapt.noise_pass = noise_pass;
        Job::open(options).unwrap().run(&stop, &|_| {}).unwrap()
    };
    let (plain, whole, bands) = (run("plain", None, false), run("whole", None, true), run("bands", Some(2), true));
    assert!(plain.noise.is_empty());
    assert_eq!(whole.noise.len(), whole.written());
    assert_eq!(whole.noise, bands.noise);
    for (number, noise) in &whole.noise {
        assert!(noise.left > 0.0 && noise.left < noise.found && noise.found < 2.0, "frame {number}: {noise:?}");
        let read = |to: &str| quell_frames::read_image(&case.0.output(to, *number)).unwrap();
        let (plain, whole, bands) = (read("plain"), read("whole"), read("bands"));
        let at = whole.parts()[0].find("quell.noise.Y").expect("the pass");
        let values = whole.samples(0, at).unwrap().to_f32();
        assert_eq!(values, bands.samples(0, at).unwrap().to_f32());
        assert!(plain.parts()[0].find("quell.noise.Y").is_none());
        for channel in plain.parts()[0].channels() {
            let other = whole.parts()[0].find(channel.name()).unwrap();
            assert!(channel.samples() == whole.samples(0, other), "{}", channel.name());
        }
    }
}
