//! Names, types, ranges and edges of a document against the registry of passes.

use super::diagnostics::{Problem, known};
use super::dial::Dial;
use super::document::{self, Document, Override};
use super::syntax::{Body, Field, Place, Value as Written, ValueKind, Word};
use super::{Edge, Layer, Loop, Node, Origin, Pipeline, When, Work, graph, progress};
use crate::contract::{Arguments, Choice, Description, Input, Output, PLACE, Parameter, ParameterKind, Pass, PortKind, Registry, Takes, Value, find};
use std::collections::BTreeMap;

/// What can be a layer of a picture.
const LAYERS: [PortKind; 2] = [PortKind::Image, PortKind::DirectLight];

/// Joins a document to the passes. None where the problems leave nothing to go on with.
pub fn check(document: &Document, registry: &Registry, problems: &mut Vec<Problem>) -> Option<Pipeline> {
    let mut checker = Checker { registry, entries: Vec::new(), complete: document.complete, problems };
    checker.enter(&document.nodes, &[]);
    let unique = checker.refuse_duplicates();
    let nodes = checker.nodes(&document.nodes, &mut 0);
    let outputs: Vec<Layer> = document.outputs.iter().filter_map(|(name, value)| checker.layer(name, value)).collect();
    document.dials.iter().for_each(|dial| checker.dial(dial));
    if !unique {
        return None; // What an edge means is open: a cycle may be none.
    }
    let nodes = match graph::order(nodes) {
        Ok(nodes) => nodes,
        Err(cycles) => {
            problems.extend(cycles);
            return None;
        }
    };
    // Where a node could not be read, it may be the one that adds records.
    if problems.is_empty() {
        problems.extend(progress::refuse_standstills(&nodes));
    }
    let (name, about, reference) = (document.name.clone(), document.about.clone(), document.reference.clone());
    problems.is_empty().then(|| Pipeline {
        name,
        about,
        reference,
        nodes,
        outputs,
        dials: document.dials.clone(),
        specialise: document.specialise,
        place: document.place.clone(),
        notes: document.notes.clone(),
    })
}

/// A node of the document, wherever it stands.
struct Entry<'d> {
    name: &'d Word,
    /// Indices of the loops around it, outermost first.
    loops: Vec<usize>,
    /// None for a pass that is not known.
    description: Option<&'static Description>,
    pass: Option<&'static dyn Pass>,
}

struct Checker<'d, 'p> {
    registry: &'p Registry,
    /// In the document's order, loops before their nodes.
    entries: Vec<Entry<'d>>,
    complete: bool,
    problems: &'p mut Vec<Problem>,
}

/// `"node"`, `"node.output"`, `PreviousRound("…")` or `PreviousFrame("…")`.
struct Reference {
    node: String,
    output: Option<String>,
    when: When,
    place: Place,
}

impl<'d> Checker<'d, '_> {
    fn report(&mut self, problem: Problem) {
        self.problems.push(problem);
    }

    fn enter(&mut self, nodes: &'d [document::Node], loops: &[usize]) {
        for node in nodes {
            let index = self.entries.len();
            let pass = find(self.registry, &node.call.name.text).copied();
            let of_loop = Loop::find(&node.call.name.text).map(Loop::description);
            let description = of_loop.or_else(|| pass.map(|pass| pass.description()));
            if description.is_none() {
                let registry = self.registry;
                let problem = Problem::new("pipeline::unknown_pass", format!("there is no pass `{}`", node.call.name.text));
                let help = known(&node.call.name.text, registry.iter().map(|pass| pass.description().name), "the passes");
                self.report(problem.at(&node.call.name.place, "not a pass").help(help));
            }
            self.entries.push(Entry { name: &node.name, loops: loops.to_vec(), description, pass });
            if let Some(inner) = &node.nodes {
                let loops: Vec<usize> = loops.iter().copied().chain([index]).collect();
                self.enter(inner, &loops);
            }
        }
    }

    /// Whether every name stands for one node.
    fn refuse_duplicates(&mut self) -> bool {
        let mut first: BTreeMap<&str, &Place> = BTreeMap::new();
        for entry in &self.entries {
            match first.get(entry.name.text.as_str()) {
                Some(earlier) => {
                    let problem = Problem::new("pipeline::duplicate_name", format!("two nodes are called `{}`", entry.name.text));
                    let problem = problem.at(&entry.name.place, "again here").at(earlier, "first here");
                    self.problems.push(problem.help("a name is unique in the whole document, loops included"));
                }
                None => {
                    first.insert(&entry.name.text, &entry.name.place);
                }
            }
        }
        first.len() == self.entries.len()
    }

    /// Checks nodes in the order of `entries`; `next` counts them.
    fn nodes(&mut self, nodes: &[document::Node], next: &mut usize) -> Vec<Node> {
        nodes.iter().filter_map(|node| self.node(node, next)).collect()
    }

    fn node(&mut self, node: &document::Node, next: &mut usize) -> Option<Node> {
        let index = *next;
        *next += 1;
        let checked = self.entries[index].description.map(|description| self.fields(node, index, description));
        let inner = node.nodes.as_ref().map(|inner| self.nodes(inner, next));
        let work = match inner.zip(Loop::find(&node.call.name.text)) {
            Some((inner, kind)) => Work::Loop(kind, inner),
            None => Work::Pass(self.entries[index].pass?),
        };
        let (arguments, inputs, places) = checked?;
        Some(Node { name: node.name.text.clone(), work, arguments, inputs, place: node.name.place.clone(), places })
    }

    /// Arguments and edges of a node: its own fields, then what is set over them.
    fn fields(&mut self, node: &document::Node, index: usize, description: &'static Description) -> (Arguments, Vec<Edge>, BTreeMap<&'static str, Place>) {
        let mut arguments = Arguments::defaults(description.parameters);
        let mut places = BTreeMap::new();
        let mut written: BTreeMap<&'static str, Written> = BTreeMap::new();
        let own = node.call.fields.iter().map(|f| Override { key: f.name.place.clone(), path: vec![f.name.text.clone()], value: f.value.clone() });
        for set in own.chain(node.overrides.iter().cloned()) {
            if let (1, Some(input)) = (set.path.len(), description.inputs.iter().find(|input| input.name == set.path[0])) {
                written.insert(input.name, set.value);
                continue;
            }
            let before = self.problems.len();
            let inputs = description.inputs.iter().map(|input| input.name).collect::<Vec<_>>();
            self.set(&node.name.text, description.name, &inputs, description.parameters, &mut arguments, &set);
            if let (true, Some(parameter)) = (self.problems.len() == before, description.parameters.iter().find(|p| p.name == set.path[0])) {
                places.insert(parameter.name, set.value.place.clone());
            }
        }
        self.refuse_missing(node, description, &written);
        let joined = description.inputs.iter().filter_map(|input| Some((input, written.get(input.name)?)));
        let edges = joined.flat_map(|(input, written)| self.edges(index, input, written)).collect();
        (arguments, edges, places)
    }

    /// Every value that a dial gives has to be one of its parameter.
    fn dial(&mut self, dial: &Dial) {
        for turn in &dial.turns {
            let (word, path) = document::path_of(&turn.key);
            let Some(description) = self.description_of(&word) else { continue };
            for stop in &turn.stops {
                let set = Override { key: turn.key.place.clone(), path: path.clone(), value: stop.value.clone() };
                self.set(&word.text, description.name, &[], description.parameters, &mut Arguments::defaults(description.parameters), &set);
            }
        }
    }

    /// Tells that there is no such node, unless it may be one that could not be read.
    fn refuse_node(&mut self, node: &str, place: &Place) {
        if self.complete {
            let problem = Problem::new("pipeline::unknown_node", format!("there is no node `{node}`"));
            let help = known(node, self.entries.iter().map(|entry| entry.name.text.as_str()), "the nodes of the pipeline");
            self.report(problem.at(place, "not a node").help(help));
        }
    }

    /// None where there is no such node, which is told, or where its pass is not known.
    fn description_of(&mut self, node: &Word) -> Option<&'static Description> {
        match self.entries.iter().find(|entry| entry.name.text == node.text) {
            Some(entry) => entry.description,
            None => {
                self.refuse_node(&node.text, &node.place);
                None
            }
        }
    }

    fn refuse_missing(&mut self, node: &document::Node, description: &'static Description, written: &BTreeMap<&'static str, Written>) {
        for input in description.inputs.iter().filter(|input| input.takes == Takes::One && !written.contains_key(input.name)) {
            let problem = Problem::new("pipeline::missing_input", format!("`{}` needs the input `{}`: {}", node.name.text, input.name, input.about));
            let help = self.offers(input.accepts, Some(&node.name.text));
            self.report(problem.at(&node.call.name.place, format!("`{}` is missing", input.name)).help(help));
        }
    }

    /// Sets one argument, or one inside the choice that is made. `owner` has the parameters, `path` leads to it.
    fn set(&mut self, path: &str, owner: &str, inputs: &[&str], parameters: &'static [Parameter], arguments: &mut Arguments, set: &Override) {
        let Some((name, deeper)) = set.path.split_first() else { return };
        let Some(parameter) = parameters.iter().find(|p| p.name == name) else {
            let message =
                if inputs.is_empty() { format!("`{owner}` has no parameter `{name}`") } else { format!("`{owner}` has no input or parameter `{name}`") };
            let names = inputs.iter().copied().chain(parameters.iter().map(|p| p.name));
            let help = if name == PLACE.name && !path.contains('.') {
                format!("only one side can do what `{owner}` does")
            } else {
                known(name, names, &format!("what `{owner}` has"))
            };
            return self.report(Problem::new("pipeline::unknown_parameter", message).at(&set.key, "unknown").help(help));
        };
        let path = format!("{path}.{name}");
        if deeper.is_empty() {
            if let Some(value) = self.value(&path, parameter, &set.value) {
                arguments.set(parameter.name, value);
            }
            return;
        }
        let ParameterKind::Choice { choices } = &parameter.kind else {
            let problem = Problem::new("pipeline::unknown_parameter", format!("`{path}` has no parameters of its own"));
            return self.report(problem.at(&set.key, "too deep").help(format!("`{path}` is {}", expected(parameter))));
        };
        let (choice, inner) = arguments.choice(parameter.name);
        let mut inner = inner.clone();
        let parameters = choices.iter().find(|c| c.name == choice).map_or(&[][..], |c| c.parameters);
        self.set(&path, choice, &[], parameters, &mut inner, &Override { path: deeper.to_vec(), ..set.clone() });
        arguments.set(parameter.name, Value::Choice(choice, inner));
    }

    fn value(&mut self, path: &str, parameter: &'static Parameter, written: &Written) -> Option<Value> {
        match (&parameter.kind, &written.kind) {
            (ParameterKind::Bool { .. }, ValueKind::Bool(value)) => Some(Value::Bool(*value)),
            (ParameterKind::Integer { min, max, .. }, ValueKind::Number(number)) => match ron::from_str::<i64>(number) {
                Ok(value) if (*min..=*max).contains(&value) => Some(Value::Integer(value)),
                Ok(_) => self.out_of_range(path, parameter, written),
                Err(_) if number.trim_start_matches(['+', '-']).chars().all(|c| c.is_ascii_digit() || c == '_') => self.out_of_range(path, parameter, written),
                Err(_) => self.wrong_type(path, parameter, written),
            },
            (ParameterKind::Float { min, max, .. }, ValueKind::Number(number)) => match ron::from_str::<f64>(number) {
                Ok(value) if (*min..=*max).contains(&value) => Some(Value::Float(value)),
                Ok(_) => self.out_of_range(path, parameter, written),
                Err(_) => self.wrong_type(path, parameter, written),
            },
            (ParameterKind::Choice { choices }, ValueKind::Compound { name: Some(name), body }) => self.choice(path, parameter, choices, name, body, written),
            _ => self.wrong_type(path, parameter, written),
        }
    }

    fn choice(&mut self, path: &str, parameter: &'static Parameter, choices: &'static [Choice], name: &Word, body: &Body, written: &Written) -> Option<Value> {
        let Some(choice) = choices.iter().find(|choice| choice.name == name.text) else {
            let problem = Problem::new("pipeline::unknown_choice", format!("`{path}` cannot be `{}`", name.text));
            let help = known(&name.text, choices.iter().map(|choice| choice.name), &format!("`{path}` is one of"));
            self.report(problem.at(&name.place, "not one of the choices").help(help));
            return None;
        };
        let fields: &[Field] = match body {
            Body::Empty => &[],
            Body::Named(fields) => fields,
            Body::Positional(_) => return self.wrong_type(path, parameter, written),
        };
        let mut arguments = Arguments::defaults(choice.parameters);
        let mut seen: BTreeMap<&str, &Place> = BTreeMap::new();
        for field in fields {
            if let Some(first) = seen.insert(&field.name.text, &field.name.place) {
                let problem = Problem::new("document::duplicate_key", format!("`{}` is given twice in {}", field.name.text, choice.name));
                self.report(problem.at(&field.name.place, "again here").at(first, "first here"));
            }
            let set = Override { key: field.name.place.clone(), path: vec![field.name.text.clone()], value: field.value.clone() };
            self.set(path, choice.name, &[], choice.parameters, &mut arguments, &set);
        }
        Some(Value::Choice(choice.name, arguments))
    }

    fn wrong_type<T>(&mut self, path: &str, parameter: &'static Parameter, written: &Written) -> Option<T> {
        let problem = Problem::new("document::wrong_type", format!("`{path}` expects {}, got {}", expected(parameter), written.phrase()));
        self.report(problem.at(&written.place, format!("expected {}", expected(parameter))).help(meaning(path, parameter)));
        None
    }

    fn out_of_range<T>(&mut self, path: &str, parameter: &'static Parameter, written: &Written) -> Option<T> {
        let number = match &written.kind {
            ValueKind::Number(number) => number.clone(),
            _ => written.phrase(),
        };
        let given = with_unit(&number, parameter.unit);
        let problem = Problem::new("pipeline::out_of_range", format!("`{path}` is {given}, expects {}", expected(parameter)));
        self.report(problem.at(&written.place, "out of range").help(meaning(path, parameter)));
        None
    }

    /// The edge to an input, or all of a list.
    fn edges(&mut self, consumer: usize, input: &'static Input, written: &Written) -> Vec<Edge> {
        let items = match &written.kind {
            ValueKind::List(items) if input.takes.is_list() => &items[..],
            _ => std::slice::from_ref(written),
        };
        items.iter().filter_map(|item| self.edge(consumer, input, item)).collect()
    }

    fn edge(&mut self, consumer: usize, input: &'static Input, written: &Written) -> Option<Edge> {
        let name = format!("{}.{}", self.entries[consumer].name.text, input.name);
        let reference = self.reference(&name, written)?;
        let (source, output) = self.resolve(&reference)?;
        let round_of = self.round_of(&name, consumer, source, &reference)?;
        if output.kind != input.accepts {
            let to = &reference_text(&reference);
            let problem = Problem::new("pipeline::kind_mismatch", format!("{name} → {to}: expects {}, got {}", input.accepts.phrase(), output.kind.phrase()));
            let help = self.offers(input.accepts, Some(&self.entries[consumer].name.text.clone()));
            self.report(problem.at(&reference.place, format!("this is {}", output.kind.phrase())).help(help));
            return None;
        }
        let from = Origin { node: reference.node, output: output.name, place: reference.place };
        Some(Edge { input: input.name, required: input.takes == Takes::One, changes: input.changes, when: reference.when, round_of, from })
    }

    fn layer(&mut self, name: &Word, written: &Written) -> Option<Layer> {
        let edge = format!("the output `{}`", name.text);
        let reference = self.reference(&edge, written)?;
        if reference.when != When::Now {
            let problem = Problem::new("pipeline::other_round", format!("{edge} shows the last round of this frame, not an earlier one"));
            self.report(problem.at(&reference.place, "an earlier one").help(format!("write \"{}\"", reference_text(&reference))));
            return None;
        }
        let (_, output) = self.resolve(&reference)?;
        if !LAYERS.contains(&output.kind) {
            let to = reference_text(&reference);
            let problem = Problem::new("pipeline::kind_mismatch", format!("{edge} → {to}: expects an image, got {}", output.kind.phrase()));
            let help = format!("{}; `--dump {}` writes what is not an image", self.offers(PortKind::Image, None), reference.node);
            self.report(problem.at(&reference.place, format!("this is {}", output.kind.phrase())).help(help));
            return None;
        }
        Some(Layer { name: name.text.clone(), from: Origin { node: reference.node, output: output.name, place: reference.place } })
    }

    fn reference(&mut self, edge: &str, written: &Written) -> Option<Reference> {
        let (when, inner) = match &written.kind {
            ValueKind::Compound { name: Some(name), body: Body::Positional(items) } if items.len() == 1 => match name.text.as_str() {
                "PreviousRound" => (When::PreviousRound, &items[0]),
                "PreviousFrame" => (When::PreviousFrame, &items[0]),
                _ => (When::Now, written),
            },
            _ => (When::Now, written),
        };
        let Some(word) = inner.word() else {
            let problem = Problem::new("document::wrong_type", format!("{edge} expects the name of a node, got {}", written.phrase()));
            let help = "write \"node\", \"node.output\", PreviousRound(\"node\") or PreviousFrame(\"node\")";
            self.report(problem.at(&written.place, "not a node").help(help));
            return None;
        };
        let (node, output) = word.text.split_once('.').map_or((word.text.as_str(), None), |(node, output)| (node, Some(output.to_owned())));
        Some(Reference { node: node.to_owned(), output, when, place: word.place.clone() })
    }

    /// The node and output that a reference means; None after an error here or in the node.
    fn resolve(&mut self, reference: &Reference) -> Option<(usize, &'static Output)> {
        let Some(index) = self.entries.iter().position(|entry| entry.name.text == reference.node) else {
            self.refuse_node(&reference.node, &reference.place);
            return None;
        };
        let description = self.entries[index].description?;
        let output = match &reference.output {
            None => description.outputs.first(),
            Some(name) => description.outputs.iter().find(|output| output.name == name),
        };
        if output.is_none() {
            let message = match &reference.output {
                Some(name) => format!("`{}` ({}) has no output `{name}`", reference.node, description.name),
                None => format!("`{}` ({}) has no outputs", reference.node, description.name),
            };
            let help = if Loop::find(description.name).is_some() {
                let inner = self.entries.iter().filter(|e| e.loops.last() == Some(&index)).map(|e| e.name.text.as_str());
                format!("a loop hands nothing on, its nodes do: {}", inner.collect::<Vec<_>>().join(", "))
            } else {
                known(reference.output.as_deref().unwrap_or_default(), description.outputs.iter().map(|o| o.name), "its outputs")
            };
            self.report(Problem::new("pipeline::unknown_output", message).at(&reference.place, "no such output").help(help));
        }
        Some((index, output?))
    }

    /// The loop that an edge to an earlier round is about, if it is one; None after an error. A loop's end is decided inside it.
    fn round_of(&mut self, edge: &str, consumer: usize, source: usize, reference: &Reference) -> Option<Option<String>> {
        let is_loop = self.entries[consumer].description.is_some_and(|d| Loop::find(d.name).is_some());
        let loops = &self.entries[source].loops;
        if is_loop && (!loops.contains(&consumer) || reference.when != When::Now) {
            let problem = Problem::new("pipeline::until_outside", format!("{edge} → {}: only a node inside the loop can end it", reference_text(reference)));
            self.report(problem.at(&reference.place, "not decided by a round"));
            return None;
        }
        if reference.when != When::PreviousRound {
            return Some(None);
        }
        let shared = loops.iter().rev().find(|index| self.entries[consumer].loops.contains(index));
        let Some(shared) = shared else {
            let problem = Problem::new("pipeline::other_round", format!("{edge} → PreviousRound(\"{}\"): the two share no loop", reference_text(reference)))
                .at(&reference.place, "in no loop with it")
                .help("PreviousRound is for two nodes of one loop; PreviousFrame takes what the last frame left");
            self.report(problem);
            return None;
        };
        Some(Some(self.entries[*shared].name.text.clone()))
    }

    /// Outputs of the document of a kind, or else passes that make it.
    fn offers(&self, kind: PortKind, except: Option<&str>) -> String {
        let others = self.entries.iter().filter(|entry| Some(entry.name.text.as_str()) != except);
        let ports =
            others.flat_map(|entry| entry.description.into_iter().flat_map(|d| d.outputs.iter().enumerate()).map(move |(i, output)| (entry, i, output)));
        let name = |(entry, index, output): (&Entry<'_>, usize, &Output)| match index {
            0 => format!("\"{}\"", entry.name.text),
            _ => format!("\"{}.{}\"", entry.name.text, output.name),
        };
        let nodes: Vec<String> = ports.filter(|(_, _, output)| output.kind == kind).map(name).collect();
        if !nodes.is_empty() {
            return format!("nodes that make {}: {}", kind.phrase(), nodes.join(", "));
        }
        let makers = self.registry.iter().map(|pass| pass.description()).filter(|d| d.outputs.iter().any(|o| o.kind == kind));
        let makers: Vec<&str> = makers.map(|d| d.name).collect();
        format!("no node makes {}; passes that do: {}", kind.phrase(), if makers.is_empty() { "none".into() } else { makers.join(", ") })
    }
}

fn reference_text(reference: &Reference) -> String {
    match &reference.output {
        None => reference.node.clone(),
        Some(output) => format!("{}.{output}", reference.node),
    }
}

/// What a parameter accepts: "a number from 10 to 175 degrees".
pub fn expected(parameter: &Parameter) -> String {
    match &parameter.kind {
        ParameterKind::Bool { .. } => "true or false".into(),
        ParameterKind::Integer { min, max, .. } => with_unit(&format!("an integer from {min} to {max}"), parameter.unit),
        ParameterKind::Float { min, max, .. } => with_unit(&format!("a number from {min} to {max}"), parameter.unit),
        ParameterKind::Choice { choices } => {
            let choices: Vec<String> = choices.iter().map(choice_text).collect();
            format!("one of {}", choices.join(", "))
        }
    }
}

fn choice_text(choice: &Choice) -> String {
    let parameters: Vec<String> = choice.parameters.iter().map(|p| format!("{}: …", p.name)).collect();
    if parameters.is_empty() { choice.name.into() } else { format!("{}({})", choice.name, parameters.join(", ")) }
}

fn meaning(path: &str, parameter: &Parameter) -> String {
    format!("{path}: {}; default {}", parameter.about, with_unit(&parameter.kind.default().to_string(), parameter.unit))
}

fn with_unit(text: &str, unit: &str) -> String {
    if unit.is_empty() { text.into() } else { format!("{text} {unit}") }
}
