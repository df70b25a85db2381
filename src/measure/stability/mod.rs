//! The extremes at which numbers break, and what must hold there: each case is a scene, parameters and a claim.

mod bench;
mod cases;
mod lobes;
mod rooms;

pub use bench::{Bench, LoadPipeline};
pub use cases::CASES;

use super::run::RunError;
use crate::pipeline::Problems;
use crate::scene::load::SceneError;
use serde::Serialize;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// One extreme.
pub struct Case {
    pub name: &'static str,
    /// What goes wrong without care.
    pub guards_against: &'static str,
    pub must_hold: &'static str,
    /// Whether it takes long.
    pub is_long: bool,
    run: fn(&Bench<'_>) -> Result<String, Trouble>,
}

/// How a case ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    Pass,
    Fail,
    /// The pipeline does not do what the case is about.
    DoesNotApply,
}

/// What a case found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    pub case: &'static str,
    pub must_hold: &'static str,
    pub seen: String,
    pub verdict: Verdict,
}

/// What keeps a case from its claim.
#[derive(Debug)]
enum Trouble {
    /// A scene, a parameter or a limit was refused before work started.
    Refused(String),
    /// The work ended with an error that names a layer whose light is not finite.
    NotFinite(String),
    Failed(String),
    /// The pipeline does not do what the case is about.
    Absent(String),
}

impl Case {
    /// Runs the case. A panic is a failure, as is a refusal where none is due.
    pub fn run(&self, bench: &Bench<'_>) -> Outcome {
        let result = catch_unwind(AssertUnwindSafe(|| (self.run)(bench))).unwrap_or_else(|panic| Err(Trouble::Failed(format!("panic: {}", told(&*panic)))));
        let (seen, verdict) = match result {
            Ok(seen) => (seen, Verdict::Pass),
            Err(Trouble::Absent(why)) => (why, Verdict::DoesNotApply),
            Err(Trouble::Refused(message)) => (format!("refused: {message}"), Verdict::Fail),
            Err(Trouble::NotFinite(message) | Trouble::Failed(message)) => (message, Verdict::Fail),
        };
        Outcome { case: self.name, must_hold: self.must_hold, seen, verdict }
    }
}

/// What a panic says.
fn told(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("without a word")
}

impl From<SceneError> for Trouble {
    fn from(error: SceneError) -> Self {
        Self::Refused(format!("{} ({})", error, error.problem().code()))
    }
}

impl From<Problems> for Trouble {
    fn from(Problems(problems): Problems) -> Self {
        let told: Vec<String> = problems.iter().map(|problem| format!("{problem} ({})", problem.code)).collect();
        Self::Refused(told.join("; "))
    }
}

impl From<RunError> for Trouble {
    fn from(error: RunError) -> Self {
        match error {
            _ if error.is_refusal() => Self::Refused(error.to_string()),
            RunError::NonFinite { .. } => Self::NotFinite(error.to_string()),
            _ => Self::Failed(error.to_string()),
        }
    }
}
