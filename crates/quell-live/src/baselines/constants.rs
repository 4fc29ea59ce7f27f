//! The constants of both baselines that a user may change: one table for controls, ranges and tests.

/// Constants of the a-trous wavelet; those of `quell_lab::methods::atrous`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtrousConstants {
    /// Levels, 1 to [`MOST_LEVELS`]; level i has taps 2^i pixels apart.
    pub levels: u32,
    /// sigma_rt of the first level, in mean luminances of the signal over the frame's surfaces; halves every level.
    pub colour: f32,
    /// sigma_n.
    pub normal: f32,
    /// sigma_x, as a part of the view depth.
    pub position: f32,
}

/// Constants of SVGF; those of `quell_lab::methods::svgf`. sigma_n is 128 always.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SvgfConstants {
    /// Least weight of the newest frame's colour.
    pub colour_alpha: f32,
    /// Least weight of the newest frame's moments.
    pub moments_alpha: f32,
    /// Levels of the wavelet, 1 to [`MOST_LEVELS`].
    pub levels: u32,
    /// The level whose output is the next frame's history, from 0.
    pub feedback: u32,
    /// Differences of depth, in sizes of what the slope explains.
    pub sigma_z: f32,
    /// Differences of luminance, in standard deviations.
    pub sigma_l: f32,
}

/// Constants of both.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BaselineConstants {
    /// Of the a-trous wavelet.
    pub atrous: AtrousConstants,
    /// Of SVGF.
    pub svgf: SvgfConstants,
}

/// Levels of either wavelet, at most: taps 128 pixels apart.
pub const MOST_LEVELS: u32 = 8;

impl Default for AtrousConstants {
    /// Fitted: docs/baselines.md.
    fn default() -> Self {
        Self { levels: 5, colour: 50.0, normal: 0.28, position: 0.07 }
    }
}

impl SvgfConstants {
    /// Section 4 of the paper.
    pub const PAPER: Self =
        Self { colour_alpha: 0.2, moments_alpha: 0.2, levels: 5, feedback: 0, sigma_z: 1.0, sigma_l: 4.0 };
    /// The defaults of the code that the authors published later.
    pub const LATER: Self =
        Self { colour_alpha: 0.05, moments_alpha: 0.2, levels: 4, feedback: 1, sigma_z: 1.0, sigma_l: 10.0 };
    /// Names of both, as `quell compare` has them.
    pub const PRESETS: [(&str, Self); 2] = [("svgf", Self::PAPER), ("svgf:later", Self::LATER)];
}

impl Default for SvgfConstants {
    fn default() -> Self {
        Self::PAPER
    }
}

/// What a user should know of a constant.
#[derive(Clone, Copy, Debug)]
pub struct BaselineConstant {
    /// `atrous.` or `svgf.`, then its name.
    pub name: &'static str,
    /// Least and greatest value.
    pub range: [f32; 2],
    /// Whole numbers only.
    pub is_whole: bool,
    /// What it is, with its unit.
    pub doc: &'static str,
    /// Where its value comes from.
    pub source: &'static str,
    get: fn(&BaselineConstants) -> f32,
    set: fn(&mut BaselineConstants, f32),
}

impl BaselineConstant {
    /// Its value.
    pub fn get(&self, constants: &BaselineConstants) -> f32 {
        (self.get)(constants)
    }

    /// Gives it another value, within its range; one that is no number changes nothing.
    pub fn set(&self, constants: &mut BaselineConstants, value: f32) {
        if !value.is_nan() {
            let value = value.clamp(self.range[0], self.range[1]);
            (self.set)(constants, if self.is_whole { value.round() } else { value });
        }
    }
}

const LEVELS: [f32; 2] = [1.0, MOST_LEVELS as f32];
const DAMMERTZ: &str = "Dammertz et al. 2010 leave it to the scene; fitted (docs/baselines.md).";
const SCHIED: &str = "Schied et al. 2017, section 4.";

/// All of them, in the order in which they are shown.
pub const BASELINE_CONSTANTS: &[BaselineConstant] = &[
    BaselineConstant {
        name: "atrous.levels",
        range: LEVELS,
        is_whole: true,
        doc: "Levels of the wavelet; level i has taps 2^i pixels apart.",
        source: "Five, as in SVGF's paper (docs/baselines.md).",
        get: |c| c.atrous.levels as f32,
        set: |c, v| c.atrous.levels = v as u32,
    },
    BaselineConstant {
        name: "atrous.colour",
        range: [0.1, 1000.0],
        is_whole: false,
        doc: "sigma_rt of the first level, in mean luminances of the signal; halves every level.",
        source: DAMMERTZ,
        get: |c| c.atrous.colour,
        set: |c, v| c.atrous.colour = v,
    },
    BaselineConstant {
        name: "atrous.normal",
        range: [0.01, 2.0],
        is_whole: false,
        doc: "sigma_n, of the distance between unit normals, divided by the step.",
        source: DAMMERTZ,
        get: |c| c.atrous.normal,
        set: |c, v| c.atrous.normal = v,
    },
    BaselineConstant {
        name: "atrous.position",
        range: [0.001, 1.0],
        is_whole: false,
        doc: "sigma_x, of the distance between world positions, as a part of the view depth.",
        source: DAMMERTZ,
        get: |c| c.atrous.position,
        set: |c, v| c.atrous.position = v,
    },
    BaselineConstant {
        name: "svgf.colour_alpha",
        range: [0.01, 1.0],
        is_whole: false,
        doc: "Least weight of the newest frame's colour.",
        source: SCHIED,
        get: |c| c.svgf.colour_alpha,
        set: |c, v| c.svgf.colour_alpha = v,
    },
    BaselineConstant {
        name: "svgf.moments_alpha",
        range: [0.01, 1.0],
        is_whole: false,
        doc: "Least weight of the newest frame's moments of luminance, from which variances come.",
        source: SCHIED,
        get: |c| c.svgf.moments_alpha,
        set: |c, v| c.svgf.moments_alpha = v,
    },
    BaselineConstant {
        name: "svgf.levels",
        range: LEVELS,
        is_whole: true,
        doc: "Levels of the wavelet; level i has taps 2^i pixels apart.",
        source: SCHIED,
        get: |c| c.svgf.levels as f32,
        set: |c, v| c.svgf.levels = v as u32,
    },
    BaselineConstant {
        name: "svgf.feedback",
        range: [0.0, LEVELS[1] - 1.0],
        is_whole: true,
        doc: "The level whose output is the next frame's history, from 0; the last one at most.",
        source: SCHIED,
        get: |c| c.svgf.feedback as f32,
        set: |c, v| c.svgf.feedback = v as u32,
    },
    BaselineConstant {
        name: "svgf.sigma_z",
        range: [0.05, 20.0],
        is_whole: false,
        doc: "Differences of depth, in sizes of what the slope explains.",
        source: SCHIED,
        get: |c| c.svgf.sigma_z,
        set: |c, v| c.svgf.sigma_z = v,
    },
    BaselineConstant {
        name: "svgf.sigma_l",
        range: [0.1, 100.0],
        is_whole: false,
        doc: "Differences of luminance, in standard deviations of its noise.",
        source: SCHIED,
        get: |c| c.svgf.sigma_l,
        set: |c, v| c.svgf.sigma_l = v,
    },
];

impl BaselineConstants {
    /// The same within their ranges; what is no number becomes the default.
    #[must_use]
    pub fn held(&self) -> Self {
        let mut held = Self::default();
        for constant in BASELINE_CONSTANTS {
            constant.set(&mut held, constant.get(self));
        }
        held.svgf.feedback = held.svgf.feedback.min(held.svgf.levels - 1);
        held
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_constant_is_set_alone_and_within_its_range() {
        let usual = BaselineConstants::default();
        for (number, constant) in BASELINE_CONSTANTS.iter().enumerate() {
            let [least, most] = constant.range;
            for (given, wanted) in [(least, least), (most, most), (-1e9, least), (f32::INFINITY, most)] {
                let mut constants = usual;
                constant.set(&mut constants, given);
                assert_eq!(constant.get(&constants), wanted, "{}", constant.name);
                for (other, others) in BASELINE_CONSTANTS.iter().enumerate().filter(|(other, _)| *other != number) {
                    assert_eq!(others.get(&constants), others.get(&usual), "{} changed {other}", constant.name);
                }
            }
            let mut constants = usual;
            constant.set(&mut constants, f32::NAN);
            assert_eq!(constants, usual);
        }
    }

    #[test]
    fn what_is_out_of_range_is_held() {
        let svgf = SvgfConstants { levels: 0, feedback: 7, sigma_l: f32::NAN, ..SvgfConstants::LATER };
        let atrous = AtrousConstants { levels: 99, normal: 0.0, ..AtrousConstants::default() };
        let held = BaselineConstants { atrous, svgf }.held();
        assert_eq!((held.svgf.levels, held.svgf.feedback, held.svgf.sigma_l), (1, 0, 4.0));
        assert_eq!((held.atrous.levels, held.atrous.normal), (MOST_LEVELS, 0.01));
        for (_, svgf) in SvgfConstants::PRESETS {
            let constants = BaselineConstants { svgf, ..BaselineConstants::default() };
            assert_eq!(constants.held(), constants);
        }
    }
}
