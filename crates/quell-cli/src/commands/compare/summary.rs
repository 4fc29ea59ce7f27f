//! The figures of every method, over seeds.

use super::contest::{Contest, Entry};
use quell_lab::compare::statistics::Interval;
use quell_lab::metrics::{FrameScores, mean_scores};
use quell_lab::report::Spread;
use quell_lab::report::figures::{ComparedMethod, Figure};
use quell_lab::scorecard::Scores;
use std::collections::BTreeMap;

/// Whose time the others are set beside.
const MEASURE_OF_TIME: &str = "quell:paper";

/// One row a method, in the order in which they were asked for.
pub fn methods(contests: &[Contest]) -> Vec<ComparedMethod> {
    let Some(first) = contests.first() else { return Vec::new() };
    let of_seed = |contest: &Contest| -> Vec<ComparedMethod> {
        let mut rows: Vec<ComparedMethod> = contest.entries.iter().map(row).collect();
        let measure = rows.iter().find(|m| m.method == MEASURE_OF_TIME).and_then(|m| m.milliseconds).map(|s| s.median);
        for row in &mut rows {
            row.time_ratio = row.milliseconds.zip(measure).map(|(own, measure)| own.median / measure);
        }
        rows
    };
    let seeds: Vec<Vec<ComparedMethod>> = contests.iter().map(of_seed).collect();
    let mut rows = Vec::new();
    for entry in &first.entries {
        let same: Vec<&ComparedMethod> = seeds.iter().flatten().filter(|m| m.method == entry.name).collect();
        rows.extend(over_seeds(&same));
    }
    rows
}

fn row(entry: &Entry) -> ComparedMethod {
    let method = entry.name.clone();
    match &entry.result {
        Err(reason) => ComparedMethod { method, reason: Some(reason.clone()), ..ComparedMethod::default() },
        Ok((finished, verdict)) => ComparedMethod {
            method,
            mean: verdict.mean,
            frames: verdict.frames.clone(),
            scorecard: Some(verdict.scorecard.clone()),
            milliseconds: finished.milliseconds,
            peak_bytes: finished.peak_bytes,
            backend: finished.backend.clone(),
            resumed: finished.resumed,
            ..ComparedMethod::default()
        },
    }
}

fn over_seeds(seeds: &[&ComparedMethod]) -> Option<ComparedMethod> {
    let first = (*seeds.first()?).clone();
    if seeds.len() < 2 {
        return Some(first);
    }
    let mut intervals = BTreeMap::new();
    for figure in Figure::all() {
        let values: Vec<f64> = seeds.iter().filter_map(|m| m.own_value(figure.name)).collect();
        if let Some(interval) = Interval::of(&values) {
            intervals.insert(figure.name.to_owned(), interval);
        }
    }
    let means: Vec<FrameScores> = seeds.iter().filter_map(|m| m.mean).collect();
    let cards: Vec<&Scores> = seeds.iter().filter_map(|m| m.scorecard.as_ref()).collect();
    let medians = seeds.iter().filter_map(|m| m.milliseconds.map(|s| s.median));
    Some(ComparedMethod {
        mean: mean_scores(&means),
        scorecard: mean_card(&cards),
        milliseconds: Spread::of(medians),
        peak_bytes: seeds.iter().filter_map(|m| m.peak_bytes).max(),
        resumed: seeds.iter().all(|m| m.resumed),
        intervals,
        ..first
    })
}

/// The mean of the values that there are; the first reason where there are none.
fn mean_card(cards: &[&Scores]) -> Option<Scores> {
    let mut mean = serde_json::to_value(*cards.first()?).ok()?;
    for name in Scores::NAMES {
        let values: Vec<f64> = cards.iter().filter_map(|card| card.get(name)?.value).collect();
        if let (Some(interval), Some(score)) = (Interval::of(&values), mean.get_mut(name)) {
            score["value"] = interval.mean.into();
        }
    }
    serde_json::from_value(mean).ok()
}
