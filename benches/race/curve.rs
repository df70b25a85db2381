//! A program's error over time as a curve, and curves read at one error.

use hemisplat::measure::front::{Standing, front};
use serde::{Serialize, Serializer, ser::SerializeMap};

/// The errors that curves are read at, and told beside.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    RmseOverMean,
    BlockP50,
    BlockP99,
    /// In windows, as those that follow.
    BandError,
    RmseInterior,
    RmseEdges,
}

impl Metric {
    pub const ALL: [Self; 6] = [Self::RmseOverMean, Self::BlockP50, Self::BlockP99, Self::BandError, Self::RmseInterior, Self::RmseEdges];

    pub fn name(self) -> &'static str {
        match self {
            Self::RmseOverMean => "rmse_over_mean",
            Self::BlockP50 => "block_p50",
            Self::BlockP99 => "block_p99",
            Self::BandError => "band_error",
            Self::RmseInterior => "rmse_interior",
            Self::RmseEdges => "rmse_edges",
        }
    }
}

/// Seconds of a setting's runs: their middle, the least and the most.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Seconds {
    pub median: f64,
    pub least: f64,
    pub most: f64,
}

/// Time and errors of one setting, or between two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    pub seconds: Seconds,
    /// In the order of `Metric::ALL`.
    pub errors: [f64; Metric::ALL.len()],
}

impl Sample {
    pub fn error(&self, metric: Metric) -> f64 {
        self.errors[metric as usize]
    }
}

/// As one object, each error by its name.
impl Serialize for Sample {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("seconds", &self.seconds)?;
        Metric::ALL.iter().try_for_each(|metric| map.serialize_entry(metric.name(), &self.error(*metric)))?;
        map.end()
    }
}

/// The samples that no other beats in both time and one error, the most exact first: errors rise, seconds fall, both are positive. Never empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    metric: Metric,
    samples: Vec<Sample>,
}

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
    pub fn of(samples: &[Sample], metric: Metric) -> Option<Self> {
        let mut samples: Vec<Sample> = samples.iter().copied().filter(|sample| sample.seconds.least > 0.0 && sample.error(metric) > 0.0).collect();
        samples.sort_by(|a, b| a.error(metric).total_cmp(&b.error(metric)).then(a.seconds.median.total_cmp(&b.seconds.median)));
        samples.dedup_by_key(|sample| [sample.error(metric), sample.seconds.median]);
        let standings: Vec<Standing> = samples.iter().map(|sample| Standing::certain(sample.seconds.median, sample.error(metric))).collect();
        let mut is_on_front = front(&standings).into_iter();
        samples.retain(|_| is_on_front.next().unwrap_or(false));
        (!samples.is_empty()).then_some(Self { metric, samples })
    }

    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// Between two samples, straight where both axes are logarithmic; the other errors go along in proportion.
    pub fn at(&self, error: f64) -> Reading {
        let (first, last) = (self.samples[0], self.samples[self.samples.len() - 1]);
        if error < first.error(self.metric) {
            return Reading::NotReached(first);
        }
        let Some(above) = self.samples.iter().position(|sample| sample.error(self.metric) >= error) else { return Reading::Exceeded(last) };
        let (a, b) = (self.samples[above.saturating_sub(1)], self.samples[above]);
        Reading::At(if b.error(self.metric) == error { b } else { self.between(a, b, error) })
    }

    fn between(&self, a: Sample, b: Sample, error: f64) -> Sample {
        let share = (error / a.error(self.metric)).ln() / (b.error(self.metric) / a.error(self.metric)).ln();
        let mixed = |a: f64, b: f64| a + (b - a) * share;
        let seconds = |of: fn(&Seconds) -> f64| mixed(of(&a.seconds).ln(), of(&b.seconds).ln()).exp();
        let mut errors: [f64; Metric::ALL.len()] = std::array::from_fn(|index| mixed(a.errors[index], b.errors[index]));
        errors[self.metric as usize] = error;
        Sample {
            seconds: Seconds { median: seconds(|seconds| seconds.median), least: seconds(|seconds| seconds.least), most: seconds(|seconds| seconds.most) },
            errors,
        }
    }

    /// Up to three errors to compare at, which need no reading between samples: the smallest, a middle one, the largest.
    pub fn levels(&self) -> Vec<f64> {
        let last = self.samples.len() - 1;
        let mut places = vec![0, last / 2, last];
        places.dedup();
        places.into_iter().map(|place| self.samples[place].error(self.metric)).collect()
    }
}

/// How many times as long one program takes as another. The least is its fastest runs beside the other's slowest, the most the reverse.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Ratio {
    pub median: f64,
    pub least: f64,
    pub most: f64,
}

/// What two readings say of how many times as long the one takes. A curve falls, so that its end bounds what lies beyond.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Factor {
    Is(Ratio),
    /// The one does not get as exact, or the other is never as coarse.
    MoreThan(f64),
    /// The reverse.
    LessThan(f64),
    /// The bounds do not meet.
    Unknown,
}

/// A ratio as an object, a bound in words, for tables.
impl Serialize for Factor {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Is(ratio) => ratio.serialize(serializer),
            Self::MoreThan(bound) => serializer.serialize_str(&format!("> {bound:.1}")),
            Self::LessThan(bound) => serializer.serialize_str(&format!("< {bound:.1}")),
            Self::Unknown => serializer.serialize_none(),
        }
    }
}

impl Reading {
    pub fn sample(&self) -> Option<Sample> {
        match self {
            Self::At(sample) => Some(*sample),
            Self::NotReached(_) | Self::Exceeded(_) => None,
        }
    }

    /// How many times as long as `other` this takes.
    pub fn over(&self, other: &Self) -> Factor {
        let (Self::At(a) | Self::NotReached(a) | Self::Exceeded(a), Self::At(b) | Self::NotReached(b) | Self::Exceeded(b)) = (self, other);
        let (a, b) = (a.seconds, b.seconds);
        let ratio = Ratio { median: a.median / b.median, least: a.least / b.most, most: a.most / b.least };
        match (self, other) {
            (Self::At(_), Self::At(_)) => Factor::Is(ratio),
            (Self::NotReached(_), Self::At(_) | Self::Exceeded(_)) | (Self::At(_), Self::Exceeded(_)) => Factor::MoreThan(ratio.least),
            (Self::Exceeded(_), Self::At(_) | Self::NotReached(_)) | (Self::At(_), Self::NotReached(_)) => Factor::LessThan(ratio.most),
            (Self::NotReached(_), Self::NotReached(_)) | (Self::Exceeded(_), Self::Exceeded(_)) => Factor::Unknown,
        }
    }
}
