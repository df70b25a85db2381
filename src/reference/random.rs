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

    /// Uniform in the cell `[x, y]` of `strata`² cells of the unit square.
    pub fn pair_in(&mut self, [x, y]: [u32; 2], strata: u32) -> [f64; 2] {
        [(x as f64 + self.number()) / strata as f64, (y as f64 + self.number()) / strata as f64]
    }
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

/// Barycentric weights of corners 1 and 2 of a point uniform over a triangle.
pub fn triangle_point([u, v]: [f64; 2]) -> glam::Vec2 {
    let root = u.sqrt();
    glam::Vec2::new((root * (1.0 - v)) as f32, (root * v) as f32)
}

/// A discrete distribution that is sampled by inversion.
pub struct Choice {
    cumulative: Vec<f64>,
}

impl Choice {
    pub fn new(weights: impl Iterator<Item = f64>) -> Self {
        Self {
            cumulative: weights
                .scan(0.0, |sum, weight| {
                    *sum += weight;
                    Some(*sum)
                })
                .collect(),
        }
    }

    /// Sum of the weights.
    pub fn total(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// Weight of one entry.
    pub fn weight(&self, index: usize) -> f64 {
        self.cumulative[index] - self.below(index)
    }

    /// The entry at `number` of 0..1, and how far into it `number` lies, 0..1 again, to be used once more.
    pub fn pick(&self, number: f64) -> (usize, f64) {
        let at = number * self.total();
        let index = self.cumulative.partition_point(|&sum| sum <= at).min(self.cumulative.len() - 1);
        (index, ((at - self.below(index)) / self.weight(index)).clamp(0.0, 1.0))
    }

    fn below(&self, index: usize) -> f64 {
        if index == 0 { 0.0 } else { self.cumulative[index - 1] }
    }
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
        let cells = (0..64).flat_map(|x| (0..64).map(move |y| [x, y]));
        let sum: Vec3 = cells.map(|cell| cosine_direction(normal, random.pair_in(cell, 64))).sum();
        assert!((sum / 4096.0).distance(normal * (2.0 / 3.0)) < 1e-3, "{sum}");
    }

    #[test]
    fn a_choice_follows_its_weights() {
        let choice = Choice::new([1.0, 0.0, 3.0].into_iter());
        assert_eq!(choice.pick(0.0), (0, 0.0));
        assert_eq!(choice.pick(0.25), (2, 0.0));
        assert_eq!(choice.pick(0.625), (2, 0.5));
        assert_eq!((choice.weight(1), choice.total()), (0.0, 4.0));
    }
}
