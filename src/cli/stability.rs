//! `hemisplat stability`

use super::console::Console;
use super::failure::{CommandError, Failure};
use super::output::Target;
use super::pipeline::{check_pipeline, load_pipeline};
use super::progress::Progress;
use crate::gpu::{Adapter, Gpu, block_on};
use crate::measure::stability::{Bench, CASES, Case, Outcome, Verdict};
use crate::pipeline::embedded::EMBEDDED;
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;

/// Run pipelines where numbers break: scales, brightness, samples, lenses, degenerate scenes
#[derive(Args)]
#[command(after_help = "Example: hemisplat stability irradiance --json out/stability.json

Without a pipeline, all that ship run. Every picture is also checked to be finite, not negative, covered, and the same twice. Status 1 if a
case fails.")]
pub struct Options {
    /// Pipelines: files, or names of those that ship
    #[arg(value_name = "PIPELINE")]
    pipelines: Vec<String>,
    /// Change a parameter of a node in all of them; may be repeated
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    sets: Vec<String>,
    /// Only this case; may be repeated
    #[arg(long, value_name = "CASE", value_parser = clap::builder::PossibleValuesParser::new(CASES.iter().map(|case| case.name)))]
    only: Vec<String>,
    /// Write everything that was found as JSON; - is standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What all pipelines did, as JSON has it.
#[derive(Serialize)]
struct Report<'a> {
    schema: u32,
    adapter: &'a Adapter,
    pipelines: Vec<PipelineReport>,
}

#[derive(Serialize)]
struct PipelineReport {
    pipeline: String,
    cases: Vec<Outcome>,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let json = options.json.as_deref().map(Target::new).transpose()?;
    let names = names(options);
    for name in &names {
        load_pipeline(name, &options.sets)?;
    }
    let cases: Vec<&Case> = CASES.iter().filter(|case| options.only.is_empty() || options.only.iter().any(|only| only == case.name)).collect();
    let gpu = block_on(Gpu::open()).map_err(Failure::work)?;
    let progress = Progress::new(console, "stability");
    let mut pipelines = Vec::new();
    for (index, name) in names.iter().enumerate() {
        let load = |more: &[String]| check_pipeline(name, &[&options.sets, more].concat());
        let bench = Bench::new(&gpu, &load).map_err(Failure::input)?;
        let share = |done: usize| (index * cases.len() + done) as f32 / (names.len() * cases.len()) as f32;
        let mut outcomes = Vec::new();
        for (done, case) in cases.iter().enumerate() {
            progress.report(share(done));
            outcomes.push(case.run(&bench));
        }
        console.print(&table(name, &outcomes))?;
        pipelines.push(PipelineReport { pipeline: name.clone(), cases: outcomes });
    }
    let failed = failed(&pipelines);
    if let Some(json) = json {
        let report = Report { schema: 1, adapter: &gpu.adapter, pipelines };
        json.write_json(&report)?;
    }
    if failed.is_empty() { Ok(()) } else { Err(Failure::work(CommandError::Unstable { failed })) }
}

fn names(options: &Options) -> Vec<String> {
    if options.pipelines.is_empty() { EMBEDDED.iter().map(|(file, _)| format!("pipelines/{file}")).collect() } else { options.pipelines.clone() }
}

fn failed(pipelines: &[PipelineReport]) -> Vec<String> {
    let of = |report: &PipelineReport| {
        let cases = report.cases.iter().filter(|outcome| outcome.verdict == Verdict::Fail);
        cases.map(|outcome| format!("{} of {}", outcome.case, report.pipeline)).collect::<Vec<_>>()
    };
    pipelines.iter().flat_map(of).collect()
}

/// A line a case, and what it claims under it.
fn table(pipeline: &str, outcomes: &[Outcome]) -> String {
    let width = outcomes.iter().map(|outcome| outcome.case.len()).max().unwrap_or(0);
    let line = |outcome: &Outcome| {
        let verdict = match outcome.verdict {
            Verdict::Pass => "pass",
            Verdict::Fail => "FAIL",
            Verdict::DoesNotApply => "-",
        };
        format!("  {verdict:<4} {:<width$}  must hold: {}\n  {:4} {:width$}  seen:      {}\n", outcome.case, outcome.must_hold, "", "", outcome.seen)
    };
    format!("{pipeline}\n{}\n", outcomes.iter().map(line).collect::<String>())
}
