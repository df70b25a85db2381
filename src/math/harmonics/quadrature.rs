//! Rules of Gauss and Legendre.

use std::f64::consts::{PI, TAU};

/// Points and weights on [0, 1]: exact for polynomials of degree 2·`count` − 1.
pub fn gauss_legendre(count: usize) -> Vec<[f64; 2]> {
    let point = |k: usize| {
        // A good first guess (Tricomi), then Newton's steps.
        let mut x = (PI * (k as f64 + 0.75) / (count as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..16 {
            let (mut before, mut now) = (1.0, x);
            for l in 2..=count {
                let l = l as f64;
                (before, now) = (now, ((2.0 * l - 1.0) * x * now - (l - 1.0) * before) / l);
            }
            slope = count as f64 * (x * now - before) / (x * x - 1.0);
            let step = now / slope;
            x -= step;
            if step.abs() < 1e-16 {
                break;
            }
        }
        [0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope)]
    };
    (0..count).map(point).collect()
}

/// Unit directions of the upper hemisphere with their solid angles [sr]: exact for spherical harmonics of a degree below `azimuths` and 2·`heights`,
/// and as good for hemispherical ones, which have a root of the height at the horizon.
pub fn hemisphere(heights: usize, azimuths: usize) -> Vec<([f64; 3], f64)> {
    let rows = gauss_legendre(heights).into_iter().map(|[t, weight]| (t * t, 2.0 * t * weight));
    let ring = move |(z, weight): (f64, f64)| {
        (0..azimuths).map(move |k| {
            let (sine, azimuth) = ((1.0 - z * z).max(0.0).sqrt(), TAU * (k as f64 + 0.5) / azimuths as f64);
            ([sine * azimuth.cos(), sine * azimuth.sin(), z], weight * TAU / azimuths as f64)
        })
    };
    rows.flat_map(ring).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_integrated_exactly() {
        for count in [1, 2, 5, 16, 97] {
            for degree in [0, 1, 2 * count - 1] {
                let sum: f64 = gauss_legendre(count).iter().map(|[x, w]| w * x.powi(degree as i32)).sum();
                assert!((sum * (degree + 1) as f64 - 1.0).abs() < 1e-12, "x^{degree} by {count} points");
            }
        }
    }

    #[test]
    fn the_hemisphere_has_its_area_and_cosine() {
        let points = hemisphere(32, 64);
        let area: f64 = points.iter().map(|(_, w)| w).sum();
        let cosine: f64 = points.iter().map(|(d, w)| d[2] * w).sum();
        assert!((area - TAU).abs() < 1e-12 && (cosine - PI).abs() < 1e-12);
    }
}
