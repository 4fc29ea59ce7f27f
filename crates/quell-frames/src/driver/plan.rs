//! Which frames are read, in which order, and where history starts afresh. Numbers only: no file is looked at.

use std::collections::BTreeSet;

/// One frame of the job, in the order of reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Frame number.
    pub number: i64,
    /// True for a frame that is to be written; the others are read for their neighbours' sake.
    pub wanted: bool,
    /// True where nothing before this frame may be used: the first, after a gap, after a cut.
    pub fresh: bool,
}

/// What a job reads and writes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// Ascending.
    pub steps: Vec<Step>,
    /// Wanted, but there is no file.
    pub missing: Vec<i64>,
    /// Stretches without a file between frames that are there, as first and last missing number; only those near
    /// enough to matter.
    pub gaps: Vec<(i64, i64)>,
}

impl Plan {
    /// A plan for the frames `wanted` of those `available`, both ascending without repeats.
    ///
    /// A frame is filtered with up to `reach` frames on each side, none beyond a gap in the numbers or beyond one of
    /// `cuts` (the first frames of new shots). So what a frame sees does not depend on which others are wanted.
    pub fn new(available: &[i64], wanted: &[i64], reach: usize, cuts: &[i64]) -> Self {
        let reach = i64::try_from(reach).unwrap_or(i64::MAX);
        let there: BTreeSet<i64> = available.iter().copied().collect();
        let cuts: BTreeSet<i64> = cuts.iter().copied().collect();
        let mut read: BTreeSet<i64> = BTreeSet::new();
        let mut missing = Vec::new();
        let mut gaps = BTreeSet::new();
        for &number in wanted {
            if !there.contains(&number) {
                missing.push(number);
                continue;
            }
            read.insert(number);
            // Outwards on each side until a gap or a cut.
            for step in [-1, 1] {
                let mut last = number;
                for _ in 0..reach {
                    let Some(next) = last.checked_add(step) else { break };
                    // A cut lies before its frame.
                    if cuts.contains(&if step > 0 { next } else { last }) {
                        break;
                    }
                    if !there.contains(&next) {
                        gaps.extend(gap(&there, last, step));
                        break;
                    }
                    read.insert(next);
                    last = next;
                }
            }
        }
        let wanted: BTreeSet<i64> = wanted.iter().copied().collect();
        let mut previous: Option<i64> = None;
        let steps = read.into_iter().map(|number| {
            let follows = previous.is_some_and(|p| p.checked_add(1) == Some(number)) && !cuts.contains(&number);
            previous = Some(number);
            Step { number, wanted: wanted.contains(&number), fresh: !follows }
        });
        Self { steps: steps.collect(), missing, gaps: gaps.into_iter().collect() }
    }

    /// How many frames are to be written.
    pub fn wanted(&self) -> usize {
        self.steps.iter().filter(|step| step.wanted).count()
    }
}

/// The missing numbers next to `last` on the side of `step`; `None` where no frame follows at all.
fn gap(there: &BTreeSet<i64>, last: i64, step: i64) -> Option<(i64, i64)> {
    if step > 0 {
        let next = *there.range(last.checked_add(1)?..).next()?;
        Some((last + 1, next - 1))
    } else {
        let next = *there.range(..last).next_back()?;
        Some((next + 1, last - 1))
    }
}

/// Numbers as ranges: `1-4, 7`.
pub fn ranges(numbers: &[i64]) -> String {
    let mut parts: Vec<(i64, i64)> = Vec::new();
    for &number in numbers {
        match parts.last_mut() {
            Some((_, last)) if last.checked_add(1) == Some(number) => *last = number,
            _ => parts.push((number, number)),
        }
    }
    let text = parts.iter().map(|(a, b)| if a == b { a.to_string() } else { format!("{a}-{b}") });
    text.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(plan: &Plan) -> Vec<i64> {
        plan.steps.iter().map(|s| s.number).collect()
    }

    #[test]
    fn neighbours_within_reach_are_read_and_not_written() {
        let available: Vec<i64> = (1..=20).collect();
        let plan = Plan::new(&available, &[5, 6, 15], 2, &[]);
        assert_eq!(numbers(&plan), [3, 4, 5, 6, 7, 8, 13, 14, 15, 16, 17]);
        assert_eq!(plan.wanted(), 3);
        let fresh: Vec<i64> = plan.steps.iter().filter(|s| s.fresh).map(|s| s.number).collect();
        assert_eq!(fresh, [3, 13]);
    }

    #[test]
    fn nothing_is_read_beyond_a_gap_or_a_cut() {
        let available = [1, 2, 3, 4, 7, 8, 9];
        let plan = Plan::new(&available, &[3, 4, 8], 3, &[3]);
        assert_eq!(numbers(&plan), [3, 4, 7, 8, 9]);
        assert_eq!(plan.gaps, [(5, 6)]);
        assert!(plan.steps.iter().all(|s| s.fresh == (s.number == 3 || s.number == 7)));
        // The cut is seen from both sides.
        assert_eq!(numbers(&Plan::new(&available, &[2], 3, &[3])), [1, 2]);
    }

    #[test]
    fn what_a_frame_sees_does_not_depend_on_the_split() {
        let available: Vec<i64> = (-7..=30).filter(|n| *n != 11).collect();
        let cuts = [4, 20];
        let whole = Plan::new(&available, &available, 3, &cuts);
        let seen = |plan: &Plan, number: i64| {
            let at = plan.steps.iter().position(|s| s.number == number).unwrap();
            let mut window = vec![number];
            let near = |a: i64, b: i64| a.abs_diff(b) <= 3;
            for step in plan.steps[..at].iter().rev().zip(plan.steps[1..=at].iter().rev()) {
                if step.1.fresh || !near(step.0.number, number) {
                    break;
                }
                window.push(step.0.number);
            }
            for step in plan.steps[at + 1..].iter().take_while(|s| !s.fresh && near(s.number, number)) {
                window.push(step.number);
            }
            window.sort_unstable();
            window
        };
        for (first, last) in [(-7, 0), (1, 3), (4, 12), (13, 30), (5, 5)] {
            let wanted: Vec<i64> = available.iter().copied().filter(|n| (first..=last).contains(n)).collect();
            let part = Plan::new(&available, &wanted, 3, &cuts);
            for number in wanted {
                assert_eq!(seen(&part, number), seen(&whole, number), "frame {number}");
            }
        }
    }

    #[test]
    fn frames_without_a_file_are_told() {
        let plan = Plan::new(&[1, 2], &[0, 1, 2, 3], 1, &[]);
        assert_eq!(plan.missing, [0, 3]);
        assert_eq!(plan.gaps, []);
        assert_eq!(ranges(&[0, 1, 2, 5, 7, 8]), "0-2, 5, 7-8");
        let ends = Plan::new(&[i64::MIN, i64::MAX], &[i64::MIN, i64::MAX], 2, &[]);
        assert_eq!(ends.wanted(), 2);
    }
}
