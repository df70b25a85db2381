//! The report as tables in Markdown and as a figure.

use crate::{
    curve::{Factor, Metric, Ratio, Reading, Sample},
    report::{Level, Point, Report, Scene},
    settings::Program,
};
use hemisplat::math::windows::SIDE;
use hemisplat::measure::plot::{Line, Mark, Plot};
use std::fmt::Write;

/// What a curve says beyond its ends.
const OUT_OF_RANGE: &str = "out of range";

pub fn markdown(report: &Report) -> String {
    let Report { date, machine, versions, size, truth, bounces, .. } = report;
    let bounces = if *bounces == 1 { "one bounce".to_owned() } else { format!("{bounces} bounces") };
    let cpu = [&[machine.cpu.clone().unwrap_or("processor unknown".into())][..], &machine.caches].concat().join(", ");
    let mut text = format!(
        "{date}, commit {}: {size}×{size} pixels, {bounces}; {} cores ({cpu}), {}; hemisplat {}, Radiance by {}, Mitsuba {}, Open Image Denoise by {}; runs in which others had more than {} of the processors' time were thrown away; \
         truth by Mitsuba, {} rays at one pixel of {stride}×{stride} and in {windows} windows of {side}×{side} pixels (`band_error`, `rmse_interior`, `rmse_edges`).\n",
        report.commit.as_deref().unwrap_or("unknown"),
        machine.cores,
        machine.adapter,
        versions.hemisplat,
        versions.radiance,
        versions.mitsuba,
        versions.denoiser,
        percent(report.others_at_most),
        truth.samples,
        stride = truth.stride,
        windows = truth.windows,
        side = SIDE
    );
    for scene in &report.scenes {
        let _ = write!(text, "\n### {}\n\n{}\n{}", scene.scene, points(scene), levels(&scene.equal_error));
        if !scene.as_shipped.is_empty() {
            let _ = write!(text, "\nAt each error of what ships:\n\n{}", levels(&scene.as_shipped));
        }
    }
    text
}

/// Seconds with three digits that count.
fn round(seconds: f64) -> String {
    let digits = (2 - seconds.log10().floor() as i32).clamp(0, 2) as usize;
    format!("{seconds:.digits$}")
}

fn percent(value: f64) -> String {
    format!("{:.2} %", value * 100.0)
}

fn share(value: Option<f64>) -> String {
    value.map_or_else(|| "not measurable".to_owned(), percent)
}

fn points(scene: &Scene) -> String {
    let mut text = String::from(
        "| program | settings | seconds | others had | `rmse_over_mean` | `bias_over_mean` | `block_p50` | `block_p99` | `band_error` | `rmse_interior` | `rmse_edges` | on its curve |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for Point { program, name, seconds, seconds_of_runs, others, errors, in_windows, is_on_curve, .. } in &scene.points {
        let range = if seconds_of_runs.len() > 1 { format!(" ({}…{})", round(seconds.least), round(seconds.most)) } else { String::new() };
        let shares = [errors.block_p50, errors.block_p99, in_windows.band_error, in_windows.rmse_interior, in_windows.rmse_edges].map(share).join(" | ");
        let _ = writeln!(
            text,
            "| {} | `{name}` | {}{range} | {} | {} | {:+.2} % | {shares} | {} |",
            program.name(),
            round(seconds.median),
            others.map_or_else(|| "unknown".to_owned(), |others| format!("{:.1} %", others * 100.0)),
            percent(errors.rmse_over_mean),
            errors.bias_over_mean * 100.0,
            if *is_on_curve { "yes" } else { "" }
        );
    }
    text
}

fn levels(levels: &[Level]) -> String {
    let names = Program::ALL.map(Program::name);
    let ratios = names[..3].iter().map(|name| format!("{name} / hemisplat")).collect::<Vec<_>>().join(" | ");
    let mut text = format!("| of | at | {} | {ratios} | hemisplat is worse in |\n|{}\n", names.join(" | "), "---|".repeat(10));
    for Level { of, metric, error, readings, over_hemisplat, hemisplat_is_worse_in } in levels {
        let _ = writeln!(
            text,
            "| {} | `{}` {} | {} | {} | {} |",
            of.name(),
            metric.name(),
            percent(*error),
            Program::ALL.map(|program| seconds(readings.get(program), *metric)).join(" | "),
            [Program::Radiance, Program::Mitsuba, Program::Denoised].map(|program| factor(*over_hemisplat.get(program))).join(" | "),
            if *of == Program::Hemisplat { "–".to_owned() } else { worse(hemisplat_is_worse_in.as_deref()) }
        );
    }
    text
}

fn seconds(reading: &Reading, metric: Metric) -> String {
    let told = |word: &str, sample: &Sample| format!("{OUT_OF_RANGE} ({word}: {} in {} s)", percent(sample.error(metric)), round(sample.seconds.median));
    match reading {
        Reading::At(sample) => format!("{} s", round(sample.seconds.median)),
        Reading::NotReached(best) => told("its best", best),
        Reading::Exceeded(fastest) => told("its fastest", fastest),
    }
}

fn factor(factor: Factor) -> String {
    match factor {
        Factor::Is(Ratio { median, least, most }) => format!("{median:.2} ({least:.2}…{most:.2})"),
        Factor::MoreThan(bound) => format!("> {bound:.2}"),
        Factor::LessThan(bound) => format!("< {bound:.2}"),
        Factor::Unknown => OUT_OF_RANGE.to_owned(),
    }
}

fn worse(errors: Option<&[&str]>) -> String {
    match errors {
        None => OUT_OF_RANGE.to_owned(),
        Some([]) => "nothing".to_owned(),
        Some(errors) => format!("**{}**", errors.join(", ")),
    }
}

/// The curves of all programs on one scene: points that another one of their program beats are left out.
pub fn plot(report: &Report, scene: &Scene) -> Plot {
    Plot {
        title: format!("{}: {2}×{2} pixels, {1} cores", scene.scene, report.machine.cores, report.size),
        x_label: "seconds".into(),
        y_label: "rmse_over_mean [%]".into(),
        label_of_marks: String::new(),
        lines: Program::ALL.map(|program| line(scene, program)).into(),
    }
}

fn line(scene: &Scene, program: Program) -> Line {
    let mut points: Vec<&Point> = scene.points.iter().filter(|point| point.program == program && point.is_on_curve).collect();
    points.sort_by(|a, b| a.seconds.median.total_cmp(&b.seconds.median));
    Line { name: program.name().to_owned(), marks: points.into_iter().map(|point| mark(scene, point)).collect() }
}

fn mark(scene: &Scene, point: &Point) -> Mark {
    let (seconds, error) = (point.seconds, point.errors.rmse_over_mean * 100.0);
    Mark {
        id: format!("{} {} {}", scene.scene, point.program.name(), point.name),
        label: None,
        about: format!("{} {}: {} s, {error:.2} %", point.program.name(), point.name, round(seconds.median)),
        x: seconds.median,
        x_spread: [seconds.least, seconds.most],
        y: error,
        y_spread: [error; 2],
        is_limit: false,
        is_on_front: false,
    }
}
