//! Several pipelines on one view of one scene: what each costs, how far it is from the truth, and which differences are more than noise.
//!
//! A run is a picture, or a sequence of them, from empty caches. Runs are interleaved in rounds, one of each variant a round, so that two runs of a round are a
//! pair.

use super::cache::Checksum;
use super::course::Course;
use super::criteria::Metric;
use super::layers::{DIRECT, GLOSSY, INDIRECT, IRRADIANCE, Layers, PICTURE};
use super::metrics::{ErrorDifference, Errors};
use super::run::{FrameReport, PassReport, Records, Run, RunError};
use super::statistics::{Difference, Spread, runs_to_find};
use crate::gpu::{Adapter, AskPace, Pace, Unfinished};
use crate::pipeline::Plan;
use serde::{Deserialize, Serialize, Serializer};
use std::collections::BTreeMap;
use web_time::{Duration, Instant};

/// The difference that a number of runs is recommended for: a variant that takes 5 % longer.
pub const WORTH_FINDING: f64 = 0.05;

/// The variants of a round, by index, in the order in which they run: reversed in every other round, and begun with another one in every other pair
/// of rounds. A machine that slows steadily slows all alike, and none follows the same neighbour each time.
pub fn order(round: usize, variants: usize) -> Vec<usize> {
    let rotated = |place: usize| (place + round / 2) % variants;
    if round.is_multiple_of(2) { (0..variants).map(rotated).collect() } else { (0..variants).rev().map(rotated).collect() }
}

/// The frames of a run.
pub trait Script {
    /// Why a run does not go on.
    type Error: From<RunError>;

    /// How many there are, one or more.
    fn frames(&self) -> usize;

    /// Brings a run to a frame of them; on the way it may run one ahead.
    ///
    /// # Errors
    /// Where the scene cannot change so.
    fn bring(&mut self, frame: usize, run: &mut Run, pace: AskPace<'_>) -> Result<(), Self::Error>;
}

/// One picture of what stands still.
pub struct Still;

impl Script for Still {
    type Error = RunError;

    fn frames(&self) -> usize {
        1
    }

    fn bring(&mut self, _: usize, _: &mut Run, _: AskPace<'_>) -> Result<(), RunError> {
        Ok(())
    }
}

/// A variant with its session, which all its runs share, and what they measured.
pub struct Contender<S = Still> {
    run: Run,
    script: S,
    warm_up_seconds: f64,
    runs: Vec<Measured>,
    /// Checksum of the last picture of the warm-up.
    picture: String,
    pictures_repeat: bool,
}

/// A run that was measured.
struct Measured {
    whole: FrameReport,
    frames: Vec<FrameOfRun>,
}

/// What a frame of a run took, and what it left.
struct FrameOfRun {
    seconds: f64,
    records: Option<u32>,
    new_records: Option<u32>,
}

impl Contender {
    /// Renders once, so that what drivers put off to the first use is done, and hands out the picture.
    pub async fn warm_up(run: Run, pace: AskPace<'_>) -> Result<(Self, Layers), RunError> {
        let mut contender = Self::new(run, Still);
        let picture = contender.warm_up_frame(0, pace).await?;
        Ok((contender, picture))
    }
}

impl<S: Script> Contender<S> {
    pub fn new(run: Run, script: S) -> Self {
        Self { run, script, warm_up_seconds: 0.0, runs: Vec::new(), picture: String::new(), pictures_repeat: true }
    }

    /// Renders a frame of the first run, which warms up: what drivers put off to the first use is done. Hands out the picture.
    pub async fn warm_up_frame(&mut self, frame: usize, pace: AskPace<'_>) -> Result<Layers, S::Error> {
        self.script.bring(frame, &mut self.run, pace)?;
        let report = self.run.frame(pace).await?;
        if frame == 0 {
            self.warm_up_seconds = report.seconds;
        }
        let picture = self.run.picture().await?;
        self.picture = checksum(&picture);
        Ok(picture)
    }

    /// One run from empty caches.
    pub async fn measure(&mut self, pace: AskPace<'_>) -> Result<(), S::Error> {
        let (mut whole, mut frames) = (None::<FrameReport>, Vec::new());
        for frame in 0..self.script.frames() {
            if frame == 0 {
                self.run.reset().await?;
            }
            self.script.bring(frame, &mut self.run, pace)?;
            let report = self.run.frame(pace).await?;
            frames.push(FrameOfRun { seconds: report.seconds, records: report.records.irradiance, new_records: report.new_records });
            whole = Some(match whole {
                None => report,
                Some(earlier) => earlier.and(report),
            });
        }
        self.runs.extend(whole.map(|whole| Measured { whole, frames }));
        self.pictures_repeat &= checksum(&self.run.picture().await?) == self.picture;
        Ok(())
    }

    /// One run from empty caches that is to take no longer than this, as loops end early: what it took, and its last picture. No part of what runs measure.
    pub async fn cut(&mut self, within: Duration, ask: AskPace<'_>) -> Result<(f64, Layers), RunError> {
        self.run.reset().await?;
        let start = Instant::now();
        let pace = || if ask() == Pace::Stop { Pace::Stop } else { Pace::Within(within.saturating_sub(start.elapsed())) };
        let report = self.run.frame(&pace).await?;
        Ok((report.seconds, self.run.picture().await?))
    }

    /// The median time of its runs; None without a run [s].
    pub fn median_seconds(&self) -> Option<f64> {
        Spread::of(&self.runs.iter().map(|run| run.whole.seconds).collect::<Vec<_>>()).map(|spread| spread.median)
    }

    pub fn plan(&self) -> &Plan {
        self.run.plan()
    }

    /// As its last picture left it.
    pub fn run(&self) -> &Run {
        &self.run
    }

    /// Runs measured so far.
    pub fn runs(&self) -> usize {
        self.runs.len()
    }

    /// What the first `runs` runs measured; None without a run.
    pub fn report(&self, id: String, about: About, runs: usize) -> Option<VariantReport> {
        let runs = &self.runs[..runs.min(self.runs.len())];
        let frames: Vec<&FrameReport> = runs.iter().map(|run| &run.whole).collect();
        let last = frames.last()?;
        let seconds: Vec<f64> = frames.iter().map(|frame| frame.seconds).collect();
        let plan = self.run.plan();
        Some(VariantReport {
            id,
            name: about.name,
            pipeline: plan.pipeline.clone(),
            set: about.set,
            dropped: dropped(plan),
            approximated: plan.approximated(),
            start_up: VariantStartUp { plan_seconds: about.plan_seconds, shaders_seconds: about.shaders_seconds, warm_up_seconds: self.warm_up_seconds },
            seconds: Spread::of(&seconds)?,
            seconds_of_runs: seconds,
            records: last.records.clone(),
            new_records: last.new_records,
            surplus_records: last.surplus_records,
            fill_rounds: last.fill_rounds,
            uncovered_pixels: last.uncovered_pixels,
            complete: frames.iter().all(|frame| frame.complete),
            unfinished: last.unfinished.clone(),
            pictures_repeat: self.pictures_repeat,
            peak_gpu_bytes: self.run.gpu_bytes(),
            passes: passes(&frames),
            errors: about.errors,
            error_parts: about.error_parts,
            cuts: about.cuts,
            frames: about.numbers.iter().enumerate().filter_map(|(place, number)| frame_of_runs(*number, place, runs)).collect(),
            courses: about.courses,
        })
    }
}

/// What is known of a variant beside what its runs measure.
#[derive(Default)]
pub struct About {
    /// As the user wrote it.
    pub name: String,
    /// `NODE.PARAM=VALUE`, those for all variants first.
    pub set: Vec<String>,
    pub plan_seconds: f64,
    pub shaders_seconds: f64,
    pub errors: VariantErrors,
    /// Where the reference holds more bounces than the variant makes, and the truth of its own bounces is at hand.
    pub error_parts: Option<ErrorParts>,
    pub cuts: Vec<Cut>,
    /// Of the frames of a sequence.
    pub numbers: Vec<u32>,
    /// Of a sequence, by layer.
    pub courses: BTreeMap<String, Course>,
}

/// A run whose loops were ended early.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cut {
    /// That it was given.
    pub within_seconds: f64,
    /// That it took: more where what cannot be ended early takes longer.
    pub seconds: f64,
    pub errors: VariantErrors,
}

/// An error in two parts: of the bounces left out, and of the method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ErrorParts {
    /// That the variant makes.
    pub bounces: String,
    /// Of the truth of these bounces, against the reference.
    pub left_out: VariantErrors,
    /// Of the variant, against the truth of these bounces.
    pub method: VariantErrors,
}

/// Everything that a comparison found. Keys in JSON are the fields' names.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// Version of this record: 1.
    pub schema: u32,
    pub scene: String,
    pub triangles: usize,
    pub camera: String,
    /// Width and height [pixels].
    pub size: [u32; 2],
    pub adapter: AdapterReport,
    /// Runs of each variant that were asked for.
    pub runs_asked: usize,
    /// Runs of each variant, one in each whole round.
    pub runs: usize,
    /// Whether all runs that were asked for are there, each with all its pixels covered.
    pub complete: bool,
    pub start_up: StartUp,
    /// Of the whole program, with all variants in memory.
    pub peak_host_bytes: Option<u64>,
    pub reference: Option<ReferenceReport>,
    pub variants: Vec<VariantReport>,
    /// Every variant with every later one.
    pub pairs: Vec<Pair>,
    /// Pictures of other programs.
    pub pictures: Vec<GivenPicture>,
    /// Every picture of another program with all variants and earlier pictures.
    pub error_pairs: Vec<ErrorPair>,
}

/// A picture that another program made, which is judged beside the variants.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GivenPicture {
    /// A letter or several, after those of the variants.
    pub id: String,
    /// As the user calls it.
    pub name: String,
    #[serde(flatten)]
    pub given: Given,
}

/// What is known of a picture that another program made.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Given {
    pub file: String,
    /// The only one that is judged; all that the reference has, too, where none is named.
    pub layer: Option<String>,
    /// As the file states them.
    pub bounces: Option<String>,
    /// What it took, as the user says: measured elsewhere, perhaps on another machine. None where nobody says.
    pub seconds: Option<f64>,
    pub errors: VariantErrors,
}

/// How the errors of a picture of another program and of something else differ.
#[derive(Debug, Clone, Serialize)]
pub struct ErrorPair {
    pub first: String,
    pub second: String,
    pub error: PairError,
}

#[derive(Debug, Clone, Serialize)]
pub struct AdapterReport {
    pub name: String,
    pub backend: String,
    pub driver: String,
}

impl From<&Adapter> for AdapterReport {
    fn from(adapter: &Adapter) -> Self {
        Self { name: adapter.name.clone(), backend: adapter.backend.clone(), driver: adapter.driver.clone() }
    }
}

/// What all variants share; no part of their times.
#[derive(Debug, Clone, Serialize)]
pub struct StartUp {
    pub load_seconds: f64,
    pub device_seconds: f64,
    /// Reading or tracing the reference.
    pub reference_seconds: f64,
}

/// What the errors are against.
#[derive(Debug, Clone, Serialize)]
pub struct ReferenceReport {
    pub file: Option<String>,
    /// The row of a study whose pictures judge the others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub row: Option<String>,
    /// Whether this program traced it, now or earlier.
    pub own: bool,
    /// As the file states them.
    pub bounces: Option<String>,
    pub samples: Option<String>,
    /// The largest of the noises of irradiance, glossy light and picture: standard deviation over mean.
    pub noise_over_mean: Option<f64>,
    /// The noise down to which it was to be traced; it ended at its bound where `noise_over_mean` is larger.
    pub error_asked: Option<f64>,
    pub stride: Option<String>,
    /// How many windows it was traced in, where that is not the whole picture.
    pub windows: Option<usize>,
}

#[derive(Debug, Clone, Serialize)]
pub struct VariantReport {
    /// A letter or several, short for the name.
    pub id: String,
    pub name: String,
    pub pipeline: String,
    pub set: Vec<String>,
    pub dropped: Vec<DroppedNode>,
    /// What it shows otherwise than the scene has it, in words.
    pub approximated: Vec<String>,
    pub start_up: VariantStartUp,
    /// Of a run: a picture, or all of a sequence, from empty caches. What changes between frames is brought to the device beside it.
    pub seconds: Spread,
    /// Of each run, by round.
    pub seconds_of_runs: Vec<f64>,
    pub records: Records,
    pub new_records: Option<u32>,
    pub surplus_records: Option<u32>,
    pub fill_rounds: Option<u32>,
    pub uncovered_pixels: Option<u32>,
    pub complete: bool,
    /// Loops that ended before they were done, by name.
    #[serde(serialize_with = "names")]
    pub unfinished: Vec<Unfinished>,
    /// Whether every run made the picture of the warm-up to the bit.
    pub pictures_repeat: bool,
    /// All buffers and textures of the variant, its copy of the scene too.
    pub peak_gpu_bytes: u64,
    pub passes: Vec<PassSpread>,
    pub errors: VariantErrors,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_parts: Option<ErrorParts>,
    /// Runs that were ended early, the shortest first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cuts: Vec<Cut>,
    /// Of a sequence; `errors` are those of its last frame.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<FrameOfRuns>,
    /// How each layer of a sequence differs from the truth in time.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub courses: BTreeMap<String, Course>,
}

/// A frame of a sequence, over all runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameOfRuns {
    /// Of the sequence.
    pub frame: u32,
    pub seconds: Spread,
    /// In the cache afterwards.
    pub records: Option<u32>,
    pub new_records: Option<u32>,
}

fn frame_of_runs(frame: u32, place: usize, runs: &[Measured]) -> Option<FrameOfRuns> {
    let of_runs: Vec<&FrameOfRun> = runs.iter().filter_map(|run| run.frames.get(place)).collect();
    let last = of_runs.last()?;
    let seconds = Spread::of(&of_runs.iter().map(|frame| frame.seconds).collect::<Vec<_>>())?;
    Some(FrameOfRuns { frame, seconds, records: last.records, new_records: last.new_records })
}

fn names<S: Serializer>(unfinished: &[Unfinished], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(unfinished.iter().map(|ended| &ended.name))
}

/// What a variant takes before its first run; no part of its times.
#[derive(Debug, Clone, Serialize)]
pub struct VariantStartUp {
    pub plan_seconds: f64,
    /// Memory, upload of the scene, shader pipelines.
    pub shaders_seconds: f64,
    /// The first picture, with what the driver puts off until then.
    pub warm_up_seconds: f64,
}

#[derive(Debug, Clone, Serialize)]
pub struct DroppedNode {
    pub node: String,
    pub because: String,
}

/// How a node's time spreads over the runs.
#[derive(Debug, Clone, Serialize)]
pub struct PassSpread {
    pub node: String,
    pub pass: &'static str,
    /// How often the node ran in a run.
    pub runs: u32,
    /// None where the adapter has no timestamps.
    pub gpu_ms: Option<Spread>,
    pub cpu_ms: Option<Spread>,
}

/// How far a variant is from the reference; None where there is no reference, or one of the two lacks the layer.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct VariantErrors {
    /// Of the indirect irradiance alone.
    pub irradiance: Option<Errors>,
    /// Of the whole picture.
    pub picture: Option<Errors>,
    /// Of the indirect light that lobes reflect, over glossy surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub glossy: Option<Errors>,
    /// Of direct light, where the variant computes no other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direct: Option<Errors>,
}

impl VariantErrors {
    /// Of the layer of that name.
    pub fn layer(&self, name: &str) -> Option<&Errors> {
        self.layers().into_iter().find(|(layer, _)| *layer == name)?.1
    }

    /// By layer.
    pub fn layers(&self) -> [(&'static str, Option<&Errors>); 4] {
        [(IRRADIANCE, self.irradiance.as_ref()), (PICTURE, self.picture.as_ref()), (GLOSSY, self.glossy.as_ref()), (DIRECT, self.direct.as_ref())]
    }

    /// The means over the frames of a sequence; see [`Errors::over_frames`].
    pub fn over_frames(frames: &[Self]) -> Self {
        let of = |layer: fn(&Self) -> Option<&Errors>| Errors::over_frames(&frames.iter().filter_map(layer).collect::<Vec<_>>());
        Self {
            irradiance: of(|errors| errors.irradiance.as_ref()),
            picture: of(|errors| errors.picture.as_ref()),
            glossy: of(|errors| errors.glossy.as_ref()),
            direct: of(|errors| errors.direct.as_ref()),
        }
    }

    /// By layer.
    pub fn layers_mut(&mut self) -> [(&'static str, Option<&mut Errors>); 4] {
        [(IRRADIANCE, self.irradiance.as_mut()), (PICTURE, self.picture.as_mut()), (GLOSSY, self.glossy.as_mut()), (DIRECT, self.direct.as_mut())]
    }
}

/// The layers that a picture is judged by. Direct light is one where there is no other: pipelines with indirect light need not have all of it there.
pub fn judged(picture: &Layers) -> impl Iterator<Item = &'static str> {
    let holds = |layer: &str| picture.layers.contains_key(layer);
    let direct_alone = ![IRRADIANCE, INDIRECT].into_iter().any(holds);
    [IRRADIANCE, PICTURE, DIRECT, GLOSSY].into_iter().filter(move |layer| holds(layer) && (*layer != DIRECT || direct_alone))
}

/// How two variants differ: in their times, in which `difference` is, and in their errors.
#[derive(Debug, Clone, Serialize)]
pub struct Pair {
    pub first: String,
    pub second: String,
    /// The test that [`Difference::p`] is of.
    pub test: &'static str,
    #[serde(flatten)]
    pub difference: Difference,
    /// Runs that find a difference of [`WORTH_FINDING`] nine times of ten, as these runs spread; None after a single one.
    pub runs_to_find_5_percent: Option<usize>,
    /// How the errors differ that the comparison is judged by; None where these were not resampled.
    pub error: Option<PairError>,
}

/// How an error of two variants differs.
#[derive(Debug, Clone, Serialize)]
pub struct PairError {
    /// `LAYER.METRIC`
    pub metric: String,
    /// Whether it is a share, told in percent.
    pub is_share: bool,
    #[serde(flatten)]
    pub difference: ErrorDifference,
}

/// Compares the times and errors of every variant with those of every later one; so many pictures of other programs are compared beside.
pub fn pairs(variants: &[VariantReport], pictures: usize) -> Vec<Pair> {
    let metric = Metric::that_judges(variants.iter().map(|variant| &variant.errors));
    let later = |index: usize| variants[index + 1..].iter().map(move |second| (&variants[index], second));
    let among = [comparisons(variants.len()), comparisons(variants.len() + pictures)];
    (0..variants.len()).flat_map(later).filter_map(|(first, second)| pair(first, second, &metric, among)).collect()
}

/// Compares the errors of every picture of another program with those of all variants and of the pictures before it.
pub fn error_pairs(variants: &[VariantReport], pictures: &[GivenPicture]) -> Vec<ErrorPair> {
    let comparisons = comparisons(variants.len() + pictures.len());
    let variants = variants.iter().map(|variant| (&variant.id, &variant.errors));
    let all: Vec<(&String, &VariantErrors)> = variants.chain(pictures.iter().map(|picture| (&picture.id, &picture.given.errors))).collect();
    let (first_picture, mut pairs) = (all.len() - pictures.len(), Vec::new());
    for (place, (second, errors)) in all.iter().enumerate().skip(first_picture) {
        let with_earlier = all[..place].iter().filter_map(|(first, earlier)| {
            let error = Metric::that_all_have(&[earlier, errors])?.difference(earlier, errors, comparisons)?;
            Some(ErrorPair { first: (*first).clone(), second: (*second).clone(), error })
        });
        pairs.extend(with_earlier);
    }
    pairs
}

/// Pairs among so many variants.
pub fn comparisons(variants: usize) -> usize {
    variants * variants.saturating_sub(1) / 2
}

/// One of so many comparisons of times and of errors.
fn pair(first: &VariantReport, second: &VariantReport, metric: &Metric, [of_times, of_errors]: [usize; 2]) -> Option<Pair> {
    let difference = Difference::between(&first.seconds_of_runs, &second.seconds_of_runs, of_times)?;
    let runs = difference.deviation_of_log_ratio.map(|deviation| runs_to_find(WORTH_FINDING, deviation, of_times));
    Some(Pair {
        first: first.id.clone(),
        second: second.id.clone(),
        test: "wilcoxon_signed_rank_exact",
        difference,
        runs_to_find_5_percent: runs,
        error: metric.difference(&first.errors, &second.errors, of_errors),
    })
}

/// A, B, … Z, AA, AB, …
pub fn letters(index: usize) -> String {
    let letter = char::from(b'A' + (index % 26) as u8);
    if index < 26 { letter.into() } else { letters(index / 26 - 1) + &String::from(letter) }
}

/// Of every channel of every layer. 16 hexadecimal digits.
pub fn checksum(picture: &Layers) -> String {
    let mut checksum = Checksum::default();
    for (name, layer) in &picture.layers {
        checksum.add(name.as_bytes());
        for (channel, plane) in &layer.channels {
            checksum.add(channel.as_bytes());
            checksum.add(bytemuck::cast_slice(plane));
        }
    }
    checksum.finish()
}

/// What several plans show otherwise than the scene has it, each sentence once.
pub fn approximations(of_each: impl IntoIterator<Item = Vec<String>>) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for sentence in of_each.into_iter().flatten() {
        if !all.contains(&sentence) {
            all.push(sentence);
        }
    }
    all
}

impl Comparison {
    /// What its variants show otherwise than the scene has it, each sentence once.
    pub fn approximated(&self) -> Vec<String> {
        approximations(self.variants.iter().map(|variant| variant.approximated.clone()))
    }

    /// Whatever is judged: letters, names and errors, first of the variants, then of the pictures of other programs.
    pub fn judged(&self) -> Vec<(&str, &str, &VariantErrors)> {
        let variants = self.variants.iter().map(|variant| (variant.id.as_str(), variant.name.as_str(), &variant.errors));
        variants.chain(self.pictures.iter().map(|picture| (picture.id.as_str(), picture.name.as_str(), &picture.given.errors))).collect()
    }

    /// The error that it is judged by: one that pictures of other programs have, too, where there is one.
    pub fn metric(&self) -> Metric {
        let judged: Vec<&VariantErrors> = self.judged().into_iter().map(|(_, _, errors)| errors).collect();
        let of_all = if self.pictures.is_empty() { None } else { Metric::that_all_have(&judged) };
        of_all.unwrap_or_else(|| Metric::that_judges(judged.into_iter()))
    }
}

/// What the plan left out of the pipeline.
pub fn dropped(plan: &Plan) -> Vec<DroppedNode> {
    plan.dropped.iter().map(|dropped| DroppedNode { node: dropped.node.clone(), because: dropped.because.clone() }).collect()
}

/// Nodes are the same in every run of a plan.
fn passes(frames: &[&FrameReport]) -> Vec<PassSpread> {
    let spread = |values: Option<Vec<f64>>| values.and_then(|values| Spread::of(&values));
    let of_node = |index: usize, last: &PassReport| {
        let of_runs = || frames.iter().filter_map(move |frame| frame.passes.get(index));
        PassSpread {
            node: last.node.clone(),
            pass: last.pass,
            runs: last.runs,
            gpu_ms: spread(of_runs().map(|pass| pass.gpu_ms).collect()),
            cpu_ms: spread(of_runs().map(|pass| Some(pass.cpu_ms)).collect()),
        }
    };
    frames.last().map_or(Vec::new(), |last| last.passes.iter().enumerate().map(|(index, pass)| of_node(index, pass)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With a time that grows from run to run, the sum of a variant's times is the sum of its places.
    #[test]
    fn a_steady_drift_hits_all_alike() {
        for variants in 1..6 {
            for rounds in [2, 4, 10] {
                let place = |variant: usize, round: usize| order(round, variants).iter().position(|v| *v == variant).unwrap() + round * variants;
                let sums: Vec<usize> = (0..variants).map(|variant| (0..rounds).map(|round| place(variant, round)).sum()).collect();
                assert!(sums.iter().all(|sum| *sum == sums[0]), "{variants} variants, {rounds} rounds: {sums:?}");
            }
        }
    }

    #[test]
    fn each_round_holds_every_variant_once() {
        for variants in 2..6 {
            for round in 0..20 {
                let mut sorted = order(round, variants);
                sorted.sort();
                assert_eq!(sorted, (0..variants).collect::<Vec<_>>());
            }
        }
        assert_eq!([0, 1, 2, 3].map(|round| order(round, 3)), [[0, 1, 2], [2, 1, 0], [1, 2, 0], [0, 2, 1]].map(Vec::from));
    }

    #[test]
    fn letters_go_on_after_z() {
        assert_eq!([0, 1, 25, 26, 27, 51, 52, 701, 702].map(letters), ["A", "B", "Z", "AA", "AB", "AZ", "BA", "ZZ", "AAA"]);
    }

    #[test]
    fn all_pairs_are_counted() {
        assert_eq!([0, 1, 2, 3, 20].map(comparisons), [0, 0, 1, 3, 190]);
    }
}
