//! ꟻLIP: how much two pictures differ when a viewer flips between them (Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström,
//! Fairchild: "FLIP: A Difference Evaluator for Alternating Images", HPG 2020).
//!
//! Section and equation numbers below are that paper's. Both pictures are filtered as the eye filters colours at a distance (4.1), their
//! colour difference is taken in a perceptually even space (4.1.2), and is raised where edges and points differ (4.2, 4.3).

use crate::math::colour::luminance;
use glam::{DMat3, DVec3};
use std::f64::consts::PI;

/// The viewer of the paper: a 0.7 m wide screen of 3840 pixels at 0.7 m distance [pixels per degree].
pub const PIXELS_PER_DEGREE: f64 = 3840.0 / 0.7 * 0.7 * PI / 180.0;

/// How far away a pixel may be that decides over this one: half the width of the widest filter [pixels].
pub const REACH: u32 = 10;

/// Mean ꟻLIP error of two pictures, 0 (equal) .. 1.
///
/// `test` and `reference` hold `width · height` colours, linear Rec. 709 in 0..1 (the display's light, so tone-mapped), rows from the top.
/// Values outside are clamped. The mean over no pixel is 0.
pub fn flip(test: &[DVec3], reference: &[DVec3], width: usize) -> f64 {
    let map = flip_map(test, reference, width);
    if map.is_empty() { 0.0 } else { map.iter().sum::<f64>() / map.len() as f64 }
}

/// ꟻLIP error of each pixel, 0..1 (equation 14); arguments as for [`flip`].
pub fn flip_map(test: &[DVec3], reference: &[DVec3], width: usize) -> Vec<f64> {
    if width == 0 || test.len() != reference.len() {
        return Vec::new();
    }
    let [test, reference] =
        [test, reference].map(|picture| picture.iter().map(|&colour| opponent(xyz(colour.clamp(DVec3::ZERO, DVec3::ONE)))).collect::<Vec<_>>());
    let colour = colour_difference(&test, &reference, width);
    let feature = feature_difference(&test, &reference, width);
    colour.iter().zip(feature).map(|(colour, feature)| colour.powf(1.0 - feature)).collect()
}

/// Mean HDR-ꟻLIP error of two pictures of linear Rec. 709 light, 0 (equal) .. 1: at each pixel the largest ꟻLIP error that a viewer meets on the
/// way through all exposures of the reference. None where the reference is black and nothing tells how to expose it.
///
/// As [`flip`] otherwise; neither depends on the light's unit. (Andersson, Nilsson, Shirley, Akenine-Möller: "Visualizing Errors in Rendered High
/// Dynamic Range Images", Eurographics 2021.)
pub fn hdr_flip(test: &[DVec3], reference: &[DVec3], width: usize) -> Option<f64> {
    let largest = hdr_flip_map(test, reference, width, &exposures(reference)?);
    Some(largest.iter().sum::<f64>() / largest.len() as f64)
}

/// HDR-ꟻLIP error of each pixel, 0..1, at the exposures that [`exposures`] tells of the whole reference; other arguments as for [`hdr_flip`].
pub fn hdr_flip_map(test: &[DVec3], reference: &[DVec3], width: usize, exposures: &[f64]) -> Vec<f64> {
    let mut largest = vec![0.0f64; reference.len()];
    for stops in exposures {
        let [test, reference] = [test, reference].map(|picture| picture.iter().map(|&colour| filmic(colour * stops.exp2())).collect::<Vec<_>>());
        largest.iter_mut().zip(flip_map(&test, &reference, width)).for_each(|(largest, error)| *largest = largest.max(error));
    }
    largest
}

/// The curve `(k₀x² + k₁x + k₂) / (k₃x² + k₄x + k₅)` that stands for the film of the Academy Color Encoding System (Narkowicz 2015), with its
/// built-in exposure of 0.6.
const FILM: [f64; 6] = [0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14];

fn filmic(colour: DVec3) -> DVec3 {
    let [a, b, c, d, e, f] = FILM.map(DVec3::splat);
    let x = colour.max(DVec3::ZERO);
    (a * x * x + b * x + c) / (d * x * x + e * x + f)
}

/// Exposures from that which brings the brightest pixel of the reference just below white to that which brings the median pixel there, a stop or
/// less apart [stops]; None of a black one. Of an even number, the median is the upper one. A median below what single precision tells from the brightest pixel counts as that.
pub fn exposures(reference: &[DVec3]) -> Option<Vec<f64>> {
    let mut luminances: Vec<f64> = reference.iter().map(|colour| luminance(*colour)).collect();
    luminances.sort_by(f64::total_cmp);
    let brightest = luminances.last().copied().filter(|brightest| *brightest > 0.0)?;
    let median = luminances[luminances.len() / 2].max(brightest * f64::from(f32::EPSILON));
    let [start, stop] = [brightest, median].map(|luminance| (nearly_white() / luminance).log2());
    let count = (stop - start).ceil().max(2.0);
    Some((0..count as u32).map(|index| start + f64::from(index) * (stop - start) / (count - 1.0)).collect())
}

/// What the curve brings to 0.85: the larger root of a quadratic equation.
fn nearly_white() -> f64 {
    const SHOWN: f64 = 0.85;
    let [a, b, c] = [0, 1, 2].map(|power| FILM[power] - SHOWN * FILM[power + 3]);
    let roots = [-1.0, 1.0].map(|sign| (-b + sign * (b * b - 4.0 * a * c).sqrt()) / (2.0 * a));
    roots[0].max(roots[1])
}

/// Linear Rec. 709 to CIE XYZ (D65).
fn rec709_to_xyz() -> DMat3 {
    DMat3::from_cols_array_2d(&[
        [10135552.0 / 24577794.0, 2613072.0 / 12288897.0, 1425312.0 / 73733382.0],
        [8788810.0 / 24577794.0, 8788810.0 / 12288897.0, 8788810.0 / 73733382.0],
        [4435075.0 / 24577794.0, 887015.0 / 12288897.0, 70074185.0 / 73733382.0],
    ])
}

fn xyz(colour: DVec3) -> DVec3 {
    rec709_to_xyz() * colour
}

fn white() -> DVec3 {
    xyz(DVec3::ONE)
}

/// XYZ to the linear opponent space YCxCz (section 4.1.1), in which the eye's filters are known.
fn opponent(xyz: DVec3) -> DVec3 {
    let t = xyz / white();
    DVec3::new(116.0 * t.y - 16.0, 500.0 * (t.x - t.y), 200.0 * (t.y - t.z))
}

fn opponent_to_xyz(opponent: DVec3) -> DVec3 {
    let y = (opponent.x + 16.0) / 116.0;
    DVec3::new(y + opponent.y / 500.0, y, y - opponent.z / 200.0) * white()
}

/// XYZ to CIE L*a*b* with the Hunt effect: chroma counts less in the dark (equation 6).
fn hunt_lab(xyz: DVec3) -> DVec3 {
    const DELTA: f64 = 6.0 / 29.0;
    let f = |t: f64| if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let t = xyz / white();
    let (fx, fy, fz) = (f(t.x), f(t.y), f(t.z));
    let lightness = 116.0 * fy - 16.0;
    DVec3::new(lightness, 0.01 * lightness * 500.0 * (fx - fy), 0.01 * lightness * 200.0 * (fy - fz))
}

/// The distance HyAB (equation 7): large differences add up city-block between lightness and chroma.
fn hyab(a: DVec3, b: DVec3) -> f64 {
    let d = a - b;
    d.x.abs() + d.y.hypot(d.z)
}

fn colour_difference(test: &[DVec3], reference: &[DVec3], width: usize) -> Vec<f64> {
    // Equations 8 to 10: exponent, the knee between common and rare differences, and where the knee lies.
    const EXPONENT: f64 = 0.7;
    const KNEE: f64 = 0.4;
    const KNEE_VALUE: f64 = 0.95;
    let largest = hyab(hunt_lab(xyz(DVec3::Y)), hunt_lab(xyz(DVec3::Z))).powf(EXPONENT);
    let redistribute = |d: f64| {
        let knee = KNEE * largest;
        if d < knee { KNEE_VALUE / knee * d } else { KNEE_VALUE + (d - knee) / (largest - knee) * (1.0 - KNEE_VALUE) }
    };
    let (test, reference) = (perceived(test, width), perceived(reference, width));
    test.iter().zip(reference).map(|(&t, r)| redistribute(hyab(t, r).powf(EXPONENT)).clamp(0.0, 1.0)).collect()
}

/// What the eye makes of a picture in opponent space: filtered by its contrast sensitivity (equations 2 to 5), in Hunt-adjusted L*a*b*.
fn perceived(picture: &[DVec3], width: usize) -> Vec<DVec3> {
    // Each sensitivity is a sum of Gaussians (amplitude a, width b in degrees²), table 1.
    let sensitivities: [&[(f64, f64)]; 3] = [&[(1.0, 0.0047)], &[(1.0, 0.0053)], &[(34.1, 0.04), (13.5, 0.025)]];
    let radius = REACH as i32;
    let mut filtered = vec![DVec3::ZERO; picture.len()];
    for (axis, sensitivity) in sensitivities.into_iter().enumerate() {
        let kernels: Vec<(f64, Vec<f64>)> = sensitivity.iter().map(|&(a, b)| (a * PI / b, gaussian_degrees(b, radius))).collect();
        let total: f64 = kernels.iter().map(|(amplitude, kernel)| amplitude * kernel.iter().sum::<f64>().powi(2)).sum();
        let plane: Vec<f64> = picture.iter().map(|colour| colour[axis]).collect();
        for (amplitude, kernel) in &kernels {
            let part = convolve(&plane, width, kernel, kernel);
            filtered.iter_mut().zip(part).for_each(|(sum, value)| sum[axis] += amplitude / total * value);
        }
    }
    let to_rec709 = rec709_to_xyz().inverse();
    filtered.iter().map(|&colour| hunt_lab(xyz((to_rec709 * opponent_to_xyz(colour)).clamp(DVec3::ZERO, DVec3::ONE)))).collect()
}

fn gaussian_degrees(b: f64, radius: i32) -> Vec<f64> {
    (-radius..=radius).map(|x| (-(PI * x as f64 / PIXELS_PER_DEGREE).powi(2) / b).exp()).collect()
}

/// How much edges and points of the achromatic channels differ (equations 11 to 13).
fn feature_difference(test: &[DVec3], reference: &[DVec3], width: usize) -> Vec<f64> {
    // An edge as wide as the eye's peak sensitivity [degrees].
    const EDGE_WIDTH: f64 = 0.082;
    let deviation = 0.5 * EDGE_WIDTH * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as i32;
    let tap = |f: &dyn Fn(f64) -> f64| -> Vec<f64> {
        (-radius..=radius).map(|x| f(x as f64) * (-(x as f64).powi(2) / (2.0 * deviation * deviation)).exp()).collect()
    };
    let smooth = signs_to_one(tap(&|_| 1.0));
    let edge = signs_to_one(tap(&|x| -x));
    let point = signs_to_one(tap(&|x| x * x / (deviation * deviation) - 1.0));
    let strength = |picture: &[DVec3], kernel: &[f64]| -> Vec<f64> {
        let plane: Vec<f64> = picture.iter().map(|colour| (colour.x + 16.0) / 116.0).collect();
        convolve(&plane, width, kernel, &smooth).iter().zip(convolve(&plane, width, &smooth, kernel)).map(|(x, y)| x.hypot(y)).collect()
    };
    let difference = |kernel: &[f64]| -> Vec<f64> { strength(test, kernel).iter().zip(strength(reference, kernel)).map(|(t, r)| (t - r).abs()).collect() };
    let (edges, points) = (difference(&edge), difference(&point));
    edges.iter().zip(points).map(|(e, p)| (e.max(p) / 2f64.sqrt()).sqrt().clamp(0.0, 1.0)).collect()
}

/// The kernel with its positive taps scaled to a sum of 1 and its negative ones to −1.
fn signs_to_one(kernel: Vec<f64>) -> Vec<f64> {
    let positive: f64 = kernel.iter().filter(|&&tap| tap > 0.0).sum();
    let negative: f64 = -kernel.iter().filter(|&&tap| tap < 0.0).sum::<f64>();
    kernel
        .into_iter()
        .map(|tap| {
            if tap > 0.0 {
                tap / positive
            } else if tap < 0.0 {
                tap / negative
            } else {
                0.0
            }
        })
        .collect()
}

/// The plane filtered along its rows and then its columns; beyond the border stands the border's value.
fn convolve(plane: &[f64], width: usize, along_rows: &[f64], along_columns: &[f64]) -> Vec<f64> {
    let radius = along_rows.len() / 2;
    let mut rows = vec![0.0; plane.len()];
    for (filtered, row) in rows.chunks_mut(width).zip(plane.chunks(width)) {
        let border = |value: f64| std::iter::repeat_n(value, radius);
        let padded: Vec<f64> = border(row[0]).chain(row.iter().copied()).chain(border(row[width - 1])).collect();
        along_rows.iter().enumerate().for_each(|(tap, weight)| add(filtered, *weight, &padded[tap..]));
    }
    let (radius, last) = (along_columns.len() / 2, plane.len() / width - 1);
    let mut both = vec![0.0; plane.len()];
    for (y, filtered) in both.chunks_mut(width).enumerate() {
        for (tap, weight) in along_columns.iter().enumerate() {
            let row = (y + tap).saturating_sub(radius).min(last);
            add(filtered, *weight, &rows[row * width..]);
        }
    }
    both
}

fn add(sum: &mut [f64], weight: f64, values: &[f64]) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (24, 17);

    fn picture(colour: impl Fn(u64, u64) -> DVec3) -> Vec<DVec3> {
        (0..SIZE.1 as u64).flat_map(|y| (0..SIZE.0 as u64).map(move |x| (x, y))).map(|(x, y)| colour(x, y)).collect()
    }

    fn noise(seed: u64) -> Vec<DVec3> {
        let value = |x: u64, y: u64, c: u64| (((x * 73856093) ^ (y * 19349663) ^ (c * 83492791) ^ (seed * 2654435761)) & 0xffff) as f64 / 65535.0;
        picture(|x, y| DVec3::new(value(x, y, 0), value(x, y, 1), value(x, y, 2)))
    }

    fn ramp() -> Vec<DVec3> {
        picture(|x, _| x as f64 / 23.0 * DVec3::new(1.0, 0.5, 0.25))
    }

    /// The expected values are those of the authors' own program (package flip-evaluator 1.7) for the same pictures: mean, and the pixels (0, 0)
    /// and (11, 8). That program computes in single precision, and the root in equation 13 enlarges its rounding.
    #[track_caller]
    fn check(test: Vec<DVec3>, reference: Vec<DVec3>, mean: f64, corner: f64, inside: f64) {
        let map = flip_map(&test, &reference, SIZE.0);
        let found = [flip(&test, &reference, SIZE.0), map[0], map[8 * SIZE.0 + 11]];
        assert!(found.iter().zip([mean, corner, inside]).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?}");
    }

    #[test]
    fn no_filter_is_wider_than_the_reach() {
        // Three deviations of the widest Gaussian of the colours, and of the edges.
        let colours = 3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE;
        let edges = 3.0 * 0.5 * 0.082 * PIXELS_PER_DEGREE;
        assert_eq!(colours.max(edges).ceil() as u32, REACH);
    }

    /// A part of a picture knows the errors of its pixels but for those within the reach of its border.
    #[test]
    fn a_part_tells_what_the_whole_tells_away_from_its_border() {
        let (width, height, side, corner) = (60usize, 50usize, 30usize, 12usize);
        let value = |at: usize, seed: usize| ((at * 7919 + seed * 104_729) % 1009) as f64 / 1009.0;
        let [test, reference] = [1, 2].map(|seed| (0..width * height).map(|at| DVec3::new(value(at, seed), value(at, seed + 2), 0.5)).collect::<Vec<_>>());
        let part = |of: &[DVec3]| -> Vec<DVec3> { (0..side * side).map(|at| of[(at / side + corner) * width + at % side + corner]).collect() };
        let (whole, found) = (flip_map(&test, &reference, width), flip_map(&part(&test), &part(&reference), side));
        let reach = REACH as usize;
        for (x, y) in (reach..side - reach).flat_map(|x| (reach..side - reach).map(move |y| (x, y))) {
            assert!((found[y * side + x] - whole[(y + corner) * width + x + corner]).abs() < 1e-12, "{x} {y}");
        }
        assert!((found[0] - whole[corner * width + corner]).abs() > 1e-3, "a border is seen otherwise");
    }

    #[test]
    fn equals_the_authors_values_for_flat_pictures() {
        let flat = |colour| picture(move |_, _| colour);
        check(flat(DVec3::ZERO), flat(DVec3::ONE), 0.967386, 0.967388, 0.967388);
        check(flat(DVec3::Y), flat(DVec3::Z), 1.0, 1.0, 1.0);
        check(flat(DVec3::Y), flat(DVec3::Y), 0.0, 0.0, 0.0);
    }

    #[test]
    fn equals_the_authors_values_for_noise_and_ramps() {
        let mirrored = picture(|x, _| (23 - x) as f64 / 23.0 * DVec3::new(1.0, 0.5, 0.25));
        let darker = ramp().iter().map(|colour| colour * 0.8).collect();
        check(noise(1), noise(2), 0.4189322, 0.599521, 0.233887);
        check(ramp(), mirrored, 0.7063806, 0.967677, 0.138311);
        check(ramp(), darker, 0.3008843, 0.131734, 0.315766);
        check(noise(1), ramp(), 0.8128495, 0.963330, 0.842510);
    }

    /// Of the reference: `50 · value⁴` of noise, `2^(x/2 − 4)` to the right, a spot of 100 on 0.05, one bright pixel in the dark.
    fn bright_noise(seed: u64) -> Vec<DVec3> {
        noise(seed).iter().map(|colour| 50.0 * colour.powf(4.0)).collect()
    }

    fn stops(column: impl Fn(u64) -> u64) -> Vec<DVec3> {
        picture(|x, _| (column(x) as f64 / 2.0 - 4.0).exp2() * DVec3::new(1.0, 0.5, 0.25))
    }

    fn spot(column: f64) -> Vec<DVec3> {
        let square = |x: u64, y: u64| (x as f64 - column).powi(2) + (y as f64 - 8.0).powi(2);
        picture(|x, y| DVec3::splat(0.05) + 100.0 * (-square(x, y) / 6.0).exp() * DVec3::new(1.0, 0.8, 0.6))
    }

    fn lamp(column: u64, radiance: f64) -> Vec<DVec3> {
        picture(|x, y| if (x, y) == (column, 3) { DVec3::splat(radiance) } else { DVec3::ZERO })
    }

    /// The expected values are those of the authors' own program for the same pictures, as (row, column, channel) arrays in single precision:
    /// `pip install flip-evaluator==1.7`, then `flip_evaluator.evaluate(reference, test, "HDR", applyMagma=False)` gives a map, its mean,
    /// and the exposures (`startExposure`, `stopExposure`, `numExposures`).
    #[track_caller]
    fn check_hdr(test: &[DVec3], reference: &[DVec3], mean: f64, exposed: (f64, f64, usize)) {
        let stops = exposures(reference).unwrap();
        let (start, stop, count) = exposed;
        assert!(stops.len() == count && (stops[0] - start).abs() < 1e-3 && (stops[count - 1] - stop).abs() < 1e-3, "{stops:?}");
        let found = hdr_flip(test, reference, SIZE.0).unwrap();
        assert!((found - mean).abs() < 2e-4, "{found}");
    }

    #[test]
    fn hdr_equals_the_authors_values() {
        let mirrored = stops(|x| 23 - x);
        let [brighter, black] = [1.2, 0.0].map(|scale| stops(|x| x).iter().map(|colour| scale * colour).collect::<Vec<_>>());
        check_hdr(&bright_noise(2), &bright_noise(1), 0.559232, (-4.20994, -1.54899, 3));
        check_hdr(&mirrored, &stops(|x| x), 0.918980, (-5.65120, -0.15120, 6));
        check_hdr(&brighter, &stops(|x| x), 0.239866, (-5.65120, -0.15120, 6));
        check_hdr(&black, &stops(|x| x), 0.937020, (-5.65120, -0.15120, 6));
        check_hdr(&spot(12.0), &spot(11.0), 0.272720, (-5.28927, 5.35884, 11));
        check_hdr(&lamp(5, 0.5), &lamp(3, 1.0), 0.039777, (1.08330, 24.08330, 23));
    }

    #[test]
    fn hdr_needs_light_and_not_its_unit() {
        let scaled = |picture: Vec<DVec3>, power: i32| picture.iter().map(|colour| colour * f64::from(power).exp2()).collect::<Vec<_>>();
        let error = |power: i32| hdr_flip(&scaled(spot(12.0), power), &scaled(spot(11.0), power), SIZE.0).unwrap();
        assert!((error(0) - error(40)).abs() < 1e-9 && (error(0) - error(-40)).abs() < 1e-9);
        assert_eq!(hdr_flip(&spot(11.0), &lamp(3, 0.0), SIZE.0), None);
        assert_eq!(hdr_flip(&[], &[], 0), None);
        let flat = picture(|_, _| DVec3::splat(0.3));
        assert_eq!(hdr_flip(&flat, &flat, SIZE.0), Some(0.0));
    }

    #[test]
    fn is_symmetric_and_sees_a_shift_of_one_pixel() {
        let shifted: Vec<DVec3> = [noise(3)[0]].into_iter().chain(noise(3)).take(SIZE.0 * SIZE.1).collect();
        let error = flip(&noise(3), &shifted, SIZE.0);
        assert_eq!(error, flip(&shifted, &noise(3), SIZE.0));
        assert!(error > 0.05);
    }
}
