//! `hemisplat pipelines`

use super::console::Console;
use super::failure::Failure;
use super::shipped::{list, name, unknown};
use crate::pipeline::document;
use crate::pipeline::embedded::{EMBEDDED, find};
use clap::Args;
use std::io::ErrorKind;

/// List the pipelines that ship, or print one to start from
#[derive(Args)]
#[command(after_help = "Example: hemisplat pipelines irradiance > mine.ron

Without a name, each is listed with what it does. `hemisplat explain` tells what a scene leaves of one.")]
pub struct Options {
    /// A pipeline of the list
    name: Option<String>,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let Some(asked) = &options.name else {
        return console.print(&list(&EMBEDDED.iter().map(|(file, _)| (name(file), about(file))).collect::<Vec<_>>()));
    };
    let (_, text) = find(asked).ok_or_else(|| unknown("pipeline", asked, EMBEDDED.iter().map(|(file, _)| name(file))))?;
    console.print(text)
}

/// What a pipeline says about itself, and what it is a variant of.
fn about(file: &str) -> String {
    let (document, _) = document::read(file, &[], &mut |_| Err(ErrorKind::NotFound.into()));
    let Some(document) = document else { return String::new() };
    let variant = document.of.map(|of| format!(" (a variant of {})", of.trim_end_matches(".ron")));
    document.about + &variant.unwrap_or_default()
}
