//! A sequence filtered: from files to files (what is read when, three things at once, what may be replaced), or frame by
//! frame in memory.
//!
//! ```text
//! plan.rs      which frames are read, in which order, where history starts afresh
//! pipeline.rs  reading, filtering and writing at the same time; what becomes of each frame
//! cuts.rs      shots separated by their feature buffers
//! job.rs       what the user asked for, made ready
//! run.rs       a job that is ready, run
//! frames.rs    a frame on its way through the three steps
//! layers.rs    its images to what the filter takes, and back: the same for frames in memory
//! stream.rs    frames in memory, pushed one by one
//! memory.rs    how much memory a job takes, and in how many bands of rows it fits
//! measure.rs   how far things move up and down, for a dry run
//! bands.rs     a job in bands, with what waits in files
//! output.rs    where frames go, what may stand there, which need not be made again
//! clock.rs     processor seconds of each of the three
//! ```
//!
//! A frame depends on the frames within [`Window`]'s reach and on nothing else. So any split of a job among machines gives
//! the same bits, and neighbours of what is written are read as needed.

mod bands;
pub mod clock;
pub mod cuts;
mod frames;
pub mod job;
mod layers;
mod measure;
mod memory;
pub mod output;
pub mod pipeline;
pub mod plan;
mod run;
pub mod stream;

pub use clock::{StageTime, Times};
pub use cuts::CutGuides;
pub use job::{Job, JobOptions};
pub use memory::{Memory, in_words};
pub use output::{Destination, Existing, JOB_ATTRIBUTE, is_done, job_key};
pub use pipeline::{Event, Fate, Files, Outcome, RunOptions, Window, run};
pub use plan::{Plan, Step, ranges};
pub use stream::{Cleaned, Stream, StreamOptions};
