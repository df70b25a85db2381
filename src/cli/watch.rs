//! `--watch`: the same again each time that a file changes which was looked for.

use super::console::Console;
use super::failure::{CommandError, Failure};
use super::interrupt::{self, Shelter};
use super::lookups::Lookups;
use super::scene::{SceneOptions, View};
use crate::gpu::{Gpu, block_on};
use crate::scene::load::Stamp;
use std::collections::BTreeMap;
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

/// How often files are looked at. One that an editor replaces may be gone for a moment: what has changed must look the same twice.
const TICK: Duration = Duration::from_millis(250);

/// What a round leaves to the next: the device, the scene, and how the files of the pipeline and of the scene stood when they were read.
#[derive(Default)]
pub struct Kept {
    gpu: Option<Arc<Gpu>>,
    view: Option<View>,
    pub pipeline_files: Lookups,
    scene_files: Lookups,
    is_watched: bool,
}

/// What a round works with, and how long it took to get it [seconds].
pub struct Ready<'k> {
    pub gpu: Result<&'k Arc<Gpu>, Failure>,
    pub view: &'k View,
    pub device: f64,
    pub load: f64,
}

/// Renders in rounds, until Ctrl-C. A round that fails is told, and mended by the next; `written` is what one that succeeds has made.
///
/// # Errors
/// The interruption; and that no change could come.
pub fn rounds(written: &[&Path], console: &Console, mut round: impl FnMut(&mut Kept) -> Result<(), Failure>) -> Result<(), Failure> {
    let (mut kept, mut why, mut made): (_, _, &[&Path]) = (Kept { is_watched: true, ..Kept::default() }, String::new(), &[]);
    loop {
        let start = Instant::now();
        let result = round(&mut kept);
        let outcome = match result {
            Ok(()) => {
                made = written;
                interrupt::keep_earlier();
                format!("rendered in {:.3} s", start.elapsed().as_secs_f64())
            }
            Err(failure) if failure.status == 130 => return Err(if made.is_empty() { failure } else { Failure::interrupted(made) }),
            Err(failure) if kept.is_idle() => return Err(failure),
            Err(failure) => {
                console.report(&*failure.report);
                kept.recover(&failure);
                if made.is_empty() { "not rendered".to_owned() } else { "not rendered, what there is stays".to_owned() }
            }
        };
        let files = kept.files();
        console.note(&format!("{why}{outcome}; watching {files} file{}, Ctrl-C ends", if files == 1 { "" } else { "s" }));
        let Some(changed) = kept.wait() else { return Err(Failure::interrupted(made)) };
        why = format!("{} changed: ", changed.join(", "));
        kept.forget_changed();
    }
}

impl Kept {
    /// Opens the device while the scene loads; what there is already is kept.
    pub fn ready(&mut self, scene: &SceneOptions, console: &Console) -> Result<Ready<'_>, Failure> {
        let (gpu, view) = (self.gpu.take(), self.view.take());
        let ((gpu, device), (view, load)) = thread::scope(|scope| {
            let gpu = scope.spawn(|| timed(|| gpu.map_or_else(|| block_on(Gpu::open()), Ok)));
            let view = timed(|| view.map_or_else(|| scene.load_timeline(&self.scene_files, console), Ok));
            (gpu.join().unwrap_or_else(|panic| resume_unwind(panic)), view)
        });
        let gpu = gpu.map(|gpu| &*self.gpu.insert(gpu)).map_err(Failure::work);
        let view = self.view.insert(view?);
        if self.is_watched && self.pipeline_files.files() + self.scene_files.files() == 0 {
            return Err(Failure::input(CommandError::NothingToWatch));
        }
        Ok(Ready { gpu, view, device, load })
    }

    fn files(&self) -> usize {
        self.pipeline_files.files() + self.scene_files.files()
    }

    /// Whether all was found, and no change can come to it.
    fn is_idle(&self) -> bool {
        self.view.is_some() && self.files() == 0
    }

    /// After a failure of the work, the device may be the cause.
    fn recover(&mut self, failure: &Failure) {
        if failure.status == 1 {
            self.gpu = None;
        }
    }

    /// Files that have changed, once they are still; None after Ctrl-C.
    fn wait(&self) -> Option<Vec<String>> {
        let _shelter = Shelter::new();
        let mut before = BTreeMap::new();
        loop {
            thread::sleep(TICK);
            let now = self.changes();
            match () {
                () if interrupt::requested() => return None,
                () if !now.is_empty() && now == before => return Some(now.into_keys().map(|path| path.display().to_string()).collect()),
                () => before = now,
            }
        }
    }

    fn changes(&self) -> BTreeMap<PathBuf, Stamp> {
        let mut changes = self.pipeline_files.changes();
        changes.extend(self.scene_files.changes());
        changes
    }

    /// A pipeline is soon read anew; a scene is kept as long as its files are what they were.
    fn forget_changed(&mut self) {
        self.pipeline_files = Lookups::default();
        if self.view.is_none() || !self.scene_files.changes().is_empty() {
            (self.view, self.scene_files) = (None, Lookups::default());
        }
    }
}

/// What a step makes, and how long it takes [seconds].
pub fn timed<T>(step: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let made = step();
    (made, start.elapsed().as_secs_f64())
}
