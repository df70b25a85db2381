//! The bootstrap: the picture's blocks are drawn anew, with replacement, and each draw has another error. Errors of neighbours go together, so blocks
//! and not pixels are drawn; sums of blocks are all that a draw needs (Efron 1979, Künsch 1989).
//!
//! The same seed draws the same blocks for every picture that one reference judges, so that differences between two are those of pairs.

use super::block_side;
use super::interval::middle;
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

/// The blocks of some pixels, and how often each draw has each of them.
pub(super) struct Resampling {
    side: u32,
    width: u32,
    across: u32,
    /// The number of each block that holds a pixel, by its place.
    numbers: Vec<Option<u32>>,
    blocks: usize,
    /// Draw by draw, block by block.
    counts: Vec<u16>,
}

impl Resampling {
    /// Of these places in a reference of this size; None of too few.
    pub fn of(places: impl Iterator<Item = usize> + Clone, size: [u32; 2]) -> Option<Self> {
        let sides = std::iter::successors(Some(SIDES * block_side(size)), |side| (*side > 1).then_some(side / 2));
        let divided: Vec<Self> = sides.map(|side| Self::divided(places.clone(), size, side)).collect();
        let enough = divided.iter().position(|divided| divided.blocks >= ENOUGH).unwrap_or(divided.len() - 1);
        let found = divided.into_iter().nth(enough).filter(|divided| divided.blocks >= FEWEST)?;
        Some(found.drawn())
    }

    fn divided(places: impl Iterator<Item = usize>, [width, height]: [u32; 2], side: u32) -> Self {
        let across = width.div_ceil(side);
        let mut divided = Self { side, width, across, numbers: vec![None; (across * height.div_ceil(side)) as usize], blocks: 0, counts: Vec::new() };
        places.for_each(|at| {
            let place = divided.place(at);
            divided.numbers[place] = Some(0);
        });
        divided.numbers.iter_mut().flatten().for_each(|number| {
            *number = divided.blocks as u32;
            divided.blocks += 1;
        });
        divided
    }

    fn drawn(mut self) -> Self {
        let mut stream = Stream(self.blocks as u64);
        self.counts = vec![0; RESAMPLES * self.blocks];
        for draw in self.counts.chunks_exact_mut(self.blocks) {
            (0..self.blocks).for_each(|_| draw[stream.below(self.blocks)] += 1);
        }
        self
    }

    fn place(&self, at: usize) -> usize {
        let (x, y) = (at as u32 % self.width, at as u32 / self.width);
        (y / self.side * self.across + x / self.side) as usize
    }

    /// The block of a pixel, by its place in the reference.
    fn block(&self, at: usize) -> usize {
        self.numbers[self.place(at)].map_or(0, |number| number as usize)
    }

    fn draws(&self) -> impl Iterator<Item = &[u16]> {
        self.counts.chunks_exact(self.blocks)
    }

    /// The middle 95 % of the draws, wider by what few blocks hide of their own spread: as Student's quantile is wider than the normal one, and
    /// the spread about the blocks' own mean is too small. None without a draw.
    pub fn middle(&self, draws: &[f64]) -> Option<[f64; 2]> {
        let [low, high] = middle(draws)?;
        let mut sorted = draws.to_vec();
        sorted.sort_by(f64::total_cmp);
        let median = quantile(&sorted, 0.5)?;
        let factor = 1.0 + 1.71 / self.blocks as f64;
        Some([low, high].map(|end| median + factor * (end - median)))
    }

    /// A value of each draw, from the sums over its pixels; a pixel is its place in the reference and what it adds.
    pub fn of_sums<const K: usize>(&self, pixels: impl Iterator<Item = (usize, [f64; K])>, value: impl Fn([f64; K]) -> f64) -> Vec<f64> {
        let mut sums = vec![[0.0; K]; self.blocks];
        for (at, terms) in pixels {
            sums[self.block(at)].iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
        let total = |draw: &[u16]| {
            let mut total = [0.0; K];
            for (count, sum) in draw.iter().zip(&sums).filter(|(count, _)| **count > 0) {
                total.iter_mut().zip(sum).for_each(|(total, term)| *total += f64::from(*count) * term);
            }
            value(total)
        };
        self.draws().map(total).collect()
    }

    /// A quantile of each draw, of values that are sorted and lie in the block of the place beside them; linear between neighbours.
    /// Empty where a draw has none of them.
    pub fn of_quantile(&self, sorted: &[(f64, usize)], share: f64) -> Vec<f64> {
        let blocks: Vec<usize> = sorted.iter().map(|(_, at)| self.block(*at)).collect();
        self.draws().map(|draw| quantile_of(sorted, &blocks, draw, share)).collect::<Option<_>>().unwrap_or_default()
    }
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
