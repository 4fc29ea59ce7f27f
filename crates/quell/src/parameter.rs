//! How parameters are declared: each once, in a table with name, unit, range, default, meaning and source. The tables
//! themselves are `settings.rs` (frame by frame) and `sequence/settings.rs` (whole sequences).

use crate::error::Error;
use std::ops::RangeInclusive;

/// What values a parameter takes: for sliders and switches that are made from a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// A number from the first to the second.
    Number(f32, f32),
    /// A whole number from the first to the second.
    Whole(u32, u32),
    /// On or off.
    Switch,
    /// One of these names.
    Choice(&'static [&'static str]),
}

/// A type that a parameter can have.
pub(crate) trait Value: Sized {
    type Range;
    fn kind(range: &Self::Range) -> Kind;
    fn parse(text: &str, range: &Self::Range) -> Option<Self>;
    fn format(&self) -> String;
    fn describe(range: &Self::Range) -> String;
    /// Values worth trying in a test that moves each parameter: inside the range.
    fn samples(range: &Self::Range) -> Vec<String>;
}

impl Value for f32 {
    type Range = RangeInclusive<f32>;
    fn kind(range: &Self::Range) -> Kind {
        Kind::Number(*range.start(), *range.end())
    }
    fn parse(text: &str, range: &Self::Range) -> Option<Self> {
        text.trim().parse().ok().filter(|v: &f32| v.is_finite() && range.contains(v))
    }
    fn format(&self) -> String {
        self.to_string()
    }
    fn describe(range: &Self::Range) -> String {
        format!("a number from {} to {}", range.start(), range.end())
    }
    fn samples(range: &Self::Range) -> Vec<String> {
        let (a, b) = (*range.start(), *range.end());
        // Geometric and arithmetic middles as well as the ends: which of them acts depends on the parameter.
        [a, a + (b - a) * 0.01, a + (b - a) * 0.1, a + (b - a) * 0.5, b].iter().map(f32::to_string).collect()
    }
}

impl Value for u32 {
    type Range = RangeInclusive<u32>;
    fn kind(range: &Self::Range) -> Kind {
        Kind::Whole(*range.start(), *range.end())
    }
    fn parse(text: &str, range: &Self::Range) -> Option<Self> {
        text.trim().parse().ok().filter(|v| range.contains(v))
    }
    fn format(&self) -> String {
        self.to_string()
    }
    fn describe(range: &Self::Range) -> String {
        format!("a whole number from {} to {}", range.start(), range.end())
    }
    fn samples(range: &Self::Range) -> Vec<String> {
        let (a, b) = (*range.start(), *range.end());
        [a, a + 1, a + (b - a) / 2, b].iter().map(u32::to_string).collect()
    }
}

impl Value for bool {
    type Range = ();
    fn kind((): &()) -> Kind {
        Kind::Switch
    }
    fn parse(text: &str, (): &()) -> Option<Self> {
        match text.trim() {
            "on" | "true" | "1" | "yes" => Some(true),
            "off" | "false" | "0" | "no" => Some(false),
            _ => None,
        }
    }
    fn format(&self) -> String {
        if *self { "on" } else { "off" }.to_owned()
    }
    fn describe((): &()) -> String {
        "on or off".to_owned()
    }
    fn samples((): &()) -> Vec<String> {
        vec!["on".to_owned(), "off".to_owned()]
    }
}

/// The preset of this name, of one filter's presets.
pub(crate) fn preset_named<P: Copy, const N: usize>(
    all: [P; N],
    name: fn(P) -> &'static str,
    wanted: &str,
) -> Result<P, Error> {
    let found = all.into_iter().find(|preset| name(*preset) == wanted);
    found.ok_or_else(|| Error::UnknownPreset { name: wanted.to_owned(), known: all.map(name).join(", ") })
}

macro_rules! choices {
    ($( $(#[$meta:meta])* $name:ident { $( $(#[$vmeta:meta])* $variant:ident = $text:literal ),+ $(,)? } )+) => { $(
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $( $(#[$vmeta])* $variant ),+ }

        impl $crate::parameter::Value for $name {
            type Range = ();
            fn kind((): &()) -> $crate::parameter::Kind {
                $crate::parameter::Kind::Choice(&[$($text),+])
            }
            fn parse(text: &str, (): &()) -> Option<Self> {
                match text.trim() { $( $text => Some(Self::$variant), )+ _ => None }
            }
            fn format(&self) -> String {
                match self { $( Self::$variant => $text.to_owned() ),+ }
            }
            fn describe((): &()) -> String {
                format!("one of {}", [$($text),+].join(", "))
            }
            fn samples((): &()) -> Vec<String> {
                vec![$($text.to_owned()),+]
            }
        }
    )+ };
}

/// What the table says of one parameter.
pub struct Parameter<S: 'static = crate::settings::Settings> {
    /// `stage.parameter`, as `--set` takes it.
    pub name: &'static str,
    /// The group: a stage or a kernel that several stages share.
    pub group: &'static str,
    /// Unit, empty for plain numbers.
    pub unit: &'static str,
    /// What it is.
    pub doc: &'static str,
    /// What a higher value (or `on`) does.
    pub higher: &'static str,
    /// What a lower value (or `off`) does.
    pub lower: &'static str,
    /// Mark and source.
    pub source: &'static str,
    pub(crate) kind: fn() -> Kind,
    pub(crate) describe: fn() -> String,
    pub(crate) samples: fn() -> Vec<String>,
    pub(crate) get: fn(&S) -> String,
    pub(crate) set: fn(&mut S, &str) -> bool,
}

impl<S> Parameter<S> {
    /// Kind and range in words.
    pub fn range(&self) -> String {
        (self.describe)()
    }

    /// Kind and range.
    pub fn kind(&self) -> Kind {
        (self.kind)()
    }

    /// Some values inside the range, the ends among them.
    pub fn samples(&self) -> Vec<String> {
        (self.samples)()
    }
}

impl<S> std::fmt::Debug for Parameter<S> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Parameter").field("name", &self.name).field("range", &self.range()).finish_non_exhaustive()
    }
}

macro_rules! parameters {
    (
        $(#[$smeta:meta])* $Settings:ident
        $(#[$tmeta:meta])* $TABLE:ident
    $(
        $(#[$gmeta:meta])*
        $group:ident: $Group:ident {
            $( $field:ident: $T:ty = $default:expr, $range:expr, $unit:literal, $doc:literal,
               higher $higher:literal, lower $lower:literal, source $source:literal; )+
        }
    )+) => {
        $(
            $(#[$gmeta])*
            #[derive(Clone, Debug, PartialEq)]
            pub struct $Group { $( #[doc = $doc] pub $field: $T, )+ }

            impl Default for $Group {
                fn default() -> Self { Self { $( $field: $default, )+ } }
            }
        )+

        $(#[$smeta])*
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct $Settings { $( $(#[$gmeta])* pub $group: $Group, )+ }

        impl $Settings {
            /// Sets `stage.parameter` from text.
            ///
            /// # Errors
            /// [`Error::UnknownParameter`](crate::Error::UnknownParameter) with the nearest names,
            /// [`Error::ParameterValue`](crate::Error::ParameterValue) with the range.
            pub fn set(&mut self, name: &str, value: &str) -> Result<(), $crate::Error> {
                $crate::parameter::set($TABLE, self, name, value)
            }

            /// The value of `stage.parameter` as text that `set` takes.
            ///
            /// # Errors
            /// [`Error::UnknownParameter`](crate::Error::UnknownParameter) with the nearest names.
            pub fn get(&self, name: &str) -> Result<String, $crate::Error> {
                Ok(($crate::parameter::find($TABLE, name)?.get)(self))
            }

            /// Checks that every value lies in its range (fields can be set without `set`).
            ///
            /// # Errors
            /// [`Error::ParameterValue`](crate::Error::ParameterValue) for the first that does not.
            pub fn check(&self) -> Result<(), $crate::Error> {
                let mut copy = self.clone();
                $TABLE.iter().try_for_each(|p| copy.set(p.name, &(p.get)(self)))
            }
        }

        $(#[$tmeta])*
        pub static $TABLE: &[$crate::parameter::Parameter<$Settings>] = &[ $( $( $crate::parameter::Parameter {
            name: concat!(stringify!($group), ".", stringify!($field)),
            group: stringify!($group),
            unit: $unit,
            doc: $doc,
            higher: $higher,
            lower: $lower,
            source: $source,
            kind: || <$T as $crate::parameter::Value>::kind(&$range),
            describe: || <$T as $crate::parameter::Value>::describe(&$range),
            samples: || <$T as $crate::parameter::Value>::samples(&$range),
            get: |s| $crate::parameter::Value::format(&s.$group.$field),
            set: |s, text| match <$T as $crate::parameter::Value>::parse(text, &$range) {
                Some(value) => { s.$group.$field = value; true }
                None => false,
            },
        }, )+ )+ ];
    };
}

pub(crate) use {choices, parameters};

/// The parameter of that name.
pub(crate) fn find<S>(table: &'static [Parameter<S>], name: &str) -> Result<&'static Parameter<S>, Error> {
    table.iter().find(|p| p.name == name).ok_or_else(|| Error::UnknownParameter {
        name: name.to_owned(),
        nearest: nearest(name, table.iter().map(|p| p.name)),
    })
}

/// Sets one parameter from text.
pub(crate) fn set<S>(table: &'static [Parameter<S>], settings: &mut S, name: &str, value: &str) -> Result<(), Error> {
    let parameter = find(table, name)?;
    if (parameter.set)(settings, value) {
        Ok(())
    } else {
        Err(Error::ParameterValue { name: name.to_owned(), value: value.to_owned(), expected: parameter.range() })
    }
}

/// Up to three candidates whose edit distance to `name` is small, nearest first; a candidate whose last part equals
/// `name`'s last part counts as near.
pub fn nearest<'a>(name: &str, candidates: impl Iterator<Item = &'a str>) -> Vec<String> {
    fn last(text: &str) -> &str {
        text.rsplit('.').next().unwrap_or(text)
    }
    let mut scored: Vec<(usize, &str)> = candidates
        .map(|c| if last(c) == last(name) { (1, c) } else { (edit_distance(name, c), c) })
        .filter(|(d, c)| *d <= 2.max(c.len() / 3))
        .collect();
    scored.sort();
    scored.into_iter().take(3).map(|(_, c)| c.to_owned()).collect()
}

/// Levenshtein's distance.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}
