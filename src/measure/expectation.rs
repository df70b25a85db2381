//! What a study expects of its numbers, beside what a paper says of them: whether they came true, and who was closer.

use super::criteria::{Cost, Metric};
use super::sweep::{Point, Sweep};
use serde::Serialize;
use std::collections::BTreeMap;

/// How far a value may be from a paper's and still be called the same, as a share of that: what papers round away, and what another build of a scene
/// changes.
const SAME: f64 = 0.1;

/// What a number of a study should be.
#[derive(Debug, Clone)]
pub struct Expectation {
    /// Of this row.
    pub row: String,
    /// At these values of what is swept, by parameter, as written.
    pub at: BTreeMap<String, String>,
    pub of: Quantity,
    /// As a share of what this row has there.
    pub over: Option<String>,
    /// The least and the most that it should be.
    pub within: [f64; 2],
    pub paper: Option<Claim>,
}

/// What a source says of a number.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Claim {
    Value(f64),
    /// No more than that it is less: papers say which of two is faster and not by how much.
    Below {
        below: f64,
    },
}

#[derive(Debug, Clone)]
pub enum Quantity {
    /// Its size.
    Error(Metric),
    /// As the study counts it.
    Cost,
}

/// An expectation and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Found {
    pub row: String,
    pub at: BTreeMap<String, String>,
    /// The metric, or the cost.
    pub of: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub over: Option<String>,
    /// Whether the numbers are shares, told in percent.
    pub is_share: bool,
    /// None where it was not measured, or the reference's noise hides it.
    pub value: Option<f64>,
    /// Of 95 % for errors, quartiles for times; of a quotient as far as both reach.
    pub interval: Option<[f64; 2]>,
    pub within: [f64; 2],
    /// None where nothing is known.
    pub as_expected: Option<bool>,
    pub paper: Option<Claim>,
    /// None where the source says nothing.
    pub verdict: Option<Verdict>,
}

/// A value beside that of a paper. Errors and costs: less is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    Agrees,
    Better,
    Differs,
    CannotBeSaid,
}

impl Verdict {
    pub fn words(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Better => "better",
            Self::Differs => "differs",
            Self::CannotBeSaid => "cannot be said",
        }
    }
}

/// A number and how far it may be off.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Known {
    value: f64,
    interval: Option<[f64; 2]>,
}

/// What became of each expectation in a sweep whose cost is this.
pub fn judge(expectations: &[Expectation], sweep: &Sweep, cost: &Cost) -> Vec<Found> {
    expectations.iter().map(|expectation| expectation.judge(sweep, cost)).collect()
}

impl Expectation {
    fn judge(&self, sweep: &Sweep, cost: &Cost) -> Found {
        let of_row = |row: &str| self.known(sweep.points.iter().find(|point| self.is_at(point, row))?, cost);
        let known = match &self.over {
            None => of_row(&self.row),
            Some(over) => of_row(&self.row).zip(of_row(over)).and_then(|(one, other)| one.over(other)),
        };
        let is_share = matches!(&self.of, Quantity::Error(metric) if metric.is_share()) && self.over.is_none();
        Found {
            row: self.row.clone(),
            at: self.at.clone(),
            of: match &self.of {
                Quantity::Error(metric) => metric.to_string(),
                Quantity::Cost => sweep.cost.clone(),
            },
            over: self.over.clone(),
            is_share,
            value: known.map(|known| known.value),
            interval: known.and_then(|known| known.interval),
            within: self.within,
            as_expected: known.map(|known| (self.within[0]..=self.within[1]).contains(&known.value)),
            paper: self.paper,
            verdict: self.paper.map(|paper| verdict(known, paper)),
        }
    }

    fn is_at(&self, point: &Point, row: &str) -> bool {
        point.row == row && self.at.iter().all(|(parameter, value)| point.values.get(parameter) == Some(value))
    }

    fn known(&self, point: &Point, cost: &Cost) -> Option<Known> {
        let measured = point.measured()?;
        match &self.of {
            Quantity::Cost => Some(Known { value: cost.of(measured)?, interval: cost.spread(measured) }),
            Quantity::Error(metric) => {
                let interval = metric.interval(&measured.errors);
                let is_hidden = interval.is_some_and(|interval| interval.below_noise);
                let value = metric.of(&measured.errors).filter(|_| !is_hidden)?;
                Some(Known { value, interval: interval.map(|interval| interval.of_size()) })
            }
        }
    }
}

impl Known {
    /// None where the other is 0.
    fn over(self, other: Self) -> Option<Self> {
        let interval = self.interval.zip(other.interval).map(|([low, high], [least, most])| [low / most, high / least]);
        (other.value > 0.0).then(|| Self { value: self.value / other.value, interval: interval.filter(|ends| ends.iter().all(|end| end.is_finite())) })
    }
}

fn verdict(known: Option<Known>, claim: Claim) -> Verdict {
    let Some(Known { value, interval }) = known else { return Verdict::CannotBeSaid };
    let holds = |number: f64| interval.is_some_and(|[low, high]| (low..=high).contains(&number));
    match claim {
        Claim::Value(paper) if holds(paper) || (value - paper).abs() <= SAME * paper => Verdict::Agrees,
        Claim::Value(paper) if value < paper => Verdict::Better,
        Claim::Below { below } if holds(below) => Verdict::CannotBeSaid,
        Claim::Below { below } if value < below => Verdict::Agrees,
        Claim::Value(_) | Claim::Below { .. } => Verdict::Differs,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(value: f64, interval: [f64; 2]) -> Option<Known> {
        Some(Known { value, interval: Some(interval) })
    }

    #[test]
    fn verdicts_mind_the_interval() {
        let paper = Claim::Value(0.181);
        assert_eq!(verdict(known(0.15, [0.149, 0.151]), paper), Verdict::Better);
        assert_eq!(verdict(known(0.15, [0.14, 0.19]), paper), Verdict::Agrees);
        assert_eq!(verdict(known(0.17, [0.169, 0.171]), paper), Verdict::Agrees);
        assert_eq!(verdict(known(0.21, [0.209, 0.211]), paper), Verdict::Differs);
        assert_eq!(verdict(Some(Known { value: 0.21, interval: None }), paper), Verdict::Differs);
        assert_eq!(verdict(None, paper), Verdict::CannotBeSaid);
    }

    #[test]
    fn that_one_is_less_is_said_where_the_interval_is() {
        let claim = Claim::Below { below: 1.0 };
        assert_eq!(verdict(known(0.95, [0.9, 0.98]), claim), Verdict::Agrees);
        assert_eq!(verdict(known(0.95, [0.9, 1.02]), claim), Verdict::CannotBeSaid);
        assert_eq!(verdict(known(1.05, [1.01, 1.1]), claim), Verdict::Differs);
        assert_eq!(verdict(Some(Known { value: 0.95, interval: None }), claim), Verdict::Agrees);
        assert_eq!(verdict(None, claim), Verdict::CannotBeSaid);
    }

    #[test]
    fn quotients_reach_as_far_as_both() {
        let quotient = known(2.0, [1.0, 3.0]).unwrap().over(known(4.0, [2.0, 8.0]).unwrap()).unwrap();
        assert_eq!(quotient, known(0.5, [0.125, 1.5]).unwrap());
        let unbounded = known(2.0, [1.0, 3.0]).unwrap().over(known(4.0, [0.0, 8.0]).unwrap()).unwrap();
        assert_eq!(unbounded, Known { value: 0.5, interval: None });
        assert_eq!(known(2.0, [1.0, 3.0]).unwrap().over(known(0.0, [0.0, 8.0]).unwrap()), None);
    }
}
