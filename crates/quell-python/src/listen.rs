//! Work in a thread of its own, while the calling one hears what it tells, and Python's signals.

use crate::failure::Failure;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

/// How long Ctrl-C may wait to be seen.
const LOOK: Duration = Duration::from_millis(50);

/// Threads for the filter: so many, or as many as the machine has.
pub fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, Failure> {
    if threads == Some(0) {
        return Err(Failure::input("threads: 0; at least 1 is needed"));
    }
    let built = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    built.map_err(|e| Failure::other(format!("threads: cannot start {threads:?}: {e}")))
}

/// Sends a message to the calling thread; false: that wants no more.
pub type Tell<'t, M> = &'t (dyn Fn(M) -> bool + Sync);

/// Runs `work` in the pool. What it tells is given to `hear`, with Python's lock. Where that raises, or the user interrupts,
/// the flag is set, the work is expected to end, and the exception comes back.
pub fn listen<M: Send, R: Send>(
    py: Python<'_>,
    pool: &rayon::ThreadPool,
    work: impl FnOnce(Tell<'_, M>, &AtomicBool) -> R + Send,
    mut hear: impl FnMut(Python<'_>, M) -> PyResult<()> + Send,
) -> PyResult<R> {
    let stop = AtomicBool::new(false);
    let (result, raised) = py.detach(|| {
        std::thread::scope(|scope| {
            let (to, from) = sync_channel::<M>(0);
            let stop = &stop;
            let worker = scope.spawn(move || {
                pool.install(move || {
                    let tell = |message| !stop.load(Ordering::SeqCst) && to.send(message).is_ok();
                    work(&tell, stop)
                })
            });
            let mut raised = None;
            loop {
                let message = match from.recv_timeout(LOOK) {
                    Ok(message) => Some(message),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                if raised.is_none() {
                    let heard = Python::attach(|py| {
                        py.check_signals()?;
                        message.map_or(Ok(()), |message| hear(py, message))
                    });
                    if let Err(error) = heard {
                        raised = Some(error);
                        stop.store(true, Ordering::SeqCst);
                    }
                }
            }
            (worker.join(), raised)
        })
    });
    match (raised, result) {
        (Some(error), _) => Err(error),
        (None, Ok(result)) => Ok(result),
        (None, Err(_)) => Err(Failure::other("the filter failed; this is a defect of quell, please report it").into()),
    }
}
