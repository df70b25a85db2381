//! How certain an error is.

use super::Errors;
use crate::measure::statistics::{CONFIDENCE, quantile, two_sided};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// Where an error lies with [`CONFIDENCE`], in its unit, and what the reference's noise leaves of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    pub low: f64,
    pub high: f64,
    /// What a picture without error would have against this reference, for its noise is not taken off; null where it is taken off or not known.
    pub noise_floor: Option<f64>,
    /// Whether the reference's noise hides the error: it is known to be below the larger end in size, and no more.
    pub below_noise: bool,
}

impl Interval {
    /// The end that is farther from 0: what an error that noise hides is known to be below.
    pub fn most(&self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// Where the error's size lies.
    pub fn of_size(&self) -> [f64; 2] {
        let least = if self.low <= 0.0 && self.high >= 0.0 { 0.0 } else { self.low.abs().min(self.high.abs()) };
        [least, self.most()]
    }
}

/// An error as it is in each draw of the picture's blocks, by metric; the same draws for all pictures that one reference judges.
#[derive(Clone, Default, PartialEq)]
pub struct Resampled {
    pub metrics: BTreeMap<String, Vec<f32>>,
}

/// Its names alone: thousands of draws hide what else is told.
impl fmt::Debug for Resampled {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_set().entries(self.metrics.keys()).finish()
    }
}

impl Resampled {
    pub(super) fn add(&mut self, metric: &str, draws: &[f64]) {
        if !draws.is_empty() {
            self.metrics.insert(metric.to_owned(), draws.iter().map(|value| *value as f32).collect());
        }
    }
}

/// The middle [`CONFIDENCE`] of the draws; None without one.
pub(super) fn middle(draws: &[f64]) -> Option<[f64; 2]> {
    let mut sorted = draws.to_vec();
    sorted.sort_by(f64::total_cmp);
    let tail = (1.0 - CONFIDENCE) / 2.0;
    Some([quantile(&sorted, tail)?, quantile(&sorted, 1.0 - tail)?])
}

/// How the errors of two pictures differ that the same pixels of one reference judge.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ErrorDifference {
    /// The second error less the first, of signed ones their sizes.
    pub difference: f64,
    /// Where that lies with `confidence`.
    pub interval: [f64; 2],
    /// Of the interval, after the correction for several comparisons.
    pub confidence: f64,
    /// Whether the interval leaves 0 out.
    pub significant: bool,
}

impl ErrorDifference {
    /// Of a metric of two pictures, by its size; None where it was not resampled alike in both.
    pub fn of(first: &Errors, second: &Errors, metric: &str, comparisons: usize) -> Option<Self> {
        let sizes = [first.metric(metric)??.abs(), second.metric(metric)??.abs()];
        Self::between(sizes, [&first.draws(metric), &second.draws(metric)], comparisons)
    }

    /// From the size of each error and its draws, one of `comparisons` that are all to hold together. None where the draws are not those of pairs.
    pub fn between([first, second]: [f64; 2], draws: [&[f64]; 2], comparisons: usize) -> Option<Self> {
        if draws[0].len() != draws[1].len() || draws[0].is_empty() {
            return None;
        }
        let differences: Vec<f64> = draws[0].iter().zip(draws[1]).map(|(a, b)| b - a).collect();
        let mean = differences.iter().sum::<f64>() / differences.len() as f64;
        let deviation = (differences.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / differences.len() as f64).sqrt();
        let error = (1.0 - CONFIDENCE) / comparisons.max(1) as f64;
        let (difference, half) = (second - first, two_sided(error) * deviation);
        // The tails of a single comparison are in the draws; those of many lie beyond them, where the normal distribution stands for them.
        let own = if comparisons > 1 { None } else { middle(&differences) };
        let [low, high] = own.unwrap_or([difference - half, difference + half]);
        // Of skewed draws the middle may lie beside the difference itself.
        let interval = [low.min(difference), high.max(difference)];
        Some(Self { difference, interval, confidence: 1.0 - error, significant: interval[0] > 0.0 || interval[1] < 0.0 })
    }
}
