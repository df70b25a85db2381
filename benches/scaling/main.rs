//! What costs grow with, and how fast: triangles, records, pixels, samples.
//!
//! `./bench scaling` builds and runs it; docs/scaling.md tells what came of it. `cargo test --test race` tests its list.

#[allow(dead_code, reason = "only parts of the race's modules are of use here")]
#[path = "../race/kept.rs"]
mod kept;
#[allow(dead_code, reason = "as above")]
#[path = "../race/machine.rs"]
mod machine;
mod series;

use clap::Parser;
use hemisplat::measure::{
    plot::{Line, Mark, Paper, Plot, svg},
    statistics::{Spread, slope},
};
use kept::{read, write};
use machine::{Machine, finish};
use serde::Serialize;
use serde_json::Value;
use series::{Axis, Costs, Per, Row, Scaling, Series, Setting};
use std::{
    fmt::Write,
    path::{Path, PathBuf},
    process::{Command, ExitCode},
};

type Failure = Box<dyn std::error::Error>;

/// Measure how the time of nodes grows with triangles, records, pixels and samples
#[derive(Parser)]
#[command(name = "./bench scaling")]
struct Options {
    /// One series of the list alone
    #[arg(long)]
    series: Option<String>,
    /// Runs of each point
    #[arg(long, default_value = "3", value_parser = clap::value_parser!(u32).range(1..))]
    runs: u32,
    /// Where results go
    #[arg(short, long, default_value = "benches/results")]
    out: PathBuf,
    /// Another build of hemisplat than the one beside
    #[arg(long, value_name = "FILE", default_value = env!("CARGO_BIN_EXE_hemisplat"), hide_default_value = true)]
    program: PathBuf,
    /// Write the tables here too
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// What `cargo bench` says
    #[arg(long, hide = true)]
    bench: bool,
}

/// Keys in JSON are the fields' names.
#[derive(Debug, Serialize)]
struct Report {
    /// Version of this record: 1.
    schema: u32,
    date: String,
    commit: String,
    /// Those of benches/changes.ron that this program has.
    changes: Vec<String>,
    machine: Machine,
    /// With a checksum of the program.
    hemisplat: String,
    series: Vec<Grown>,
}

/// A series as it was measured.
#[derive(Debug, Serialize)]
struct Grown {
    name: String,
    scene: String,
    x: Axis,
    /// Slopes are those of the points from here on.
    from: f64,
    points: Vec<Point>,
    lines: Vec<Curve>,
}

/// A render of the series, whichever run.
#[derive(Debug, Serialize)]
struct Point {
    row: String,
    command: String,
    triangles: u64,
    records: u64,
    rounds: u64,
    peak_gpu_bytes: u64,
    peak_host_bytes: Option<u64>,
    /// The whole command.
    seconds: Spread,
}

#[derive(Debug, Serialize)]
struct Curve {
    name: String,
    unit: &'static str,
    /// Value on the axis, milliseconds.
    places: Vec<(f64, Spread)>,
    /// Exponent of the power law through the medians.
    slope: Option<f64>,
}

/// One run of one point.
struct Run {
    command: String,
    seconds: f64,
    stats: Value,
}

fn main() -> ExitCode {
    machine::ended(measure(&Options::parse()))
}

fn measure(options: &Options) -> Result<(), Failure> {
    let text = String::from_utf8(read(&machine::root().join("benches/scaling.ron"))?)?;
    let scaling = Scaling::read(&text).and_then(|scaling| scaling.only(options.series.as_deref())).map_err(|error| format!("benches/scaling.ron: {error}"))?;
    let (commit, changes) = (machine::clean_commit()?, machine::changes()?);
    let (program, hemisplat) = machine::hemisplat(&options.program)?;
    let machine = Machine::find(&program)?;
    let series = scaling.series.iter().map(|series| grown(series, &program, options.runs)).collect::<Result<_, _>>()?;
    publish(options, &Report { schema: 1, date: machine::date()?, commit, changes, machine, hemisplat, series })
}

/// Measures a series: each round of runs goes through all of its points, so that a machine that changes its speed does so for all.
fn grown(series: &Series, program: &Path, runs: u32) -> Result<Grown, Failure> {
    let jobs: Vec<(&Row, &Setting)> = series.rows.iter().flat_map(|row| series.points.iter().map(move |point| (row, point))).collect();
    let mut found: Vec<Vec<Run>> = jobs.iter().map(|_| Vec::new()).collect();
    for round in 1..=runs {
        for ((row, point), found) in jobs.iter().zip(&mut found) {
            let run = run(series, row, point, program)?;
            eprintln!("{} {round}/{runs}: {} {:.1} s", series.name, run.command, run.seconds);
            found.push(run);
        }
    }
    let of_row = |index: usize| &found[index * series.points.len()..(index + 1) * series.points.len()];
    let curves = series.rows.iter().enumerate().flat_map(|(index, row)| row.lines.iter().map(move |costs| (index, costs)));
    let lines = curves.map(|(index, costs)| curve(series, costs, of_row(index))).collect::<Result<_, _>>()?;
    let points = jobs.iter().zip(&found).map(|((row, _), runs)| told(&row.name, runs)).collect::<Result<_, _>>()?;
    Ok(Grown { name: series.name.clone(), scene: series.scene.clone(), x: series.x, from: series.from, points, lines })
}

fn run(series: &Series, row: &Row, point: &Setting, program: &Path) -> Result<Run, Failure> {
    let folder = tempfile::tempdir()?;
    let stats = folder.path().join("out.json");
    let size = point.size.or(series.size).ok_or("a point without a size")?;
    let mut command = Command::new(program);
    command.args(["render", &row.pipeline, "--scene", &series.scene, "--size", &format!("{size}x{size}"), "--strict"]);
    command.args(point.scene_set.iter().flat_map(|set| ["--scene-set", set]));
    command.args(series.set.iter().chain(&point.set).chain(&row.set).flat_map(|set| ["--set", set]));
    let shown = command.get_args().map(|argument| argument.to_string_lossy()).collect::<Vec<_>>().join(" ");
    let done = finish(command.arg("-o").arg(folder.path().join("out.exr")).arg("--stats").arg(&stats))?;
    Ok(Run { command: format!("hemisplat {shown}"), seconds: done.seconds, stats: serde_json::from_slice(&read(&stats)?)? })
}

fn told(row: &str, runs: &[Run]) -> Result<Point, Failure> {
    let Run { command, stats, .. } = runs.last().ok_or("no runs")?;
    let number = |value: &Value| value.as_u64().ok_or_else(|| format!("{command}: a number is missing in its statistics"));
    let frame = &stats["frames"][0];
    Ok(Point {
        row: row.to_owned(),
        command: command.clone(),
        triangles: number(&stats["triangles"])?,
        records: number(&frame["records"]["irradiance"])?,
        rounds: number(&frame["fill_rounds"])?,
        peak_gpu_bytes: number(&stats["peak_gpu_bytes"])?,
        peak_host_bytes: stats["peak_host_bytes"].as_u64(),
        seconds: Spread::of(&runs.iter().map(|run| run.seconds).collect::<Vec<_>>()).ok_or("no runs")?,
    })
}

fn curve(series: &Series, costs: &Costs, points: &[Vec<Run>]) -> Result<Curve, Failure> {
    let mut places = Vec::new();
    for runs in points {
        let Run { stats, .. } = runs.last().ok_or("no runs")?;
        let times = runs.iter().map(|run| milliseconds(costs, &run.stats)).collect::<Option<Vec<_>>>();
        let x = place(series.x, stats);
        places.push(x.zip(times.and_then(|times| Spread::of(&times))).ok_or_else(|| format!("{}: nothing to measure of {}", runs[0].command, costs.name))?);
    }
    let fitted: Vec<[f64; 2]> = places.iter().filter(|(x, _)| *x >= series.from).map(|(x, time)| [*x, time.median]).collect();
    Ok(Curve { name: costs.name.clone(), unit: costs.per.label(), slope: slope(&fitted), places })
}

/// The time of the nodes of a line; None where the frame has none of them.
fn milliseconds(costs: &Costs, stats: &Value) -> Option<f64> {
    let frame = &stats["frames"][0];
    let own = frame["passes"].as_array()?.iter().filter(|pass| pass["node"].as_str().is_some_and(|node| costs.holds(node)));
    let times = own.map(|pass| Some(pass["gpu_ms"].as_f64().unwrap_or(0.0) + pass["cpu_ms"].as_f64()?)).collect::<Option<Vec<_>>>()?;
    let total = times.iter().sum::<f64>();
    match costs.per {
        _ if times.is_empty() => None,
        Per::Record => Some(total / frame["records"]["irradiance"].as_f64()?),
        Per::Frame => Some(total),
    }
}

/// Where a run stands on the axis.
fn place(axis: Axis, stats: &Value) -> Option<f64> {
    let frame = &stats["frames"][0];
    match axis {
        Axis::Triangles => stats["triangles"].as_f64(),
        Axis::Records => frame["records"]["irradiance"].as_f64(),
        Axis::Pixels => Some(stats["size"][0].as_f64()? * stats["size"][1].as_f64()?),
        Axis::Samples => {
            let mut sets = frame["set"].as_array()?.iter().rev().filter_map(Value::as_str);
            let edge: f64 = sets.find_map(|set| set.strip_prefix("tiles.resolution="))?.parse().ok()?;
            Some(edge * edge)
        }
    }
}

/// Tables on the terminal, everything else into files.
fn publish(options: &Options, report: &Report) -> Result<(), Failure> {
    let tables = markdown(report);
    let only = options.series.as_ref().map_or(String::new(), |series| format!("-{series}"));
    let name = |ending: &str| options.out.join(format!("{}-scaling{ending}", report.date));
    write(&name(&format!("{only}.json")), &(serde_json::to_string_pretty(report)? + "\n"))?;
    for series in &report.series {
        write(&name(&format!("-{}.svg", series.name)), &svg(&plot(series, &report.machine), Paper::Wide))?;
    }
    options.markdown.iter().try_for_each(|file| write(file, &tables))?;
    println!("{tables}\nwritten: {}", name(&format!("{only}.json")).display());
    Ok(())
}

fn markdown(report: &Report) -> String {
    let Machine { cores, cpu, adapter, .. } = &report.machine;
    let commit = &report.commit;
    let mut text =
        format!("{}, commit {commit}: {cores} cores ({}), {adapter}; hemisplat {}.\n", report.date, cpu.as_deref().unwrap_or("unknown"), report.hemisplat);
    for series in &report.series {
        let _ = write!(text, "\n### {}, in {}\n\n| | slope |", series.name, series.scene);
        let places = series.lines.first().map(|line| &line.places[..]).unwrap_or_default();
        places.iter().for_each(|(x, _)| text += &format!(" {x} |"));
        text += &format!("\n|---|---|{}\n", "---|".repeat(places.len()));
        for Curve { name, unit, places, slope } in &series.lines {
            let _ = write!(text, "| {name} [{unit}] | {} |", slope.map_or("-".to_owned(), |slope| format!("{slope:.2}")));
            places.iter().for_each(|(_, time)| text += &format!(" {:.3} |", time.median));
            text += "\n";
        }
        for Point { row, records, rounds, seconds, peak_gpu_bytes, peak_host_bytes, command, .. } in &series.points {
            let memory = peak_host_bytes.map_or("-".to_owned(), |bytes| format!("{}", bytes >> 20));
            let (device, seconds) = (peak_gpu_bytes >> 20, seconds.median);
            let _ =
                write!(text, "\n- {row}: {records} records in {rounds} rounds, {seconds:.1} s, {device} MiB on the device, {memory} MiB in all: `{command}`");
        }
        text += "\n";
    }
    text
}

fn plot(series: &Grown, machine: &Machine) -> Plot {
    let label = |curve: &Curve| curve.slope.map_or_else(|| curve.name.clone(), |slope| format!("{}: slope {slope:.2}", curve.name));
    let mark = |curve: &Curve, (x, time): &(f64, Spread)| Mark {
        id: format!("{} {x}", curve.name),
        label: None,
        about: format!("{} at {x}: {:.3} {}", curve.name, time.median, curve.unit),
        x: *x,
        x_spread: [*x; 2],
        y: time.median,
        y_spread: [time.median; 2],
        is_limit: false,
        is_on_front: false,
    };
    Plot {
        title: format!("{}: {}, {} cores", series.name, series.scene, machine.cores),
        x_label: series.x.label().into(),
        y_label: series.lines.first().map_or(String::new(), |line| line.unit.into()),
        label_of_marks: String::new(),
        lines: series.lines.iter().map(|curve| Line { name: label(curve), marks: curve.places.iter().map(|place| mark(curve, place)).collect() }).collect(),
    }
}
