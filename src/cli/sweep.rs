//! `hemisplat sweep`
//!
//! What was measured of a point is kept in a file of its own, named by the checksum of everything that the numbers depend on. It appears whole or
//! not at all, and a sweep that finds it does not measure the point again.

use super::compare::{Variant, all, failure, warn_of_unstated_bounces};
use super::console::Console;
use super::failure::{CommandError, Failure};
use super::input::read_file;
use super::interrupt::Shelter;
use super::output::{Target, expect_distinct};
use super::pipeline::{check_pipeline, plan_view};
use super::progress::Progress;
use super::scene::{SceneOptions, View};
use super::swept;
use super::truth::{Truth, TruthOptions, content};
use crate::gpu::{AskPace, Gpu, Pace};
use crate::measure::Layers;
use crate::measure::cache::Checksum;
use crate::measure::compare::{self, About, Contender, VariantErrors};
use crate::measure::plot::svg;
use crate::measure::run::{Run, RunError};
use crate::measure::sweep::{Axis, Measured, Metric, Outcome, Point, Sweep, grid, mark_front, plot};
use crate::pipeline::{Pipeline, Plan, Problems, Values};
use clap::Args;
use miette::Diagnostic;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// More points make no figure that anybody can read, and take their time to be planned.
const MAX_POINTS: usize = 1000;

/// The longest file of a point that is read.
const MOST_POINT_BYTES: u64 = 16 << 20;

/// The longest program file that is read.
const MOST_PROGRAM_BYTES: u64 = 4 << 30;

/// Tell error over time as parameters change, and which points nothing beats
#[derive(Args)]
#[command(
    after_help = "Example: hemisplat sweep irradiance --over cache.accuracy=0.1,0.2,0.4 --over tiles.resolution=16,32 --scene cornell -o out/sweep --svg out/sweep.svg

Several parameters make a grid; several pipelines are each swept. Every point is kept in DIR when it is measured: the same command goes on where an
earlier one was stopped. Status 1 if a point is refused; the others are measured all the same."
)]
pub struct Options {
    /// Pipelines: files, or names of those that ship; @ gives a parameter of this one another value
    #[arg(value_name = "PIPELINE[@NODE.PARAM=VALUE]…", required = true)]
    variants: Vec<String>,
    #[command(flatten)]
    scene: SceneOptions,
    /// A parameter of a node and the values that it takes in turn; may be repeated, for a grid
    #[arg(long, value_name = "NODE.PARAM=VALUE,VALUE,…", required = true)]
    over: Vec<String>,
    /// Change a parameter of a node in all points; may be repeated
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    sets: Vec<String>,
    /// Where each point is kept, for the same command to go on from
    #[arg(long, short, value_name = "DIR", required_unless_present = "dry_run")]
    out: Option<PathBuf>,
    /// Runs of each point
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=500))]
    runs: u16,
    /// Points that are in memory together and run in turn; an interruption loses no more than these
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=64))]
    together: u16,
    /// The error of the front and the plot; picture.METRIC is that of the whole picture
    #[arg(long, value_name = "METRIC", default_value = "irradiance.rmse_over_mean", conflicts_with = "no_reference")]
    metric: Metric,
    #[command(flatten)]
    truth: TruthOptions,
    /// Write all points as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a row for each point as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw error over time, with the Pareto front
    #[arg(long, value_name = "FILE", conflicts_with = "no_reference")]
    svg: Option<PathBuf>,
    /// List the points and what refuses them, and measure nothing
    #[arg(long)]
    dry_run: bool,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let targets = Targets::new(options)?;
    // Anything wrong with a pipeline is told before a large scene is loaded.
    let over = axes(&options.over)?;
    let (files, mut points): (Vec<String>, Vec<Point>) = points(options, &over)?.into_iter().unzip();
    let pipelines = all(files.iter().zip(&points).map(|(file, point)| check_pipeline(file, &point.set)))?;
    expect_different(&points, &pipelines, &over)?;
    let view = options.scene.load(console)?;
    let plans: Vec<Option<Plan>> = pipelines.iter().zip(&mut points).map(|(pipeline, point)| planned(pipeline, &view, point)).collect();
    if options.dry_run {
        console.print(&listed(&points, &plans, &over))?;
        return expect_none_refused(&points);
    }
    let folder = Folder::new(options)?;
    let given = options.truth.given(&view)?;
    let keeper = options.truth.keeper(&view)?;
    let gpu = Gpu::open().map_err(Failure::work)?;
    let truth = given.map_or_else(|| keeper.map(|keeper| keeper.obtain(&view, console)).transpose(), |given| Ok(Some(given)))?;
    warn_of_unstated_bounces(truth.as_ref(), console);

    let common = conditions(&view, truth.as_ref(), &gpu, options);
    let keys: Vec<String> = pipelines.iter().map(|pipeline| format!("{common}{}", pipeline.to_ron())).collect();
    let found = folder.find(&mut points, &keys, console);
    tell_what_is_there(&points, found, &folder, console);
    let mut work = Work { gpu: &gpu, view: &view, plans: &plans, keys: &keys, truth: truth.as_ref(), folder: &folder, options, points, shelter: None };
    let result = work.measure(console);
    let is_interrupted = result.as_ref().is_err_and(|failure| failure.status == 130);
    if !is_interrupted {
        result?;
    }
    let (points, _shelter) = (work.points, work.shelter);
    let sweep = sweep(options, &view, &gpu, truth.as_ref(), over, points);
    swept::warnings(&sweep, &options.metric).iter().for_each(|warning| console.note(warning));
    console.print(&swept::text(&sweep, &options.metric))?;
    targets.write(&sweep, &options.metric)?;
    if is_interrupted {
        return Err(Failure::interrupted(&[&[folder.path.as_path()], &targets.paths()[..]].concat()));
    }
    expect_none_refused(&sweep.points)
}

/// The files that the results go to, beside those of the points.
struct Targets {
    json: Option<Target>,
    csv: Option<Target>,
    svg: Option<Target>,
}

impl Targets {
    fn new(options: &Options) -> Result<Self, Failure> {
        let target = |path: &Option<PathBuf>| path.as_deref().map(Target::new).transpose();
        let targets = Self { json: target(&options.json)?, csv: target(&options.csv)?, svg: target(&options.svg)? };
        expect_distinct(&targets.paths(), &options.truth.files())?;
        Ok(targets)
    }

    fn write(&self, sweep: &Sweep, metric: &Metric) -> Result<(), Failure> {
        self.json.iter().try_for_each(|json| json.write_json(sweep))?;
        self.csv.iter().try_for_each(|csv| csv.write(swept::csv(sweep).as_bytes()))?;
        self.svg.iter().try_for_each(|figure| figure.write(svg(&plot(sweep, metric)).as_bytes()))
    }

    fn paths(&self) -> Vec<&Path> {
        self.json.iter().chain(&self.csv).chain(&self.svg).map(Target::path).collect()
    }
}

/// The parameters that are swept, each once.
fn axes(over: &[String]) -> Result<Vec<Axis>, Failure> {
    let mut axes: Vec<Axis> = Vec::new();
    for text in over {
        let Values { parameter, values } = Values::parse("--over", text).map_err(Failure::input)?;
        if axes.iter().any(|axis| axis.parameter == parameter) {
            return Err(Failure::input(CommandError::SweptTwice { parameter }));
        }
        axes.push(Axis { parameter, values });
    }
    Ok(axes)
}

/// Every pipeline's file with every combination of values.
fn points(options: &Options, over: &[Axis]) -> Result<Vec<(String, Point)>, Failure> {
    let lengths: Vec<usize> = over.iter().map(|axis| axis.values.len()).collect();
    let count = lengths.iter().fold(options.variants.len(), |count, length| count.saturating_mul(*length));
    if count > MAX_POINTS {
        return Err(Failure::input(CommandError::TooManyPoints { points: count, most: MAX_POINTS }));
    }
    let variants = options.variants.iter().map(|text| Variant::parse(text, &options.sets)).collect::<Result<Vec<_>, _>>()?;
    let places = grid(&lengths);
    let pairs = variants.iter().flat_map(|variant| places.iter().map(move |place| (variant, place)));
    Ok(pairs.enumerate().map(|(index, (variant, place))| (variant.pipeline.clone(), point(compare::letters(index), variant, over, place))).collect())
}

fn point(id: String, variant: &Variant, over: &[Axis], place: &[usize]) -> Point {
    let values = over.iter().zip(place).map(|(axis, at)| (axis.parameter.clone(), axis.values[*at].clone()));
    let swept = values.clone().map(|(parameter, value)| format!("{parameter}={value}"));
    Point {
        id,
        pipeline: variant.name.clone(),
        set: variant.sets.iter().cloned().chain(swept).collect(),
        values: values.collect(),
        outcome: Outcome::Open,
        pareto: false,
    }
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

/// The plan of a point; a point without one is refused.
fn planned(pipeline: &Pipeline, view: &View, point: &mut Point) -> Option<Plan> {
    plan_view(pipeline, view, &[]).map_err(|problems| point.outcome = Outcome::Refused { because: told(&problems) }).ok()
}

/// Several problems on one line, each with its code.
fn told(problems: &Problems) -> String {
    problems.0.iter().map(|problem| format!("{}: {problem}", problem.code)).collect::<Vec<_>>().join("; ")
}

fn listed(points: &[Point], plans: &[Option<Plan>], over: &[Axis]) -> String {
    let line = |(point, plan): (&Point, &Option<Plan>)| {
        let what = match (&point.outcome, plan) {
            (Outcome::Refused { because }, _) => format!(", refused: {because}"),
            (_, Some(plan)) => format!(", {:.1} MiB on the device", plan.memory().total() as f64 / f64::from(1 << 20)),
            _ => String::new(),
        };
        format!("{} {}{what}\n", point.id, point.name(over))
    };
    points.iter().zip(plans).map(line).collect()
}

fn expect_none_refused(points: &[Point]) -> Result<(), Failure> {
    let refused = points.iter().filter(|point| matches!(point.outcome, Outcome::Refused { .. })).count();
    if refused == 0 { Ok(()) } else { Err(Failure::work(CommandError::RefusedPoints { refused, points: points.len() })) }
}

/// Everything but the pipeline that the numbers of a point depend on.
fn conditions(view: &View, truth: Option<&Truth>, gpu: &Gpu, options: &Options) -> String {
    let adapter = &gpu.adapter;
    let reference = truth.map_or("none".to_owned(), Truth::content);
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    format!(
        "program {}\nadapter {}, {}, {}, {processors} processors\n{}\nreference {reference}\nruns {}\n",
        program(),
        adapter.name,
        adapter.backend,
        adapter.driver,
        content(view),
        options.runs
    )
}

/// The version, and the checksum of the program's file: shaders and passes stand in it.
fn program() -> String {
    let file = std::env::current_exe().and_then(|path| read_file(&path, MOST_PROGRAM_BYTES)).map(|bytes| Checksum::of(&bytes));
    format!("hemisplat {} {}", env!("CARGO_PKG_VERSION"), file.unwrap_or_default())
}

/// What the file of a point holds.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// Version of this record: 1.
    schema: u32,
    /// Everything that the numbers depend on.
    key: String,
    /// For readers: `NODE.PARAM=VALUE`.
    set: Vec<String>,
    measured: Measured,
}

/// Where the points are kept.
struct Folder {
    path: PathBuf,
}

impl Folder {
    /// Creates the folder, and tries whether it takes files.
    fn new(options: &Options) -> Result<Self, Failure> {
        let folder = Self { path: options.out.clone().unwrap_or_default() };
        Target::new(&folder.file("new"))?;
        Ok(folder)
    }

    fn file(&self, key: &str) -> PathBuf {
        self.path.join(format!("point-{}.json", Checksum::of(key.as_bytes())))
    }

    /// Takes over the points that are there; how many those are.
    fn find(&self, points: &mut [Point], keys: &[String], console: &Console) -> usize {
        let mut found = 0;
        for (point, key) in points.iter_mut().zip(keys).filter(|(point, _)| point.outcome == Outcome::Open) {
            if let Some(measured) = self.kept(key, console) {
                point.outcome = Outcome::Measured(Box::new(measured));
                found += 1;
            }
        }
        found
    }

    /// None where there is no such file, or one that is damaged.
    fn kept(&self, key: &str, console: &Console) -> Option<Measured> {
        let path = self.file(key);
        let file = read_file(&path, MOST_POINT_BYTES).ok()?;
        let kept = serde_json::from_slice::<Kept>(&file).ok().filter(|kept| kept.schema == 1 && kept.key == key);
        if kept.is_none() {
            console.note(&format!("{} is damaged: its point is measured anew", path.display()));
        }
        kept.map(|kept| kept.measured)
    }

    fn keep(&self, key: &str, point: &Point, measured: &Measured) -> Result<(), Failure> {
        let kept = Kept { schema: 1, key: key.to_owned(), set: point.set.clone(), measured: measured.clone() };
        Target::new(&self.file(key))?.write_json(&kept)
    }
}

fn tell_what_is_there(points: &[Point], found: usize, folder: &Folder, console: &Console) {
    let open = points.iter().filter(|point| point.outcome == Outcome::Open).count();
    let refused = points.len() - open - found;
    console.note(&format!("{} points: {found} found in {}, {refused} refused, {open} to measure", points.len(), folder.path.display()));
}

/// A sweep as it runs.
struct Work<'a> {
    gpu: &'a Gpu,
    view: &'a View,
    plans: &'a [Option<Plan>],
    keys: &'a [String],
    truth: Option<&'a Truth>,
    folder: &'a Folder,
    options: &'a Options,
    points: Vec<Point>,
    /// From the end of the first group on there is something to tell.
    shelter: Option<Shelter>,
}

/// A point of the group that is in memory.
type Entry<'a> = (usize, Contender<'a>, VariantErrors);

impl<'a> Work<'a> {
    /// Measures what is open, group by group; the points of a group are kept when it is done.
    fn measure(&mut self, console: &Console) -> Result<(), Failure> {
        let planned = self.points.iter().zip(self.plans).enumerate().filter_map(|(index, (point, plan))| Some((index, point, plan.as_ref()?)));
        let open: Vec<(usize, &Plan)> = planned.filter(|(_, point, _)| point.outcome == Outcome::Open).map(|(index, _, plan)| (index, plan)).collect();
        let progress = Progress::new(console, "sweeping");
        let mut done = 0;
        for group in open.chunks(usize::from(self.options.together)) {
            progress.tell(|| format!("point {} of {}", done + 1, open.len()));
            let share = |of_group: f32| (done as f32 + of_group * group.len() as f32) / open.len() as f32;
            self.measure_group(group, &|of_group| progress.report(share(of_group)))?;
            self.shelter.get_or_insert_with(Shelter::new);
            done += group.len();
        }
        Ok(())
    }

    /// `report` takes the share of the group that is done, and is false once the user asked to stop.
    fn measure_group(&mut self, group: &[(usize, &'a Plan)], report: &dyn Fn(f32) -> bool) -> Result<(), Failure> {
        let runs = usize::from(self.options.runs);
        let steps = (group.len() * (runs + 1)) as f32;
        let pace = |done: usize| move || if report(done as f32 / steps) { Pace::GoOn } else { Pace::Stop };
        let mut entries: Vec<Entry<'a>> = Vec::new();
        for (place, (index, plan)) in group.iter().enumerate() {
            match self.warm_up(plan, &pace(place)) {
                Ok((contender, picture)) => entries.push((*index, contender, self.judge(picture)?)),
                Err(error) if refuses(&error) => self.points[*index].outcome = Outcome::Refused { because: with_code(&error) },
                Err(error) => return Err(failure(error)),
            }
        }
        for round in 0..runs {
            for (place, entry) in compare::order(round, entries.len()).into_iter().enumerate() {
                let pace = pace(group.len() + round * entries.len() + place);
                // A pipeline without a loop asks for no pace.
                if pace() == Pace::Stop {
                    return Err(Failure::interrupted(&[]));
                }
                entries[entry].1.measure(&pace).map_err(failure)?;
            }
        }
        entries.into_iter().try_for_each(|entry| self.keep(entry))
    }

    fn warm_up(&self, plan: &'a Plan, pace: AskPace) -> Result<(Contender<'a>, Layers), RunError> {
        let run = Run::new(self.gpu, &self.view.scene, &self.view.bvh, plan, &self.view.camera, self.view.size)?;
        Contender::warm_up(run, pace)
    }

    fn judge(&self, picture: Layers) -> Result<VariantErrors, Failure> {
        self.truth.map_or(Ok(VariantErrors::default()), |truth| truth.judge(picture))
    }

    fn keep(&mut self, (index, contender, errors): Entry<'a>) -> Result<(), Failure> {
        let point = &mut self.points[index];
        let about = About { name: point.name(&[]), set: point.set.clone(), plan_seconds: 0.0, shaders_seconds: 0.0, errors };
        if let Some(report) = contender.report(point.id.clone(), about, usize::from(self.options.runs)) {
            let measured = Measured::from(report);
            self.folder.keep(&self.keys[index], point, &measured)?;
            point.outcome = Outcome::Measured(Box::new(measured));
        }
        Ok(())
    }
}

/// Whether it is this pipeline that cannot run, on this adapter or in this scene.
fn refuses(error: &RunError) -> bool {
    error.is_refusal() || matches!(error, RunError::NonFinite { .. })
}

fn with_code(error: &RunError) -> String {
    error.code().map_or(error.to_string(), |code| format!("{code}: {error}"))
}

fn sweep(options: &Options, view: &View, gpu: &Gpu, truth: Option<&Truth>, over: Vec<Axis>, mut points: Vec<Point>) -> Sweep {
    mark_front(&mut points, &options.metric);
    Sweep {
        schema: 1,
        scene: view.scene.name.clone(),
        triangles: view.scene.triangles.len(),
        camera: view.camera.name.clone(),
        size: view.size,
        adapter: (&gpu.adapter).into(),
        runs: usize::from(options.runs),
        complete: points.iter().all(|point| point.measured().is_some_and(|measured| measured.complete)),
        reference: truth.map(Truth::report),
        metric: options.metric.to_string(),
        over,
        points,
    }
}
