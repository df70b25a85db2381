//! Counter-based random numbers and the shapes drawn from them.

use glam::Vec3;
use std::f32::consts::TAU;

/// A stream of random numbers that its keys alone decide (SplitMix64: Steele, Lea, Flood 2014).
pub struct Random(u64);

impl Random {
    pub fn new<const N: usize>(keys: [u64; N]) -> Self {
        Self(keys.into_iter().fold(0, |state, key| mix(state.wrapping_add(GOLDEN) ^ key.wrapping_mul(GOLDEN))))
    }

    /// Uniform in 0..1, 1 excluded.
    pub fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        (mix(self.0) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in the unit square.
    pub fn pair(&mut self) -> [f64; 2] {
        [self.number(), self.number()]
    }

    /// Uniform in a cell of the unit square.
    pub fn pair_in(&mut self, cell: Cell) -> [f64; 2] {
        [(cell.column + self.number()) / cell.columns, (cell.before + self.number() * cell.columns) / cell.cells]
    }
}

/// One of so many parts of the unit square that are equally large and nearly squares: they stand in rows, and where they do not fill the last ones,
/// those hold one less and are as much lower.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    /// Cells left of this one in its row.
    column: f64,
    /// Cells of its row.
    columns: f64,
    /// Cells of all rows before.
    before: f64,
    /// Of the whole square.
    cells: f64,
}

/// The unit square in so many cells, row by row.
pub fn cells(count: u32) -> impl Iterator<Item = Cell> {
    let rows = f64::from(count).sqrt().round().max(1.0) as u32;
    let columns_of = move |row: u32| count / rows + u32::from(row < count % rows);
    let row = move |row: u32| {
        let before = row * (count / rows) + row.min(count % rows);
        let [columns, before, cells] = [columns_of(row), before, count].map(f64::from);
        (0..columns_of(row)).map(move |column| Cell { column: f64::from(column), columns, before, cells })
    };
    (0..rows).flat_map(row)
}

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

fn mix(value: u64) -> u64 {
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}

/// Unit vector about the unit vector `normal`, its density cosine/π (Malley's method).
pub fn cosine_direction(normal: Vec3, [u, v]: [f64; 2]) -> Vec3 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let (radius, height) = (u.sqrt() as f32, (1.0 - u).max(0.0).sqrt() as f32);
    let (sin, cos) = (v as f32 * TAU).sin_cos();
    (tangent * (radius * cos) + bitangent * (radius * sin) + normal * height).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_depend_on_every_key() {
        let first = |keys| Random::new::<3>(keys).number();
        let numbers = [first([0, 0, 0]), first([1, 0, 0]), first([0, 1, 0]), first([0, 0, 1]), first([1, 1, 0])];
        for (i, a) in numbers.iter().enumerate() {
            assert!(numbers[..i].iter().all(|b| a != b), "{numbers:?}");
        }
    }

    #[test]
    fn streams_are_uniform() {
        let mut bins = [0u32; 16];
        (0..16_000u64).for_each(|key| bins[(Random::new([7, key, 0]).number() * 16.0) as usize] += 1);
        // χ² of 15 degrees of freedom stays below 37.7 with probability 0.999.
        let chi_squared: f64 = bins.iter().map(|&n| (n as f64 - 1000.0).powi(2) / 1000.0).sum();
        assert!(chi_squared < 37.7, "χ² {chi_squared}");
    }

    #[test]
    fn cosine_directions_have_mean_two_thirds_of_the_normal() {
        let normal = Vec3::new(0.6, -0.64, 0.48);
        let mut random = Random::new([1]);
        let sum: Vec3 = cells(4096).map(|cell| cosine_direction(normal, random.pair_in(cell))).sum();
        assert!((sum / 4096.0).distance(normal * (2.0 / 3.0)) < 1e-3, "{sum}");
    }

    /// However many there are: each holds as much of the square, and they leave none of it out.
    #[test]
    fn any_number_of_cells_fills_the_square() {
        for count in [1, 2, 3, 7, 16, 25, 50, 64, 67, 255, 256] {
            let mut random = Random::new([u64::from(count)]);
            let cells: Vec<Cell> = cells(count).collect();
            assert_eq!(cells.len(), count as usize);
            let area: f64 = cells.iter().map(|cell| 1.0 / cell.columns * (cell.columns / cell.cells)).sum();
            assert!((area - 1.0).abs() < 1e-12);
            // Each point lies in a cell of its own, in the order of rows, then columns.
            let place = |[u, v]: [f64; 2]| {
                let row = cells.iter().rev().find(|cell| cell.before <= v * cell.cells).unwrap();
                row.before + (u * row.columns).floor()
            };
            let places: Vec<f64> = cells.iter().map(|cell| place(random.pair_in(*cell))).collect();
            assert_eq!(places, (0..count).map(f64::from).collect::<Vec<_>>(), "{count}");
        }
        assert_eq!(cells(256).map(|cell| [cell.column, cell.columns, cell.before]).nth(17), Some([1.0, 16.0, 16.0]));
    }
}
