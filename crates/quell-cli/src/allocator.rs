//! What becomes of memory that was freed: kept for the next plane of its size, or given back to the system where a limit was set.
//!
//! glibc serves blocks of more than 32 MiB from the system one by one, and smaller ones, too, until one of their size was freed: the
//! system hands out zeroed pages, each with an interrupt of its own. Planes of large pictures are such blocks, and are taken and freed by
//! every stage of every frame: at 1920x1080 that was a fifth of all processor seconds. From a heap of its own, which never shrinks, the same
//! planes come for nothing.
//!
//! A job in bands takes and frees planes in another size for each band, though: one heap a thread held 5.6 GiB where 3.0 were in
//! use. There, blocks go back. The other systems' allocators have no such rules.

/// From now on what is freed stays with the process, in one heap. To be called before there are other threads: their heaps stay as
/// they are.
pub fn keep_for_reuse() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    glibc::set(&[
        (libc::M_ARENA_MAX, 1),
        (libc::M_MMAP_THRESHOLD, libc::c_int::MAX),
        (libc::M_TRIM_THRESHOLD, -1), // never
    ]);
}

/// From now on every block of a mebibyte or more is the system's own again as soon as it is freed. It costs time:
/// the system hands out zeroed pages (8 % more processor seconds at 480x270).
pub fn give_back_at_once() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    glibc::set(&[(libc::M_MMAP_THRESHOLD, glibc::LARGE), (libc::M_TRIM_THRESHOLD, glibc::LARGE)]);
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(unsafe_code, reason = "the C library's settings have no other door")]
mod glibc {
    /// Below it lie rows and lists; planes of a band lie above.
    pub(super) const LARGE: libc::c_int = 1 << 20;

    pub(super) fn set(settings: &[(libc::c_int, libc::c_int)]) {
        for (setting, value) in settings {
            // SAFETY: `mallopt` takes two integers and no pointer, and may be called at any time; glibc locks its own state.
            // It answers 0 where it refuses, and nothing changes then.
            let _ = unsafe { libc::mallopt(*setting, *value) };
        }
    }
}

#[cfg(all(test, target_os = "linux", target_env = "gnu"))]
mod tests {
    /// Bytes of the process that lie in memory.
    fn resident() -> usize {
        let status = std::fs::read_to_string("/proc/self/status").expect("Linux tells");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("a line");
        line.trim().trim_end_matches("kB").trim().parse::<usize>().expect("a number") * 1024
    }

    #[test]
    fn planes_that_were_freed_go_back_although_something_younger_is_kept() {
        const PLANES: usize = 64;
        const BYTES: usize = 4 << 20;
        super::give_back_at_once();
        // This alone would make glibc keep everything smaller.
        drop(std::hint::black_box(vec![1u8; 16 << 20]));
        let before = resident();
        let planes: Vec<Vec<u8>> = (0..PLANES).map(|_| std::hint::black_box(vec![1u8; BYTES])).collect();
        let younger = std::hint::black_box(vec![1u8; 100 << 10]);
        let held = resident() - before;
        assert!(held > PLANES * BYTES * 9 / 10, "{held}");
        drop(planes);
        let kept = resident().saturating_sub(before);
        assert!(kept < PLANES * BYTES / 10, "{kept} bytes were kept beside {}", younger.len());
    }

    /// Times that the process had to wait for a page.
    fn faults() -> usize {
        let stat = std::fs::read_to_string("/proc/self/stat").expect("Linux tells");
        // The tenth field; the second is the program's name, which may hold blanks.
        let after = stat.rsplit_once(')').expect("a name").1;
        after.split_whitespace().nth(7).and_then(|v| v.parse().ok()).expect("a number")
    }

    /// In a process of its own: how memory is served is the whole process's.
    #[test]
    fn planes_that_were_freed_are_used_again() {
        const CHILD: &str = "QUELL_TEST_ALLOCATOR";
        if std::env::var_os(CHILD).is_none() {
            let name = "allocator::tests::planes_that_were_freed_are_used_again";
            let run = std::process::Command::new(std::env::current_exe().expect("a test"))
                .args(["--exact", name, "--test-threads=1"])
                .env(CHILD, "1")
                .output()
                .expect("it starts");
            assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stdout));
            assert!(String::from_utf8_lossy(&run.stdout).contains("1 passed"), "it ran nothing");
            return;
        }
        super::keep_for_reuse();
        let take = || drop((0..4).map(|_| std::hint::black_box(vec![1u8; 40 << 20])).collect::<Vec<_>>());
        // A thread that begins now: the harness's own has its heap already.
        let count = move || {
            let begin = faults();
            take();
            let first = faults() - begin;
            take();
            (first, faults() - begin - first)
        };
        let (first, second) = std::thread::spawn(count).join().expect("it ends");
        assert!(second < first / 10, "{first} pages at first, {second} then");
    }
}
