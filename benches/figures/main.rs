//! Writes the figures of README and the book from what is kept of measurements, and measures those that are asked for anew.
//!
//! `./bench docs` builds and runs it; docs/bench.md tells how a table comes to its figures. `cargo test --test figures` compares text and data.

mod data;
#[path = "../race/kept.rs"]
#[allow(dead_code, reason = "only parts of the race's modules are of use here")]
mod kept;
#[path = "../race/machine.rs"]
#[allow(dead_code, reason = "as above")]
mod machine;
mod measure;
mod pages;
mod template;

use clap::Parser;
use data::{Kind, Lists, Measurement};
use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
};

type Failure = Box<dyn std::error::Error>;

/// Write the figures of README and docs from benches/results, after measuring what is asked for
#[derive(Parser)]
#[command(name = "./bench docs", after_help = "Example: ./bench docs --measure spacing")]
struct Options {
    /// Measure this one of benches/figures/measurements.ron before; may be repeated
    #[arg(long, value_name = "NAME")]
    measure: Vec<String>,
    /// Measure all that tell times: let nothing else run meanwhile
    #[arg(long)]
    times: bool,
    /// Measure all that tell errors and counts alone
    #[arg(long)]
    errors: bool,
    /// List the measurements, and what each is older than
    #[arg(long)]
    list: bool,
    /// Another build of hemisplat than the one beside
    #[arg(long, value_name = "FILE", default_value = env!("CARGO_BIN_EXE_hemisplat"), hide_default_value = true)]
    program: PathBuf,
    /// What `cargo bench` says
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    machine::ended(run(&Options::parse()))
}

fn run(options: &Options) -> Result<(), Failure> {
    let root = machine::root();
    let lists = Lists::read(root)?;
    if options.list {
        list(root, &lists);
        return Ok(());
    }
    for measurement in asked(options, &lists)? {
        measure::measure(root, measurement, &options.program).map_err(|error| format!("{}: {error}", measurement.name))?;
    }
    let mut used = BTreeSet::new();
    for page in pages::pages(root)? {
        let path = root.join(&page);
        let text = fs::read_to_string(&path)?;
        let renewed = pages::renewed(root, &lists, &text, &mut used).map_err(|error| format!("{}: {error}", page.display()))?;
        if renewed != text {
            println!("{}", page.display());
            kept::write(&path, &renewed)?;
        }
    }
    Ok(())
}

fn asked<'l>(options: &Options, lists: &'l Lists) -> Result<Vec<&'l Measurement>, Failure> {
    let mut asked = options.measure.iter().map(|name| lists.measurement(name)).collect::<Result<Vec<_>, _>>()?;
    let times = |measurement: &&Measurement| measurement.tells.contains(&Kind::Times);
    asked.extend(lists.measurements.iter().filter(|measurement| options.times && times(measurement) || options.errors && !times(measurement)));
    Ok(asked)
}

fn list(root: &Path, lists: &Lists) {
    for measurement in &lists.measurements {
        let state = match lists.kept(root, &measurement.name) {
            Ok(Some(kept)) if lists.since(&kept).is_empty() => "of today's program".to_owned(),
            Ok(Some(kept)) => format!("before: {}", lists.since(&kept).join("; ")),
            Ok(None) => "not kept yet".to_owned(),
            Err(error) => error.to_string(),
        };
        println!("{}: {state}", measurement.name);
        measurement.commands.iter().for_each(|command| println!("    {command}"));
    }
}
