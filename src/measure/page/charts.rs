//! The plots of a page: one for each error that is known, each with a front of its own.

use crate::measure::criteria::{Cost, Metric};
use crate::measure::metrics::Told;
use crate::measure::plot::{Paper, svg};
use crate::measure::sweep::{Point, Sweep, mark_front, plot};
use serde::Serialize;

/// An error of each point, and how it lies over the cost.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Chart {
    label: String,
    /// What it means, for a tooltip.
    meaning: Option<&'static str>,
    /// One a point, signed; null where it is not known.
    errors: Vec<Option<f64>>,
    /// The same in words, with intervals.
    told: Vec<Option<Told>>,
    /// Whether the reference's noise hides it.
    hidden: Vec<bool>,
    wide: String,
    narrow: String,
}

impl Chart {
    pub(super) fn label(&self) -> &str {
        &self.label
    }

    /// The error of a point in words.
    pub(super) fn told(&self, point: usize) -> String {
        self.told[point].as_ref().map_or_else(|| "–".into(), Told::sentence)
    }
}

/// First that of `first`, then those of all metrics that a page tells; none of an error that no point has.
pub(super) fn charts(sweep: &Sweep, first: &Metric, cost: &Cost) -> Vec<Chart> {
    let label = |metric: &Metric| Metric::TOLD.iter().find(|(told, _)| told == metric).map_or(metric.to_string(), |(_, label)| label.to_string());
    let others = Metric::TOLD.into_iter().map(|(metric, _)| metric).filter(|metric| metric != first);
    std::iter::once(*first).chain(others).filter_map(|metric| chart(sweep, &metric, label(&metric), cost)).collect()
}

fn chart(sweep: &Sweep, metric: &Metric, label: String, cost: &Cost) -> Option<Chart> {
    let errors: Vec<Option<f64>> = sweep.points.iter().map(|point| metric.signed(point.errors()?)).collect();
    errors.iter().flatten().next()?;
    let mut judged = sweep.clone();
    mark_front(&mut judged.points, metric, cost);
    let plot = plot(&judged, metric, cost);
    let of = |point: &Point| metric.told(point.errors()?);
    let is_hidden = |point: &Point| point.errors().and_then(|errors| metric.interval(errors)).is_some_and(|interval| interval.below_noise);
    Some(Chart {
        label,
        meaning: metric.definition().map(|definition| definition.meaning),
        errors,
        told: judged.points.iter().map(of).collect(),
        hidden: judged.points.iter().map(is_hidden).collect(),
        wide: svg(&plot, Paper::Wide),
        narrow: svg(&plot, Paper::Narrow),
    })
}
