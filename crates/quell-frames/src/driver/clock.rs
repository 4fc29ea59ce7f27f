//! What the threads of a job cost: seconds of processor time, and seconds by the clock.

use std::time::{Duration, Instant};

/// What one of the three steps cost so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTime {
    /// Processor seconds of all threads that worked on it; absent where the system does not report them.
    pub cpu: Option<f64>,
    /// Seconds by the clock in which it had work (not those of waiting).
    pub busy: f64,
}

/// What a job cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Times {
    /// Finding, decoding, and making planes of it.
    pub reading: StageTime,
    /// The filter.
    pub filtering: StageTime,
    /// Putting filtered light back into channels, encoding, writing.
    pub writing: StageTime,
    /// From the first frame's reading to the last one's writing, by the clock.
    pub wall: f64,
    /// A device took part in the filter, whose work is in no processor second.
    pub elsewhere: bool,
}

impl Times {
    /// The least that `cores` cores could take if all three overlapped wholly and spread over all cores: their processor
    /// seconds together over the cores. `None`: the system does not report them, or they are not all of the work.
    pub fn bound(&self, cores: usize) -> Option<f64> {
        if self.elsewhere {
            return None;
        }
        let sum = self.reading.cpu? + self.filtering.cpu? + self.writing.cpu?;
        Some(sum / cores.max(1) as f64)
    }
}

/// Processor seconds of the thread that calls.
#[cfg(unix)]
pub fn thread_seconds() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Some(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
}

/// Not asked for on this system.
#[cfg(not(unix))]
pub fn thread_seconds() -> Option<f64> {
    None
}

/// Processor seconds of all threads of the process so far.
#[cfg(unix)]
pub fn process_seconds() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
}

/// Not asked for on this system.
#[cfg(not(unix))]
pub fn process_seconds() -> Option<f64> {
    None
}

/// Processor seconds of every thread of the pool that calls, and of the caller where it is none of them.
pub fn pool_seconds() -> Option<f64> {
    let own = if rayon::current_thread_index().is_none() { thread_seconds()? } else { 0.0 };
    rayon::broadcast(|_| thread_seconds()).into_iter().try_fold(own, |sum, seconds| Some(sum + seconds?))
}

/// Adds up the time in which a step had work.
#[derive(Debug, Default)]
pub struct Busy(Duration);

impl Busy {
    /// Runs `work` and counts its time.
    pub fn during<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let begin = Instant::now();
        let result = work();
        self.0 += begin.elapsed();
        result
    }

    /// Counts some time.
    pub fn add(&mut self, time: Duration) {
        self.0 += time;
    }

    /// Seconds so far.
    pub fn seconds(&self) -> f64 {
        self.0.as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn work_costs_processor_time_and_waiting_does_not() {
        let begin = thread_seconds().unwrap();
        std::thread::sleep(Duration::from_millis(120));
        let slept = thread_seconds().unwrap();
        assert!(slept - begin < 0.06, "{}", slept - begin);
        let mut x = 1.0f64;
        while thread_seconds().unwrap() - slept < 0.05 {
            x = std::hint::black_box(x.sin());
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        assert!(pool.install(pool_seconds).unwrap() < 0.05);
    }

    #[test]
    fn the_bound_shares_processor_time_among_cores() {
        let stage = |cpu| StageTime { cpu: Some(cpu), busy: 0.0 };
        let times =
            Times { reading: stage(2.0), filtering: stage(8.0), writing: stage(4.0), wall: 7.5, elsewhere: false };
        assert_eq!(times.bound(2), Some(7.0));
        assert_eq!(Times { elsewhere: true, ..times }.bound(2), None);
        assert_eq!(Times::default().bound(2), None);
    }
}
