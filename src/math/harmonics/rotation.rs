//! Rotation of spherical harmonics by the recurrence of Ivanic and Ruedenberg (1996, with the corrections of 1998).

use super::index;
use num_traits::Float;

/// A matrix for each band.
pub struct Rotation<T> {
    order: usize,
    /// Band l: (2l+1)² numbers, rows and columns by m from −l on.
    bands: Vec<Vec<T>>,
}

/// The rotation of directions, as bands refer to it.
struct Seed<T>([[T; 3]; 3]);

impl<T: Float> Seed<T> {
    /// The axes of Y₁: m = −1, 0, 1 are y, z, x.
    fn at(&self, row: isize, column: isize) -> T {
        let axis = |m: isize| [1, 2, 0][(m + 1) as usize];
        self.0[axis(row)][axis(column)]
    }
}

impl<T: Float> Rotation<T> {
    /// Of functions as `matrix`, row by row, turns directions: the value at d becomes the value at `matrix · d`.
    pub fn new(order: usize, matrix: [[T; 3]; 3]) -> Self {
        let seed = Seed(matrix);
        let mut bands: Vec<Vec<T>> = Vec::with_capacity(order);
        for l in 0..order as isize {
            let band = match bands.last() {
                None => vec![T::one()],
                Some(before) => {
                    let places = (-l..=l).flat_map(|m| (-l..=l).map(move |n| (m, n)));
                    places.map(|(m, n)| if l == 1 { seed.at(m, n) } else { element(&seed, before, l, m, n) }).collect()
                }
            };
            bands.push(band);
        }
        Self { order, bands }
    }

    pub fn order(&self) -> usize {
        self.order
    }

    /// The matrices, row by row.
    pub fn into_bands(self) -> Vec<Vec<T>> {
        self.bands
    }

    /// The expansion of the turned function.
    pub fn apply(&self, values: &[T]) -> Vec<T> {
        let mut out = Vec::with_capacity(values.len());
        for (l, band) in self.bands.iter().enumerate() {
            let from = &values[index(l, -(l as isize))..=index(l, l as isize)];
            out.extend(band.chunks_exact(2 * l + 1).map(|row| row.iter().zip(from).fold(T::zero(), |sum, (a, b)| sum + *a * *b)));
        }
        out
    }
}

/// An element of band l ≥ 2 from the band before.
fn element<T: Float>(seed: &Seed<T>, before: &[T], l: isize, m: isize, n: isize) -> T {
    let root = |value: f64| T::from(value.max(0.0).sqrt()).unwrap_or_else(T::nan);
    let two = root(2.0);
    let half = T::one() / (T::one() + T::one());
    let previous = |m: isize, n: isize| before[((m + l - 1) * (2 * l - 1) + n + l - 1) as usize];
    let product = |i: isize, m: isize| {
        if n == l {
            seed.at(i, 1) * previous(m, l - 1) - seed.at(i, -1) * previous(m, 1 - l)
        } else if n == -l {
            seed.at(i, 1) * previous(m, 1 - l) + seed.at(i, -1) * previous(m, l - 1)
        } else {
            seed.at(i, 0) * previous(m, n)
        }
    };
    let denominator = (if n.abs() == l { 2 * l * (2 * l - 1) } else { (l + n) * (l - n) }) as f64;
    let a = m.abs();
    let mut sum = T::zero();
    if a < l {
        sum = sum + root(((l + m) * (l - m)) as f64 / denominator) * product(0, m);
    }
    let v = root(((l + a - 1) * (l + a)) as f64 / denominator) * half;
    sum = sum
        + v * match m {
            0 => -(product(1, 1) + product(-1, -1)) * two,
            1 => product(1, 0) * two,
            -1 => product(-1, 0) * two,
            m if m > 0 => product(1, m - 1) - product(-1, 1 - m),
            m => product(1, m + 1) + product(-1, -m - 1),
        };
    if m != 0 && a < l - 1 {
        let w = root(((l - a - 1) * (l - a)) as f64 / denominator) * half;
        sum = sum - w * if m > 0 { product(1, m + 1) + product(-1, -m - 1) } else { product(1, m - 1) - product(-1, 1 - m) };
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::{Basis, MOST, count};
    use super::*;
    use glam::{DMat3, DVec3};
    use proptest::prelude::*;

    fn rows(matrix: DMat3) -> [[f64; 3]; 3] {
        matrix.transpose().to_cols_array_2d()
    }

    /// Some function of each order.
    fn some(order: usize) -> Vec<f64> {
        (0..count(order)).map(|k| ((k * k) as f64 * 0.37 + 0.2).sin()).collect()
    }

    fn value(basis: &Basis<f64>, function: &[f64], direction: DVec3) -> f64 {
        basis.spherical(direction.to_array()).iter().zip(function).map(|(y, f)| y * f).sum()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn functions_turn_with_directions(axis in prop::array::uniform3(-1.0..1.0f64), angle in -4.0..4.0f64, order in 1..=MOST) {
            let axis = DVec3::from(axis).try_normalize().unwrap_or(DVec3::Z);
            let matrix = DMat3::from_axis_angle(axis, angle);
            let (basis, function) = (Basis::new(order), some(order));
            let turned = Rotation::new(order, rows(matrix)).apply(&function);
            for direction in [DVec3::X, DVec3::NEG_Z, DVec3::new(0.48, 0.6, 0.64), DVec3::new(-0.6, 0.0, 0.8)] {
                let (there, here) = (value(&basis, &turned, matrix * direction), value(&basis, &function, direction));
                prop_assert!((there - here).abs() < 1e-10, "{there}, not {here}");
            }
        }

        #[test]
        fn turns_compose_and_invert(a in -3.0..3.0f64, b in -3.0..3.0f64) {
            let (first, second) = (DMat3::from_rotation_y(a), DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), b));
            let turn = |matrix: DMat3, values: &[f64]| Rotation::new(MOST, rows(matrix)).apply(values);
            let function = some(MOST);
            let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-10);
            let both = turn(second, &turn(first, &function));
            prop_assert!(near(&both, &turn(second * first, &function)));
            prop_assert!(near(&turn(first.transpose() * second.transpose(), &both), &function));
        }
    }

    #[test]
    fn single_precision_keeps_its_digits() {
        let matrix = DMat3::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 2.1);
        let function = some(MOST);
        let double = Rotation::new(MOST, rows(matrix)).apply(&function);
        let single = Rotation::new(MOST, rows(matrix).map(|row| row.map(|v| v as f32))).apply(&function.iter().map(|v| *v as f32).collect::<Vec<_>>());
        let error = double.iter().zip(single).map(|(a, b)| (a - b as f64).abs()).fold(0.0, f64::max);
        assert!(error < 1e-4, "{error}");
    }
}
