//! The pipeline file as written, before its names and types are checked; variants are resolved here.
//!
//! ```ron
//! Pipeline(version: 1, about: "…", source: "…", specialise: true, nodes: [(name: "a", pass: Pass(parameter: 1, input: "node.output")), …], outputs: {"layer": "a"},
//!     dials: {"quality": Dial(…)})
//! Variant(version: 1, about: "…", of: "other.ron", set: {"node.parameter": value}, replace: {"node": Pass(…)},
//!     remove: ["node"], add: {"node": [(name: …, pass: …)]}, outputs: {…}, dials: {…}, specialise: false)
//! ```
//!
//! A variant removes, replaces, adds (after the node named) and sets, in this order; its outputs, if given, replace all others. Its dials are added; one that there
//! is turns more. Nodes that it removes or replaces are turned no longer; a dial can be removed like a node.

use super::diagnostics::{Problem, known};
use super::dial::Dial;
use super::embedded;
use super::grammar::{Grammar, Keys, named_fields};
use super::loops::Loop;
use super::set::Set;
use super::syntax::{self, Body, Field, Place, Value, ValueKind, Word};
use std::io;
use std::path::{Component, Path, PathBuf};

/// Variants of variants end here.
const MAX_VARIANTS: usize = 32;

/// Reads a text file; the caller decides where files come from.
pub type ReadFile<'a> = dyn FnMut(&Path) -> io::Result<String> + 'a;

/// A pipeline with its variants applied.
#[derive(Debug)]
pub struct Document {
    /// The file as the user named it.
    pub name: String,
    pub about: String,
    /// What it is a variant of, in its own words.
    pub of: Option<String>,
    /// Where the method is from.
    pub reference: String,
    pub nodes: Vec<Node>,
    /// Layer and reference.
    pub outputs: Vec<(Word, Value)>,
    pub dials: Vec<Dial>,
    /// See [`super::Pipeline::specialise`].
    pub specialise: bool,
    /// The name before the parentheses.
    pub place: Place,
    /// Names by which it was found, or what it is a variant of, that stand for others now: in words.
    pub notes: Vec<String>,
    /// Whether every node could be read: if not, a name that is not found may be that of a node that is wrong otherwise.
    pub complete: bool,
}

#[derive(Debug, Clone)]
pub struct Node {
    pub name: Word,
    pub call: Call,
    /// What variants and the command line set, the last one counts.
    pub overrides: Vec<Override>,
    /// The nodes of a loop.
    pub nodes: Option<Vec<Node>>,
}

/// `Pass(field: value, …)`
#[derive(Debug, Clone)]
pub struct Call {
    pub name: Word,
    pub fields: Vec<Field>,
}

/// `"node.parameter.nested": value`, without the node.
#[derive(Debug, Clone)]
pub struct Override {
    pub key: Place,
    pub path: Vec<String>,
    pub value: Value,
}

/// Reads a pipeline by its path or the name of one that ships, follows its variants, applies `sets`.
/// Where some parts cannot be read, the others come with the problems.
pub fn read(name: &str, sets: &[Set], read_file: &mut ReadFile<'_>) -> (Option<Document>, Vec<Problem>) {
    let mut reader = Reader { read_file, grammar: Grammar::default(), chain: Vec::new(), notes: Vec::new(), complete: true };
    let mut document = match reader.find(name, None) {
        Ok(found) => reader.document(found),
        Err(problem) => {
            reader.grammar.problems.push(problem);
            None
        }
    };
    if let Some(document) = &mut document {
        sets.iter().for_each(|set| reader.set(document, &set.key, set.value.clone()));
        document.complete = reader.complete;
        document.notes = reader.notes;
    }
    (document, reader.grammar.problems)
}

/// Where a text came from: a file, or the program itself.
#[derive(Debug, Clone, PartialEq)]
enum Location {
    File(PathBuf),
    Embedded(&'static str),
}

struct Found {
    location: Location,
    name: String,
    text: String,
}

struct Reader<'r, 'f> {
    read_file: &'r mut ReadFile<'f>,
    grammar: Grammar,
    /// The documents that led here, each of which is a variant of the next.
    chain: Vec<Location>,
    /// See [`Document::notes`].
    notes: Vec<String>,
    /// See [`Document::complete`].
    complete: bool,
}

impl Reader<'_, '_> {
    /// `from` is the document that says the name.
    fn find(&mut self, name: &str, from: Option<&Location>) -> Result<Found, Problem> {
        let path = match from {
            Some(Location::Embedded(_)) => None,
            Some(Location::File(file)) => Some(normalised(&file.parent().unwrap_or(Path::new("")).join(name))),
            None => Some(normalised(Path::new(name))),
        };
        if let Some(path) = path {
            match (self.read_file)(&path) {
                Ok(text) => return Ok(Found { name: path.display().to_string(), location: Location::File(path), text }),
                Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::IsADirectory) => {}
                Err(error) => return Err(Problem::new("pipeline::unreadable", format!("cannot read the pipeline {}: {error}", path.display()))),
            }
        }
        let (file, text) = embedded::find(name).ok_or_else(|| {
            // As the name was written: with the ending, or without.
            let shipped = embedded::EMBEDDED.iter().map(|(file, _)| if name.ends_with(".ron") { *file } else { file.trim_end_matches(".ron") });
            Problem::new("pipeline::not_found", format!("there is no pipeline `{name}`")).help(known(name, shipped, "besides files, these ship"))
        })?;
        if let Some(new) = embedded::replaced(name) {
            self.notes.push(format!("`{name}` is called `{new}` now"));
        }
        Ok(Found { location: Location::Embedded(file), name: format!("pipelines/{file}"), text: text.into() })
    }

    fn document(&mut self, found: Found) -> Option<Document> {
        self.chain.push(found.location);
        // Some editors begin a file with a mark of its byte order.
        let source = syntax::source(&found.name, found.text.trim_start_matches('\u{feff}'));
        let value = match syntax::parse(&source, 0..source.inner().len()) {
            Ok(value) => value,
            Err(problem) => {
                self.grammar.problems.push(problem);
                return None;
            }
        };
        if let ValueKind::Compound { name: Some(name), body } = &value.kind {
            let fields = named_fields(body);
            match (name.text.as_str(), fields) {
                ("Pipeline", Some(fields)) => return self.pipeline(found.name, name, fields),
                ("Variant", Some(fields)) => return self.variant(found.name, name, fields),
                _ => {}
            }
        }
        let problem = Problem::new("pipeline::not_a_pipeline", format!("expected a pipeline, got {}", value.phrase()));
        self.grammar.problems.push(problem.at(&value.start(), "here").help("a file holds `Pipeline(version: 1, …)` or `Variant(version: 1, …)`"));
        None
    }

    fn pipeline(&mut self, name: String, head: &Word, fields: &[Field]) -> Option<Document> {
        if !self.grammar.version(head, fields) {
            return None;
        }
        let keys = self.grammar.keys("Pipeline", &head.place, fields, &["version", "about", "source", "specialise", "nodes", "outputs", "dials"]);
        let about = self.grammar.text(&keys, "about", true);
        let reference = self.grammar.text(&keys, "source", false);
        let specialise = self.grammar.flag(&keys, "specialise").unwrap_or(true);
        let nodes = self.grammar.required(&keys, "nodes").map(|value| self.nodes(value));
        self.complete &= nodes.is_some();
        let outputs = self.grammar.required(&keys, "outputs").map_or(Vec::new(), |value| self.outputs(value));
        let dials = self.dials(&keys, Vec::new());
        let (nodes, place) = (nodes.unwrap_or_default(), head.place.clone());
        Some(Document { name, about, of: None, reference, nodes, outputs, dials, specialise, place, notes: Vec::new(), complete: self.complete })
    }

    fn variant(&mut self, name: String, head: &Word, fields: &[Field]) -> Option<Document> {
        if !self.grammar.version(head, fields) {
            return None;
        }
        let keys = self.grammar.keys(
            "Variant",
            &head.place,
            fields,
            &["version", "about", "source", "of", "specialise", "set", "replace", "remove", "add", "outputs", "dials"],
        );
        let about = self.grammar.text(&keys, "about", true);
        let of = self.grammar.required(&keys, "of").and_then(|value| self.grammar.word(value, "the name of a pipeline file"))?;
        let mut document = self.base(&of)?;
        document.name = name;
        document.about = about;
        document.of = Some(of.text);
        document.place = head.place.clone();
        if keys.found.contains_key("source") {
            document.reference = self.grammar.text(&keys, "source", false);
        }
        document.specialise = self.grammar.flag(&keys, "specialise").unwrap_or(document.specialise);
        self.apply(&keys, &mut document);
        Some(document)
    }

    fn base(&mut self, of: &Word) -> Option<Document> {
        let from = self.chain.last().cloned();
        let found = match self.find(&of.text, from.as_ref()) {
            Ok(found) => found,
            Err(problem) => {
                self.grammar.problems.push(problem.at(&of.place, "named here"));
                return None;
            }
        };
        if self.chain.len() >= MAX_VARIANTS {
            let problem = Problem::new("pipeline::too_many_variants", format!("more than {MAX_VARIANTS} variants extend each other"));
            self.grammar.problems.push(problem.at(&of.place, "one too many").help("let a variant extend a `Pipeline(…)` with fewer steps between"));
            return None;
        }
        if self.chain.contains(&found.location) {
            let problem = Problem::new("pipeline::extends_itself", format!("`{}` extends itself", found.name));
            self.grammar.problems.push(problem.at(&of.place, "leads back here").help("a chain of variants ends at a `Pipeline(…)`"));
            return None;
        }
        self.document(found)
    }

    fn apply(&mut self, keys: &Keys<'_>, document: &mut Document) {
        if let Some(value) = keys.found.get("remove") {
            self.remove(value, document);
        }
        for (key, value) in self.grammar.map(keys, "replace") {
            let Some(word) = self.grammar.word(&key, "the name of a node") else { continue };
            let replacement = self.work(&value);
            if let (Some(node), Some((call, nodes))) = (self.node_of(document, &word), replacement) {
                let gone = names(std::slice::from_ref(node));
                *node = Node { name: node.name.clone(), call, overrides: Vec::new(), nodes };
                leave_alone(document, &gone);
            }
        }
        for (key, value) in self.grammar.map(keys, "add") {
            let Some(word) = self.grammar.word(&key, "the name of a node") else { continue };
            let nodes = self.nodes(&value);
            if self.node_of(document, &word).is_some() {
                insert_after(&mut document.nodes, &word.text, nodes);
            }
        }
        for (key, value) in self.grammar.map(keys, "set") {
            if let Some(word) = self.grammar.word(&key, "a node and a parameter such as \"node.parameter\"") {
                self.set(document, &word, value);
            }
        }
        if let Some(value) = keys.found.get("outputs") {
            document.outputs = self.outputs(value);
        }
        document.dials = self.dials(keys, std::mem::take(&mut document.dials));
    }

    /// Adds dials to those that there are; one of the same name has these turns, too.
    fn dials(&mut self, keys: &Keys<'_>, mut dials: Vec<Dial>) -> Vec<Dial> {
        let mut seen: Vec<Word> = Vec::new();
        for (key, value) in self.grammar.map(keys, "dials") {
            let Some(name) = self.grammar.word(&key, "the name of a dial") else { continue };
            self.check_name(&name, "a dial");
            if let Some(first) = seen.iter().find(|first| first.text == name.text) {
                let problem = Problem::new("document::duplicate_key", format!("two dials are called `{}`", name.text));
                self.grammar.problems.push(problem.at(&name.place, "again here").at(&first.place, "first here"));
                continue;
            }
            seen.push(name.clone());
            let base = dials.iter().position(|dial| dial.name.text == name.text).map(|at| dials.remove(at));
            dials.extend(Dial::read(&mut self.grammar, name, &value, base.as_ref()));
        }
        dials
    }

    fn remove(&mut self, value: &Value, document: &mut Document) {
        let ValueKind::List(items) = &value.kind else { return self.grammar.wrong_type(value, "a list of names of nodes") };
        for item in items {
            let Some(word) = self.grammar.word(item, "the name of a node") else { continue };
            if document.dials.iter().any(|dial| dial.name.text == word.text) {
                document.dials.retain(|dial| dial.name.text != word.text);
                continue;
            }
            let Some(node) = self.node_of(document, &word) else { continue };
            let gone = names(std::slice::from_ref(node));
            remove_node(&mut document.nodes, &word.text);
            leave_alone(document, &gone);
        }
    }

    /// `key` is "node.parameter" or deeper, or a dial.
    fn set(&mut self, document: &mut Document, key: &Word, value: Value) {
        let (node, path) = path_of(key);
        let sets = match document.dials.iter().find(|dial| dial.name.text == key.text) {
            Some(dial) => dial.turned(&mut self.grammar, key, &value),
            None if path.is_empty() => return self.refuse_bare(document, key),
            None => vec![(node, Override { key: key.place.clone(), path, value })],
        };
        for (node, set) in sets {
            if let Some(node) = self.node_of(document, &node) {
                node.overrides.push(set);
            }
        }
    }

    /// A key that is neither a parameter nor a dial.
    fn refuse_bare(&mut self, document: &Document, key: &Word) {
        let problem = Problem::new("document::missing_key", format!("`{}` names no parameter", key.text));
        let dials: Vec<&str> = document.dials.iter().map(|dial| dial.name.text.as_str()).collect();
        let (label, help) = match dials[..] {
            [] => ("a node alone", "write \"node.parameter\"".to_owned()),
            _ => ("neither a parameter nor a dial", format!("write \"node.parameter\", or turn a dial: {}", dials.join(", "))),
        };
        self.grammar.problems.push(problem.at(&key.place, label).help(help));
    }

    fn node_of<'d>(&mut self, document: &'d mut Document, name: &Word) -> Option<&'d mut Node> {
        if find_node(&document.nodes, &name.text).is_none() {
            let names = names(&document.nodes);
            let problem = Problem::new("pipeline::unknown_node", format!("there is no node `{}`", name.text));
            let help = known(&name.text, names.iter().map(String::as_str), "the nodes of the pipeline");
            if self.complete {
                self.grammar.problems.push(problem.at(&name.place, "not a node").help(help));
            }
        }
        find_node_mut(&mut document.nodes, &name.text)
    }

    fn outputs(&mut self, value: &Value) -> Vec<(Word, Value)> {
        let ValueKind::Map(entries) = &value.kind else {
            self.grammar.wrong_type(value, "a map from names of layers to nodes");
            return Vec::new();
        };
        if entries.is_empty() {
            self.grammar.problems.push(Problem::new("pipeline::no_outputs", "the pipeline has no outputs").at(&value.place, "name at least one layer"));
        }
        let mut outputs: Vec<(Word, Value)> = Vec::new();
        for (key, value) in entries {
            let Some(layer) = self.grammar.word(key, "the name of a layer") else { continue };
            self.check_name(&layer, "a layer");
            if let Some((first, _)) = outputs.iter().find(|(other, _)| other.text == layer.text) {
                let problem = Problem::new("pipeline::duplicate_output", format!("two outputs are called `{}`", layer.text));
                self.grammar.problems.push(problem.at(&layer.place, "again here").at(&first.place, "first here"));
                continue;
            }
            outputs.push((layer, value.clone()));
        }
        outputs
    }

    /// The nodes of a list, as far as they can be read.
    fn nodes(&mut self, value: &Value) -> Vec<Node> {
        let ValueKind::List(items) = &value.kind else {
            self.complete = false;
            self.grammar.wrong_type(value, "a list of nodes");
            return Vec::new();
        };
        let nodes: Vec<Node> = items.iter().filter_map(|item| self.node(item)).collect();
        self.complete &= nodes.len() == items.len();
        nodes
    }

    fn node(&mut self, value: &Value) -> Option<Node> {
        let ValueKind::Compound { name: None, body: Body::Named(fields) } = &value.kind else {
            self.grammar.wrong_type(value, "a node such as `(name: \"…\", pass: …)`");
            return None;
        };
        let keys = self.grammar.keys("a node", &value.place, fields, &["name", "pass", "repeat"]);
        let name = self.grammar.required(&keys, "name").and_then(|value| self.grammar.word(value, "a name"));
        if let Some(name) = &name {
            self.check_name(name, "a node");
        }
        let work = match (keys.found.get("pass"), keys.found.get("repeat")) {
            (Some(_), Some(repeat)) => {
                let problem = Problem::new("document::duplicate_key", "a node is a pass or a loop, not both");
                self.grammar.problems.push(problem.at(&repeat.place, "besides `pass`"));
                None
            }
            (None, Some(repeat)) => self.repeat(repeat),
            _ => self.grammar.required(&keys, "pass").and_then(|pass| self.work(pass)),
        };
        let (call, nodes) = work?;
        Some(Node { name: name?, call, overrides: Vec::new(), nodes })
    }

    fn repeat(&mut self, value: &Value) -> Option<(Call, Option<Vec<Node>>)> {
        match &value.kind {
            ValueKind::Compound { name: Some(name), .. } if Loop::find(&name.text).is_some() => self.work(value),
            _ => {
                let problem = Problem::new("pipeline::unknown_loop", format!("{} is not a loop", value.phrase()));
                self.grammar
                    .problems
                    .push(problem.at(&value.place, "not a loop").help("write `Fill(until: \"…\", nodes: […])` or `Iterate(rounds: …, nodes: […])`"));
                None
            }
        }
    }

    /// `Pass(…)`, or a loop such as `Fill(…, nodes: […])` with its nodes.
    fn work(&mut self, value: &Value) -> Option<(Call, Option<Vec<Node>>)> {
        let ValueKind::Compound { name: Some(name), body } = &value.kind else {
            self.grammar.wrong_type(value, "a pass such as `GBuffer()`");
            return None;
        };
        let Some(fields) = named_fields(body) else {
            self.grammar.wrong_type(value, &format!("`{}` with names before its values", name.text));
            return None;
        };
        let mut fields = fields.to_vec();
        self.grammar.refuse_repeated(&name.text, &mut fields);
        if Loop::find(&name.text).is_none() {
            return Some((Call { name: name.clone(), fields }, None));
        }
        let keys = Keys { owner: name.text.clone(), place: name.place.clone(), found: fields.iter().map(|f| (f.name.text.as_str(), &f.value)).collect() };
        let nodes = self.grammar.required(&keys, "nodes").map(|value| self.nodes(value))?;
        fields.retain(|field| field.name.text != "nodes");
        Some((Call { name: name.clone(), fields }, Some(nodes)))
    }

    fn check_name(&mut self, name: &Word, what: &str) {
        let is_valid = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if name.text.is_empty() || !name.text.chars().all(is_valid) {
            let problem = Problem::new("pipeline::invalid_name", format!("`{}` cannot be the name of {what}", name.text));
            self.grammar.problems.push(problem.at(&name.place, "this name").help("names are made of letters, digits, `_` and `-`"));
        }
    }
}

/// "node.parameter", or deeper, as the node and the path in it.
pub fn path_of(key: &Word) -> (Word, Vec<String>) {
    let mut parts = key.text.split('.').map(str::to_owned);
    let node = Word { text: parts.next().unwrap_or_default(), place: key.place.clone() };
    (node, parts.collect())
}

/// No dial turns what these nodes have.
fn leave_alone(document: &mut Document, nodes: &[String]) {
    for dial in &mut document.dials {
        dial.turns.retain(|turn| !nodes.contains(&path_of(&turn.key).0.text));
    }
    document.dials.retain(|dial| !dial.turns.is_empty());
}

/// Without `.` and `..` where names can tell, so that a file has one path.
fn normalised(path: &Path) -> PathBuf {
    let mut parts: Vec<Component<'_>> = Vec::new();
    for part in path.components() {
        match (part, parts.last()) {
            (Component::CurDir, _) => {}
            (Component::ParentDir, Some(Component::Normal(_))) => {
                parts.pop();
            }
            _ => parts.push(part),
        }
    }
    parts.into_iter().collect()
}

/// Names of all nodes, those inside loops too.
pub fn names(nodes: &[Node]) -> Vec<String> {
    nodes.iter().flat_map(|node| std::iter::once(node.name.text.clone()).chain(names(node.nodes.as_deref().unwrap_or_default()))).collect()
}

fn find_node<'n>(nodes: &'n [Node], name: &str) -> Option<&'n Node> {
    nodes.iter().find_map(|node| if node.name.text == name { Some(node) } else { find_node(node.nodes.as_deref()?, name) })
}

fn find_node_mut<'n>(nodes: &'n mut [Node], name: &str) -> Option<&'n mut Node> {
    nodes.iter_mut().find_map(|node| if node.name.text == name { Some(node) } else { find_node_mut(node.nodes.as_deref_mut()?, name) })
}

fn remove_node(nodes: &mut Vec<Node>, name: &str) {
    nodes.retain(|node| node.name.text != name);
    nodes.iter_mut().filter_map(|node| node.nodes.as_mut()).for_each(|inner| remove_node(inner, name));
}

fn insert_after(nodes: &mut Vec<Node>, name: &str, added: Vec<Node>) {
    match nodes.iter().position(|node| node.name.text == name) {
        Some(at) => drop(nodes.splice(at + 1..at + 1, added)),
        None => {
            let holder = nodes.iter_mut().filter_map(|node| node.nodes.as_mut()).find(|inner| find_node(inner, name).is_some());
            if let Some(inner) = holder {
                insert_after(inner, name, added);
            }
        }
    }
}
