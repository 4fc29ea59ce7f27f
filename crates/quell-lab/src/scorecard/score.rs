//! What the scorecard says: ten scores, each a number or the reason why there is none.

use serde::{Deserialize, Serialize};

/// One figure of the scorecard; 0 is best.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// The figure; `None`: it cannot be measured here, see `reason`.
    pub value: Option<f64>,
    /// Why there is no value, or what limits it.
    pub reason: Option<String>,
    /// What the noise of the reference alone explains; only where there is one reference without halves.
    pub floor: Option<f64>,
}

impl Score {
    /// A figure.
    pub fn of(value: f64) -> Self {
        if value.is_finite() {
            Self { value: Some(value), ..Self::default() }
        } else {
            Self::null("the pictures hold values that are not finite")
        }
    }

    /// No figure, and why.
    pub fn null(reason: impl Into<String>) -> Self {
        Self { reason: Some(reason.into()), ..Self::default() }
    }
}

/// The scorecard of one sequence (docs/scorecard.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// Share of fine detail lost.
    pub blur: Score,
    /// Light carried across an edge, as a share of what a plain blur would carry.
    pub smearing: Score,
    /// Share of stale light, shadow or reflection that stays; may exceed 1.
    pub ghosting: Score,
    /// Grain in a still frame, in stops (rms).
    pub noise: Score,
    /// Grain that changes, in stops (rms).
    pub flicker: Score,
    /// Blotches that change from frame to frame, in stops (rms).
    pub boiling: Score,
    /// Blotches that change within four frames, in stops (rms).
    pub slow_boiling: Score,
    /// Error where a surface has come into view at most four frames ago, in stops (rms).
    pub fresh_noise: Score,
    /// Share of the local contrast of indirect light that is lost: contact shadows.
    pub flatness: Score,
    /// Frames until indirect light has followed a change of the lamps, where it is slowest.
    pub lag: Score,
}

impl Scores {
    /// The fields' names, in their order.
    pub const NAMES: [&'static str; 10] = [
        "blur",
        "smearing",
        "ghosting",
        "noise",
        "flicker",
        "boiling",
        "slow_boiling",
        "fresh_noise",
        "flatness",
        "lag",
    ];

    /// The same reason everywhere.
    pub fn all_null(reason: &str) -> Self {
        let null = || Score::null(reason);
        Self {
            blur: null(),
            smearing: null(),
            ghosting: null(),
            noise: null(),
            flicker: null(),
            boiling: null(),
            slow_boiling: null(),
            fresh_noise: null(),
            flatness: null(),
            lag: null(),
        }
    }

    /// Every score with its name.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &Score)> {
        let scores = [
            &self.blur,
            &self.smearing,
            &self.ghosting,
            &self.noise,
            &self.flicker,
            &self.boiling,
            &self.slow_boiling,
            &self.fresh_noise,
            &self.flatness,
            &self.lag,
        ];
        Self::NAMES.into_iter().zip(scores)
    }

    /// The score of this name.
    pub fn get(&self, name: &str) -> Option<&Score> {
        self.iter().find(|(own, _)| *own == name).map(|(_, score)| score)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_fields_and_values_survive_json() {
        let mut scores = Scores::all_null("why");
        scores.noise = Score { floor: Some(0.01), ..Score::of(0.25) };
        let json = serde_json::to_value(&scores).unwrap();
        let mut names: Vec<&str> = json.as_object().unwrap().keys().map(String::as_str).collect();
        let mut expected = Scores::NAMES;
        names.sort_unstable();
        expected.sort_unstable();
        assert_eq!(names, expected);
        for (name, score) in scores.iter() {
            assert_eq!(json[name], serde_json::to_value(score).unwrap(), "{name}");
        }
        assert_eq!(scores.get("noise").unwrap().value, Some(0.25));
        assert_eq!(serde_json::from_value::<Scores>(json).unwrap(), scores);
        assert_eq!(Score::of(f64::NAN).value, None);
    }
}
