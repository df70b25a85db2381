//! `hemisplat render`

use super::console::Console;
use super::dump;
use super::exposure::{Exposure, ExposureOptions};
use super::failure::{CommandError, Failure};
use super::input::peak_host_bytes;
use super::interrupt::{self, Shelter};
use super::movie::{Movie, is_movie};
use super::output::{PictureTarget, Target, expect_distinct, exposed, warn_of_nothing};
use super::pipeline::{expect_exact, judged_bounces, load_noting, note_approximations, note_idle, note_names};
use super::progress::Progress;
use super::records::{Beginning, Keeping, RecordsFile};
use super::resources::expect_memory;
use super::scene::{SceneOptions, View};
use super::timeline::{Frame, Plans, Timeline, TimelineOptions, camera_of_frame, still_camera};
use super::watch::{self, Kept, Ready, timed};
use crate::gpu::{Gpu, GpuError, Pace, block_on};
use crate::math::bounces::Bounces;
use crate::math::pixel_filter::PixelFilter;
use crate::measure::Layers;
use crate::measure::average::Average;
use crate::measure::cache::After;
use crate::measure::compare::{AdapterReport, dropped};
use crate::measure::gap::Gap;
use crate::measure::metrics::SCENE_CHECKSUM;
use crate::measure::run::{FrameReport, PassReport, Run, RunError};
use crate::pipeline::Plan;
use crate::reference::{LeftOut, left_out};
use crate::scene::{Camera, Sample, animation::Moment};
use crate::schedule::Device;
use clap::{Args, ValueEnum};
use glam::DVec2;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::{
    Arc,
    atomic::{AtomicU32, Ordering},
};
use std::time::{Duration, Instant};

/// Render a scene with a pipeline
#[derive(Args)]
#[command(after_help = "Example: hemisplat render irradiance --scene cornell -o out/cornell.exr -o out/cornell.png --stats out/cornell.json

The report goes to stdout: records, time of each node, uncovered pixels. A sequence is written as OUT.0000.exr and so on; its frames share the records.")]
pub struct Options {
    /// The pipeline: a file, or the name of one that ships
    pipeline: String,
    #[command(flatten)]
    scene: SceneOptions,
    #[command(flatten)]
    timeline: TimelineOptions,
    /// Loads records from this file where it exists, and saves them to it, every few seconds and at the end. A sequence whose first frame follows the one that they
    /// were saved after goes on as if it had not been interrupted
    #[arg(long, value_name = "FILE")]
    cache: Option<PathBuf>,
    /// Goes on with a sequence that was interrupted: frames that are there, and were when the file of --cache was saved, are left out. Where there are none, or others,
    /// all are rendered
    #[arg(long, requires = "cache")]
    resume: bool,
    /// Fail, with status 1, when a pixel of a frame is left without a record; its picture is written all the same. Refuse, with status 2, to take glossy materials as diffuse
    #[arg(long)]
    strict: bool,
    /// Keep each frame within this time; pixels that no record has been made for by then are interpolated from farther ones
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    time: Option<Duration>,
    /// Samples of each pixel, whose mean smooths edges. They share the records, so that each takes far less time than a picture. What is no light, such as depth, and --dump have one sample
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    samples: u16,
    /// How far the samples of a pixel are spread
    #[arg(long, value_name = "FILTER", value_enum, default_value_t = Filter::Box, requires = "samples")]
    filter: Filter,
    #[command(flatten)]
    exposure: ExposureOptions,
    /// Where to write: .exr, .png or .hdr, or a sequence as one animated .apng; may be repeated
    #[arg(long, short, value_name = "FILE", required = true)]
    output: Vec<PathBuf>,
    /// Where to write what was measured; - is standard output
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// Writes what this node, or node.output, made, beside the first output; may be repeated
    #[arg(long, value_name = "NODE")]
    dump: Vec<String>,
    /// Render again each time that a file changes which the pipeline or the scene is made of, until Ctrl-C
    #[arg(long, conflicts_with = "cache")]
    watch: bool,
    #[arg(long = "spp", hide = true, value_name = "N", value_parser = no_samples)]
    _spp: Option<String>,
    #[arg(long = "bounces", hide = true, value_name = "N", value_parser = no_bounces)]
    _bounces: Option<String>,
}

/// Attributes of a picture whose pixels have several samples; `samples` are the rays of a reference, all of them through one point.
pub const PIXEL_SAMPLES: &str = "pixel-samples";
pub const PIXEL_FILTER: &str = "pixel-filter";

/// See [`PixelFilter`].
#[derive(Clone, Copy, ValueEnum)]
enum Filter {
    /// Over the pixel's own area
    Box,
    /// To the neighbours' centres, less and less
    Tent,
    /// Over three pixels, by the window of Blackman and Harris
    BlackmanHarris,
}

impl Filter {
    fn offsets(self, samples: u16) -> Vec<DVec2> {
        let filter = match self {
            Self::Box => PixelFilter::Box,
            Self::Tent => PixelFilter::Tent,
            Self::BlackmanHarris => PixelFilter::BlackmanHarris,
        };
        filter.offsets(samples.into())
    }

    fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }
}

/// What other renderers have, and what is there instead.
fn no_samples(_: &str) -> Result<String, String> {
    Err("a pipeline traces rays for records, not for pixels: `--set quality=Q` or `--set tiles.resolution=N` sets the rays of each record; `--samples N` \
        smooths edges; `hemisplat reference --spp N` traces rays per pixel"
        .to_owned())
}

fn no_bounces(_: &str) -> Result<String, String> {
    Err("a pipeline says itself how many bounces it computes: most have one, `irradiance-bounces` has all; `hemisplat reference --bounces N` traces them"
        .to_owned())
}

/// Seconds from the command to the first frame, and of what they are made; the device is opened while the scene loads.
struct StartUp {
    load: f64,
    plan: f64,
    device: f64,
    shaders: f64,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let job = Job::new(options)?;
    if options.watch {
        return watch::rounds(&job.written(), console, |kept| job.round(kept, console));
    }
    job.round(&mut Kept::default(), console)
}

/// What is asked for, as far as no file that is read decides it.
struct Job<'o> {
    options: &'o Options,
    timeline: Timeline,
    /// Of each frame.
    targets: Vec<Targets>,
    /// Animated pictures, which all frames are in.
    movies: Vec<Target>,
    stats: Option<Target>,
    records: Option<RecordsFile>,
}

impl<'o> Job<'o> {
    fn new(options: &'o Options) -> Result<Self, Failure> {
        let written: Vec<&Path> = options.output.iter().chain(&options.stats).chain(&options.cache).map(PathBuf::as_path).collect();
        expect_distinct(&written, &[options.scene.path(), Path::new(&options.pipeline)])?;
        let timeline = options.timeline.timeline(options.scene.named_cameras())?;
        let targets: Vec<Targets> = timeline.frames.iter().map(|frame| Targets::new(options, &timeline, frame)).collect::<Result<_, _>>()?;
        let movies: Vec<&PathBuf> = options.output.iter().filter(|path| is_movie(path)).collect();
        if let Some(path) = movies.first().filter(|_| !timeline.is_sequence) {
            return Err(Failure::input(CommandError::NoSequence { path: path.to_path_buf() }));
        }
        if let Some(path) = movies.first().filter(|_| options.resume) {
            return Err(Failure::input(CommandError::ResumedMovie { path: path.to_path_buf() }));
        }
        if !options.dump.is_empty() && movies.len() == options.output.len() {
            return Err(Failure::input(CommandError::NoPicture));
        }
        let movies = movies.into_iter().map(|path| Target::new(path)).collect::<Result<_, _>>()?;
        let stats = options.stats.as_deref().map(Target::new).transpose()?;
        let records = options.cache.as_deref().map(RecordsFile::open).transpose()?;
        Ok(Self { options, timeline, targets, movies, stats, records })
    }

    /// The files that it leaves.
    fn written(&self) -> Vec<&Path> {
        let pictures = self.targets.iter().flat_map(|targets| &targets.0).map(PictureTarget::path);
        pictures.chain(self.movies.iter().chain(&self.stats).map(Target::path)).collect()
    }

    /// Reads the documents and renders all frames.
    fn round(&self, kept: &mut Kept, console: &Console) -> Result<(), Failure> {
        let Self { options, timeline, .. } = self;
        let sets = &timeline.frames[0].sets;
        // Anything wrong with the pipeline is told before a large scene is loaded.
        note_names([&load_noting(&options.pipeline, sets, &kept.pipeline_files)?], console);
        let Ready { gpu, view, device, load } = kept.ready(&options.scene, console)?;
        let able = gpu.as_ref().map_or(Device::ABLE, |gpu| gpu.adapter.device());
        let (plans, planned) = timed(|| Plans::of(&options.pipeline, timeline, view, able, &options.dump, console));
        let mut plans = plans?;
        let first = plans.of_frame(&timeline.frames[0], &view.stage, view.size).map_err(Failure::input)?;
        if options.strict {
            expect_exact(&first).map_err(Failure::input)?;
        }
        note_approximations(&first, console);
        note_idle(&first, sets, console);
        self.render(gpu?, view, (plans, &first), StartUp { load, plan: planned, device, shaders: 0.0 }, console)
    }

    fn render(&self, gpu: &Arc<Gpu>, view: &View, (plans, first): (Plans<'_>, &Arc<Plan>), start_up: StartUp, console: &Console) -> Result<(), Failure> {
        let Self { options, timeline, targets, movies, stats, records } = self;
        expect_memory([first], view)?;
        let start = Instant::now();
        let mut run = block_on(Run::new(gpu, &view.stage, first, &view.camera, view.size)).map_err(Failure::work)?;
        let start_up = StartUp { shaders: start.elapsed().as_secs_f64(), ..start_up };
        let there = if options.resume { self.frames_there(view, first, console) } else { Some(0) };
        let keeping = records.as_ref().map(|records| Keeping::of(records, &run, there.is_none())).transpose()?;

        let _shelter = Shelter::new();
        let exposure = Exposure::new(&options.exposure, console);
        let movies = movies.iter().map(|target| Movie::begin(target, targets.len(), view.size, timeline.rate)).collect::<Result<_, _>>()?;
        let mut film = Film {
            options,
            timeline,
            console,
            view,
            plans,
            exposure,
            movies,
            keeping,
            moment: None,
            frames: Vec::new(),
            gaps: Vec::new(),
            is_faulty: false,
            kept: Vec::new(),
            left_out: None,
        };
        let mut open = timeline.frames.iter().zip(targets).skip(there.unwrap_or(0)).peekable();
        if let Some((frame, _)) = open.peek() {
            film.begin(frame, &mut run)?;
        }
        let result = open.try_for_each(|(frame, targets)| film.expose(frame, targets, &mut run)).and_then(|()| film.end());
        let is_interrupted = result.as_ref().is_err_and(|failure| failure.status == 130);
        let finished = film.finish(&run, stats.as_ref(), &start_up, gpu, result.is_ok());
        if is_interrupted {
            return finished.and(Err(Failure::interrupted(&film.kept)));
        }
        // What went wrong first is the cause.
        result.and(finished)?;
        film.refuse_gaps()
    }

    /// How many frames are there already which the file of records goes on after; None where all have to be rendered.
    fn frames_there(&self, view: &View, plan: &Plan, console: &Console) -> Option<usize> {
        let records = self.records.as_ref().filter(|records| records.was_there())?;
        let count = records.frames_before(&self.timeline, view).ok_or_else(|| format!("{} was not saved after one of its frames", records.path().display()));
        let found = count.and_then(|count| {
            let mut before = self.timeline.frames.iter().zip(&self.targets).take(count);
            before.try_for_each(|(frame, targets)| targets.expect_there(&lasting_attributes(self.options, view, plan, frame)))?;
            Ok(count)
        });
        match &found {
            Ok(0) => {}
            Ok(count) => console.note(&format!("note: {count} of {} frames are there", self.targets.len())),
            Err(why) => console.note(&format!("note: the sequence is begun anew: {why}")),
        }
        found.ok()
    }
}

/// What frames leave: pictures, reports, and the gaps in them.
struct Film<'o> {
    options: &'o Options,
    timeline: &'o Timeline,
    console: &'o Console,
    view: &'o View,
    plans: Plans<'o>,
    exposure: Exposure<'o>,
    movies: Vec<Movie<'o>>,
    keeping: Option<Keeping<'o>>,
    /// That of the frame which was begun last [s].
    moment: Option<f64>,
    /// Reports of the frames that are whole, as in the file of statistics.
    frames: Vec<Value>,
    gaps: Vec<CommandError>,
    /// Whether the last frame failed on the device or made numbers that are not finite.
    is_faulty: bool,
    /// Files that are written.
    kept: Vec<&'o Path>,
    /// What a frame's camera does not see for want of bounces, if it sees anything.
    left_out: Option<(Camera, Option<LeftOut>)>,
}

impl<'o> Film<'o> {
    /// Takes over what the file of records has for a first frame.
    fn begin(&mut self, first: &Frame, run: &mut Run) -> Result<(), Failure> {
        let Some(moment) = self.keeping.as_ref().and_then(Keeping::moment) else { return Ok(()) };
        // Records are of the scene as it was.
        self.change(&self.view.animation().at(moment), first, run)?;
        let Some(keeping) = &self.keeping else { return Ok(()) };
        let beginning = keeping.begin(run, (self.timeline, self.view), first)?;
        if let Beginning::Next(exposure) = beginning {
            self.exposure.go_on_with(exposure);
        }
        beginning.tell(run, keeping.path(), self.console);
        Ok(())
    }

    /// Renders a frame and writes its pictures.
    fn expose(&mut self, frame: &Frame, targets: &'o Targets, run: &mut Run) -> Result<(), Failure> {
        if interrupt::requested() {
            return Err(Failure::interrupted(&[]));
        }
        self.look_ahead(frame, run)?;
        let time = self.timeline.time(self.view, frame.number);
        let moment = self.view.animation().at(time);
        self.moment = Some(time);
        self.change(&moment, frame, run)?;
        let camera = camera_of_frame(self.view, (frame, &moment), &run.stage().scene);
        let drawn = self.draw(frame, &camera, run);
        // Records that a faulty first frame leaves are not for other runs; those of one that was given up are whole.
        self.is_faulty = matches!(&drawn, Err(error) if !matches!(error, RunError::Gpu(GpuError::Interrupted)));
        let (report, picture) = drawn.map_err(Failure::of_run)?;
        let exposure = self.exposure.of(&picture, exposed(&targets.0).or(self.movies.first().map(Movie::path)))?;
        warn_of_nothing(&picture, self.console);
        let attributes = attributes(self.options, self.view, run, (frame, time), &camera);
        let scene = attributes.get(SCENE_CHECKSUM).cloned().unwrap_or_default();
        self.movies.iter_mut().try_for_each(|movie| movie.add(&picture, exposure))?;
        targets.write(self.options, run, Layers { attributes, ..picture }, exposure)?;
        self.kept.extend(targets.0.iter().map(PictureTarget::path));
        let after = After { frame: frame.number, next: self.timeline.time(self.view, frame.number + 1), exposure: self.exposure.stops() };
        self.keeping.iter_mut().try_for_each(|keeping| keeping.keep(run, (scene.clone(), time), after.clone()))?;
        let left_out = self.left_out(&camera, run);
        self.console.print(&(text(self.options, frame.number, &report) + &told_of(left_out)))?;
        self.note_gap(frame, &report);
        report.passes.iter().filter_map(cut_off).for_each(|note| self.console.note(&note));
        self.frames.push(with_frame(&report, frame, &camera.name, left_out)?);
        Ok(())
    }

    /// All frames are there.
    fn end(&mut self) -> Result<(), Failure> {
        self.movies.drain(..).try_for_each(|movie| {
            self.kept.push(movie.end()?);
            Ok(())
        })
    }

    /// Before a frame: samples what lives on as it will be, where the pipeline asks for that and the scene is another then. No frame has time for it that is to take so
    /// much and no more.
    fn look_ahead(&mut self, frame: &Frame, run: &mut Run) -> Result<(), Failure> {
        if self.options.time.is_some() {
            return Ok(());
        }
        let Some(ahead) = self.timeline.rate.ahead(self.view.moment, frame.number, run.window()) else { return Ok(()) };
        let moment = self.view.animation().at(ahead.time);
        if !self.change(&moment, frame, run)? {
            return Ok(());
        }
        let then = Frame { number: ahead.number, sets: frame.sets.clone() };
        run.set_camera(&camera_of_frame(self.view, (&then, &moment), &run.stage().scene));
        let pace = || if interrupt::requested() { Pace::Stop } else { Pace::GoOn };
        block_on(run.look_ahead(ahead.frames, &pace)).map_err(Failure::of_run)
    }

    /// Brings the scene to a moment, and goes on with the frame's plan; whether that changed the scene.
    fn change(&mut self, moment: &Moment<'_>, frame: &Frame, run: &mut Run) -> Result<bool, Failure> {
        let (changes, size) = (run.stage().changes_to(moment), self.view.size);
        if changes.is_empty() {
            let plan = self.plans.of_frame(frame, run.stage(), size).map_err(Failure::input)?;
            run.switch_to(&plan).map_err(Failure::of_run)?;
            return Ok(false);
        }
        self.plans.forget();
        block_on(run.renew(&changes, |run| self.plans.of_frame(frame, run.stage(), size))).map_err(Failure::of_change)?;
        Ok(true)
    }

    /// What more than the bounces that are counted would bring. That depends on the camera alone where nothing moves; where something does, it is told of the first
    /// frame, as finding out takes longer than many a frame.
    fn left_out(&mut self, camera: &Camera, run: &Run) -> Option<LeftOut> {
        if let Some((before, found)) = &self.left_out {
            if !self.view.animation().is_empty() {
                return None;
            }
            if before == camera {
                return *found;
            }
        }
        let Bounces::Count(counted) = run.plan().bounces else { return None };
        let found = left_out(&run.stage().scene, &run.stage().bvh, camera, self.view.size, counted);
        self.left_out = Some((camera.clone(), found));
        found
    }

    /// The frame's numbers and layers, all of them finite, and where its pixels are.
    fn draw(&self, frame: &Frame, camera: &Camera, run: &mut Run) -> Result<(FrameReport, Layers), RunError> {
        let start = Instant::now();
        let progress = Progress::open_ended(self.console, &format!("frame {}", frame.number));
        let rounds = AtomicU32::new(0);
        let pace = || {
            let round = rounds.fetch_add(1, Ordering::Relaxed);
            progress.tell(|| format!("round {round}"));
            match self.options.time {
                _ if interrupt::requested() => Pace::Stop,
                Some(time) => Pace::Within(time.saturating_sub(start.elapsed())),
                None => Pace::GoOn,
            }
        };
        let mut shoot = |number: usize, offset: &DVec2| {
            let sample = Sample { number: number as u32, shift: offset.as_vec2(), width: (self.options.samples as f32).sqrt().recip() };
            run.set_camera(&Camera { sample, ..camera.clone() });
            let report = block_on(run.frame(&pace))?;
            Ok::<_, RunError>((report, block_on(run.picture())?.seen_through(camera, &run.stage().scene, self.view.size)))
        };
        let offsets = self.options.filter.offsets(self.options.samples);
        let (mut report, first) = shoot(0, &offsets[0])?;
        let mut picture = Average::of(first);
        for (number, offset) in offsets.iter().enumerate().skip(1) {
            let (next, shifted) = shoot(number, offset)?;
            report = report.and(next);
            picture.add(&shifted);
        }
        Ok((report, picture.mean()))
    }

    fn note_gap(&mut self, frame: &Frame, report: &FrameReport) {
        if report.complete {
            return;
        }
        let coarse = report.coarse_pixels.zip(report.coarsest);
        let Gap { what, help } = Gap::of(report.uncovered_pixels, coarse, &report.unfinished);
        let gap = CommandError::Incomplete { frame: frame.number, what, help };
        if !self.options.strict {
            self.console.warn(&gap);
        }
        self.gaps.push(gap);
    }

    /// With `--strict` gaps are errors, of which all are told.
    fn refuse_gaps(mut self) -> Result<(), Failure> {
        match self.gaps.pop() {
            Some(last) if self.options.strict => {
                self.gaps.iter().for_each(|gap| self.console.report(gap));
                Err(Failure::work(last))
            }
            _ => Ok(()),
        }
    }

    /// Saves the records and what was measured, also of frames before one that failed.
    fn finish(&mut self, run: &Run, stats: Option<&'o Target>, start_up: &StartUp, gpu: &Gpu, is_whole: bool) -> Result<(), Failure> {
        let mut saved = Ok(());
        // Before a frame is begun there is nothing new.
        if let (Some(keeping), Some(moment)) = (&mut self.keeping, self.moment) {
            let is_new = keeping.end(run, moment, self.is_faulty);
            self.kept.extend(matches!(is_new, Ok(true)).then(|| keeping.path()));
            saved = is_new.map(drop);
        }
        if let Some(stats) = stats {
            let complete = self.gaps.is_empty() && is_whole;
            let value = statistics(self, run, gpu, start_up, complete);
            stats.write_json(&value)?;
            self.kept.push(stats.path());
        }
        saved
    }
}

/// Tells where photons were given up that carried light.
fn cut_off(pass: &PassReport) -> Option<String> {
    let [cut_off, emitted] = ["photons_cut_off", "photons_emitted"].map(|name| pass.numbers.get(name).copied());
    let (cut_off, emitted) = (cut_off?, emitted?);
    let told = || {
        let node = &pass.node;
        format!(
            "warning: {cut_off} of {emitted} photons of `{node}` were still on their way after its `legs`: what they carry is missing, as surfaces reflect nearly all light; raise `legs`"
        )
    };
    (u64::from(cut_off) * FEW_CUT_OFF > u64::from(emitted)).then(told)
}

/// So few photons that end early are none to speak of.
const FEW_CUT_OFF: u64 = 1000;

/// A sentence, or nothing where no light arrives.
fn told_of(left_out: Option<LeftOut>) -> String {
    let Some(LeftOut { share, interval: [low, high], bounces }) = left_out else { return String::new() };
    let [share, low, high] = [share, low, high].map(|share| (100.0 * share).round());
    let more = if bounces == 0 {
        "light that surfaces send each other".to_owned()
    } else {
        format!("light of more than {bounces} {}", if bounces == 1 { "bounce" } else { "bounces" })
    };
    format!("  left out: {more}, {share:.0} % ({low:.0} … {high:.0}) of what surfaces reflect toward the camera\n")
}

/// A report with the number of its frame, its camera and its parameters, and what it leaves out.
fn with_frame(report: &FrameReport, frame: &Frame, camera: &str, left_out: Option<LeftOut>) -> Result<Value, Failure> {
    let json_error = |error: serde_json::Error| Failure::work(CommandError::Json { reason: error.to_string() });
    let mut value = serde_json::to_value(report).map_err(json_error)?;
    value["left_out"] = serde_json::to_value(left_out).map_err(json_error)?;
    value["frame"] = json!(frame.number);
    value["camera"] = json!(camera);
    value["set"] = json!(frame.sets);
    Ok(value)
}

/// Where a frame's pictures go.
struct Targets(Vec<PictureTarget>);

impl Targets {
    fn new(options: &Options, timeline: &Timeline, frame: &Frame) -> Result<Self, Failure> {
        let number = timeline.is_sequence.then_some(frame.number);
        let pictures = options.output.iter().filter(|path| !is_movie(path));
        pictures.map(|path| PictureTarget::new(&numbered(path, number))).collect::<Result<_, _>>().map(Self)
    }

    /// Refuses to take a frame for one that is there: its pictures must be, with what is the same in all pictures of it.
    fn expect_there(&self, attributes: &BTreeMap<String, String>) -> Result<(), String> {
        for path in self.0.iter().map(PictureTarget::path) {
            let missing = |error: &dyn std::fmt::Display| format!("{} cannot be read: {error}", path.display());
            let file = File::open(path).map_err(|error| missing(&error))?;
            if !path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr")) {
                continue;
            }
            let found = Layers::attributes_of_exr(BufReader::new(file)).map_err(|error| missing(&error))?;
            let other = attributes.iter().find(|(name, value)| found.get(*name) != Some(value));
            if let Some((name, value)) = other {
                let was = found.get(name).map_or("nothing", String::as_str);
                return Err(format!("`{name}` of {} is {was}, and not {value}", path.display()));
            }
        }
        Ok(())
    }

    fn write(&self, options: &Options, run: &Run, picture: Layers, exposure: f32) -> Result<(), Failure> {
        self.0.iter().try_for_each(|target| target.write(&picture, exposure))?;
        let Some(first) = self.0.first() else { return Ok(()) };
        options.dump.iter().try_for_each(|name| dump::write(name, run.plan(), run, first.path()))
    }
}

/// `out.exr` as `out.0007.exr`.
fn numbered(path: &Path, frame: Option<u32>) -> PathBuf {
    match (frame, path.extension()) {
        (Some(frame), Some(ending)) => path.with_extension(format!("{frame:04}.{}", ending.to_string_lossy())),
        _ => path.to_owned(),
    }
}

/// Enough to make the picture again.
fn attributes(options: &Options, view: &View, run: &Run, (frame, time): (&Frame, f64), camera: &Camera) -> BTreeMap<String, String> {
    let mut attributes = options.scene.attributes(view, (&run.stage().scene, time), camera);
    attributes.extend(own_attributes(options, run.plan(), frame));
    attributes
}

/// Those of them that are known before the frame is rendered.
fn lasting_attributes(options: &Options, view: &View, plan: &Plan, frame: &Frame) -> BTreeMap<String, String> {
    let mut attributes = options.scene.lasting_attributes(view, still_camera(view, frame));
    attributes.extend(own_attributes(options, plan, frame));
    // Where records are kept is no matter of the picture.
    attributes.remove("cache");
    attributes
}

/// Those of a picture that this command renders.
fn own_attributes(options: &Options, plan: &Plan, frame: &Frame) -> BTreeMap<String, String> {
    let own = [
        ("command", "render".to_owned()),
        ("pipeline", plan.pipeline.clone()),
        ("set", frame.sets.join(" ")),
        ("frame", frame.number.to_string()),
        ("bounces", judged_bounces(plan).to_string()),
        ("stride", "1".to_owned()),
    ];
    let mut attributes: BTreeMap<String, String> = own.map(|(name, value)| (name.to_owned(), value)).into();
    // What a picture with these depends on besides is not in the file: other frames, other runs, the machine's speed.
    attributes.extend(options.time.map(|time| ("time".to_owned(), time.as_secs_f64().to_string())));
    if options.samples > 1 {
        attributes.extend([(PIXEL_SAMPLES, options.samples.to_string()), (PIXEL_FILTER, options.filter.name())].map(|(name, value)| (name.to_owned(), value)));
    }
    attributes.extend(options.cache.as_ref().map(|cache| ("cache".to_owned(), cache.display().to_string())));
    attributes
}

/// The report of a frame for people.
fn text(options: &Options, frame: u32, report: &FrameReport) -> String {
    let mut text = format!("{} frame {frame}: {:.3} s", options.pipeline, report.seconds);
    let numbers = [
        ("records", report.records.irradiance),
        ("radiance records", report.records.radiance),
        ("new", report.new_records),
        ("surplus", report.surplus_records),
        ("rounds", report.fill_rounds),
        ("waits", Some(report.waits)),
        ("uncovered pixels", report.uncovered_pixels),
    ];
    let coarse = report.coarse_pixels.filter(|pixels| *pixels > 0);
    for (name, number) in numbers.into_iter().chain([("coarse pixels", coarse)]) {
        if let Some(number) = number {
            text += &format!(", {number} {name}");
        }
    }
    text += &format!("\n  {:<14} {:<16} {:>10} {:>10} {:>6}\n", "node", "pass", "device ms", "host ms", "runs");
    for pass in &report.passes {
        let gpu = pass.gpu_ms.map_or("-".to_owned(), |ms| format!("{ms:.1}"));
        text += &format!("  {:<14} {:<16} {:>10} {:>10.1} {:>6}\n", pass.node, pass.pass, gpu, pass.cpu_ms, pass.runs);
    }
    text
}

fn statistics(film: &Film<'_>, run: &Run, gpu: &Gpu, start_up: &StartUp, complete: bool) -> Value {
    let (plan, view) = (run.plan(), film.view);
    json!({
        "schema": 1,
        "pipeline": plan.pipeline,
        "scene": view.stage.scene.name,
        "triangles": view.stage.scene.triangles.len(),
        "adapter": AdapterReport::from(&gpu.adapter),
        "size": view.size,
        "samples": film.options.samples,
        "complete": complete,
        "frames": film.frames,
        "start_up": {
            "load_seconds": start_up.load,
            "plan_seconds": start_up.plan,
            "device_seconds": start_up.device,
            "shaders_seconds": start_up.shaders,
        },
        "peak_gpu_bytes": run.gpu_bytes(),
        "peak_host_bytes": peak_host_bytes(),
        "plan": { "dropped": dropped(plan), "approximated": plan.approximated() },
    })
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds.ok_or_else(|| "expected a number of seconds, such as 2.5".to_owned())
}
