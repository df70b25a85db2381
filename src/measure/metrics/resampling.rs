//! The bootstrap: the picture's blocks are drawn anew, with replacement, and each draw has another error. Errors of neighbours go together, so blocks
//! and not pixels are drawn; sums of blocks are all that a draw needs (Efron 1979, Künsch 1989).
//!
//! The same seed draws the same blocks for every picture that one reference judges, so that differences between two are those of pairs.

use super::block_side;
use crate::measure::statistics::quantile;

/// Draws of each interval.
pub const RESAMPLES: usize = 1000;

/// Sides of the blocks that are drawn, in sides of [`block_side`]: eight along the longer side of the image. Splotches must be small beside them, for
/// what reaches over a border is taken for two errors that know nothing of each other.
const SIDES: u32 = 4;

/// With fewer blocks they are made smaller, as long as they can be.
const ENOUGH: usize = 24;

/// With fewer blocks nothing is said.
const FEWEST: usize = 8;

/// A stream of numbers that its seed alone decides (SplitMix64: Steele, Lea, Flood 2014).
pub(super) struct Stream(pub u64);

impl Stream {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// Below `end`, each as likely.
    fn below(&mut self, end: usize) -> usize {
        ((u128::from(self.next()) * end as u128) >> 64) as usize
    }

    /// In 0..1, neither included.
    fn uniform(&mut self) -> f64 {
        ((self.next() >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    /// Normal, of mean 0 and variance 1 (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let (radius, angle) = ((-2.0 * self.uniform().ln()).sqrt(), std::f64::consts::TAU * self.uniform());
        radius * angle.cos()
    }
}

/// Square blocks that hold some pixels of a reference.
struct Blocks {
    side: u32,
    width: u32,
    across: u32,
    /// The number of each block that holds a pixel, by its place.
    numbers: Vec<Option<u32>>,
    count: usize,
}

impl Blocks {
    fn of(places: impl Iterator<Item = usize>, [width, height]: [u32; 2], side: u32) -> Self {
        let across = width.div_ceil(side);
        let mut blocks = Self { side, width, across, numbers: vec![None; (across * height.div_ceil(side)) as usize], count: 0 };
        places.for_each(|at| {
            let place = blocks.place(at);
            blocks.numbers[place] = Some(0);
        });
        blocks.numbers.iter_mut().flatten().for_each(|number| {
            *number = blocks.count as u32;
            blocks.count += 1;
        });
        blocks
    }

    fn place(&self, at: usize) -> usize {
        let (x, y) = (at as u32 % self.width, at as u32 / self.width);
        (y / self.side * self.across + x / self.side) as usize
    }

    /// The block of a pixel, by its place in the reference.
    fn block(&self, at: usize) -> usize {
        self.numbers[self.place(at)].map_or(0, |number| number as usize)
    }

    /// Of each block the sum over its pixels; a pixel is its place in the reference and what it adds.
    fn sums<const K: usize>(&self, pixels: impl Iterator<Item = (usize, [f64; K])>) -> Vec<[f64; K]> {
        let mut sums = vec![[0.0; K]; self.count];
        pixels.for_each(|(at, terms)| sums[self.block(at)].iter_mut().zip(terms).for_each(|(sum, term)| *sum += term));
        sums
    }
}

/// The variance of what is made of the sums of blocks, as leaving out one block after the other shows it (Efron 1979), but for a factor next to 1.
fn jackknife<const K: usize>(sums: &[[f64; K]], value: impl Fn([f64; K]) -> f64) -> f64 {
    let total = sums.iter().fold([0.0; K], |total, sum| std::array::from_fn(|k| total[k] + sum[k]));
    let left: Vec<f64> = sums.iter().map(|sum| value(std::array::from_fn(|k| total[k] - sum[k]))).collect();
    let mean = left.iter().sum::<f64>() / left.len() as f64;
    left.iter().map(|value| (value - mean).powi(2)).sum()
}

/// The blocks of some pixels, and how often each draw has each of them.
pub(super) struct Resampling {
    blocks: Blocks,
    /// Of half the side, where that is a pixel or more.
    halves: Option<Blocks>,
    /// Draw by draw, block by block.
    counts: Vec<u16>,
}

impl Resampling {
    /// Of these places in a reference of this size; None of too few.
    pub fn of(places: impl Iterator<Item = usize> + Clone, size: [u32; 2]) -> Option<Self> {
        let divided = |side| Blocks::of(places.clone(), size, side);
        let mut blocks = divided(SIDES * block_side(size));
        while blocks.count < ENOUGH && blocks.side > 1 {
            blocks = divided(blocks.side / 2);
        }
        let halves = (blocks.side > 1).then(|| divided(blocks.side / 2));
        (blocks.count >= FEWEST).then(|| Self { counts: draw(blocks.count), blocks, halves })
    }

    fn draws(&self) -> impl Iterator<Item = &[u16]> {
        self.counts.chunks_exact(self.blocks.count)
    }

    /// A value of each draw, from the sums over its pixels; a pixel is its place in the reference and what it adds.
    pub fn of_sums<const K: usize>(&self, pixels: impl Iterator<Item = (usize, [f64; K])> + Clone, value: impl Fn([f64; K]) -> f64) -> Vec<f64> {
        let sums = self.blocks.sums(pixels.clone());
        let total = |draw: &[u16]| {
            let mut total = [0.0; K];
            for (count, sum) in draw.iter().zip(&sums).filter(|(count, _)| **count > 0) {
                total.iter_mut().zip(sum).for_each(|(total, term)| *total += f64::from(*count) * term);
            }
            value(total)
        };
        self.widened(self.draws().map(total).collect(), self.reach(pixels, &sums, &value))
    }

    /// How much wider a spread is than blocks show, as errors go on across their borders. What blocks miss is inverse to their side, so the variances that
    /// whole and half blocks show tell it. Beyond 1.5 the blocks know too little.
    fn reach<const K: usize>(&self, pixels: impl Iterator<Item = (usize, [f64; K])>, sums: &[[f64; K]], value: impl Fn([f64; K]) -> f64) -> f64 {
        let whole = jackknife(sums, &value);
        let Some(halves) = self.halves.as_ref().filter(|_| whole > 0.0) else { return 1.0 };
        (2.0 - jackknife(&halves.sums(pixels), &value) / whole).clamp(1.0, 2.25).sqrt()
    }

    /// The draws, farther from their middle by what few blocks hide of their own spread, as Student's quantile is wider than the normal one and the spread
    /// about the blocks' own mean is too small; and by `reach`.
    fn widened(&self, mut draws: Vec<f64>, reach: f64) -> Vec<f64> {
        let mut sorted = draws.clone();
        sorted.sort_by(f64::total_cmp);
        if let Some(median) = quantile(&sorted, 0.5) {
            let factor = reach * (1.0 + 1.71 / self.blocks.count as f64);
            draws.iter_mut().for_each(|value| *value = median + factor * (*value - median));
        }
        draws
    }

    /// A quantile of each draw, of values that are sorted and lie in the block of the place beside them; linear between neighbours.
    /// Empty where a draw has none of them.
    pub fn of_quantile(&self, sorted: &[(f64, usize)], share: f64) -> Vec<f64> {
        let blocks: Vec<usize> = sorted.iter().map(|(_, at)| self.blocks.block(*at)).collect();
        let draws = self.draws().map(|draw| quantile_of(sorted, &blocks, draw, share)).collect::<Option<_>>();
        // A quantile moves as the share of values above it does.
        let whole = quantile(&sorted.iter().map(|(value, _)| *value).collect::<Vec<_>>(), share).unwrap_or_default();
        let above = sorted.iter().map(|(value, at)| (*at, [f64::from(*value > whole), 1.0]));
        self.widened(draws.unwrap_or_default(), self.reach(above.clone(), &self.blocks.sums(above), |[above, all]| above / all))
    }
}

/// How often each draw has each of so many blocks.
fn draw(blocks: usize) -> Vec<u16> {
    let mut stream = Stream(blocks as u64);
    let mut counts = vec![0; RESAMPLES * blocks];
    for draw in counts.chunks_exact_mut(blocks) {
        (0..blocks).for_each(|_| draw[stream.below(blocks)] += 1);
    }
    counts
}

/// The quantile of values of which each is there as often as its block was drawn; None where none is.
fn quantile_of(sorted: &[(f64, usize)], blocks: &[usize], draw: &[u16], share: f64) -> Option<f64> {
    let count: usize = blocks.iter().map(|block| usize::from(draw[*block])).sum();
    let place = share * count.checked_sub(1)? as f64;
    let (mut below, mut before) = (None, 0);
    for ((value, _), block) in sorted.iter().zip(blocks) {
        before += usize::from(draw[*block]);
        if below.is_none() && before as f64 > place.floor() {
            below = Some(*value);
        }
        if before as f64 > place.ceil() {
            return below.map(|below| below + (value - below) * place.fract());
        }
    }
    None
}
