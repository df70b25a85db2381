//! `hemisplat graph`

use super::console::Console;
use super::failure::Failure;
use super::pipeline::{load_pipeline, note_names};
use crate::pipeline::{self, export};
use clap::{Args, ValueEnum};

/// Draw a pipeline as a graph
#[derive(Args)]
#[command(after_help = "Example: hemisplat graph irradiance --format svg > irradiance.svg")]
pub struct Options {
    /// The pipeline: a file, or the name of one that ships
    pipeline: String,
    /// Graphviz, Mermaid or a picture
    #[arg(long, value_enum, default_value_t = Format::Dot)]
    format: Format,
    /// Change a parameter of a node; may be repeated
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    sets: Vec<String>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    Dot,
    Mermaid,
    Svg,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let format = match options.format {
        Format::Dot => pipeline::Format::Dot,
        Format::Mermaid => pipeline::Format::Mermaid,
        Format::Svg => pipeline::Format::Svg,
    };
    let pipeline = load_pipeline(&options.pipeline, &options.sets)?;
    note_names([&pipeline], console);
    console.print(&export(&pipeline, format))
}
