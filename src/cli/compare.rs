//! `hemisplat compare`

use super::check::unique;
use super::console::Console;
use super::failure::{CommandError, Failure};
use super::given::PictureOption;
use super::input::peak_host_bytes;
use super::interrupt::Shelter;
use super::output::{Target, expect_distinct};
use super::overlays::overlays;
use super::pipeline::{check_pipeline, note_idle, note_names, plan_view};
use super::progress::Progress;
use super::resources::expect_memory;
use super::scene::{SceneOptions, View};
use super::sequence::{Reel, Sequence, SequenceOptions, Watches};
use super::truth::{FILES, Shorter, Truth, TruthOptions};
use crate::gpu::{AskPace, Gpu, Pace, block_on, expected_device};
use crate::measure::Layers;
use crate::measure::compare::{self, About, Comparison, Contender, Cut, GivenPicture, StartUp, VariantErrors};
use crate::measure::page::{Gallery, Moment};
use crate::measure::run::Run;
use crate::measure::statistics::least_runs;
use crate::measure::told::comparison;
use crate::pipeline::{Pipeline, Plan, Problems};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Most runs of each variant: the test of significance is exact, and its work grows with their third power.
const MAX_RUNS: i64 = 500;

/// Most runs of each variant that are ended early: the last has a 256th of the time.
const MAX_CUTS: i64 = 8;

/// Runs of each variant where the user says nothing, unless so many variants are compared that more are needed.
const DEFAULT_RUNS: usize = 10;

/// Tell what pipelines cost, how far each is from the truth, and what is noise
#[derive(Args)]
#[command(mut_arg("frames", |frames| frames.conflicts_with_all(["reference", "pictures", "cuts"])), after_help = "Example: hemisplat compare irradiance irradiance@tiles.resolution=32 irradiance-readback --scene cornell --json out/compare.json

A run is a picture from empty caches, or all frames of a sequence. Every variant runs once to warm up, then once a round, in an order that changes from round to round. The
same pipeline may be given again with other parameters. A picture of another program, --picture 'denoised=other.exr:picture,seconds=1.2', is judged by the
same reference; its time is the one that is stated.")]
pub struct Options {
    /// Pipelines: files, or names of those that ship; @ gives a parameter of this one another value
    #[arg(value_name = "PIPELINE[@NODE.PARAM=VALUE]…", required = true)]
    variants: Vec<String>,
    #[command(flatten)]
    scene: SceneOptions,
    #[command(flatten)]
    sequence: SequenceOptions,
    /// Change a parameter of a node in all of them; may be repeated
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    sets: Vec<String>,
    /// Runs of each; 10 if not given, or more where so many pairs need more
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MAX_RUNS))]
    runs: Option<u16>,
    #[command(flatten)]
    truth: TruthOptions,
    /// Also run each once with half of its time, once with a quarter and so on, and judge what it has by then
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u8).range(..=MAX_CUTS), conflicts_with = "no_reference")]
    cuts: u8,
    /// Judge a picture that another program made, too, and say what time it took there; may be repeated
    #[arg(long = "picture", value_name = "LABEL=FILE.exr:LAYER[,seconds=S]", value_parser = PictureOption::parse, group = FILES, conflicts_with = "no_reference")]
    pictures: Vec<PictureOption>,
    /// Write everything that was found as JSON; - is standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a row for each variant as CSV; - is standard output
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write a page with the pictures, maps of their errors, plots and tables as HTML
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let targets = Targets::new(options)?;
    // Anything wrong with a pipeline is told before a large scene is loaded.
    let variants = options.variants.iter().map(|text| Variant::parse(text, &options.sets)).collect::<Result<Vec<_>, _>>()?;
    let pipelines = all(variants.iter().map(|variant| check_pipeline(&variant.pipeline, &variant.sets)))?;
    note_names(&pipelines, console);
    let (mut view, load_seconds) = timed(|| options.scene.load(console))?;
    let sequence = options.sequence.of(&view, console);
    view.go_to(sequence.moments[0])?;
    let plans = plan_all(&pipelines, &view, console)?;
    variants.iter().zip(&plans).for_each(|(variant, (plan, _))| note_idle(plan, &variant.sets, console));
    let pictures = options.pictures.iter().map(|given| given.read(&view, options.truth.anyway)).collect::<Result<Vec<_>, _>>()?;
    let judged = options.truth.judged(plans.iter().map(|(plan, _)| plan))?;
    let judged = if sequence.numbers.is_empty() { judged } else { judged.of_frames() };
    let (given, given_seconds) = timed(|| options.truth.given(&view, judged))?;
    // That there is a place for references is told before work is done for them.
    let mut first = options.truth.keeper(&view, judged)?;
    expect_memory(plans.iter().map(|(plan, _)| plan), &view)?;
    warn_of_few_runs(options, console);
    let (gpu, device_seconds) = timed(|| block_on(Gpu::open()).map_err(Failure::work))?;
    let runs = plans.iter().map(|(plan, _)| timed(|| ready(&gpu, &view, plan))).collect::<Result<Vec<_>, _>>()?;
    let abouts = variants.into_iter().zip(&plans).map(|(variant, (_, plan_seconds))| variant.about(*plan_seconds, &sequence));
    let ready = runs.into_iter().zip(abouts).zip(&pipelines);
    let mut entries: Vec<Entry<'_>> = ready.map(|((run, about), pipeline)| Entry::new(run, about, Reel::new(&sequence, pipeline, &view, console))).collect();
    let mut reference_seconds = given_seconds;
    let mut trace = |view: &View, console: &Console| {
        let keeper = first.take().map_or_else(|| options.truth.keeper(view, judged), |first| Ok(Some(first)))?;
        let (traced, seconds) = timed(|| keeper.map(|keeper| keeper.obtain(view, console)).transpose())?;
        reference_seconds += seconds;
        Ok(traced)
    };
    // With the reference.
    let in_frame = plans.len() + pictures.len() + 1;
    let mut gallery = targets.html.is_some().then(|| Gallery::new(view.size, in_frame * sequence.moments.len()));
    lead(&mut entries, &sequence, &mut view, &mut trace, gallery.as_mut(), console)?;
    let truth = given.or(trace(&view, console)?);
    let shorter_keepers = options.truth.shorter_keepers(&view, plans.iter().map(|(plan, _)| plan), judged)?;
    let shorter = Shorter::all(&shorter_keepers, truth.as_ref(), &view, console)?;
    warn_of_unstated_bounces(truth.as_ref(), console);
    let given_pictures = options
        .pictures
        .iter()
        .zip(&pictures)
        .zip(plans.len()..)
        .filter_map(|((given, picture), place)| truth.as_ref().map(|truth| given.judge(place, picture, truth)));
    let given_pictures = given_pictures.collect::<Result<Vec<_>, _>>()?;

    let (rounds, cuts) = (runs_of(options), options.cuts.into());
    let mut contest = Contest { truth: truth.as_ref(), shorter: &shorter, gallery, entries, last: sequence.last(), rounds, cuts, shelter: None };
    let result = contest.hold(&view, &Progress::new(console, "comparing"));
    let is_interrupted = result.as_ref().is_err_and(|failure| failure.status == 130);
    if !is_interrupted {
        result?;
    }
    pictures.iter().try_for_each(|picture| contest.exhibit(picture))?;
    let (_shelter, mut gallery) = (contest.shelter.take(), contest.gallery.take());
    end_frame(gallery.as_mut(), sequence.moment(sequence.last()), truth.as_ref())?;
    let start_up = StartUp { load_seconds, device_seconds, reference_seconds };
    let Some(comparison) = contest.comparison(&view, &gpu, start_up, given_pictures) else { return Err(Failure::interrupted(&[])) };
    comparison::warnings(&comparison).iter().for_each(|warning| console.note(warning));
    console.print(&comparison::text(&comparison))?;
    targets.write(&comparison)?;
    targets.write_page(&comparison, &pipelines, gallery.as_ref())?;
    if is_interrupted { Err(Failure::interrupted(&targets.paths())) } else { Ok(()) }
}

/// The files that the results go to.
struct Targets {
    json: Option<Target>,
    csv: Option<Target>,
    html: Option<Target>,
}

impl Targets {
    fn new(options: &Options) -> Result<Self, Failure> {
        let target = |path: &Option<PathBuf>| path.as_deref().map(Target::new).transpose();
        let targets = Self { json: target(&options.json)?, csv: target(&options.csv)?, html: target(&options.html)? };
        let read: Vec<&Path> = options.truth.files().into_iter().chain(options.pictures.iter().map(PictureOption::path)).collect();
        expect_distinct(&targets.paths(), &read)?;
        Ok(targets)
    }

    fn write(&self, comparison: &Comparison) -> Result<(), Failure> {
        self.json.iter().try_for_each(|json| json.write_json(comparison))?;
        self.csv.iter().try_for_each(|csv| csv.write(comparison::csv(comparison).as_bytes()))
    }

    fn write_page(&self, comparison: &Comparison, pipelines: &[Pipeline], gallery: Option<&Gallery>) -> Result<(), Failure> {
        let (Some(html), Some(gallery)) = (&self.html, gallery) else { return Ok(()) };
        html.write_page(&comparison::report(comparison, pipelines.iter().map(Pipeline::to_ron).collect()), gallery)
    }

    fn paths(&self) -> Vec<&Path> {
        self.json.iter().chain(&self.csv).chain(&self.html).map(Target::path).collect()
    }
}

/// A pipeline and the parameters that this comparison changes.
pub(super) struct Variant {
    pub(super) name: String,
    pub(super) pipeline: String,
    pub(super) sets: Vec<String>,
}

impl Variant {
    /// Reads `PIPELINE@NODE.PARAM=VALUE@…`; a file whose name holds the sign comes first.
    pub(super) fn parse(text: &str, common: &[String]) -> Result<Self, Failure> {
        let mut parts = if Path::new(text).exists() { vec![text] } else { text.split('@').collect() };
        let pipeline = parts.remove(0);
        if pipeline.is_empty() {
            return Err(Failure::input(CommandError::NoPipeline { variant: text.to_owned() }));
        }
        let sets = common.iter().cloned().chain(parts.into_iter().map(str::to_owned)).collect();
        Ok(Self { name: text.to_owned(), pipeline: pipeline.to_owned(), sets })
    }

    fn about(self, plan_seconds: f64, sequence: &Sequence) -> About {
        About { name: self.name, set: self.sets, plan_seconds, numbers: sequence.numbers.clone(), ..About::default() }
    }
}

/// All results, or the problems of all that failed, each told once.
pub(super) fn all<T>(results: impl Iterator<Item = Result<T, Problems>>) -> Result<Vec<T>, Failure> {
    let (mut good, mut problems) = (Vec::new(), Vec::new());
    for result in results {
        match result {
            Ok(value) => good.push(value),
            Err(found) => problems.extend(found.0),
        }
    }
    if problems.is_empty() { Ok(good) } else { Err(Failure::input(Problems(unique(problems)))) }
}

/// Every plan, and the seconds that it took.
fn plan_all(pipelines: &[Pipeline], view: &View, console: &Console) -> Result<Vec<(Arc<Plan>, f64)>, Failure> {
    all(pipelines.iter().map(|pipeline| timed(|| plan_view(pipeline, view, expected_device(), &[], console))))
}

fn ready(gpu: &Arc<Gpu>, view: &View, plan: &Arc<Plan>) -> Result<Run, Failure> {
    block_on(Run::new(gpu, &view.stage, plan, &view.camera, view.size)).map_err(Failure::work)
}

/// What the work makes, and the seconds that it took.
fn timed<T, E>(work: impl FnOnce() -> Result<T, E>) -> Result<(T, f64), E> {
    let start = Instant::now();
    Ok((work()?, start.elapsed().as_secs_f64()))
}

fn runs_of(options: &Options) -> usize {
    let enough = DEFAULT_RUNS.max(least_runs(compare::comparisons(options.variants.len())));
    options.runs.map_or(enough, usize::from)
}

fn warn_of_few_runs(options: &Options, console: &Console) {
    let comparisons = compare::comparisons(options.variants.len());
    let (runs, least) = (runs_of(options), least_runs(comparisons));
    if comparisons > 0 && runs < least {
        console.note(&format!("note: no difference can be told from noise: {} variants need at least --runs {least}", options.variants.len()));
    }
}

pub(super) fn warn_of_unstated_bounces(truth: Option<&Truth>, console: &Console) {
    if let Some(truth) = truth.filter(|truth| !truth.states_bounces()) {
        console.note(&format!("note: {} does not say of how many bounces its light is; it is taken for {}", truth.path().display(), truth.bounces()));
    }
}

/// A variant as it runs, and what is known of it.
struct Entry<'s> {
    contender: Contender<Reel<'s>>,
    about: About,
    watches: Watches,
}

impl<'s> Entry<'s> {
    fn new((run, shaders_seconds): (Run, f64), about: About, reel: Reel<'s>) -> Self {
        Self { contender: Contender::new(run, reel), about: About { shaders_seconds, ..about }, watches: Watches::default() }
    }

    /// Renders a frame, which is judged in time where there is a truth and there are several; its picture and its errors.
    fn frame(&mut self, frame: usize, truth: Option<&Truth>, pace: AskPace<'_>) -> Result<(Layers, VariantErrors), Failure> {
        let picture = block_on(self.contender.warm_up_frame(frame, pace)).map_err(Failure::of_change)?;
        let Some(truth) = truth else { return Ok((picture, VariantErrors::default())) };
        let errors = truth.judge(picture.clone())?;
        if !self.about.numbers.is_empty() {
            self.watches.see(&picture, truth, &errors)?;
        }
        Ok((picture, errors))
    }
}

/// Obtains the truth of a view, where one is wanted.
type Trace<'t> = dyn FnMut(&View, &Console) -> Result<Option<Truth>, Failure> + 't;

/// Leads all variants through a sequence, up to its last frame, at which the view is then.
fn lead(
    entries: &mut [Entry<'_>],
    sequence: &Sequence,
    view: &mut View,
    trace: &mut Trace<'_>,
    mut gallery: Option<&mut Gallery>,
    console: &Console,
) -> Result<(), Failure> {
    let progress = Progress::new(console, "warming up, and tracing references");
    for (frame, moment) in sequence.moments.iter().enumerate() {
        view.go_to(*moment)?;
        if frame == sequence.last() {
            break;
        }
        let pace = || if progress.report(frame as f32 / sequence.last() as f32) { Pace::GoOn } else { Pace::Stop };
        if pace() == Pace::Stop {
            return Err(Failure::interrupted(&[]));
        }
        // What is said of the first reference holds for the others.
        let truth = trace(view, &if frame > 0 { console.silenced() } else { *console })?;
        for entry in &mut *entries {
            let (picture, _) = entry.frame(frame, truth.as_ref(), &pace)?;
            exhibit(gallery.as_deref_mut(), &picture, truth.as_ref())?;
        }
        end_frame(gallery.as_deref_mut(), sequence.moment(frame), truth.as_ref())?;
    }
    Ok(())
}

fn exhibit(gallery: Option<&mut Gallery>, picture: &Layers, truth: Option<&Truth>) -> Result<(), Failure> {
    gallery.map_or(Ok(()), |gallery| gallery.add(picture, truth.map(Truth::picture))).map_err(Failure::work)
}

fn end_frame(gallery: Option<&mut Gallery>, moment: Option<Moment>, truth: Option<&Truth>) -> Result<(), Failure> {
    gallery.map_or(Ok(()), |gallery| gallery.end_frame(moment, truth.map(Truth::picture))).map_err(Failure::work)
}

/// The variants as they run.
struct Contest<'t, 's> {
    truth: Option<&'t Truth>,
    /// Truths of fewer bounces.
    shorter: &'t [Shorter],
    /// Where a page is wanted.
    gallery: Option<Gallery>,
    entries: Vec<Entry<'s>>,
    /// The number of the last frame.
    last: usize,
    rounds: usize,
    /// Of each variant, so many runs are ended early.
    cuts: usize,
    /// From the end of the first round on there is something to keep.
    shelter: Option<Shelter>,
}

impl Contest<'_, '_> {
    /// Warms each variant up and judges its picture, then holds the rounds.
    fn hold(&mut self, view: &View, progress: &Progress) -> Result<(), Failure> {
        let variants = self.entries.len();
        let steps = (variants * (self.rounds + self.cuts + 1)) as f32;
        let pace = |done: usize| move || if progress.report(done as f32 / steps) { Pace::GoOn } else { Pace::Stop };
        for variant in 0..variants {
            let (picture, errors) = self.entries[variant].frame(self.last, self.truth, &pace(variant))?;
            self.exhibit(&picture)?;
            let Entry { contender, about, watches } = &mut self.entries[variant];
            if let Some(gallery) = &mut self.gallery {
                gallery.overlay(overlays(contender.run(), view)?);
            }
            about.error_parts = Shorter::parts(self.shorter, contender.plan(), &picture)?;
            about.errors = errors;
            about.courses = std::mem::take(watches).courses();
        }
        for round in 0..self.rounds {
            for (place, variant) in compare::order(round, variants).into_iter().enumerate() {
                let pace = pace(variants * (round + 1) + place);
                // A pipeline without a loop asks for no pace.
                if pace() == Pace::Stop {
                    return Err(Failure::interrupted(&[]));
                }
                block_on(self.entries[variant].contender.measure(&pace)).map_err(Failure::of_change)?;
            }
            self.shelter.get_or_insert_with(Shelter::new);
        }
        for variant in 0..variants {
            let done = variants * (self.rounds + 1) + variant * self.cuts;
            self.cut(variant, &|cut| progress.report((done + cut) as f32 / steps))?;
        }
        Ok(())
    }

    /// Runs a variant in ever less of its time; `report` takes how many of these runs are done, and is false once the user asked to stop.
    fn cut(&mut self, variant: usize, report: &(dyn Fn(usize) -> bool + Sync)) -> Result<(), Failure> {
        let Entry { contender, about, .. } = &mut self.entries[variant];
        let (Some(truth), Some(median)) = (self.truth, contender.median_seconds()) else { return Ok(()) };
        for cut in 0..self.cuts {
            let within = Duration::from_secs_f64(median / f64::from(2 << cut));
            let pace = || if report(cut) { Pace::GoOn } else { Pace::Stop };
            let (seconds, picture) = block_on(contender.cut(within, &pace)).map_err(Failure::of_run)?;
            about.cuts.insert(0, Cut { within_seconds: within.as_secs_f64(), seconds, errors: truth.judge(picture)? });
        }
        Ok(())
    }

    fn exhibit(&mut self, picture: &Layers) -> Result<(), Failure> {
        exhibit(self.gallery.as_mut(), picture, self.truth)
    }

    /// What the whole rounds found; None without one.
    fn comparison(self, view: &View, gpu: &Gpu, start_up: StartUp, pictures: Vec<GivenPicture>) -> Option<Comparison> {
        let whole = self.entries.iter().map(|entry| entry.contender.runs()).min()?;
        let entries = self.entries.into_iter().enumerate();
        let variants = entries.map(|(index, entry)| entry.contender.report(compare::letters(index), entry.about, whole)).collect::<Option<Vec<_>>>()?;
        Some(Comparison {
            schema: 1,
            scene: view.stage.scene.name.clone(),
            triangles: view.stage.scene.triangles.len(),
            camera: view.camera.name.clone(),
            size: view.size,
            adapter: (&gpu.adapter).into(),
            runs_asked: self.rounds,
            runs: whole,
            complete: whole == self.rounds && variants.iter().all(|variant| variant.complete),
            start_up,
            peak_host_bytes: peak_host_bytes(),
            reference: self.truth.map(Truth::report),
            pairs: compare::pairs(&variants, pictures.len()),
            error_pairs: compare::error_pairs(&variants, &pictures),
            variants,
            pictures,
        })
    }
}
