//! How a command ends when it does not succeed.

use crate::gpu::GpuError;
use crate::measure::run::{ChangeError, RunError};
use miette::Diagnostic;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// An error and the exit status that it means.
pub struct Failure {
    /// 2 for bad usage or bad input, 130 after Ctrl-C, 1 for everything else.
    pub status: u8,
    pub report: Box<dyn Diagnostic + Send + Sync>,
}

impl Failure {
    /// The user gave something that cannot be used: status 2.
    pub fn input(error: impl Diagnostic + Send + Sync + 'static) -> Self {
        Self { status: 2, report: Box::new(error) }
    }

    /// The input is good, the work failed: status 1.
    pub fn work(error: impl Diagnostic + Send + Sync + 'static) -> Self {
        Self { status: 1, report: Box::new(error) }
    }

    /// A run ended early: by Ctrl-C before anything was written, or because the work failed.
    pub fn of_run(error: RunError) -> Self {
        match error {
            RunError::Gpu(GpuError::Interrupted) => Self::interrupted(&[]),
            other => Self::work(other),
        }
    }

    /// A scene that cannot change so, or a run that ended early thereby.
    pub fn of_change(error: ChangeError) -> Self {
        match error {
            ChangeError::Run(error) => Self::of_run(error),
            other => Self::input(other),
        }
    }

    /// Ctrl-C: status 130. `kept` says what was written nevertheless.
    pub fn interrupted(kept: &[&Path]) -> Self {
        let names: Vec<String> = kept.iter().map(|path| path.display().to_string()).collect();
        let kept = if names.is_empty() { "nothing was written".to_owned() } else { format!("what was whole is in {}", names.join(", ")) };
        Self { status: 130, report: Box::new(CommandError::Interrupted { kept }) }
    }

    /// A file cannot be read: status 2.
    pub fn read(path: &Path, source: io::Error) -> Self {
        Self::input(CommandError::Read { path: path.to_owned(), source })
    }

    /// What caused it, in words: the last of the causes.
    pub fn cause(&self) -> String {
        std::iter::successors(self.report.source(), |cause| cause.source()).last().map_or_else(|| self.report.to_string(), |cause| cause.to_string())
    }

    /// A file cannot be written: status 1.
    pub fn write(path: &Path, source: io::Error) -> Self {
        Self::work(CommandError::Write { path: path.to_owned(), source })
    }
}

/// What goes wrong in commands themselves.
#[derive(Debug, Error, Diagnostic)]
pub enum CommandError {
    #[error("cannot read {}", path.display())]
    #[diagnostic(code(cli::read))]
    Read { path: PathBuf, source: io::Error },
    #[error("cannot write {}", path.display())]
    #[diagnostic(code(cli::write), help("nothing was left behind, an earlier file of that name is unchanged"))]
    Write { path: PathBuf, source: io::Error },
    #[error("{} is there already", path.display())]
    #[diagnostic(code(cli::exists), help("it stays as it is; take another name, or move it away"))]
    Exists { path: PathBuf },
    #[error("`{name}` does not name {what}")]
    #[diagnostic(code(cli::bad_name), help("{help}"))]
    BadName { name: String, what: &'static str, help: &'static str },
    #[error("there is no passes/mod.rs here: passes are written in a checkout of hemisplat")]
    #[diagnostic(code(cli::no_checkout), help("clone hemisplat and run this in its top folder; scenes and pipelines may stand anywhere"))]
    NoCheckout,
    #[error("cannot tell the format of {}", path.display())]
    #[diagnostic(code(cli::unknown_format), help("pictures are written as .exr, .png or .hdr, sequences also as .apng"))]
    UnknownFormat { path: PathBuf },
    #[error("{} is an animation, and there is one frame", path.display())]
    #[diagnostic(code(cli::no_sequence), help("--frames A..B renders a sequence; a picture is written as .exr, .png or .hdr"))]
    NoSequence { path: PathBuf },
    #[error("--dump writes beside a picture, and none is written")]
    #[diagnostic(code(cli::no_picture), help("add an output .exr or .png"))]
    NoPicture,
    #[error("{} would be written twice, or over what is read", path.display())]
    #[diagnostic(code(cli::same_file), help("give every file a name of its own"))]
    SameFile { path: PathBuf },
    #[error("{}: {error}", path.display())]
    #[diagnostic(forward(error))]
    BadPicture { path: PathBuf, error: crate::measure::PictureError },
    #[error("the two pictures share no layer: one holds {test}, the other {reference}")]
    #[diagnostic(code(cli::no_common_layer), help("name one for each: A.exr:LAYER B.exr:LAYER"))]
    NoCommonLayer { test: String, reference: String },
    #[error("{} has one layer and does not say what it is", path.display())]
    #[diagnostic(code(cli::nameless_layer), help("say so: {0}:irradiance or {0}:picture, or name the other file's layer that it is to be compared with", path.display()))]
    NamelessLayer { path: PathBuf },
    #[error("{} shows something else than {}: {}", reference.display(), test, differences.join("; "))]
    #[diagnostic(code(cli::other_view), help("compare pictures of one scene, camera and light; --anyway takes these all the same"))]
    OtherView { reference: PathBuf, test: String, differences: Vec<String> },
    #[error("the pipelines make light of different bounces: {made}")]
    #[diagnostic(
        code(cli::several_bounces),
        help("say how many the reference is to hold: --bounces all, or --bounces N; what a pipeline leaves out of them counts as its error")
    )]
    SeveralBounces { made: String },
    #[error("{}", failed.join("; "))]
    #[diagnostic(code(cli::over_threshold))]
    OverThreshold { failed: Vec<String> },
    #[error("a case fails: {}", failed.join("; "))]
    #[diagnostic(code(cli::unstable), help("the table says what was seen and what had to hold; --only CASE --json FILE looks closer"))]
    Unstable { failed: Vec<String> },
    #[error("no change can come: the pipeline and the scene are of those that ship with the program")]
    #[diagnostic(code(cli::nothing_to_watch), help("`hemisplat pipelines NAME > mine.ron` and `hemisplat scenes NAME > room.ron` make files to edit"))]
    NothingToWatch,
    #[error("the scene has no camera `{name}`")]
    #[diagnostic(code(cli::unknown_camera), help("its cameras: {known}"))]
    UnknownCamera { name: String, known: String },
    #[error("the camera's eye is where it is to look")]
    #[diagnostic(code(cli::target_in_eye), help("give --eye and --target different places; without --target it is the middle of the scene"))]
    TargetInEye,
    #[error("the camera looks along its own up")]
    #[diagnostic(code(cli::up_along_view), help("give an --up that is no multiple of the way from --eye to --target"))]
    UpAlongView,
    #[error("the result cannot be written as JSON: {reason}")]
    #[diagnostic(code(cli::json))]
    Json { reason: String },
    #[error("frame {frame}: {what}")]
    #[diagnostic(code(render::incomplete), help("{help}"))]
    Incomplete { frame: u32, what: String, help: String },
    #[error("frame {frame} cannot share memory and shaders with the frames before it: {what}")]
    #[diagnostic(
        code(render::other_plan),
        help("its parameters are {sets}; between frames only those can change that neither sizes nor shaders depend on, such as an accuracy")
    )]
    OtherPlan { frame: u32, sets: String, what: String },
    #[error("the pipeline keeps no records that {} could hold", path.display())]
    #[diagnostic(code(render::no_records), help("leave --cache away"))]
    NoRecords { path: PathBuf },
    #[error("{} is written in one go, and cannot be gone on with", path.display())]
    #[diagnostic(code(render::resumed_movie), help("leave --resume away, or write the frames as .exr, .png or .hdr"))]
    ResumedMovie { path: PathBuf },
    #[error("several cameras are named: {names}")]
    #[diagnostic(code(cli::several_cameras), help("this command looks through one; `hemisplat render` makes a frame of each"))]
    SeveralCameras { names: String },
    #[error("the reference {} cannot judge these pipelines: {error}", path.display())]
    #[diagnostic(forward(error))]
    BadReference { path: PathBuf, error: crate::measure::MetricsError },
    #[error("{} cannot be judged: {error}", path.display())]
    #[diagnostic(forward(error))]
    BadGiven { path: PathBuf, error: crate::measure::MetricsError },
    #[error("`{layer}` of {} is no layer that pictures are judged by", path.display())]
    #[diagnostic(code(compare::not_judged), help("say what it holds: {judged}"))]
    NotJudged { path: PathBuf, layer: String, judged: String },
    #[error("there is no folder to keep references in")]
    #[diagnostic(code(compare::no_cache), help("name one with --reference-cache, or give a reference"))]
    NoReferenceCache,
    #[error("references cannot be kept in {}", folder.display())]
    #[diagnostic(
        code(compare::unusable_cache),
        help("make room or rights there, name another folder with --reference-cache, or give a reference with --reference")
    )]
    UnusableCache { folder: PathBuf, source: io::Error },
    #[error("the reference could not be kept in {}: {reason}", path.display())]
    #[diagnostic(
        code(compare::not_kept),
        help("this run goes on with it, the next one traces it again; make room there, or name another folder with --reference-cache")
    )]
    NotKept { path: PathBuf, reason: String },
    #[error("`{variant}` names no pipeline")]
    #[diagnostic(code(compare::no_pipeline), help("write PIPELINE or PIPELINE@NODE.PARAM=VALUE, such as irradiance@tiles.resolution=32"))]
    NoPipeline { variant: String },
    #[error("`{parameter}` is swept twice")]
    #[diagnostic(code(sweep::same_parameter), help("give all its values to one --over"))]
    SweptTwice { parameter: String },
    #[error("`{first}` and `{second}` are the same pipeline")]
    #[diagnostic(code(sweep::same_pipeline), help("each point of a sweep is measured once: leave one away"))]
    SamePoint { first: String, second: String },
    #[error("the sweep has {points} points; {most} is the limit")]
    #[diagnostic(code(sweep::too_many), help("sweep fewer parameters at once, or give them fewer values"))]
    TooManyPoints { points: usize, most: usize },
    #[error("{refused} of {points} points are refused")]
    #[diagnostic(code(sweep::refused), help("what refuses them stands in the table; the others stand as they are"))]
    RefusedPoints { refused: usize, points: usize },
    #[error("what the study expects did not come: {}", missed.join("; "))]
    #[diagnostic(code(study::unexpected), help("the last table tells what was measured; mend what is wrong, or state in the study's file what holds now"))]
    Unexpected { missed: Vec<String> },
    #[error("nothing is called `{name}` in this plan")]
    #[diagnostic(code(render::unknown_dump), help("it has: {known}"))]
    UnknownDump { name: String, known: String },
    #[error("the system lets this program start {granted} threads more; it needs {wanted}")]
    #[diagnostic(code(cli::few_threads), help("raise the limit on processes: `ulimit -u`, or that of the container; RAYON_NUM_THREADS=1 needs fewer"))]
    FewThreads { granted: usize, wanted: usize },
    #[error("the threads that share the work cannot be started: {reason}")]
    #[diagnostic(code(cli::no_threads), help("raise the limit on processes: `ulimit -u`, or that of the container"))]
    NoThreads { reason: String },
    #[error("the limit on memory is {limit} MiB; this needs about {wanted} MiB")]
    #[diagnostic(
        code(cli::little_memory),
        help("raise the limit with `ulimit -v`, or make the picture, the batch of the fill or the scene smaller. What a driver reserves counts, used or not")
    )]
    LittleMemory { limit: u64, wanted: u64 },
    #[error("a fault of hemisplat: {message}, at {place}")]
    #[diagnostic(code(cli::fault), help("please report it with the command and its files; with RUST_BACKTRACE=1 it tells more"))]
    Fault { message: String, place: String },
    #[error("interrupted; {kept}")]
    #[diagnostic(code(cli::interrupted))]
    Interrupted { kept: String },
    #[error("Ctrl-C cannot be listened to: {reason}")]
    #[diagnostic(code(cli::signal), help("where no thread can be started for it, raise the limit on processes: `ulimit -u`, or that of the container"))]
    Signal { reason: String },
}
