//! Each metric of luminance: its value, its interval, and what it is in each draw of the picture's blocks.

use super::interval::{Interval, middle};
use super::resampling::{Resampling, Stream};
use super::samples::{Sample, Samples};
use super::{LargestError, block_side};
use crate::math::windows;
use crate::measure::statistics::{CONFIDENCE, quantile, two_sided};

/// Pixels darker than this share of the mean are left out of `rms_of_relative`.
const DARK: f64 = 0.02;
/// What keeps `relmse` finite in the dark [share of the squared mean].
const RELMSE_FLOOR: f64 = 0.01;
/// Made pictures of noise alone that tell what it does to the quantiles of blocks.
const NOISES: usize = 200;

/// A metric with what is known of it.
pub(super) struct Found {
    pub value: Option<f64>,
    pub interval: Option<Interval>,
    /// Empty where it was not resampled.
    pub draws: Vec<f64>,
}

/// A square of an error, less what the reference's noise adds.
pub(super) struct Square {
    pub value: f64,
    /// The variance that noise alone gives it, as if those of pixels were independent.
    pub spread: f64,
}

/// The pixels with the draws of their blocks, if there are enough.
pub(super) struct Judged<'s> {
    pub samples: &'s Samples,
    pub resampling: Option<Resampling>,
}

impl<'s> Judged<'s> {
    pub fn new(samples: &'s Samples) -> Self {
        Self { samples, resampling: Resampling::of(samples.all.iter().map(|s| s.at), samples.size) }
    }

    /// Of each draw: `value` of the sums of `terms`.
    fn draws<const K: usize>(&self, terms: impl Fn(&Sample) -> [f64; K], value: impl Fn([f64; K]) -> f64) -> Vec<f64> {
        let pixels = || self.samples.all.iter().map(|sample| (sample.at, terms(sample)));
        self.resampling.as_ref().map_or(Vec::new(), |resampling| resampling.of_sums(pixels(), value))
    }

    /// The sum of `terms` over all pixels.
    fn sum<const K: usize>(&self, terms: impl Fn(&Sample) -> [f64; K]) -> [f64; K] {
        self.samples.all.iter().fold([0.0; K], |mut sum, sample| {
            sum.iter_mut().zip(terms(sample)).for_each(|(sum, term)| *sum += term);
            sum
        })
    }

    /// sqrt(max(0, mean square difference − mean variance)) / mean.
    pub fn rmse(&self) -> Found {
        self.root_mean(|s| Some(Square { value: s.difference().powi(2) - s.variance, spread: 2.0 * s.variance.powi(2) }))
    }

    /// sqrt(max(0, mean of squares)) over the mean of all pixels' r; nothing where no pixel has a square.
    pub fn root_mean(&self, square: impl Fn(&Sample) -> Option<Square>) -> Found {
        let terms = |s: &Sample| {
            let square = square(s);
            [square.as_ref().map_or(0.0, |square| square.value), if square.is_some() { 1.0 } else { 0.0 }, s.r, 1.0]
        };
        // Signed, so that draws below the noise stay in order. A draw may hold none of the pixels that count.
        let value = |[square, count, r, all]: [f64; 4]| if count > 0.0 { signed_root(square / count) * all / r } else { 0.0 };
        let sum = self.sum(terms);
        if sum[1] == 0.0 {
            return Found { value: None, interval: None, draws: Vec::new() };
        }
        let draws = self.draws(terms, value);
        let (found, is_noisy) = (value(sum), self.samples.variance.is_some());
        let of_noise_alone = || self.of_noise_alone(&square);
        let interval = match middle(&draws) {
            Some([low, high]) if high > 0.0 || !is_noisy => Some(Interval { low: low.max(0.0), high, noise_floor: None, below_noise: is_noisy && low <= 0.0 }),
            // Even the larger end is none: what is sure then is that the error is not above the noise's own spread.
            Some(_) => Some(of_noise_alone()),
            None => (is_noisy && found <= 0.0).then(of_noise_alone),
        };
        Found { value: Some(found.max(0.0)), interval, draws }
    }

    /// What such a root cannot be told from 0 below: two deviations of the mean square of noise that is normal and its own in each pixel.
    fn of_noise_alone(&self, square: impl Fn(&Sample) -> Option<Square>) -> Interval {
        let [squares, count] = self.sum(|s| square(s).map_or([0.0; 2], |square| [square.spread, 1.0]));
        let high = (two_sided(1.0 - CONFIDENCE) * squares.sqrt() / count).sqrt() / self.samples.mean;
        Interval { low: 0.0, high, noise_floor: None, below_noise: high > 0.0 }
    }

    /// (mean of x − mean) / mean.
    pub fn bias(&self) -> Found {
        let terms = |s: &Sample| [s.difference(), s.r];
        let value = |[difference, r]: [f64; 2]| difference / r;
        let found = value(self.sum(terms));
        let draws = self.draws(terms, value);
        let [variance, count] = self.sum(|s| [s.variance, 1.0]);
        let noise = two_sided(1.0 - CONFIDENCE) * variance.sqrt() / count / self.samples.mean;
        let interval = middle(&draws).map(|[low, high]| Interval { low, high, noise_floor: None, below_noise: found.abs() < noise });
        Found { value: Some(found), interval, draws }
    }

    /// sqrt(mean(((x − r)/r)²)) over the pixels with r > 2 % of the mean.
    pub fn rms_of_relative(&self) -> Found {
        let bright = |s: &Sample| s.r > DARK * self.samples.mean;
        let terms = |s: &Sample| if bright(s) { [(s.difference() / s.r).powi(2), s.variance / (s.r * s.r), 1.0] } else { [0.0; 3] };
        self.with_noise(terms, f64::sqrt)
    }

    /// mean((x − r)² / (r² + 0.01 · mean²)).
    pub fn relmse(&self) -> Found {
        let over = |s: &Sample| s.r * s.r + RELMSE_FLOOR * self.samples.mean.powi(2);
        self.with_noise(|s| [s.difference().powi(2) / over(s), s.variance / over(s), 1.0], |mean| mean)
    }

    /// A metric that is `value` of a mean of squares from which the reference's noise is not taken off; `terms` are square, variance, count.
    fn with_noise(&self, terms: impl Fn(&Sample) -> [f64; 3], value: impl Fn(f64) -> f64) -> Found {
        let [squares, variances, count] = self.sum(&terms);
        if count == 0.0 {
            return Found { value: None, interval: None, draws: Vec::new() };
        }
        // A draw may hold none of the pixels that count.
        let mean = |sum: f64, count: f64| if count > 0.0 { sum / count } else { 0.0 };
        let draws = self.draws(&terms, |[squares, _, count]| value(mean(squares, count)));
        let beyond_noise = middle(&self.draws(&terms, |[squares, variances, count]| mean(squares - variances, count)));
        let is_noise = self.samples.variance.is_some() && squares > 0.0 && beyond_noise.is_some_and(|[low, _]| low <= 0.0);
        let noise_floor = self.samples.variance.map(|_| value(variances / count));
        let interval = middle(&draws).map(|[low, high]| Interval { low: low.max(0.0), high, noise_floor, below_noise: is_noise });
        Found { value: Some(value(squares / count)), interval, draws }
    }

    /// The median and the 99th percentile of the relative errors of blocks.
    pub fn blocks(&self) -> [Found; 2] {
        let blocks: Vec<Block> = blocks(self.samples).into_iter().filter(|block| block.r > 0.0).collect();
        let noises = self.samples.variance.map(|_| noises(&blocks));
        let mut errors: Vec<(f64, usize)> = blocks.iter().map(|block| (block.error(), block.at)).collect();
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        [0.5, 0.99].map(|share| self.quantile(&errors, share, noises.as_deref()))
    }

    fn quantile(&self, errors: &[(f64, usize)], share: f64, noises: Option<&[Vec<f64>]>) -> Found {
        let sorted: Vec<f64> = errors.iter().map(|(error, _)| *error).collect();
        let value = quantile(&sorted, share);
        let draws = self.resampling.as_ref().map_or(Vec::new(), |resampling| resampling.of_quantile(errors, share));
        let noise: Option<Vec<f64>> = noises.map(|noises| noises.iter().filter_map(|noise| quantile(noise, share)).collect());
        let noise_floor = noise.as_ref().and_then(|noise| super::mean(noise.iter().copied()));
        let most_of_noise = noise.and_then(|noise| middle(&noise)).map(|[_, high]| high);
        let is_noise = value.zip(most_of_noise).is_some_and(|(value, noise)| noise > 0.0 && value <= noise);
        let interval = middle(&draws).map(|[low, high]| Interval { low: low.max(0.0), high, noise_floor, below_noise: is_noise });
        Found { value, interval, draws }
    }

    /// The largest |x − r|; its interval holds that of the picture without noise, as all pixels' normal noise is bounded at once.
    pub fn largest(&self) -> Option<(LargestError, Found)> {
        let Samples { all, mean, variance, .. } = self.samples;
        let worst = all.iter().reduce(|worst, next| if next.difference().abs() > worst.difference().abs() { next } else { worst })?;
        let over_mean = worst.difference() / mean;
        let [x, y] = self.samples.place_in_test(worst);
        let deviations = two_sided((1.0 - CONFIDENCE) / all.len() as f64);
        let most = |sign: f64| all.iter().map(|s| (s.difference().abs() + sign * deviations * s.variance.sqrt()) / mean).fold(0.0, f64::max);
        let (low, high) = (most(-1.0), most(1.0));
        let interval = variance.map(|_| {
            let [low, high] = if low == 0.0 {
                [-high, high]
            } else if over_mean < 0.0 {
                [-high, -low]
            } else {
                [low, high]
            };
            Interval { low, high, noise_floor: None, below_noise: low < 0.0 && high > 0.0 }
        });
        let found = Found { value: Some(over_mean), interval, draws: Vec::new() };
        Some((LargestError { x, y, test: worst.x, reference: worst.r, over_mean }, found))
    }
}

/// The root of a number's size, with its sign.
fn signed_root(value: f64) -> f64 {
    value.abs().sqrt().copysign(value)
}

/// Means over a block that is whole.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::measure) struct Block {
    /// Its first pixel, by its place in the reference.
    pub at: usize,
    /// The tested luminance.
    pub x: f64,
    /// The reference's.
    pub r: f64,
    /// The variance of `r`, as if those of pixels were independent; 0 where it is not known.
    pub variance: f64,
}

impl Block {
    fn error(&self) -> f64 {
        ((self.x - self.r) / self.r).abs()
    }
}

/// The blocks that are filled by surface.
pub(super) fn blocks(samples: &Samples) -> Vec<Block> {
    let [width, height] = samples.size;
    let side = block_side(samples.size);
    let mut of_pixel: Vec<Option<&Sample>> = vec![None; width as usize * height as usize];
    samples.all.iter().for_each(|sample| of_pixel[sample.at] = Some(sample));
    let share = f64::from(side * side).recip();
    let whole = |[x, y]: [u32; 2]| {
        let mut pixels = (y..y + side).flat_map(|row| (x..x + side).map(move |column| (row * width + column) as usize));
        let at = (y * width + x) as usize;
        let add = |sum: Block, s: &Sample| Block { at, x: sum.x + s.x, r: sum.r + s.r, variance: sum.variance + s.variance };
        let sum = pixels.try_fold(Block::default(), |sum, pixel| of_pixel[pixel].map(|sample| add(sum, sample)))?;
        Some(Block { at, x: share * sum.x, r: share * sum.r, variance: share * share * sum.variance })
    };
    places(samples, side).into_iter().filter_map(whole).collect()
}

/// The first column and row of each block of that side which no border cuts, of the picture's or of a window's.
fn places(samples: &Samples, side: u32) -> Vec<[u32; 2]> {
    let within = |[left, top]: [u32; 2], [width, height]: [u32; 2]| {
        let rows = (0..height / side).map(move |row| top + row * side);
        rows.flat_map(move |y| (0..width / side).map(move |column| [left + column * side, y]))
    };
    match &samples.windows {
        None => within([0, 0], samples.size).collect(),
        Some(windows) => windows.corners().iter().flat_map(|corner| within(*corner, [windows::SIDE; 2])).collect(),
    }
}

/// The errors of blocks of a picture without error, from the smallest, in many pictures of the reference's noise.
fn noises(blocks: &[Block]) -> Vec<Vec<f64>> {
    let mut stream = Stream(1);
    let mut picture = || {
        let mut errors: Vec<f64> = blocks.iter().map(|block| (block.variance.sqrt() / block.r * stream.normal()).abs()).collect();
        errors.sort_by(f64::total_cmp);
        errors
    };
    (0..NOISES).map(|_| picture()).collect()
}
