//! A pipeline as an SVG picture: boxes with their ports, loops as frames around their nodes, lines that cross no box.

use super::layers::{Block, End, Level, Line, Net, Pin, Role};
use super::{Arrow, about, arrows, output_id};
use crate::contract::PortKind;
use crate::pipeline::graph::family;
use crate::pipeline::{Layer, Node, Pipeline, When};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Room around the drawing, and between a frame and what is in it.
const MARGIN: i32 = 24;
const FRAME_MARGIN: i32 = 18;
/// Sizes of letters [pixels]; those of fixed-width fonts are 0.602 of that wide.
const NAME_SIZE: i32 = 13;
const PASS_SIZE: i32 = 11;
const PORT_SIZE: i32 = 10;
const LETTER: f32 = 0.602;
const FONTS: &str = "ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, monospace";
/// Height of a row of ports, of a node's name and pass, of an output, and of a frame's title.
const PORT_ROW: i32 = 15;
const TEXT_ROWS: i32 = 38;
const OUTPUT_HEIGHT: i32 = 28;
const TITLE_TOP: i32 = 6;
const TITLE_LINE: i32 = 15;
const LEAST_WIDTH: i32 = 104;
/// Radius of a line's bends, and height of an arrow's head.
const BEND: i32 = 6;
const HEAD: i32 = 8;
const PLAIN: &str = "#5b6b80";

/// Lines of one kind have one colour.
fn colour(kind: PortKind) -> &'static str {
    match kind {
        PortKind::GBuffer | PortKind::Lobes | PortKind::VisibleLobes => "#3d6fb4",
        PortKind::DirectLight | PortKind::ShadowMaps | PortKind::Image | PortKind::PhotonMap | PortKind::Lightmap => "#b26a00",
        PortKind::RecordCache | PortKind::IrradianceField | PortKind::Records | PortKind::Splats => "#2f7f5f",
        PortKind::Requests | PortKind::Shooters | PortKind::ShooterViews | PortKind::Tiles | PortKind::WeightedTiles => "#8a4f9e",
        PortKind::Flag | PortKind::Own(_) => PLAIN,
    }
}

/// A pipeline's drawing.
pub fn svg(pipeline: &Pipeline) -> String {
    let all = arrows(pipeline);
    let sheet = Sheet::new(&pipeline.nodes, &pipeline.outputs, &all, None);
    let [width, height] = [sheet.size[0], sheet.size[1] + 2 * MARGIN];
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" font-family=\"{FONTS}\" text-anchor=\"middle\">\n\
         <style>\n\
         .node {{ fill: #f3f6fa; stroke: #5b6b80 }}\n\
         .layer {{ fill: #e3f2e6; stroke: #3f7d52 }}\n\
         .loop {{ fill: #fbf8ef; stroke: #b0a276; stroke-dasharray: 2 3 }}\n\
         .name {{ font-size: {NAME_SIZE}px; font-weight: bold; fill: #1b2430 }}\n\
         .pass {{ font-size: {PASS_SIZE}px; fill: #4a586b }}\n\
         .port {{ font-size: {PORT_SIZE}px; fill: #6a7687 }}\n\
         .edge {{ fill: none; stroke-width: 1.5 }}\n\
         .earlier {{ stroke-dasharray: 5 4 }}\n\
         </style>\n\
         <rect width=\"{width}\" height=\"{height}\" rx=\"8\" fill=\"#ffffff\"/>\n"
    );
    sheet.paint([0, MARGIN], &mut text);
    text.push_str("</svg>\n");
    text
}

/// What leaves one output: the node, the output, and whether an earlier round or frame is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Key<'p> {
    from: &'p str,
    output: &'p str,
    earlier: bool,
}

/// What a pin of a block is for: an input of a node by its name and what it is joined to, or a line that goes on in a frame or beyond it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Slot<'p> {
    Input(&'p str, Key<'p>),
    Line(Key<'p>),
}

/// A block with what it shows.
struct Part<'p> {
    /// The node, or the layer.
    id: String,
    shown: Shown<'p>,
    inputs: Vec<(Slot<'p>, String)>,
    outputs: Vec<(Key<'p>, String)>,
}

enum Shown<'p> {
    /// Name and pass.
    Node([&'p str; 2]),
    Layer(&'p str),
    Frame(Sheet<'p>),
    /// A place on a frame's border, or its title.
    Nothing,
}

/// One level of a pipeline, laid out.
struct Sheet<'p> {
    size: [i32; 2],
    /// Of a loop, line by line.
    title: Option<Vec<String>>,
    parts: Vec<Part<'p>>,
    blocks: Vec<Block>,
    nets: Vec<(Key<'p>, Net)>,
    lines: Vec<Line>,
    colours: BTreeMap<Key<'p>, &'static str>,
}

impl<'p> Key<'p> {
    fn of(arrow: &'p Arrow) -> Self {
        Self { from: &arrow.from, output: arrow.output, earlier: arrow.when != When::Now }
    }
}

impl<'p> Sheet<'p> {
    fn new(nodes: &'p [Node], layers: &'p [Layer], arrows: &'p [Arrow], title: Option<Vec<String>>) -> Self {
        let mut sheet = Self { size: [0; 2], title, parts: Vec::new(), blocks: Vec::new(), nets: Vec::new(), lines: Vec::new(), colours: BTreeMap::new() };
        let mut holders = BTreeMap::new();
        for node in nodes {
            family(node, &mut |member| {
                holders.insert(member.name.clone(), sheet.parts.len());
            });
            sheet.add_node(node, arrows);
        }
        for layer in layers {
            holders.insert(output_id(&layer.name), sheet.parts.len());
            sheet.add_layer(layer, arrows);
        }
        if let Some(title) = &sheet.title {
            let width = title.iter().map(|line| text_width(line, NAME_SIZE)).max().unwrap_or(0);
            sheet.add(Part::nothing(), Block { size: [width, TITLE_TOP + title.len() as i32 * TITLE_LINE], role: Role::Title, ..Block::default() });
        }
        arrows.iter().for_each(|arrow| sheet.join(arrow, &holders));
        sheet.lay_out();
        sheet
    }

    fn add(&mut self, part: Part<'p>, block: Block) -> usize {
        self.parts.push(part);
        self.blocks.push(block);
        self.parts.len() - 1
    }

    fn add_node(&mut self, node: &'p Node, arrows: &'p [Arrow]) {
        if node.inner().is_empty() {
            return self.add_pass(node, arrows);
        }
        let sheet = Sheet::new(node.inner(), &[], arrows, Some([vec![node.name.clone()], about(node)].concat()));
        let border = |role: Role| sheet.blocks.iter().zip(&sheet.parts).filter(move |(block, _)| block.role == role);
        let inputs = border(Role::Entry).filter_map(|(_, part)| Some((Slot::Line(part.outputs.first()?.0), String::new()))).collect();
        let outputs =
            border(Role::Exit).filter_map(|(_, part)| part.inputs.first()).filter_map(|(slot, _)| slot.line()).map(|key| (key, String::new())).collect();
        let pins = |role: Role| border(role).map(|(block, _)| Pin { offset: block.position[0], ..Pin::default() }).collect();
        let block = Block { size: sheet.size, inputs: pins(Role::Entry), outputs: pins(Role::Exit), role: Role::Frame, ..Block::default() };
        self.add(Part { id: node.name.clone(), inputs, outputs, shown: Shown::Frame(sheet) }, block);
    }

    fn add_pass(&mut self, node: &'p Node, arrows: &'p [Arrow]) {
        let description = node.description();
        let label = |arrow: &Arrow| match arrow.when {
            When::Now if description.inputs.len() == 1 => String::new(),
            When::Now => arrow.label.into(),
            When::PreviousRound => format!("{}, round before", arrow.label),
            When::PreviousFrame => format!("{}, frame before", arrow.label),
        };
        let inputs = arrows.iter().filter(|arrow| arrow.to == node.name).map(|arrow| (Slot::Input(arrow.label, Key::of(arrow)), label(arrow))).collect();
        let mut keys: Vec<Key<'p>> = arrows.iter().filter(|arrow| arrow.from == node.name).map(Key::of).collect();
        keys.sort();
        keys.dedup();
        let name = |key: &Key<'_>| if description.outputs.len() == 1 { String::new() } else { key.output.into() };
        let part = Part {
            id: node.name.clone(),
            shown: Shown::Node([&node.name, description.name]),
            inputs,
            outputs: keys.iter().map(|key| (*key, name(key))).collect(),
        };
        let block = part.block(text_width(&node.name, NAME_SIZE).max(text_width(description.name, PASS_SIZE)), TEXT_ROWS);
        self.add(part, block);
    }

    fn add_layer(&mut self, layer: &'p Layer, arrows: &'p [Arrow]) {
        let id = output_id(&layer.name);
        let inputs = arrows.iter().filter(|arrow| arrow.to == id).map(|arrow| (Slot::Input(arrow.label, Key::of(arrow)), String::new())).collect();
        let part = Part { id, shown: Shown::Layer(&layer.name), inputs, outputs: Vec::new() };
        let block = part.block(text_width(&layer.name, NAME_SIZE), OUTPUT_HEIGHT);
        self.add(part, block);
    }

    /// Draws an arrow, as far as it runs on this level.
    fn join(&mut self, arrow: &'p Arrow, holders: &BTreeMap<String, usize>) {
        let key = Key::of(arrow);
        self.colours.insert(key, colour(arrow.kind));
        let (from, to) = (holders.get(&arrow.from).copied(), holders.get(&arrow.to).copied());
        let is_frame = |part: usize| matches!(self.parts[part].shown, Shown::Frame(_));
        let is_inside = from == to && from.is_none_or(is_frame);
        if is_inside {
            return;
        }
        let target = match to {
            Some(part) => {
                self.parts[part].inputs.iter().position(|(slot, _)| *slot == Slot::Input(arrow.label, key) || *slot == Slot::Line(key)).map(|pin| (part, pin))
            }
            None => Some((self.exit(key), 0)),
        };
        let (Some(net), Some(target)) = (self.net(key, from), target) else { return };
        let net = &mut self.nets[net].1;
        let goes_around = key.earlier && from.is_some() && to.is_some();
        let targets = if goes_around { &mut net.back } else { &mut net.targets };
        if !targets.contains(&target) {
            targets.push(target);
        }
    }

    /// The net of a key, that starts in this level or comes in from outside.
    fn net(&mut self, key: Key<'p>, from: Option<usize>) -> Option<usize> {
        if let Some(found) = self.nets.iter().position(|(other, _)| *other == key) {
            return Some(found);
        }
        let source = match from {
            Some(part) => (part, self.parts[part].outputs.iter().position(|(other, _)| *other == key)?),
            None => {
                let part = Part { outputs: vec![(key, String::new())], ..Part::nothing() };
                (self.add(part, Block { outputs: vec![Pin::default()], role: Role::Entry, ..Block::default() }), 0)
            }
        };
        self.nets.push((key, Net { source, targets: Vec::new(), back: Vec::new() }));
        Some(self.nets.len() - 1)
    }

    /// Where a key's line leaves the frame.
    fn exit(&mut self, key: Key<'p>) -> usize {
        let is_it = |(block, part): (&Block, &Part<'p>)| block.role == Role::Exit && part.inputs.first().is_some_and(|(slot, _)| *slot == Slot::Line(key));
        if let Some(found) = self.blocks.iter().zip(&self.parts).position(is_it) {
            return found;
        }
        let part = Part { inputs: vec![(Slot::Line(key), String::new())], ..Part::nothing() };
        self.add(part, Block { inputs: vec![Pin::default()], role: Role::Exit, ..Block::default() })
    }

    fn lay_out(&mut self) {
        let is_frame = self.title.is_some();
        let nets = self.nets.iter().map(|(_, net)| net.clone()).collect();
        let mut level = Level { blocks: std::mem::take(&mut self.blocks), nets };
        let (size, lines) = level.lay_out(if is_frame { FRAME_MARGIN } else { MARGIN });
        (self.size, self.lines, self.blocks) = (size, lines, level.blocks);
        if is_frame && self.blocks.iter().all(|block| block.role != Role::Exit) {
            self.size[1] += FRAME_MARGIN;
        }
    }

    fn paint(&self, origin: [i32; 2], text: &mut String) {
        let at = |position: [i32; 2]| [origin[0] + position[0], origin[1] + position[1]];
        if let Some(title) = &self.title {
            let ([x, y], [width, height]) = (origin, self.size);
            let _ = writeln!(text, "<g class=\"inside\">\n<rect class=\"loop\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" rx=\"10\"/>");
            let _ = writeln!(text, "<g text-anchor=\"start\">");
            for (index, line) in title.iter().enumerate() {
                write_text(if index == 0 { "name" } else { "pass" }, [x + FRAME_MARGIN, y + TITLE_TOP + (index as i32 + 1) * TITLE_LINE], line, text);
            }
            let _ = writeln!(text, "</g>");
        }
        for (index, (key, _)) in self.nets.iter().enumerate() {
            self.paint_net(index, key, origin, text);
        }
        for (part, block) in self.parts.iter().zip(&self.blocks) {
            part.paint(block, at(block.position), text);
        }
        if self.title.is_some() {
            text.push_str("</g>\n");
        }
    }

    /// All lines of a net are one path, so that what they share is drawn once.
    fn paint_net(&self, index: usize, key: &Key<'_>, origin: [i32; 2], text: &mut String) {
        let lines: Vec<&Line> = self.lines.iter().filter(|line| line.net == index).collect();
        let has_head = |line: &Line| !matches!(self.blocks[line.target.0].role, Role::Frame | Role::Exit);
        let moved = |line: &Line| line.points.iter().map(|point| [origin[0] + point[0], origin[1] + point[1]]).collect::<Vec<_>>();
        let paths: String = lines.iter().map(|line| path(&moved(line), if has_head(line) { HEAD - 2 } else { 0 })).collect();
        let mut tips: Vec<String> = lines.iter().map(|line| self.end(line.target)).filter(|end| !end.is_empty()).collect();
        tips.dedup();
        let class = if key.earlier { "edge earlier" } else { "edge" };
        let arrow = if tips.is_empty() { String::new() } else { format!(" → {}", tips.join(", ")) };
        let colour = self.colours.get(key).copied().unwrap_or(PLAIN);
        let _ = writeln!(text, "<path class=\"{class}\" stroke=\"{colour}\" d=\"{paths}\"><title>{}.{}{arrow}</title></path>", key.from, key.output);
        for [x, y] in lines.iter().filter(|line| has_head(line)).filter_map(|line| moved(line).last().copied()) {
            let _ = writeln!(text, "<path fill=\"{colour}\" d=\"M{x} {y}l-4 -{HEAD}h8z\"/>");
        }
    }

    /// "splats.gbuffer", or the name of a layer; nothing where the line goes on in a frame or beyond it.
    fn end(&self, (part, pin): End) -> String {
        let Part { id, shown, inputs, .. } = &self.parts[part];
        match (shown, inputs[pin].0) {
            (Shown::Layer(name), _) => (*name).into(),
            (Shown::Node(_), Slot::Input(input, _)) => format!("{id}.{input}"),
            _ => String::new(),
        }
    }
}

impl<'p> Slot<'p> {
    fn line(&self) -> Option<Key<'p>> {
        match self {
            Self::Input(..) => None,
            Self::Line(key) => Some(*key),
        }
    }
}

impl Part<'_> {
    fn nothing() -> Self {
        Self { id: String::new(), shown: Shown::Nothing, inputs: Vec::new(), outputs: Vec::new() }
    }

    /// A block that has room for its text and the labels of its ports.
    fn block(&self, text: i32, rows: i32) -> Block {
        let pin = |label: &String| Pin { cell: (text_width(label, PORT_SIZE) + 14).max(26), ..Pin::default() };
        let inputs: Vec<Pin> = self.inputs.iter().map(|(_, label)| pin(label)).collect();
        let outputs: Vec<Pin> = self.outputs.iter().map(|(_, label)| pin(label)).collect();
        let cells = |pins: &[Pin]| pins.iter().map(|pin| pin.cell).sum::<i32>() + 10;
        let width = (text + 2 * 14).max(cells(&inputs)).max(cells(&outputs)).max(LEAST_WIDTH);
        let height = rows + PORT_ROW * (i32::from(self.has_labels(true)) + i32::from(self.has_labels(false)));
        Block { size: [width + width % 2, height], inputs, outputs, ..Block::default() }
    }

    fn has_labels(&self, of_inputs: bool) -> bool {
        if of_inputs { self.inputs.iter().any(|(_, label)| !label.is_empty()) } else { self.outputs.iter().any(|(_, label)| !label.is_empty()) }
    }

    fn paint(&self, block: &Block, [x, y]: [i32; 2], text: &mut String) {
        let [width, height] = block.size;
        let middle = x + width / 2;
        match &self.shown {
            Shown::Nothing => {}
            Shown::Frame(sheet) => sheet.paint([x, y], text),
            Shown::Layer(name) => {
                let _ = writeln!(text, "<rect class=\"layer\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" rx=\"{}\"/>", height / 2);
                write_text("name", [middle, y + 18], name, text);
            }
            Shown::Node([name, pass]) => {
                let _ = writeln!(text, "<rect class=\"node\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" rx=\"5\"/>");
                let top = y + if self.has_labels(true) { PORT_ROW } else { 0 };
                write_text("name", [middle, top + 16], name, text);
                write_text("pass", [middle, top + 30], pass, text);
                for (pin, (_, label)) in block.inputs.iter().zip(&self.inputs) {
                    write_text("port", [x + pin.label, y + 13], label, text);
                }
                for (pin, (_, label)) in block.outputs.iter().zip(&self.outputs) {
                    write_text("port", [x + pin.label, y + height - 6], label, text);
                }
            }
        }
    }
}

fn text_width(text: &str, size: i32) -> i32 {
    (text.chars().count() as f32 * size as f32 * LETTER).ceil() as i32
}

fn write_text(class: &str, [x, y]: [i32; 2], content: &str, text: &mut String) {
    if !content.is_empty() {
        let _ = writeln!(text, "<text class=\"{class}\" x=\"{x}\" y=\"{y}\">{content}</text>");
    }
}

/// A line with round bends, that ends so much above its end.
fn path(points: &[[i32; 2]], short: i32) -> String {
    let [Some([x0, y0]), Some([x, y])] = [points.first(), points.last()] else { return String::new() };
    let mut path = format!("M{x0} {y0}");
    for window in points.windows(3) {
        let [before, at, after] = [window[0], window[1], window[2]];
        let bend = BEND.min(distance(before, at) / 2).min(distance(at, after) / 2);
        let ([x1, y1], [x2, y2]) = (toward(at, before, bend), toward(at, after, bend));
        let _ = write!(path, "L{x1} {y1}Q{} {} {x2} {y2}", at[0], at[1]);
    }
    let _ = write!(path, "L{x} {}", y - short);
    path
}

fn distance(a: [i32; 2], b: [i32; 2]) -> i32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).abs()
}

/// From a point some way toward another at the same height or below it.
fn toward(from: [i32; 2], to: [i32; 2], by: i32) -> [i32; 2] {
    [from[0] + (to[0] - from[0]).signum() * by, from[1] + (to[1] - from[1]).signum() * by]
}
