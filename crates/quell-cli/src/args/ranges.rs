//! Ranges of frames: `1001-1100`, `1001-1100x2` (or `:2`, as Open Job Description writes it), `1,4,7-9`, `-10--1`.
//! Inclusive.

use std::str::FromStr;

/// More frames than any run has; a longer list is a slip of the finger.
const MOST_FRAMES: u64 = 1_000_000;
/// Frame numbers beyond 32 bits are no frame numbers: no program knows them.
const LARGEST_NUMBER: u64 = i32::MAX as u64;

/// A list of frame numbers, ascending, each once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frames(Vec<i64>);

impl Frames {
    /// The numbers, ascending, at least one.
    pub fn numbers(&self) -> &[i64] {
        &self.0
    }
}

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut numbers = Vec::new();
        for part in text.split(',') {
            let part = part.trim();
            let (first, last, step) = parsed(part).ok_or_else(|| {
                format!("`{part}` is no range of frames; write 1001-1100, 1001-1100x2, 1,4,7-9 or -10--1")
            })?;
            if let Some(beyond) = [first, last].into_iter().find(|n| n.unsigned_abs() > LARGEST_NUMBER) {
                return Err(format!("frame {beyond} is beyond {LARGEST_NUMBER}, the largest frame number"));
            }
            if first > last {
                return Err(format!("`{part}` ends before it begins"));
            }
            let length = last.abs_diff(first) / step;
            if length.saturating_add(numbers.len() as u64) >= MOST_FRAMES {
                return Err(format!("`{part}` is more than {MOST_FRAMES} frames"));
            }
            numbers.extend((0..=length).map(|i| first + (i * step) as i64));
        }
        numbers.sort_unstable();
        numbers.dedup();
        Ok(Self(numbers))
    }
}

/// First, last and step of `a`, `a-b` or `a-bxn`.
fn parsed(part: &str) -> Option<(i64, i64, u64)> {
    // A minus sign at the very start belongs to the number.
    let dash = part.char_indices().skip(1).find(|(_, c)| *c == '-').map(|(i, _)| i);
    let Some(dash) = dash else {
        let only = number(part)?;
        return Some((only, only, 1));
    };
    let (last, step) = match part[dash + 1..].split_once(['x', ':']) {
        Some((last, step)) if step.bytes().all(|b| b.is_ascii_digit()) => (last, step.parse().ok().filter(|s| *s > 0)?),
        Some(_) => return None,
        None => (&part[dash + 1..], 1),
    };
    Some((number(&part[..dash])?, number(last)?, step))
}

/// Digits with a minus sign or without; no plus, no spaces.
fn number(text: &str) -> Option<i64> {
    let digits = text.strip_prefix('-').unwrap_or(text);
    if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) { None } else { text.parse().ok() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str) -> Vec<i64> {
        text.parse::<Frames>().unwrap_or_else(|e| panic!("{text}: {e}")).0
    }

    #[test]
    fn ranges_are_inclusive_sorted_and_without_repeats() {
        assert_eq!(numbers("1001-1004"), [1001, 1002, 1003, 1004]);
        assert_eq!(numbers("1001-1006x2"), [1001, 1003, 1005]);
        assert_eq!(numbers("1001-1006:2"), [1001, 1003, 1005]);
        assert_eq!(numbers("1,4,7-9"), [1, 4, 7, 8, 9]);
        assert_eq!(numbers("-10--7"), [-10, -9, -8, -7]);
        assert_eq!(numbers("-2-1"), [-2, -1, 0, 1]);
        assert_eq!(numbers("7"), [7]);
        assert_eq!(numbers("-7"), [-7]);
        assert_eq!(numbers("3-5,4,1"), [1, 3, 4, 5]);
        assert_eq!(numbers("5-5x9"), [5]);
        assert_eq!(numbers("-2147483647,2147483647"), [-2_147_483_647, 2_147_483_647]);
    }

    #[test]
    fn what_is_no_range_is_refused_by_name() {
        for text in ["", "a", "1-", "-", "--", "1--", "1-2x", "1-2x0", "1-2x-1", "1x2", "1,,2", "1-2-3", "+1", "1.5"] {
            let error = text.parse::<Frames>().unwrap_err();
            assert!(error.contains("no range of frames"), "{text}: {error}");
        }
        assert!("9-1".parse::<Frames>().unwrap_err().contains("ends before it begins"));
        assert!("0-2000000000".parse::<Frames>().unwrap_err().contains("more than"));
        assert!("-2147483647-2147483647".parse::<Frames>().unwrap_err().contains("more than"));
        assert!("2147483648".parse::<Frames>().unwrap_err().contains("largest frame number"));
        assert!("-9223372036854775808-9223372036854775807".parse::<Frames>().unwrap_err().contains("largest"));
        assert!("99999999999999999999".parse::<Frames>().is_err());
    }
}
