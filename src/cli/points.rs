//! The points of a survey before they are measured: checked, planned, listed.

use super::check::unique;
use super::compare::all;
use super::console::Console;
use super::failure::{CommandError, Failure};
use super::pipeline::{check_with, plan_view};
use super::scene::View;
use crate::gpu::expected_device;
use crate::measure::criteria::Cost;
use crate::measure::survey::Survey;
use crate::measure::sweep::{Axis, Outcome, Point};
use crate::measure::traffic::traffic;
use crate::pipeline::diagnostics::known;
use crate::pipeline::syntax::Word;
use crate::pipeline::{Pipeline, Plan, Problem, Problems};
use std::collections::BTreeMap;
use std::sync::Arc;

/// More points make no figure that anybody can read, and take their time to be planned.
const MAX_POINTS: usize = 1000;

/// Every point with its pipeline, or all that is wrong with any of them.
pub(super) fn check(survey: &Survey) -> Result<(Vec<Point>, Vec<Pipeline>), Failure> {
    let count = survey.rows.len().saturating_mul(survey.columns());
    if count > MAX_POINTS {
        return Err(Failure::input(CommandError::TooManyPoints { points: count, most: MAX_POINTS }));
    }
    let points = survey.points();
    let pipelines = all(points.iter().map(|(row, sets, _)| check_with(&row.pipeline, row.place.as_ref(), sets)))?;
    let points: Vec<Point> = points.into_iter().map(|(_, _, point)| point).collect();
    expect_different(&points, &pipelines, &survey.axes())?;
    let timed: &[Word] = if let Cost::PerRecord(nodes) = &survey.cost { nodes } else { &[] };
    expect_nodes(timed.iter().chain(&survey.moved), &pipelines)?;
    Ok((points, pipelines))
}

/// The same pipeline at two points would be measured twice for one answer.
fn expect_different(points: &[Point], pipelines: &[Pipeline], over: &[Axis]) -> Result<(), Failure> {
    let mut seen: BTreeMap<String, &Point> = BTreeMap::new();
    for (point, pipeline) in points.iter().zip(pipelines) {
        if let Some(first) = seen.insert(pipeline.to_ron(), point) {
            return Err(Failure::input(CommandError::SamePoint { first: first.name(over), second: point.name(over) }));
        }
    }
    Ok(())
}

/// A node whose time or traffic counts must be there in one of the pipelines.
fn expect_nodes<'w>(nodes: impl Iterator<Item = &'w Word>, pipelines: &[Pipeline]) -> Result<(), Failure> {
    let mut names: Vec<&str> = pipelines.iter().flat_map(Pipeline::names).collect();
    names.sort_unstable();
    names.dedup();
    let unknown = nodes.filter(|node| !names.contains(&node.text.as_str()));
    let problem = |node: &Word| {
        let problem = Problem::new("study::unknown_node", format!("no pipeline has a node `{}`", node.text));
        problem.at(&node.place, "not a node").help(known(&node.text, names.iter().copied(), "the nodes"))
    };
    let problems: Vec<Problem> = unknown.map(problem).collect();
    if problems.is_empty() { Ok(()) } else { Err(Failure::input(Problems(unique(problems)))) }
}

/// The plan of a point; a point without one is refused.
pub(super) fn planned(pipeline: &Pipeline, view: &View, point: &mut Point, console: &Console) -> Option<Arc<Plan>> {
    plan_view(pipeline, view, expected_device(), &[], console).map_err(|problems| point.outcome = Outcome::Refused { because: told(&problems) }).ok()
}

/// Several problems on one line, each with its code.
pub(super) fn told(problems: &Problems) -> String {
    problems.0.iter().map(|problem| format!("{}: {problem}", problem.code)).collect::<Vec<_>>().join("; ")
}

/// What the nodes of each plan move.
pub(super) fn weigh(moved: &[Word], plans: &[Option<Arc<Plan>>], points: &mut [Point]) -> Result<(), Failure> {
    let nodes: Vec<&str> = moved.iter().map(|node| node.text.as_str()).collect();
    for (plan, point) in plans.iter().zip(points).filter(|_| !nodes.is_empty()) {
        point.traffic = plan.as_ref().map(|plan| traffic(plan, &nodes)).transpose().map_err(Failure::work)?.flatten();
    }
    Ok(())
}

pub(super) fn listed(points: &[Point], plans: &[Option<Arc<Plan>>], over: &[Axis]) -> String {
    let line = |(point, plan): (&Point, &Option<Arc<Plan>>)| {
        let what = match (&point.outcome, plan) {
            (Outcome::Refused { because }, _) => format!(", refused: {because}"),
            (_, Some(plan)) => format!(", {:.1} MiB on the device", plan.memory().total() as f64 / f64::from(1 << 20)),
            _ => String::new(),
        };
        format!("{} {}{what}\n", point.id, point.name(over))
    };
    points.iter().zip(plans).map(line).collect()
}

pub(super) fn expect_none_refused(points: &[Point]) -> Result<(), Failure> {
    let refused = points.iter().filter(|point| matches!(point.outcome, Outcome::Refused { .. })).count();
    if refused == 0 { Ok(()) } else { Err(Failure::work(CommandError::RefusedPoints { refused, points: points.len() })) }
}
