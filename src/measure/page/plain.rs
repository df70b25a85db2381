//! What was found as a table of plain HTML, for a page whose script is turned off.

use super::charts::Chart;
use super::escape;
use super::report::Report;
use crate::measure::sweep::Point;

/// A row for each point: its letter, what it is of, its time, its errors.
pub(super) fn table(report: &Report) -> String {
    let head = ["", "Point", "Seconds"].into_iter().chain(report.charts.iter().map(Chart::label));
    let body = report.sweep.points.iter().enumerate().map(|(index, point)| {
        let errors = report.charts.iter().map(|chart| chart.told(index));
        let cells = [point.id.clone(), point.name(&report.sweep.over), seconds(point)].into_iter().chain(errors);
        row("td", cells.map(|cell| escape(&cell)))
    });
    let body: String = body.collect();
    format!("<h1>{}</h1>\n<table><thead>{}</thead><tbody>{body}</tbody></table>", escape(&report.title), row("th", head.map(escape)))
}

fn row(tag: &str, cells: impl Iterator<Item = String>) -> String {
    let cells: String = cells.map(|cell| format!("<{tag}>{cell}</{tag}>")).collect();
    format!("<tr>{cells}</tr>\n")
}

fn seconds(point: &Point) -> String {
    point.seconds().map_or_else(|| "–".into(), |seconds| format!("{seconds:.3}"))
}
