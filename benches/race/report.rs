//! What the race found: every point, and the programs at equal error.

use crate::{
    Failure,
    curve::{Curve, Reading, Sample},
    kept::Run,
    machine::Machine,
    programs::Versions,
    settings::{Program, Setting, Truth},
};
use hemisplat::measure::{Errors, statistics::Spread};
use serde::Serialize;
use serde_json::Value;

/// Keys in JSON are the fields' names.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Version of this record: 1.
    pub schema: u32,
    pub date: String,
    pub commit: Option<String>,
    /// Those of benches/changes.ron that this program has.
    pub changes: Vec<String>,
    pub machine: Machine,
    pub versions: Versions,
    /// Edge of all pictures [pixels].
    pub size: u32,
    pub truth: Truth,
    pub scenes: Vec<Scene>,
}

#[derive(Debug, Serialize)]
pub struct Scene {
    pub scene: String,
    pub points: Vec<Point>,
    pub equal_error: Vec<Level>,
}

/// All runs of one setting.
#[derive(Debug, Serialize)]
pub struct Point {
    pub program: Program,
    /// As its program is told.
    pub name: String,
    pub setting: Setting,
    pub command: String,
    pub seconds: Spread,
    pub seconds_of_runs: Vec<f64>,
    pub errors: Errors,
    /// The same at every pixel of windows.
    pub in_windows: Errors,
    /// What else its program tells of the last run.
    pub facts: Value,
    /// Whether it is on its program's curve: no other point of it is as fast and as exact.
    pub is_on_curve: bool,
}

/// The programs' curves read at one error.
#[derive(Debug, Serialize)]
pub struct Level {
    pub rmse_over_mean: f64,
    pub radiance: Reading,
    pub mitsuba: Reading,
    pub hemisplat: Reading,
    /// How many times hemisplat's seconds Radiance takes.
    pub radiance_over_hemisplat: Option<f64>,
    pub mitsuba_over_hemisplat: Option<f64>,
    /// Errors of hemisplat that are larger than Radiance's there; None where it has none to compare.
    pub hemisplat_is_worse_in: Option<Vec<&'static str>>,
}

impl Point {
    /// Runs of one setting, one at least.
    pub fn of(setting: &Setting, runs: Vec<Run>) -> Result<Self, Failure> {
        let name = setting.name();
        let seconds_of_runs: Vec<f64> = runs.iter().map(|run| run.seconds).collect();
        let seconds = Spread::of(&seconds_of_runs).ok_or("no runs")?;
        if runs.iter().any(|run| run.errors != runs[0].errors || run.in_windows != runs[0].in_windows) {
            return Err(format!("{} {name}: pictures of equal runs differ", setting.program().name()).into());
        }
        let Run { command, errors, in_windows, facts, .. } = runs.into_iter().next_back().ok_or("no runs")?;
        Ok(Self {
            program: setting.program(),
            name,
            setting: setting.clone(),
            command,
            seconds,
            seconds_of_runs,
            errors,
            in_windows,
            facts,
            is_on_curve: false,
        })
    }

    pub fn sample(&self) -> Result<Sample, Failure> {
        let Errors { rmse_over_mean, bias_over_mean, block_p50, block_p99, .. } = self.errors;
        let (block_p50, block_p99) = block_p50.zip(block_p99).ok_or_else(|| format!("{}: no block of the picture is whole", self.name))?;
        let Errors { band_error, rmse_edges, .. } = self.in_windows;
        let (band_error, rmse_edges) =
            band_error.zip(rmse_edges).ok_or_else(|| format!("{}: the windows hold no edge, or no surface that is large enough", self.name))?;
        Ok(Sample { seconds: self.seconds.median, rmse_over_mean, bias_over_mean, block_p50, block_p99, band_error, rmse_edges })
    }
}

impl Scene {
    pub fn of(scene: &str, mut points: Vec<Point>) -> Result<Self, Failure> {
        let [radiance, mitsuba, hemisplat] = Program::ALL.map(|program| curve(&mut points, program));
        let (radiance, mitsuba, hemisplat) = (radiance?, mitsuba?, hemisplat?);
        let levels = radiance.levels();
        let equal_error = levels.into_iter().map(|error| Level::of(error, [&radiance, &mitsuba, &hemisplat].map(|curve| curve.at(error)))).collect();
        Ok(Self { scene: scene.to_owned(), points, equal_error })
    }
}

/// A program's curve; marks the points that are on it.
fn curve(points: &mut [Point], program: Program) -> Result<Curve, Failure> {
    let mut own: Vec<&mut Point> = points.iter_mut().filter(|point| point.program == program && point.setting.is_on_curve()).collect();
    let samples = own.iter().map(|point| point.sample()).collect::<Result<Vec<_>, _>>()?;
    let curve = Curve::of(&samples).ok_or_else(|| format!("no error of {} is above the truth's noise: give `truth` more samples", program.name()))?;
    own.iter_mut().zip(samples).for_each(|(point, sample)| point.is_on_curve = curve.samples().contains(&sample));
    Ok(curve)
}

impl Level {
    fn of(rmse_over_mean: f64, [radiance, mitsuba, hemisplat]: [Reading; 3]) -> Self {
        Self {
            rmse_over_mean,
            radiance,
            mitsuba,
            hemisplat,
            radiance_over_hemisplat: radiance.over(&hemisplat),
            mitsuba_over_hemisplat: mitsuba.over(&hemisplat),
            hemisplat_is_worse_in: radiance.sample().zip(hemisplat.sample()).map(|(theirs, ours)| worse(&ours, &theirs)),
        }
    }
}

fn worse(ours: &Sample, theirs: &Sample) -> Vec<&'static str> {
    let pairs = [
        ("block_p50", ours.block_p50, theirs.block_p50),
        ("block_p99", ours.block_p99, theirs.block_p99),
        ("band_error", ours.band_error, theirs.band_error),
        ("rmse_edges", ours.rmse_edges, theirs.rmse_edges),
    ];
    pairs.into_iter().filter(|(_, ours, theirs)| ours > theirs).map(|(name, ..)| name).collect()
}
