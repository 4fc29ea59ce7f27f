//! Handles: one thread at a time inside, no panic across the border, the message of the last failure kept.

use crate::memory;
use crate::status::Failure;
use crate::types::{QUELL_INVALID_ARGUMENT, QUELL_OK, quell_status};
use std::ffi::c_char;
use std::mem::ManuallyDrop;
use std::panic::AssertUnwindSafe;
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::thread::JoinHandle;

/// What a handle holds.
pub trait Inside {
    /// What messages call it.
    const WORD: &'static str;
    /// What a living handle begins with; each kind has a number of its own.
    const ALIVE: u64;
    /// After a panic: what was inside is given up.
    fn reset(&mut self);
}

/// `alive` lies first, so that a handle of another kind is seen to be one.
#[repr(C)]
pub struct Handle<T> {
    alive: u64,
    inner: Mutex<T>,
    /// Of the last call that failed.
    message: Mutex<String>,
}

impl<T: Inside> Handle<T> {
    fn new(inner: T) -> Self {
        Self { alive: T::ALIVE, inner: Mutex::new(inner), message: Mutex::default() }
    }

    fn lock(&self) -> Result<MutexGuard<'_, T>, Failure> {
        match self.inner.try_lock() {
            Ok(inner) => Ok(inner),
            Err(TryLockError::Poisoned(poisoned)) => Ok(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => Err(Failure::busy(T::WORD)),
        }
    }
}

/// A handle of C; `None` for what is visibly none.
///
/// # Safety
/// Null, or what [`create`] made; else at least readable memory.
unsafe fn living<'h, T: Inside>(handle: *const Handle<T>) -> Option<&'h Handle<T>> {
    // SAFETY: as the caller promises; of what is no handle of this kind nothing but its first number is read.
    unsafe {
        let is_living = !handle.is_null() && handle.cast::<u64>().read_unaligned() == T::ALIVE;
        if is_living { handle.as_ref() } else { None }
    }
}

/// Runs a call on a handle.
pub fn call<T: Inside>(handle: *const Handle<T>, work: impl FnOnce(&mut T) -> Result<(), Failure>) -> quell_status {
    // SAFETY: the header asks for a handle that was created; what is visibly none is refused.
    let Some(handle) = (unsafe { living(handle) }) else { return QUELL_INVALID_ARGUMENT };
    let result = handle.lock().and_then(|mut inner| {
        let done = std::panic::catch_unwind(AssertUnwindSafe(|| work(&mut inner)));
        done.unwrap_or_else(|_| {
            inner.reset();
            Err(Failure::panicked())
        })
    });
    match result {
        Ok(()) => QUELL_OK,
        Err(failure) => {
            if let Ok(mut message) = handle.message.lock() {
                *message = failure.message;
            }
            failure.status
        }
    }
}

/// Makes a handle; where that fails nothing is written to it, and `text` (null, or `capacity` bytes) has the sentence.
pub fn create<T: Inside>(
    to: *mut *mut Handle<T>,
    text: *mut c_char,
    capacity: usize,
    make: impl FnOnce() -> Result<T, Failure>,
) -> quell_status {
    let made = std::panic::catch_unwind(AssertUnwindSafe(|| {
        if to.is_null() { Err(Failure::argument(format!("{}: a null pointer", T::WORD))) } else { make() }
    }));
    let (status, said) = match made.unwrap_or_else(|_| Err(Failure::panicked())) {
        Ok(made) => {
            // SAFETY: it is not null, and the header asks for room for a pointer.
            unsafe { to.write(Box::into_raw(Box::new(Handle::new(made)))) };
            (QUELL_OK, String::new())
        }
        Err(failure) => (failure.status, failure.message),
    };
    // SAFETY: the header asks for as many writable bytes.
    unsafe { memory::put_text(&said, text, capacity) };
    status
}

/// Why the last call that failed did so.
pub fn message<T: Inside>(handle: *const Handle<T>, text: *mut c_char, capacity: usize) -> usize {
    // SAFETY: as in `call`.
    let said = match unsafe { living(handle) } {
        Some(handle) => handle.message.lock().map(|message| message.clone()).unwrap_or_default(),
        None => format!("this is no {}, or it was freed", T::WORD),
    };
    // SAFETY: the header asks for as many writable bytes.
    unsafe { memory::put_text(&said, text, capacity) }
}

/// Frees a handle; what is visibly none is left alone.
pub fn free<T: Inside>(handle: *mut Handle<T>) {
    // SAFETY: the header asks for a handle that was created and that no thread is using.
    unsafe {
        if living(handle).is_some() {
            (*handle).alive = 0;
            drop(Box::from_raw(handle));
        }
    }
}

/// Threads that have ended when it is dropped: hosts unload libraries.
pub struct Pool {
    threads: ManuallyDrop<rayon::ThreadPool>,
    handles: Vec<JoinHandle<()>>,
}

impl Pool {
    /// So many threads; 0: as many as the machine has.
    pub fn new(count: usize) -> Result<Self, Failure> {
        let mut handles = Vec::new();
        let spawn = |thread: rayon::ThreadBuilder| {
            handles.push(std::thread::Builder::new().name("quell".to_owned()).spawn(|| thread.run())?);
            Ok(())
        };
        let built = rayon::ThreadPoolBuilder::new().num_threads(count).spawn_handler(spawn).build();
        let threads = built.map_err(|e| Failure::argument(format!("threads: cannot start {count}: {e}")))?;
        Ok(Self { threads: ManuallyDrop::new(threads), handles })
    }

    /// Runs it with these threads.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.threads.install(work)
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        // SAFETY: it is dropped here only, and not used any more.
        unsafe { ManuallyDrop::drop(&mut self.threads) };
        for handle in self.handles.drain(..) {
            let _ = handle.join();
        }
    }
}
