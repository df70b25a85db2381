//! `hemisplat study`

use super::console::Console;
use super::failure::Failure;
use super::input::read_file;
use super::scene::{SceneOptions, ViewOptions};
use super::sequence::SequenceOptions;
use super::survey::{self, Reference, SurveyOptions};
use super::sweep::axes;
use super::truth::TruthOptions;
use crate::measure::criteria::{Cost, Metric};
use crate::measure::expectation::Quantity;
use crate::measure::study::{self, Study, embedded};
use crate::pipeline::diagnostics::known;
use crate::pipeline::{Problem, Problems};
use crate::reference::Pixels;
use clap::Args;
use std::io;
use std::path::{Path, PathBuf};

/// The longest study that is read.
const MOST_STUDY_BYTES: u64 = 1 << 20;

/// Take a measurement that is written down in a file: errors and costs of rows of pipelines
#[derive(Args)]
#[command(after_help = "Example: hemisplat study compensation -o out/compensation --svg out/compensation.svg --markdown out/compensation.md

The file says scene, reference, rows and what is swept; options change it. Every point is kept in DIR when it is measured: the same command goes on
where an earlier one was stopped. Status 1 if a point is refused; the others are measured all the same.")]
pub struct Options {
    /// A file, or the name of a study that ships
    #[arg(value_name = "STUDY")]
    study: String,
    /// Another scene than the study's, with its own camera
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    view: ViewOptions,
    /// Only this row of the study, and the one that judges, if one does; may be repeated
    #[arg(long = "row", value_name = "NAME")]
    rows: Vec<String>,
    /// Other values of a parameter that the study sweeps; may be repeated
    #[arg(long, value_name = "NODE.PARAM=VALUE,…")]
    over: Vec<String>,
    /// Runs of each point instead of the study's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=500))]
    runs: Option<u16>,
    /// The error of tables, front and plot instead of the study's; picture.METRIC is that of the whole picture
    #[arg(long, value_name = "METRIC")]
    metric: Option<Metric>,
    /// What that error is held against instead of the study's: Seconds, Records or PerRecord(["NODE", …])
    #[arg(long, value_name = "COST")]
    cost: Option<String>,
    /// Rays per pixel of a reference that is traced, instead of the study's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1 << 24))]
    reference_spp: Option<u32>,
    /// Where references that are traced are kept; the user's cache folder if not given
    #[arg(long, value_name = "DIR")]
    reference_cache: Option<PathBuf>,
    #[command(flatten)]
    work: SurveyOptions,
}

pub fn run(options: Options, console: &Console) -> Result<(), Failure> {
    let (mut study, folder) = find(&options.study)?;
    for row in &mut study.survey.rows {
        row.pipeline = beside(folder.as_deref(), &row.pipeline).display().to_string();
    }
    keep_rows(&mut study, &options.rows)?;
    sweep_over(&mut study, &options.over)?;
    study.survey.runs = options.runs.unwrap_or(study.survey.runs);
    study.survey.metric = options.metric.unwrap_or(study.survey.metric);
    if let Some(cost) = &options.cost {
        study.survey.cost = Cost::parse("--cost", cost).map_err(|problem| Failure::input(Problems(vec![problem])))?;
        study.survey.expected.retain(|expected| !matches!(expected.of, Quantity::Cost));
    }
    if options.scene.is_some() || options.view.is_given() || options.reference_spp.is_some() {
        tell_unchecked(&mut study, console);
    }
    let reference = match study.reference {
        study::Reference::Row(row) => Reference::Row(row),
        study::Reference::Traced { spp, stride, windows } => Reference::Outside(TruthOptions::traced(
            options.reference_spp.unwrap_or(spp),
            windows.map_or(Pixels::Every(stride), Pixels::Windows),
            options.reference_cache,
        )),
    };
    // Another scene has other cameras.
    let camera = study.camera.as_ref().filter(|_| options.scene.is_none());
    let view = options.view.or(camera, study.size);
    let scene = options.scene.unwrap_or_else(|| beside(folder.as_deref(), &study.scene));
    survey::run(&study.survey, (&SceneOptions::new(scene, view), &SequenceOptions::none()), &reference, &options.work, console)
}

/// Of another view nothing is expected.
fn tell_unchecked(study: &mut Study, console: &Console) {
    if !study.survey.expected.is_empty() {
        console.note("note: what the study expects is of its own scene, view and reference: it is not checked here");
        study.survey.expected.clear();
    }
}

/// Leaves the rows that are asked for, and the one that judges them; all where none is named.
fn keep_rows(study: &mut Study, asked: &[String]) -> Result<(), Failure> {
    let rows = &mut study.survey.rows;
    if let Some(unknown) = asked.iter().find(|name| rows.iter().all(|row| row.name != **name)) {
        let help = known(unknown, rows.iter().map(|row| row.name.as_str()), "it has");
        return Err(Failure::input(Problem::new("study::unknown_row", format!("the study has no row `{unknown}`")).help(help)));
    }
    let judge = match study.reference {
        study::Reference::Row(judge) => Some(rows[judge].name.clone()),
        study::Reference::Traced { .. } => None,
    };
    rows.retain(|row| asked.is_empty() || asked.contains(&row.name) || judge.as_ref() == Some(&row.name));
    if let Some(index) = judge.and_then(|judge| rows.iter().position(|row| row.name == judge)) {
        study.reference = study::Reference::Row(index);
    }
    Ok(())
}

/// Gives parameters that are swept other values.
fn sweep_over(study: &mut Study, over: &[String]) -> Result<(), Failure> {
    for axis in axes(over)? {
        let swept = &mut study.survey.over;
        match swept.iter_mut().find(|own| own.parameter == axis.parameter) {
            Some(own) => *own = axis,
            None => {
                let help = known(&axis.parameter, swept.iter().map(|own| own.parameter.as_str()), "it sweeps");
                let message = format!("the study does not sweep `{}`", axis.parameter);
                return Err(Failure::input(Problem::new("study::not_swept", message).help(help)));
            }
        }
    }
    Ok(())
}

/// A study, and the folder that it stands in; one that ships stands in none.
fn find(name: &str) -> Result<(Study, Option<PathBuf>), Failure> {
    let path = Path::new(name);
    let file = read_file(path, MOST_STUDY_BYTES);
    let (name, text, folder) = match file {
        Ok(bytes) => {
            let text = String::from_utf8(bytes).map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is no text in UTF-8"));
            (name.to_owned(), text.map_err(|error| Failure::read(path, error))?, path.parent().map(Path::to_owned))
        }
        Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::IsADirectory) => {
            let (file, text) = embedded::find(name).ok_or_else(|| not_found(name))?;
            (format!("studies/{file}"), text.to_owned(), None)
        }
        Err(error) => return Err(Failure::read(path, error)),
    };
    Ok((study::read(&name, &text).map_err(Failure::input)?, folder))
}

fn not_found(name: &str) -> Failure {
    let help = known(name, embedded::EMBEDDED.iter().map(|(file, _)| *file), "besides files, these ship");
    Failure::input(Problem::new("study::not_found", format!("there is no study `{name}`")).help(help))
}

/// The file of this name in the folder, if it is there; else the name stands for itself.
fn beside(folder: Option<&Path>, name: &str) -> PathBuf {
    folder.map(|folder| folder.join(name)).filter(|path| path.is_file()).unwrap_or_else(|| name.into())
}
