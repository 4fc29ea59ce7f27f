//! Small values on the command line: sizes, settings, back ends, counts.

use quell::Size;
use std::str::FromStr;

/// `1280x720`.
pub fn size(text: &str) -> Result<Size, String> {
    let parts = text.split_once(['x', 'X', '×']);
    let parsed = parts.and_then(|(w, h)| Some(Size::new(w.trim().parse().ok()?, h.trim().parse().ok()?)));
    match parsed {
        None => Err(format!("`{text}` is no size; write WIDTHxHEIGHT, such as 1280x720")),
        Some(size) if size.width == 0 || size.height == 0 => {
            Err(format!("`{text}` has no pixels; both extents must be at least 1"))
        }
        Some(size) if size.width > quell_trace::SIZE_LIMIT || size.height > quell_trace::SIZE_LIMIT => {
            Err(format!("`{text}` is too large; both extents must be at most {}", quell_trace::SIZE_LIMIT))
        }
        Some(size) => Ok(size),
    }
}

/// A whole number of at least 1.
pub fn at_least_one<T: FromStr + PartialOrd + From<u8>>(text: &str) -> Result<T, String> {
    text.trim()
        .parse::<T>()
        .ok()
        .filter(|n| *n >= T::from(1))
        .ok_or_else(|| format!("`{text}` is no whole number of at least 1"))
}

/// A positive finite number.
pub fn positive(text: &str) -> Result<f32, String> {
    let number = text.trim().parse::<f32>().ok().filter(|n| n.is_finite() && *n > 0.0);
    number.ok_or_else(|| format!("`{text}` is no positive number"))
}

/// `stage.parameter=value`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// `stage.parameter`.
    pub name: String,
    /// What stands behind the sign of equality.
    pub value: String,
}

impl FromStr for Setting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((name, value)) if !name.trim().is_empty() && !value.trim().is_empty() => {
                Ok(Self { name: name.trim().to_owned(), value: value.trim().to_owned() })
            }
            _ => Err(format!("`{text}` sets nothing; write stage.parameter=value, such as matte_temporal.alpha=0.9")),
        }
    }
}

/// Which twins run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BackendChoice {
    /// A GPU where there is a real one, else the fast CPU back end.
    #[default]
    Auto,
    /// A GPU.
    Gpu,
    /// The fast CPU back end.
    Cpu,
    /// The scalar specification.
    Reference,
}

impl FromStr for BackendChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "cpu" => Ok(Self::Cpu),
            "reference" => Ok(Self::Reference),
            "gpu" => Ok(Self::Gpu),
            _ => Err(format!("unknown back end `{text}`; there are auto, cpu, gpu, reference")),
        }
    }
}

impl BackendChoice {
    /// As it is typed.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Gpu => "gpu",
            Self::Cpu => "cpu",
            Self::Reference => "reference",
        }
    }
}

/// What traces frames and references.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TracerChoice {
    /// The CPU.
    Cpu,
    /// The GPU that the back end runs on.
    Gpu,
}

/// What traces, by name.
pub fn tracer(text: &str) -> Result<TracerChoice, String> {
    match text {
        "cpu" => Ok(TracerChoice::Cpu),
        "gpu" => Ok(TracerChoice::Gpu),
        _ => Err(format!("unknown tracer `{text}`; there are cpu, gpu")),
    }
}

/// Estimators of the path tracer.
pub fn estimator(text: &str) -> Result<quell_trace::Estimator, String> {
    match text {
        "exact" => Ok(quell_trace::Estimator::Exact),
        "paper" => Ok(quell_trace::Estimator::Paper),
        _ => Err(format!("unknown estimator `{text}`; there are exact, paper")),
    }
}

/// Primary surface replacement.
pub fn primary_replacement(text: &str) -> Result<quell_trace::PrimaryReplacement, String> {
    match text {
        "off" => Ok(quell_trace::PrimaryReplacement::Off),
        "glass" => Ok(quell_trace::PrimaryReplacement::Glass),
        "mirrors" => Ok(quell_trace::PrimaryReplacement::GlassAndMirrors),
        _ => Err(format!("unknown replacement `{text}`; there are off, glass, mirrors")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(size("1280x720"), Ok(Size::new(1280, 720)));
        assert_eq!(size("1x1"), Ok(Size::new(1, 1)));
        for (text, why) in [
            ("0x5", "no pixels"),
            ("5x0", "no pixels"),
            ("5", "WIDTHxHEIGHT"),
            ("-5x5", "WIDTHxHEIGHT"),
            ("x", "WIDTHxHEIGHT"),
            ("99999999999999999999999x2", "WIDTHxHEIGHT"),
            ("40000x2", "too large"),
        ] {
            assert!(size(text).unwrap_err().contains(why), "{text}");
        }
    }

    #[test]
    fn settings_and_back_ends() {
        let setting: Setting = "a.b = 1=2".parse().unwrap();
        assert_eq!((setting.name.as_str(), setting.value.as_str()), ("a.b", "1=2"));
        for text in ["", "=", "a.b", "a.b=", "=1"] {
            assert!(text.parse::<Setting>().is_err(), "{text}");
        }
        assert!("cuda".parse::<BackendChoice>().unwrap_err().contains("auto, cpu, gpu, reference"));
        for choice in [BackendChoice::Auto, BackendChoice::Gpu, BackendChoice::Cpu, BackendChoice::Reference] {
            assert_eq!(choice.name().parse(), Ok(choice));
        }
        assert_eq!((tracer("cpu"), tracer("gpu")), (Ok(TracerChoice::Cpu), Ok(TracerChoice::Gpu)));
        assert!(tracer("auto").unwrap_err().contains("cpu, gpu"));
        assert!(positive("0").is_err() && positive("inf").is_err() && positive("nan").is_err());
        assert!(at_least_one::<u32>("0").is_err() && at_least_one::<u32>("-1").is_err());
    }
}
