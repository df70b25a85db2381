//! Dials: one number of a pipeline that turns several parameters together, such as how wrong its picture may be.
//!
//! ```ron
//! dials: { "quality": Dial(about: "…", written: 0.02, turns: { "tiles.resolution": { 0.01: 48, 0.02: 36, 0.05: 16 }, … }) }
//! ```
//!
//! Between two of its stops a parameter goes the way in proportion, both as logarithms; beyond the outermost it stays there.

use super::diagnostics::Problem;
use super::document::{Override, path_of};
use super::grammar::{Grammar, named_fields};
use super::syntax::{Value, ValueKind, Word};
use std::fmt;
use std::ops::RangeInclusive;

#[derive(Debug, Clone)]
pub struct Dial {
    pub name: Word,
    /// What its number means.
    pub about: String,
    /// Where the document's own values stand.
    pub written: f64,
    /// Each parameter once.
    pub turns: Vec<Turn>,
}

/// What a dial makes of one parameter.
#[derive(Debug, Clone)]
pub struct Turn {
    /// "node.parameter", or deeper.
    pub key: Word,
    /// By ascending positions; never empty.
    pub stops: Vec<Stop>,
}

#[derive(Debug, Clone)]
pub struct Stop {
    /// Above 0.
    pub at: f64,
    pub value: Value,
}

impl Dial {
    /// Reads `Dial(…)`, which only adds turns to `base` where there is one. None where it cannot be used; the grammar has the problems.
    pub fn read(grammar: &mut Grammar, name: Word, value: &Value, base: Option<&Self>) -> Option<Self> {
        let fields = match &value.kind {
            ValueKind::Compound { name: Some(head), body } if head.text == "Dial" => named_fields(body),
            _ => None,
        };
        let Some(fields) = fields else {
            grammar.wrong_type(value, "a dial such as `Dial(about: \"…\", written: 0.02, turns: {…})`");
            return None;
        };
        let keys = grammar.keys("Dial", &value.start(), fields, &["about", "written", "turns"]);
        let about = base.map(|base| base.about.clone()).filter(|_| !keys.found.contains_key("about"));
        let about = about.unwrap_or_else(|| grammar.text(&keys, "about", true));
        let written = base.map(|base| base.written).filter(|_| !keys.found.contains_key("written"));
        let written = written.or_else(|| grammar.required(&keys, "written").and_then(|value| position(grammar, value)));
        grammar.required(&keys, "turns")?;
        let own: Vec<Turn> = grammar.map(&keys, "turns").into_iter().filter_map(|(key, stops)| Turn::read(grammar, &key, &stops)).collect();
        let is_own = |turn: &Turn| own.iter().any(|other| other.key.text == turn.key.text);
        let turns = base.iter().flat_map(|base| &base.turns).filter(|turn| !is_own(turn)).cloned().chain(own.iter().cloned()).collect();
        let dial = Self { name, about, written: written?, turns };
        if !dial.turns.is_empty() && !dial.range().contains(&dial.written) {
            grammar.problems.push(dial.out_of_range(dial.written, keys.found.get("written").unwrap_or(&value)));
        }
        Some(dial)
    }

    /// The positions that it has.
    pub fn range(&self) -> RangeInclusive<f64> {
        let ends = |turn: &Turn| [turn.stops[0].at, turn.stops[turn.stops.len() - 1].at];
        let all: Vec<f64> = self.turns.iter().flat_map(ends).collect();
        all.iter().copied().fold(f64::INFINITY, f64::min)..=all.iter().copied().fold(0.0, f64::max)
    }

    /// What each parameter is set to where the dial is turned to `value`, a number.
    pub fn turned(&self, grammar: &mut Grammar, key: &Word, value: &Value) -> Vec<(Word, Override)> {
        let Some(at) = position(grammar, value) else { return Vec::new() };
        if !self.range().contains(&at) {
            grammar.problems.push(self.out_of_range(at, value));
            return Vec::new();
        }
        let overridden = |turn: &Turn| {
            let (node, path) = path_of(&turn.key);
            let set = turn.at(at).map(|kind| Value { place: value.place.clone(), kind }).unwrap_or_else(|stop| stop.clone());
            (node, Override { key: key.place.clone(), path, value: set })
        };
        self.turns.iter().map(overridden).collect()
    }

    fn out_of_range(&self, at: f64, value: &Value) -> Problem {
        let (start, end) = self.range().into_inner();
        let problem = Problem::new("pipeline::out_of_range", format!("`{}` is {at}, expects {start} to {end}", self.name.text));
        problem.at(&value.place, "out of range").help(format!("{}: {}", self.name.text, self.about))
    }
}

/// `quality, 0.005 to 0.1, as written 0.02: what it means`
impl fmt::Display for Dial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (start, end) = self.range().into_inner();
        write!(f, "{}, {start} to {end}, as written {}: {}", self.name.text, self.written, self.about)
    }
}

impl Turn {
    fn read(grammar: &mut Grammar, key: &Value, value: &Value) -> Option<Self> {
        let key = grammar.word(key, "a node and a parameter such as \"node.parameter\"")?;
        let ValueKind::Map(entries) = &value.kind else {
            grammar.wrong_type(value, "values by the dial's position such as {0.01: 48, 0.05: 16}");
            return None;
        };
        let mut stops: Vec<Stop> = Vec::new();
        for (at, value) in entries {
            let position = position(grammar, at)?;
            if stops.iter().any(|stop| stop.at == position) {
                let problem = Problem::new("document::duplicate_key", format!("`{}` has two values at {position}", key.text));
                grammar.problems.push(problem.at(&at.place, "again here"));
                return None;
            }
            stops.push(Stop { at: position, value: value.clone() });
        }
        stops.sort_by(|a, b| a.at.total_cmp(&b.at));
        if stops.is_empty() {
            grammar.wrong_type(value, "at least one value by the dial's position");
            return None;
        }
        Some(Self { key, stops })
    }

    /// The value at a position: a number between two stops, or else the stop at or below it.
    fn at(&self, at: f64) -> Result<ValueKind, &Value> {
        let above = self.stops.iter().position(|stop| stop.at > at).unwrap_or(self.stops.len());
        let below = &self.stops[above.saturating_sub(1)];
        let (Some(next), true) = (self.stops.get(above), below.at < at) else { return Err(&below.value) };
        let (Some(from), Some(to)) = (number(&below.value), number(&next.value)) else { return Err(&below.value) };
        let share = (at / below.at).ln() / (next.at / below.at).ln();
        let between = if from > 0.0 && to > 0.0 { from * (to / from).powf(share) } else { from + (to - from) * share };
        let is_whole = |value: &Value| value.written().trim_start_matches('-').bytes().all(|c| c.is_ascii_digit());
        let text = if is_whole(&below.value) && is_whole(&next.value) { format!("{}", between.round()) } else { format!("{between}") };
        Ok(ValueKind::Number(text))
    }
}

/// A number above 0.
fn position(grammar: &mut Grammar, value: &Value) -> Option<f64> {
    let found = number(value).filter(|number| *number > 0.0 && number.is_finite());
    if found.is_none() {
        grammar.wrong_type(value, "a number above 0");
    }
    found
}

fn number(value: &Value) -> Option<f64> {
    match &value.kind {
        ValueKind::Number(number) => ron::from_str(number).ok(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::syntax;
    use super::*;

    fn value(text: &str) -> Value {
        let source = syntax::source("dial.ron", text);
        syntax::parse(&source, 0..text.len()).expect("RON")
    }

    fn dial(turns: &str) -> Dial {
        let text = value(&format!("Dial(about: \"how wrong\", written: 0.02, turns: {turns})"));
        let name = value("\"quality\"").word().expect("a word");
        let mut grammar = Grammar::default();
        let dial = Dial::read(&mut grammar, name, &text, None).expect("a dial");
        assert!(grammar.problems.is_empty(), "{:?}", grammar.problems);
        dial
    }

    /// What a position makes of the parameters, as RON.
    fn turned(dial: &Dial, at: &str) -> Vec<String> {
        let text = |(node, set): (Word, Override)| {
            let ValueKind::Number(number) = &set.value.kind else { return format!("{}.{}={}", node.text, set.path.join("."), set.value.written()) };
            format!("{}.{}={number}", node.text, set.path.join("."))
        };
        let mut grammar = Grammar::default();
        let found = dial.turned(&mut grammar, &dial.name, &value(at)).into_iter().map(text).collect();
        assert!(grammar.problems.is_empty(), "{:?}", grammar.problems);
        found
    }

    #[test]
    fn parameters_go_in_proportion_between_stops_and_stay_beyond() {
        let dial = dial(
            "{\"a.rays\": {0.01: 64, 0.04: 16}, \"b.by.share\": {0.02: 0.1, 0.08: 0.4}, \"c.on\": {0.01: true, 0.03: false}, \"d.off\": {0.01: 2.0, 0.04: 0.0}}",
        );
        assert_eq!(turned(&dial, "0.01"), ["a.rays=64", "b.by.share=0.1", "c.on=true", "d.off=2.0"]);
        assert_eq!(turned(&dial, "0.02"), ["a.rays=32", "b.by.share=0.1", "c.on=true", "d.off=1"]);
        let between = turned(&dial, "0.04");
        assert_eq!((&between[0][..], &between[2..]), ("a.rays=16", &["c.on=false".to_owned(), "d.off=0.0".to_owned()][..]));
        assert!((between[1].trim_start_matches("b.by.share=").parse::<f64>().expect("a number") - 0.2).abs() < 1e-12, "{between:?}");
        assert_eq!(turned(&dial, "0.08")[1], "b.by.share=0.4");
        // Whole numbers stay whole.
        assert_eq!(turned(&dial, "0.03")[0], "a.rays=21");
    }

    #[test]
    fn positions_beyond_the_range_are_refused() {
        let dial = dial("{\"a.rays\": {0.01: 64, 0.04: 16}, \"b.share\": {0.02: 0.1, 0.08: 0.4}}");
        for (at, code) in
            [("0.009", "pipeline::out_of_range"), ("0.09", "pipeline::out_of_range"), ("0", "document::wrong_type"), ("true", "document::wrong_type")]
        {
            let mut grammar = Grammar::default();
            assert!(dial.turned(&mut grammar, &dial.name, &value(at)).is_empty());
            assert_eq!(grammar.problems.iter().map(|problem| problem.code).collect::<Vec<_>>(), [code], "{at}");
        }
    }
}
