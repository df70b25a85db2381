//! The expectations of a study, as its file has them.

use super::Reader;
use crate::measure::criteria::Metric;
use crate::measure::expectation::{Claim, Expectation, Quantity};
use crate::measure::survey::{Row, Swept};
use crate::pipeline::Problem;
use crate::pipeline::diagnostics::known;
use crate::pipeline::grammar::{Keys, named_fields};
use crate::pipeline::syntax::{Body, Place, Value, ValueKind};
use std::collections::BTreeMap;

const KEYS: [&str; 6] = ["row", "at", "of", "over", "within", "paper"];

/// What expectations are about.
pub(super) struct About<'s> {
    pub(super) rows: &'s [Row],
    pub(super) over: &'s [Swept],
    pub(super) metric: Metric,
}

impl Reader {
    /// None where nothing is expected.
    pub(super) fn expectations(&mut self, keys: &Keys<'_>, about: &About<'_>) -> Vec<Expectation> {
        let Some(value) = keys.found.get("expect") else { return Vec::new() };
        self.items(value, "a list of expectations").iter().filter_map(|item| self.expectation(item, about)).collect()
    }

    fn expectation(&mut self, value: &Value, about: &About<'_>) -> Option<Expectation> {
        let fields = match &value.kind {
            ValueKind::Compound { name: None, body } => named_fields(body),
            _ => None,
        };
        let Some(fields) = fields else {
            self.grammar.wrong_type(value, "an expectation such as `(row: \"…\", at: {\"node.parameter\": value}, within: (0.1, 0.2))`");
            return None;
        };
        let keys = self.grammar.keys("an expectation", &value.place, fields, &KEYS);
        let row = self.grammar.required(&keys, "row").and_then(|value| self.row_named(value, about.rows));
        let over = self.optional(&keys, "over", |reader, value| reader.row_named(value, about.rows));
        let at = self.values_at(&keys, &value.start(), about.over);
        let of = match keys.found.get("of") {
            None => Some(Quantity::Error(about.metric)),
            Some(Value { kind: ValueKind::Compound { name: Some(name), body: Body::Empty }, .. }) if name.text == "Cost" => Some(Quantity::Cost),
            Some(value) => self.metric(value).map(Quantity::Error),
        };
        let within = self.grammar.required(&keys, "within").and_then(|value| self.range(value));
        let paper = self.optional(&keys, "paper", Self::claim);
        Some(Expectation { row: row?, at: at?, of: of?, over, within: within?, paper })
    }

    pub(super) fn row_named(&mut self, value: &Value, rows: &[Row]) -> Option<String> {
        let word = self.grammar.word(value, "the name of a row")?;
        let is_there = rows.iter().any(|row| row.name == word.text);
        if !is_there {
            let problem = Problem::new("study::unknown_row", format!("there is no row `{}`", word.text)).at(&word.place, "not a row");
            self.grammar.problems.push(problem.help(known(&word.text, rows.iter().map(|row| row.name.as_str()), "the rows")));
        }
        is_there.then_some(word.text)
    }

    /// One value of each parameter that is swept over several.
    fn values_at(&mut self, keys: &Keys<'_>, place: &Place, over: &[Swept]) -> Option<BTreeMap<String, String>> {
        let mut at = BTreeMap::new();
        for (key, value) in self.grammar.map(keys, "at") {
            let key = self.parameter(&key)?;
            let swept = over.iter().find(|swept| swept.parameter == key.text);
            let values = swept.map_or(Vec::new(), |swept| swept.sets.iter().map(|set| set.value.written()).collect::<Vec<_>>());
            if !values.contains(&value.written()) {
                let what = swept.map_or(format!("the study does not sweep `{}`", key.text), |_| format!("`{}` does not take this value", key.text));
                let known = swept.map_or(over.iter().map(|swept| swept.parameter.as_str()).collect(), |_| values);
                let problem = Problem::new("study::no_point", what).at(&value.place, "no point has this");
                self.grammar.problems.push(problem.help(format!("it has: {}", known.join(", "))));
                return None;
            }
            at.insert(key.text, value.written().to_owned());
        }
        if let Some(open) = over.iter().find(|swept| swept.sets.len() > 1 && !at.contains_key(&swept.parameter)) {
            let problem = Problem::new("study::no_point", format!("`at` does not say which value of `{}` is meant", open.parameter));
            self.grammar.problems.push(problem.at(place, "this expects something of several points").help("an expectation is of one point"));
            return None;
        }
        Some(at)
    }

    /// `(least, most)`
    fn range(&mut self, value: &Value) -> Option<[f64; 2]> {
        let ends = match &value.kind {
            ValueKind::Compound { name: None, body: Body::Positional(ends) } if ends.len() == 2 => [self.amount(&ends[0])?, self.amount(&ends[1])?],
            _ => {
                self.grammar.wrong_type(value, "the least and the most such as `(0.1, 0.2)`");
                return None;
            }
        };
        if ends[0] > ends[1] {
            let problem = Problem::new("study::out_of_range", format!("nothing is between {} and {}", ends[0], ends[1]));
            self.grammar.problems.push(problem.at(&value.place, "the least comes first"));
            return None;
        }
        Some(ends)
    }

    /// A number, or `Below(1)`.
    fn claim(&mut self, value: &Value) -> Option<Claim> {
        match &value.kind {
            ValueKind::Compound { name: Some(name), body: Body::Positional(ends) } if name.text == "Below" && ends.len() == 1 => {
                self.amount(&ends[0]).map(|below| Claim::Below { below })
            }
            ValueKind::Number(_) => self.amount(value).map(Claim::Value),
            _ => {
                self.grammar.wrong_type(value, "what the source says, a number or `Below(1)`");
                None
            }
        }
    }

    /// A number from 0 on.
    fn amount(&mut self, value: &Value) -> Option<f64> {
        let ValueKind::Number(text) = &value.kind else {
            self.grammar.wrong_type(value, "a number");
            return None;
        };
        let amount = text.parse().ok().filter(|amount: &f64| amount.is_finite() && *amount >= 0.0);
        if amount.is_none() {
            let problem = Problem::new("study::out_of_range", format!("an error or a cost cannot be {text}"));
            self.grammar.problems.push(problem.at(&value.place, "expected a number from 0 on"));
        }
        amount
    }
}
