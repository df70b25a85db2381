//! What the user sees: results on stdout, messages on stderr.

use super::failure::Failure;
use super::legible::{Legible, clean};
use clap::{Args, ValueEnum};
use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme};
use std::io::{self, IsTerminal, Write};
use std::path::Path;

/// Columns of a report where no terminal says how wide it is.
const WIDTH: usize = 120;

/// Writes a result to standard output, whose reader may have closed its end.
pub fn write_stdout(result: &[u8]) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(result).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}

#[derive(Args)]
pub struct ConsoleOptions {
    /// Say nothing but errors on stderr
    #[arg(long, short, global = true)]
    quiet: bool,
    /// Colours in messages
    #[arg(long, global = true, value_enum, default_value_t = Colour::Auto, value_name = "WHEN")]
    color: Colour,
}

#[derive(Clone, Copy, ValueEnum)]
enum Colour {
    Auto,
    Always,
    Never,
}

/// Where messages go, and how.
#[derive(Clone, Copy)]
pub struct Console {
    pub quiet: bool,
    colour: bool,
    /// Whether standard output is for a file named `-` alone.
    has_file: bool,
}

impl Console {
    /// Where `has_file` says so, tables for people go to stderr: standard output is one of the files to be written.
    pub fn new(options: &ConsoleOptions, has_file: bool) -> Self {
        let colour = match options.color {
            Colour::Auto => io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty()),
            Colour::Always => true,
            Colour::Never => false,
        };
        Self { quiet: options.quiet, colour, has_file }
    }

    /// The same that says nothing but errors.
    pub fn silenced(self) -> Self {
        Self { quiet: true, ..self }
    }

    #[cfg(test)]
    pub fn silent() -> Self {
        Self { quiet: true, colour: false, has_file: false }
    }

    /// Prints a result. A reader that has closed its end, such as `head`, is no failure.
    pub fn print(&self, result: &str) -> Result<(), Failure> {
        if self.has_file {
            self.note(result.trim_end());
            return Ok(());
        }
        write_stdout(clean(result).as_bytes()).map_err(|error| Failure::write(Path::new("standard output"), error))
    }

    /// Says something that is not a result, unless told to be quiet.
    pub fn note(&self, message: &str) {
        if !self.quiet {
            self.say(&clean(message));
        }
    }

    /// Shows an error with its code, its source and what helps.
    pub fn report(&self, diagnostic: &dyn Diagnostic) {
        self.show(&Legible::new(diagnostic));
    }

    /// Shows a warning in the same way.
    pub fn warn(&self, diagnostic: &dyn Diagnostic) {
        self.show(&Legible::new(diagnostic).into_warning());
    }

    fn show(&self, diagnostic: &Legible<'_>) {
        let theme = if self.colour { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
        let mut text = String::new();
        match GraphicalReportHandler::new_themed(theme).with_links(false).with_width(WIDTH).render_report(&mut text, diagnostic) {
            Ok(()) => self.say(text.trim_end()),
            Err(_) => self.say(&diagnostic.to_string()),
        }
    }

    fn say(&self, message: &str) {
        // A closed stderr leaves nobody to tell.
        let _ = writeln!(io::stderr(), "{message}");
    }
}
