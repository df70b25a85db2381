//! The ground truth: a path tracer that shares only the scene, its hierarchy and the formulas of its lobes with the passes.
//!
//! For each pixel's centre it finds the visible surface and estimates two irradiances there, apart, and where the surface is glossy what its
//! lobe reflects of each:
//! - **direct**: what punctual lights, emitters and the sky send without touching another surface;
//! - **indirect**: what touched one to `bounces` surfaces on its way.
//!
//! Directions are cosine-distributed and stratified, 256 a round at most; the spread of the rounds' means gives the
//! variance of their mean. Light from emitters and from a latitude-longitude sky is sampled both by rays and at its
//! source, joined by the balance heuristic (Veach 1997, eq. 9.8), so that no place is singular. Every pixel and round
//! draws from its own counter-based stream: the result does not depend on the number of threads, and a picture with a
//! stride or of windows holds the same bits as these pixels of the full one.
//!
//! Direct light is shadowed by either side of a surface, whatever sends it. Rays that look for indirect light pass
//! through the backs of one-sided surfaces, as those of a viewer do.

mod left_out;
mod lights;
mod path;
mod random;

pub use left_out::{LeftOut, left_out};
pub use path::{Gather, Tracer};

pub use crate::math::bounces::{Bounces, MAX_BOUNCES};
use crate::math::colour::luminance;
use crate::math::windows::{SIDE, Windows, room};
use crate::scene::{Camera, MAX_SIDE, Rgb, Scene, bvh::Bvh, surface::Surface};
use glam::{DVec3, Vec3};
use path::Round;
use random::Random;
use rayon::prelude::*;
use std::{
    f64::consts::PI,
    fmt,
    sync::atomic::{AtomicBool, AtomicUsize, Ordering},
};
use web_time::Instant;

/// Raised whenever the same settings give another picture, so that pictures kept from before are traced anew.
pub const VERSION: u32 = 3;

/// Pixels that one reference computes, at some 300 bytes each.
pub const MAX_PIXELS: u64 = 1 << 24;

/// Samples per pixel at which [`Stop::RelativeError`] gives up at the latest.
pub const MAX_SAMPLES: u32 = 1 << 20;

/// Rounds where there are rays enough: fewer say too little about their own spread.
const MIN_ROUNDS: u32 = 4;

/// Most rays of a round.
const MOST_RAYS: u32 = 256;

/// Pixels between two reports of progress.
const CHUNK: usize = 64;

/// What to compute.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Width and height of the full picture [pixels].
    pub size: [u32; 2],
    /// Which of its pixels are computed.
    pub pixels: Pixels,
    pub bounces: Bounces,
    pub stop: Stop,
    /// Another seed is an independent estimate.
    pub seed: u64,
}

/// Which pixels of a picture are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pixels {
    /// The pixels `k/2, k/2 + k, …` of each axis; 1 for all. The reference has these alone, and is k times smaller.
    Every(u32),
    /// Those of so many windows, as [`Windows::spread`] places them. The reference has the full size, and is 0 elsewhere.
    Windows(u32),
}

impl Pixels {
    /// Every how many columns and rows the reference has one.
    fn stride(self) -> u32 {
        match self {
            Self::Every(stride) => stride,
            Self::Windows(_) => 1,
        }
    }
}

impl fmt::Display for Pixels {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Every(stride) => write!(f, "stride {stride}"),
            Self::Windows(count) => write!(f, "windows {count}"),
        }
    }
}

impl Settings {
    /// Columns and rows of the reference.
    fn extent(&self) -> [u32; 2] {
        let stride = self.pixels.stride();
        self.size.map(|side| (side - stride / 2).div_ceil(stride))
    }

    /// The windows, where the picture is computed in windows alone.
    fn windows(&self) -> Result<Option<Windows>, ReferenceError> {
        let [width, height] = self.size;
        match self.pixels {
            Pixels::Every(_) => Ok(None),
            Pixels::Windows(count) => Windows::spread(self.size, count).map(Some).ok_or(ReferenceError::Windows { count, width, height }),
        }
    }
}

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// After so many rays per pixel, two or more.
    Samples(u32),
    /// When [`Reference::noise`] falls below this share, or after so many rays per pixel, at most [`MAX_SAMPLES`].
    RelativeError { error: f32, at_most: u32 },
}

/// How the rays of a pixel are shared out among rounds, of which each is an estimate of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rounds {
    count: u32,
    rays: u32,
}

impl Rounds {
    /// Those of all rays, or for an error bound of as many as it may take.
    fn of(stop: Stop) -> Self {
        match stop {
            Stop::Samples(rays) => Self { count: rays.div_ceil(MOST_RAYS).max(MIN_ROUNDS).min(rays), rays },
            Stop::RelativeError { at_most, .. } => {
                let each = (at_most / (2 * MIN_ROUNDS)).clamp(1, MOST_RAYS);
                let count = (at_most.min(MAX_SAMPLES) / each).max(MIN_ROUNDS);
                Self { count, rays: count * each }
            }
        }
    }

    /// Rays of one round: no two differ by more than one.
    fn rays(&self, round: u32) -> u32 {
        self.rays / self.count + u32::from(round < self.rays % self.count)
    }

    /// Rays of so many rounds.
    fn rays_of_first(&self, rounds: u32) -> u32 {
        rounds * (self.rays / self.count) + rounds.min(self.rays % self.count)
    }
}

/// The result: `width · height` values a layer, rows from the top. A pixel that sees no surface is 0 in all layers but
/// the picture; one that was not computed in all.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    pub width: u32,
    pub height: u32,
    /// Every how many columns and rows of the full picture this has one.
    pub stride: u32,
    /// What was computed, where that is not all.
    pub windows: Option<Windows>,
    pub bounces: Bounces,
    /// Rays per pixel that were averaged.
    pub samples: u32,
    /// Radiance toward the camera, with emission and sky [W m⁻² sr⁻¹].
    pub picture: Vec<Rgb>,
    /// Reflected direct light alone [W m⁻² sr⁻¹].
    pub direct: Vec<Rgb>,
    /// Reflected indirect light alone [W m⁻² sr⁻¹].
    pub indirect: Vec<Rgb>,
    /// Indirect irradiance, before reflectance [W/m²].
    pub irradiance: Vec<Rgb>,
    /// Direct irradiance, before reflectance [W/m²].
    pub direct_irradiance: Vec<Rgb>,
    /// Variance of `irradiance` as an estimate [(W/m²)²].
    pub variance: Vec<Rgb>,
    /// Indirect light that lobes reflect toward the camera [W m⁻² sr⁻¹]; none where nothing in the scene is glossy.
    pub glossy: Option<Glossy>,
    /// Variance of luminance, layer by layer.
    pub luminance_variance: LuminanceVariance,
    /// The largest of the noises of irradiance, glossy light and picture: standard deviation (root of the mean variance of luminance) over mean.
    pub noise: f64,
    /// Along the camera's axis [scene units].
    pub depth: Vec<f32>,
    /// Unit shading normal on the side seen.
    pub normal: Vec<Vec3>,
    /// Wall-clock time that it took.
    pub seconds: f64,
}

/// What the lobes of glossy surfaces reflect.
#[derive(Debug, Clone, PartialEq)]
pub struct Glossy {
    /// Indirect light toward the camera [W m⁻² sr⁻¹].
    pub radiance: Vec<Rgb>,
    /// Variance of `radiance` as an estimate.
    pub variance: Vec<Rgb>,
}

/// The variance of each pixel's luminance as an estimate, in the squared unit of its layer; 0 where no surface is seen.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LuminanceVariance {
    pub irradiance: Vec<f32>,
    pub glossy: Vec<f32>,
    pub direct: Vec<f32>,
    pub indirect: Vec<f32>,
    pub picture: Vec<f32>,
}

/// Why no reference was made.
#[derive(Debug, Clone, PartialEq, thiserror::Error, miette::Diagnostic)]
pub enum ReferenceError {
    #[error("a picture of {width}×{height} pixels cannot be rendered")]
    #[diagnostic(
        code(reference::size),
        help("each side must be 1 to {MAX_SIDE} pixels, and {MAX_PIXELS} pixels may be computed in all: a stride leaves some out")
    )]
    Size { width: u32, height: u32 },
    #[error("a stride of {stride} does not fit a picture of {width}×{height} pixels")]
    #[diagnostic(code(reference::stride), help("the stride must be at least 1 and at most the shorter side"))]
    Stride { stride: u32, width: u32, height: u32 },
    #[error("{count} window{} of {SIDE}×{SIDE} pixels cannot be placed in a picture of {width}×{height}", if *count == 1 { "" } else { "s" })]
    #[diagnostic(code(reference::windows), help("{}", windows_that_fit([*width, *height])))]
    Windows { count: u32, width: u32, height: u32 },
    #[error("{samples} rays a pixel are too few")]
    #[diagnostic(code(reference::samples), help("ask for 2 or more: a single one does not say how noisy it is"))]
    FewSamples { samples: u32 },
    #[error("a relative error of {error} cannot be reached")]
    #[diagnostic(code(reference::error), help("the error must be a positive number, such as 0.01 for one per cent"))]
    RelativeError { error: f32 },
    #[error("camera `{name}` has no valid view")]
    #[diagnostic(code(reference::camera), help("its place and directions must be finite, its directions unit vectors, its field of view between 0 and π"))]
    Camera { name: String },
    #[error("stopped before two rounds of samples were whole")]
    #[diagnostic(code(reference::stopped))]
    Stopped,
}

fn windows_that_fit(size: [u32; 2]) -> String {
    match room(size) {
        0 => format!("both sides of the picture must have {SIDE} pixels at least"),
        most => format!("it has room for 1 to {most}"),
    }
}

/// Renders the ground truth of `camera`'s view.
///
/// `progress` is told the share done, 0..1, from several threads; once it returns false, the round under way is dropped
/// and what earlier rounds found is returned.
///
/// # Errors
/// Impossible settings or camera, or a stop before two rounds were whole.
pub fn render(scene: &Scene, bvh: &Bvh, camera: &Camera, settings: &Settings, progress: &(dyn Fn(f32) -> bool + Sync)) -> Result<Reference, ReferenceError> {
    check(camera, settings)?;
    let start = Instant::now();
    let tracer = Tracer::new(scene, bvh);
    let mut frame = Frame::new(&tracer, camera, settings)?;
    let rounds = Rounds::of(settings.stop);
    let mut expected = rounds.count;
    while frame.rounds < expected {
        let share = |part: f32| progress((frame.rounds as f32 + part) / expected as f32);
        let Some(round) = frame.round(&tracer, settings, rounds.rays(frame.rounds), &share) else { break };
        frame.add(&round);
        if let Stop::RelativeError { error, .. } = settings.stop {
            expected = frame.rounds_for(error, rounds.count);
        }
    }
    if frame.rounds < 2 {
        return Err(ReferenceError::Stopped);
    }
    let mut reference = frame.resolve(settings, rounds.rays_of_first(frame.rounds));
    reference.seconds = start.elapsed().as_secs_f64();
    Ok(reference)
}

/// Indirect irradiance at one point, of `samples` rays, two or more, over the hemisphere about `normal` (a unit vector).
/// For many points, make one [`Tracer`] and call [`Tracer::gather`].
pub fn gather(scene: &Scene, bvh: &Bvh, position: Vec3, normal: Vec3, bounces: Bounces, samples: u32, seed: u64) -> Gather {
    Tracer::new(scene, bvh).gather(position, normal, bounces, samples, seed)
}

/// Refuses what [`render`] would refuse, before any work.
///
/// # Errors
/// Impossible settings or camera.
pub fn check(camera: &Camera, settings: &Settings) -> Result<(), ReferenceError> {
    let [width, height] = settings.size;
    if width.min(height) == 0 || width.max(height) > MAX_SIDE {
        return Err(ReferenceError::Size { width, height });
    }
    let stride = settings.pixels.stride();
    if stride == 0 || stride > width.min(height) {
        return Err(ReferenceError::Stride { stride, width, height });
    }
    let [columns, rows] = settings.extent().map(u64::from);
    if columns * rows > MAX_PIXELS {
        return Err(ReferenceError::Size { width, height });
    }
    settings.windows()?;
    match settings.stop {
        Stop::Samples(samples) | Stop::RelativeError { at_most: samples, .. } if samples < 2 => return Err(ReferenceError::FewSamples { samples }),
        Stop::RelativeError { error, .. } if !(error.is_finite() && error > 0.0) => return Err(ReferenceError::RelativeError { error }),
        _ => {}
    }
    let half = camera.half_extent(settings.size);
    let unit = |v: Vec3| (v.length() - 1.0).abs() < 1e-3;
    if !(camera.eye.is_finite() && half.is_finite() && half.min_element() > 0.0 && unit(camera.direction) && unit(camera.up) && unit(camera.right())) {
        return Err(ReferenceError::Camera { name: camera.name.clone() });
    }
    Ok(())
}

/// The visible surfaces and what has been summed over them.
struct Frame {
    width: u32,
    height: u32,
    /// What pixels see that see no surface.
    sky: Vec<(usize, Rgb)>,
    visible: Vec<Visible>,
    sums: Vec<Sums>,
    rounds: u32,
    windows: Option<Windows>,
}

struct Visible {
    /// Index into the layers.
    index: usize,
    /// Which of the full picture's pixels it is, so that its random numbers do not depend on the stride.
    pixel: u64,
    depth: f32,
    surface: Surface,
}

#[derive(Clone, Copy, Default)]
struct Sums {
    direct: DVec3,
    indirect: DVec3,
    indirect_squared: DVec3,
    glossy_direct: DVec3,
    glossy_indirect: DVec3,
    glossy_squared: DVec3,
    /// Squares of luminance.
    squared: Luminances,
}

/// The luminance of each layer whose noise is told.
#[derive(Clone, Copy, Default)]
struct Luminances {
    irradiance: f64,
    glossy: f64,
    direct: f64,
    indirect: f64,
    picture: f64,
}

impl Frame {
    fn new(tracer: &Tracer, camera: &Camera, settings: &Settings) -> Result<Self, ReferenceError> {
        let stride = settings.pixels.stride();
        let [width, height] = settings.extent();
        let windows = settings.windows()?;
        let mask = windows.as_ref().map(|windows| windows.mask(settings.size, 0));
        let is_computed = |index: &usize| mask.as_ref().is_none_or(|mask| mask[*index]);
        let (mut sky, mut visible) = (Vec::new(), Vec::new());
        for index in (0..width as usize * height as usize).filter(is_computed) {
            let [x, y] = [index as u32 % width, index as u32 / width].map(|i| i * stride + stride / 2);
            let ray = camera.ray(settings.size, [x, y]);
            match tracer.surface(ray) {
                None => sky.push((index, tracer.scene().environment.radiance(ray.direction.normalize()))),
                Some(surface) => {
                    let depth = (surface.position - camera.eye).dot(camera.direction);
                    visible.push(Visible { index, pixel: y as u64 * settings.size[0] as u64 + x as u64, depth, surface });
                }
            }
        }
        let sums = vec![Sums::default(); visible.len()];
        Ok(Self { width, height, sky, visible, sums, rounds: 0, windows })
    }

    /// One more round for every pixel, or none when told to stop.
    fn round(&self, tracer: &Tracer, settings: &Settings, rays: u32, progress: &(dyn Fn(f32) -> bool + Sync)) -> Option<Vec<Round>> {
        let (stop, done) = (AtomicBool::new(!progress(0.0)), AtomicUsize::new(0));
        let mut rounds = vec![Round::default(); self.visible.len()];
        rounds.par_chunks_mut(CHUNK).zip(self.visible.par_chunks(CHUNK)).for_each(|(rounds, visible)| {
            if stop.load(Ordering::Relaxed) {
                return;
            }
            for (round, visible) in rounds.iter_mut().zip(visible) {
                let mut random = Random::new([settings.seed, visible.pixel, self.rounds as u64]);
                *round = tracer.round(&visible.surface, settings.bounces, rays, &mut random);
            }
            let done = done.fetch_add(visible.len(), Ordering::Relaxed) + visible.len();
            if !progress(done as f32 / self.visible.len() as f32) {
                stop.store(true, Ordering::Relaxed);
            }
        });
        (!stop.into_inner() || done.into_inner() == self.visible.len() && !self.visible.is_empty()).then_some(rounds)
    }

    fn add(&mut self, rounds: &[Round]) {
        for ((sum, round), visible) in self.sums.iter_mut().zip(rounds).zip(&self.visible) {
            sum.direct += round.direct;
            sum.indirect += round.indirect;
            sum.indirect_squared += round.indirect * round.indirect;
            sum.glossy_direct += round.glossy_direct;
            sum.glossy_indirect += round.glossy_indirect;
            sum.glossy_squared += round.glossy_indirect * round.glossy_indirect;
            sum.squared.add_squares(&visible.luminances(round));
        }
        self.rounds += 1;
    }

    /// As [`Reference::noise`] tells.
    fn noise(&self) -> f64 {
        let n = self.rounds as f64;
        let pixels =
            || self.visible.iter().zip(&self.sums).map(|(visible, sums)| (visible, visible.luminances(&sums.mean(n)), sums.luminance_variance(visible, n)));
        let irradiance = noise(pixels().filter(|(visible, ..)| visible.has_irradiance()).map(|(_, mean, variance)| [mean.irradiance, variance.irradiance]));
        let glossy = noise(pixels().filter(|(visible, ..)| visible.surface.glossy.is_some()).map(|(_, mean, variance)| [mean.glossy, variance.glossy]));
        let picture = noise(pixels().map(|(_, mean, variance)| [mean.picture, variance.picture]));
        irradiance.max(glossy).max(picture)
    }

    /// How many rounds it takes to reach a relative error, as far as can be said now; those done when it is reached.
    fn rounds_for(&self, error: f32, at_most: u32) -> u32 {
        if self.rounds < MIN_ROUNDS {
            return at_most.min(MIN_ROUNDS);
        }
        let (n, noise) = (self.rounds as f64, self.noise());
        if noise <= error as f64 {
            return self.rounds;
        }
        ((n * (noise / error as f64).powi(2)).ceil().min(at_most as f64) as u32).max(self.rounds + 1).min(at_most)
    }

    fn resolve(&self, settings: &Settings, samples: u32) -> Reference {
        let count = self.width as usize * self.height as usize;
        let black = || vec![Vec3::ZERO; count];
        let mut reference = Reference {
            width: self.width,
            height: self.height,
            stride: settings.pixels.stride(),
            windows: self.windows.clone(),
            bounces: settings.bounces,
            samples,
            picture: black(),
            direct: black(),
            indirect: black(),
            irradiance: black(),
            direct_irradiance: black(),
            variance: black(),
            glossy: self.visible.iter().any(|v| v.surface.glossy.is_some()).then(|| Glossy { radiance: black(), variance: black() }),
            luminance_variance: LuminanceVariance::black(count),
            noise: self.noise(),
            depth: vec![0.0; count],
            normal: black(),
            seconds: 0.0,
        };
        self.sky.iter().for_each(|&(index, radiance)| reference.picture[index] = radiance);
        let n = self.rounds as f64;
        for (visible, sums) in self.visible.iter().zip(&self.sums) {
            let Visible { index: at, depth, surface, .. } = visible;
            let at = *at;
            let brdf = surface.reflectance.as_dvec3() / PI;
            let (direct, indirect) = (sums.direct / n, sums.indirect / n);
            let (glossy_direct, glossy_indirect) = (sums.glossy_direct / n, sums.glossy_indirect / n);
            reference.picture[at] = (surface.emission.as_dvec3() + brdf * (direct + indirect) + glossy_direct + glossy_indirect).as_vec3();
            reference.direct[at] = (brdf * direct + glossy_direct).as_vec3();
            reference.indirect[at] = (brdf * indirect + glossy_indirect).as_vec3();
            if let Some(glossy) = &mut reference.glossy {
                glossy.radiance[at] = glossy_indirect.as_vec3();
                glossy.variance[at] = sums.glossy_variance(n).as_vec3();
            }
            if visible.has_irradiance() {
                reference.irradiance[at] = indirect.as_vec3();
                reference.direct_irradiance[at] = direct.as_vec3();
                reference.variance[at] = sums.variance(n).as_vec3();
            }
            reference.luminance_variance.set(at, visible, &sums.luminance_variance(visible, n));
            reference.depth[at] = *depth;
            reference.normal[at] = surface.normal;
        }
        reference
    }
}

impl Visible {
    /// Where a lobe is all that reflects, nobody asks for irradiance.
    fn has_irradiance(&self) -> bool {
        self.surface.glossy.is_none() || self.surface.reflectance != Vec3::ZERO
    }

    /// Of what a round, or all of them, found here.
    fn luminances(&self, round: &Round) -> Luminances {
        let reflected = |irradiance: DVec3, glossy: DVec3| luminance(self.surface.reflectance.as_dvec3() / PI * irradiance + glossy);
        let (direct, indirect) = (reflected(round.direct, round.glossy_direct), reflected(round.indirect, round.glossy_indirect));
        let emission = luminance(self.surface.emission.as_dvec3());
        Luminances { irradiance: luminance(round.indirect), glossy: luminance(round.glossy_indirect), direct, indirect, picture: emission + direct + indirect }
    }
}

impl Luminances {
    fn add_squares(&mut self, of: &Self) {
        self.irradiance += of.irradiance.powi(2);
        self.glossy += of.glossy.powi(2);
        self.direct += of.direct.powi(2);
        self.indirect += of.indirect.powi(2);
        self.picture += of.picture.powi(2);
    }
}

impl LuminanceVariance {
    fn black(count: usize) -> Self {
        let black = || vec![0.0; count];
        Self { irradiance: black(), glossy: black(), direct: black(), indirect: black(), picture: black() }
    }

    fn set(&mut self, at: usize, visible: &Visible, variance: &Luminances) {
        if visible.has_irradiance() {
            self.irradiance[at] = variance.irradiance as f32;
        }
        self.glossy[at] = variance.glossy as f32;
        self.direct[at] = variance.direct as f32;
        self.indirect[at] = variance.indirect as f32;
        self.picture[at] = variance.picture as f32;
    }
}

impl Sums {
    /// Variance of the mean of `n` rounds.
    fn variance(&self, n: f64) -> DVec3 {
        variance_of_mean(self.indirect, self.indirect_squared, n)
    }

    /// The means of `n` rounds.
    fn mean(&self, n: f64) -> Round {
        let Self { direct, indirect, glossy_direct, glossy_indirect, .. } = self;
        Round { direct: direct / n, indirect: indirect / n, glossy_direct: glossy_direct / n, glossy_indirect: glossy_indirect / n }
    }

    /// Variance of the luminance of the mean of `n` rounds.
    fn luminance_variance(&self, at: &Visible, n: f64) -> Luminances {
        let (mean, squared) = (at.luminances(&self.mean(n)), &self.squared);
        let variance = |mean: f64, squares: f64| (squares / n - mean * mean).max(0.0) / (n - 1.0);
        Luminances {
            irradiance: variance(mean.irradiance, squared.irradiance),
            glossy: variance(mean.glossy, squared.glossy),
            direct: variance(mean.direct, squared.direct),
            indirect: variance(mean.indirect, squared.indirect),
            picture: variance(mean.picture, squared.picture),
        }
    }

    /// The same of what lobes reflect.
    fn glossy_variance(&self, n: f64) -> DVec3 {
        variance_of_mean(self.glossy_indirect, self.glossy_squared, n)
    }
}

/// Standard deviation over mean of a picture, from its pixels' means and their variance; 0 where it has none.
fn noise(pixels: impl Iterator<Item = [f64; 2]>) -> f64 {
    let [mean, variance, count] = pixels.fold([0.0; 3], |[means, variances, count], [mean, variance]| [means + mean, variances + variance, count + 1.0]);
    if variance == 0.0 { 0.0 } else { (variance * count).sqrt() / mean.max(f64::MIN_POSITIVE) }
}

/// Variance of the mean of `n` values, from their sum and the sum of their squares.
fn variance_of_mean(sum: DVec3, squares: DVec3, n: f64) -> DVec3 {
    let mean = sum / n;
    (squares / n - mean * mean).max(DVec3::ZERO) / (n - 1.0)
}
