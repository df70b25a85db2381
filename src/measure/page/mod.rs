//! A sweep or a comparison as one HTML file that needs nothing else: no network, no other file.
//!
//! What was found goes into the page as JSON, the light of pictures packed in it, plots as SVG; a script draws the rest. Nothing in the data is ever read as
//! HTML. Where no script runs, a table tells what was found.

mod charts;
mod gallery;
mod plain;
mod planes;
mod records;
mod report;

pub use gallery::{Gallery, Moment};
pub use records::Overlay;
pub use report::{Beside, Differences, ErrorsTold, Report, Told};

use super::layers::PictureError;
use gallery::Exhibition;
use serde::Serialize;

const HTML: &str = include_str!("page.html");
const CSS: &str = include_str!("page.css");
/// Several files of one scope.
const SCRIPT: &str = concat!(
    "\"use strict\";\n(() => {\n",
    include_str!("script/head.js"),
    include_str!("script/pictures.js"),
    include_str!("script/insets.js"),
    include_str!("script/records.js"),
    include_str!("script/frames.js"),
    include_str!("script/stage.js"),
    include_str!("script/keep.js"),
    include_str!("script/results.js"),
    include_str!("script/start.js"),
    "})();\n"
);

#[derive(Serialize)]
struct Data<'p> {
    report: &'p Report,
    gallery: Exhibition,
}

/// The page of a report; the frames of the gallery hold a picture of each of its points, in their order.
pub fn page(report: &Report, gallery: &Gallery) -> Result<String, PictureError> {
    let json = serde_json::to_string(&Data { report, gallery: gallery.show() }).map_err(|error| PictureError::Encoding { reason: error.to_string() })?;
    Ok(fill(HTML, &[("{title}", &escape(&report.title)), ("{css}", CSS), ("{table}", &plain::table(report)), ("{data}", &inert(&json)), ("{script}", SCRIPT)]))
}

/// Replaces each mark, in their order; what was put in is not looked at again.
fn fill(template: &str, parts: &[(&str, &str)]) -> String {
    let mut rest = template;
    let mut page = String::with_capacity(template.len() + parts.iter().map(|(_, part)| part.len()).sum::<usize>());
    for (mark, part) in parts {
        let (before, after) = rest.split_once(mark).unwrap_or((rest, ""));
        page.push_str(before);
        page.push_str(part);
        rest = after;
    }
    page + rest
}

/// Text as HTML shows it.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// JSON that can end no script: within its strings, where alone it may hold the sign, `<` is written as a number.
fn inert(json: &str) -> String {
    json.replace('<', "\\u003c")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_put_in_is_no_mark() {
        assert_eq!(fill("a {x} b {y} c", &[("{x}", "{y}"), ("{y}", "2")]), "a {y} b 2 c");
    }

    #[test]
    fn the_template_has_every_mark_once() {
        for mark in ["{title}", "{css}", "{table}", "{data}", "{script}"] {
            assert_eq!(HTML.matches(mark).count(), 1, "{mark}");
        }
    }

    #[test]
    fn text_ends_no_element() {
        assert_eq!(escape("<script> & </title>"), "&lt;script&gt; &amp; &lt;/title&gt;");
        let json = serde_json::to_string("</script><!--<script>").unwrap();
        assert!(!inert(&json).contains('<'));
        assert_eq!(serde_json::from_str::<String>(&inert(&json)).unwrap(), "</script><!--<script>");
    }
}
