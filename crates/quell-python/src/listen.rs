//! Work in a thread of its own, while the calling one hears what it tells, and Python's signals.

use crate::failure::Failure;
use pyo3::exceptions::PySystemExit;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How long Ctrl-C may wait to be seen.
const LOOK: Duration = Duration::from_millis(50);

/// Calls that compute without Python's lock. An interpreter that ends kills every thread that takes its lock again, whose stack holds
/// what others still work on: so it waits for them, and they end after the frame in hand.
struct Calls {
    inside: Mutex<usize>,
    left: Condvar,
    ends: AtomicBool,
}

static CALLS: Calls = Calls { inside: Mutex::new(0), left: Condvar::new(), ends: AtomicBool::new(false) };
/// How long an interpreter that ends waits: a callback that never returns must not keep it.
const PATIENCE: Duration = Duration::from_secs(60);

impl Calls {
    fn count(&self) -> MutexGuard<'_, usize> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A call that is inside; it goes out with Python's lock in its hands.
struct Inside;

impl Inside {
    fn enter() -> PyResult<Self> {
        let mut count = CALLS.count();
        // Under the same lock as the count: whoever comes in later sees it.
        if CALLS.ends.load(Ordering::SeqCst) {
            return Err(PySystemExit::new_err(()));
        }
        *count += 1;
        Ok(Self)
    }
}

impl Drop for Inside {
    fn drop(&mut self) {
        *CALLS.count() -= 1;
        CALLS.left.notify_all();
    }
}

/// Called as the interpreter ends, before any thread is killed: calls end after the frame in hand, with `SystemExit` in their threads.
#[pyfunction]
pub fn finish(py: Python<'_>) {
    py.detach(|| {
        let count = CALLS.count();
        CALLS.ends.store(true, Ordering::SeqCst);
        // Whether all are out or the time is: the interpreter ends.
        drop(CALLS.left.wait_timeout_while(count, PATIENCE, |inside| *inside > 0));
    });
}

/// [`Python::detach`] that an interpreter which ends waits for.
pub fn detached<R: Send>(py: Python<'_>, work: impl FnOnce() -> R + Send) -> PyResult<R> {
    let _inside = Inside::enter()?;
    Ok(py.detach(work))
}

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
    let inside = Inside::enter()?;
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
                if CALLS.ends.load(Ordering::SeqCst) {
                    stop.store(true, Ordering::SeqCst);
                } else if raised.is_none() {
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
    drop(inside);
    if CALLS.ends.load(Ordering::SeqCst) {
        return Err(PySystemExit::new_err(()));
    }
    match (raised, result) {
        (Some(error), _) => Err(error),
        (None, Ok(result)) => Ok(result),
        (None, Err(_)) => Err(Failure::other("the filter failed; this is a defect of quell, please report it").into()),
    }
}
