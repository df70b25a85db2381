//! Pages with figures between two marks.

use crate::{Failure, data::Lists, template::render};
use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

/// At the start of a line, so that text may name it.
pub const START: &str = "\n<!-- figures: ";
pub const END: &str = "<!-- end of figures -->";
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
