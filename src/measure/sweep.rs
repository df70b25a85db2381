//! A pipeline over a grid of parameters: error over time, and which points nothing else beats.

use super::compare::{AdapterReport, Comparison, Cut, ErrorParts, FrameOfRuns, Given, GivenPicture, ReferenceReport, VariantErrors, VariantReport};
use super::course::Course;
use super::criteria::{Cost, Metric};
use super::expectation::Found;
use super::front::{Standing, front};
use super::plot::{Line, Mark, Plot};
use super::run::Records;
use super::statistics::Spread;
use super::traffic::Traffic;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Every combination of places on axes of these lengths; the last axis is the fastest.
pub fn grid(lengths: &[usize]) -> Vec<Vec<usize>> {
    let longer = |places: Vec<Vec<usize>>, length: usize| places.iter().flat_map(|place| (0..length).map(|next| [&place[..], &[next]].concat())).collect();
    lengths.iter().fold(vec![Vec::new()], |places, length| longer(places, *length))
}

/// Everything that a sweep found. Keys in JSON are the fields' names.
#[derive(Debug, Clone, Serialize)]
pub struct Sweep {
    /// Version of this record: 1.
    pub schema: u32,
    pub scene: String,
    pub triangles: usize,
    pub camera: String,
    /// Width and height [pixels].
    pub size: [u32; 2],
    pub adapter: AdapterReport,
    /// Runs of each point.
    pub runs: usize,
    /// Whether every point is measured, with all its pixels covered.
    pub complete: bool,
    pub reference: Option<ReferenceReport>,
    /// What pipelines show otherwise than the scene has it, in words, each once.
    pub approximated: Vec<String>,
    /// The error of the front and the plot.
    pub metric: String,
    /// What the front and the plot hold that error against.
    pub cost: String,
    pub over: Vec<Axis>,
    /// By pipeline, then by values, those of the last parameter the fastest.
    pub points: Vec<Point>,
    /// What a study expected of its numbers.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub expected: Vec<Found>,
}

/// A parameter that is swept.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Axis {
    /// `node.parameter`
    pub parameter: String,
    /// As written.
    pub values: Vec<String>,
}

/// A pipeline with one value of each parameter that is swept.
#[derive(Debug, Clone, Serialize)]
pub struct Point {
    /// A letter or several.
    pub id: String,
    /// What the pipeline is called here: as the user wrote it, or a study's name for it.
    pub row: String,
    pub pipeline: String,
    /// By parameter.
    pub values: BTreeMap<String, String>,
    /// Everything that is set, `NODE.PARAM=VALUE`.
    pub set: Vec<String>,
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Of the nodes that a study names, for each tile.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traffic: Option<Traffic>,
    /// Whether no other point of the sweep beats it, by differences that hold: [`front`].
    pub pareto: bool,
}

/// What became of a point; `state` in JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "state", rename_all = "snake_case")]
pub enum Outcome {
    Measured(Box<Measured>),
    /// Another program made its picture.
    Given(Box<Given>),
    /// The scene or the adapter does not take the pipeline.
    Refused {
        because: String,
    },
    /// Not reached.
    Open,
}

/// What the runs of a point measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Of a run: a picture from empty caches.
    pub seconds: Spread,
    /// Of each run, by round.
    pub seconds_of_runs: Vec<f64>,
    pub records: Records,
    pub fill_rounds: Option<u32>,
    pub uncovered_pixels: Option<u32>,
    pub complete: bool,
    /// Whether every run made the same picture to the bit.
    pub pictures_repeat: bool,
    /// All buffers and textures, the copy of the scene too.
    pub peak_gpu_bytes: u64,
    pub passes: Vec<PassMedian>,
    pub errors: VariantErrors,
    /// Where the reference has more bounces than the point makes, and one of as many was made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error_parts: Option<ErrorParts>,
    /// Runs that were ended early, the shortest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cuts: Vec<Cut>,
    /// Of a sequence.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<FrameOfRuns>,
    /// Of a sequence, by layer.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub courses: BTreeMap<String, Course>,
}

/// The median time of a node.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PassMedian {
    pub node: String,
    pub pass: String,
    /// How often the node ran in a run.
    pub runs: u32,
    /// None where the adapter has no timestamps.
    pub gpu_ms: Option<f64>,
    pub cpu_ms: Option<f64>,
}

impl From<VariantReport> for Measured {
    fn from(report: VariantReport) -> Self {
        let median = |spread: Option<Spread>| spread.map(|spread| spread.median);
        let passes = report.passes.into_iter().map(|pass| PassMedian {
            node: pass.node,
            pass: pass.pass.to_owned(),
            runs: pass.runs,
            gpu_ms: median(pass.gpu_ms),
            cpu_ms: median(pass.cpu_ms),
        });
        Self {
            seconds: report.seconds,
            seconds_of_runs: report.seconds_of_runs,
            records: report.records,
            fill_rounds: report.fill_rounds,
            uncovered_pixels: report.uncovered_pixels,
            complete: report.complete,
            pictures_repeat: report.pictures_repeat,
            peak_gpu_bytes: report.peak_gpu_bytes,
            passes: passes.collect(),
            errors: report.errors,
            error_parts: report.error_parts,
            cuts: report.cuts,
            frames: report.frames,
            courses: report.courses,
        }
    }
}

/// A comparison is a sweep of its variants over no parameters.
impl From<&Comparison> for Sweep {
    fn from(comparison: &Comparison) -> Self {
        let point = |id: &str, row: &str, outcome: Outcome| Point {
            id: id.to_owned(),
            row: row.to_owned(),
            pipeline: String::new(),
            values: BTreeMap::new(),
            set: Vec::new(),
            outcome,
            traffic: None,
            pareto: false,
        };
        let of_variant = |variant: &VariantReport| Point {
            pipeline: variant.pipeline.clone(),
            set: variant.set.clone(),
            ..point(&variant.id, &variant.name, Outcome::Measured(Box::new(variant.clone().into())))
        };
        let of_picture = |picture: &GivenPicture| point(&picture.id, &picture.name, Outcome::Given(Box::new(picture.given.clone())));
        let (metric, cost) = (comparison.metric(), Cost::Seconds);
        let mut points: Vec<Point> = comparison.variants.iter().map(of_variant).chain(comparison.pictures.iter().map(of_picture)).collect();
        mark_front(&mut points, &metric, &cost);
        Self {
            schema: 1,
            scene: comparison.scene.clone(),
            triangles: comparison.triangles,
            camera: comparison.camera.clone(),
            size: comparison.size,
            adapter: comparison.adapter.clone(),
            runs: comparison.runs,
            complete: comparison.complete,
            reference: comparison.reference.clone(),
            approximated: comparison.approximated(),
            metric: metric.to_string(),
            cost: cost.to_string(),
            over: Vec::new(),
            points,
            expected: Vec::new(),
        }
    }
}

impl Sweep {
    /// The first and the last frame of a sequence; None where no point of one is measured.
    pub fn frames(&self) -> Option<[u32; 2]> {
        let frames = &self.points.iter().find_map(Point::measured)?.frames;
        Some([frames.first()?.frame, frames.last()?.frame])
    }

    /// The same in words, to be put behind others; nothing of one picture.
    pub fn frames_told(&self) -> String {
        self.frames().map_or(String::new(), |[first, last]| format!(", frames {first} to {last}"))
    }
}

impl Point {
    pub fn measured(&self) -> Option<&Measured> {
        match &self.outcome {
            Outcome::Measured(measured) => Some(measured),
            _ => None,
        }
    }

    /// None where nothing was judged.
    pub fn errors(&self) -> Option<&VariantErrors> {
        match &self.outcome {
            Outcome::Measured(measured) => Some(&measured.errors),
            Outcome::Given(picture) => Some(&picture.errors),
            Outcome::Refused { .. } | Outcome::Open => None,
        }
    }

    /// Its cost with its quartiles, or with itself twice where it is no matter of chance; None where it is not known.
    fn cost(&self, cost: &Cost) -> Option<(f64, [f64; 2])> {
        let (x, spread) = match &self.outcome {
            Outcome::Measured(measured) => (cost.of(measured)?, cost.spread(measured)),
            Outcome::Given(picture) => (picture.seconds.filter(|_| matches!(cost, Cost::Seconds))?, None),
            Outcome::Refused { .. } | Outcome::Open => return None,
        };
        Some((x, spread.unwrap_or([x; 2])))
    }

    /// Median of its runs, or what was stated; None where neither is known.
    pub fn seconds(&self) -> Option<f64> {
        self.cost(&Cost::Seconds).map(|(seconds, _)| seconds)
    }

    /// Cost and error; None where one of them is not known, or pixels are left without light.
    pub fn costs(&self, metric: &Metric, cost: &Cost) -> Option<[f64; 2]> {
        let is_whole = self.measured().is_none_or(|measured| measured.complete);
        let (x, _) = self.cost(cost).filter(|_| is_whole)?;
        Some([x, metric.of(self.errors()?)?])
    }

    /// How it stands beside others; None as for [`Point::costs`].
    fn standing(&self, metric: &Metric, cost: &Cost) -> Option<Standing> {
        let [_, error] = self.costs(metric, cost)?;
        Some(Standing { cost: self.cost(cost)?.1, error, draws: metric.draws(self.errors()?) })
    }

    /// `NODE.PARAM=VALUE` of these parameters, in their order.
    fn swept<'p>(&'p self, over: &'p [Axis]) -> impl Iterator<Item = String> + 'p {
        over.iter().filter_map(|axis| Some(format!("{}={}", axis.parameter, self.values.get(&axis.parameter)?)))
    }

    /// The row and its values of these parameters.
    pub fn name(&self, over: &[Axis]) -> String {
        std::iter::once(self.row.clone()).chain(self.swept(over)).collect::<Vec<_>>().join(" ")
    }
}

/// Marks the points of the front.
pub fn mark_front(points: &mut [Point], metric: &Metric, cost: &Cost) {
    let known = |(index, point): (usize, &Point)| Some((index, point.standing(metric, cost)?));
    let (indices, standings): (Vec<usize>, Vec<Standing>) = points.iter().enumerate().filter_map(known).unzip();
    points.iter_mut().for_each(|point| point.pareto = false);
    for (index, is_on_front) in indices.into_iter().zip(front(&standings)) {
        points[index].pareto = is_on_front;
    }
}

/// The points of the front, the cheapest first, each with its cost and error.
pub fn best<'p>(points: &'p [Point], metric: &Metric, cost: &Cost) -> Vec<(&'p Point, [f64; 2])> {
    let mut best: Vec<_> = points.iter().filter(|point| point.pareto).filter_map(|point| Some((point, point.costs(metric, cost)?))).collect();
    best.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    best
}

/// Error over cost: a line for each row and the values of all parameters but the first, along which that one changes. Marks of the front have that
/// one's value beside them, or without parameters each mark its letter. The marks of runs that were ended early lead to that of the whole ones.
pub fn plot(sweep: &Sweep, metric: &Metric, cost: &Cost) -> Plot {
    let along = sweep.over.first().map_or("", |axis| &axis.parameter);
    let unit = if metric.is_share() { " [%]" } else { "" };
    let [width, height] = sweep.size;
    let marks =
        |points: Vec<&Point>| points.iter().flat_map(|point| cut_marks(point, metric, cost).into_iter().chain(mark(sweep, point, metric, cost))).collect();
    let lines = lines(sweep).into_iter().map(|(name, points)| Line { name, marks: marks(points) });
    Plot {
        title: format!("{}, {width}×{height}{}, {}", sweep.scene, sweep.frames_told(), sweep.adapter.name),
        x_label: cost.label(sweep.runs),
        y_label: format!("{metric}{unit}"),
        label_of_marks: along.to_owned(),
        lines: lines.filter(|line| !line.marks.is_empty()).collect(),
    }
}

/// The points of each row and of the values of all parameters but the first, along which that one changes.
pub fn lines(sweep: &Sweep) -> Vec<(String, Vec<&Point>)> {
    let mut lines: Vec<(String, Vec<&Point>)> = Vec::new();
    for point in &sweep.points {
        let name = point.name(sweep.over.get(1..).unwrap_or(&[]));
        match lines.iter_mut().find(|line| line.0 == name) {
            Some(line) => line.1.push(point),
            None => lines.push((name, vec![point])),
        }
    }
    lines
}

fn mark(sweep: &Sweep, point: &Point, metric: &Metric, cost: &Cost) -> Option<Mark> {
    let (x, x_spread) = point.cost(cost).filter(|(x, _)| *x > 0.0)?;
    let errors = point.errors()?;
    let in_time: String = point.measured().and_then(|measured| metric.course(measured)).map_or(String::new(), Course::told);
    let about = format!("{}: {}, {}, {}{in_time}", point.id, point.name(&sweep.over), cost.told(x), metric.told(errors)?.sentence());
    let label = match sweep.over.first() {
        None => Some(&point.id),
        Some(axis) => point.values.get(&axis.parameter).filter(|_| point.pareto),
    };
    Some(Mark { id: point.id.clone(), label: label.cloned(), about, x, x_spread, is_on_front: point.pareto, ..mark_of_errors(errors, metric)? })
}

/// One for each run of a point that was ended early, without an id: there is no picture of it.
fn cut_marks(point: &Point, metric: &Metric, cost: &Cost) -> Vec<Mark> {
    let cuts = point.measured().filter(|_| matches!(cost, Cost::Seconds)).map_or(&[][..], |measured| &measured.cuts);
    let mark = |cut: &Cut| {
        let about = format!("{} ended after {}, {}", point.id, cost.told(cut.seconds), metric.told(&cut.errors)?.sentence());
        Some(Mark { about, x: cut.seconds, x_spread: [cut.seconds; 2], ..mark_of_errors(&cut.errors, metric)? })
    };
    cuts.iter().filter(|cut| cut.seconds > 0.0).filter_map(mark).collect()
}

/// What a mark tells of errors; None where they are not known.
fn mark_of_errors(errors: &VariantErrors, metric: &Metric) -> Option<Mark> {
    let factor = if metric.is_share() { 100.0 } else { 1.0 };
    let interval = metric.interval(errors).map(|interval| interval.of_size().map(|end| factor * end));
    let hidden = metric.interval(errors).filter(|interval| interval.below_noise).map(|interval| factor * interval.most());
    let error = hidden.unwrap_or(factor * metric.of(errors)?);
    Some(Mark { y: error, y_spread: interval.unwrap_or([error; 2]), is_limit: hidden.is_some(), ..Mark::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_last_axis_is_the_fastest() {
        assert_eq!(grid(&[2, 3]), [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]].map(Vec::from));
        assert_eq!(grid(&[]), [Vec::<usize>::new()]);
        assert_eq!(grid(&[3, 0]), Vec::<Vec<usize>>::new());
    }

    proptest! {
        #[test]
        fn a_grid_holds_every_combination_once_in_the_order_of_counting(lengths in prop::collection::vec(1usize..5, 0..5)) {
            let places = grid(&lengths);
            prop_assert_eq!(places.len(), lengths.iter().product::<usize>());
            prop_assert!(places.iter().all(|place| place.len() == lengths.len() && place.iter().zip(&lengths).all(|(at, length)| at < length)));
            prop_assert!(places.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }
}
