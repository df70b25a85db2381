//! A checked pipeline as a document again: variants followed, changes applied, every default in its place.

use super::{Dial, Edge, Node, Pipeline, When, Work};
use std::fmt::Write;

impl Pipeline {
    /// The pipeline as RON that reads back as the same one, an input or a parameter a line, so that two of them can be compared by lines.
    pub fn to_ron(&self) -> String {
        let mut text = String::from("Pipeline(\n    version: 1,\n");
        let _ =
            write!(text, "    about: {},\n    source: {},\n    specialise: {},\n    nodes: [\n", quoted(&self.about), quoted(&self.reference), self.specialise);
        self.nodes.iter().for_each(|node| write_node(&mut text, node, 2));
        text += "    ],\n    outputs: {\n";
        for output in &self.outputs {
            let _ = writeln!(text, "        {}: {},", quoted(&output.name), quoted(&output.from.to_string()));
        }
        text += "    },\n";
        write_dials(&mut text, &self.dials);
        text + ")\n"
    }
}

fn write_dials(text: &mut String, dials: &[Dial]) {
    if dials.is_empty() {
        return;
    }
    *text += "    dials: {\n";
    for dial in dials {
        let _ = writeln!(text, "        {}: Dial(about: {}, written: {}, turns: {{", quoted(&dial.name.text), quoted(&dial.about), dial.written);
        for turn in &dial.turns {
            let stops: Vec<String> = turn.stops.iter().map(|stop| format!("{}: {}", stop.at, stop.value.written())).collect();
            let _ = writeln!(text, "            {}: {{ {} }},", quoted(&turn.key.text), stops.join(", "));
        }
        *text += "        }),\n";
    }
    *text += "    },\n";
}

fn write_node(text: &mut String, node: &Node, depth: usize) {
    let indent = "    ".repeat(depth);
    let verb = if matches!(node.work, Work::Loop(..)) { "repeat" } else { "pass" };
    let _ = write!(text, "{indent}(name: {}, {verb}: {}(", quoted(&node.name), node.description().name);
    let lines = inputs(node).chain(node.arguments.iter().map(|(name, value)| format!("{name}: {value}")));
    let lines: Vec<String> = lines.map(|line| format!("{indent}    {line},\n")).collect();
    if !lines.is_empty() || !node.inner().is_empty() {
        text.push('\n');
        text.push_str(&lines.concat());
        write_inner(text, node, depth);
        text.push_str(&indent);
    }
    text.push_str(")),\n");
}

fn write_inner(text: &mut String, node: &Node, depth: usize) {
    if !node.inner().is_empty() {
        let indent = "    ".repeat(depth);
        let _ = writeln!(text, "{indent}    nodes: [");
        node.inner().iter().for_each(|inner| write_node(text, inner, depth + 2));
        let _ = writeln!(text, "{indent}    ],");
    }
}

/// An input a line; one that takes any number as a list.
fn inputs(node: &Node) -> impl Iterator<Item = String> {
    node.description().inputs.iter().filter_map(|input| {
        let joined: Vec<String> = node.inputs.iter().filter(|edge| edge.input == input.name).map(reference).collect();
        let written = if input.takes.is_list() { format!("[{}]", joined.join(", ")) } else { joined.concat() };
        (!joined.is_empty()).then(|| format!("{}: {written}", input.name))
    })
}

fn reference(edge: &Edge) -> String {
    let from = quoted(&edge.from.to_string());
    match edge.when {
        When::Now => from,
        earlier => format!("{earlier:?}({from})"),
    }
}

/// As RON writes a string.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n"))
}
