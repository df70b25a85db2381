//! A sweep as text, as CSV, and as a report for its page.

use super::comparison::{Cell, cell, count, lag, line, of_errors, percent, significant};
use super::expectations;
use crate::measure::compare::{ErrorParts, VariantErrors, dropped};
use crate::measure::course::Course;
use crate::measure::criteria::{Cost, Metric};
use crate::measure::page::{Beside, Report};
use crate::measure::survey::Survey;
use crate::measure::sweep::{Measured, Outcome, Point, Sweep};
use crate::measure::traffic::Traffic;
use crate::measure::{IRRADIANCE, PICTURE};
use crate::pipeline::{Pipeline, Plan};
use std::fmt::Write;
use std::sync::Arc;

/// The table for people.
pub fn text(sweep: &Sweep, survey: &Survey) -> String {
    let metric = &survey.metric;
    let [width, height] = sweep.size;
    let (frames, adapter) = (sweep.frames_told(), &sweep.adapter.name);
    let head = format!("{}, camera {}, {width}×{height}{frames}, {adapter}: {} runs of each point\n", sweep.scene, sweep.camera, sweep.runs);
    let names: Vec<String> = sweep.points.iter().map(|point| point.name(&sweep.over)).collect();
    let widest = names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max("point".len());
    let against = sweep.reference.as_ref().map(|reference| format!("\nagainst {}\n", reference.file.as_deref().unwrap_or("the reference")));
    let columns = format!(
        "\n{:<4} {:<widest$} {:>9} {:>21} {:>8} {:>10} {:>26} {:>6}\n",
        "",
        "point",
        "seconds",
        "quartiles",
        "records",
        "device MiB",
        metric.to_string(),
        "front"
    );
    let rows: String = sweep.points.iter().zip(&names).map(|(point, name)| row(point, name, widest, metric)).collect();
    [head, against.unwrap_or_default(), columns, rows, in_time(sweep, metric), parts(sweep, metric)].concat()
}

/// How the points of a sequence differ from the truth in time; nothing of one picture.
fn in_time(sweep: &Sweep, metric: &Metric) -> String {
    let courses = sweep.points.iter().filter_map(|point| Some((point, metric.course(point.measured()?)?)));
    let row = |(point, course): (&Point, &Course)| {
        let share = |share: Option<f64>| share.map_or("-".to_owned(), percent);
        let [p50, p99] = [course.lag_p50, course.lag_p99].map(|frames| lag(course, frames).unwrap_or("-".to_owned()));
        format!("{:<4} {:>10} {p50:>20} {p99:>20} {:>10}\n", point.id, share(course.flicker), share(course.ghost_p99))
    };
    let rows: String = courses.map(row).collect();
    let head = format!(
        "\n{}, in time; errors are means over the frames\n{:<4} {:>10} {:>20} {:>20} {:>10}\n",
        metric.layer(),
        "",
        "flicker",
        "lag_p50",
        "lag_p99",
        "ghost_p99"
    );
    if rows.is_empty() { rows } else { head + &rows }
}

/// What of the errors is of bounces that points leave out.
fn parts(sweep: &Sweep, metric: &Metric) -> String {
    let with_parts = sweep.points.iter().filter_map(|point| Some((point, point.measured()?.error_parts.as_ref()?)));
    let row = |(point, parts): (&Point, &ErrorParts)| {
        let [left_out, method] = [&parts.left_out, &parts.method].map(|errors| metric.told(errors).map_or("-".to_owned(), |told| told.sentence()));
        format!("{:<4} {:>8} {left_out:>26} {method:>26}\n", point.id, parts.bounces)
    };
    let rows: String = with_parts.map(row).collect();
    let head = format!("\n{metric} in two parts\n{:<4} {:>8} {:>26} {:>26}\n", "", "bounces", "light left out", "method");
    if rows.is_empty() { rows } else { head + &rows }
}

fn row(point: &Point, name: &str, widest: usize, metric: &Metric) -> String {
    let mut text = format!("{:<4} {name:<widest$} ", point.id);
    let _ = match &point.outcome {
        Outcome::Measured(measured) => writeln!(text, "{}{:>7}", numbers(measured, metric), if point.pareto { "*" } else { "" }),
        Outcome::Refused { because } => writeln!(text, "refused: {because}"),
        // A survey measures pipelines alone.
        Outcome::Given(_) | Outcome::Open => writeln!(text, "not measured yet"),
    };
    text
}

fn numbers(measured: &Measured, metric: &Metric) -> String {
    let seconds = &measured.seconds;
    format!(
        "{:>9} {:>21} {:>8} {:>10.1} {:>26}",
        significant(seconds.median),
        format!("{} … {}", significant(seconds.lower_quartile), significant(seconds.upper_quartile)),
        count(measured.records.irradiance),
        measured.peak_gpu_bytes as f64 / f64::from(1 << 20),
        metric.told(&measured.errors).map_or("-".to_owned(), |told| told.sentence()),
    )
}

/// What a reader must know before trusting the numbers.
pub fn warnings(sweep: &Sweep, survey: &Survey) -> Vec<String> {
    let (metric, cost) = (&survey.metric, &survey.cost);
    let measured = || sweep.points.iter().filter_map(|point| Some((point, point.measured()?)));
    let unfinished = measured()
        .filter(|(_, measured)| !measured.complete)
        .map(|(point, _)| format!("warning: {} {}: its pictures are unfinished; it is left out of the front", point.id, point.name(&sweep.over)));
    let other = measured().filter(|(_, measured)| !measured.pictures_repeat);
    let other = other.map(|(point, _)| format!("warning: {} {}: its runs did not make the same picture to the bit", point.id, point.name(&sweep.over)));
    let unjudged = measured().filter(|(_, measured)| metric.of(&measured.errors).is_none()).count();
    let unjudged =
        (sweep.reference.is_some() && unjudged > 0).then(|| format!("note: {unjudged} points have no {metric}; they are left out of front and plot"));
    let untimed = measured().filter(|(_, measured)| cost.of(measured).is_none()).count();
    let untimed =
        (untimed > 0).then(|| format!("note: {untimed} points have no {cost}: the adapter tells no time of nodes; they are left out of front and plot"));
    let approximated = sweep.approximated.iter().map(|what| format!("note: {what}"));
    approximated.chain(unfinished).chain(other).chain(unjudged).chain(untimed).collect()
}

/// What the page shows; pipelines and plans are those of the points.
pub fn report(sweep: &Sweep, survey: &Survey, pipelines: &[Pipeline], plans: &[Option<Arc<Plan>>]) -> Report {
    let beside = |(pipeline, plan): (&Pipeline, &Option<Arc<Plan>>)| Beside {
        text: pipeline.to_ron(),
        dropped: plan.as_ref().map_or(Vec::new(), |plan| dropped(plan)),
        start_up_seconds: None,
    };
    let beside = pipelines.iter().zip(plans).map(beside).collect();
    let points = match sweep.points.len() {
        1 => "one point".to_owned(),
        points => format!("{points} points"),
    };
    let mut report = Report::new(format!("{}: {points} measured", sweep.scene), sweep.clone(), &survey.metric, &survey.cost, beside);
    report.warnings = warnings(sweep, survey);
    if !sweep.expected.is_empty() {
        report.expectations = expectations::rows(&sweep.expected);
    }
    report
}

/// A row a point, headed by names with units; a cell is empty where there is no number.
pub fn csv(sweep: &Sweep, survey: &Survey) -> String {
    let nodes = nodes(&sweep.points);
    let rows: Vec<Vec<Cell>> = sweep.points.iter().map(|point| cells(sweep, point, &nodes, survey)).collect();
    let head = rows.first().map(|row| line(row.iter().map(|(name, _)| name)));
    head.into_iter().chain(rows.iter().map(|row| line(row.iter().map(|(_, value)| value)))).collect()
}

/// All nodes that ran, each once.
fn nodes(points: &[Point]) -> Vec<&str> {
    let mut nodes: Vec<&str> = Vec::new();
    for pass in points.iter().filter_map(Point::measured).flat_map(|measured| &measured.passes) {
        if !nodes.contains(&pass.node.as_str()) {
            nodes.push(&pass.node);
        }
    }
    nodes
}

fn cells(sweep: &Sweep, point: &Point, nodes: &[&str], survey: &Survey) -> Vec<Cell> {
    let (state, because) = match &point.outcome {
        Outcome::Measured(_) => ("measured", None),
        Outcome::Refused { because } => ("refused", Some(because)),
        Outcome::Given(_) => ("given", None),
        Outcome::Open => ("open", None),
    };
    let mut cells =
        vec![cell("id", Some(&point.id)), cell("row", Some(&point.row)), cell("pipeline", Some(&point.pipeline)), cell("set", Some(point.set.join(" ")))];
    cells.extend(sweep.over.iter().map(|axis| cell(&axis.parameter, point.values.get(&axis.parameter))));
    cells.extend([cell("state", Some(state)), cell("because", because), cell("pareto", Some(point.pareto))]);
    cells.extend([
        cell("scene", Some(&sweep.scene)),
        cell("camera", Some(&sweep.camera)),
        cell("width", Some(sweep.size[0])),
        cell("height", Some(sweep.size[1])),
        cell("adapter", Some(&sweep.adapter.name)),
        cell("runs", Some(sweep.runs)),
    ]);
    cells.extend(of_costs(point.measured()));
    if matches!(survey.cost, Cost::PerRecord(_)) {
        cells.push(cell("ms_per_record", point.measured().and_then(|measured| survey.cost.of(measured))));
    }
    if !survey.moved.is_empty() {
        cells.extend(of_traffic(point.traffic));
    }
    cells.extend(of_errors(point.measured().map_or(&VariantErrors::default(), |measured| &measured.errors)));
    cells.extend(sweep.frames().into_iter().flat_map(|_| of_courses(point.measured())));
    if sweep.points.iter().filter_map(Point::measured).any(|measured| measured.error_parts.is_some()) {
        let parts = point.measured().and_then(|measured| measured.error_parts.as_ref());
        let of = |errors: Option<&VariantErrors>| errors.and_then(|errors| survey.metric.of(errors));
        cells.push(cell(format!("{}_left_out", survey.metric), of(parts.map(|parts| &parts.left_out))));
        cells.push(cell(format!("{}_method", survey.metric), of(parts.map(|parts| &parts.method))));
    }
    cells.extend(nodes.iter().flat_map(|node| of_node(node, point.measured())));
    cells
}

fn of_costs(measured: Option<&Measured>) -> Vec<Cell> {
    let seconds = measured.map(|measured| measured.seconds);
    vec![
        cell("seconds_median", seconds.map(|seconds| seconds.median)),
        cell("seconds_lower_quartile", seconds.map(|seconds| seconds.lower_quartile)),
        cell("seconds_upper_quartile", seconds.map(|seconds| seconds.upper_quartile)),
        cell("seconds_least", seconds.map(|seconds| seconds.least)),
        cell("seconds_most", seconds.map(|seconds| seconds.most)),
        cell("records", measured.and_then(|measured| measured.records.irradiance)),
        cell("fill_rounds", measured.and_then(|measured| measured.fill_rounds)),
        cell("uncovered_pixels", measured.and_then(|measured| measured.uncovered_pixels)),
        cell("complete", measured.map(|measured| measured.complete)),
        cell("pictures_repeat", measured.map(|measured| measured.pictures_repeat)),
        cell("peak_gpu_bytes", measured.map(|measured| measured.peak_gpu_bytes)),
    ]
}

/// How the light of a sequence differs from the truth in time.
fn of_courses(measured: Option<&Measured>) -> Vec<Cell> {
    let of_layer = |layer: &str| {
        let course = measured.and_then(|measured| measured.courses.get(layer));
        let cell = |name: &str, value: Option<f64>| cell(format!("{layer}_{name}"), value);
        [
            cell("flicker", course.and_then(|course| course.flicker)),
            cell("jumps", course.map(|course| course.jumps as f64)),
            cell("lag_p50", course.and_then(|course| course.lag_p50)),
            cell("lag_p99", course.and_then(|course| course.lag_p99)),
            cell("ghost_p99", course.and_then(|course| course.ghost_p99)),
        ]
    };
    [IRRADIANCE, PICTURE].into_iter().flat_map(of_layer).collect()
}

/// For each tile.
fn of_traffic(traffic: Option<Traffic>) -> [Cell; 3] {
    [
        cell("read_bytes_per_tile", traffic.map(|traffic| traffic.read_bytes)),
        cell("written_bytes_per_tile", traffic.map(|traffic| traffic.written_bytes)),
        cell("read_back_bytes_per_tile", traffic.map(|traffic| traffic.read_back_bytes)),
    ]
}

fn of_node(node: &str, measured: Option<&Measured>) -> [Cell; 2] {
    let pass = measured.and_then(|measured| measured.passes.iter().find(|pass| pass.node == node));
    [cell(format!("{node}_gpu_ms"), pass.and_then(|pass| pass.gpu_ms)), cell(format!("{node}_cpu_ms"), pass.and_then(|pass| pass.cpu_ms))]
}
