//! Every method over the frames of one seed, measured.

use crate::context::Context;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Work;
use quell_lab::Error;
use quell_lab::compare::memory::Memory;
use quell_lab::compare::{Finished, Judge, Runner, Sequence, Verdict};
use quell_lab::methods::external::Competitor;
use quell_trace::TraceError;
use std::path::Path;

/// Share of a method's time that measuring takes, for the bar.
const MEASURING: f32 = 0.3;

/// What came of one seed.
pub struct Contest {
    pub sequence: Sequence,
    pub entries: Vec<Entry>,
}

/// What came of one method.
pub struct Entry {
    pub name: String,
    /// Or why there is nothing.
    pub result: Result<(Finished, Verdict), String>,
}

/// Bytes that the program's allocator has given out.
pub struct Counted;

impl Memory for Counted {
    fn allocated(&self) -> Option<usize> {
        Some(crate::ALLOCATOR.current_usage())
    }

    fn peak(&self) -> Option<usize> {
        Some(crate::ALLOCATOR.peak_usage())
    }

    fn reset_peak(&self) {
        crate::ALLOCATOR.reset_peak_usage();
    }
}

impl Contest {
    /// Runs and measures one method after the other; one that fails is noted and the others run. `maps`: FLIP maps
    /// are kept.
    pub fn hold(
        context: &Context,
        sequence: Sequence,
        competitors: &[Competitor],
        folder: &Path,
        maps: bool,
    ) -> Result<Self, Failure> {
        let program = program(&context.program);
        let backend = context.backend()?;
        let runner = Runner { folder, program: &program, backend, memory: &Counted, cancel: Some(interrupt::flag()) };
        let judge = Judge::new(&sequence)?;
        let work = Work::new(context.quiet);
        let mut entries = Vec::new();
        let (count, frames) = (competitors.len() as f32, sequence.numbers.len());
        for (index, competitor) in competitors.iter().enumerate() {
            let name = competitor.name();
            let at = |within: f32, what: &str| {
                let note = format!("{name} ({} of {}), {what}", index + 1, competitors.len());
                work.to((index as f32 + within) / count, &note);
            };
            at(0.0, "running");
            let result = runner
                .run(&sequence, competitor, &|done| {
                    let share = done as f32 / frames.max(1) as f32;
                    at(share * (1.0 - MEASURING), &format!("frame {done} of {frames}"));
                })
                .and_then(|finished| {
                    let verdict = judge.measure(&finished, &|done| {
                        let share = done as f32 / sequence.scored.len().max(1) as f32;
                        at(1.0 - MEASURING * (1.0 - share), "measuring");
                    })?;
                    Ok((finished, verdict))
                });
            let result = match result {
                Err(Error::Trace(TraceError::Cancelled)) => return Err(interrupted(index, competitors.len())),
                Err(Error::Method { reason, .. }) => Err(reason),
                Err(error) => Err(error.to_string()),
                Ok((finished, verdict)) if maps => Ok((finished, verdict)),
                Ok((finished, verdict)) => Ok((finished, Verdict { maps: Default::default(), ..verdict })),
            };
            if let Err(reason) = &result {
                work.say(&format!("warning: {name}: {reason}"));
            }
            if interrupt::asked() {
                return Err(interrupted(index + 1, competitors.len()));
            }
            entries.push(Entry { name: name.to_owned(), result });
        }
        drop(judge);
        Ok(Self { sequence, entries })
    }

    /// What methods say about themselves.
    pub fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = Vec::new();
        for (finished, _) in self.entries.iter().filter_map(|e| e.result.as_ref().ok()) {
            notes.extend(finished.notes.iter().cloned());
        }
        let resumed = |e: &&Entry| e.result.as_ref().is_ok_and(|(f, _)| f.resumed);
        let names: Vec<&str> = self.entries.iter().filter(resumed).map(|e| e.name.as_str()).collect();
        if !names.is_empty() {
            notes.push(format!("Pictures and times of {} come from an earlier run of this command.", names.join(", ")));
        }
        notes
    }
}

fn interrupted(finished: usize, of: usize) -> Failure {
    Failure::Interrupted(format!(
        "{finished} of {of} methods are finished and kept; the same command goes on from here"
    ))
}

/// Stands for the very program in this file: a change of any filter changes its bytes, while its version stays for months.
pub fn program(file: &Path) -> String {
    let bytes = std::fs::read(file).unwrap_or_default();
    let hash = bytes.chunks(8).fold(0xcbf2_9ce4_8422_2325_u64, |hash, chunk| {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        (hash ^ u64::from_le_bytes(word)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    format!("quell {} {hash:016x}", env!("CARGO_PKG_VERSION"))
}
