//! The values of the functions, by recurrences over normalised terms: no factorial, nothing that overflows.

use super::{Harmonics, count, index};
use num_traits::Float;

/// The functions of an order.
pub struct Basis<T> {
    order: usize,
    /// `√((2m+1)!! / (2m)!! / 4π)`: the normalised Legendre functions of degree m and order m without their power of the sine.
    sectoral: Vec<T>,
    /// Of each degree and order, at `l·order + m`: how a value follows from the two of lower degree.
    steps: Vec<[T; 2]>,
}

impl<T: Float> Basis<T> {
    pub fn new(order: usize) -> Self {
        let number = |value: f64| T::from(value).unwrap_or_else(T::nan);
        let mut sectoral = vec![(0.25 / std::f64::consts::PI).sqrt()];
        for m in 1..order {
            sectoral.push(sectoral[m - 1] * (1.0 + 0.5 / m as f64).sqrt());
        }
        let step = |l: usize, m: usize| {
            if m >= l {
                return [0.0; 2];
            }
            let (l, m) = (l as f64, m as f64);
            let before = (l - 1.0) * (l - 1.0);
            [((4.0 * l * l - 1.0) / (l * l - m * m)).sqrt(), ((before - m * m) / (4.0 * before - 1.0)).max(0.0).sqrt()]
        };
        let steps = (0..order * order).map(|at| step(at / order, at % order).map(number)).collect();
        Self { order, sectoral: sectoral.into_iter().take(order).map(number).collect(), steps }
    }

    pub fn order(&self) -> usize {
        self.order
    }

    /// What the recurrences start from and how they go on, for shaders: of each m the value of degree m without the power of the sine; at `l·order + m` two factors.
    pub fn recurrence(self) -> (Vec<T>, Vec<[T; 2]>) {
        (self.sectoral, self.steps)
    }

    /// The spherical harmonics at a unit direction: [`count`] values.
    pub fn spherical(&self, [x, y, z]: [T; 3]) -> Vec<T> {
        let mut values = vec![T::zero(); count(self.order)];
        self.fill([x, y, z], T::one(), &mut values);
        values
    }

    /// The hemispherical harmonics at a unit direction with z ≥ 0, in 1/√sr.
    pub fn hemispherical(&self, direction: [T; 3]) -> Vec<T> {
        let mut values = vec![T::zero(); count(self.order)];
        self.fill(stretched(direction), T::one() + T::one(), &mut values);
        values
    }

    /// Those of one kind at a unit direction with z ≥ 0.
    pub fn values(&self, harmonics: Harmonics, direction: [T; 3]) -> Vec<T> {
        match harmonics {
            Harmonics::Hemispherical => self.hemispherical(direction),
            Harmonics::Spherical => self.spherical(direction),
        }
    }

    /// `√power` times the spherical harmonics.
    fn fill(&self, [x, y, z]: [T; 3], power: T, values: &mut [T]) {
        let (zonal, other) = (power.sqrt(), (power + power).sqrt());
        // Real and imaginary part of (x + iy)^m: the sine's power times cos mφ and sin mφ.
        let (mut cosine, mut sine) = (T::one(), T::zero());
        for m in 0..self.order {
            let (mut before, mut now) = (T::zero(), self.sectoral[m]);
            for l in m..self.order {
                if l > m {
                    let [a, b] = self.steps[l * self.order + m];
                    (before, now) = (now, a * (z * now - b * before));
                }
                if m == 0 {
                    values[index(l, 0)] = zonal * now;
                } else {
                    values[index(l, m as isize)] = other * now * cosine;
                    values[index(l, -(m as isize))] = other * now * sine;
                }
            }
            (cosine, sine) = (x * cosine - y * sine, x * sine + y * cosine);
        }
    }
}

/// Where the stretch of the hemisphere over the sphere takes a unit direction: `cosθ' = 2 cosθ − 1`, the azimuth stays.
pub fn stretched<T: Float>([x, y, z]: [T; 3]) -> [T; 3] {
    let two = T::one() + T::one();
    // Below the horizon by rounding.
    let z = z.max(T::zero());
    let scale = two * (z / (T::one() + z)).sqrt();
    [x * scale, y * scale, two * z - T::one()]
}

#[cfg(test)]
mod tests {
    use super::super::{MOST, quadrature::hemisphere};
    use super::*;
    use proptest::prelude::*;

    /// The largest deviation from orthonormality of functions over the upper hemisphere, or over both: a sum of functions, projected, has to be itself. The factors have
    /// nothing to do with each other, so that no two products make up for one another.
    fn deviation(order: usize, halves: &[f64], values: impl Fn([f64; 3]) -> Vec<f64>) -> f64 {
        let factor = |k: usize| (k as f64 * k as f64 * 0.618_034 + 0.3).sin();
        let mut products = vec![0.0; count(order)];
        for (direction, weight) in hemisphere(48, 48) {
            for half in halves {
                let v = values([direction[0], direction[1], half * direction[2]]);
                let sum: f64 = v.iter().enumerate().map(|(k, v)| factor(k) * v).sum();
                products.iter_mut().zip(v).for_each(|(product, v)| *product += weight * sum * v);
            }
        }
        products.iter().enumerate().map(|(k, product)| (product - factor(k)).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn functions_are_orthonormal() {
        let basis = Basis::<f64>::new(MOST);
        assert!(deviation(MOST, &[1.0, -1.0], |d| basis.spherical(d)) < 1e-6);
        assert!(deviation(MOST, &[1.0], |d| basis.hemispherical(d)) < 1e-6);
    }

    #[test]
    fn the_first_functions_are_those_of_the_books() {
        let basis = Basis::<f64>::new(3);
        let [x, y, z] = [0.48, 0.6, 0.64];
        let pi = std::f64::consts::PI;
        let known = [
            (0.25 / pi).sqrt(),
            (0.75 / pi).sqrt() * y,
            (0.75 / pi).sqrt() * z,
            (0.75 / pi).sqrt() * x,
            (3.75 / pi).sqrt() * x * y,
            (3.75 / pi).sqrt() * y * z,
            (5.0 / 16.0 / pi).sqrt() * (3.0 * z * z - 1.0),
            (3.75 / pi).sqrt() * x * z,
            (15.0 / 16.0 / pi).sqrt() * (x * x - y * y),
        ];
        for (found, known) in basis.spherical([x, y, z]).into_iter().zip(known) {
            assert!((found - known).abs() < 1e-14, "{found}, not {known}");
        }
    }

    proptest! {
        #[test]
        fn values_are_finite_and_agree_in_single_precision(z in 0.0..=1.0f64, azimuth in 0.0..6.3f64, order in 1..=MOST) {
            let sine = (1.0 - z * z).sqrt();
            let direction = [sine * azimuth.cos(), sine * azimuth.sin(), z];
            let (double, single) = (Basis::<f64>::new(order), Basis::<f32>::new(order));
            let pairs = double.hemispherical(direction).into_iter().zip(single.hemispherical(direction.map(|v| v as f32)));
            for (at, (double, single)) in pairs.enumerate() {
                prop_assert!((double - single as f64).abs() < 2e-4 * order as f64, "{at}: {single}, not {double}");
            }
        }

        #[test]
        fn the_stretch_keeps_directions_unit(z in 0.0..=1.0f64, azimuth in 0.0..6.3f64) {
            let sine = (1.0 - z * z).sqrt();
            let [x, y, z] = stretched([sine * azimuth.cos(), sine * azimuth.sin(), z]);
            prop_assert!((x * x + y * y + z * z - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn pole_and_horizon_are_no_exception() {
        let basis = Basis::<f32>::new(MOST);
        for direction in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, -1e-7], [1e-20, 0.0, 1.0]] {
            assert!(basis.hemispherical(direction).iter().all(|v| v.is_finite()), "{direction:?}");
        }
    }
}
