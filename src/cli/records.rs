//! The file that keeps records between runs, and all else that the next frame of a sequence finds of those before it.

use super::console::Console;
use super::failure::{CommandError, Failure};
use super::input::read_file;
use super::output::Target;
use super::scene::View;
use super::timeline::{Frame, Timeline, camera_of_frame};
use crate::gpu::block_on;
use crate::measure::cache::{self, After, Cache, Given, accumulates, fingerprint};
use crate::measure::run::Run;
use std::path::Path;
use std::time::{Duration, Instant};

/// How often the file is saved while a sequence is rendered, if that is quick.
const OFTEN: Duration = Duration::from_secs(5);

/// Of the time, saving takes no more than one part in so many.
const SHARE: u32 = 50;

/// The file, and what it held before.
pub struct RecordsFile {
    target: Target,
    /// None where there was none.
    found: Option<Cache>,
}

impl RecordsFile {
    pub fn open(path: &Path) -> Result<Self, Failure> {
        let target = Target::new(path)?;
        let contents = path.exists().then(|| read_file(path, cache::MOST_BYTES).map_err(|error| Failure::read(path, error))).transpose()?;
        let found = contents.map(|contents| Cache::of_file(&contents)).transpose().map_err(Failure::input)?;
        Ok(Self { target, found })
    }

    pub fn path(&self) -> &Path {
        self.target.path()
    }

    /// How many frames of a timeline came before it was saved; None where it is of no frame of them, nor of the one before them.
    pub fn frames_before(&self, timeline: &Timeline, view: &View) -> Option<usize> {
        let after = self.found.as_ref()?.after()?;
        let next = after.frame.checked_add(1)?;
        let count = next.checked_sub(timeline.frames[0].number)? as usize;
        (count <= timeline.frames.len() && timeline.time(view, next) == after.next).then_some(count)
    }

    /// Whether there was one.
    pub fn was_there(&self) -> bool {
        self.found.is_some()
    }
}

/// The file of a run that is under way.
pub struct Keeping<'f> {
    file: &'f RecordsFile,
    /// What the run begins with.
    found: Option<&'f Cache>,
    /// After the last frame that is whole.
    latest: Option<Cache>,
    is_saved: bool,
    saved_at: Instant,
    /// What it took to save last.
    cost: Duration,
}

/// How a run begins.
pub enum Beginning {
    /// From what the frame before its first has left, at this exposure if one was chosen [stops].
    Next(Option<f32>),
    /// From records of another time, and why.
    Records(String),
    /// With light that has to be found anew.
    Anew,
    /// Without any.
    Empty,
}

impl<'f> Keeping<'f> {
    /// Of a run that takes over what there is unless it `begins_anew`; refuses one that has nothing to keep.
    pub fn of(file: &'f RecordsFile, run: &Run, begins_anew: bool) -> Result<Self, Failure> {
        if run.plan().persistent.is_empty() {
            return Err(Failure::input(CommandError::NoRecords { path: file.path().to_owned() }));
        }
        let found = file.found.as_ref().filter(|_| !begins_anew);
        Ok(Self { file, found, latest: None, is_saved: true, saved_at: Instant::now(), cost: Duration::ZERO })
    }

    /// The moment that a run's scene is to be brought to before it [takes over](Self::begin) what there is [s].
    pub fn moment(&self) -> Option<f64> {
        self.found.map(Cache::moment)
    }

    /// Has a run take over what there is before it renders a frame.
    pub fn begin(&self, run: &mut Run, (timeline, view): (&Timeline, &View), first: &Frame) -> Result<Beginning, Failure> {
        let Some(found) = self.found else { return Ok(Beginning::Empty) };
        let before = found.after();
        let moment = view.animation().at(found.moment());
        let number = before.map_or(first.number, |after| after.frame);
        let camera = camera_of_frame(view, (&Frame { number, sets: Vec::new() }, &moment), &run.stage().scene);
        let is_next = before.is_some_and(|after| after.frame.checked_add(1) == Some(first.number) && after.next == timeline.time(view, first.number));
        if is_next || !view.animation().is_empty() {
            run.see_before(&camera);
        }
        match found.give(run, is_next).map_err(Failure::input)? {
            Given::All => return Ok(Beginning::Next(before.and_then(|after| after.exposure))),
            Given::Items if accumulates(run) => return Ok(Beginning::Anew),
            Given::Accumulated | Given::Items => {}
        }
        Ok(Beginning::Records(match before {
            None => "no frame had been ended when it was saved".to_owned(),
            Some(_) if is_next => "another pipeline or another version of hemisplat has left it".to_owned(),
            Some(after) => format!("frame {} at {} s was the last that it saw", after.frame, found.moment()),
        }))
    }

    /// Keeps what a frame that is whole has left; every few seconds, in the file.
    pub fn keep(&mut self, run: &Run, (scene, moment): (String, f64), after: After) -> Result<(), Failure> {
        let cache = Cache::of(run, (scene, moment), Some(after));
        self.latest = Some(block_on(cache).map_err(Failure::work)?);
        self.is_saved = false;
        if self.saved_at.elapsed() < OFTEN.max(SHARE * self.cost) { Ok(()) } else { self.save() }
    }

    /// Saves what there is after the last whole frame; before there is one, what the run has, unless it `is_faulty`. Whether there was anything new.
    pub fn end(&mut self, run: &Run, moment: f64, is_faulty: bool) -> Result<bool, Failure> {
        if self.latest.is_none() && !is_faulty {
            let scene = fingerprint(&run.stage().scene);
            self.latest = Some(block_on(Cache::of(run, (scene, moment), None)).map_err(Failure::work)?);
            self.is_saved = false;
        }
        let is_new = self.latest.is_some();
        if self.is_saved { Ok(is_new) } else { self.save().map(|()| is_new) }
    }

    fn save(&mut self) -> Result<(), Failure> {
        let start = Instant::now();
        if let Some(latest) = &self.latest {
            self.file.target.write(&latest.to_file().map_err(Failure::work)?)?;
        }
        (self.is_saved, self.saved_at, self.cost) = (true, Instant::now(), start.elapsed());
        Ok(())
    }

    pub fn path(&self) -> &'f Path {
        self.file.path()
    }
}

impl Beginning {
    /// Says that what would have lived on has to be found anew.
    pub fn tell(&self, run: &Run, path: &Path, console: &Console) {
        match self {
            Self::Records(why) if run.plan().schedule.lives_on() => console.note(&format!("note: all records of {} are sampled anew: {why}", path.display())),
            Self::Anew => console.note(&format!("note: the light of {} is found anew, as this version of hemisplat cannot go on with it", path.display())),
            Self::Records(_) | Self::Next(_) | Self::Empty => {}
        }
    }
}
