//! What is raced: scenes, and the settings of each program, read from a file and checked before anything runs.

use hemisplat::math::windows::{Windows, room};
use hemisplat::{passes::REGISTRY, pipeline};
use serde::{Deserialize, Serialize};
use std::io;

/// Pixels of the truth along an edge: fewer make no blocks of several pixels.
const FEWEST_PIXELS: u32 = 33;
/// Rays of a round of Mitsuba's truth, and the fewest rounds that tell a variance.
const ROUND: u32 = 256;
const FEWEST_ROUNDS: u32 = 2;

/// The file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Race {
    /// Edge of all pictures [pixels].
    pub size: u32,
    pub truth: Truth,
    /// Most surfaces that light touches on its way, in the truth and with every peer; the pipelines have theirs.
    #[serde(default = "one")]
    pub bounces: u32,
    /// `NODE.PARAM=VALUE` that make a render short without changing its shaders.
    pub warm_up: Vec<String>,
    pub scenes: Vec<Case>,
    pub hemisplat: Vec<Hemisplat>,
    pub mitsuba: Vec<Mitsuba>,
    pub denoised: Vec<Denoised>,
    /// Of each setting.
    pub runs: Runs,
    /// The most that other processes may have of the processors' time while a run is timed; a run that they had more of is thrown away.
    pub others_at_most: f64,
}

fn one() -> u32 {
    1
}

/// How often each program's settings run: what takes minutes is disturbed less than what takes a second.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Runs {
    pub radiance: u32,
    pub mitsuba: u32,
    pub denoised: u32,
    pub hemisplat: u32,
}

impl Runs {
    pub fn of(&self, program: Program) -> u32 {
        match program {
            Program::Radiance => self.radiance,
            Program::Mitsuba => self.mitsuba,
            Program::Denoised => self.denoised,
            Program::Hemisplat => self.hemisplat,
        }
    }
}

/// What all errors are held against: rays of each pixel of those that it holds. One truth has every `stride`-th pixel of each row and column; what an eye
/// sees first is measured in another one, at every pixel of so many windows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    pub samples: u32,
    pub stride: u32,
    pub windows: u32,
}

/// A scene by its name in `benches/peers/cases.json` and in `scenes/`, and what Radiance is tried with on it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    pub name: String,
    pub radiance: Vec<Radiance>,
}

/// Radiance's -aa, -ad, -ar.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Radiance {
    pub accuracy: f64,
    pub samples: u32,
    pub resolution: u32,
}

/// Rays of each pixel: `strata` × `strata`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mitsuba {
    pub strata: u32,
}

/// Mitsuba's rays of each pixel, then Open Image Denoise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Denoised {
    pub rays: u32,
    pub quality: Quality,
}

/// Of the denoiser's network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Quality {
    Fast,
    Balanced,
    High,
}

impl Quality {
    /// As the script takes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::High => "high",
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hemisplat {
    /// One that ships.
    pub pipeline: String,
    #[serde(default)]
    pub set: Vec<String>,
    #[serde(default)]
    pub start: Start,
}

/// Whether the driver has compiled the shaders in an earlier run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Start {
    #[default]
    Warm,
    Cold,
}

/// One point of one program's curve.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Setting {
    Radiance(Radiance),
    Mitsuba(Mitsuba),
    Denoised(Denoised),
    Hemisplat(Hemisplat),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Program {
    Radiance,
    Mitsuba,
    /// Few rays of Mitsuba's, denoised.
    Denoised,
    Hemisplat,
}

impl Program {
    pub const ALL: [Self; 4] = [Self::Radiance, Self::Mitsuba, Self::Denoised, Self::Hemisplat];

    pub fn name(self) -> &'static str {
        match self {
            Self::Radiance => "Radiance",
            Self::Mitsuba => "Mitsuba",
            Self::Denoised => "Mitsuba and OIDN",
            Self::Hemisplat => "hemisplat",
        }
    }
}

impl Setting {
    pub fn program(&self) -> Program {
        match self {
            Self::Radiance(_) => Program::Radiance,
            Self::Mitsuba(_) => Program::Mitsuba,
            Self::Denoised(_) => Program::Denoised,
            Self::Hemisplat(_) => Program::Hemisplat,
        }
    }

    /// Whether it belongs to the curve that is compared: a cold start is told beside it.
    pub fn is_on_curve(&self) -> bool {
        !matches!(self, Self::Hemisplat(Hemisplat { start: Start::Cold, .. }))
    }

    /// What anyone gets who changes nothing.
    pub fn is_what_ships(&self) -> bool {
        matches!(self, Self::Hemisplat(Hemisplat { pipeline, set, start: Start::Warm }) if ["irradiance", "irradiance-bounces"].contains(&pipeline.as_str()) && set.is_empty())
    }

    /// As its program is told.
    pub fn name(&self) -> String {
        match self {
            Self::Radiance(Radiance { accuracy, samples, resolution }) => format!("-aa {accuracy} -ad {samples} -ar {resolution}"),
            Self::Mitsuba(Mitsuba { strata }) => format!("{} rays a pixel", strata * strata),
            Self::Denoised(Denoised { rays, quality }) => format!("{rays} rays a pixel, {}", quality.name()),
            Self::Hemisplat(Hemisplat { pipeline, set, start }) => {
                let start = (*start == Start::Cold).then(|| "(cold start)".to_owned());
                std::iter::once(pipeline.clone()).chain(set.iter().cloned()).chain(start).collect::<Vec<_>>().join(" ")
            }
        }
    }
}

impl Race {
    /// Reads the file's text; the error says what is wrong with it.
    pub fn read(text: &str) -> Result<Self, String> {
        let race: Self = ron::from_str(text).map_err(|error| error.to_string())?;
        race.check_sizes()?;
        race.check_lists()?;
        race.hemisplat.iter().try_for_each(|ours| race.check_pipeline(ours))?;
        Ok(race)
    }

    /// The scenes of this name, or all.
    pub fn only(mut self, scene: Option<&str>) -> Result<Self, String> {
        let names = self.scenes.iter().map(|case| case.name.clone()).collect::<Vec<_>>().join(", ");
        self.scenes.retain(|case| scene.is_none_or(|scene| case.name == scene));
        if self.scenes.is_empty() { Err(format!("no scene {}; the list has {names}", scene.unwrap_or_default())) } else { Ok(self) }
    }

    /// Those of the scene's Radiance, of Mitsuba, denoised, of hemisplat.
    pub fn settings(&self, case: &Case) -> Vec<Setting> {
        let radiance = case.radiance.iter().cloned().map(Setting::Radiance);
        let mitsuba = self.mitsuba.iter().cloned().map(Setting::Mitsuba);
        let denoised = self.denoised.iter().cloned().map(Setting::Denoised);
        radiance.chain(mitsuba).chain(denoised).chain(self.hemisplat.iter().cloned().map(Setting::Hemisplat)).collect()
    }

    fn check_sizes(&self) -> Result<(), String> {
        let Truth { samples, stride, windows } = self.truth;
        if stride == 0 || !self.size.is_multiple_of(stride) || self.size / stride < FEWEST_PIXELS {
            return Err(format!("size {} and stride {stride}: the size is to be a multiple of the stride, {FEWEST_PIXELS} times as large at least", self.size));
        }
        if Windows::spread([self.size; 2], windows).is_none() {
            return Err(format!("truth.windows {windows}: the picture has room for 1 to {}", room([self.size; 2])));
        }
        if !samples.is_multiple_of(ROUND) || samples < ROUND * FEWEST_ROUNDS {
            return Err(format!("truth.samples {samples}: Mitsuba casts rounds of {ROUND}, {FEWEST_ROUNDS} at least"));
        }
        if !(1..=64).contains(&self.bounces) {
            return Err(format!("bounces {}: 1 to 64", self.bounces));
        }
        if self.mitsuba.iter().any(|mitsuba| !(1..=1000).contains(&mitsuba.strata)) {
            return Err("mitsuba.strata: a number from 1 to 1000".into());
        }
        if self.denoised.iter().any(|denoised| !denoised.rays.is_power_of_two() || denoised.rays > 64) {
            return Err("denoised.rays: 1, 2, 4, 8, 16, 32 or 64".into());
        }
        if Program::ALL.into_iter().any(|program| self.runs.of(program) == 0) {
            return Err("runs: one at least of each program".into());
        }
        if !(self.others_at_most > 0.0 && self.others_at_most <= 1.0) {
            return Err(format!("others_at_most {}: a share of the processors' time, above 0 and up to 1", self.others_at_most));
        }
        Ok(())
    }

    /// Every program has points, none of them twice.
    fn check_lists(&self) -> Result<(), String> {
        for (index, case) in self.scenes.iter().enumerate() {
            if self.scenes[..index].iter().any(|other| other.name == case.name) {
                return Err(format!("scene {} stands there twice", case.name));
            }
            let settings = self.settings(case);
            let on_curve = |program| settings.iter().any(|setting| setting.program() == program && setting.is_on_curve());
            if let Some(program) = Program::ALL.into_iter().find(|program| !on_curve(*program)) {
                return Err(format!("scene {} has no setting of {}", case.name, program.name()));
            }
            if let Some(twice) = (1..settings.len()).find(|index| settings[..*index].contains(&settings[*index])).map(|index| &settings[index]) {
                return Err(format!("scene {}: {} {} stands there twice", case.name, twice.program().name(), twice.name()));
            }
        }
        Ok(())
    }

    /// Only pipelines that ship: the program's checksum stands for them.
    fn check_pipeline(&self, ours: &Hemisplat) -> Result<(), String> {
        let sets = [&ours.set[..], &self.warm_up].concat();
        let loaded = pipeline::load(&ours.pipeline, &sets, REGISTRY, &mut |_| Err(io::ErrorKind::NotFound.into()));
        loaded.map(drop).map_err(|problems| format!("pipeline {}:\n{:?}", ours.pipeline, miette::Report::new(problems)))
    }
}

/// One list out of several, each spread evenly over the whole and in its own order, so that what drifts with time falls on all alike.
pub fn interleaved<T>(lists: Vec<Vec<T>>) -> Vec<T> {
    let place = |index: usize, length: usize| (index as f64 + 0.5) / length as f64;
    let placed = |list: Vec<T>| {
        let length = list.len();
        list.into_iter().enumerate().map(move |(index, item)| (place(index, length), item)).collect::<Vec<_>>()
    };
    let mut all: Vec<(f64, T)> = lists.into_iter().flat_map(placed).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().map(|(_, item)| item).collect()
}
