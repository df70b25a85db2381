//! Pages with figures between two marks.

use crate::{Failure, data::Lists, template::render};
use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

/// At the start of a line, so that text may name it.
const START: &str = "\n<!-- figures: ";
const END: &str = "<!-- end of figures -->";
pub const TEMPLATES: &str = "benches/figures/templates";

/// README and the pages of the book, from the root of the project.
pub fn pages(root: &Path) -> Result<Vec<PathBuf>, Failure> {
    let book = fs::read_dir(root.join("docs"))?.map(|entry| Ok(Path::new("docs").join(entry?.file_name())));
    let mut pages: Vec<PathBuf> = book.collect::<Result<Vec<_>, std::io::Error>>()?;
    pages.retain(|page| page.extension().is_some_and(|ending| ending == "md"));
    pages.push("README.md".into());
    pages.sort();
    Ok(pages)
}

/// A page with the text between every two marks made anew; the templates that it uses are added to `used`.
pub fn renewed(root: &Path, lists: &Lists, text: &str, used: &mut BTreeSet<String>) -> Result<String, Failure> {
    let mut parts = text.split(START);
    let mut page = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (name, rest) = part.split_once(" -->\n").ok_or("`<!-- figures:` is not closed by ` -->`")?;
        let (before, after) = rest.split_once(END).ok_or_else(|| format!("the figures `{name}` do not end with `{END}`"))?;
        let path = format!("{TEMPLATES}/{name}.txt");
        let template = fs::read_to_string(root.join(&path)).map_err(|error| format!("cannot read {path}: {error}"))?;
        let body = render(root, lists, &template, before).map_err(|error| format!("{path}: {error}"))?;
        used.insert(name.to_owned());
        page += &format!("{START}{name} -->\n{body}{END}{after}");
    }
    Ok(page)
}

/// The heads of tables that stand outside of the marks and hold figures: a cell with a point between digits or a unit after them.
pub fn tables_by_hand(text: &str) -> Vec<String> {
    let outside: String =
        text.split(START).enumerate().map(|(index, part)| if index == 0 { part } else { part.split_once(END).map_or("", |(_, after)| after) }).collect();
    let lines: Vec<&str> = outside.split("```").step_by(2).flat_map(str::lines).collect();
    let mut heads = Vec::new();
    for index in (0..lines.len()).filter(|index| is_rule(lines[*index])) {
        let rows = lines[index + 1..].iter().take_while(|line| line.starts_with('|'));
        let (cells, figures) = rows
            .flat_map(|row| row.split('|'))
            .fold((0, 0), |(cells, figures), cell| (cells + usize::from(!cell.trim().is_empty()), figures + usize::from(is_figure(cell))));
        if figures * 3 > cells {
            heads.push(lines[index.max(1) - 1].to_owned());
        }
    }
    heads
}

fn is_rule(line: &str) -> bool {
    line.starts_with('|') && line.contains("---") && line.chars().all(|letter| "|-: ".contains(letter))
}

/// Whether a cell is a number, perhaps with a unit or an interval.
fn is_figure(cell: &str) -> bool {
    let cell = cell.trim().trim_matches('*');
    cell.starts_with(|letter: char| letter.is_ascii_digit() || "+−-<".contains(letter)) && cell.chars().any(|letter| letter.is_ascii_digit())
}
