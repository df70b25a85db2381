//! Families of functions over the hemisphere, side by side: how much of a function's energy so many of each hold (thesis, figures 3.9 and 3.10).

use super::{Basis, index, quadrature::hemisphere};
use std::f64::consts::PI;

/// A family of functions, ordered by degree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Hemispherical harmonics.
    Hemispherical,
    /// Spherical harmonics of a function that is 0 below the horizon.
    Spherical,
    /// Spherical harmonics of a function and its mirror image below the horizon (Sloan and others 2003): those that are odd in z are 0 and do not count.
    EvenReflected,
    /// Zernike's polynomials over the disc that has the hemisphere's areas (Koenderink and others 1996).
    Zernike,
    /// Associated Jacobi polynomials, shifted to the hemisphere, which is how the thesis describes Makhotkin's harmonics (1996). They are Zernike's functions, but
    /// counted as spherical harmonics are: up to one height for all m.
    Jacobi,
}

impl Family {
    pub const ALL: [Self; 5] = [Self::Hemispherical, Self::Spherical, Self::EvenReflected, Self::Zernike, Self::Jacobi];

    /// The functions of degrees below `order` at a unit direction with z ≥ 0, which are orthonormal over the hemisphere; spherical harmonics are so over
    /// the sphere.
    pub fn values(self, basis: &Basis<f64>, direction: [f64; 3]) -> Vec<f64> {
        match self {
            Self::Hemispherical => basis.hemispherical(direction),
            Self::Spherical => basis.spherical(direction),
            Self::EvenReflected => {
                let all = basis.spherical(direction);
                let even = |l: usize| (-(l as isize)..=l as isize).filter(move |m| (l as isize + m) % 2 == 0);
                (0..basis.order()).flat_map(|l| even(l).map(move |m| index(l, m))).map(|at| 2f64.sqrt() * all[at]).collect()
            }
            Self::Zernike => {
                let places = (0..basis.order() as isize).flat_map(|n| (-n..=n).step_by(2).map(move |m| (n, m)));
                on_disc(basis.order(), direction, places)
            }
            Self::Jacobi => {
                let places = (0..basis.order() as isize).flat_map(|l| (-l..=l).map(move |m| (2 * l - m.abs(), m)));
                on_disc(basis.order(), direction, places)
            }
        }
    }

    /// The share of a function's energy that the functions of degrees below `order` hold, and how many these are (equation 3.32).
    pub fn captured(self, order: usize, function: impl Fn([f64; 3]) -> f64) -> (f64, usize) {
        let basis = Basis::new(order);
        let (mut energy, mut products) = (0.0, Vec::new());
        for (direction, weight) in hemisphere(128, 256) {
            let value = function(direction);
            energy += weight * value * value;
            let functions = self.values(&basis, direction);
            products.resize(functions.len(), 0.0);
            products.iter_mut().zip(functions).for_each(|(sum, f): (&mut f64, f64)| *sum += weight * value * f);
        }
        (products.iter().map(|product| product * product).sum::<f64>() / energy, products.len())
    }
}

/// Zernike's polynomials of these degrees n and orders m, |m| below `order`.
fn on_disc(order: usize, [x, y, z]: [f64; 3], places: impl Iterator<Item = (isize, isize)>) -> Vec<f64> {
    // The place on the disc: its radius squared is 1 − z.
    let scale = 1.0 / (1.0 + z).sqrt();
    let mut powers = vec![[1.0, 0.0]];
    for m in 1..order {
        let [re, im] = powers[m - 1];
        powers.push([(x * re - y * im) * scale, (x * im + y * re) * scale]);
    }
    let value = |(n, m): (isize, isize)| {
        let around = m.unsigned_abs();
        let radial = jacobi((n as usize - around) / 2, around as f64, 2.0 * z - 1.0) * ((n + 1) as f64 / PI).sqrt();
        match m {
            0 => radial / 2f64.sqrt(),
            m if m > 0 => radial * powers[around][0],
            _ => radial * powers[around][1],
        }
    };
    places.map(value).collect()
}

/// Jacobi's polynomial of a degree for the weight `(1 − x)^alpha`.
fn jacobi(degree: usize, alpha: f64, x: f64) -> f64 {
    let (mut before, mut now) = (0.0, 1.0);
    for k in 1..=degree {
        let k = k as f64;
        let twice = 2.0 * k + alpha;
        let next = if k == 1.0 {
            alpha + 1.0 + (alpha + 2.0) * (x - 1.0) / 2.0
        } else {
            let a = (twice - 1.0) * (twice * (twice - 2.0) * x + alpha * alpha);
            let b = 2.0 * (k + alpha - 1.0) * (k - 1.0) * twice;
            (a * now - b * before) / (2.0 * k * (k + alpha) * (twice - 2.0))
        };
        (before, now) = (now, next);
    }
    now
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn lobe(degrees: f64, exponent: i32) -> impl Fn([f64; 3]) -> f64 {
        let axis = DVec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
        move |direction| DVec3::from(direction).dot(axis).max(0.0).powi(exponent)
    }

    #[test]
    fn families_are_orthonormal() {
        let order = 9;
        let basis = Basis::new(order);
        for (family, known) in [(Family::EvenReflected, order * (order + 1) / 2), (Family::Zernike, order * (order + 1) / 2), (Family::Jacobi, order * order)] {
            let points = hemisphere(48, 48);
            let values: Vec<_> = points.iter().map(|(direction, weight)| (family.values(&basis, *direction), weight)).collect();
            let count = values[0].0.len();
            assert_eq!(count, known);
            for i in 0..count {
                for j in 0..=i {
                    let product: f64 = values.iter().map(|(v, weight)| v[i] * v[j] * *weight).sum();
                    assert!((product - if i == j { 1.0 } else { 0.0 }).abs() < 1e-9, "{family:?} {i} {j}: {product}");
                }
            }
        }
    }

    /// A function of a family is held in whole once the order reaches it. Spherical harmonics, 0 below the horizon, hold half of what is the same above it.
    #[test]
    fn a_family_holds_its_own_functions() {
        for (family, counts) in Family::ALL.into_iter().zip([[1, 4], [1, 4], [1, 3], [1, 3], [1, 4]]) {
            let whole = if family == Family::Spherical { 0.5 } else { 1.0 };
            let (share, count) = family.captured(1, |_| 3.0);
            assert!((share - whole).abs() < 1e-9 && count == counts[0], "{family:?}: {share} {count}");
            let basis = Basis::new(2);
            let (share, count) = family.captured(2, |direction| family.values(&basis, direction)[1]);
            assert!((share - whole).abs() < 1e-9 && count == counts[1], "{family:?}: {share} {count}");
        }
        // A cosine: the first hemispherical harmonic has the square of its mean, 1/4, over the mean of its square, 1/3.
        let (share, _) = Family::Hemispherical.captured(1, |direction| direction[2]);
        assert!((share - 0.75).abs() < 1e-9, "{share}");
    }

    #[test]
    fn more_functions_hold_more_and_never_more_than_all() {
        for family in Family::ALL {
            let shares: Vec<f64> = [1, 2, 3, 5, 8, 11].into_iter().map(|order| family.captured(order, lobe(30.0, 5)).0).collect();
            assert!(shares.windows(2).all(|pair| pair[0] <= pair[1] + 1e-9) && shares[5] <= 1.0 + 1e-9, "{family:?}: {shares:?}");
        }
    }

    #[test]
    fn hemispherical_harmonics_hold_more_than_spherical_ones() {
        for degrees in [0.0, 30.0, 60.0] {
            for order in [2, 3, 4, 6, 9] {
                let [hemispherical, spherical] = [Family::Hemispherical, Family::Spherical].map(|family| family.captured(order, lobe(degrees, 5)).0);
                assert!(hemispherical >= spherical - 1e-3, "{degrees}°, order {order}: {hemispherical} to {spherical}");
            }
        }
    }
}
