//! Metrics and stage times as text for a terminal.

use crate::report::json::{MethodScores, StageTime};

/// Columns of text: the first is set flush left, all others flush right.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// Heads of the columns.
    pub head: Vec<String>,
    /// Rows, each with as many cells as there are heads.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    pub fn new<const N: usize>(head: [&str; N]) -> Self {
        Self { head: head.map(str::to_owned).to_vec(), rows: Vec::new() }
    }

    /// One more row.
    pub fn push<const N: usize>(&mut self, cells: [String; N]) {
        self.rows.push(cells.to_vec());
    }
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let width = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column)).chain(self.head.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.head.len()).map(width).collect();
        let line = |f: &mut std::fmt::Formatter<'_>, cells: &[String]| {
            let mut text = String::new();
            for (i, (cell, &width)) in cells.iter().zip(&widths).enumerate() {
                if i == 0 {
                    text.push_str(&format!("{cell:<width$}"));
                } else {
                    text.push_str(&format!("  {cell:>width$}"));
                }
            }
            writeln!(f, "{}", text.trim_end())
        };
        line(f, &self.head)?;
        let rule: Vec<String> = widths.iter().map(|&w| "-".repeat(w)).collect();
        line(f, &rule)?;
        for row in &self.rows {
            line(f, row)?;
        }
        Ok(())
    }
}

/// Scores of every method, one row each; "lower by": how many times trimmed relMSE is below that of the first.
pub fn metrics_table(metrics: &[MethodScores]) -> Table {
    let mut table = Table::new([
        "method",
        "relMSE",
        "trimmed",
        "lower by",
        "PSNR dB",
        "SSIM",
        "FLIP",
        "HDR-FLIP",
        "energy",
        "fireflies",
        "frames",
    ]);
    let first = metrics.first().and_then(|m| m.mean).map(|m| m.rel_mse_trimmed);
    for method in metrics {
        let frames = method.frames.len().to_string();
        let Some(mean) = method.mean else {
            let none = || "-".to_owned();
            let mut cells = vec![method.method.clone()];
            cells.extend((0..9).map(|_| none()));
            cells.push(frames);
            table.rows.push(cells);
            continue;
        };
        table.push([
            method.method.clone(),
            significant(mean.rel_mse),
            significant(mean.rel_mse_trimmed),
            first.map_or("-".to_owned(), |first| format!("{:.1}x", first / mean.rel_mse_trimmed)),
            format!("{:.2}", mean.psnr),
            format!("{:.4}", mean.ssim),
            format!("{:.4}", mean.ldr_flip),
            format!("{:.4}", mean.hdr_flip),
            format!("{:.4}", mean.energy),
            format!("{:.1}", mean.fireflies),
            frames,
        ]);
    }
    table
}

/// Time of every stage, one row each, and their sum (of the medians).
pub fn stage_table(stages: &[StageTime]) -> Table {
    let mut table = Table::new(["stage", "paper", "median ms", "min", "max", "bytes/pixel", "floor ms"]);
    let optional = |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |v| format!("{v:.digits$}"));
    for stage in stages {
        table.push([
            stage.name.clone(),
            stage.paper_stage.map_or("-".to_owned(), |s| s.to_string()),
            format!("{:.2}", stage.milliseconds.median),
            format!("{:.2}", stage.milliseconds.min),
            format!("{:.2}", stage.milliseconds.max),
            optional(stage.bytes_per_pixel, 0),
            optional(stage.floor_ms, 2),
        ]);
    }
    if stages.len() > 1 {
        let all = |f: fn(&StageTime) -> Option<f64>| stages.iter().filter_map(f).reduce(|a, b| a + b);
        table.push([
            "sum".to_owned(),
            String::new(),
            format!("{:.2}", stages.iter().map(|s| s.milliseconds.median).sum::<f64>()),
            String::new(),
            String::new(),
            optional(all(|s| s.bytes_per_pixel), 0),
            optional(all(|s| s.floor_ms), 2),
        ]);
    }
    table
}

/// Three significant digits.
pub(crate) fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = 2 - value.abs().log10().floor() as i32;
    if (0..=6).contains(&digits) { format!("{value:.*}", digits as usize) } else { format!("{value:.2e}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::FrameScores;
    use crate::report::json::Spread;

    #[test]
    fn tables_line_up() {
        let scores = |v: f64| {
            Some(FrameScores {
                rel_mse: v,
                rel_mse_trimmed: v,
                fireflies: 2.0,
                psnr: 20.0,
                energy: 1.0,
                ssim: 0.9,
                ldr_flip: 0.1,
                hdr_flip: 0.2,
            })
        };
        let method = |name: &str, mean| MethodScores { method: name.to_owned(), mean, frames: Vec::new() };
        let table = metrics_table(&[method("noisy", scores(0.5)), method("quell:paper", scores(0.0125))]).to_string();
        assert!(table.contains("40.0x") && table.contains("0.0125") && table.contains("0.500"), "{table}");
        let length = |line: &str| line.chars().count();
        let lines: Vec<&str> = table.lines().collect();
        assert!(lines.iter().all(|l| length(l) == length(lines[0])), "{table}");

        let stage = |name: &str, ms: f64| StageTime {
            name: name.to_owned(),
            paper_stage: Some(3),
            milliseconds: Spread { median: ms, min: ms, max: ms },
            bytes_per_pixel: Some(10.0),
            floor_ms: None,
        };
        let table = stage_table(&[stage("a", 1.5), stage("b", 2.25)]).to_string();
        assert!(table.lines().last().unwrap().starts_with("sum") && table.contains("3.75"), "{table}");
    }
}
