//! A bar for what takes longer than a second.

use super::console::Console;
use super::interrupt;
use super::legible::clean;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

const STEPS: u64 = 1000;
/// Of work whose share that is done is known.
const BAR: &str = "{msg} {wide_bar} {percent} % {eta}";
/// Of work that ends when nothing is left to do.
const SPINNER: &str = "{spinner} {msg} {elapsed}";
const PATIENCE: Duration = Duration::from_secs(1);

/// The progress of one piece of work, shown on stderr if that is a terminal.
pub struct Progress {
    what: String,
    template: &'static str,
    quiet: bool,
    started: Instant,
    bar: OnceLock<ProgressBar>,
}

impl Progress {
    /// `what` is being done, such as `path tracing`.
    pub fn new(console: &Console, what: &str) -> Self {
        Self::with_template(console, what, BAR)
    }

    /// The same where nobody knows how much there is to do.
    pub fn open_ended(console: &Console, what: &str) -> Self {
        Self::with_template(console, what, SPINNER)
    }

    fn with_template(console: &Console, what: &str, template: &'static str) -> Self {
        Self { what: clean(what).into_owned(), template, quiet: console.quiet, started: Instant::now(), bar: OnceLock::new() }
    }

    /// Takes note of the share that is done, 0..1, from any thread. False once the user asked to stop.
    pub fn report(&self, share: f32) -> bool {
        if !self.quiet && self.started.elapsed() > PATIENCE {
            self.bar.get_or_init(|| self.draw()).set_position((share.clamp(0.0, 1.0) * STEPS as f32) as u64);
        }
        !interrupt::requested()
    }

    /// Says what is being done of open-ended work, such as `round 7`.
    pub fn tell(&self, doing: impl FnOnce() -> String) {
        if !self.quiet && self.started.elapsed() > PATIENCE {
            let bar = self.bar.get_or_init(|| self.draw());
            bar.set_message(clean(&format!("{}, {}", self.what, doing())).into_owned());
            bar.tick();
        }
    }

    fn draw(&self) -> ProgressBar {
        let style = ProgressStyle::with_template(self.template).unwrap_or_else(|_| ProgressStyle::default_bar());
        ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr())
            .with_style(style)
            .with_message(self.what.clone())
            .with_elapsed(self.started.elapsed())
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = self.bar.get() {
            bar.finish_and_clear();
        }
    }
}
