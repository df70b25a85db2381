//! What of an error lies in the band of wavelengths that eyes see first, 5 to 30 pixels, inside surfaces: discs, streaks, splotches.
//!
//! The band is the difference of two blurs of the error. Each is a mean weighted by a Gaussian, over pixels of the same surface alone (normalised
//! convolution: Knutsson and Westin 1993), so that nothing is smeared over an edge and an error that is the same all over a surface is none in the band.
//!
//! Far from edges, a wave of wavelength L comes out of a Gaussian of deviation σ as `exp(−2π²σ²/L²)` of its height. The deviations are those that
//! halve waves of 5 and of 30 pixels, and the difference is scaled so that the wave which passes best, of 12 pixels, passes whole: 5 and 30 pixels
//! pass by 0.57 and 0.55, 2 and 100 pixels by 0.03 and 0.07.

use std::f64::consts::{LN_2, PI};

/// The wavelengths that the two blurs halve [pixels].
const BAND: [f64; 2] = [5.0, 30.0];

/// Kernels end at so many deviations.
const END: f64 = 3.0;

/// The share of the wide kernel's weight that must lie on a pixel's surface for its band to be told: half at a straight edge.
const ON_SURFACE: f64 = 0.5;

/// An error in the band at a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// In the unit of the error, signed.
    pub error: f64,
    /// What independent noise of the pixels brings about of its square.
    pub noise: f64,
}

/// The band at each pixel, rows from the top. `errors` are those of pixels, `variances` of their noise; `surfaces` tells which surface a pixel belongs to.
/// None where it belongs to none, or the surface is too small around it.
pub fn bands(errors: &[f64], variances: &[f64], surfaces: &[Option<u32>], width: usize) -> Vec<Option<Band>> {
    let [fine, wide] = BAND.map(|wavelength| gaussian(deviation(wavelength)));
    let filter = |plane: &[f64], kernel: &[f64]| filtered(plane, surfaces, width, kernel);
    let ones = vec![1.0; errors.len()];
    let [blurred, blurred_wide] = [&fine, &wide].map(|kernel| filter(errors, kernel));
    let [weight, weight_wide] = [&fine, &wide].map(|kernel| filter(&ones, kernel));
    // A pixel counts with fine/weight − wide/weight_wide. Products of Gaussians are Gaussians, so the sum of the squares falls apart in rows and columns too.
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<f64>>();
    let [squares, mixed, squares_wide] = [product(&fine, &fine), product(&fine, &wide), product(&wide, &wide)].map(|kernel| filter(variances, &kernel));
    let full = wide.iter().sum::<f64>().powi(2);
    let gain = gain();
    let band = |at: usize| Band {
        error: gain * (blurred[at] / weight[at] - blurred_wide[at] / weight_wide[at]),
        noise: gain * gain * (squares[at] / weight[at].powi(2) - 2.0 * mixed[at] / (weight[at] * weight_wide[at]) + squares_wide[at] / weight_wide[at].powi(2)),
    };
    let is_told = |at: &usize| surfaces[*at].is_some() && weight_wide[*at] >= ON_SURFACE * full;
    (0..errors.len()).map(|at| Some(at).filter(is_told).map(band)).collect()
}

/// The deviation of the Gaussian that halves waves of that length [pixels].
fn deviation(wavelength: f64) -> f64 {
    wavelength * (LN_2 / 2.0).sqrt() / PI
}

/// How many pixels share their noise in the band: the sum of the squared correlations of one with all others, `∫H⁴ / (∫H²)²` over all waves.
pub fn noise_area() -> f64 {
    let [a, b] = BAND.map(|wavelength| deviation(wavelength).powi(2));
    // A product of n Gaussians of the fine blur and m of the wide one has this integral, but for a factor.
    let integral = |n: f64, m: f64| 1.0 / (n * a + m * b);
    let square = integral(2.0, 0.0) - 2.0 * integral(1.0, 1.0) + integral(0.0, 2.0);
    let fourth = integral(4.0, 0.0) - 4.0 * integral(3.0, 1.0) + 6.0 * integral(2.0, 2.0) - 4.0 * integral(1.0, 3.0) + integral(0.0, 4.0);
    2.0 * PI * fourth / square.powi(2)
}

/// One over the height of the wave that passes best.
fn gain() -> f64 {
    let ratio = (BAND[1] / BAND[0]).powi(2);
    1.0 / (ratio.powf(-1.0 / (ratio - 1.0)) - ratio.powf(-ratio / (ratio - 1.0)))
}

/// A Gaussian at whole pixels, all kernels equally long.
fn gaussian(deviation: f64) -> Vec<f64> {
    let radius = (END * self::deviation(BAND[1])).ceil() as i32;
    (-radius..=radius).map(|x| (-f64::from(x * x) / (2.0 * deviation * deviation)).exp()).collect()
}

/// Weighted sums over the pixels of the same surface, along rows and then along columns.
fn filtered(plane: &[f64], surfaces: &[Option<u32>], width: usize, kernel: &[f64]) -> Vec<f64> {
    let height = plane.len() / width.max(1);
    let rows = summed(plane, surfaces, kernel, |at| (at % width, width, 1));
    summed(&rows, surfaces, kernel, |at| (at / width, height, width))
}

/// The same along one axis: `line` tells a pixel's place in its line, the line's length, and how far apart its pixels are.
fn summed(plane: &[f64], surfaces: &[Option<u32>], kernel: &[f64], line: impl Fn(usize) -> (usize, usize, usize)) -> Vec<f64> {
    let radius = kernel.len() / 2;
    let sum = |at: usize| {
        let (place, length, step) = line(at);
        let (from, to) = (radius.saturating_sub(place), (length + radius - place).min(kernel.len()));
        let other = |tap: usize| at + tap * step - radius * step;
        (from..to).map(|tap| (tap, other(tap))).filter(|&(_, other)| surfaces[other] == surfaces[at]).map(|(tap, other)| kernel[tap] * plane[other]).sum()
    };
    (0..plane.len()).map(|at| if surfaces[at].is_some() { sum(at) } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 260;
    const HEIGHT: usize = 50;

    /// The band of an error on one surface that fills the picture.
    fn whole(error: impl Fn(f64, f64) -> f64) -> Vec<Band> {
        let errors: Vec<f64> = (0..WIDTH * HEIGHT).map(|at| error((at % WIDTH) as f64, (at / WIDTH) as f64)).collect();
        bands(&errors, &errors, &[Some(0); WIDTH * HEIGHT], WIDTH).into_iter().map(|band| band.unwrap_or(Band { error: 0.0, noise: 0.0 })).collect()
    }

    /// How much of a wave along x passes, away from the borders and over whole waves.
    fn passed(wavelength: f64) -> f64 {
        let wave = |x: f64, phase: f64| (2.0 * PI * (x + phase) / wavelength).sin();
        let mean_square = |phase: f64| {
            let band = whole(|x, _| wave(x, phase));
            let inner = || (30..230).map(|x| 25 * WIDTH + x);
            (inner().map(|at| band[at].error.powi(2)).sum::<f64>(), inner().map(|at| wave((at % WIDTH) as f64, phase).powi(2)).sum::<f64>())
        };
        // Two phases a quarter apart: together they have the same square everywhere.
        let [(a, c), (b, d)] = [0.25, 0.25 + wavelength / 4.0].map(mean_square);
        ((a + b) / (c + d)).sqrt()
    }

    #[test]
    fn waves_of_5_to_30_pixels_pass_and_others_do_not() {
        let known = |wavelength: f64| {
            let [fine, wide] = BAND.map(|halved| 0.5f64.powf((halved / wavelength).powi(2)));
            gain() * (fine - wide)
        };
        for wavelength in [5.0, 6.0, 8.0, 12.0, 20.0, 25.0, 30.0] {
            assert!((passed(wavelength) - known(wavelength)).abs() < 0.01, "{wavelength}: {} in place of {}", passed(wavelength), known(wavelength));
            assert!(passed(wavelength) > 0.54, "{wavelength}: {}", passed(wavelength));
        }
        assert!((passed(12.0) - 1.0).abs() < 0.01);
        assert!(passed(2.0) < 0.04 && passed(100.0) < 0.08 && passed(2.5) < 0.08, "{} {} {}", passed(2.0), passed(100.0), passed(2.5));
    }

    #[test]
    fn an_error_that_is_the_same_all_over_a_surface_is_none_in_the_band() {
        let halves: Vec<Option<u32>> = (0..WIDTH * HEIGHT).map(|at| [Some(0), Some(1), None][[0, 0, 2, 1, 1][at % WIDTH / 52]]).collect();
        let errors: Vec<f64> = halves.iter().map(|half| [3.0, -7.0][half.unwrap_or(0) as usize]).collect();
        let found = bands(&errors, &errors, &halves, WIDTH);
        assert!(found.iter().flatten().all(|band| band.error.abs() < 1e-12));
        // Three quarters of a border are told, corners and what lies beyond are not.
        assert!(found[25 * WIDTH].is_some() && found[25 * WIDTH + 103].is_some() && found[25 * WIDTH + 104].is_none() && found[0].is_none());
        assert!(found.iter().flatten().count() > WIDTH * HEIGHT / 2);
    }

    /// Means of squares of made noise scatter as the area says.
    #[test]
    fn neighbours_share_their_noise() {
        let mean_square = |seed: u32| {
            let value = |at: u32| {
                let mut bits = (at + seed * 1_000_003).wrapping_mul(0x9e37_79b9);
                bits = (bits ^ (bits >> 16)).wrapping_mul(0x85eb_ca6b);
                bits = (bits ^ (bits >> 13)).wrapping_mul(0xc2b2_ae35);
                f64::from(bits ^ (bits >> 16)) / f64::from(u32::MAX) - 0.5
            };
            let errors: Vec<f64> = (0..80 * 80).map(value).collect();
            let found = bands(&errors, &vec![1.0 / 12.0; 80 * 80], &[Some(0); 80 * 80], 80);
            let inner = (20..60).flat_map(|y| (20..60).map(move |x| y * 80 + x)).filter_map(|at| found[at]);
            inner.map(|band| band.error.powi(2) / band.noise).sum::<f64>() / 1600.0
        };
        let means: Vec<f64> = (0..300).map(mean_square).collect();
        let mean = means.iter().sum::<f64>() / 300.0;
        let variance = means.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 299.0;
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
        // Three standard deviations of a variance of 300 values are 25 %.
        assert!((variance * 1600.0 / 2.0 / noise_area() - 1.0).abs() < 0.25, "{} against {}", variance * 800.0, noise_area());
        assert!((noise_area() - 5.19).abs() < 0.01);
    }

    /// The noise that is told is that of a filter's weights, which a lone bright pixel shows one by one.
    #[test]
    fn noise_is_the_sum_of_the_squared_weights() {
        let surface: Vec<Option<u32>> = (0..60 * 60).map(|at: usize| (at % 60 < 40 && at / 60 > 8).then_some(0)).collect();
        let at = 30 * 60 + 36;
        let variances: Vec<f64> = (0..60 * 60).map(|at| 1.0 + (at % 7) as f64).collect();
        let weight = |of: usize| {
            let lone: Vec<f64> = (0..60 * 60).map(|at| if at == of { 1.0 } else { 0.0 }).collect();
            bands(&lone, &variances, &surface, 60)[at].unwrap().error
        };
        let near = (12..48).flat_map(|y| (18..54).map(move |x| y * 60 + x));
        let known: f64 = near.map(|of| weight(of).powi(2) * variances[of]).sum();
        let found = bands(&variances, &variances, &surface, 60)[at].unwrap().noise;
        assert!((found / known - 1.0).abs() < 1e-9, "{found} {known}");
    }
}
