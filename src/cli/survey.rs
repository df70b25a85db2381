//! What `hemisplat sweep` and `hemisplat study` share: a survey is checked, planned, measured point by point, told and written.

use super::compare::warn_of_unstated_bounces;
use super::console::Console;
use super::exhibited;
use super::failure::{CommandError, Failure};
use super::input::read_file;
use super::interrupt::Shelter;
use super::judge::{Frames, Judge};
use super::kept::{self, Folder};
use super::output::{Target, expect_distinct};
use super::pipeline::note_names;
use super::points::{self, check, expect_none_refused, listed, planned, weigh};
use super::progress::Progress;
use super::resources::expect_memory;
use super::scene::{SceneOptions, View};
use super::sequence::{Reel, Sequence, SequenceOptions, Watches};
use super::truth::{Keeper, Shorter, Truth, TruthOptions, content};
use crate::gpu::limits::hold;
use crate::gpu::{AskPace, Gpu, Pace, block_on};
use crate::measure::Layers;
use crate::measure::cache::Checksum;
use crate::measure::compare::{self, About, Contender, ErrorParts, ReferenceReport, VariantErrors, approximations};
use crate::measure::expectation;
use crate::measure::plot::{Paper, svg};
use crate::measure::run::{ChangeError, Run, RunError};
use crate::measure::survey::Survey;
use crate::measure::sweep::{Measured, Outcome, Point, Sweep, mark_front, plot};
use crate::measure::told::{self, tables};
use crate::pipeline::{Pipeline, Plan};
use clap::Args;
use miette::Diagnostic;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The longest program file that is read.
const MOST_PROGRAM_BYTES: u64 = 4 << 30;

/// How a survey is done, and where its results go.
#[derive(Args)]
pub struct SurveyOptions {
    /// Where each point is kept, for the same command to go on from
    #[arg(long, short, value_name = "DIR", required_unless_present = "dry_run")]
    out: Option<PathBuf>,
    /// Points that are in memory together and run in turn; an interruption loses no more than these
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=64))]
    together: u16,
    /// Write all points as JSON; - is standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a row for each point as CSV; - is standard output
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw error over cost, with the Pareto front
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Write tables of errors and costs, a column for each value, and what nothing beats
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Write a page with the pictures, maps of their errors, plots and tables as HTML
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// List the points and what refuses them, and measure nothing
    #[arg(long)]
    dry_run: bool,
}

/// What errors are against.
pub(super) enum Reference {
    /// A file, a picture that is traced, or nothing.
    Outside(TruthOptions),
    /// The pictures of this row at the same values.
    Row(usize),
}

/// Checks, plans, measures what was not measured before, prints and writes.
pub(super) fn run(
    survey: &Survey,
    (scene, sequence): (&SceneOptions, &SequenceOptions),
    reference: &Reference,
    options: &SurveyOptions,
    console: &Console,
) -> Result<(), Failure> {
    let (row, outside) = match reference {
        Reference::Outside(outside) => (None, outside),
        Reference::Row(row) => (Some(*row), &TruthOptions::none()),
    };
    let targets = Targets::new(options, &outside.files())?;
    // Anything wrong with a pipeline is told before a large scene is loaded.
    let (mut points, pipelines) = check(survey)?;
    note_names(&pipelines, console);
    let mut view = scene.load(console)?;
    let sequence = sequence.of(&view, console);
    view.go_to(sequence.moments[0])?;
    let plans: Vec<Option<Arc<Plan>>> = pipelines.iter().zip(&mut points).map(|(pipeline, point)| planned(pipeline, &view, point, console)).collect();
    plans.iter().flatten().try_for_each(|plan| expect_memory([plan], &view))?;
    weigh(&survey.moved, &plans, &mut points)?;
    let axes = survey.axes();
    if options.dry_run {
        console.print(&listed(&points, &plans, &axes))?;
        return expect_none_refused(&points);
    }
    let folder = Folder::new(options.out.as_deref().unwrap_or(Path::new("")))?;
    let judged = outside.judged(plans.iter().flatten())?;
    let judged = if sequence.is_sequence() { judged.of_frames() } else { judged };
    let given = outside.given(&view, judged)?;
    let keeper = outside.keeper(&view, judged)?;
    let shorter_keepers = outside.shorter_keepers(&view, plans.iter().flatten(), judged)?;
    let gpu = block_on(Gpu::open()).map_err(Failure::work)?;
    // What does not fit is told before a reference is traced.
    plans.iter().flatten().try_for_each(|plan| hold(&plan.schedule, &gpu.limits, gpu.features, &gpu.adapter.name)).map_err(Failure::work)?;
    let conditions = conditions(&view, &gpu) + &frames_told(&sequence, keeper.as_ref(), &mut view)?;
    let judge = if sequence.is_sequence() {
        Judge::Frames(Frames { options: outside, judged })
    } else {
        let truth = given.map_or_else(|| keeper.map(|keeper| keeper.obtain(&view, console)).transpose(), |given| Ok(Some(given)))?;
        warn_of_unstated_bounces(truth.as_ref(), console);
        let shorter = Shorter::all(&shorter_keepers, truth.as_ref(), &view, console)?;
        Judge::new(row, survey, truth, shorter)
    };
    let keys = keys(&pipelines, &judge, &conditions, survey.runs);
    let found = folder.find(&mut points, &keys, console);
    tell_what_is_there(&points, found, &folder, console);
    let fixed = Fixed { gpu: &gpu, pipelines: &pipelines, plans: &plans, sequence: &sequence, keys: &keys, folder: &folder, survey, console };
    let mut work = Work { fixed, view: &mut view, judge, points, shelter: None };
    let result = work.measure(usize::from(options.together));
    let is_interrupted = result.as_ref().is_err_and(|failure| failure.status == 130);
    if !is_interrupted {
        result?;
    }
    let (points, judge, _shelter) = (work.points, work.judge, work.shelter);
    let reference = match &judge {
        Judge::Frames(frames) if !is_interrupted => {
            view.go_to(sequence.moments[sequence.last()])?;
            frames.truth(&view, console)?.map(|truth| truth.report())
        }
        judge => judge.report(),
    };
    let mut sweep = sweep(survey, &view, &gpu, reference, approximations(plans.iter().flatten().map(|plan| plan.approximated())), points);
    sweep.expected = expectation::judge(&survey.expected, &sweep, &survey.cost);
    told::sweep::warnings(&sweep, survey).iter().for_each(|warning| console.note(warning));
    console.print(&[told::sweep::text(&sweep, survey), tables::markdown(&sweep, survey)].join("\n"))?;
    targets.write(&sweep, survey)?;
    if let Some(html) = &targets.html {
        let gallery = exhibited::gallery(&sweep.points, &keys, &folder, &judge, view.size)?;
        html.write_page(&told::sweep::report(&sweep, survey, &pipelines, &plans), &gallery)?;
    }
    if is_interrupted {
        return Err(Failure::interrupted(&[&[folder.path.as_path()], &targets.paths()[..]].concat()));
    }
    expect_none_refused(&sweep.points)?;
    let missed = told::missed(&sweep.expected);
    if missed.is_empty() { Ok(()) } else { Err(Failure::work(CommandError::Unexpected { missed })) }
}

/// The files that the results go to, beside those of the points.
struct Targets {
    json: Option<Target>,
    csv: Option<Target>,
    svg: Option<Target>,
    markdown: Option<Target>,
    html: Option<Target>,
}

impl Targets {
    fn new(options: &SurveyOptions, read: &[&Path]) -> Result<Self, Failure> {
        let target = |path: &Option<PathBuf>| path.as_deref().map(Target::new).transpose();
        let targets = Self {
            json: target(&options.json)?,
            csv: target(&options.csv)?,
            svg: target(&options.svg)?,
            markdown: target(&options.markdown)?,
            html: target(&options.html)?,
        };
        expect_distinct(&targets.paths(), read)?;
        Ok(targets)
    }

    fn write(&self, sweep: &Sweep, survey: &Survey) -> Result<(), Failure> {
        self.json.iter().try_for_each(|json| json.write_json(sweep))?;
        self.csv.iter().try_for_each(|csv| csv.write(told::sweep::csv(sweep, survey).as_bytes()))?;
        self.svg.iter().try_for_each(|figure| figure.write(svg(&plot(sweep, &survey.metric, &survey.cost), Paper::Wide).as_bytes()))?;
        self.markdown.iter().try_for_each(|tables| tables.write(tables::markdown(sweep, survey).as_bytes()))
    }

    fn paths(&self) -> Vec<&Path> {
        [&self.json, &self.csv, &self.svg, &self.markdown, &self.html].into_iter().flatten().map(Target::path).collect()
    }
}

/// What the numbers depend on beside pipelines, reference and runs.
fn conditions(view: &View, gpu: &Gpu) -> String {
    let adapter = &gpu.adapter;
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    format!("program {}\nadapter {}, {}, {}, {processors} processors\n{}\n", program(), adapter.name, adapter.backend, adapter.driver, content(view))
}

/// What the frames of a sequence show, and what tells their errors; nothing of one picture.
fn frames_told(sequence: &Sequence, keeper: Option<&Keeper>, view: &mut View) -> Result<String, Failure> {
    if !sequence.is_sequence() {
        return Ok(String::new());
    }
    let mut told = Checksum::default();
    for (number, moment) in sequence.numbers.iter().zip(&sequence.moments) {
        view.go_to(*moment)?;
        told.add(format!("frame {number} at {moment}: {}\n", content(view)).as_bytes());
    }
    view.go_to(sequence.moments[0])?;
    Ok(format!("{} frames {}, judged by {}\n", sequence.numbers.len(), told.finish(), keeper.map_or("nothing", Keeper::key)))
}

/// Everything that the numbers of each point depend on.
fn keys(pipelines: &[Pipeline], judge: &Judge, conditions: &str, runs: u16) -> Vec<String> {
    let key = |(index, pipeline): (usize, &Pipeline)| {
        let reference = match judge {
            Judge::Nothing | Judge::Frames(_) => "none".to_owned(),
            Judge::Truth(truth, shorter) => [truth.content()].into_iter().chain(shorter.iter().map(Shorter::content)).collect::<Vec<_>>().join("\n"),
            Judge::Row(row) => format!("pipeline {}", Checksum::of(pipelines[row.point_of(index)].to_ron().as_bytes())),
        };
        format!("{conditions}reference {reference}\nruns {runs}\n{}", pipeline.to_ron())
    };
    pipelines.iter().enumerate().map(key).collect()
}

/// The version, and the checksum of the program's file: shaders and passes stand in it.
fn program() -> String {
    let file = std::env::current_exe().and_then(|path| read_file(&path, MOST_PROGRAM_BYTES)).map(|bytes| Checksum::of(&bytes));
    format!("hemisplat {} {}", env!("CARGO_PKG_VERSION"), file.unwrap_or_default())
}

fn tell_what_is_there(points: &[Point], found: usize, folder: &Folder, console: &Console) {
    let open = points.iter().filter(|point| point.outcome == Outcome::Open).count();
    let refused = points.len() - open - found;
    console.note(&format!("{} points: {found} found in {}, {refused} refused, {open} to measure", points.len(), folder.path.display()));
}

/// What does not change while a survey is measured.
#[derive(Clone, Copy)]
struct Fixed<'a> {
    gpu: &'a Arc<Gpu>,
    pipelines: &'a [Pipeline],
    plans: &'a [Option<Arc<Plan>>],
    sequence: &'a Sequence,
    keys: &'a [String],
    folder: &'a Folder,
    survey: &'a Survey,
    console: &'a Console,
}

/// A survey as it is measured.
struct Work<'a, 'v> {
    fixed: Fixed<'a>,
    /// At the frame that is looked at.
    view: &'v mut View,
    judge: Judge<'a>,
    points: Vec<Point>,
    /// From the end of the first group on there is something to tell.
    shelter: Option<Shelter>,
}

/// A point of the group that is in memory.
struct Entry<'a> {
    index: usize,
    contender: Contender<Reel<'a>>,
    /// Of the last frame of the warm-up, as it is kept; None before it.
    picture: Option<Layers>,
    /// Of each frame.
    errors: Vec<VariantErrors>,
    watches: Watches,
    error_parts: Option<ErrorParts>,
}

impl<'a> Work<'a, '_> {
    /// Measures what is open, group by group; the points of a group are kept when it is done.
    fn measure(&mut self, together: usize) -> Result<(), Failure> {
        let planned = self.points.iter().zip(self.fixed.plans).enumerate().filter_map(|(index, (point, plan))| Some((index, point, plan.as_ref()?)));
        let open: Vec<(usize, &Arc<Plan>)> = planned.filter(|(_, point, _)| point.outcome == Outcome::Open).map(|(index, _, plan)| (index, plan)).collect();
        let progress = Progress::new(self.fixed.console, "sweeping");
        let mut done = 0;
        for group in open.chunks(together) {
            progress.tell(|| format!("point {} of {}", done + 1, open.len()));
            let share = |of_group: f32| (done as f32 + of_group * group.len() as f32) / open.len() as f32;
            self.measure_group(group, &|of_group| progress.report(share(of_group)))?;
            self.shelter.get_or_insert_with(Shelter::new);
            done += group.len();
        }
        Ok(())
    }

    /// `report` takes the share of the group that is done, and is false once the user asked to stop.
    fn measure_group(&mut self, group: &[(usize, &Arc<Plan>)], report: &(dyn Fn(f32) -> bool + Sync)) -> Result<(), Failure> {
        let runs = usize::from(self.fixed.survey.runs);
        let steps = (group.len() * (runs + 1)) as f32;
        let pace = |done: usize| move || if report(done as f32 / steps) { Pace::GoOn } else { Pace::Stop };
        let mut entries = self.warm_up_group(group, &pace)?;
        for round in 0..runs {
            for (place, entry) in compare::order(round, entries.len()).into_iter().enumerate() {
                let pace = pace(group.len() + round * entries.len() + place);
                // A pipeline without a loop asks for no pace.
                if pace() == Pace::Stop {
                    return Err(Failure::interrupted(&[]));
                }
                block_on(entries[entry].contender.measure(&pace)).map_err(Failure::of_change)?;
            }
        }
        entries.into_iter().try_for_each(|entry| self.keep(entry))
    }

    /// Leads the points of a group through the frames, side by side, and judges them; what is refused is left out.
    fn warm_up_group<P: Fn() -> Pace + Sync>(&mut self, group: &[(usize, &Arc<Plan>)], pace: &dyn Fn(usize) -> P) -> Result<Vec<Entry<'a>>, Failure> {
        let (moments, mut entries) = (&self.fixed.sequence.moments, Vec::new());
        self.view.go_to(moments[0])?;
        for (index, plan) in group {
            match self.enter(*index, plan) {
                Ok(entry) => entries.push(entry),
                Err(error) => self.refuse(*index, error.into())?,
            }
        }
        for (frame, moment) in moments.iter().enumerate() {
            self.view.go_to(*moment)?;
            let pace = pace(group.len() * frame / moments.len());
            if pace() == Pace::Stop {
                return Err(Failure::interrupted(&[]));
            }
            // What is said of the first reference holds for the others.
            let console = if frame > 0 { self.fixed.console.silenced() } else { *self.fixed.console };
            let truth = if let Judge::Frames(frames) = &self.judge { frames.truth(self.view, &console)? } else { None };
            let mut seen = Vec::new();
            for entry in entries {
                seen.extend(self.see(entry, frame, truth.as_ref(), &pace)?);
            }
            entries = seen;
        }
        Ok(entries)
    }

    fn enter(&self, index: usize, plan: &Arc<Plan>) -> Result<Entry<'a>, RunError> {
        let Fixed { gpu, pipelines, sequence, console, .. } = self.fixed;
        let run = block_on(Run::new(gpu, &self.view.stage, plan, &self.view.camera, self.view.size))?;
        let contender = Contender::new(run, Reel::new(sequence, &pipelines[index], self.view, console));
        Ok(Entry { index, contender, picture: None, errors: Vec::new(), watches: Watches::default(), error_parts: None })
    }

    /// A point with a frame more; None where that is refused.
    fn see(&mut self, mut entry: Entry<'a>, frame: usize, truth: Option<&Truth>, pace: AskPace) -> Result<Option<Entry<'a>>, Failure> {
        let picture = match block_on(entry.contender.warm_up_frame(frame, pace)) {
            Ok(picture) => picture,
            Err(error) => return self.refuse(entry.index, error).map(|()| None),
        };
        if frame == self.fixed.sequence.last() {
            entry.picture = Some(kept::shown(&picture));
            entry.error_parts = self.parts(entry.contender.plan(), &picture)?;
        }
        let errors = match truth {
            Some(truth) => {
                let errors = truth.judge(picture.clone())?;
                entry.watches.see(&picture, truth, &errors)?;
                errors
            }
            None => self.judge(entry.index, picture, pace)?,
        };
        entry.errors.push(errors);
        Ok(Some(entry))
    }

    /// Notes that a pipeline cannot run, if that is what is wrong.
    fn refuse(&mut self, index: usize, error: ChangeError) -> Result<(), Failure> {
        let because = match &error {
            ChangeError::Run(error) if refuses(error) => with_code(error),
            ChangeError::Plan(problems) => points::told(problems),
            _ => return Err(Failure::of_change(error)),
        };
        self.points[index].outcome = Outcome::Refused { because };
        Ok(())
    }

    fn warm_up(&self, plan: &Arc<Plan>, pace: AskPace) -> Result<(Contender, Layers), RunError> {
        block_on(async {
            let run = Run::new(self.fixed.gpu, &self.view.stage, plan, &self.view.camera, self.view.size).await?;
            Contender::warm_up(run, pace).await
        })
    }

    /// What of a point's error is of the bounces that it leaves out, and what is its method's.
    fn parts(&self, plan: &Plan, picture: &Layers) -> Result<Option<ErrorParts>, Failure> {
        if let Judge::Truth(_, shorter) = &self.judge { Shorter::parts(shorter, plan, picture) } else { Ok(None) }
    }

    fn judge(&mut self, index: usize, picture: Layers, pace: AskPace) -> Result<VariantErrors, Failure> {
        let judging = match &self.judge {
            Judge::Nothing | Judge::Frames(_) => return Ok(VariantErrors::default()),
            Judge::Truth(truth, _) => return truth.judge(picture),
            Judge::Row(row) => row.point_of(index),
        };
        self.look_at(judging, (judging == index).then_some(&picture), pace)?;
        match &self.judge {
            // What judges is not judged: against itself it would be without error.
            Judge::Row(row) if judging != index => row.pictures.get(&judging).map_or(Ok(VariantErrors::default()), |truth| truth.judge(picture)),
            _ => Ok(VariantErrors::default()),
        }
    }

    /// Makes sure that the picture of a judging point is there, unless it is refused.
    fn look_at(&mut self, point: usize, picture: Option<&Layers>, pace: AskPace) -> Result<(), Failure> {
        let Judge::Row(row) = &self.judge else { return Ok(()) };
        let Some(plan) = self.fixed.plans[point].as_ref().filter(|_| !row.pictures.contains_key(&point)) else { return Ok(()) };
        let picture = match picture {
            Some(picture) => picture.clone(),
            None => match self.warm_up(plan, pace) {
                Ok((_, picture)) => picture,
                Err(error) if refuses(&error) => return Ok(()),
                Err(error) => return Err(Failure::of_run(error)),
            },
        };
        if let Judge::Row(row) = &mut self.judge {
            row.pictures.insert(point, Truth::of_row(&row.name, picture));
        }
        Ok(())
    }

    fn keep(&mut self, Entry { index, contender, picture, errors, watches, error_parts }: Entry<'a>) -> Result<(), Failure> {
        let (point, Fixed { survey, sequence, folder, keys, .. }) = (&mut self.points[index], self.fixed);
        let (errors, numbers, courses) = (VariantErrors::over_frames(&errors), sequence.numbers.clone(), watches.courses());
        let about = About { name: point.name(&[]), set: point.set.clone(), errors, error_parts, numbers, courses, ..About::default() };
        if let Some((report, picture)) = contender.report(point.id.clone(), about, usize::from(survey.runs)).zip(picture) {
            let measured = Measured::from(report);
            folder.keep(&keys[index], point, &measured, picture)?;
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

fn sweep(survey: &Survey, view: &View, gpu: &Gpu, reference: Option<ReferenceReport>, approximated: Vec<String>, mut points: Vec<Point>) -> Sweep {
    mark_front(&mut points, &survey.metric, &survey.cost);
    Sweep {
        schema: 1,
        scene: view.stage.scene.name.clone(),
        triangles: view.stage.scene.triangles.len(),
        camera: view.camera.name.clone(),
        size: view.size,
        adapter: (&gpu.adapter).into(),
        runs: usize::from(survey.runs),
        complete: points.iter().all(|point| point.measured().is_some_and(|measured| measured.complete)),
        reference,
        approximated,
        metric: survey.metric.to_string(),
        cost: survey.cost.to_string(),
        over: survey.axes(),
        points,
        expected: Vec::new(),
    }
}
