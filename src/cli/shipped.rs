//! What ships inside the program: lists of it, and documents to start one's own from.

use super::failure::Failure;
use crate::pipeline::Problem;
use crate::pipeline::diagnostics::known;

/// A line for each: its name, and what it says about itself.
pub fn list(shipped: &[(&str, String)]) -> String {
    let width = shipped.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    shipped.iter().map(|(name, about)| format!("{name:<width$}  {about}\n")).collect()
}

/// The name of a document that ships, as commands take it.
pub fn name(file: &'static str) -> &'static str {
    file.strip_suffix(".ron").unwrap_or(file)
}

/// Nothing of this `kind` ships under this name.
pub fn unknown(kind: &str, asked: &str, names: impl IntoIterator<Item = &'static str>) -> Failure {
    let problem = Problem::new("cli::not_shipped", format!("no {kind} called `{asked}` ships with the program"));
    Failure::input(problem.help(known(asked, names, "these do")))
}
