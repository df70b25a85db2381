//! `hemisplat completions`

use super::console::Console;
use super::failure::Failure;
use clap::{Args, CommandFactory};
use clap_complete::Shell;

/// Print a shell's completions
#[derive(Args)]
#[command(after_help = "Example: hemisplat completions bash > ~/.local/share/bash-completion/completions/hemisplat")]
pub struct Options {
    /// The shell
    shell: Shell,
}

pub fn run<P: CommandFactory>(options: &Options, console: &Console) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut P::command(), "hemisplat", &mut script);
    console.print(&String::from_utf8_lossy(&script))
}
