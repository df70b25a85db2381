//! Where caustics come from: photons that meet a lobe first start in few places and go few ways, which a few photons find for all others.
//!
//! Of each part of the sources' flux it has two grids: over the first two numbers that tell how a photon starts, and over the other two. A photon's own numbers
//! choose a cell of each among those from which photons meet lobes, and its flux is divided by how often the cell is chosen: nothing is biased. As
//! `shaders/lib/guide.wgsl`.

use crate::math::choice::Choice;
use crate::math::random::{combine, hash};
use crate::scene::sources::{Start, start};

/// Parts of the sources' flux.
const PARTS: usize = 8;
/// Cells along an edge of a grid.
const CELLS: usize = 32;
/// Grids of a part.
const GRIDS: usize = 2;
/// Words of a grid: where the share of each row ends, then of each row where that of each cell does.
const GRID_WORDS: usize = CELLS + CELLS * CELLS;

/// Words of all.
pub(super) const WORDS: usize = PARTS + PARTS * GRIDS * GRID_WORDS;

/// The share of photons that start anywhere, whatever was found.
const BLIND: f64 = 0.1;

/// Bits of a place that are not shaken: it moves by a cell of the guide at most.
const SHAKEN_BITS: u32 = 5;

/// Some tens for each cell.
const SCOUTS_OF_PART: u32 = 1 << 16;

/// Parts that so many sources have each for themselves.
fn own_parts(sources: usize) -> usize {
    sources.clamp(1, PARTS).next_power_of_two()
}

/// Shares of a whole are words of 32 bits.
const WHOLE: f32 = 4_294_967_296.0;

/// How photons that meet lobes start.
pub(super) struct Guide {
    words: Vec<u32>,
}

impl Guide {
    /// How many photons, of so many sources, look for lobes.
    pub fn scouts(sources: usize) -> u32 {
        SCOUTS_OF_PART * own_parts(sources) as u32
    }

    /// From starts of photons, of so many sources, that met a lobe.
    pub fn new(sources: usize, found: &[Start]) -> Self {
        let alike = PARTS / own_parts(sources);
        let mut parts = vec![0.0; PARTS];
        let mut grids = vec![[false; CELLS * CELLS]; PARTS * GRIDS];
        for [source, u, v, s, t] in found {
            let first = index(*source, PARTS) / alike * alike;
            for part in first..first + alike {
                // Not by how many: photons of unlike flux make more noise than those that meet nothing.
                parts[part] = 1.0;
                for (grid, pair) in [[u, v], [s, t]].into_iter().enumerate() {
                    let [row, column] = pair.map(|place| index(*place, CELLS));
                    grids[GRIDS * part + grid][CELLS * row + column] = true;
                }
            }
        }
        let mut words = ends(&parts);
        for grid in &grids {
            let cells = mixed(&widened(grid));
            words.extend(ends_of(cells.chunks(CELLS).map(|row| row.iter().sum())));
            cells.chunks(CELLS).for_each(|row| words.extend(ends_of(row.iter().copied())));
        }
        Self { words }
    }

    /// What shaders read.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// How a photon starts by its number, and by how much rarer it would start so were it not for the guide.
    pub fn start(&self, number: u32) -> (Start, f32) {
        let [source, u, v, s, t] = shaken(number);
        let (parts, grids) = self.words.split_at(PARTS);
        let (source, density) = warped(parts, source);
        let part = index(source, PARTS);
        let grid = |number: usize, row: u32, column: u32| {
            let first = (GRIDS * part + number) * GRID_WORDS;
            let (rows, cells) = grids[first..first + GRID_WORDS].split_at(CELLS);
            let (row, of_row) = warped(rows, row);
            let at = index(row, CELLS);
            let (column, of_column) = warped(&cells[CELLS * at..CELLS * (at + 1)], column);
            ([row, column], of_row * of_column)
        };
        let ([u, v], first) = grid(0, u, v);
        let ([s, t], second) = grid(1, s, t);
        ([source, u, v, s, t], density * first * second)
    }
}

/// Which of so many equal shares holds a place; their number is a power of two.
fn index(place: u32, shares: usize) -> usize {
    (place >> (32 - shares.trailing_zeros())) as usize
}

/// Where a photon is on the lattice, moved by chance: the lattice shows in what curved mirrors make of it.
fn shaken(number: u32) -> Start {
    let mut key = 0;
    start(number).map(|place| {
        key += 1;
        place.wrapping_add(hash(combine(number, key)) >> SHAKEN_BITS)
    })
}

/// The cells that hold anything, and their neighbours: what is there goes on beyond the edge of a cell.
fn widened(grid: &[bool; CELLS * CELLS]) -> Vec<f64> {
    let at = |row: usize, column: usize| grid[CELLS * (row % CELLS) + column % CELLS];
    let near = |cell: usize| (0..9).any(|way| at(cell / CELLS + CELLS - 1 + way / 3, cell % CELLS + CELLS - 1 + way % 3));
    (0..CELLS * CELLS).map(|cell| f64::from(u8::from(near(cell)))).collect()
}

/// Shares of a whole, none of them too small.
fn mixed(weights: &[f64]) -> Vec<f64> {
    let sum: f64 = weights.iter().sum();
    let even = 1.0 / weights.len() as f64;
    weights.iter().map(|weight| if sum > 0.0 { BLIND * even + (1.0 - BLIND) * weight / sum } else { even }).collect()
}

fn ends(weights: &[f64]) -> Vec<u32> {
    ends_of(mixed(weights).into_iter()).collect()
}

fn ends_of(shares: impl ExactSizeIterator<Item = f64>) -> impl Iterator<Item = u32> {
    let count = shares.len();
    let choice = Choice::new(shares);
    (0..count).map(move |index| choice.end(index))
}

/// A place along shares that end there, as a place along as many equal shares; and how much denser places are than without.
fn warped(ends: &[u32], place: u32) -> (u32, f32) {
    let at = ends.partition_point(|end| *end <= place).min(ends.len() - 1);
    let begin = if at == 0 { 0 } else { ends[at - 1] };
    let width = (ends[at] - begin).max(1) as f32;
    let size = 1 << (32 - ends.len().trailing_zeros());
    let within = ((place - begin) as f32 / width * size as f32) as u32;
    (at as u32 * size + within.min(size - 1), width * ends.len() as f32 / WHOLE)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of anything over guided starts, by their densities, is that over even ones.
    #[test]
    fn guided_starts_are_no_more_light_than_even_ones() {
        let bright = |[source, u, v, s, _]: Start| source < 1 << 30 && u > 3 << 30 && v.abs_diff(1 << 31) < 1 << 28 && s < 1 << 29;
        let found: Vec<_> = (0..Guide::scouts(100)).map(start).filter(|start| bright(*start)).collect();
        let guide = Guide::new(100, &found);
        assert_eq!(guide.words().len(), WORDS);
        let count = 100_000;
        let guided = (0..count).map(|number| guide.start(number));
        let (mut all, mut of_bright, mut hits) = (0.0, 0.0, 0);
        for (start, density) in guided {
            all += f64::from(1.0 / density) / f64::from(count);
            if bright(start) {
                of_bright += f64::from(1.0 / density) / f64::from(count);
                hits += 1;
            }
        }
        let known = 0.25 * 0.25 * 0.125 * 0.125;
        assert!((all - 1.0).abs() < 0.05, "{all}");
        assert!((of_bright / known - 1.0).abs() < 0.01, "{of_bright}, not {known}");
        assert!(f64::from(hits) > 0.2 * f64::from(count), "{hits}");
        // Nothing found, nothing preferred.
        let (same, density) = Guide::new(1, &[]).start(77);
        assert!(shaken(77).iter().zip(same).all(|(a, b)| a.abs_diff(b) < 1 << 10) && (density - 1.0).abs() < 1e-5);
    }
}
