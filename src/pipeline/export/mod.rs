//! A pipeline as a drawing: Graphviz, Mermaid, or SVG.

mod layers;
mod svg;

use super::{Loop, Node, Origin, Pipeline, When, Work, graph::family};
use crate::contract::PortKind;
use std::collections::BTreeMap;
use std::fmt::Write;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    Dot,
    Mermaid,
    Svg,
}

/// Draws the nodes, the edges between them and the outputs.
pub fn export(pipeline: &Pipeline, format: Format) -> String {
    match format {
        Format::Dot => dot(pipeline),
        Format::Mermaid => mermaid(pipeline),
        Format::Svg => svg::svg(pipeline),
    }
}

/// From an output to what it is joined to.
struct Arrow {
    from: String,
    output: &'static str,
    to: String,
    /// The input, or the output that a layer shows.
    label: &'static str,
    kind: PortKind,
    when: When,
}

/// Outputs are drawn as nodes of their own.
fn output_id(layer: &str) -> String {
    format!("output:{layer}")
}

fn arrows(pipeline: &Pipeline) -> Vec<Arrow> {
    let (mut members, mut arrows) = (BTreeMap::new(), Vec::new());
    for node in &pipeline.nodes {
        family(node, &mut |member| {
            members.insert(member.name.as_str(), member);
        });
    }
    let kind = |from: &Origin| {
        let outputs = members.get(from.node.as_str()).map_or(&[][..], |node| node.description().outputs);
        outputs.iter().find(|output| output.name == from.output).map_or(PortKind::Image, |output| output.kind)
    };
    for node in &pipeline.nodes {
        family(node, &mut |member| {
            // What ends a loop is told in its title.
            let edges = member.inputs.iter().filter(|_| member.inner().is_empty());
            arrows.extend(edges.map(|edge| Arrow {
                from: edge.from.node.clone(),
                output: edge.from.output,
                to: member.name.clone(),
                label: edge.input,
                kind: kind(&edge.from),
                when: edge.when,
            }));
        });
    }
    arrows.extend(pipeline.outputs.iter().map(|layer| Arrow {
        from: layer.from.node.clone(),
        output: layer.from.output,
        to: output_id(&layer.name),
        label: layer.from.output,
        kind: kind(&layer.from),
        when: When::Now,
    }));
    arrows
}

/// "fill: Fill, Batched(at_most: 64) until misses.none", "bounces: Iterate, 3 rounds"
fn title(node: &Node) -> String {
    format!("{}: {}", node.name, about(node).join(" "))
}

/// The pass, or what is told of a loop, line by line.
fn about(node: &Node) -> Vec<String> {
    let description = node.description().name;
    let Work::Loop(kind, _) = &node.work else { return vec![description.into()] };
    let how = match kind {
        Loop::Iterate => format!("{} rounds", node.arguments.integer("rounds")),
        Loop::Fill => node.arguments.iter().find(|(name, _)| *name == "order").map(|(_, value)| value.to_string()).unwrap_or_default(),
    };
    let until = node.inputs.iter().map(|edge| format!("until {}", edge.from));
    [format!("{description}, {how}")].into_iter().chain(until).collect()
}

fn dot(pipeline: &Pipeline) -> String {
    let mut text = String::from("digraph pipeline {\n  node [shape=box];\n");
    pipeline.nodes.iter().for_each(|node| dot_node(node, 1, &mut text));
    for layer in &pipeline.outputs {
        let _ = writeln!(text, "  \"{}\" [label=\"{}\", shape=ellipse];", output_id(&layer.name), layer.name);
    }
    for arrow in arrows(pipeline) {
        let style = if arrow.when != When::Now { ", style=dashed, constraint=false" } else { "" };
        let _ = writeln!(text, "  \"{}\" -> \"{}\" [label=\"{}\"{style}];", arrow.from, arrow.to, arrow.label);
    }
    text.push_str("}\n");
    text
}

fn dot_node(node: &Node, depth: usize, text: &mut String) {
    let indent = "  ".repeat(depth);
    if node.inner().is_empty() {
        let _ = writeln!(text, "{indent}\"{}\" [label=\"{}\"];", node.name, title(node));
        return;
    }
    let _ = writeln!(text, "{indent}subgraph \"cluster_{}\" {{\n{indent}  label=\"{}\";", node.name, title(node));
    node.inner().iter().for_each(|inner| dot_node(inner, depth + 1, text));
    let _ = writeln!(text, "{indent}}}");
}

fn mermaid(pipeline: &Pipeline) -> String {
    let mut text = String::from("flowchart TD\n");
    pipeline.nodes.iter().for_each(|node| mermaid_node(node, 1, &mut text));
    for layer in &pipeline.outputs {
        let _ = writeln!(text, "  {}([\"{}\"])", mermaid_id(&output_id(&layer.name)), layer.name);
    }
    for arrow in arrows(pipeline) {
        let line = if arrow.when != When::Now { "-.->" } else { "-->" };
        let _ = writeln!(text, "  {} {line}|{}| {}", mermaid_id(&arrow.from), arrow.label, mermaid_id(&arrow.to));
    }
    text
}

fn mermaid_node(node: &Node, depth: usize, text: &mut String) {
    let indent = "  ".repeat(depth);
    if node.inner().is_empty() {
        let _ = writeln!(text, "{indent}{}[\"{}\"]", mermaid_id(&node.name), title(node));
        return;
    }
    let _ = writeln!(text, "{indent}subgraph {}[\"{}\"]", mermaid_id(&node.name), title(node));
    node.inner().iter().for_each(|inner| mermaid_node(inner, depth + 1, text));
    let _ = writeln!(text, "{indent}end");
}

/// Words such as `end` mean something to Mermaid, `:` and `-` too: every name gets a prefix, what is no letter or digit becomes its code.
fn mermaid_id(name: &str) -> String {
    let escape = |c: char| if c.is_ascii_alphanumeric() { c.to_string() } else { format!("_{:x}_", c as u32) };
    format!("n_{}", name.chars().map(escape).collect::<String>())
}
