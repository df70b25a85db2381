//! How sure a tile's sum is, by what its samples tell of each other.

/// What a tile gets wrong by chance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertainty {
    /// Standard error of the sum, as a share of it.
    pub error: f32,
    /// How fast the error falls with the samples along an edge, as their power: 1 where samples know nothing of each other, 1.5 along outlines.
    pub power: f32,
}

/// The share that mixed differences tell too much along outlines: a stratum that one crosses differs from its neighbours by more than its own samples do.
const OUTLINES: f32 = 0.45;

impl Uncertainty {
    /// Of a tile in the dark: nobody knows.
    pub const UNKNOWN: Self = Self { error: f32::INFINITY, power: 1.5 };

    /// Of one sample in each of `edge`×`edge` strata that count alike. Its ray has the share in it that `shares` tells; all of it where that is empty.
    ///
    /// What strata differ by has two parts, how light changes from one to the other and what chance does within each. Mixed differences of four neighbours,
    /// `B = g₀₀ − g₁₀ − g₀₁ + g₁₁`, leave out a steady change and hold four times the variance of one sample: `s² = n⁻² · mean(B²)/4`, with n² strata
    /// of one ray each. In strata twice as large B² is what it is of samples twice as far apart: the same of noise, twice as much along an outline, where twice
    /// as many blocks have it. What no sample has met is not in it.
    ///
    /// # Panics
    /// Where there are fewer samples than strata.
    pub fn of(edge: usize, light: &[f32], shares: &[f32]) -> Self {
        let mean = light.iter().sum::<f32>() / light.len() as f32;
        if mean.is_nan() || mean <= 0.0 || edge < 3 {
            return Self::UNKNOWN;
        }
        let squares = |step: usize| mixed_squares(edge, light, shares, step) / (edge - step).pow(2) as f32 / (mean * mean);
        let [next, apart] = [squares(1), squares(2)];
        let growth = if next > 0.0 { (apart / next).log2().clamp(0.0, 1.0) } else { 1.0 };
        Self { error: (next / 4.0).sqrt() / edge as f32 * (1.0 - OUTLINES * growth), power: 1.0 + 0.5 * growth }
    }

    /// The error over what the light of `edge`×`edge` strata alone would tell, as [`super::sum::standard_error`] does; 1 where that is nothing.
    pub fn over_plain(&self, edge: usize, light: &[f32]) -> f32 {
        let mean = light.iter().sum::<f32>() / light.len() as f32;
        let plain = (mixed_squares(edge, light, &[], 1) / 4.0).sqrt() / ((edge - 1) * edge) as f32 / mean;
        let share = self.error / plain;
        if plain > 0.0 && share.is_finite() { share } else { 1.0 }
    }

    /// The error with so many times as many samples along an edge.
    pub fn refined(&self, times: f32) -> f32 {
        self.error * times.powf(-self.power)
    }
}

/// Sum over all blocks of four samples, `step` apart, of the squares of their mixed differences, each in the mean share of its samples.
fn mixed_squares(edge: usize, light: &[f32], shares: &[f32], step: usize) -> f32 {
    // Sums side by side, so that they are computed so.
    let mut sums = [0.0f32; 8];
    let (mut row, blocks) = (vec![0.0f32; edge - step], edge - step);
    for y in 0..blocks {
        let (near, far) = (&light[y * edge..][..edge], &light[(y + step) * edge..][..edge]);
        let mixed = near.iter().zip(&near[step..]).zip(far.iter().zip(&far[step..]));
        row.iter_mut().zip(mixed).for_each(|(square, ((a, b), (c, d)))| *square = ((a - b) - (c - d)) * ((a - b) - (c - d)));
        if !shares.is_empty() {
            let (near, far) = (&shares[y * edge..][..edge], &shares[(y + step) * edge..][..edge]);
            let four = near.iter().zip(&near[step..]).zip(far.iter().zip(&far[step..]));
            row.iter_mut().zip(four).for_each(|(square, ((a, b), (c, d)))| *square *= 0.25 * ((a + b) + (c + d)));
        }
        let (eights, rest) = row.as_chunks::<8>();
        eights.iter().for_each(|eight| sums.iter_mut().zip(eight).for_each(|(sum, square)| *sum += square));
        sums.iter_mut().zip(rest).for_each(|(sum, square)| *sum += square);
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};

    /// Of the values' squares the mean's root.
    fn root_mean_square(values: impl Iterator<Item = f32>) -> f32 {
        let squares: Vec<f32> = values.map(|value| value * value).collect();
        (squares.iter().sum::<f32>() / squares.len() as f32).sqrt()
    }

    /// Deviation of many tiles' sums from their mean, as a share of it; what the tiles expect of it, and what of tiles three times as fine.
    fn found(edge: usize, seen: impl Fn(f32, f32) -> f32) -> [f32; 3] {
        let mut next = 0;
        let mut random = || {
            next += 1;
            unit(hash(next))
        };
        let mut tile = || {
            let at = |place: usize, within: f32| (place as f32 + within) / edge as f32;
            (0..edge * edge).map(|k| seen(at(k % edge, random()), at(k / edge, random()))).collect::<Vec<f32>>()
        };
        let tiles: Vec<Vec<f32>> = (0..400).map(|_| tile()).collect();
        let sums: Vec<f32> = tiles.iter().map(|tile| tile.iter().sum()).collect();
        let mean = sums.iter().sum::<f32>() / sums.len() as f32;
        let told: Vec<Uncertainty> = tiles.iter().map(|tile| Uncertainty::of(edge, tile, &[])).collect();
        let deviation = root_mean_square(sums.iter().map(|sum| sum / mean - 1.0));
        [deviation, root_mean_square(told.iter().map(|told| told.error)), root_mean_square(told.iter().map(|told| told.refined(3.0)))]
    }

    type Sight = Box<dyn Fn(f32, f32) -> f32>;

    fn disc(radius: f32) -> Sight {
        Box::new(move |x, y| f32::from((x - 0.43).hypot(y - 0.58) < radius))
    }

    fn noise() -> Sight {
        Box::new(|x, y| unit(hash((x * 1e6) as u32 ^ (y * 2e6) as u32)))
    }

    #[test]
    fn tiles_know_their_errors() {
        let cases: [(&str, Sight, [f32; 2]); 5] = [
            ("a steady change", Box::new(|x, y| 1.0 + x - 0.5 * y), [0.9, 1.1]),
            ("waves", Box::new(|x, y| 1.0 + 0.5 * (20.0 * x).sin() * (12.0 * y).cos()), [0.6, 1.0]),
            ("a disc", disc(0.3), [0.7, 1.1]),
            ("a small disc", disc(0.06), [0.6, 1.3]),
            ("noise", noise(), [0.9, 1.1]),
        ];
        for (name, seen, [least, most]) in cases {
            let [deviation, told, _] = found(24, &seen);
            assert!((least..most).contains(&(told / deviation)), "{name}: {told} is told of {deviation}");
        }
    }

    #[test]
    fn finer_tiles_are_as_sure_as_foretold() {
        for (name, seen) in [("a disc", disc(0.3)), ("noise", noise())] {
            let ([_, _, foretold], [deviation, ..]) = (found(12, &seen), found(36, &seen));
            assert!((0.7..1.7).contains(&(foretold / deviation)), "{name}: {foretold} is foretold of {deviation}");
        }
    }

    #[test]
    fn the_dark_is_not_sure() {
        assert_eq!(Uncertainty::of(8, &[0.0; 64], &[]), Uncertainty::UNKNOWN);
        assert_eq!(Uncertainty::of(8, &[3.0; 64], &[]).error, 0.0);
        assert_eq!(Uncertainty::of(8, &[f32::NAN; 64], &[]), Uncertainty::UNKNOWN);
    }

    #[test]
    fn more_rays_make_a_stratum_surer() {
        let (mut light, mut shares) = ([1.0; 64], [1.0; 64]);
        light[27] = 9.0;
        let alone = Uncertainty::of(8, &light, &[]).error;
        assert_eq!(Uncertainty::of(8, &light, &shares).error, alone);
        for at in [18, 19, 20, 26, 27, 28, 34, 35, 36] {
            shares[at] = 1.0 / 16.0;
        }
        // Samples two apart have the shares of others between them.
        let share = Uncertainty::of(8, &light, &shares).error / alone;
        assert!((0.15..0.26).contains(&share), "{share}");
    }
}
