//! `hemisplat sweep`

use super::compare::Variant;
use super::console::Console;
use super::failure::{CommandError, Failure};
use super::scene::SceneOptions;
use super::sequence::SequenceOptions;
use super::survey::{self, Reference, SurveyOptions};
use super::truth::TruthOptions;
use crate::measure::criteria::{Cost, Metric};
use crate::measure::study::DEFAULT_RUNS;
use crate::measure::survey::{Row, Survey, Swept};
use crate::pipeline::{Problem, Problems, Set, Values};
use clap::Args;

/// Tell error over time as parameters change, and which points nothing beats
#[derive(Args)]
#[command(
    after_help = "Example: hemisplat sweep irradiance --over cache.accuracy=0.1,0.2,0.4 --over tiles.resolution=16,32 --scene cornell -o out/sweep --html out/sweep.html

Several parameters make a grid; several pipelines are each swept. Every point is kept in DIR when it is measured: the same command goes on where an
earlier one was stopped. Status 1 if a point is refused; the others are measured all the same.",
    mut_arg("svg", |svg| svg.conflicts_with("no_reference")),
    mut_arg("frames", |frames| frames.conflicts_with_all(["reference", "html"]))
)]
pub struct Options {
    /// Pipelines: files, or names of those that ship; @ gives a parameter of this one another value
    #[arg(value_name = "PIPELINE[@NODE.PARAM=VALUE]…", required = true)]
    variants: Vec<String>,
    #[command(flatten)]
    scene: SceneOptions,
    #[command(flatten)]
    sequence: SequenceOptions,
    /// A parameter of a node and the values that it takes in turn; may be repeated, for a grid
    #[arg(long, value_name = "NODE.PARAM=VALUE,VALUE,…", required = true)]
    over: Vec<String>,
    /// Change a parameter of a node in all points; may be repeated
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    sets: Vec<String>,
    /// Runs of each point
    #[arg(long, value_name = "N", default_value_t = DEFAULT_RUNS, value_parser = clap::value_parser!(u16).range(1..=500))]
    runs: u16,
    /// The error of tables, front and plot; picture.METRIC is that of the whole picture
    #[arg(long, value_name = "METRIC", default_value_t = Metric::default(), conflicts_with = "no_reference")]
    metric: Metric,
    /// What that error is held against: Seconds, Records or PerRecord(["NODE", …])
    #[arg(long, value_name = "COST", default_value = "Seconds")]
    cost: String,
    #[command(flatten)]
    truth: TruthOptions,
    #[command(flatten)]
    work: SurveyOptions,
}

pub fn run(options: Options, console: &Console) -> Result<(), Failure> {
    let survey = Survey {
        rows: options.variants.iter().map(|text| row(text, &options.sets)).collect::<Result<_, _>>()?,
        over: axes(&options.over)?,
        runs: options.runs,
        metric: options.metric,
        cost: Cost::parse("--cost", &options.cost).map_err(bad)?,
        moved: Vec::new(),
        expected: Vec::new(),
    };
    survey::run(&survey, (&options.scene, &options.sequence), &Reference::Outside(options.truth), &options.work, console)
}

fn bad(problem: Problem) -> Failure {
    Failure::input(Problems(vec![problem]))
}

fn row(text: &str, common: &[String]) -> Result<Row, Failure> {
    let Variant { name, pipeline, sets } = Variant::parse(text, common)?;
    let sets = sets.iter().map(|set| Set::parse("--set", set)).collect::<Result<_, _>>().map_err(bad)?;
    Ok(Row { name, pipeline, place: None, sets })
}

/// The parameters that are swept, each once.
pub(super) fn axes(over: &[String]) -> Result<Vec<Swept>, Failure> {
    let mut axes: Vec<Swept> = Vec::new();
    for text in over {
        let Values { parameter, values } = Values::parse("--over", text).map_err(Failure::input)?;
        if axes.iter().any(|axis| axis.parameter == parameter) {
            return Err(Failure::input(CommandError::SweptTwice { parameter }));
        }
        let sets = values.iter().map(|value| Set::parse("--over", &format!("{parameter}={value}"))).collect::<Result<_, _>>().map_err(bad)?;
        axes.push(Swept { parameter, sets });
    }
    Ok(axes)
}
