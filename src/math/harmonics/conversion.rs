//! From spherical harmonics to hemispherical ones and back.

use super::{Basis, count, index, quadrature::gauss_legendre};
use std::f64::consts::{PI, TAU};

/// The integrals of the products of both over the hemisphere (thesis, equation 3.20; the matrix printed in 3.4.1 is not that integral).
/// Those of different orders m are 0.
pub struct Conversion {
    hemispherical: usize,
    spherical: usize,
    /// For each m the degrees l ≥ m of the hemispherical harmonics by those of the spherical ones.
    blocks: Vec<Vec<f64>>,
}

impl Conversion {
    /// Between expansions of these orders; more spherical bands than hemispherical ones lose less.
    pub fn new(hemispherical: usize, spherical: usize) -> Self {
        let most = hemispherical.max(spherical);
        let basis = Basis::<f64>::new(most);
        let bands = hemispherical.min(spherical);
        let mut blocks: Vec<Vec<f64>> = (0..bands).map(|m| vec![0.0; (hemispherical - m) * (spherical - m)]).collect();
        // With z = t² the roots at the horizon are gone.
        for [t, weight] in gauss_legendre(2 * most + 32) {
            let z = t * t;
            let direction = [(1.0 - z * z).max(0.0).sqrt(), 0.0, z];
            let (h, y) = (basis.hemispherical(direction), basis.spherical(direction));
            for (m, block) in blocks.iter_mut().enumerate() {
                let around = if m == 0 { TAU } else { PI } * 2.0 * t * weight;
                for row in m..hemispherical {
                    for column in m..spherical {
                        let at = (row - m) * (spherical - m) + column - m;
                        block[at] += around * h[index(row, m as isize)] * y[index(column, m as isize)];
                    }
                }
            }
        }
        Self { hemispherical, spherical, blocks }
    }

    pub fn hemispherical_order(&self) -> usize {
        self.hemispherical
    }

    pub fn spherical_order(&self) -> usize {
        self.spherical
    }

    /// Degree of H, degree of Y, order of both, and their integral: each that is not 0 for its order's sake.
    pub fn elements(&self) -> impl Iterator<Item = (usize, usize, isize, f64)> {
        let signs = |m: usize| [m as isize, -(m as isize)].into_iter().take(if m == 0 { 1 } else { 2 });
        self.blocks.iter().enumerate().flat_map(move |(m, block)| {
            let width = self.spherical - m;
            signs(m).flat_map(move |sign| block.iter().enumerate().map(move |(at, value)| (m + at / width, m + at % width, sign, *value)))
        })
    }

    /// The spherical expansion of a function that is 0 below the horizon.
    pub fn to_spherical(&self, hemispherical: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; count(self.spherical)];
        self.elements().for_each(|(h, y, m, value)| out[index(y, m)] += value * hemispherical[index(h, m)]);
        out
    }

    /// The hemispherical expansion of a function's upper half.
    pub fn to_hemispherical(&self, spherical: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; count(self.hemispherical)];
        self.elements().for_each(|(h, y, m, value)| out[index(h, m)] += value * spherical[index(y, m)]);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::super::quadrature::hemisphere;
    use super::*;

    #[test]
    fn elements_are_the_known_ones() {
        let conversion = Conversion::new(3, 3);
        let find = |h: usize, y: usize, m: isize| conversion.elements().find(|e| (e.0, e.1, e.2) == (h, y, m)).map_or(0.0, |e| e.3);
        let known = [
            (0, 0, 0, std::f64::consts::FRAC_1_SQRT_2),
            (1, 0, 0, 0.0),
            (0, 1, 0, 0.6124),
            (1, 1, 0, 0.3536),
            (1, 2, 0, 0.6847),
            (1, 1, 1, 0.6739),
            (1, 2, -1, 0.6745),
            (2, 1, 1, -0.1578),
            (2, 2, -1, 0.2117),
            (2, 2, 0, 0.1768),
            (2, 2, 2, 0.6187),
            (2, 2, -2, 0.6187),
        ];
        for (h, y, m, value) in known {
            assert!((find(h, y, m) - value).abs() < 1e-4, "{h} {y} {m}: {}, not {value}", find(h, y, m));
        }
    }

    /// Against products summed over the hemisphere.
    #[test]
    fn elements_are_the_integrals() {
        let (n, s) = (7, 11);
        let basis = Basis::<f64>::new(s);
        let mut sums = vec![0.0; count(n) * count(s)];
        for (direction, weight) in hemisphere(64, 64) {
            let (h, y) = (basis.hemispherical(direction), basis.spherical(direction));
            for i in 0..count(n) {
                for j in 0..count(s) {
                    sums[i * count(s) + j] += weight * h[i] * y[j];
                }
            }
        }
        for (h, y, m, value) in Conversion::new(n, s).elements() {
            let sum = std::mem::take(&mut sums[index(h, m) * count(s) + index(y, m)]);
            assert!((sum - value).abs() < 1e-10, "{h} {y} {m}: {value}, not {sum}");
        }
        assert!(sums.iter().all(|sum| sum.abs() < 1e-10), "what is left is 0");
    }

    #[test]
    fn energy_never_grows() {
        let conversion = Conversion::new(10, 14);
        for k in 0..count(10) {
            let mut unit = vec![0.0; count(10)];
            unit[k] = 1.0;
            let there = conversion.to_spherical(&unit);
            let back = conversion.to_hemispherical(&there);
            let energy = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
            assert!(energy(&there) <= 1.0 + 1e-12 && energy(&back) <= energy(&there) + 1e-12);
        }
    }
}
