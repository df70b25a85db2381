//! A program's error over time as a curve, and two curves read at one error.

use hemisplat::measure::front::{Standing, front};
use serde::Serialize;

/// Time and errors of one setting, or between two.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sample {
    pub seconds: f64,
    /// What curves are read at.
    pub rmse_over_mean: f64,
    pub bias_over_mean: f64,
    pub block_p50: f64,
    pub block_p99: f64,
    /// In windows, as the next.
    pub band_error: f64,
    pub rmse_edges: f64,
}

/// The samples that no other beats in both time and error, the most exact first: errors rise, seconds fall, both are positive. Never empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve(Vec<Sample>);

/// What a curve says of an error. A curve says nothing beyond its ends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reading {
    At(Sample),
    /// Even the most exact sample, which this is, has a larger error.
    NotReached(Sample),
    /// Even the fastest sample, which this is, has a smaller error.
    Exceeded(Sample),
}

impl Curve {
    /// None without a sample of positive time and error: others have no logarithm.
    pub fn of(samples: &[Sample]) -> Option<Self> {
        let mut samples: Vec<Sample> = samples.iter().copied().filter(|sample| sample.seconds > 0.0 && sample.rmse_over_mean > 0.0).collect();
        samples.sort_by(|a, b| a.rmse_over_mean.total_cmp(&b.rmse_over_mean).then(a.seconds.total_cmp(&b.seconds)));
        samples.dedup_by_key(|sample| [sample.rmse_over_mean, sample.seconds]);
        let standings: Vec<Standing> = samples.iter().map(|sample| Standing::certain(sample.seconds, sample.rmse_over_mean)).collect();
        let mut is_on_front = front(&standings).into_iter();
        samples.retain(|_| is_on_front.next().unwrap_or(false));
        (!samples.is_empty()).then_some(Self(samples))
    }

    pub fn samples(&self) -> &[Sample] {
        &self.0
    }

    /// Between two samples, straight where both axes are logarithmic; the other errors go along in proportion.
    pub fn at(&self, error: f64) -> Reading {
        let (first, last) = (self.0[0], self.0[self.0.len() - 1]);
        if error < first.rmse_over_mean {
            return Reading::NotReached(first);
        }
        let Some(above) = self.0.iter().position(|sample| sample.rmse_over_mean >= error) else { return Reading::Exceeded(last) };
        let (a, b) = (self.0[above.saturating_sub(1)], self.0[above]);
        Reading::At(if b.rmse_over_mean == error { b } else { between(a, b, error) })
    }

    /// Up to three errors to compare at, which need no reading between samples: the smallest, a middle one, the largest.
    pub fn levels(&self) -> Vec<f64> {
        let last = self.0.len() - 1;
        let mut places = vec![0, last / 2, last];
        places.dedup();
        places.into_iter().map(|place| self.0[place].rmse_over_mean).collect()
    }
}

fn between(a: Sample, b: Sample, error: f64) -> Sample {
    let share = (error / a.rmse_over_mean).ln() / (b.rmse_over_mean / a.rmse_over_mean).ln();
    let mixed = |a: f64, b: f64| a + (b - a) * share;
    Sample {
        seconds: mixed(a.seconds.ln(), b.seconds.ln()).exp(),
        rmse_over_mean: error,
        bias_over_mean: mixed(a.bias_over_mean, b.bias_over_mean),
        block_p50: mixed(a.block_p50, b.block_p50),
        block_p99: mixed(a.block_p99, b.block_p99),
        band_error: mixed(a.band_error, b.band_error),
        rmse_edges: mixed(a.rmse_edges, b.rmse_edges),
    }
}

impl Reading {
    pub fn sample(&self) -> Option<Sample> {
        match self {
            Self::At(sample) => Some(*sample),
            Self::NotReached(_) | Self::Exceeded(_) => None,
        }
    }

    /// How many times as long as `other` this takes; None where either has no time.
    pub fn over(&self, other: &Self) -> Option<f64> {
        Some(self.sample()?.seconds / other.sample()?.seconds)
    }
}
