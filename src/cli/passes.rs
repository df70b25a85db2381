//! `hemisplat passes`

use super::console::Console;
use super::failure::Failure;
use crate::contract::{Description, Input, Parameter, ParameterKind, Takes};
use crate::passes::REGISTRY;
use crate::pipeline::diagnostics::known;
use crate::pipeline::{Loop, Problem, expected};
use clap::Args;
use std::fmt::Write;

/// List the passes, or tell all about one
#[derive(Args)]
#[command(after_help = "Example: hemisplat passes HemisphereTiles")]
pub struct Options {
    /// A pass, or a loop: Fill or Iterate
    name: Option<String>,
    /// All about each pass, or about the one that is named, as Markdown
    #[arg(long)]
    markdown: bool,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let all = || REGISTRY.iter().map(|pass| pass.description()).chain(Loop::ALL.map(Loop::description));
    let Some(name) = &options.name else {
        if options.markdown {
            return console.print(&all().map(markdown).collect::<Vec<_>>().join("\n"));
        }
        return console.print(&all().map(|d| format!("{:<18} {}\n", d.name, d.about)).collect::<String>());
    };
    let found = all().find(|description| description.name == name).ok_or_else(|| {
        let problem = Problem::new("cli::unknown_pass", format!("there is no pass `{name}`"));
        Failure::input(problem.help(known(name, all().map(|d| d.name), "the passes")))
    })?;
    console.print(&if options.markdown { markdown(found) } else { text(found) })
}

fn text(description: &Description) -> String {
    let mut text = format!("{}: {}\nsource: {}\n", description.name, description.about, description.source);
    section(&mut text, "inputs", description.inputs, |input, text| {
        let _ = writeln!(text, "  {}: {}{}\n      {}", input.name, input.accepts.phrase(), optional(input), input.about);
    });
    section(&mut text, "outputs", description.outputs, |output, text| {
        let _ = writeln!(text, "  {}: {}\n      {}", output.name, output.kind.phrase(), output.about);
    });
    section(&mut text, "parameters", description.parameters, |parameter, text| parameter_text(parameter, 1, text));
    text
}

fn section<T>(text: &mut String, title: &str, items: &[T], line: impl Fn(&T, &mut String)) {
    if !items.is_empty() {
        let _ = writeln!(text, "{title}");
        items.iter().for_each(|item| line(item, text));
    }
}

fn optional(input: &Input) -> &'static str {
    match input.takes {
        Takes::One => "",
        Takes::AtMostOne => ", optional",
        Takes::Any => ", any number in a list",
        Takes::Some => ", one or more in a list",
    }
}

fn parameter_text(parameter: &Parameter, depth: usize, text: &mut String) {
    let indent = "  ".repeat(depth);
    let _ = writeln!(text, "{indent}{}: {}", parameter.name, value_text(parameter));
    let _ = writeln!(text, "{indent}    {}", parameter.about);
    if let ParameterKind::Choice { choices } = &parameter.kind {
        for choice in *choices {
            let _ = writeln!(text, "{indent}  {}: {}", choice.name, choice.about);
            choice.parameters.iter().for_each(|inner| parameter_text(inner, depth + 2, text));
        }
    }
}

/// What a parameter accepts, and what it is where nothing is given.
fn value_text(parameter: &Parameter) -> String {
    let unit = if parameter.unit.is_empty() { String::new() } else { format!(" {}", parameter.unit) };
    format!("{}; default {}{unit}", expected(parameter), parameter.kind.default())
}

/// A chapter about a pass.
fn markdown(description: &Description) -> String {
    let mut text = format!("## {}\n\n{}.\n\nSource: {}\n", description.name, description.about, description.source);
    list(&mut text, "Inputs", description.inputs, |input, text| {
        let _ = writeln!(text, "- `{}`: {}{}. {}", input.name, input.accepts.phrase(), optional(input), sentence(input.about));
    });
    list(&mut text, "Outputs", description.outputs, |output, text| {
        let _ = writeln!(text, "- `{}`: {}. {}", output.name, output.kind.phrase(), sentence(output.about));
    });
    list(&mut text, "Parameters", description.parameters, |parameter, text| parameter_item(parameter, 0, text));
    text
}

fn list<T>(text: &mut String, title: &str, items: &[T], item: impl Fn(&T, &mut String)) {
    if !items.is_empty() {
        let _ = writeln!(text, "\n### {title}\n");
        items.iter().for_each(|one| item(one, text));
    }
}

fn parameter_item(parameter: &Parameter, depth: usize, text: &mut String) {
    let indent = "  ".repeat(depth);
    let about = sentence(parameter.about);
    let _ = writeln!(text, "{indent}- `{}`: {}. {about}", parameter.name, value_text(parameter));
    if let ParameterKind::Choice { choices } = &parameter.kind {
        for choice in *choices {
            let _ = writeln!(text, "{indent}  - `{}`: {}", choice.name, sentence(choice.about));
            choice.parameters.iter().for_each(|inner| parameter_item(inner, depth + 2, text));
        }
    }
}

/// With a capital letter and a full stop.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", letters.as_str())
}
