//! A study: a measurement as a file, with the scene, the rows, what is swept, and what errors and costs are.
//!
//! ```ron
//! Study(version: 1, about: "…", source: "…", scene: "…", camera: "…", size: (64, 64), reference: Traced(spp: 1024), runs: 5,
//!     metric: "rms_of_relative", cost: PerRecord(["node"]), moved: ["node"], set: {"node.parameter": value},
//!     rows: [(name: "…", pipeline: "…", set: {"node.parameter": value})], over: {"node.parameter": [value, value]},
//!     expect: [(row: "…", at: {"node.parameter": value}, within: (0.1, 0.2), paper: 0.15)])
//! ```

pub mod embedded;
mod expect;

use super::criteria::{Cost, Metric};
use super::survey::{Row, Survey, Swept};
use crate::pipeline::grammar::{Grammar, Keys, named_fields};
use crate::pipeline::syntax::{self, Body, Field, Value, ValueKind, Word};
use crate::pipeline::{Problem, Problems, Set};
use std::ops::RangeInclusive;

const KEYS: [&str; 15] =
    ["version", "about", "source", "scene", "camera", "size", "reference", "runs", "metric", "cost", "moved", "set", "rows", "over", "expect"];

/// Runs of each point where nothing is said, of sweeps too.
pub const DEFAULT_RUNS: u16 = 5;

pub struct Study {
    pub about: String,
    /// Paper and section.
    pub source: String,
    /// As the document names it.
    pub scene: String,
    pub camera: Option<String>,
    /// Width and height [pixels]; the camera's own if not given.
    pub size: Option<[u32; 2]>,
    pub reference: Reference,
    pub survey: Survey,
}

/// What errors are against.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reference {
    /// Rays per pixel, at every how many pixels, or in how many windows.
    Traced { spp: u32, stride: u32, windows: Option<u32> },
    /// The pictures of a row, by its index, at the same values of what is swept.
    Row(usize),
}

/// Reads a study from its text; `name` is what messages call it.
///
/// # Errors
/// All that is wrong at once, but for what only the pipelines can tell.
pub fn read(name: &str, text: &str) -> Result<Study, Problems> {
    let source = syntax::source(name, text.trim_start_matches('\u{feff}'));
    let value = syntax::parse(&source, 0..source.inner().len()).map_err(|problem| Problems(vec![problem]))?;
    let head = match &value.kind {
        ValueKind::Compound { name: Some(head), body } if head.text == "Study" => named_fields(body).map(|fields| (head, fields)),
        _ => None,
    };
    let Some((head, fields)) = head else {
        let problem = Problem::new("study::not_a_study", format!("expected a study, got {}", value.phrase()));
        return Err(Problems(vec![problem.at(&value.start(), "here").help("a file holds `Study(version: 1, …)`")]));
    };
    let mut reader = Reader::default();
    match reader.study(head, fields) {
        Some(study) if reader.grammar.problems.is_empty() => Ok(study),
        _ => Err(Problems(reader.grammar.problems)),
    }
}

#[derive(Default)]
struct Reader {
    grammar: Grammar,
}

impl Reader {
    fn study(&mut self, head: &Word, fields: &[Field]) -> Option<Study> {
        if !self.grammar.version(head, fields) {
            return None;
        }
        let keys = self.grammar.keys("Study", &head.place, fields, &KEYS);
        let about = self.grammar.text(&keys, "about", true);
        let source = self.grammar.text(&keys, "source", false);
        let scene = self.grammar.text(&keys, "scene", true);
        let camera = self.optional(&keys, "camera", Self::text);
        let size = self.optional(&keys, "size", Self::size);
        let runs = self.optional(&keys, "runs", |reader, value| reader.number(value, "the runs", 1..=500));
        let metric = self.optional(&keys, "metric", Self::metric);
        let cost = self.optional(&keys, "cost", Self::cost);
        let moved = self.optional(&keys, "moved", Self::moved).unwrap_or_default();
        let common = self.sets(&keys);
        let rows = self.rows(&keys, &common);
        let over = self.over(&keys);
        let reference = self.grammar.required(&keys, "reference").and_then(|value| self.reference(value, &rows));
        let metric = metric.unwrap_or_default();
        let expected = self.expectations(&keys, &expect::About { rows: &rows, over: &over, metric });
        let survey = Survey { rows, over, runs: runs.map_or(DEFAULT_RUNS, |runs| runs as u16), metric, cost: cost.unwrap_or(Cost::Seconds), moved, expected };
        Some(Study { about, source, scene, camera, size, reference: reference?, survey })
    }

    fn optional<T>(&mut self, keys: &Keys<'_>, key: &str, read: impl FnOnce(&mut Self, &Value) -> Option<T>) -> Option<T> {
        keys.found.get(key).and_then(|value| read(self, value))
    }

    fn text(&mut self, value: &Value) -> Option<String> {
        self.grammar.word(value, "a string").map(|word| word.text)
    }

    fn number(&mut self, value: &Value, what: &str, range: RangeInclusive<u32>) -> Option<u32> {
        let ValueKind::Number(text) = &value.kind else {
            self.grammar.wrong_type(value, "a whole number");
            return None;
        };
        let number = text.parse().ok().filter(|number| range.contains(number));
        if number.is_none() {
            let problem = Problem::new("study::out_of_range", format!("{what} cannot be {text}"));
            self.grammar.problems.push(problem.at(&value.place, format!("expected a whole number from {} to {}", range.start(), range.end())));
        }
        number
    }

    fn size(&mut self, value: &Value) -> Option<[u32; 2]> {
        match &value.kind {
            ValueKind::Compound { name: None, body: Body::Positional(sides) } if sides.len() == 2 => {
                let [width, height] = [0, 1].map(|side| self.number(&sides[side], "a side of the picture", 1..=crate::scene::MAX_SIDE));
                Some([width?, height?])
            }
            _ => {
                self.grammar.wrong_type(value, "width and height such as `(640, 480)`");
                None
            }
        }
    }

    fn metric(&mut self, value: &Value) -> Option<Metric> {
        let word = self.grammar.word(value, "the name of a metric")?;
        let metric = word.text.parse::<Metric>();
        metric.map_err(|expected| self.grammar.problems.push(unknown_metric(&word, expected))).ok()
    }

    fn cost(&mut self, value: &Value) -> Option<Cost> {
        Cost::read(value).map_err(|problem| self.grammar.problems.push(problem)).ok()
    }

    fn moved(&mut self, value: &Value) -> Option<Vec<Word>> {
        self.items(value, "a list of names of nodes").iter().map(|item| self.grammar.word(item, "the name of a node")).collect()
    }

    /// `Traced(spp: …, stride: …)`, `Traced(spp: …, windows: …)` or `Row("…")`.
    fn reference(&mut self, value: &Value, rows: &[Row]) -> Option<Reference> {
        match &value.kind {
            ValueKind::Compound { name: Some(name), body: Body::Named(fields) } if name.text == "Traced" => {
                let keys = self.grammar.keys("Traced", &name.place, fields, &["spp", "stride", "windows"]);
                let spp = self.grammar.required(&keys, "spp").and_then(|value| self.number(value, "the rays of a pixel", 2..=1 << 24));
                let stride = self.optional(&keys, "stride", |reader, value| reader.number(value, "the stride", 1..=1 << 14));
                let windows = self.optional(&keys, "windows", |reader, value| reader.number(value, "the windows", 1..=1 << 12));
                if stride.is_some() && windows.is_some() {
                    let problem = Problem::new("study::stride_and_windows", "a reference has a stride or windows".to_owned());
                    self.grammar.problems.push(problem.at(&name.place, "has both").help("keep one of them"));
                }
                Some(Reference::Traced { spp: spp?, stride: stride.unwrap_or(1), windows })
            }
            ValueKind::Compound { name: Some(name), body: Body::Positional(values) } if name.text == "Row" && values.len() == 1 => {
                let name = self.row_named(&values[0], rows)?;
                rows.iter().position(|row| row.name == name).map(Reference::Row)
            }
            _ => {
                self.grammar.wrong_type(value, "`Traced(spp: …)` or `Row(\"…\")`");
                None
            }
        }
    }

    fn sets(&mut self, keys: &Keys<'_>) -> Vec<Set> {
        let entries = self.grammar.map(keys, "set");
        entries.into_iter().filter_map(|(key, value)| Some(Set { key: self.parameter(&key)?, value })).collect()
    }

    fn parameter(&mut self, key: &Value) -> Option<Word> {
        self.grammar.word(key, "a node and a parameter such as \"node.parameter\"")
    }

    fn rows(&mut self, keys: &Keys<'_>, common: &[Set]) -> Vec<Row> {
        let Some(value) = self.grammar.required(keys, "rows") else { return Vec::new() };
        let mut rows: Vec<(Word, Row)> = Vec::new();
        for item in self.items(value, "a list of rows") {
            let Some((name, row)) = self.row(item, common) else { continue };
            if let Some((first, _)) = rows.iter().find(|(other, _)| other.text == name.text) {
                let problem = Problem::new("study::duplicate_row", format!("two rows are called `{}`", name.text));
                self.grammar.problems.push(problem.at(&name.place, "again here").at(&first.place, "first here"));
                continue;
            }
            rows.push((name, row));
        }
        rows.into_iter().map(|(_, row)| row).collect()
    }

    fn row(&mut self, value: &Value, common: &[Set]) -> Option<(Word, Row)> {
        let ValueKind::Compound { name: None, body: Body::Named(fields) } = &value.kind else {
            self.grammar.wrong_type(value, "a row such as `(name: \"…\", pipeline: \"…\")`");
            return None;
        };
        let keys = self.grammar.keys("a row", &value.place, fields, &["name", "pipeline", "set"]);
        let [name, pipeline] = ["name", "pipeline"].map(|key| self.grammar.required(&keys, key).and_then(|value| self.grammar.word(value, "a string")));
        let sets = common.iter().cloned().chain(self.sets(&keys)).collect();
        let (name, pipeline) = (name?, pipeline?);
        Some((name.clone(), Row { name: name.text, pipeline: pipeline.text, place: Some(pipeline.place), sets }))
    }

    fn over(&mut self, keys: &Keys<'_>) -> Vec<Swept> {
        if self.grammar.required(keys, "over").is_none() {
            return Vec::new();
        }
        let entries = self.grammar.map(keys, "over");
        if let (true, Some(value)) = (entries.is_empty(), keys.found.get("over").filter(|value| matches!(value.kind, ValueKind::Map(_)))) {
            self.empty(value);
        }
        let mut over: Vec<Swept> = Vec::new();
        for (key, values) in entries {
            let Some(key) = self.parameter(&key) else { continue };
            let sets = self.items(&values, "a list of values").iter().map(|value| Set { key: key.clone(), value: value.clone() }).collect();
            if over.iter().any(|swept| swept.parameter == key.text) {
                let problem = Problem::new("sweep::same_parameter", format!("`{}` is swept twice", key.text)).at(&key.place, "again here");
                self.grammar.problems.push(problem.help("give all its values to one list"));
                continue;
            }
            over.push(Swept { parameter: key.text, sets });
        }
        over
    }

    /// The items of a list that must hold something.
    fn items<'v>(&mut self, value: &'v Value, what: &str) -> &'v [Value] {
        let ValueKind::List(items) = &value.kind else {
            self.grammar.wrong_type(value, what);
            return &[];
        };
        if items.is_empty() {
            self.empty(value);
        }
        items
    }

    fn empty(&mut self, value: &Value) {
        self.grammar.problems.push(Problem::new("study::empty", "this must hold something").at(&value.place, "nothing is here"));
    }
}

fn unknown_metric(word: &Word, expected: String) -> Problem {
    Problem::new("study::unknown_metric", format!("there is no metric `{}`", word.text)).at(&word.place, "not a metric").help(expected)
}
