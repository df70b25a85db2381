//! A survey as tables in Markdown: errors, costs, and what nothing beats.

use super::comparison::significant;
use super::expectations;
use crate::measure::course::Course;
use crate::measure::criteria::{Cost, Metric};
use crate::measure::survey::Survey;
use crate::measure::sweep::{Outcome, Point, Sweep, best, lines};
use crate::measure::traffic::Traffic;

/// A table of errors and one of costs, each a row for each row of the survey and a column for each value, and the points that nothing beats.
pub fn markdown(sweep: &Sweep, survey: &Survey) -> String {
    let (metric, cost) = (&survey.metric, &survey.cost);
    let error = |point: &Point| told(point, metric);
    let costs = |point: &Point| cost.of(point.measured()?).map(significant);
    let unit = if metric.is_share() { " [%]" } else { "" };
    let mut parts = vec![headline(sweep)];
    if sweep.reference.is_some() {
        parts.push(by_value(sweep, &format!("{metric}{unit}"), &error));
    }
    parts.extend(in_time(sweep, metric));
    parts.push(by_value(sweep, &cost.to_string(), &costs));
    if !survey.moved.is_empty() {
        let nodes: Vec<&str> = survey.moved.iter().map(|node| node.text.as_str()).collect();
        let what = format!("KiB a tile in {}: read + written, read back", nodes.join(", "));
        parts.push(by_value(sweep, &what, &|point| point.traffic.map(moved)));
    }
    if sweep.points.iter().any(|point| point.pareto) {
        parts.push(front(sweep, metric, cost));
    }
    if !sweep.expected.is_empty() {
        parts.push(table(expectations::rows(&sweep.expected)));
    }
    parts.join("\n")
}

/// A number that tells of time.
type OfCourse = fn(&Course) -> Option<f64>;

/// Of a sequence, how light differs from the truth in time, as far as there is anything to tell.
fn in_time(sweep: &Sweep, metric: &Metric) -> Vec<String> {
    let all: [(&str, OfCourse, f64); 3] = [
        ("flicker [%]", |course| course.flicker, 100.0),
        ("lag_p99 [frames]", |course| course.lag_p99, 1.0),
        ("ghost_p99 [%]", |course| course.ghost_p99, 100.0),
    ];
    let tables = all.into_iter().filter_map(|(what, of, unit)| {
        let value = |point: &Point| point.measured().and_then(|measured| metric.course(measured)).and_then(of);
        let is_told = sweep.points.iter().any(|point| value(point).is_some());
        is_told.then(|| by_value(sweep, &format!("{}.{what}", metric.layer()), &|point| Some(significant(unit * value(point)?))))
    });
    tables.collect()
}

fn headline(sweep: &Sweep) -> String {
    let [width, height] = sweep.size;
    let against = sweep.reference.as_ref().map(|reference| match (&reference.row, &reference.samples) {
        (Some(row), _) => format!(", against `{row}`"),
        (_, Some(samples)) => format!(", against {samples} rays a pixel{}", noise(sweep)),
        _ => format!(", against {}", reference.file.as_deref().unwrap_or("the reference")),
    });
    let runs = if sweep.runs == 1 { "1 run".to_owned() } else { format!("{} runs", sweep.runs) };
    let frames = sweep.frames_told();
    format!("{}, {width}×{height}{frames}, {}, {runs} of each point{}:\n", sweep.scene, sweep.adapter.name, against.unwrap_or_default())
}

/// That of the reference, as far as it is known.
fn noise(sweep: &Sweep) -> String {
    let measured = sweep.points.iter().filter_map(Point::measured);
    let noise = measured.filter_map(|measured| measured.errors.irradiance.as_ref()?.reference_noise_over_mean).next();
    noise.map_or(String::new(), |noise| format!(", whose noise is {:.2} %", 100.0 * noise))
}

/// Without the unit, which stands above.
fn told(point: &Point, metric: &Metric) -> Option<String> {
    Some(metric.told(&point.measured()?.errors)?.sentence().replace(" %", ""))
}

fn moved(traffic: Traffic) -> String {
    let Traffic { read_bytes, written_bytes, read_back_bytes } = traffic;
    let [read, written, back] = [read_bytes, written_bytes, read_back_bytes].map(|bytes| significant(bytes / 1024.0));
    format!("{read} + {written}, {back}")
}

fn by_value(sweep: &Sweep, what: &str, cell: &dyn Fn(&Point) -> Option<String>) -> String {
    let Some(axis) = sweep.over.first() else { return String::new() };
    let head = std::iter::once(format!("{what} \\ {}", axis.parameter)).chain(axis.values.iter().cloned()).collect();
    let row = |(name, points): (String, Vec<&Point>)| {
        let at = |value: &String| points.iter().find(|point| point.values.get(&axis.parameter) == Some(value));
        std::iter::once(name).chain(axis.values.iter().map(|value| at(value).map_or("-".to_owned(), |point| shown(point, cell)))).collect()
    };
    table(std::iter::once(head).chain(lines(sweep).into_iter().map(row)).collect())
}

fn shown(point: &Point, cell: &dyn Fn(&Point) -> Option<String>) -> String {
    match &point.outcome {
        Outcome::Refused { .. } => "refused".to_owned(),
        _ => cell(point).unwrap_or_else(|| "-".to_owned()),
    }
}

fn front(sweep: &Sweep, metric: &Metric, cost: &Cost) -> String {
    let unit = if metric.is_share() { " [%]" } else { "" };
    let head = vec!["nothing beats".to_owned(), cost.unit().to_owned(), format!("{metric}{unit}")];
    let row = |(point, [cost, _]): (&Point, [f64; 2])| vec![point.name(&sweep.over), significant(cost), told(point, metric).unwrap_or_default()];
    table(std::iter::once(head).chain(best(&sweep.points, metric, cost).into_iter().map(row)).collect())
}

/// Cells padded, so that the text can be read as it stands; all columns but the first are numbers.
pub(super) fn table(rows: Vec<Vec<String>>) -> String {
    let cells: Vec<Vec<String>> = rows.into_iter().map(|row| row.into_iter().map(|cell| cell.replace('|', "\\|")).collect()).collect();
    let columns = cells.iter().map(Vec::len).max().unwrap_or(0);
    let widths: Vec<usize> =
        (0..columns).map(|column| cells.iter().filter_map(|row| Some(row.get(column)?.chars().count())).max().unwrap_or(0).max(3)).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).enumerate();
        let cells = cells.map(|(column, (cell, width))| if column == 0 { format!("{cell:<width$}") } else { format!("{cell:>width$}") });
        format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "))
    };
    let rule = widths.iter().enumerate().map(|(column, width)| if column == 0 { "-".repeat(*width) } else { "-".repeat(width - 1) + ":" });
    let rule = format!("| {} |\n", rule.collect::<Vec<_>>().join(" | "));
    cells.iter().take(1).map(line).chain([rule]).chain(cells.iter().skip(1).map(line)).collect()
}
