//! A pipeline as a drawing: Graphviz, Mermaid, or SVG.

use super::{Loop, Node, Pipeline, When, Work, graph::family};
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
        Format::Svg => svg(pipeline),
    }
}

/// From, to, label, and whether the value is that of an earlier round or frame.
struct Arrow {
    from: String,
    to: String,
    label: String,
    earlier: bool,
}

/// Outputs are drawn as nodes of their own.
fn output_id(layer: &str) -> String {
    format!("output:{layer}")
}

fn arrows(pipeline: &Pipeline) -> Vec<Arrow> {
    let mut arrows = Vec::new();
    for node in &pipeline.nodes {
        family(node, &mut |member| {
            // What ends a loop is told in its title.
            let edges = member.inputs.iter().filter(|_| member.inner().is_empty());
            arrows.extend(edges.map(|edge| Arrow {
                from: edge.from.node.clone(),
                to: member.name.clone(),
                label: edge.input.into(),
                earlier: edge.when != When::Now,
            }));
        });
    }
    arrows.extend(pipeline.outputs.iter().map(|layer| Arrow {
        from: layer.from.node.clone(),
        to: output_id(&layer.name),
        label: layer.from.output.into(),
        earlier: false,
    }));
    arrows
}

/// "fill: Fill, Batched(at_most: 64) until misses.none", "bounces: Iterate, 3 rounds"
fn title(node: &Node) -> String {
    let description = node.description().name;
    match &node.work {
        Work::Pass(_) => format!("{}: {description}", node.name),
        Work::Loop(Loop::Iterate, _) => format!("{}: {description}, {} rounds", node.name, node.arguments.integer("rounds")),
        Work::Loop(Loop::Fill, _) => {
            let until: Vec<String> = node.inputs.iter().map(|edge| edge.from.to_string()).collect();
            let order = node.arguments.iter().find(|(name, _)| *name == "order").map(|(_, value)| value.to_string()).unwrap_or_default();
            format!("{}: {description}, {order} until {}", node.name, until.join(", "))
        }
    }
}

fn dot(pipeline: &Pipeline) -> String {
    let mut text = String::from("digraph pipeline {\n  node [shape=box];\n");
    pipeline.nodes.iter().for_each(|node| dot_node(node, 1, &mut text));
    for layer in &pipeline.outputs {
        let _ = writeln!(text, "  \"{}\" [label=\"{}\", shape=ellipse];", output_id(&layer.name), layer.name);
    }
    for arrow in arrows(pipeline) {
        let style = if arrow.earlier { ", style=dashed, constraint=false" } else { "" };
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
        let line = if arrow.earlier { "-.->" } else { "-->" };
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

const BOX_HEIGHT: f32 = 34.0;
const GAP: f32 = 36.0;
const PADDING: f32 = 16.0;
const CHARACTER: f32 = 7.4;

/// A box with its text, relative to the group that holds it.
struct Drawn {
    id: String,
    title: String,
    position: [f32; 2],
    size: [f32; 2],
    inner: Vec<Drawn>,
    is_output: bool,
}

/// Rows by the longest way from a source, in the order of nodes within a row; a loop is laid out first and then is one box.
fn svg(pipeline: &Pipeline) -> String {
    let arrows = arrows(pipeline);
    let mut drawn: Vec<Drawn> = pipeline.nodes.iter().map(|node| draw(node, &arrows)).collect();
    drawn.extend(pipeline.outputs.iter().map(|layer| boxed(&output_id(&layer.name), &layer.name, true)));
    let size = lay_out(&mut drawn, &arrows, PADDING);
    let mut boxes = BTreeMap::new();
    let mut body = String::new();
    drawn.iter().for_each(|item| paint(item, [0.0, 0.0], &mut boxes, &mut body));
    let lines: String = arrows.iter().filter_map(|arrow| Some(curve(boxes.get(&arrow.from)?, boxes.get(&arrow.to)?, arrow))).collect();
    let [width, height] = size;
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <defs><marker id=\"arrow\" viewBox=\"0 0 8 8\" refX=\"8\" refY=\"4\" markerWidth=\"8\" markerHeight=\"8\" orient=\"auto\"><path d=\"M0 0L8 4L0 8z\" fill=\"#456\"/></marker></defs>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{body}{lines}</svg>\n"
    )
}

fn draw(node: &Node, arrows: &[Arrow]) -> Drawn {
    let mut drawn = boxed(&node.name, &title(node), false);
    if !node.inner().is_empty() {
        drawn.inner = node.inner().iter().map(|inner| draw(inner, arrows)).collect();
        let [width, height] = lay_out(&mut drawn.inner, arrows, BOX_HEIGHT);
        drawn.size = [width.max(drawn.size[0]), height];
    }
    drawn
}

fn boxed(id: &str, title: &str, is_output: bool) -> Drawn {
    let width = title.chars().count() as f32 * CHARACTER + 2.0 * PADDING;
    Drawn { id: id.into(), title: title.into(), position: [0.0; 2], size: [width, BOX_HEIGHT], inner: Vec::new(), is_output }
}

/// Places the boxes of one group from `top` on and returns the group's size.
fn lay_out(items: &mut [Drawn], arrows: &[Arrow], top: f32) -> [f32; 2] {
    let rows = rows(items, arrows);
    let (mut y, mut width) = (top, 0.0_f32);
    for row in 0..=rows.iter().copied().max().unwrap_or(0) {
        let (mut x, mut height) = (PADDING, 0.0_f32);
        for (item, _) in items.iter_mut().zip(&rows).filter(|(_, r)| **r == row) {
            item.position = [x, y];
            x += item.size[0] + GAP;
            height = height.max(item.size[1]);
        }
        width = width.max(x - GAP + PADDING);
        y += height + GAP;
    }
    [width, y - GAP + PADDING]
}

fn rows(items: &[Drawn], arrows: &[Arrow]) -> Vec<usize> {
    let mut holder: BTreeMap<&str, usize> = BTreeMap::new();
    for (index, item) in items.iter().enumerate() {
        hold(item, index, &mut holder);
    }
    let mut rows = vec![0; items.len()];
    // Items stand in the order of execution, so sources are placed before their consumers.
    for index in 0..items.len() {
        let sources = arrows.iter().filter(|arrow| !arrow.earlier && holder.get(arrow.to.as_str()) == Some(&index));
        let above = sources.filter_map(|arrow| holder.get(arrow.from.as_str())).filter(|source| **source != index);
        rows[index] = above.map(|source| rows[*source] + 1).max().unwrap_or(0);
    }
    rows
}

fn hold<'d>(item: &'d Drawn, index: usize, holder: &mut BTreeMap<&'d str, usize>) {
    holder.insert(&item.id, index);
    item.inner.iter().for_each(|inner| hold(inner, index, holder));
}

/// Left, top, width, height.
type Rectangle = [f32; 4];

fn paint(item: &Drawn, origin: [f32; 2], boxes: &mut BTreeMap<String, Rectangle>, text: &mut String) {
    let [x, y] = [origin[0] + item.position[0], origin[1] + item.position[1]];
    let [width, height] = item.size;
    boxes.insert(item.id.clone(), [x, y, width, height]);
    let (fill, radius) = if item.is_output { ("#e8f3e8", BOX_HEIGHT / 2.0) } else { (if item.inner.is_empty() { "#eef2f8" } else { "#faf6ea" }, 4.0) };
    let _ = writeln!(text, "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" rx=\"{radius}\" fill=\"{fill}\" stroke=\"#456\"/>");
    let baseline = y + BOX_HEIGHT / 2.0 + 4.0;
    let _ = writeln!(text, "<text x=\"{:.1}\" y=\"{baseline:.1}\">{}</text>", x + PADDING, item.title);
    item.inner.iter().for_each(|inner| paint(inner, [x, y], boxes, text));
}

/// From the bottom of one box to the top of the other.
fn curve(from: &Rectangle, to: &Rectangle, arrow: &Arrow) -> String {
    let [x0, y0] = [from[0] + from[2] / 2.0, from[1] + from[3]];
    let [x1, y1] = [to[0] + to[2] / 2.0, to[1]];
    let bend = ((y1 - y0).abs() / 2.0).max(GAP / 2.0);
    let dashes = if arrow.earlier { " stroke-dasharray=\"4 3\"" } else { "" };
    let (c0, c1) = (y0 + bend, y1 - bend);
    format!(
        "<path d=\"M{x0:.1} {y0:.1}C{x0:.1} {c0:.1} {x1:.1} {c1:.1} {x1:.1} {y1:.1}\" fill=\"none\" stroke=\"#456\" opacity=\"0.7\"{dashes} marker-end=\"url(#arrow)\"><title>{}</title></path>\n",
        arrow.label
    )
}
