//! Which records may count at a point and a normal: for each side that normals face to a grid of octrees, whose leaves list them, so that a point looks at few
//! that do not, eight side by side.

use super::eight_records::{Apart, Standing};
use super::vectors::{LANES, Vectors};
use super::weight::{FRONT_TOLERANCE, Reaching};
use fearless_simd::{Select, Simd, f32x8, prelude::*};
use glam::Vec3;
use rayon::prelude::*;

/// Cells of the grid along each axis.
const GRID: usize = 16;

/// A leaf that lists so few is not divided: as many as are looked at side by side.
const FEW: usize = LANES;

/// A cell is not divided that is less than this share of how far the records in it reach: its parts would list nearly the same.
const SMALL: f32 = 1.0;

/// Most divisions of a cell of the grid.
const DEEPEST: u32 = 16;

/// Cells are taken for larger by this share, for what rounding takes away.
const MARGIN: f32 = 1e-3;

/// Marks a node that has children; the rest of the word is the place of the first of eight. Other nodes are the places of their blocks.
const INNER: u32 = 1 << 31;

/// Trees over records.
pub struct Tree {
    /// For the normals that are nearest to +x, −x, +y, −y, +z, −z.
    sides: [Side; 6],
}

/// Octrees over the records that count for some of the normals of one side.
struct Side {
    corner: Vec3,
    /// Cells of the grid a scene unit, along each axis.
    scale: Vec3,
    /// Those of the grid, then children.
    nodes: Vec<u32>,
    /// The records of leaves. The first has none.
    blocks: Vec<Block>,
}

/// Up to eight records of a leaf.
pub struct Block {
    standing: Standing,
    pub numbers: [u32; LANES],
    /// Whether the next block belongs to the same leaf.
    goes_on: bool,
}

/// The blocks of a leaf, and those of others behind them.
#[derive(Clone, Copy)]
pub struct Leaf<'a>(&'a [Block]);

impl<'a> Leaf<'a> {
    pub const NONE: Self = Self(&[]);

    #[inline(always)]
    pub fn blocks(self) -> impl Iterator<Item = &'a Block> {
        let mut goes_on = true;
        self.0.iter().take_while(move |block| std::mem::replace(&mut goes_on, block.goes_on))
    }

    /// As [`Standing::touched`] of the first block.
    #[inline(always)]
    pub fn touched(self) -> f32 {
        self.0.first().map_or(0.0, |block| block.standing.touched())
    }
}

impl Block {
    const EMPTY: Self = Self { standing: Standing::NOWHERE, numbers: [0; LANES], goes_on: false };

    fn of(records: &[Reaching<'_>], numbers: &[u32]) -> Self {
        let mut block = Self::EMPTY;
        for (lane, number) in numbers.iter().enumerate() {
            let reaching = &records[*number as usize];
            block.standing.set(lane, reaching, reaching.record().stretch);
            block.numbers[lane] = *number;
        }
        block
    }

    /// As [`Reaching::local_weight`] of compact weights.
    #[inline(always)]
    pub fn weights<S: Simd>(&self, simd: S, at: [Vectors<S>; 2], accuracy: f32) -> f32x8<S> {
        let zero = f32x8::splat(simd, 0.0);
        let Apart { across, per_area, turned, is_level, .. } = self.standing.apart(simd, at, accuracy, 1.0);
        let apart = across * per_area;
        let counts = is_level & apart.simd_le(1.0) & turned.simd_le(1.0);
        counts.select((1.0 - apart.sqrt() - turned.sqrt()).max(zero) * per_area, zero)
    }
}

/// The part of space where a record counts for some normal: within a ball, between two planes.
pub(super) struct Region {
    position: Vec3,
    normal: Vec3,
    radius: f32,
    height: f32,
}

/// A cell, by its middle and half its edges.
#[derive(Clone, Copy)]
struct Cell {
    middle: Vec3,
    half: Vec3,
}

/// How far above its plane a record may count, over how far it reaches.
pub fn steepest(accuracy: f32) -> f32 {
    // Half the angle that normals may differ by, and as far as a point may be above or below the mean of the planes.
    let half = (accuracy * std::f32::consts::FRAC_1_SQRT_2).min(1.0).asin();
    let beside = (FRONT_TOLERANCE / half.cos().max(f32::MIN_POSITIVE)).min(1.0).asin();
    (half + beside).min(std::f32::consts::FRAC_PI_2).sin()
}

impl Region {
    fn of(record: &Reaching<'_>, accuracy: f32) -> Self {
        Self::reaching(record, record.longest_validity_radius(), accuracy)
    }

    pub fn reaching(record: &Reaching<'_>, radius: f32, accuracy: f32) -> Self {
        Self { position: record.record().position, normal: record.record().normal, radius, height: radius * steepest(accuracy) }
    }

    /// Whether it is partly in a cube, which is taken for larger by what rounding takes away.
    pub fn counts_within(&self, middle: Vec3, half_edge: f32) -> bool {
        self.touches(&Cell { middle, half: half_edge * (1.0 + MARGIN) + 4e-7 * middle.abs() })
    }

    fn touches(&self, cell: &Cell) -> bool {
        let offset = cell.middle - self.position;
        let outside = (offset.abs() - cell.half).max(Vec3::ZERO);
        let above = offset.dot(self.normal).abs() - cell.half.dot(self.normal.abs());
        outside.length_squared() <= self.radius * self.radius && above <= self.height
    }
}

impl Cell {
    fn child(&self, number: usize) -> Self {
        let side = |bit: usize| if number >> bit & 1 == 1 { 0.5 } else { -0.5 };
        let half = 0.5 * self.half;
        Self { middle: self.middle + self.half * Vec3::new(side(0), side(1), side(2)), half }
    }

    fn widened(&self) -> Self {
        Self { half: self.half * (1.0 + MARGIN), ..*self }
    }
}

impl Tree {
    pub fn new(records: &[Reaching<'_>], accuracy: f32) -> Self {
        let regions: Vec<Region> = records.iter().map(|record| Region::of(record, accuracy)).collect();
        // The cosine between normals that differ as much as they may; less for what rounding takes away.
        let least = 1.0 - accuracy * accuracy - 1e-3;
        let of_side = |side: usize| (0..).zip(&regions).filter(|(_, region)| nearest_of_side(region.normal, side) >= least).map(|(number, _)| number).collect();
        Self { sides: std::array::from_fn(|side| Side::new(records, &regions, of_side(side))) }
    }

    /// The records that may count at a point and a normal, by ascending numbers, and others behind them.
    #[inline(always)]
    pub fn near(&self, position: Vec3, normal: Vec3) -> Leaf<'_> {
        let side = &self.sides[side_of(normal)];
        Leaf(&side.blocks[side.leaf(position)..])
    }
}

/// The axis that a normal is nearest to, with its direction.
#[inline(always)]
fn side_of(normal: Vec3) -> usize {
    let size = normal.abs();
    let axis = if size.x >= size.y.max(size.z) { 0 } else { 1 + usize::from(size.y < size.z) };
    2 * axis + usize::from(normal[axis] < 0.0)
}

/// The cosine between a normal and the nearest to it of those of a side: the most of `n · (1, p, q)/√(1 + p² + q²)` over a square, by one of the two after the other.
fn nearest_of_side(normal: Vec3, side: usize) -> f32 {
    let axis = side / 2;
    let sign = if side.is_multiple_of(2) { 1.0 } else { -1.0 };
    let [a, b, c] = [sign * normal[axis], normal[(axis + 1) % 3], normal[(axis + 2) % 3]];
    let along = |ahead: f32, aside: f32, rest: f32| if ahead > 0.0 { (aside * rest / ahead).clamp(-1.0, 1.0) } else { 1.0f32.copysign(aside) };
    let (mut p, mut q) = (0.0, 0.0);
    for _ in 0..8 {
        p = along(a + c * q, b, 1.0 + q * q);
        q = along(a + b * p, c, 1.0 + p * p);
    }
    (a + b * p + c * q) / (1.0 + p * p + q * q).sqrt()
}

impl Side {
    fn new(records: &[Reaching<'_>], regions: &[Region], all: Vec<u32>) -> Self {
        // Beyond where records stand only some of the farthest reach, which need no fine cells: so much is enough to be sure of all of a scene.
        let bounds =
            |all: fn(Vec3, Vec3) -> Vec3, sign: f32| regions.iter().map(|region| region.position + sign * region.radius).reduce(all).unwrap_or(Vec3::ZERO);
        let (corner, end) = (bounds(Vec3::min, -1.0).max(Vec3::splat(-1e15)), bounds(Vec3::max, 1.0).min(Vec3::splat(1e15)));
        let edge = ((end - corner) / GRID as f32).max(Vec3::splat(1e-15));
        let place = |at: usize| Vec3::new((at % GRID) as f32, (at / GRID % GRID) as f32, (at / GRID / GRID) as f32);
        let slices: Vec<Vec<u32>> = (0..GRID)
            .into_par_iter()
            .map(|z| {
                let middle = corner + edge * Vec3::new(0.5 * GRID as f32, 0.5 * GRID as f32, z as f32 + 0.5);
                touching(regions, &all, &Cell { middle, half: edge * Vec3::new(0.5 * GRID as f32, 0.5 * GRID as f32, 0.5) })
            })
            .collect();
        let parts: Vec<Part> = (0..GRID * GRID * GRID)
            .into_par_iter()
            .map(|at| {
                let cell = Cell { middle: corner + edge * (place(at) + 0.5), half: 0.5 * edge };
                let mut part = Part { records, regions, nodes: Vec::new(), blocks: Vec::new() };
                let root = part.add(touching(regions, &slices[at / GRID / GRID], &cell), cell, 0);
                part.nodes.push(root);
                part
            })
            .collect();
        Self::joined(corner, edge.recip(), parts)
    }

    fn joined(corner: Vec3, scale: Vec3, parts: Vec<Part<'_>>) -> Self {
        let (mut nodes, mut blocks) = (vec![0; parts.len()], vec![Block::EMPTY]);
        for (at, part) in parts.into_iter().enumerate() {
            let (first_node, first_block) = (nodes.len() as u32, blocks.len() as u32 - 1);
            let moved = |node: u32| match node {
                0 => 0,
                node if node & INNER != 0 => node + first_node,
                node => node + first_block,
            };
            let (root, children) = part.nodes.split_last().map_or((0, &[][..]), |(root, children)| (*root, children));
            nodes[at] = moved(root);
            nodes.extend(children.iter().map(|node| moved(*node)));
            blocks.extend(part.blocks);
        }
        Self { corner, scale, nodes, blocks }
    }

    /// Where the blocks of the leaf that a point is in begin.
    #[inline(always)]
    fn leaf(&self, position: Vec3) -> usize {
        let place = (position - self.corner) * self.scale;
        if !(place.min_element() >= 0.0 && place.max_element() < GRID as f32) {
            return 0;
        }
        let cell = place.floor();
        let mut within = place - cell;
        let [x, y, z] = cell.to_array().map(|axis| axis as usize);
        let mut node = self.nodes[(z * GRID + y) * GRID + x];
        while node & INNER != 0 {
            within += within;
            let upper = within.cmpge(Vec3::ONE);
            within -= Vec3::select(upper, Vec3::ONE, Vec3::ZERO);
            node = self.nodes[(node & !INNER) as usize + upper.bitmask() as usize];
        }
        node as usize
    }
}

fn touching(regions: &[Region], of: &[u32], cell: &Cell) -> Vec<u32> {
    let widened = cell.widened();
    of.iter().copied().filter(|number| regions[*number as usize].touches(&widened)).collect()
}

/// The tree of a cell of the grid. The first block's place is 1, as 0 stands for an empty one.
struct Part<'a> {
    records: &'a [Reaching<'a>],
    regions: &'a [Region],
    nodes: Vec<u32>,
    blocks: Vec<Block>,
}

impl Part<'_> {
    /// Adds a cell; the word that stands for it.
    fn add(&mut self, list: Vec<u32>, cell: Cell, depth: u32) -> u32 {
        if list.is_empty() {
            return 0;
        }
        let reach = list.iter().map(|number| self.regions[*number as usize].radius).sum::<f32>() / list.len() as f32;
        if list.len() <= FEW || depth == DEEPEST || 2.0 * cell.half.max_element() < SMALL * reach {
            let place = self.blocks.len() as u32 + 1;
            self.blocks.extend(list.chunks(LANES).map(|eight| Block { goes_on: true, ..Block::of(self.records, eight) }));
            self.blocks.last_mut().expect("lists nothing").goes_on = false;
            return place;
        }
        let first = self.nodes.len();
        self.nodes.resize(first + 8, 0);
        for number in 0..8 {
            let child = cell.child(number);
            self.nodes[first + number] = self.add(touching(self.regions, &list, &child), child, depth + 1);
        }
        INNER | first as u32
    }
}
