//! The program: one file a command, and what the commands share.

mod adapters;
mod camera;
mod check;
mod compare;
mod completions;
mod console;
mod daylight;
mod diff;
mod dump;
mod exhibited;
mod explain;
mod exposure;
mod failure;
mod fault;
mod given;
mod graph;
mod input;
mod interrupt;
mod judge;
mod kept;
mod legible;
mod lightmap;
mod lookups;
mod movie;
mod new;
mod output;
mod overlays;
mod passes;
mod pipeline;
mod pipelines;
mod points;
mod progress;
mod records;
mod reference;
mod render;
mod resources;
mod scene;
mod scenes;
mod sealed;
mod sequence;
mod shipped;
mod stability;
mod stored;
mod study;
mod survey;
mod sweep;
mod timeline;
mod truth;
mod watch;

use clap::{Arg, ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use console::{Console, ConsoleOptions};
use failure::Failure;
use legible::clean;
use resources::Need;
use std::borrow::Cow;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Global illumination on the GPU by caching irradiance: pipelines of passes, wired in RON, measured for speed against accuracy.
#[derive(Parser)]
#[command(name = "hemisplat", version, propagate_version = true, after_help = STATUSES)]
struct Program {
    #[command(flatten)]
    console: ConsoleOptions,
    #[command(subcommand)]
    command: Command,
}

const STATUSES: &str = "\
Environment:
  HEMISPLAT_SCENES   Folders with scenes, separated as in PATH; --scenes comes first
  WGPU_ADAPTER_NAME  Part of the name of the adapter to use; `hemisplat adapters` lists them
  WGPU_BACKEND       The graphics API: vulkan, metal or dx12
  VK_DRIVER_FILES    The Vulkan driver to load, a file .json
  RAYON_NUM_THREADS  How many threads share the work; all cores if not given
  XDG_CACHE_HOME     Where tables and references are kept between runs; ~/.cache if not given
  NO_COLOR           No colours in messages

Exit status: 0 done; 2 bad usage or bad input; 1 any other failure; 130 interrupted.";

/// Options whose value `-` means standard output.
const FILES: [&str; 6] = ["json", "csv", "stats", "svg", "markdown", "html"];

#[derive(Subcommand)]
enum Command {
    Render(render::Options),
    Compare(compare::Options),
    Sweep(sweep::Options),
    Study(study::Options),
    Reference(reference::Options),
    Diff(diff::Options),
    Stability(stability::Options),
    Adapters(adapters::Options),
    #[command(mut_args(of_scene))]
    Check(check::Options),
    Explain(explain::Options),
    Graph(graph::Options),
    Pipelines(pipelines::Options),
    Scenes(scenes::Options),
    New(new::Options),
    Passes(passes::Options),
    Completions(completions::Options),
}

/// What is to be seen of a scene says nothing where no scene is given.
fn of_scene(argument: Arg) -> Arg {
    if ["cameras", "size", "search", "set", "eye", "target", "up", "fov", "print_camera", "sky", "sun"].contains(&argument.get_id().as_str()) {
        argument.requires("scene")
    } else {
        argument
    }
}

impl Command {
    fn need(&self) -> Need {
        match self {
            Self::Render(_) | Self::Compare(_) | Self::Sweep(_) | Self::Study(_) | Self::Stability(_) => Need::Driver,
            Self::Reference(_) | Self::Diff(_) | Self::Check(_) | Self::Explain(_) => Need::Cores,
            Self::Adapters(_) | Self::Graph(_) | Self::Pipelines(_) | Self::Scenes(_) | Self::New(_) | Self::Passes(_) | Self::Completions(_) => Need::Little,
        }
    }

    fn run(self, console: &Console) -> Result<(), Failure> {
        match self {
            Self::Render(options) => render::run(&options, console),
            Self::Compare(options) => compare::run(&options, console),
            Self::Sweep(options) => sweep::run(options, console),
            Self::Study(options) => study::run(options, console),
            Self::Reference(options) => reference::run(&options, console),
            Self::Diff(options) => diff::run(&options, console),
            Self::Stability(options) => stability::run(&options, console),
            Self::Adapters(options) => adapters::run(&options, console),
            Self::Check(options) => check::run(&options, console),
            Self::Explain(options) => explain::run(&options, console),
            Self::Graph(options) => graph::run(&options, console),
            Self::Pipelines(options) => pipelines::run(&options, console),
            Self::Scenes(options) => scenes::run(&options, console),
            Self::New(options) => new::run(&options, console),
            Self::Passes(options) => passes::run(&options, console),
            Self::Completions(options) => completions::run::<Program>(&options, console),
        }
    }
}

/// The program's commands and options, for manuals, completions and the tests of both.
pub fn command() -> clap::Command {
    Program::command()
}

/// Runs the program with the process's arguments.
///
/// Status: 0 done; 2 bad usage or bad input; 1 any other failure; 130 interrupted. Results go to stdout or to named files, messages to stderr.
pub fn run() -> ExitCode {
    without_wayland(|| {
        let parsed = Program::command().try_get_matches().and_then(|matches| Ok((Program::from_arg_matches(&matches)?, writes_to_stdout(&matches))));
        match parsed {
            Ok((program, has_file)) => obey(program, has_file),
            Err(usage) => {
                tell(&usage);
                ExitCode::from(usage.exit_code() as u8)
            }
        }
    })
}

fn obey(program: Program, has_file: bool) -> ExitCode {
    let console = Console::new(&program.console, has_file);
    let work = || interrupt::listen().and_then(|()| resources::prepare(program.command.need())).and_then(|()| program.command.run(&console));
    match fault::guard(&console, work) {
        Some(Ok(())) => ExitCode::SUCCESS,
        Some(Err(failure)) => {
            console.report(&*failure.report);
            ExitCode::from(failure.status)
        }
        None => ExitCode::FAILURE,
    }
}

/// Prints help or wrong usage. Where an argument holds what a terminal might obey, without colours.
fn tell(usage: &clap::Error) {
    let text = usage.render().to_string();
    // Nothing is left to do where even the usage cannot be printed.
    let _ = match clean(&text) {
        _ if std::env::args_os().all(|argument| matches!(clean(&argument.to_string_lossy()), Cow::Borrowed(_))) => usage.print(),
        text if usage.use_stderr() => io::stderr().write_all(text.as_bytes()),
        text => io::stdout().write_all(text.as_bytes()),
    };
}

/// Whether one of the files to be written is standard output.
fn writes_to_stdout(matches: &ArgMatches) -> bool {
    let is_stdout = |matches: &ArgMatches, id| matches!(matches.try_get_one::<PathBuf>(id), Ok(Some(path)) if path == Path::new(output::STDOUT));
    matches.subcommand().is_some_and(|(_, matches)| FILES.iter().any(|id| is_stdout(matches, id)))
}

/// Vulkan's layer that chooses among Mesa's devices asks Wayland for one, whose library complains on stderr where there is no folder for it. With a folder
/// that is not there it finds nothing and says nothing. To be called before there are threads.
fn without_wayland<T>(run: impl FnOnce() -> T) -> T {
    const FOLDER: &str = "XDG_RUNTIME_DIR";
    let is_there = std::env::var_os(FOLDER).is_some_and(|folder| Path::new(&folder).is_absolute());
    if is_there || !cfg!(target_os = "linux") { run() } else { temp_env::with_var(FOLDER, Some("/nonexistent"), run) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_are_declared_without_contradiction() {
        command().debug_assert();
    }

    #[test]
    fn every_command_shows_an_example() {
        for command in command().get_subcommands() {
            let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains(&format!("hemisplat {}", command.get_name())), "{}", command.get_name());
        }
    }
}
