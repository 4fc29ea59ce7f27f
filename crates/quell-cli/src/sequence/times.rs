//! Stage times over frames.

use quell::pipeline::Stage;
use quell::report::StageTimes;
use quell_lab::report::{Spread, StageTime};

/// Collects the times of each frame.
#[derive(Default)]
pub struct StageClock {
    /// Milliseconds of each frame, by stage in the order of [`Stage::ALL`]; the border last.
    milliseconds: [Vec<f64>; Stage::ALL.len() + 1],
}

impl StageClock {
    /// One more frame.
    pub fn add(&mut self, times: &StageTimes) {
        for (stage, time) in times.iter() {
            self.milliseconds[stage as usize].push(time.as_secs_f64() * 1e3);
        }
        self.milliseconds[Stage::ALL.len()].push(times.border.as_secs_f64() * 1e3);
    }

    /// Spread over frames of every stage that ran, in order; reading and cleaning the planes first.
    pub fn stages(&self) -> Vec<StageTime> {
        let border = ("border", None, &self.milliseconds[Stage::ALL.len()]);
        let stages = Stage::ALL.map(|stage| (stage.name(), paper_number(stage), &self.milliseconds[stage as usize]));
        let row = |(name, paper_stage, milliseconds): (&str, _, &Vec<f64>)| {
            Spread::of(milliseconds.iter().copied()).map(|milliseconds| StageTime {
                name: name.to_owned(),
                paper_stage,
                milliseconds,
                bytes_per_pixel: None,
                floor_ms: None,
            })
        };
        std::iter::once(border).chain(stages).filter_map(row).collect()
    }
}

/// The stage's number in the paper's talk.
pub fn paper_number(stage: Stage) -> Option<u32> {
    stage.paper_stage().split(' ').next().and_then(|number| number.parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_3_to_11_have_their_numbers() {
        let numbers: Vec<u32> = Stage::ALL.into_iter().filter_map(paper_number).collect();
        assert_eq!(numbers, (3..=11).collect::<Vec<_>>());
    }
}
