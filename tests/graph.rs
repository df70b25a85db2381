//! Drawings of pipelines, as a reader sees them: no line crosses a box or a text, no text lies on another, and nothing is cut off.

use hemisplat::passes::REGISTRY;
use hemisplat::pipeline::{Format, Pipeline, embedded::EMBEDDED, export, load};
use proptest::{prelude::*, test_runner::RngSeed};
use roxmltree::{Document, Node};
use std::io;
use std::ops::Range;

/// Left, top, right, bottom.
type Rectangle = [f64; 4];
type Point = [f64; 2];

/// What a drawing shows.
#[derive(Default)]
struct Drawing {
    view: Rectangle,
    boxes: Vec<Rectangle>,
    /// Frames with the range of bytes that draws what is in them.
    frames: Vec<(Rectangle, Range<usize>)>,
    texts: Vec<(Rectangle, String)>,
    /// Source, corners of each part, and where it is drawn.
    lines: Vec<(String, Vec<Vec<Point>>, usize)>,
    heads: usize,
}

fn number(node: &Node<'_, '_>, name: &str) -> f64 {
    node.attribute(name).unwrap_or("0").parse().unwrap()
}

fn rectangle(node: &Node<'_, '_>) -> Rectangle {
    let [x, y, width, height] = ["x", "y", "width", "height"].map(|name| number(node, name));
    [x, y, x + width, y + height]
}

/// Letters are 0.602 of their size wide, a little higher than their size.
fn text(node: &Node<'_, '_>) -> (Rectangle, String) {
    let size = match node.attribute("class") {
        Some("name") => 13.0,
        Some("pass") => 11.0,
        _ => 10.0,
    };
    let content = node.text().unwrap().to_owned();
    let width = content.chars().count() as f64 * 0.602 * size;
    let starts = node.ancestors().find_map(|node| node.attribute("text-anchor")) == Some("start");
    let [x, y] = ["x", "y"].map(|name| number(node, name));
    let left = if starts { x } else { x - width / 2.0 };
    ([left, y - 0.8 * size, left + width, y + 0.25 * size], content)
}

/// The corners of a path: a bend counts as the corner that it rounds.
fn parts(path: &str) -> Vec<Vec<Point>> {
    let part = |part: &str| {
        let numbers: Vec<f64> = part.split(['L', 'Q', ' ']).filter(|word| !word.is_empty()).map(|word| word.parse().unwrap()).collect();
        numbers.chunks(2).map(|pair| [pair[0], pair[1]]).collect()
    };
    path.split('M').skip(1).map(part).collect()
}

fn drawing(svg: &str) -> Drawing {
    let document = Document::parse(svg).unwrap();
    let view: Vec<f64> = document.root_element().attribute("viewBox").unwrap().split(' ').map(|word| word.parse().unwrap()).collect();
    let mut drawing = Drawing { view: [view[0], view[1], view[2], view[3]], ..Drawing::default() };
    for node in document.descendants() {
        match (node.tag_name().name(), node.attribute("class")) {
            ("rect", Some("loop")) => drawing.frames.push((rectangle(&node), node.parent().unwrap().range())),
            ("rect", Some(_)) => drawing.boxes.push(rectangle(&node)),
            ("text", _) => drawing.texts.push(text(&node)),
            ("path", Some(_)) => {
                let source = node.children().find_map(|child| child.text()).unwrap().split(' ').next().unwrap().to_owned();
                let earlier = node.attribute("class").unwrap();
                drawing.lines.push((format!("{source} {earlier}"), parts(node.attribute("d").unwrap()), node.range().start));
            }
            ("path", None) => drawing.heads += 1,
            _ => {}
        }
    }
    drawing
}

fn segments(parts: &[Vec<Point>]) -> impl Iterator<Item = [Point; 2]> {
    parts.iter().flat_map(|points| points.windows(2).map(|pair| [pair[0], pair[1]]))
}

/// Whether a horizontal or vertical segment comes into a rectangle.
fn enters([a, b]: &[Point; 2], [left, top, right, bottom]: &Rectangle) -> bool {
    let range = |axis: usize| (a[axis].min(b[axis]), a[axis].max(b[axis]));
    let ((x0, x1), (y0, y1)) = (range(0), range(1));
    x1 > left + 0.5 && x0 < right - 0.5 && y1 > top + 0.5 && y0 < bottom - 0.5
}

fn overlap(a: &Rectangle, b: &Rectangle) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

fn is_within(inner: &Rectangle, outer: &Rectangle) -> bool {
    outer[0] <= inner[0] && outer[1] <= inner[1] && inner[2] <= outer[2] && inner[3] <= outer[3]
}

/// Whether two segments lie on each other for more than a bend.
fn share([a, b]: &[Point; 2], [c, d]: &[Point; 2]) -> bool {
    let along = |axis: usize| {
        let across = 1 - axis;
        let same_line = a[across] == b[across] && c[across] == d[across] && (a[across] - c[across]).abs() < 2.0;
        same_line && a[axis].max(b[axis]).min(c[axis].max(d[axis])) - a[axis].min(b[axis]).max(c[axis].min(d[axis])) > 2.0
    };
    along(0) || along(1)
}

/// What is wrong with a drawing.
fn faults(svg: &str) -> Vec<String> {
    let drawing = drawing(svg);
    let mut faults = Vec::new();
    for (source, parts, place) in &drawing.lines {
        for segment in segments(parts) {
            faults.extend(drawing.boxes.iter().filter(|each| enters(&segment, each)).map(|each| format!("{source} crosses a box {each:?} by {segment:?}")));
            faults.extend(drawing.texts.iter().filter(|(each, _)| enters(&segment, each)).map(|(_, content)| format!("{source} crosses the text {content}")));
            let passes = |(frame, inside): &&(Rectangle, Range<usize>)| !inside.contains(place) && enters(&segment, frame);
            faults.extend(drawing.frames.iter().filter(passes).map(|_| format!("{source} crosses a frame by {segment:?}")));
            let is_outside = segment.iter().any(|[x, y]| !is_within(&[*x, *y, *x, *y], &drawing.view));
            faults.extend(is_outside.then(|| format!("{source} leaves the view")));
        }
    }
    for (index, (source, parts, _)) in drawing.lines.iter().enumerate() {
        for (other, others, _) in drawing.lines[..index].iter().filter(|(other, ..)| other.split(' ').next() != source.split(' ').next()) {
            let meets = segments(parts).find(|a| segments(others).any(|b| share(a, &b)));
            faults.extend(meets.map(|at| format!("{source} and {other} lie on each other at {at:?}")));
        }
    }
    for (index, each) in drawing.boxes.iter().enumerate() {
        faults.extend(drawing.boxes[..index].iter().filter(|other| overlap(each, other)).map(|other| format!("boxes {each:?} and {other:?} overlap")));
        faults.extend((!is_within(each, &drawing.view)).then(|| format!("a box leaves the view: {each:?}")));
        let cut = |(frame, _): &&(Rectangle, Range<usize>)| overlap(each, frame) && !is_within(each, frame);
        faults.extend(drawing.frames.iter().filter(cut).map(|_| format!("a frame cuts a box: {each:?}")));
    }
    for (index, (each, content)) in drawing.texts.iter().enumerate() {
        faults.extend(drawing.texts[..index].iter().filter(|(other, _)| overlap(each, other)).map(|(_, other)| format!("{content} and {other} overlap")));
        faults.extend(drawing.boxes.iter().filter(|other| overlap(each, other) && !is_within(each, other)).map(|_| format!("{content} does not fit its box")));
        let holds = drawing.boxes.iter().chain(drawing.frames.iter().map(|(frame, _)| frame)).any(|other| is_within(each, other));
        faults.extend((!holds).then(|| format!("{content} is in no box or frame")));
    }
    faults.extend(drawing.frames.iter().filter(|(frame, _)| !is_within(frame, &drawing.view)).map(|(frame, _)| format!("a frame leaves the view: {frame:?}")));
    faults
}

fn load_text(text: &str) -> Pipeline {
    load("test.ron", &[], REGISTRY, &mut |_| Ok(text.to_owned())).unwrap_or_else(|problems| panic!("{:?}\n{text}", problems.0))
}

#[test]
fn every_pipeline_that_ships_is_drawn_cleanly() {
    for (file, _) in EMBEDDED {
        let pipeline = load(file, &[], REGISTRY, &mut |_| Err(io::ErrorKind::NotFound.into())).unwrap();
        let svg = export(&pipeline, Format::Svg);
        assert_eq!(faults(&svg), [""; 0], "{file}");
        // What dot draws between nodes has a head here.
        assert_eq!(drawing(&svg).heads, export(&pipeline, Format::Dot).matches(" -> ").count(), "{file}");
        let nodes = pipeline.names().len() + pipeline.outputs.len();
        assert_eq!(drawing(&svg).boxes.len() + drawing(&svg).frames.len(), nodes, "{file}");
    }
}

const LOOPS: &str = r#"Pipeline(version: 1, about: "", nodes: [
    (name: "gbuffer", pass: GBuffer()),
    (name: "direct", pass: DirectLight(gbuffer: "gbuffer")),
    (name: "outer", repeat: Iterate(rounds: 2, nodes: [
        (name: "bounces", repeat: Iterate(rounds: 4, nodes: [(name: "sum", pass: Composite(gbuffer: "gbuffer", direct: "direct", indirect: PreviousRound("sum")))])),
        (name: "more", pass: Composite(gbuffer: "gbuffer", indirect: ["sum", PreviousFrame("late")])),
    ])),
    (name: "late", pass: Composite(gbuffer: "gbuffer", indirect: PreviousFrame("sum"))),
], outputs: { "picture": "sum", "late": "late", "more": "more" })"#;

#[test]
fn what_earlier_rounds_and_frames_left_comes_around_on_dashed_lines() {
    let svg = export(&load_text(LOOPS), Format::Svg);
    assert_eq!(faults(&svg), [""; 0]);
    for text in [">indirect, round before<", ">indirect, frame before<", ">Iterate, 4 rounds<", "<title>sum.picture → sum.indirect</title>"] {
        assert!(svg.contains(text), "{text}\n{svg}");
    }
    let dashed: Vec<&str> = svg.lines().filter(|line| line.contains("class=\"edge earlier\"")).collect();
    // Around the sum and out of its frame, out of the next one, and around to `late`; from `late` around to the frame, and on in it.
    assert_eq!(dashed.len(), 3 + 2, "{svg}");
}

/// Nodes that read nodes before them, or earlier values of any, in loops at random.
fn random_document(steps: &[(u8, u16, u16, u8)]) -> String {
    let name = |index: usize| format!("n{index}{}", "_x".repeat(steps[index].3 as usize));
    let mut text = String::from("(name: \"g\", pass: GBuffer()),\n(name: \"d\", pass: DirectLight(gbuffer: \"g\")),\n");
    let (mut made, mut open): (Vec<String>, Vec<usize>) = (vec!["g.depth".into(), "g.normal".into()], Vec::new());
    for (index, (kind, a, b, _)) in steps.iter().enumerate() {
        let pick = |number: u16| made[number as usize % made.len()].clone();
        let (first, second) = (pick(*a), pick(*b));
        let inside = open.last().is_some_and(|start| made.len() > *start);
        match kind {
            0 if open.len() < 3 => {
                text += &format!("(name: \"{}\", repeat: Iterate(rounds: 2, nodes: [\n", name(index));
                open.push(made.len());
                continue;
            }
            1 if inside => {
                text += "])),\n";
                open.pop();
                continue;
            }
            2 => text += &format!("(name: \"{}\", pass: Composite(gbuffer: \"g\", indirect: [\"{first}\", PreviousFrame(\"{second}\")])),\n", name(index)),
            3 if !open.is_empty() => {
                let own = name(index);
                text += &format!("(name: \"{own}\", pass: Composite(gbuffer: \"g\", indirect: [PreviousRound(\"{own}.indirect\"), \"{first}\"])),\n");
            }
            4 => text += &format!("(name: \"{}\", pass: Composite(gbuffer: \"g\", direct: \"d\")),\n", name(index)),
            _ => text += &format!("(name: \"{}\", pass: Composite(gbuffer: \"g\", indirect: [\"{first}\", \"{second}\"])),\n", name(index)),
        }
        made.extend([name(index), format!("{}.indirect", name(index))]);
    }
    if open.last().is_some_and(|start| made.len() == *start) {
        text += "(name: \"last\", pass: Composite(gbuffer: \"g\", direct: \"d\")),\n";
    }
    text += &"])),\n".repeat(open.len());
    let outputs: Vec<String> = made.iter().enumerate().step_by(3).map(|(index, node)| format!("\"layer{index}\": \"{node}\"")).collect();
    format!("Pipeline(version: 1, about: \"\", nodes: [\n{text}], outputs: {{ {} }})", outputs.join(", "))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]
    #[test]
    fn random_pipelines_are_drawn_cleanly(steps in prop::collection::vec((0u8..9, any::<u16>(), any::<u16>(), 0u8..6), 1..24)) {
        let text = random_document(&steps);
        let svg = export(&load_text(&text), Format::Svg);
        let faults = faults(&svg);
        prop_assert!(faults.is_empty(), "{}\n{text}", faults.join("\n"));
    }
}
