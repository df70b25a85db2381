//! One figure: a value over another, both on logarithmic axes, as SVG that needs nothing beside itself.

use super::labels::{self, Label};
use std::fmt::Write;

/// What is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    pub title: String,
    /// With its unit.
    pub x_label: String,
    /// With its unit.
    pub y_label: String,
    /// What the words beside marks of the front are; empty where all marks have them.
    pub label_of_marks: String,
    pub lines: Vec<Line>,
}

/// Marks that belong together, joined in their order.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    pub name: String,
    pub marks: Vec<Mark>,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mark {
    /// `data-id` of its group, for pages that answer to a click; empty where they do not.
    pub id: String,
    /// Stands beside it.
    pub label: Option<String>,
    /// Shown where a pointer rests on it.
    pub about: String,
    /// Positive.
    pub x: f64,
    /// Positive.
    pub x_spread: [f64; 2],
    /// Positive; 0 is drawn at the lower end of the axis.
    pub y: f64,
    /// As `y`; holds it.
    pub y_spread: [f64; 2],
    /// Whether all that is known is that it lies below `y`: drawn hollow.
    pub is_limit: bool,
    /// Whether no other mark beats it.
    pub is_on_front: bool,
}

/// How wide the figure is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Paper {
    Wide,
    /// For a phone: letters are as large as those of the wide one, beside a picture half as wide.
    Narrow,
}

impl Paper {
    fn width(self) -> f64 {
        match self {
            Self::Wide => 800.0,
            Self::Narrow => 400.0,
        }
    }

    /// Where the axes are: left, right, top, bottom.
    fn frame(self) -> [f64; 4] {
        [76.0, self.width() - 24.0, 48.0, 440.0]
    }
}

/// Below the axis: its ticks, its name.
const BELOW: f64 = 64.0;
const ROW: f64 = 22.0;
/// What a hollow mark says.
const LIMITS: &str = "hidden by the noise of the reference: the error is below";
/// The mean width of a letter of 1 pixel.
const LETTER: f64 = 0.54;
/// Between the middles of two ticks' words.
const TICK: f64 = 40.0;
/// The narrowest range of an axis: its ends differ by this factor.
const NARROWEST: f64 = 1.5;
/// Left free at each end of an axis.
const MARGIN: f64 = 0.07;
/// Fewer ticks tell no scale.
const FEWEST_TICKS: usize = 3;

/// Legible on white and on black.
const COLOURS: [&str; 6] = ["#0072b2", "#c44e00", "#00805c", "#b0568a", "#8a6d00", "#6b6fd0"];

/// Of all, so that lines of one colour differ.
const SHAPES: [&str; 4] = ["M-5,0a5,5 0 1,0 10,0a5,5 0 1,0 -10,0z", "M-4.5,-4.5h9v9h-9z", "M0,-6l5.5,10h-11z", "M0,-6.5l5.5,6.5l-5.5,6.5l-5.5,-6.5z"];

const STYLE: &str = ".hemisplat-plot{background:#fff}\
.hemisplat-plot text{font:13px system-ui,sans-serif;fill:#1b1f24}\
.hemisplat-plot .title{font-size:15px;font-weight:600}\
.hemisplat-plot .grid{stroke:#d8dde3;stroke-width:1}\
.hemisplat-plot .frame{fill:none;stroke:#6a737d}\
.hemisplat-plot .front{fill:none;stroke:#1b1f24;stroke-width:1.5;stroke-dasharray:5 4}\
.hemisplat-plot .ring{fill:none;stroke:#1b1f24;stroke-width:1.5}\
.hemisplat-plot .line{fill:none;stroke-width:1.8}\
.hemisplat-plot .spread{stroke-width:1.2;fill:none}\
.hemisplat-plot .shape{stroke:none}\
.hemisplat-plot .hollow{fill:#fff;stroke-width:2}\
.hemisplat-plot .leader{stroke:#6a737d;stroke-width:1}\
.hemisplat-plot .mark text{paint-order:stroke;stroke:#fff;stroke-width:4px;stroke-linejoin:round}\
@media (prefers-color-scheme:dark){\
.hemisplat-plot{background:#14171a}\
.hemisplat-plot text{fill:#e6e9ec}\
.hemisplat-plot .mark text{stroke:#14171a}\
.hemisplat-plot .hollow{fill:#14171a}\
.hemisplat-plot .grid{stroke:#30363d}\
.hemisplat-plot .front,.hemisplat-plot .ring{stroke:#e6e9ec}}";

/// An axis: values from `low` to `high` lie between two places on the paper.
struct Scale {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// Holds all values that are positive.
    fn of(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let positive = values.filter(|value| *value > 0.0 && value.is_finite());
        let ends = positive.fold(None, |ends: Option<[f64; 2]>, value| Some(ends.map_or([value; 2], |[low, high]| [low.min(value), high.max(value)])));
        let [low, high] = ends.unwrap_or([1.0; 2]).map(f64::ln);
        let span = (high - low).max(NARROWEST.ln());
        let middle = (low + high) / 2.0;
        let half = span * (0.5 + MARGIN);
        Self { low: (middle - half).exp(), high: (middle + half).exp(), from, to }
    }

    fn place(&self, value: f64) -> f64 {
        let share = (value / self.low).ln() / (self.high / self.low).ln();
        self.from + share.clamp(0.0, 1.0) * (self.to - self.from)
    }

    /// Round values within the range, of the coarsest kind that gives enough of them.
    fn ticks(&self) -> Vec<f64> {
        let every = |step| (10..100).step_by(step).collect::<Vec<u32>>();
        let kinds = [vec![10], vec![10, 20, 50], every(10), every(5), every(2), every(1)];
        let mut found = kinds.iter().map(|tenths| self.ticks_of(tenths));
        found.find(|ticks| ticks.len() >= FEWEST_TICKS).unwrap_or_default()
    }

    /// Tenths times powers of ten.
    fn ticks_of(&self, tenths: &[u32]) -> Vec<f64> {
        let decade = |value: f64| value.log10().floor() as i32;
        let decades = decade(self.low)..=decade(self.high);
        // Read from text, a tick is the number that it is written as.
        let all = decades.flat_map(|decade| tenths.iter().filter_map(move |tenths| format!("{tenths}e{}", decade - 1).parse::<f64>().ok()));
        all.filter(|tick| (self.low..=self.high).contains(tick)).collect()
    }
}

/// The paper with its axes.
struct Canvas {
    paper: Paper,
    frame: [f64; 4],
    x: Scale,
    y: Scale,
}

impl Canvas {
    fn of(plot: &Plot, paper: Paper) -> Self {
        let frame = paper.frame();
        let [left, right, top, bottom] = frame;
        let marks = || plot.lines.iter().flat_map(|line| &line.marks);
        let x = Scale::of(marks().flat_map(|mark| [mark.x, mark.x_spread[0], mark.x_spread[1]]), left, right);
        // The lower end of a limit's interval tells nothing, and would stretch the axis.
        let ends = |mark: &Mark| if mark.is_limit { vec![mark.y] } else { vec![mark.y, mark.y_spread[0], mark.y_spread[1]] };
        Self { paper, frame, x, y: Scale::of(marks().flat_map(ends), bottom, top) }
    }

    fn place(&self, mark: &Mark) -> [f64; 2] {
        [self.x.place(mark.x), self.y.place(mark.y)]
    }
}

/// The figure as a document of its own, which can also stand inside a page. Each mark is a group of the class `mark`; those of the front have a ring.
pub fn svg(plot: &Plot, paper: Paper) -> String {
    let canvas = Canvas::of(plot, paper);
    let [left, _, _, bottom] = canvas.frame;
    let height = bottom + BELOW + ROW * (plot.lines.len() + 3) as f64;
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"hemisplat-plot\" viewBox=\"0 0 {2} {height}\" role=\"img\" aria-label=\"{0}\">\n<style>{STYLE}</style>\n\
         <text class=\"title\" x=\"{left}\" y=\"28\"{1}>{0}</text>\n",
        escaped(&plot.title),
        squeezed(&plot.title, 15.0, paper.width() - left),
        paper.width(),
    );
    text += &axes(plot, &canvas);
    text += &front(plot, &canvas);
    text += &drawn(plot, &canvas);
    text += &legend(plot, &canvas);
    text + "</svg>\n"
}

/// Attributes that keep a text of letters of this size within its room.
fn squeezed(text: &str, size: f64, room: f64) -> String {
    let is_long = text.chars().count() as f64 * size * LETTER > room;
    if is_long { format!(" textLength=\"{room}\" lengthAdjust=\"spacingAndGlyphs\"") } else { String::new() }
}

fn axes(plot: &Plot, canvas: &Canvas) -> String {
    let [left, right, top, bottom] = canvas.frame;
    let mut text = String::new();
    let mut last = f64::NEG_INFINITY;
    for tick in canvas.x.ticks() {
        let at = canvas.x.place(tick);
        let _ = write!(text, "<path class=\"grid\" d=\"M{at:.1},{top}V{bottom}\"/>");
        if at - last >= TICK {
            let _ = writeln!(text, "<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{tick}</text>", bottom + 19.0);
            last = at;
        }
    }
    for tick in canvas.y.ticks() {
        let at = canvas.y.place(tick);
        let _ = writeln!(
            text,
            "<path class=\"grid\" d=\"M{left},{at:.1}H{right}\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{tick}</text>",
            left - 8.0,
            at + 4.5
        );
    }
    let (middle_x, middle_y) = ((left + right) / 2.0, (top + bottom) / 2.0);
    let _ = writeln!(
        text,
        "<rect class=\"frame\" x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\"/>\n<text x=\"{middle_x}\" y=\"{}\" text-anchor=\"middle\"{}>{}</text>\n\
         <text transform=\"translate(20,{middle_y}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        right - left,
        bottom - top,
        bottom + 42.0,
        squeezed(&plot.x_label, 13.0, right - left),
        escaped(&plot.x_label),
        escaped(&plot.y_label)
    );
    text
}

/// Stairs: what is behind them is beaten.
fn front(plot: &Plot, canvas: &Canvas) -> String {
    let on_front = plot.lines.iter().flat_map(|line| &line.marks).filter(|mark| mark.is_on_front);
    let mut places: Vec<[f64; 2]> = on_front.map(|mark| canvas.place(mark)).collect();
    places.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let Some(([first_x, first_y], rest)) = places.split_first().map(|(first, rest)| (*first, rest)) else { return String::new() };
    let stairs: String = rest.iter().map(|[x, y]| format!("H{x:.1}V{y:.1}")).collect();
    format!("<path class=\"front\" d=\"M{first_x:.1},{first_y:.1}{stairs}\"/>\n")
}

/// The lines, below all marks.
fn drawn(plot: &Plot, canvas: &Canvas) -> String {
    let mut text = String::new();
    for (index, line) in plot.lines.iter().enumerate() {
        let places: Vec<String> = line.marks.iter().map(|mark| canvas.place(mark)).map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(text, "<polyline class=\"line\" stroke=\"{}\" points=\"{}\"/>", colour(index), places.join(" "));
    }
    let marks: Vec<(usize, &Mark)> = plot.lines.iter().enumerate().flat_map(|(index, line)| line.marks.iter().map(move |mark| (index, mark))).collect();
    let places: Vec<[f64; 2]> = marks.iter().map(|(_, mark)| canvas.place(mark)).collect();
    // Bold, and with some air.
    let width = |mark: &Mark| mark.label.as_ref().map(|label| label.chars().count() as f64 * 13.0 * 1.15 * LETTER + 4.0);
    let widths: Vec<Option<f64>> = marks.iter().map(|(_, mark)| width(mark)).collect();
    let labels = labels::place(&places, &widths, canvas.frame);
    marks.into_iter().zip(labels).for_each(|((line, mark), label)| text += &group(mark, line, label, canvas));
    text
}

fn group(mark: &Mark, line: usize, label: Option<Label>, canvas: &Canvas) -> String {
    let [at_x, at_y] = canvas.place(mark);
    let [low, high] = mark.x_spread.map(|value| canvas.x.place(value) - at_x);
    let [least, most] = mark.y_spread.map(|value| canvas.y.place(value) - at_y);
    // An arrow where there is no lower end.
    let upright = if mark.is_limit { "M0,0V20M-4,15l4,5l4,-5".to_owned() } else { format!("M0,{least:.1}V{most:.1}M-3,{least:.1}h6M-3,{most:.1}h6") };
    let fill = if mark.is_limit { "hollow" } else { "shape" };
    format!(
        "<g class=\"mark\" data-id=\"{}\" transform=\"translate({at_x:.1},{at_y:.1})\"><title>{}</title>\
         <path class=\"spread\" stroke=\"{colour}\" d=\"M{low:.1},0H{high:.1}M{low:.1},-3v6M{high:.1},-3v6{upright}\"/>\
         <path class=\"{fill}\" stroke=\"{colour}\" fill=\"{colour}\" d=\"{}\"/>{}{}</g>\n",
        escaped(&mark.id),
        escaped(&mark.about),
        shape(line),
        if mark.is_on_front { "<circle class=\"ring\" r=\"9\"/>" } else { "" },
        label.zip(mark.label.as_ref()).map_or(String::new(), |(label, words)| beside(&label, words)),
        colour = colour(line),
    )
}

/// The words of a mark, seen from it; a line leads to those that stand far off.
fn beside(label: &Label, words: &str) -> String {
    let [x, y] = label.middle;
    let leader = if label.is_far { format!("<path class=\"leader\" d=\"M0,0L{x:.1},{y:.1}\"/>") } else { String::new() };
    format!("{leader}<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>", y + 4.5, escaped(words))
}

/// The names of the lines, and where there is a ring what it says.
fn legend(plot: &Plot, canvas: &Canvas) -> String {
    let [left, _, _, bottom] = canvas.frame;
    let row = |index: usize| bottom + BELOW + ROW * (index as f64 + 0.5);
    // Names are long: on narrow paper they begin at its edge.
    let at = if canvas.paper == Paper::Wide { left } else { 8.0 } + 14.0;
    let room = canvas.paper.width() - at - 24.0 - 8.0;
    let mut text = String::new();
    for (index, line) in plot.lines.iter().enumerate() {
        let _ = writeln!(
            text,
            "<g transform=\"translate({at},{})\"><path class=\"line\" stroke=\"{2}\" d=\"M-14,0h28\"/><path fill=\"{2}\" d=\"{3}\"/><text x=\"24\" y=\"4.5\"{1}>{4}</text></g>",
            row(index),
            squeezed(&line.name, 13.0, room),
            colour(index),
            shape(index),
            escaped(&line.name)
        );
    }
    let has = |of: fn(&Mark) -> bool| plot.lines.iter().flat_map(|line| &line.marks).any(of);
    let mut rows = plot.lines.len();
    if has(|mark| mark.is_limit) {
        let _ = writeln!(
            text,
            "<g transform=\"translate({at},{})\"><path class=\"frame\" d=\"{}\"/><path class=\"frame\" d=\"M0,5v8m-3,-4l3,4l3,-4\"/>\
             <text x=\"24\" y=\"4.5\"{}>{LIMITS}</text></g>",
            row(rows),
            SHAPES[0],
            squeezed(LIMITS, 13.0, room),
        );
        rows += 1;
    }
    if !has(|mark| mark.is_on_front) {
        return text;
    }
    let front = if plot.label_of_marks.is_empty() { "Pareto front".to_owned() } else { format!("Pareto front, with {}", plot.label_of_marks) };
    let _ = writeln!(
        text,
        "<g transform=\"translate({at},{})\"><path class=\"front\" d=\"M-14,0h28\"/><circle class=\"ring\" r=\"9\"/><text x=\"24\" y=\"4.5\"{}>{}</text></g>",
        row(rows),
        squeezed(&front, 13.0, room),
        escaped(&front)
    );
    text
}

fn colour(line: usize) -> &'static str {
    COLOURS[line % COLOURS.len()]
}

/// Shifted after each turn of the colours, so that 24 lines differ.
fn shape(line: usize) -> &'static str {
    SHAPES[(line + line / COLOURS.len()) % SHAPES.len()]
}

/// As XML has text and attributes; what it has no place for, such as control characters, becomes a mark of replacement.
pub fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for letter in text.chars() {
        match letter {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\t' | '\n' | '\r' => escaped.push(' '),
            letter if letter.is_control() || matches!(letter, '\u{fffe}' | '\u{ffff}') => escaped.push('\u{fffd}'),
            letter => escaped.push(letter),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn mark(x: f64, y: f64, is_on_front: bool) -> Mark {
        Mark {
            id: "A".into(),
            label: Some("a<b & \"c\"\u{1}".into()),
            about: "]]> '".into(),
            x,
            x_spread: [x * 0.9, x * 1.1],
            y,
            y_spread: [0.0, 2.0 * y],
            is_limit: x > 1.0,
            is_on_front,
        }
    }

    fn plot(marks: &[(f64, f64, bool)]) -> Plot {
        let text = |text: &str| text.to_owned();
        let lines = marks.iter().map(|(x, y, is_on_front)| Line { name: text("<&>"), marks: vec![mark(*x, *y, *is_on_front)] });
        Plot { title: text("t"), x_label: text("seconds"), y_label: text("error [%]"), label_of_marks: text("n.p"), lines: lines.collect() }
    }

    #[test]
    fn ticks_are_round_and_enough() {
        let ticks = |low, high| Scale { low, high, from: 0.0, to: 1.0 }.ticks();
        assert_eq!(ticks(0.01, 1000.0), [0.01, 0.1, 1.0, 10.0, 100.0, 1000.0]);
        assert_eq!(ticks(0.9, 6.0), [1.0, 2.0, 5.0]);
        assert_eq!(ticks(2.1, 5.9), [3.0, 4.0, 5.0]);
        assert_eq!(ticks(0.21, 0.32), [0.22, 0.24, 0.26, 0.28, 0.3, 0.32]);
    }

    #[test]
    fn nothing_at_all_is_still_a_figure() {
        let text = svg(&plot(&[]), Paper::Wide);
        let document = roxmltree::Document::parse(&text).unwrap();
        assert_eq!(document.root_element().tag_name().name(), "svg");
    }

    proptest! {
        #[test]
        fn every_figure_is_xml_with_a_mark_a_point_inside_its_frame(
            marks in prop::collection::vec((1e-6..1e6f64, prop_oneof![Just(0.0), 1e-9..1e3f64], any::<bool>()), 0..30),
            is_narrow in any::<bool>()
        ) {
            let paper = if is_narrow { Paper::Narrow } else { Paper::Wide };
            let text = svg(&plot(&marks), paper);
            let document = roxmltree::Document::parse(&text).unwrap();
            let groups: Vec<_> = document.descendants().filter(|node| node.attribute("class") == Some("mark")).collect();
            prop_assert_eq!(groups.len(), marks.len());
            let rings = groups.iter().filter(|group| group.descendants().any(|node| node.attribute("class") == Some("ring"))).count();
            prop_assert_eq!(rings, marks.iter().filter(|mark| mark.2).count());
            for group in groups {
                let place = group.attribute("transform").and_then(|text| text.strip_prefix("translate(")?.strip_suffix(')')?.split_once(',')).unwrap();
                let [x, y]: [f64; 2] = [place.0, place.1].map(|text| text.parse().unwrap());
                let [left, right, top, bottom] = paper.frame();
                prop_assert!((left..=right).contains(&x) && (top..=bottom).contains(&y), "{x} {y}");
            }
        }

        #[test]
        fn axes_have_ticks_in_order(low in 1e-9..1e9f64, factor in 1.0..1e9f64) {
            let scale = Scale::of([low, low * factor].into_iter(), 0.0, 1.0);
            let ticks = scale.ticks();
            prop_assert!((FEWEST_TICKS..20).contains(&ticks.len()), "{ticks:?}");
            prop_assert!(ticks.windows(2).all(|pair| pair[0] < pair[1] && scale.place(pair[0]) < scale.place(pair[1])));
        }
    }
}
