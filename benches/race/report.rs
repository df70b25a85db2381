//! What the race found: every point, and the programs at equal error.

use crate::{
    Failure,
    curve::{Curve, Factor, Metric, Reading, Sample, Seconds},
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
    /// Version of this record: 2.
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
    /// Most surfaces that light touches on its way, in the truth and with every peer.
    pub bounces: u32,
    /// Runs in which other processes had more of the processors' time were thrown away.
    pub others_at_most: f64,
    pub scenes: Vec<Scene>,
}

#[derive(Debug, Serialize)]
pub struct Scene {
    pub scene: String,
    pub points: Vec<Point>,
    /// At `rmse_over_mean` of Radiance, then of denoised rays.
    pub equal_error: Vec<Level>,
    /// At each error of what ships.
    pub as_shipped: Vec<Level>,
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
    /// The most that other processes had of the processors' time in a run; None where the system does not tell it.
    pub others: Option<f64>,
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
    /// Whose error it is.
    pub of: Program,
    pub metric: Metric,
    pub error: f64,
    pub readings: Each<Reading>,
    /// How many times hemisplat's seconds the others take.
    pub over_hemisplat: Each<Factor>,
    /// Errors of hemisplat that are larger there than those of the program whose error it is; None where it has none to compare.
    pub hemisplat_is_worse_in: Option<Vec<&'static str>>,
}

/// Something of each program, with its name as the key.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Each<T> {
    pub radiance: T,
    pub mitsuba: T,
    pub denoised: T,
    pub hemisplat: T,
}

impl<T> Each<T> {
    fn of(mut made: impl FnMut(Program) -> T) -> Self {
        Self { radiance: made(Program::Radiance), mitsuba: made(Program::Mitsuba), denoised: made(Program::Denoised), hemisplat: made(Program::Hemisplat) }
    }

    pub fn get(&self, program: Program) -> &T {
        match program {
            Program::Radiance => &self.radiance,
            Program::Mitsuba => &self.mitsuba,
            Program::Denoised => &self.denoised,
            Program::Hemisplat => &self.hemisplat,
        }
    }
}

impl Point {
    /// Runs of one setting, one at least. Pictures of the same setting are the same, but for Radiance's, whose processes share what they find: there the
    /// first counts.
    pub fn of(setting: &Setting, runs: Vec<Run>) -> Result<Self, Failure> {
        let (name, program) = (setting.name(), setting.program());
        let seconds_of_runs: Vec<f64> = runs.iter().map(|run| run.seconds).collect();
        let seconds = Spread::of(&seconds_of_runs).ok_or("no runs")?;
        let differ = runs.iter().any(|run| run.errors != runs[0].errors || run.in_windows != runs[0].in_windows);
        if differ && program != Program::Radiance {
            return Err(format!("{} {name}: pictures of equal runs differ", program.name()).into());
        }
        let others = runs.iter().filter_map(|run| run.others).reduce(f64::max);
        let Run { command, errors, in_windows, facts, .. } = runs.into_iter().next().ok_or("no runs")?;
        let setting = setting.clone();
        Ok(Self { program, name, setting, command, seconds, seconds_of_runs, others, errors, in_windows, facts, is_on_curve: false })
    }

    pub fn sample(&self) -> Result<Sample, Failure> {
        let Errors { rmse_over_mean, block_p50, block_p99, .. } = self.errors;
        let (block_p50, block_p99) = block_p50.zip(block_p99).ok_or_else(|| format!("{}: no block of the picture is whole", self.name))?;
        let Errors { band_error, rmse_interior, rmse_edges, .. } = self.in_windows;
        let (band_error, (rmse_interior, rmse_edges)) = band_error
            .zip(rmse_interior.zip(rmse_edges))
            .ok_or_else(|| format!("{}: the windows hold no edge, or no surface that is large enough", self.name))?;
        let Spread { median, least, most, .. } = self.seconds;
        Ok(Sample { seconds: Seconds { median, least, most }, errors: [rmse_over_mean, block_p50, block_p99, band_error, rmse_interior, rmse_edges] })
    }
}

impl Scene {
    pub fn of(scene: &str, mut points: Vec<Point>) -> Result<Self, Failure> {
        let curves = Curves::of(&points)?;
        for point in &mut points {
            let is_on_front = curves.get(point.program, Metric::RmseOverMean)?.samples().contains(&point.sample()?);
            point.is_on_curve = point.setting.is_on_curve() && is_on_front;
        }
        let mut equal_error = Vec::new();
        for program in [Program::Radiance, Program::Denoised] {
            for error in curves.get(program, Metric::RmseOverMean)?.levels() {
                equal_error.push(curves.level(program, Metric::RmseOverMean, error)?);
            }
        }
        let shipped = points.iter().find(|point| point.setting.is_what_ships()).map(Point::sample).transpose()?;
        let as_shipped = shipped.iter().flat_map(|sample| Metric::ALL.map(|metric| curves.level(Program::Hemisplat, metric, sample.error(metric))));
        Ok(Self { scene: scene.to_owned(), equal_error, as_shipped: as_shipped.collect::<Result<_, _>>()?, points })
    }
}

/// The curve of each program in each error.
struct Curves(Vec<(Program, Metric, Curve)>);

impl Curves {
    fn of(points: &[Point]) -> Result<Self, Failure> {
        let mut curves = Vec::new();
        for program in Program::ALL {
            let own = points.iter().filter(|point| point.program == program && point.setting.is_on_curve());
            let samples = own.map(Point::sample).collect::<Result<Vec<_>, _>>()?;
            for metric in Metric::ALL {
                let curve = Curve::of(&samples, metric);
                let curve = curve.ok_or_else(|| format!("no {} of {} is above the truth's noise: give `truth` more samples", metric.name(), program.name()))?;
                curves.push((program, metric, curve));
            }
        }
        Ok(Self(curves))
    }

    fn get(&self, program: Program, metric: Metric) -> Result<&Curve, Failure> {
        let found = self.0.iter().find(|(other, of, _)| *other == program && *of == metric);
        Ok(&found.ok_or_else(|| format!("{} has no curve", program.name()))?.2)
    }

    /// All programs at an error of `of`.
    fn level(&self, of: Program, metric: Metric, error: f64) -> Result<Level, Failure> {
        let mut read = Vec::new();
        for program in Program::ALL {
            read.push(self.get(program, metric)?.at(error));
        }
        let readings = Each::of(|program| read[program as usize]);
        let over_hemisplat = Each::of(|program| readings.get(program).over(&readings.hemisplat));
        let both = readings.get(of).sample().zip(readings.hemisplat.sample()).filter(|_| of != Program::Hemisplat);
        let hemisplat_is_worse_in = both.map(|(theirs, ours)| worse(&ours, &theirs, metric));
        Ok(Level { of, metric, error, readings, over_hemisplat, hemisplat_is_worse_in })
    }
}

fn worse(ours: &Sample, theirs: &Sample, but: Metric) -> Vec<&'static str> {
    Metric::ALL.into_iter().filter(|metric| *metric != but && ours.error(*metric) > theirs.error(*metric)).map(Metric::name).collect()
}
