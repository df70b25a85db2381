//! An index over records by where they reach: what is the irradiance at any point and normal? The cells of a level are cubes of one size, a power of two; a record
//! is listed in the cells that it touches of the level whose cells are two to four times as wide as it reaches, eight at most, so that a point looks into one cell
//! a level. Cells are found by a hash, and what two of them share is told apart by the level and by the record's own weight. One buffer holds it all, as
//! `shaders/lib/irradiance_field/records.wgsl` reads it: [`HEADER`] words, where the list of each hash ends, the lists, the records; then near lists, made in the same
//! way for smaller cells, of the records that may count in a part of a cell: the device finds those of a point by them, the host by a tree.

use super::eight_records::{Apart, Standing};
use super::random::hash;
use super::record_tree::{Leaf, Region, Tree};
use super::vectors::{LANES, Vectors};
use super::weight::{Reaching, Record, Rule};
use fearless_simd::{Level, Select, Simd, dispatch, f32x8, prelude::*, u32x8};
use glam::{IVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Words before the lists' ends: exponent of the smallest cells' edge, a bit for each level that there is, number of hashes, number of records.
pub const HEADER: usize = 4;

/// Most levels; records that validity radius less than the smallest cells stand for are listed there.
pub const LEVELS: i32 = 24;

/// A level that holds less than this share of the records is not worth a look at each point: the next larger cells take them.
pub const FEW: u32 = 16;

/// How many times as far records reach where none counts, short of obstacles on their surface; past those they count `LITTLE`.
pub const COARSER: f32 = 3.0;

/// What a record counts that may be hidden by an obstacle: only where no other does.
const LITTLE: f32 = 1e-8;

/// Words of a record.
pub const RECORD_WORDS: usize = 40;

/// Which cells records are listed in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cells {
    /// Two to four times as wide as a record reaches: those that its reach touches.
    Far,
    /// One to two times as wide: those in parts of which a record may count, where normals differ no more than by this accuracy.
    Near { accuracy: f32 },
}

impl Cells {
    /// Most that list a record.
    const fn most(self) -> usize {
        match self {
            Self::Far => 8,
            Self::Near { .. } => 27,
        }
    }

    /// The exponent of the edge of those that list a record of some reach.
    fn edge_exponent(self, reach: f32) -> i32 {
        exponent(if self == Self::Far { 2.0 * reach } else { reach })
    }
}

/// The level stands in the bits of an entry from here on, the record's number below.
pub const LEVEL_BIT: u32 = 24;

/// Reaches are taken for longer by this factor, for what the devices round differently.
const LONGER: f32 = 1.0001;

/// Where the parts of an index for so many records stand [words].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// A power of two.
    pub hashes: usize,
    /// The first entry's place.
    pub entries: usize,
    /// The first record's place, a multiple of four.
    pub records: usize,
    pub near: NearLayout,
    /// All of them.
    pub words: usize,
}

/// Where the parts of the near lists stand [words].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NearLayout {
    /// Their header's place.
    pub header: usize,
    /// A power of two.
    pub hashes: usize,
    /// The first entry's place.
    pub entries: usize,
}

impl Layout {
    /// For at most 2²⁴ records.
    pub fn of(capacity: usize) -> Self {
        let hashes = (2 * capacity).next_power_of_two().max(4);
        let entries = HEADER + hashes;
        let records = entries + (Cells::Far.most() * capacity).next_multiple_of(4);
        let (header, near_hashes) = (records + RECORD_WORDS * capacity, (8 * capacity).next_power_of_two().max(4));
        let near = NearLayout { header, hashes: near_hashes, entries: header + HEADER + near_hashes };
        let words = (near.entries + Cells::Near { accuracy: 1.0 }.most() * capacity).next_multiple_of(4);
        Self { hashes, entries, records, near, words }
    }
}

/// Which records are listed where.
pub struct Lists {
    pub levels: Levels,
    /// Of each hash, the place behind its last entry.
    pub ends: Vec<u32>,
    /// A record's number and its level; ascending within a list.
    pub entries: Vec<u32>,
}

/// Sizes of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Levels {
    /// Exponent of the edge of the smallest cells.
    pub lowest: i32,
    /// A bit for each level that there is, from the smallest cells on.
    pub there: u32,
}

impl Levels {
    /// Where there is no record.
    pub const NONE: Self = Self { lowest: 0, there: 0 };

    /// For cells whose edges' exponents are these.
    fn of(exponents: &[i32]) -> Self {
        let Some(highest) = exponents.iter().copied().max() else { return Self::NONE };
        let lowest = highest - LEVELS + 1;
        let mut held = [0u32; LEVELS as usize];
        exponents.iter().for_each(|exponent| held[(exponent - lowest).max(0) as usize] += 1);
        let (mut there, mut waiting) = (1u32 << (LEVELS - 1), 0);
        for (level, held) in held.iter().enumerate() {
            waiting += held;
            if waiting * FEW >= exponents.len() as u32 {
                there |= 1 << level;
                waiting = 0;
            }
        }
        let first = there.trailing_zeros();
        Self { lowest: lowest + first as i32, there: there >> first }
    }

    /// The first words of an index over so many records.
    pub fn header(self, hashes: usize, records: u32) -> [u32; HEADER] {
        [self.lowest as u32, self.there, hashes as u32, records]
    }

    /// The smallest level whose cells have at least an edge of this exponent.
    fn level(self, exponent: i32) -> u32 {
        let least = (exponent - self.lowest).max(0) as u32;
        least + (self.there >> least).trailing_zeros()
    }
}

impl Lists {
    /// Linear in the records.
    pub fn of(records: &[Reaching<'_>], cells: Cells, hashes: usize) -> Self {
        let reach = |record: &Reaching<'_>| record.longest_validity_radius() * LONGER;
        let exponents: Vec<i32> = records.iter().map(|record| cells.edge_exponent(reach(record))).collect();
        let levels = Levels::of(&exponents);
        let listed = |(number, (record, exponent)): (u32, (&Reaching<'_>, &i32))| {
            let level = levels.level(*exponent);
            listed(record, reach(record), cells, [levels.lowest, level as i32], hashes).into_iter().map(move |hash| (hash, number | level << LEVEL_BIT))
        };
        let touched: Vec<(u32, u32)> = (0..).zip(records.iter().zip(&exponents)).flat_map(listed).collect();
        let mut ends = vec![0u32; hashes];
        touched.iter().for_each(|(hash, _)| ends[*hash as usize] += 1);
        let mut next = Vec::with_capacity(hashes);
        let mut sum = 0;
        for end in &mut ends {
            next.push(sum);
            sum += *end;
            *end = sum;
        }
        let mut entries = vec![0; touched.len()];
        for (hash, entry) in touched {
            let place = &mut next[hash as usize];
            entries[*place as usize] = entry;
            *place += 1;
        }
        Self { levels, ends, entries }
    }

    /// Of the cell of each level that a point is in, the level and the entries, among which are those of other cells with the same hash.
    pub fn at(&self, point: Vec3) -> impl Iterator<Item = (u32, &[u32])> {
        let smallest = cell(point, self.levels.lowest);
        (0..LEVELS as u32).filter(|level| self.levels.there >> level & 1 == 1).map(move |level| {
            let hash = hash_of(smallest >> level as i32, level, self.ends.len()) as usize;
            let first = if hash == 0 { 0 } else { self.ends[hash - 1] };
            (level, &self.entries[first as usize..self.ends[hash] as usize])
        })
    }

    /// Their header, their ends and themselves, for an index over so many records.
    pub fn words(&self, records: usize) -> Vec<u32> {
        let header = self.levels.header(self.ends.len(), records as u32);
        header.iter().chain(&self.ends).chain(&self.entries).copied().collect()
    }
}

/// The hashes of the cells of a level that list a record, each once.
fn listed(record: &Reaching<'_>, reach: f32, cells: Cells, [lowest, level]: [i32; 2], hashes: usize) -> Vec<u32> {
    let centre = record.record().position;
    let (first, last) = (cell(centre - reach, lowest) >> level, cell(centre + reach, lowest) >> level);
    let edge = f32::from_bits(((127 + lowest + level) as u32) << 23);
    let region = match cells {
        Cells::Far => None,
        Cells::Near { accuracy } => Some(Region::reaching(record, reach, accuracy)),
    };
    let counts_within = |at: IVec3| region.as_ref().is_none_or(|region| region.counts_within((at.as_vec3() + 0.5) * edge, 0.5 * edge));
    let mut listed = Vec::with_capacity(cells.most());
    for z in first.z..=last.z {
        for y in first.y..=last.y {
            for x in first.x..=last.x {
                let hash = hash_of(IVec3::new(x, y, z), level as u32, hashes);
                if listed.len() < cells.most() && counts_within(IVec3::new(x, y, z)) && !listed.contains(&hash) {
                    listed.push(hash);
                }
            }
        }
    }
    listed
}

/// The exponent of the least power of two that is no less than a number; within what cells can be counted in.
pub(super) fn exponent(number: f32) -> i32 {
    let bits = number.clamp(1e-30, 1e30).to_bits();
    (bits >> 23) as i32 - 127 + i32::from(bits & 0x7f_ffff != 0)
}

/// The cell that a point is in, of those whose edge is a power of two.
#[inline(always)]
pub(super) fn cell(point: Vec3, exponent: i32) -> IVec3 {
    (point * f32::from_bits(((127 - exponent) as u32) << 23)).floor().clamp(Vec3::splat(-2e9), Vec3::splat(2e9)).as_ivec3()
}

#[inline(always)]
fn hash_of(cell: IVec3, level: u32, hashes: usize) -> u32 {
    let [x, y, z] = cell.to_array().map(|number| number as u32);
    let mixed = x.wrapping_mul(PRIMES[0]) ^ y.wrapping_mul(PRIMES[1]) ^ z.wrapping_mul(PRIMES[2]) ^ level.wrapping_mul(PRIMES[3]);
    hash(mixed) & (hashes as u32 - 1)
}

/// What tells the axes and the levels apart.
const PRIMES: [u32; 4] = [2_654_435_761, 2_246_822_519, 3_266_489_917, 668_265_263];

/// Records and their lists, to be asked for the irradiance at points.
pub struct RecordIndex {
    records: Vec<Record>,
    rule: Rule,
    light: RecordLight,
    found: Arc<Found>,
}

/// What finds records, as long as they stand where they do.
struct Found {
    tree: Tree,
    levels: Levels,
    /// Where the blocks of each hash start, and their end.
    starts: Vec<u32>,
    /// The lists, eight records side by side.
    blocks: Vec<Block>,
}

/// The light of records, as points look at them one by one, and what tells how much they weigh.
pub struct RecordLight {
    irradiance: Vec<Vec3>,
    /// Position, normal, stretch, and how far each reaches: the validity radius and the confinement.
    stands: Vec<[Vec3; 4]>,
    is_flat: bool,
}

impl RecordLight {
    pub fn new(records: &[Record], rule: &Rule) -> Self {
        let is_flat = records.iter().all(|record| [record.rotation, record.translation] == [[Vec3::ZERO; 3]; 2]);
        let reach = |record: &Record| Vec3::new(rule.reaching(record).validity_radius(), record.confinement, 0.0);
        let stand = |record: &Record| [record.position, record.normal, record.stretch, reach(record)];
        Self { irradiance: records.iter().map(|record| record.irradiance).collect(), stands: records.iter().map(stand).collect(), is_flat }
    }

    /// Whether records foretell what they hold themselves, as they have no gradients.
    pub fn is_flat(&self) -> bool {
        self.is_flat
    }
}

/// What tells how much eight records weigh.
struct Block {
    standing: Standing,
    /// Squares of one over how many times as far each reaches, [`COARSER`] or up to an obstacle, and past all obstacles.
    in_sight: [f32; LANES],
    past_all: [f32; LANES],
    number: [u32; LANES],
    /// Of the cells that a record is listed in; of lanes without a record none.
    level: [u32; LANES],
}

impl Block {
    const EMPTY: Self = Self { standing: Standing::NOWHERE, in_sight: [0.0; LANES], past_all: [0.0; LANES], number: [0; LANES], level: [u32::MAX; LANES] };

    fn set(&mut self, lane: usize, entry: u32, reaching: &Reaching<'_>) {
        let record = reaching.record();
        self.standing.set(lane, reaching, coarser_stretch(record));
        self.in_sight[lane] = record.confinement.max(1.0 / COARSER).powi(2);
        self.past_all[lane] = (1.0 - record.stretch.length_squared()) / (COARSER * COARSER);
        (self.number[lane], self.level[lane]) = (entry & ((1 << LEVEL_BIT) - 1), entry >> LEVEL_BIT);
    }

    /// As [`Reaching::local_weight`] of compact weights, of eight records that reach farther, see [`COARSER`]; None where none counts.
    #[inline(always)]
    fn weights<S: Simd>(&self, simd: S, level: u32, at: [Vectors<S>; 2], accuracy: f32) -> Option<f32x8<S>> {
        let zero = f32x8::splat(simd, 0.0);
        let Apart { square, across, per_area, turned, is_level } = self.standing.apart(simd, at, accuracy, COARSER);
        let apart = across * (per_area * f32x8::load_array_ref(simd, &self.in_sight));
        let past_all = square * (per_area * f32x8::load_array_ref(simd, &self.past_all));
        let may = u32x8::load_array_ref(simd, &self.level).simd_eq(level) & turned.simd_le(1.0) & is_level;
        let [in_sight, counts] = [may & apart.simd_le(1.0), may & (apart.simd_le(1.0) | past_all.simd_le(1.0))];
        // Most are out of reach: their roots are not worth taking.
        if counts.to_bitmask() == 0 {
            return None;
        }
        let nearer = in_sight.select(apart, past_all);
        let least = in_sight.select(per_area, per_area * LITTLE);
        Some(counts.select((1.0 - nearer.sqrt() - turned.sqrt()).max(zero) * least, zero))
    }
}

/// That of the ellipse along which a record reaches [`COARSER`] times as far: where an obstacle keeps the shorter axis as it is, the longer one grows.
fn coarser_stretch(record: &Record) -> Vec3 {
    let square = record.stretch.length_squared();
    if square == 0.0 || record.confinement < 1.0 {
        return record.stretch;
    }
    let coarser = 1.0 - ((1.0 - square) / (COARSER * COARSER)).max(0.01);
    record.stretch * (coarser / square).sqrt()
}

impl RecordIndex {
    /// Of the words of the buffer; `records` are those in it. Weights are compact.
    pub fn new(words: &[u32], layout: Layout, records: Vec<Record>, rule: Rule) -> Self {
        let found = Arc::new(Found::new(words, layout, &records, &rule));
        Self { light: RecordLight::new(&records, &rule), records, rule, found }
    }

    /// That of records which stand where these do, whose light may be new; None where they stand elsewhere.
    pub fn lit(&self, records: &[Record]) -> Option<Self> {
        let light = RecordLight::new(records, &self.rule);
        (light.stands == self.light.stands).then(|| Self { light, records: records.to_vec(), rule: self.rule, found: self.found.clone() })
    }

    /// The weighted mean of what the records that count at a point foretell, and the sum of their weights [W/m²]. Where none counts, that of the records listed
    /// there as if they reached farther: see [`COARSER`]; 0 where none does even so.
    #[inline(always)]
    pub fn estimate<S: Simd>(&self, simd: S, position: Vec3, normal: Vec3) -> (Vec3, f32) {
        self.estimate_in(simd, self.found.tree.near(position, normal), position, normal)
    }

    /// Those of points side by side, without the weights.
    #[inline(always)]
    pub fn estimates<S: Simd, const POINTS: usize>(&self, simd: S, points: &[Option<[Vec3; 2]>; POINTS], found: &mut [Vec3; POINTS]) {
        let mut leaves = [Leaf::NONE; POINTS];
        for (leaf, point) in leaves.iter_mut().zip(points) {
            if let Some([position, normal]) = point {
                *leaf = self.found.tree.near(*position, *normal);
            }
        }
        // All are fetched before any is worked on, so that memory is waited for once.
        std::hint::black_box(leaves.iter().map(|leaf| leaf.touched()).sum::<f32>());
        for ((found, leaf), point) in found.iter_mut().zip(leaves).zip(points) {
            if let Some([position, normal]) = point {
                *found = self.estimate_in(simd, leaf, *position, *normal).0;
            }
        }
    }

    #[inline(always)]
    fn estimate_in<S: Simd>(&self, simd: S, leaf: Leaf<'_>, position: Vec3, normal: Vec3) -> (Vec3, f32) {
        let (mut light, mut all) = (Vec3::ZERO, 0.0);
        let mut add = |number: u32, weight: f32| {
            light += weight * self.foretold(number, position, normal);
            all += weight;
        };
        if !self.see_near(simd, leaf, [position, normal], &mut add) {
            self.found.see_listed(simd, [position, normal], self.rule.accuracy, &mut add);
        }
        if all > 0.0 { (light / all, all) } else { (Vec3::ZERO, 0.0) }
    }

    /// What a record tells of a point.
    #[inline(always)]
    fn foretold(&self, number: u32, position: Vec3, normal: Vec3) -> Vec3 {
        if self.light.is_flat { self.light.irradiance[number as usize] } else { self.rule.estimate(&self.records[number as usize], position, normal) }
    }

    /// Shows the records of a leaf that count at a point, with their weights; whether there is any.
    #[inline(always)]
    fn see_near<S: Simd>(&self, simd: S, leaf: Leaf<'_>, point: [Vec3; 2], see: &mut impl FnMut(u32, f32)) -> bool {
        let at = point.map(|vector| Vectors::splat(simd, vector));
        let mut any = false;
        for block in leaf.blocks() {
            any |= see_lanes(block.weights(simd, at, self.rule.accuracy), &block.numbers, see);
        }
        any
    }

    /// The records that [`Self::estimate`] takes the mean of at a point, and the share of each.
    #[inline(always)]
    fn shares<S: Simd>(&self, simd: S, position: Vec3, normal: Vec3, shares: &mut Vec<Share>) {
        let first = shares.len();
        let mut push = |number, weight| shares.push((number, weight));
        if !self.see_near(simd, self.found.tree.near(position, normal), [position, normal], &mut push) {
            self.found.see_listed(simd, [position, normal], self.rule.accuracy, &mut push);
        }
        let all: f32 = shares[first..].iter().map(|(_, weight)| weight).sum();
        shares[first..].iter_mut().for_each(|(_, share)| *share /= all);
    }

    /// The same for a point alone.
    pub fn estimate_at(&self, position: Vec3, normal: Vec3) -> (Vec3, f32) {
        dispatch!(Level::new(), simd => self.estimate(simd, position, normal))
    }
}

impl Found {
    fn new(words: &[u32], layout: Layout, records: &[Record], rule: &Rule) -> Self {
        let reaching: Vec<Reaching<'_>> = records.iter().map(|record| rule.reaching(record)).collect();
        let (ends, entries) = (&words[HEADER..layout.entries], &words[layout.entries..layout.records]);
        let (mut starts, mut blocks, mut first) = (Vec::with_capacity(layout.hashes + 1), Vec::new(), 0);
        for end in ends {
            starts.push(blocks.len() as u32);
            for eight in entries[first..*end as usize].chunks(LANES) {
                let mut block = Block::EMPTY;
                eight.iter().enumerate().for_each(|(lane, entry)| block.set(lane, *entry, &reaching[(entry & ((1 << LEVEL_BIT) - 1)) as usize]));
                blocks.push(block);
            }
            first = *end as usize;
        }
        starts.push(blocks.len() as u32);
        Self { tree: Tree::new(&reaching, rule.accuracy), levels: Levels { lowest: words[0] as i32, there: words[1] }, starts, blocks }
    }

    /// Shows the records listed at a point that count there were they to reach [`COARSER`] times as far, with their weights.
    #[inline(always)]
    fn see_listed<S: Simd>(&self, simd: S, [position, normal]: [Vec3; 2], accuracy: f32, see: &mut impl FnMut(u32, f32)) {
        let at = [position, normal].map(|vector| Vectors::splat(simd, vector));
        let smallest = cell(position, self.levels.lowest);
        let mut there = self.levels.there;
        while there != 0 {
            let level = there.trailing_zeros();
            there &= there - 1;
            let hash = hash_of(smallest >> level, level, self.starts.len() - 1) as usize;
            for block in &self.blocks[self.starts[hash] as usize..self.starts[hash + 1] as usize] {
                if let Some(weights) = block.weights(simd, level, at, accuracy) {
                    see_lanes(weights, &block.number, see);
                }
            }
        }
    }
}

/// Shows those of eight records that count; whether there is any.
#[inline(always)]
fn see_lanes<S: Simd>(weights: f32x8<S>, numbers: &[u32; LANES], see: &mut impl FnMut(u32, f32)) -> bool {
    let counting = weights.simd_gt(0.0).to_bitmask();
    let (mut left, weights) = (counting, weights.to_array());
    while left != 0 {
        let lane = left.trailing_zeros() as usize % LANES;
        left &= left - 1;
        see(numbers[lane], weights[lane]);
    }
    counting != 0
}

/// The number of a record, and its share of a mean.
type Share = (u32, f32);

/// Of a list of points, which records count at each, and how much: asked once for light that is new in each round.
#[derive(Default)]
pub struct Shares {
    /// Of each point, where its shares begin, and one past the last.
    starts: Vec<u32>,
    shares: Vec<Share>,
    /// What the weights depend on, of each record.
    stands: Vec<[Vec3; 4]>,
}

impl Shares {
    /// Of records that have no gradients: with them a point's light is no sum of theirs.
    pub fn of(index: &RecordIndex, points: &[[Vec3; 2]]) -> Self {
        const POINTS: usize = 4096;
        let of_chunk = |chunk: &[[Vec3; 2]]| {
            dispatch!(Level::new(), simd => {
                let (mut counts, mut shares) = (Vec::with_capacity(chunk.len()), Vec::with_capacity(4 * chunk.len()));
                for [position, normal] in chunk {
                    let before = shares.len();
                    index.shares(simd, *position, *normal, &mut shares);
                    counts.push((shares.len() - before) as u32);
                }
                (counts, shares)
            })
        };
        let parts: Vec<(Vec<u32>, Vec<Share>)> = points.par_chunks(POINTS).map(of_chunk).collect();
        let (mut starts, mut shares) = (vec![0], Vec::with_capacity(parts.iter().map(|(_, shares)| shares.len()).sum()));
        let mut end = 0;
        for (counts, more) in parts {
            starts.extend(counts.into_iter().map(|count| {
                end += count;
                end
            }));
            shares.extend(more);
        }
        Self { starts, shares, stands: index.light.stands.clone() }
    }

    /// Whether these are the shares of records: they stand where those stood, reach as far, and have no gradients.
    pub fn are_of(&self, light: &RecordLight) -> bool {
        light.is_flat && self.stands == light.stands
    }

    /// What records tell at a point, by its number [W/m²].
    pub fn irradiance(&self, light: &RecordLight, point: usize) -> Vec3 {
        let of_point = &self.shares[self.starts[point] as usize..self.starts[point + 1] as usize];
        of_point.iter().fold(Vec3::ZERO, |sum, (number, share)| sum + light.irradiance[*number as usize] * *share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{
        radius::Reach,
        random::{hash, unit},
        weight::Weighting,
    };
    use proptest::prelude::*;

    fn number(at: u32) -> f32 {
        2.0 * unit(hash(at)) - 1.0
    }

    fn point(at: u32) -> Vec3 {
        Vec3::new(number(3 * at), number(3 * at + 1), number(3 * at + 2))
    }

    fn record(at: u32, scale: f32) -> Record {
        Record {
            position: point(at) * scale,
            radius: scale * 2.0f32.powf(4.0 * number(at + 77) - 3.0),
            normal: point(at + 1000).normalize(),
            minimum_distance: 1e30,
            irradiance: Vec3::new(1.0, 2.0, 3.0) * (2.0 + number(at + 5)),
            footprint: 0.05 * scale,
            error: Vec3::ZERO,
            rotation: [point(at + 2000); 3],
            translation: [point(at + 3000) / scale; 3],
            stretch: if at.is_multiple_of(3) { point(at + 4000) * 0.5 } else { Vec3::ZERO },
            relative_gradient: 1.0 / scale,
            fineness: 1.0,
            confinement: 0.0,
        }
    }

    fn rule() -> Rule {
        Rule { weighting: Weighting::Compact, accuracy: 0.7, spacing: [1.0, 50.0], nearest: 0.7, change: 1e6, overlap: 0.2, contrast: 1e6, finest_spacing: 1.0 }
    }

    /// Of all records, asked one by one; None where none counts.
    fn by_all(records: &[Record], position: Vec3, normal: Vec3) -> Option<(Vec3, f32)> {
        let rule = rule();
        let weighted = records.iter().map(|record| (rule.reaching(record).local_weight(position, normal), record)).filter(|(weight, _)| *weight > 0.0);
        let (sum, weights) =
            weighted.fold((Vec3::ZERO, 0.0), |(sum, weights), (weight, record)| (sum + rule.estimate(record, position, normal) * weight, weights + weight));
        (weights > 0.0).then(|| (sum / weights, weights))
    }

    /// The words of an index, and its layout.
    fn words(records: &[Record], capacity: usize) -> (Vec<u32>, Layout) {
        let (layout, rule) = (Layout::of(capacity), rule());
        let reaching: Vec<_> = records.iter().map(|record| rule.reaching(record)).collect();
        let mut words = Lists::of(&reaching, Cells::Far, layout.hashes).words(records.len());
        words.resize(layout.records, 0);
        (words, layout)
    }

    proptest! {
        #[test]
        fn any_point_finds_what_a_look_at_all_records_finds(count in 0usize..400, first in 0u32..100_000, scale in -12i32..12) {
            let scale = 3.0f32.powi(scale);
            let records: Vec<Record> = (0..count as u32).map(|at| record(first + at, scale)).collect();
            let (words, layout) = words(&records, count.max(1));
            let index = RecordIndex::new(&words, layout, records.clone(), rule());
            for at in 0..200 {
                let (position, normal) = (point(first + 7_000 + at) * scale * 1.2, point(first + 9_000 + at).normalize());
                let Some((expected, weights)) = by_all(&records, position, normal) else { continue };
                let (found, of_found) = index.estimate_at(position, normal);
                prop_assert!((of_found - weights).abs() <= 1e-3 * weights + 1e-6 / (scale * scale), "{of_found} {weights}");
                prop_assert!((found - expected).length() <= 1e-4 * expected.length(), "{found} {expected}");
            }
        }
    }

    /// The near list of a point's cell names each record that counts there, once.
    #[test]
    fn near_lists_name_all_that_counts() {
        let (records, rule) = ((0..400).map(|at| record(at, 1.0)).collect::<Vec<_>>(), rule());
        let reaching: Vec<_> = records.iter().map(|record| rule.reaching(record)).collect();
        let hashes = Layout::of(400).near.hashes;
        let Lists { levels, ends, entries } = Lists::of(&reaching, Cells::Near { accuracy: rule.accuracy }, hashes);
        let listed = |at: Vec3| -> Vec<u32> {
            let of_level = |level: u32| {
                let hash = hash_of(cell(at, levels.lowest) >> level as i32, level, hashes) as usize;
                let first = if hash == 0 { 0 } else { ends[hash - 1] };
                entries[first as usize..ends[hash] as usize]
                    .iter()
                    .filter(move |entry| **entry >> LEVEL_BIT == level)
                    .map(|entry| entry & ((1 << LEVEL_BIT) - 1))
            };
            (0..LEVELS as u32).filter(|level| levels.there >> level & 1 == 1).flat_map(of_level).collect()
        };
        let mut counting = 0;
        for at in 0..4000 {
            let near = &reaching[at as usize % reaching.len()];
            let (way, normal) = (point(7_000 + at).normalize() * near.longest_validity_radius() * 0.9, near.record().normal);
            let position = near.record().position + way - normal * normal.dot(way) * 0.97;
            let there = listed(position);
            for (number, record) in (0..).zip(&reaching) {
                let times = there.iter().filter(|other| **other == number).count();
                assert!(times <= 1);
                if record.local_weight(position, normal) > 0.0 {
                    counting += 1;
                    assert_eq!(times, 1, "{position} {normal}");
                }
            }
        }
        assert!(counting > 1000, "{counting} count");
    }

    #[test]
    fn records_are_found_and_found_once() {
        let records: Vec<Record> = (0..300).map(|at| record(at, 1.0)).collect();
        let (words, layout) = words(&records, 300);
        let index = RecordIndex::new(&words, layout, records.clone(), rule());
        assert!(records.iter().all(|record| index.estimate_at(record.position, record.normal).1 > 0.0));
        assert!(index.found.blocks.iter().flat_map(|block| block.level).filter(|level| *level != u32::MAX).count() <= Cells::Far.most() * 300);
        assert!((2..LEVELS as u32).contains(&index.found.levels.there.count_ones()));
    }

    /// Light that is asked for again is that of the index, also after it has changed; records that stand elsewhere are told.
    #[test]
    fn shares_tell_what_the_index_tells() {
        let flat = |at: u32, light: f32| Record {
            rotation: [Vec3::ZERO; 3],
            translation: [Vec3::ZERO; 3],
            irradiance: Vec3::new(1.0, 2.0, 3.0) * light,
            ..record(at, 1.0)
        };
        let points: Vec<[Vec3; 2]> = (0..10_000).map(|at| [point(at + 500) * 1.1, point(at + 1000).normalize()]).collect();
        let index = |records: Vec<Record>| {
            let (words, layout) = words(&records, 300);
            RecordIndex::new(&words, layout, records, rule())
        };
        let shares = Shares::of(&index((0..300).map(|at| flat(at, 1.0)).collect()), &points);
        let later: Vec<Record> = (0..300).map(|at| flat(at, 2.0 + number(at))).collect();
        let light = RecordLight::new(&later, &rule());
        assert!(shares.are_of(&light));
        let all = index(later);
        for (number, [position, normal]) in points.iter().enumerate() {
            let (found, expected) = (shares.irradiance(&light, number), all.estimate_at(*position, *normal).0);
            assert!((found - expected).length() <= 1e-5 * expected.length(), "{found} {expected}");
        }
        let others =
            [(0..299).map(|at| flat(at, 1.0)).collect(), (1..301).map(|at| flat(at, 1.0)).collect(), (0..300).map(|at| record(at, 1.0)).collect::<Vec<_>>()];
        assert!(others.iter().all(|records| !shares.are_of(&RecordLight::new(records, &rule()))));
    }

    /// Of two records on a floor with a wall between them, a point next to the wall that neither reaches has the light of its own side, however near the other's
    /// is; and that of the other where there is no record on its own.
    #[test]
    fn no_light_comes_past_an_obstacle_where_other_light_does() {
        let beside = |x: f32, y: f32, light: f32| {
            let wall: Vec<Vec3> = (-8..=8).map(|at| Vec3::new(-x, 0.1 * at as f32, 0.0)).collect();
            let Reach { radius, stretch, confinement } = Reach::before(&wall, Vec3::Z, 0.3, 0.02);
            let flat = [Vec3::ZERO; 3];
            let (position, irradiance) = (Vec3::new(x, y, 0.0), Vec3::splat(light));
            Record {
                position,
                radius: 10.0,
                normal: Vec3::Z,
                irradiance,
                footprint: radius,
                stretch,
                confinement,
                rotation: flat,
                translation: flat,
                ..record(0, 1.0)
            }
        };
        let at = Vec3::new(0.02, 0.0, 0.0);
        let told = |records: &[Record], position: Vec3| {
            let (words, layout) = words(records, records.len());
            let rule = Rule { spacing: [1.0; 2], nearest: 1e6, ..rule() };
            RecordIndex::new(&words, layout, records.to_vec(), rule).estimate_at(position, Vec3::Z).0.x
        };
        let (own, other) = (beside(0.2, 0.35, 1.0), beside(-0.05, 0.25, 1000.0));
        let near = told(&[own, other], at);
        assert!((1.0..1.1).contains(&near), "{near}");
        assert!((told(&[other], at) - 1000.0).abs() < 1e-3);
        let open = Record { confinement: 0.0, stretch: Vec3::ZERO, footprint: 0.3, ..other };
        assert!(told(&[own, open], at) > 500.0);
    }

    #[test]
    fn cells_are_powers_of_two() {
        for (number, expected) in [(1.0, 0), (1.1, 1), (2.0, 1), (2.1, 2), (0.5, -1), (0.3, -1), (0.0, -99), (f32::INFINITY, 100)] {
            assert_eq!(exponent(number), expected, "{number}");
        }
        assert_eq!(cell(Vec3::new(1.9, -0.1, 4.0), 1), IVec3::new(0, -1, 2));
        assert_eq!(cell(Vec3::new(1.9, -0.1, 4.0), -1), IVec3::new(3, -1, 8));
    }

    #[test]
    fn without_records_nothing_is_found() {
        let (words, layout) = words(&[], 5);
        assert_eq!(RecordIndex::new(&words, layout, Vec::new(), rule()).estimate_at(Vec3::ONE, Vec3::Z), (Vec3::ZERO, 0.0));
        // As a loop starts all is 0.
        let zeros = vec![0; layout.records];
        assert_eq!(RecordIndex::new(&zeros, layout, Vec::new(), rule()).estimate_at(Vec3::ONE, Vec3::Z), (Vec3::ZERO, 0.0));
    }
}
