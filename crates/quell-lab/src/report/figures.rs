//! Everything that is said of a method, as named figures: one table for terminal, CSV, LaTeX and page.

use super::json::Spread;
use super::table::{Table, significant};
use crate::compare::statistics::Interval;
use crate::metrics::FrameScores;
use crate::report::json::NumberedScores;
use crate::scorecard::Scores;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One method of a comparison.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComparedMethod {
    /// `none`, `quell:paper` and so on.
    pub method: String,
    /// Why it did not run, or could not be measured.
    pub reason: Option<String>,
    /// Picture metrics: means over the scored frames, and over seeds.
    pub mean: Option<FrameScores>,
    /// Picture metrics of each scored frame, of the first seed.
    pub frames: Vec<NumberedScores>,
    /// The scorecard; over seeds, the mean of those that have a value.
    pub scorecard: Option<Scores>,
    /// A frame's time in the steady state.
    pub milliseconds: Option<Spread>,
    /// Median time over that of `quell:paper` in the same comparison.
    pub time_ratio: Option<f64>,
    /// The most memory at once, without its input, bytes.
    pub peak_bytes: Option<u64>,
    /// The back end that it ran on, where that is not the CPU.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub backend: Option<String>,
    /// Its pictures and times come from an earlier run of the same command.
    pub resumed: bool,
    /// With several seeds: mean and 95 % interval of each figure, by its name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub intervals: BTreeMap<String, Interval>,
}

/// Which way is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Better {
    /// Less is better.
    Lower,
    /// More is better.
    Higher,
    /// 1 is right.
    One,
}

/// A figure's name and how it is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// As in JSON and CSV.
    pub name: &'static str,
    /// Head of its column.
    pub label: &'static str,
    /// What it is, in a sentence.
    pub meaning: &'static str,
    /// Which way is better.
    pub better: Better,
    shown: Shown,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shown {
    Significant,
    Digits(usize),
    Mebibytes,
}

macro_rules! figure {
    ($name:literal, $label:literal, $better:ident, $shown:expr, $meaning:literal) => {
        Figure { name: $name, label: $label, meaning: $meaning, better: Better::$better, shown: $shown }
    };
}

use Shown::{Digits, Mebibytes, Significant};

/// Picture metrics, in the order of their columns. Those that a version does not measure are left out.
pub const PICTURE: &[Figure] = &[
    figure!(
        "rel_mse_trimmed",
        "relMSE",
        Lower,
        Significant,
        "relative mean squared error without the worst 0.1 % of pixels"
    ),
    figure!("rel_mse", "untrimmed", Lower, Significant, "relative mean squared error with every pixel"),
    figure!("psnr", "PSNR dB", Higher, Digits(2), "peak signal-to-noise ratio after the tone curve"),
    figure!("ssim", "SSIM", Higher, Digits(4), "structural similarity after the tone curve"),
    figure!("ldr_flip", "FLIP", Lower, Digits(4), "what a viewer sees when flipping to the reference, at one exposure"),
    figure!(
        "hdr_flip",
        "HDR-FLIP",
        Lower,
        Digits(4),
        "what a viewer sees when flipping to the reference, the worst over all exposures"
    ),
    figure!("energy", "energy", One, Digits(4), "light of the picture over light of the reference"),
    figure!("fireflies", "fireflies", Lower, Digits(1), "pixels a frame that are far too bright"),
];

/// The scorecard.
pub const SCORECARD: &[Figure] = &[
    figure!("blur", "blur", Lower, Digits(3), "share of fine detail lost"),
    figure!(
        "smearing",
        "smearing",
        Lower,
        Digits(3),
        "light carried across edges, as a share of what a plain blur would carry"
    ),
    figure!("ghosting", "ghosting", Lower, Digits(3), "share of stale light, shadow or reflection that stays"),
    figure!("noise", "noise", Lower, Digits(4), "grain in a still frame, in stops"),
    figure!("flicker", "flicker", Lower, Digits(4), "grain that changes, in stops"),
    figure!("boiling", "boiling", Lower, Digits(4), "blotches that change from frame to frame, in stops"),
    figure!("slow_boiling", "slow boiling", Lower, Digits(4), "blotches that change within four frames, in stops"),
    figure!("fresh_noise", "fresh noise", Lower, Digits(4), "error where a surface has just come into view, in stops"),
    figure!("flatness", "flatness", Lower, Digits(3), "share of the local contrast of indirect light that is lost"),
    figure!("lag", "lag", Lower, Digits(1), "frames until indirect light has followed a change of the lamps"),
];

/// What it costs.
pub const COST: &[Figure] = &[
    figure!("milliseconds", "ms a frame", Lower, Significant, "median time of a steady frame"),
    figure!("time_ratio", "of paper's", Lower, Digits(2), "that time over the one of quell:paper in the same run"),
    figure!("peak_bytes", "MiB", Lower, Mebibytes, "the most memory that the method holds at once"),
];

impl Figure {
    /// Every figure.
    pub fn all() -> impl Iterator<Item = &'static Self> {
        PICTURE.iter().chain(SCORECARD).chain(COST)
    }

    /// As text, without its unit.
    pub fn text(&self, value: f64) -> String {
        match self.shown {
            _ if !value.is_finite() => value.to_string(),
            Shown::Significant => significant(value),
            Shown::Digits(digits) => format!("{value:.digits$}"),
            Shown::Mebibytes => format!("{:.1}", value / 1_048_576.0),
        }
    }
}

impl ComparedMethod {
    /// The value of a figure, of the mean over seeds where there are several.
    pub fn value(&self, name: &str) -> Option<f64> {
        if let Some(interval) = self.intervals.get(name) {
            return Some(interval.mean);
        }
        self.own_value(name)
    }

    /// The value without intervals.
    pub fn own_value(&self, name: &str) -> Option<f64> {
        match name {
            "milliseconds" => self.milliseconds.map(|s| s.median),
            "time_ratio" => self.time_ratio,
            "peak_bytes" => self.peak_bytes.map(|b| b as f64),
            _ => {
                if let Some(score) = self.scorecard.as_ref().and_then(|s| s.get(name)) {
                    return score.value;
                }
                // By the names in JSON, so that metrics that come later need no line here. PSNR of equal pictures is
                // null there.
                let mean = serde_json::to_value(self.mean?).ok()?;
                let value = mean.get(name)?;
                if value.is_null() { Some(f64::INFINITY) } else { value.as_f64() }
            }
        }
    }

    /// Why a figure has no value.
    pub fn why_not(&self, name: &str) -> Option<&str> {
        let own = self.scorecard.as_ref().and_then(|s| s.get(name)).and_then(|s| s.reason.as_deref());
        own.or(self.reason.as_deref())
    }

    /// The back end that its time belongs to; `None`: it has none.
    fn ran_on(&self) -> Option<&str> {
        self.milliseconds.map(|_| self.backend.as_deref().unwrap_or("cpu"))
    }

    pub(crate) fn cell(&self, figure: &Figure) -> String {
        let Some(value) = self.value(figure.name) else { return "-".to_owned() };
        match self.intervals.get(figure.name).and_then(|i| i.half_width) {
            Some(half) => format!("{} ±{}", figure.text(value), figure.text(half)),
            None => figure.text(value),
        }
    }
}

/// Those figures that any method has.
pub fn present<'f>(methods: &[ComparedMethod], figures: &'f [Figure]) -> Vec<&'f Figure> {
    figures.iter().filter(|f| methods.iter().any(|m| m.value(f.name).is_some())).collect()
}

/// One row a method; methods without any of the figures have dashes.
pub fn table(methods: &[ComparedMethod], figures: &[&Figure]) -> Table {
    let mut head: Vec<String> =
        std::iter::once("method".to_owned()).chain(figures.iter().map(|f| f.label.to_owned())).collect();
    let row = |m: &ComparedMethod| {
        std::iter::once(m.method.clone()).chain(figures.iter().map(|f| m.cell(f))).collect::<Vec<_>>()
    };
    let mut rows: Vec<Vec<String>> = methods.iter().map(row).collect();
    // Times of different devices stand in one column: it is said whose they are.
    let has_times = figures.iter().any(|f| f.name == "milliseconds");
    if has_times && any_elsewhere(methods) {
        head.push("on".to_owned());
        rows.iter_mut().zip(methods).for_each(|(row, m)| row.push(m.ran_on().unwrap_or("-").to_owned()));
    }
    Table { head, rows }
}

fn any_elsewhere(methods: &[ComparedMethod]) -> bool {
    methods.iter().any(|m| m.backend.is_some())
}

/// The tables of the terminal: pictures and cost, the scorecard, and why anything is missing.
pub fn text(methods: &[ComparedMethod]) -> String {
    let mut first = present(methods, PICTURE);
    first.extend(present(methods, COST));
    let mut text = format!("{}\n", table(methods, &first));
    let card = present(methods, SCORECARD);
    if !card.is_empty() {
        text.push_str(&format!("{}\n", table(methods, &card)));
    }
    for (what, names) in missing(methods) {
        text.push_str(&format!("- {names}: {what}\n"));
    }
    text
}

/// Every reason why figures are missing, with the figures and methods that miss for it.
pub fn missing(methods: &[ComparedMethod]) -> Vec<(String, String)> {
    let mut reasons: Vec<(String, Vec<String>)> = Vec::new();
    let mut add = |reason: &str, name: String| match reasons.iter_mut().find(|(r, _)| r == reason) {
        Some((_, names)) => names.push(name),
        None => reasons.push((reason.to_owned(), vec![name])),
    };
    for method in methods {
        if let Some(reason) = &method.reason {
            add(reason, method.method.clone());
        }
    }
    let measured: Vec<&ComparedMethod> = methods.iter().filter(|m| m.scorecard.is_some()).collect();
    for figure in SCORECARD {
        let without = |m: &&&ComparedMethod| m.value(figure.name).is_none();
        let lacking: Vec<&&ComparedMethod> = measured.iter().filter(without).collect();
        for method in &lacking {
            let Some(reason) = method.why_not(figure.name) else { continue };
            let same = lacking.iter().filter(|m| m.why_not(figure.name) == Some(reason)).count();
            if same < measured.len() {
                add(reason, format!("{} of {}", figure.label, method.method));
            } else if lacking.first().is_some_and(|m| m.method == method.method) {
                add(reason, figure.label.to_owned());
            }
        }
    }
    reasons.into_iter().map(|(reason, names)| (reason, names.join(", "))).collect()
}

/// Comma-separated values: one row a method, every figure by its name, empty where there is none; with several seeds
/// also half the 95 % interval as `NAME_ci95`.
pub fn csv(methods: &[ComparedMethod]) -> String {
    let quoted = |text: &str| {
        if text.contains([',', '"', '\n', '\r']) {
            format!("\"{}\"", text.replace('"', "\"\""))
        } else {
            text.to_owned()
        }
    };
    let seeds = methods.iter().any(|m| !m.intervals.is_empty());
    let mut head = vec!["method".to_owned()];
    for figure in Figure::all() {
        head.push(figure.name.to_owned());
        if seeds {
            head.push(format!("{}_ci95", figure.name));
        }
    }
    let elsewhere = any_elsewhere(methods);
    if elsewhere {
        head.push("backend".to_owned());
    }
    head.push("reason".to_owned());
    let mut text = head.join(",") + "\n";
    for method in methods {
        let mut cells = vec![quoted(&method.method)];
        for figure in Figure::all() {
            cells.push(method.value(figure.name).map_or(String::new(), |v| v.to_string()));
            if seeds {
                let half = method.intervals.get(figure.name).and_then(|i| i.half_width);
                cells.push(half.map_or(String::new(), |v| v.to_string()));
            }
        }
        if elsewhere {
            cells.push(method.ran_on().unwrap_or("").to_owned());
        }
        cells.push(quoted(method.reason.as_deref().unwrap_or("")));
        text.push_str(&(cells.join(",") + "\n"));
    }
    text
}

/// Two `tabular`s with the rules of the package booktabs; the best of each column is bold.
pub fn latex(methods: &[ComparedMethod]) -> String {
    let mut first = present(methods, PICTURE);
    first.extend(present(methods, COST));
    let mut text = String::from("% needs \\usepackage{booktabs}\n");
    for figures in [first, present(methods, SCORECARD)] {
        if figures.is_empty() {
            continue;
        }
        let on = any_elsewhere(methods) && figures.iter().any(|f| f.name == "milliseconds");
        let columns = "r".repeat(figures.len()) + if on { "l" } else { "" };
        text.push_str(&format!("\\begin{{tabular}}{{l{columns}}}\n\\toprule\n"));
        let heads = figures.iter().map(|f| escaped(f.label)).chain(on.then(|| "on".to_owned()));
        text.push_str(&format!("method & {} \\\\\n\\midrule\n", heads.collect::<Vec<_>>().join(" & ")));
        for method in methods {
            let cells = figures.iter().map(|figure| {
                let cell = escaped(&method.cell(figure)).replace('±', "$\\pm$");
                if best(methods, figure).contains(&method.method.as_str()) {
                    format!("\\textbf{{{cell}}}")
                } else {
                    cell
                }
            });
            let own = on.then(|| method.ran_on().unwrap_or("-").to_owned());
            let cells: Vec<String> = cells.chain(own).collect();
            text.push_str(&format!("{} & {} \\\\\n", escaped(&method.method), cells.join(" & ")));
        }
        text.push_str("\\bottomrule\n\\end{tabular}\n\n");
    }
    text.trim_end().to_owned() + "\n"
}

fn escaped(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => out.extend(['\\', c]),
            '\\' => out.push_str("\\textbackslash{}"),
            '~' => out.push_str("\\textasciitilde{}"),
            '^' => out.push_str("\\textasciicircum{}"),
            _ => out.push(c),
        }
    }
    out
}

/// The methods that are best in a figure, where at least two have it. The noisy input is left out: it is blurred by
/// nothing and takes no time.
pub fn best<'m>(methods: &'m [ComparedMethod], figure: &Figure) -> Vec<&'m str> {
    let badness = |m: &ComparedMethod| {
        m.value(figure.name).map(|v| match figure.better {
            // Shares are fitted and may come out a little below 0, which is no merit.
            Better::Lower => v.abs(),
            Better::Higher => -v,
            Better::One => (v - 1.0).abs(),
        })
    };
    let taking_part: Vec<(&str, f64)> =
        methods.iter().filter(|m| m.method != "none").filter_map(|m| Some((m.method.as_str(), badness(m)?))).collect();
    let least = taking_part.iter().map(|(_, b)| *b).fold(f64::INFINITY, f64::min);
    if taking_part.len() < 2 || !least.is_finite() {
        return Vec::new();
    }
    taking_part.into_iter().filter(|(_, b)| *b <= least).map(|(name, _)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scorecard::Score;

    fn method(name: &str, error: f64) -> ComparedMethod {
        let mean = serde_json::from_value(serde_json::json!({
            "rel_mse": error, "rel_mse_trimmed": error, "fireflies": 0.0, "psnr": 30.0, "energy": 1.0,
            "hdr_flip": error, "ssim": 0.9, "ldr_flip": error,
        }));
        let mut scorecard = Scores::all_null("nothing moves");
        scorecard.noise = Score::of(error);
        ComparedMethod {
            method: name.to_owned(),
            mean: Some(mean.unwrap()),
            scorecard: Some(scorecard),
            milliseconds: Spread::of([error * 10.0]),
            peak_bytes: Some(3 << 20),
            ..ComparedMethod::default()
        }
    }

    fn methods() -> Vec<ComparedMethod> {
        let absent = ComparedMethod {
            method: "oidn:high".to_owned(),
            reason: Some("no library, \"found\"".to_owned()),
            ..ComparedMethod::default()
        };
        let mut other = method("b_c", 0.25);
        other.scorecard.as_mut().unwrap().noise = Score::null("too little signal");
        vec![method("none", 0.125), method("a", 0.5), other, absent]
    }

    #[test]
    fn tables_show_figures_and_why_others_are_missing() {
        let text = text(&methods());
        assert!(text.contains("HDR-FLIP") && text.contains("0.5000") && text.contains("3.0"), "{text}");
        assert!(
            text.contains("- oidn:high: no library") && text.contains("- noise of b_c: too little signal"),
            "{text}"
        );
        assert!(
            text.contains("- blur, smearing, ghosting, flicker") && text.matches("nothing moves").count() == 1,
            "{text}"
        );
    }

    /// A figure whose name is no field would silently have no column.
    #[test]
    fn every_metric_and_every_score_has_its_column() {
        let names = |list: &[Figure]| list.iter().map(|f| f.name.to_owned()).collect::<std::collections::BTreeSet<_>>();
        let mean = method("a", 0.5).mean.unwrap();
        let fields = serde_json::to_value(mean).unwrap();
        assert_eq!(names(PICTURE), fields.as_object().unwrap().keys().cloned().collect());
        assert_eq!(names(SCORECARD), Scores::NAMES.map(str::to_owned).into());
    }

    #[test]
    fn a_share_below_nothing_is_not_better_than_nothing() {
        let with_blur = |name: &str, blur: f64| {
            let mut method = method(name, 0.5);
            method.scorecard = Some(Scores { blur: Score::of(blur), ..Scores::all_null("not measured") });
            method
        };
        let blur = SCORECARD.iter().find(|f| f.name == "blur").unwrap();
        assert_eq!(best(&[with_blur("a", -0.06), with_blur("b", 0.01)], blur), ["b"]);
    }

    #[test]
    fn the_best_is_not_the_noisy_input() {
        let all = methods();
        let figure = |name: &str| Figure::all().find(|f| f.name == name).unwrap();
        assert_eq!(best(&all, figure("hdr_flip")), ["b_c"]);
        assert_eq!(best(&all, figure("psnr")), ["a", "b_c"]);
        assert_eq!(best(&all, figure("noise")), Vec::<&str>::new());
    }

    #[test]
    fn csv_and_latex_hold_every_method() {
        let all = methods();
        let csv = csv(&all);
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines.len(), 5);
        let columns = lines[0].split(',').count();
        assert!(lines[1..4].iter().all(|l| l.split(',').count() == columns), "{csv}");
        assert!(lines[4].ends_with("\"no library, \"\"found\"\"\""), "{csv}");
        let latex = latex(&all);
        assert!(latex.contains("b\\_c") && latex.contains("\\textbf{0.2500}") && !latex.contains("b_c"), "{latex}");
        assert_eq!(latex.matches("\\begin{tabular}").count(), 2);
    }
}
