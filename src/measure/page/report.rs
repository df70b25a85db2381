//! What a page shows: a sweep, or a comparison, which is a sweep over no parameters.

use super::charts::{Chart, charts};
use crate::measure::compare::{DroppedNode, Pair};
use crate::measure::criteria::{Cost, Metric};
use crate::measure::sweep::{Point, Sweep};
use serde::Serialize;

/// Everything but the pictures.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    pub title: String,
    /// The numbers.
    pub sweep: Sweep,
    /// Runs of each point that were asked for.
    pub runs_asked: usize,
    /// What a reader must know before trusting the numbers.
    pub warnings: Vec<String>,
    /// One a point.
    pub beside: Vec<Beside>,
    /// The cost of each point that its error is held against; empty where its numbers tell it as they are.
    costs: Vec<Option<f64>>,
    /// Error over cost, for each error that is known; the sweep's own is the first.
    pub(super) charts: Vec<Chart>,
    /// A row for each thing that a study expected, below that of the names; empty where nothing was expected.
    pub expectations: Vec<Vec<String>>,
    /// None where times were not compared.
    pub differences: Option<Differences>,
}

/// What is told of a point beside its numbers.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Beside {
    /// The whole pipeline as RON.
    pub text: String,
    pub dropped: Vec<DroppedNode>,
    /// Plan, shaders and first picture; None where it is not told.
    pub start_up_seconds: Option<f64>,
}

/// How the times of variants differ.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Differences {
    pub pairs: Vec<Told>,
    /// Pairs of which errors alone are known.
    pub errors: Vec<ErrorsTold>,
    /// How many runs would settle what the pairs leave open.
    pub hint: Option<String>,
}

/// How the errors of two pictures differ, in words.
#[derive(Debug, Clone, Serialize)]
pub struct ErrorsTold {
    pub first: String,
    pub second: String,
    pub significant: bool,
    pub words: String,
}

/// A pair of variants, also in words.
#[derive(Debug, Clone, Serialize)]
pub struct Told {
    #[serde(flatten)]
    pub pair: Pair,
    pub words: String,
}

impl Report {
    /// A report whose plots hold errors against this cost, the error of this metric first.
    pub fn new(title: String, sweep: Sweep, metric: &Metric, cost: &Cost, beside: Vec<Beside>) -> Self {
        let of_point = |point: &Point| point.measured().and_then(|measured| cost.of(measured));
        let costs = if matches!(cost, Cost::PerRecord(_)) { sweep.points.iter().map(of_point).collect() } else { Vec::new() };
        let charts = charts(&sweep, metric, cost);
        Self { title, runs_asked: sweep.runs, sweep, warnings: Vec::new(), beside, costs, charts, expectations: Vec::new(), differences: None }
    }
}
