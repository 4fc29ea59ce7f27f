//! How much memory a job takes, and in how many bands of rows it fits.

use crate::adapt::Footprint;
use crate::error::Error;
use crate::image::Window;

/// What every process takes, whatever the frames: code, threads, buffers of files.
const FIXED: u64 = 96 << 20;
/// Estimates are multiplied by it: allocators keep some of what was given back.
const SLACK: f64 = 1.1;
/// Of what the system has free a job without a limit of its own takes this share.
const SYSTEM_SHARE: f64 = 0.85;
/// Bands are never lower than this many rows.
const LEAST_ROWS: usize = 8;

/// What a job would take.
#[derive(Clone, Debug, PartialEq)]
pub struct Memory {
    /// Bytes without bands.
    pub whole: u64,
    /// Bytes in `bands`.
    pub bytes: u64,
    /// Bands of rows; 1: the whole picture at once.
    pub bands: usize,
    /// What it must not exceed, and whether the user said so; absent: the system reports nothing.
    pub limit: Option<(u64, bool)>,
}

impl Memory {
    /// For a person.
    pub fn describe(&self) -> String {
        let how = if self.bands > 1 {
            format!("in at least {} bands of rows ({} at once)", self.bands, in_words(self.whole))
        } else {
            "the whole picture at once".to_owned()
        };
        let limit = match self.limit {
            Some((limit, true)) => format!("; the limit is {}", in_words(limit)),
            Some((limit, false)) => format!("; the system has {} free", in_words(limit)),
            None => String::new(),
        };
        format!("at most {}, {how}{limit}", in_words(self.bytes))
    }
}

/// What decides how much memory a job takes.
pub(super) struct Estimate {
    pub footprints: Vec<Footprint>,
    pub canvas: Window,
    /// Frames that are inside the filter at once, at most.
    pub window: usize,
    /// Neighbours on each side whose filtered pictures are needed.
    pub steady: usize,
}

impl Estimate {
    /// Bytes at the peak, in bands with `margin` rows around each.
    pub fn bytes(&self, bands: usize, margin: usize) -> u64 {
        let (width, height) = (self.canvas.size.width as f64, self.canvas.size.height as f64);
        let sum = |per_pixel: &dyn Fn(&Footprint) -> f64| self.footprints.iter().map(per_pixel).sum::<f64>();
        let most = |per_pixel: &dyn Fn(&Footprint) -> f64| self.footprints.iter().map(per_pixel).fold(0.0, f64::max);
        let pixels = width * height;
        // The files of all layers are read together; the filters of layers take turns.
        let reading = sum(&|f| f.read_bytes + f.waiting()) + most(&Footprint::planes);
        let writing = sum(&|f| f.written_bytes + f.filtered()) + 64.0;
        let rows = if bands <= 1 { height } else { (height / bands as f64 + 2.0 * margin as f64).min(height) };
        let at_work = most(&|f: &Footprint| f.at_work(rows));
        let inside = sum(&|f| f.waiting() * self.window as f64 + f.estimates(self.steady)) + at_work;
        let peak = if bands <= 1 {
            pixels * (reading + inside + writing)
        } else {
            // A frame as read, and the one before that waits for it; then bands, one frame more than in the window on its
            // way in and one on its way out; then frames as written.
            let band = width * rows * (inside + sum(&|f| f.waiting() + f.filtered()));
            let spool = pixels * (reading + sum(&Footprint::waiting));
            band.max(spool).max(pixels * writing)
        };
        FIXED + (peak * SLACK) as u64
    }

    /// The fewest bands that keep the limit (of the user, where true). What the system has free may be more a moment later:
    /// where no bands keep that, those that take least.
    ///
    /// # Errors
    /// [`Error::Memory`] where none keeps the user's limit.
    pub fn bands(&self, limit: Option<(u64, bool)>, margin: usize) -> Result<usize, Error> {
        let Some((limit, asked)) = limit else { return Ok(1) };
        let most = (self.canvas.size.height / LEAST_ROWS).max(1);
        let fits = |bands: &usize| self.bytes(*bands, margin) <= limit;
        let least = || (1..=most).map(|bands| (self.bytes(bands, margin), bands)).min().unwrap_or((0, 1));
        match (1..=most).find(fits) {
            Some(bands) => Ok(bands),
            None if asked => Err(Error::Memory { needed: least().0, limit }),
            None => Ok(least().1),
        }
    }
}

/// Bytes that the system would give without taking them from others; `None` where it does not report them.
pub(super) fn system() -> Option<u64> {
    let number = |path: &str| std::fs::read_to_string(path).ok()?.trim().parse::<u64>().ok();
    let info = std::fs::read_to_string("/proc/meminfo").ok();
    let free = info.and_then(|text| {
        let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
        Some(line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()? * 1024)
    });
    // A container's or a job's own limit (control groups, version 2).
    let group = number("/sys/fs/cgroup/memory.max")
        .map(|most| most.saturating_sub(number("/sys/fs/cgroup/memory.current").unwrap_or(0)));
    let least = free.into_iter().chain(group).min()?;
    Some((least as f64 * SYSTEM_SHARE) as u64)
}

/// Bytes for a person: `5.2 GiB`.
pub fn in_words(bytes: u64) -> String {
    let mebibytes = bytes as f64 / f64::from(1 << 20);
    if mebibytes >= 1024.0 { format!("{:.1} GiB", mebibytes / 1024.0) } else { format!("{mebibytes:.0} MiB") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell::Size;

    fn estimate() -> Estimate {
        let footprint = Footprint { lights: 10.0, weights: 3.0, read_bytes: 90.0, written_bytes: 66.0 };
        Estimate {
            footprints: vec![footprint],
            canvas: Window::new(0, 0, Size::new(1920, 1080)),
            window: 21,
            steady: 2,
        }
    }

    #[test]
    fn more_bands_take_less_and_a_limit_is_kept() {
        let e = estimate();
        let whole = e.bytes(1, 100);
        assert_eq!(e.bands(None, 100).unwrap(), 1);
        assert_eq!(e.bands(Some((whole, true)), 100).unwrap(), 1);
        let bands = e.bands(Some((whole / 2, true)), 100).unwrap();
        assert!(bands > 1 && e.bytes(bands, 100) <= whole / 2 && e.bytes(bands - 1, 100) > whole / 2, "{bands}");
        // Wide margins need more.
        assert!(e.bytes(4, 200) > e.bytes(4, 20));
        assert!(e.bands(Some((1 << 20, false)), 100).unwrap() > 10);
        let Err(error) = e.bands(Some((1 << 20, true)), 100) else { panic!("it was accepted") };
        assert!(error.to_string().contains("GiB"), "{error}");
        assert_eq!(in_words(3 << 29), "1.5 GiB");
        assert_eq!(in_words(500 << 20), "500 MiB");
    }
}
