//! The pipeline with frames that are numbers and a filter that lists what it saw.

use super::*;
use std::path::Path;
use std::sync::Mutex;

/// Frame `n` holds `n`; a written frame is the list of frames its window held.
#[derive(Default)]
struct Numbers {
    unreadable: Vec<i64>,
    unwritable: Vec<i64>,
    full_from: Option<i64>,
    written: Mutex<BTreeMap<i64, Vec<i64>>>,
    reads: Mutex<Vec<i64>>,
}

fn refused(kind: std::io::ErrorKind, action: &'static str) -> Error {
    Error::io(Path::new("frame.exr"), action, kind.into())
}

impl Files for Numbers {
    type Loaded = i64;
    type Done = Vec<i64>;

    fn read(&self, number: i64, _wanted: bool) -> Result<(i64, Vec<String>), Error> {
        self.reads.lock().unwrap().push(number);
        if self.unreadable.contains(&number) {
            return Err(refused(std::io::ErrorKind::UnexpectedEof, "read"));
        }
        Ok((number, Vec::new()))
    }

    fn write(&self, number: i64, done: Vec<i64>) -> Result<Vec<String>, Error> {
        if self.full_from.is_some_and(|from| number >= from) {
            return Err(refused(std::io::ErrorKind::StorageFull, "write"));
        }
        if self.unwritable.contains(&number) {
            return Err(refused(std::io::ErrorKind::NotFound, "read"));
        }
        self.written.lock().unwrap().insert(number, done);
        Ok(Vec::new())
    }
}

#[derive(Default)]
struct Lists {
    reach: usize,
    cut_before: Vec<i64>,
    refuses: Option<i64>,
    seen: Vec<(i64, bool)>,
    out: usize,
}

impl Lists {
    fn window(&self, at: usize) -> (i64, Vec<i64>) {
        let low = at.saturating_sub(self.reach);
        let high = (at + self.reach + 1).min(self.seen.len());
        (self.seen[at].0, self.seen[low..high].iter().map(|s| s.0).collect())
    }

    fn ready(&mut self, until: usize, out: &mut dyn FnMut(i64, Vec<i64>) -> bool) {
        while self.out < until {
            let at = self.out;
            self.out += 1;
            let (number, window) = self.window(at);
            if self.seen[at].1 && !out(number, window) {
                return;
            }
        }
    }
}

impl Window for Lists {
    type Loaded = i64;
    type Done = Vec<i64>;

    fn push(
        &mut self,
        number: i64,
        loaded: i64,
        wanted: bool,
        out: &mut dyn FnMut(i64, Vec<i64>) -> bool,
    ) -> Result<(), Error> {
        assert_eq!(number, loaded);
        if self.refuses == Some(number) {
            return Err(refused(std::io::ErrorKind::InvalidData, "filter"));
        }
        self.seen.push((number, wanted));
        let complete = self.seen.len().saturating_sub(self.reach);
        self.ready(complete, out);
        Ok(())
    }

    fn finish(&mut self, out: &mut dyn FnMut(i64, Vec<i64>) -> bool) -> Result<(), Error> {
        self.ready(self.seen.len(), out);
        self.seen.clear();
        self.out = 0;
        Ok(())
    }

    fn is_cut(&self, loaded: &i64) -> bool {
        self.cut_before.contains(loaded)
    }
}

struct Case {
    files: Numbers,
    window: Lists,
    options: RunOptions,
    available: Vec<i64>,
    cuts: Vec<i64>,
}

impl Case {
    fn new() -> Self {
        Self {
            files: Numbers::default(),
            window: Lists { reach: 2, ..Lists::default() },
            options: RunOptions { reach: 2, find_cuts: true, whole_windows: false },
            available: (1..=12).collect(),
            cuts: Vec::new(),
        }
    }

    fn run(&mut self, wanted: &[i64]) -> (Outcome, Vec<Event>) {
        let plan = Plan::new(&self.available, wanted, 2, &self.cuts);
        let events = Mutex::new(Vec::new());
        let notify = |event| events.lock().unwrap().push(event);
        let stop = AtomicBool::new(false);
        let outcome = run(&plan, &self.files, &mut self.window, self.options, &stop, &notify).unwrap();
        (outcome, events.into_inner().unwrap())
    }

    fn seen(&self, number: i64) -> Vec<i64> {
        self.files.written.lock().unwrap().get(&number).cloned().unwrap_or_default()
    }
}

#[test]
fn every_split_gives_every_frame_the_same_window() {
    let mut whole = Case::new();
    (whole.available, whole.cuts) = ((1..=12).filter(|n| *n != 7).collect(), vec![4]);
    whole.window.cut_before = vec![10];
    let all = whole.available.clone();
    let (outcome, events) = whole.run(&all);
    assert_eq!(outcome.written(), 11);
    assert_eq!(outcome.cuts, [10]);
    assert!(events.contains(&Event::Cut(10)));
    assert_eq!(whole.seen(5), [4, 5, 6]);
    assert_eq!(whole.seen(9), [8, 9]);
    for split in [vec![1], vec![2, 3], vec![4, 5, 6, 8], vec![9], vec![10, 12], vec![11]] {
        let mut part = Case { available: whole.available.clone(), cuts: whole.cuts.clone(), ..Case::new() };
        part.window.cut_before = vec![10];
        part.run(&split);
        for &number in &split {
            assert_eq!(part.seen(number), whole.seen(number), "frame {number} of {split:?}");
        }
        assert_eq!(part.files.written.lock().unwrap().len(), split.len());
    }
}

#[test]
fn a_frame_that_cannot_be_read_fails_and_the_others_are_written() {
    let mut case = Case::new();
    case.files.unreadable = vec![5];
    let (outcome, events) = case.run(&[3, 4, 5, 6]);
    assert_eq!(outcome.written(), 3);
    assert!(matches!(&outcome.frames[2], (5, Fate::Failed(why)) if why.contains("frame.exr")), "{outcome:?}");
    assert_eq!((case.seen(4), case.seen(6)), (vec![2, 3, 4], vec![6, 7, 8]));
    assert!(events.iter().any(|e| matches!(e, Event::Failed(5, _))));
    // A neighbour that is not wanted is only reported.
    let mut case = Case::new();
    case.files.unreadable = vec![5];
    let (outcome, events) = case.run(&[3, 4]);
    assert_eq!(outcome.written(), 2);
    assert!(events.iter().any(|e| matches!(e, Event::Note(why) if why.contains("without it"))), "{events:?}");
}

#[test]
fn with_whole_windows_it_spoils_its_neighbours() {
    let mut case = Case::new();
    case.files.unreadable = vec![6];
    case.options.whole_windows = true;
    let all = case.available.clone();
    let (outcome, _) = case.run(&all);
    let failed: Vec<i64> = outcome.frames.iter().filter(|f| f.1 != Fate::Written).map(|f| f.0).collect();
    assert_eq!(failed, [4, 5, 6, 7, 8]);
    assert!(case.files.written.lock().unwrap().keys().all(|n| !failed.contains(n)));
}

#[test]
fn a_full_disk_ends_the_run_and_another_error_of_writing_does_not() {
    let mut case = Case::new();
    case.files.full_from = Some(6);
    let all = case.available.clone();
    let (outcome, _) = case.run(&all);
    assert_eq!(outcome.written(), 5);
    assert!(outcome.ended.as_ref().is_some_and(|why| why.contains("frame.exr")), "{outcome:?}");
    assert!(outcome.frames.iter().any(|(_, fate)| *fate == Fate::Skipped));
    let mut case = Case::new();
    case.files.unwritable = vec![6];
    let (outcome, _) = case.run(&all);
    assert_eq!((outcome.written(), outcome.ended), (11, None));
}

#[test]
fn a_frame_that_the_filter_refuses_fails_alone() {
    let mut case = Case::new();
    case.window.refuses = Some(6);
    let all = case.available.clone();
    let (outcome, _) = case.run(&all);
    assert_eq!(outcome.written(), 11);
    assert!(matches!(outcome.frames[5], (6, Fate::Failed(_))));
    assert_eq!((case.seen(5), case.seen(7)), (vec![3, 4, 5], vec![7, 8, 9]));
}

#[test]
fn asked_to_stop_it_ends_with_whole_frames() {
    let case = Case::new();
    let all: Vec<i64> = (1..=500).collect();
    let plan = Plan::new(&all, &all, 2, &[]);
    let stop = AtomicBool::new(false);
    let notify = |event| {
        if event == Event::Written(20) {
            stop.store(true, Ordering::SeqCst);
        }
    };
    let mut window = Lists { reach: 2, ..Lists::default() };
    let outcome = run(&plan, &case.files, &mut window, case.options, &stop, &notify).unwrap();
    assert_eq!(outcome.ended.as_deref(), Some(""));
    let written = outcome.written();
    assert!((20..30).contains(&written), "{written}");
    assert_eq!(case.files.written.lock().unwrap().len(), written);
    // Reading is never far ahead of writing.
    assert!(case.files.reads.lock().unwrap().len() < 40);
}

#[test]
#[cfg(unix)]
fn costs_are_told_apart() {
    struct Costly(Numbers);
    fn spend(seconds: f64) {
        let begin = super::super::clock::thread_seconds().unwrap();
        let mut x = 1.0f64;
        while super::super::clock::thread_seconds().unwrap() - begin < seconds {
            x = std::hint::black_box(x.sin());
        }
    }
    impl Files for Costly {
        type Loaded = i64;
        type Done = Vec<i64>;
        fn read(&self, number: i64, wanted: bool) -> Result<(i64, Vec<String>), Error> {
            use rayon::prelude::*;
            (0..2).into_par_iter().for_each(|_| spend(0.01));
            self.0.read(number, wanted)
        }
        fn write(&self, number: i64, done: Vec<i64>) -> Result<Vec<String>, Error> {
            spend(0.005);
            self.0.write(number, done)
        }
    }
    let all: Vec<i64> = (1..=6).collect();
    let plan = Plan::new(&all, &all, 1, &[]);
    let files = Costly(Numbers::default());
    let mut window = Lists { reach: 1, ..Lists::default() };
    let options = RunOptions { reach: 1, ..RunOptions::default() };
    let outcome = run(&plan, &files, &mut window, options, &AtomicBool::new(false), &|_| {}).unwrap();
    let times = outcome.times;
    let (reading, writing) = (times.reading.cpu.unwrap(), times.writing.cpu.unwrap());
    assert!((0.12..0.3).contains(&reading), "{times:?}");
    assert!((0.03..0.12).contains(&writing), "{times:?}");
    assert!(times.filtering.cpu.unwrap() < 0.1, "{times:?}");
}
