//! The largest memory that a method holds at once.
//!
//! Two lower bounds, of which the larger counts: bytes allocated in Rust, counted by the program's allocator, and the
//! growth of the process as the system sees it (Linux), which knows foreign libraries but not what the allocator had
//! kept from before. Both are read around each call, so that frames and pictures of the comparison itself do not
//! count; what stays allocated between calls is the method's own.

/// Bytes in use and their peak.
pub trait Memory: Sync {
    /// Bytes that are allocated now; `None`: not counted.
    fn allocated(&self) -> Option<usize>;

    /// The most since [`Memory::reset_peak`].
    fn peak(&self) -> Option<usize>;

    /// Begins a new peak.
    fn reset_peak(&self);
}

/// For programs whose allocator does not count.
pub struct NotCounted;

impl Memory for NotCounted {
    fn allocated(&self) -> Option<usize> {
        None
    }

    fn peak(&self) -> Option<usize> {
        None
    }

    fn reset_peak(&self) {}
}

/// Resident memory of this process, from the system.
struct Resident;

impl Resident {
    #[cfg(target_os = "linux")]
    fn read(field: &str) -> Option<usize> {
        let text = std::fs::read_to_string("/proc/self/status").ok()?;
        let line = text.lines().find_map(|line| line.strip_prefix(field))?;
        line.trim().strip_suffix("kB")?.trim().parse::<usize>().ok().map(|kib| kib * 1024)
    }

    #[cfg(not(target_os = "linux"))]
    fn read(_: &str) -> Option<usize> {
        None
    }
}

impl Memory for Resident {
    fn allocated(&self) -> Option<usize> {
        Self::read("VmRSS:")
    }

    fn peak(&self) -> Option<usize> {
        Self::read("VmHWM:")
    }

    fn reset_peak(&self) {
        // Where this is not allowed the peak of the whole process stays: `Account` then finds no growth or too much,
        // and takes nothing that began higher than it ended.
        #[cfg(target_os = "linux")]
        let _ = std::fs::write("/proc/self/clear_refs", "5");
    }
}

/// One method's share as one of the two sees it.
#[derive(Clone, Copy, Debug, Default)]
struct Account {
    before: usize,
    /// What it holds between calls.
    held: isize,
    most: usize,
    known: bool,
}

impl Account {
    fn begin(&mut self, memory: &dyn Memory) {
        memory.reset_peak();
        let before = memory.allocated();
        // Directly after a reset both are equal, but for other threads.
        let reset = memory.peak().zip(before).is_some_and(|(peak, now)| peak <= now.saturating_add(now / 50));
        self.known = reset;
        self.before = before.unwrap_or(0);
    }

    fn end(&mut self, memory: &dyn Memory) {
        if let (true, Some(peak), Some(after)) = (self.known, memory.peak(), memory.allocated()) {
            let within = peak.saturating_sub(self.before) as isize;
            self.most = self.most.max((within + self.held).max(0) as usize);
            self.held += after as isize - self.before as isize;
        }
    }
}

/// Measures one method.
pub struct Meter<'a> {
    counted: &'a dyn Memory,
    own: Account,
    resident: Account,
}

impl<'a> Meter<'a> {
    /// `counted` is the program's allocator.
    pub fn new(counted: &'a dyn Memory) -> Self {
        Self { counted, own: Account::default(), resident: Account::default() }
    }

    /// Right before a call.
    pub fn begin(&mut self) {
        self.resident.begin(&Resident);
        self.own.begin(self.counted);
    }

    /// Right after it.
    pub fn end(&mut self) {
        self.own.end(self.counted);
        self.resident.end(&Resident);
    }

    /// So many bytes of what the call left are the caller's now.
    pub fn released(&mut self, bytes: usize) {
        self.own.held -= bytes as isize;
        self.resident.held -= bytes as isize;
    }

    /// The most bytes at once; `None` where nothing could be measured.
    pub fn peak(&self) -> Option<u64> {
        let most = self.own.most.max(self.resident.most);
        (most > 0).then_some(most as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// An allocator whose figures a test sets.
    #[derive(Default)]
    struct Told {
        now: AtomicUsize,
        peak: AtomicUsize,
    }

    impl Told {
        fn set(&self, now: usize) {
            self.now.store(now, Ordering::SeqCst);
            self.peak.fetch_max(now, Ordering::SeqCst);
        }
    }

    impl Memory for Told {
        fn allocated(&self) -> Option<usize> {
            Some(self.now.load(Ordering::SeqCst))
        }
        fn peak(&self) -> Option<usize> {
            Some(self.peak.load(Ordering::SeqCst))
        }
        fn reset_peak(&self) {
            self.peak.store(self.now.load(Ordering::SeqCst), Ordering::SeqCst);
        }
    }

    #[test]
    fn what_stays_between_calls_counts_and_the_callers_frames_do_not() {
        let told = Told::default();
        told.set(1000);
        let mut account = Account::default();
        // The first call leaves 300 of state and a picture of 50, which the caller takes and drops.
        account.begin(&told);
        told.set(1500);
        told.set(1350);
        account.end(&told);
        account.held -= 50;
        // Another frame is read: 4000 bytes that are not the method's.
        told.set(5300);
        account.begin(&told);
        told.set(5900);
        told.set(5350);
        account.end(&told);
        assert_eq!(account.most, 900);
        assert_eq!(account.held, 350);
    }

    #[test]
    fn without_a_counter_the_system_is_asked() {
        let mut meter = Meter::new(&NotCounted);
        meter.begin();
        let large = vec![1_u8; 64 << 20];
        assert!(large.iter().step_by(4096).all(|&b| b == 1));
        meter.end();
        if cfg!(target_os = "linux") && meter.resident.known {
            let peak = meter.peak().unwrap_or(0);
            assert!(peak > 48 << 20, "{peak}");
        }
    }
}
