//! What every kind of document shares: a version, keys that stand once, values of the right kind. What is wrong is collected, so that all of it is told.

use super::diagnostics::{Problem, known};
use super::syntax::{Body, Field, Place, Value, ValueKind, Word};
use std::collections::BTreeMap;

/// The version of the grammar.
pub const VERSION: &str = "1";

/// Reads groups of keys.
#[derive(Default)]
pub struct Grammar {
    pub problems: Vec<Problem>,
}

/// The keys of a group, each once.
pub struct Keys<'v> {
    pub owner: String,
    pub place: Place,
    pub found: BTreeMap<&'v str, &'v Value>,
}

impl Grammar {
    pub fn refuse_repeated(&mut self, owner: &str, fields: &mut Vec<Field>) {
        let mut seen: BTreeMap<String, Place> = BTreeMap::new();
        fields.retain(|field| {
            let first = seen.get(&field.name.text);
            if let Some(first) = first {
                let problem = Problem::new("document::duplicate_key", format!("`{}` is given twice in {owner}", field.name.text));
                self.problems.push(problem.at(&field.name.place, "again here").at(first, "first here"));
                return false;
            }
            seen.insert(field.name.text.clone(), field.name.place.clone());
            true
        });
    }

    pub fn keys<'v>(&mut self, owner: &str, place: &Place, fields: &'v [Field], accepted: &[&str]) -> Keys<'v> {
        self.refuse_repeated(owner, &mut fields.to_vec());
        let mut found = BTreeMap::new();
        for field in fields {
            if accepted.contains(&field.name.text.as_str()) {
                found.entry(field.name.text.as_str()).or_insert(&field.value);
            } else {
                let problem = Problem::new("document::unknown_key", format!("{owner} has no `{}`", field.name.text));
                let help = known(&field.name.text, accepted.iter().copied(), "what can stand here");
                self.problems.push(problem.at(&field.name.place, "unknown").help(help));
            }
        }
        Keys { owner: owner.into(), place: place.clone(), found }
    }

    pub fn required<'v>(&mut self, keys: &Keys<'v>, key: &str) -> Option<&'v Value> {
        let found = keys.found.get(key).copied();
        if found.is_none() {
            let problem = Problem::new("document::missing_key", format!("{} needs `{key}`", keys.owner));
            self.problems.push(problem.at(&keys.place, format!("`{key}` is missing")));
        }
        found
    }

    pub fn map(&mut self, keys: &Keys<'_>, key: &str) -> Vec<(Value, Value)> {
        match keys.found.get(key) {
            None => Vec::new(),
            Some(Value { kind: ValueKind::Map(entries), .. }) => entries.clone(),
            Some(value) => {
                self.wrong_type(value, "a map such as {\"name\": value}");
                Vec::new()
            }
        }
    }

    /// The version decides what everything else means: nothing is read of one that is not known.
    pub fn version(&mut self, head: &Word, fields: &[Field]) -> bool {
        let version = fields.iter().find(|field| field.name.text == "version").map(|field| &field.value);
        let problem = match version {
            Some(Value { kind: ValueKind::Number(number), .. }) if number == VERSION => return true,
            Some(value) => Problem::new("document::version", format!("version {VERSION} is known, this is {}", value.phrase()))
                .at(&value.place, "unknown version")
                .help("a newer hemisplat may read it"),
            None => Problem::new("document::missing_key", format!("{} needs `version`", head.text)).at(&head.place, "`version` is missing"),
        };
        self.problems.push(problem);
        false
    }

    pub fn text(&mut self, keys: &Keys<'_>, key: &str, required: bool) -> String {
        let value = if required { self.required(keys, key) } else { keys.found.get(key).copied() };
        value.and_then(|value| self.word(value, "a string")).map(|word| word.text).unwrap_or_default()
    }

    /// None where it is not given.
    pub fn flag(&mut self, keys: &Keys<'_>, key: &str) -> Option<bool> {
        let value = keys.found.get(key).copied()?;
        if let ValueKind::Bool(flag) = value.kind {
            return Some(flag);
        }
        self.wrong_type(value, "true or false");
        None
    }

    pub fn word(&mut self, value: &Value, expected: &str) -> Option<Word> {
        let word = value.word();
        if word.is_none() {
            self.wrong_type(value, expected);
        }
        word
    }

    pub fn wrong_type(&mut self, value: &Value, expected: &str) {
        let problem = Problem::new("document::wrong_type", format!("expected {expected}, got {}", value.phrase()));
        self.problems.push(problem.at(&value.place, format!("expected {expected}")));
    }
}

/// The fields between parentheses; None where values stand there without names.
pub fn named_fields(body: &Body) -> Option<&[Field]> {
    match body {
        Body::Empty => Some(&[]),
        Body::Named(fields) => Some(fields),
        Body::Positional(_) => None,
    }
}
