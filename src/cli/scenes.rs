//! `hemisplat scenes`

use super::console::Console;
use super::failure::Failure;
use super::shipped::{list, name, unknown};
use crate::scene::load::{about, embedded_scenes, find_embedded};
use clap::Args;
use std::path::Path;

/// List the scenes that ship, or print one to start from
#[derive(Args)]
#[command(after_help = "Example: hemisplat scenes cornell > mine.ron

Without a name, each is listed with what it shows.")]
pub struct Options {
    /// A scene of the list
    name: Option<String>,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let all = || embedded_scenes().filter_map(|file| find_embedded(Path::new(file)));
    let Some(asked) = &options.name else {
        return console.print(&list(&all().map(|(file, text)| (name(file), about(text).unwrap_or_default())).collect::<Vec<_>>()));
    };
    let (_, text) = find_embedded(Path::new(asked)).ok_or_else(|| unknown("scene", asked, all().map(|(file, _)| name(file))))?;
    console.print(text)
}
