//! What arrives from all around, in spherical harmonics, and what a diffuse surface takes of it.

use super::{Basis, Conversion, Harmonics, MOST, Rotation, count, index, quadrature::hemisphere};
use crate::math::frame::Frame;
use glam::{DVec3, Vec2, Vec3, Vec3Swizzles};
use std::f64::consts::{PI, TAU};

/// Expansions in red, green and blue of a radiance that is known on a grid of latitude and longitude: `rows` from the pole down, `columns` from
/// azimuth 0 on. `radiance` is asked for the middle of each cell, by its polar angle and azimuth.
///
/// The sum along a row takes the trigonometric functions alone, so that large grids are summed in the time that it takes to read them.
pub fn project(order: usize, [rows, columns]: [usize; 2], radiance: impl Fn(f64, f64) -> DVec3) -> [Vec<f64>; 3] {
    let basis = Basis::<f64>::new(order);
    let azimuth = |column: usize| TAU * (column as f64 + 0.5) / columns as f64;
    let turns: Vec<Vec<(f64, f64)>> = (0..columns).map(|column| (0..order).map(|m| (m as f64 * azimuth(column)).sin_cos()).collect()).collect();
    let mut sums: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; count(order)]);
    for row in 0..rows {
        let edge = |row: usize| (PI * row as f64 / rows as f64).cos();
        let solid_angle = (edge(row) - edge(row + 1)) * TAU / columns as f64;
        let polar = PI * (row as f64 + 0.5) / rows as f64;
        let mut around = vec![[DVec3::ZERO; 2]; order];
        for (column, turns) in turns.iter().enumerate() {
            let value = radiance(polar, azimuth(column)) * solid_angle;
            around.iter_mut().zip(turns).for_each(|([cosines, sines], (sine, cosine))| {
                *cosines += value * *cosine;
                *sines += value * *sine;
            });
        }
        // At azimuth 0 the functions of m > 0 are their dependence on the polar angle.
        let along = basis.spherical([polar.sin(), 0.0, polar.cos()]);
        for l in 0..order {
            for (m, [cosines, sines]) in around.iter().enumerate().take(l + 1) {
                let height = along[index(l, m as isize)];
                for channel in 0..3 {
                    sums[channel][index(l, m as isize)] += height * cosines[channel];
                    if m > 0 {
                        sums[channel][index(l, -(m as isize))] += height * sines[channel];
                    }
                }
            }
        }
    }
    sums
}

/// The cosine above the horizon: of each degree the coefficient of m = 0; the others are 0. Its product with an expansion around the normal is the irradiance.
pub fn cosine_lobe(order: usize) -> Vec<f64> {
    let basis = Basis::<f64>::new(2);
    let mut cosine = vec![0.0; count(2)];
    for (direction, weight) in hemisphere(8, 8) {
        cosine.iter_mut().zip(basis.values(Harmonics::Hemispherical, direction)).for_each(|(sum, value)| *sum += weight * direction[2] * value);
    }
    let spherical = Conversion::new(2, order).to_spherical(&cosine);
    (0..order).map(|l| spherical[index(l, 0)]).collect()
}

/// The matrices of a quarter turn around x, which takes y to z, band by band, rows and columns by m: with turns around z alone, which mix only m and −m, it makes
/// any rotation.
pub fn quarter_turn(order: usize) -> Vec<f64> {
    Rotation::new(order, [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]).into_bands().concat()
}

/// Places whose light is summed side by side.
pub const LANES: usize = 8;

/// A number at each place.
pub type Lanes = [f32; LANES];

/// Red, green and blue.
type Colours = [Lanes; 3];

/// The light of a sky, for places of any orientation. The pole of its harmonics is up, y; their azimuth goes from z to x.
pub struct Sky {
    order: usize,
    /// Red, green and blue.
    coefficients: Vec<[f32; 3]>,
    cosine_lobe: Vec<f32>,
    /// Of each degree the rows of the quarter turn, and of the one back: columns and values, without those that are 0.
    quarters: Vec<[Vec<Row>; 2]>,
}

type Row = Vec<(usize, f32)>;

/// What arrives at places: for a surface that takes all in proportion to the cosine, and for both parts of a lobe.
#[derive(Debug, Clone, Default)]
pub struct Arriving {
    pub irradiance: Colours,
    pub flat: Colours,
    pub rise: Colours,
}

impl Sky {
    /// Of the expansions in red, green and blue.
    pub fn new(order: usize, [red, green, blue]: &[Vec<f64>; 3]) -> Self {
        let coefficients = red.iter().zip(green).zip(blue).map(|((r, g), b)| [*r as f32, *g as f32, *b as f32]).collect();
        let cosine_lobe = cosine_lobe(order).into_iter().map(|value| value as f32).collect();
        let matrices = quarter_turn(order);
        let mut first = 0;
        let mut next = |l: usize| {
            let width = 2 * l + 1;
            let matrix = &matrices[first..first + width * width];
            first += width * width;
            let row = |at: &dyn Fn(usize) -> usize| {
                let values = (0..width).map(|column| (column, matrix[at(column)] as f32));
                values.filter(|(_, value)| value.abs() > 1e-7).collect()
            };
            [(0..width).map(|r| row(&|c| r * width + c)).collect(), (0..width).map(|r| row(&|c| c * width + r)).collect()]
        };
        Self { order, coefficients, cosine_lobe, quarters: (0..order).map(&mut next).collect() }
    }

    /// What arrives in these frames; `flat` and `rise` are the spherical expansions of lobes there.
    pub fn arriving(&self, frames: &[Frame; LANES], flat: &[Lanes], rise: &[Lanes]) -> Arriving {
        let turns = self.turns(frames);
        let mut sums = Arriving::default();
        let mut band = [Colours::default(); MOST_BAND];
        let mut turned = band;
        for (l, [forth, back]) in self.quarters.iter().enumerate() {
            let width = 2 * l + 1;
            for (colours, values) in band.iter_mut().zip(&self.coefficients[index(l, -(l as isize))..][..width]) {
                *colours = values.map(|value| [value; LANES]);
            }
            turn_back(&mut band[..width], &turns[2]);
            quarter(forth, &band, &mut turned);
            turn_back(&mut turned[..width], &turns[1]);
            quarter(back, &turned, &mut band);
            add(&mut sums.irradiance, &band[l], &[self.cosine_lobe[l]; LANES]);
            if flat.is_empty() {
                continue;
            }
            turn_back(&mut band[..width], &turns[0]);
            for (i, colours) in band[..width].iter().enumerate() {
                add(&mut sums.flat, colours, &flat[l * l + i]);
                if let Some(rise) = rise.get(l * l + i) {
                    add(&mut sums.rise, colours, rise);
                }
            }
        }
        sums
    }

    /// Cosines and sines of the multiples of the Euler angles of frames, in the order in which they turn directions.
    fn turns(&self, frames: &[Frame; LANES]) -> [Multiples; 3] {
        let angles = frames.map(|frame| euler(&frame));
        std::array::from_fn(|which| {
            let turn: [Lanes; 2] = [angles.map(|angle| angle[which].x), angles.map(|angle| angle[which].y)];
            let mut multiples = [[[1.0; LANES], [0.0; LANES]]; MOST];
            for m in 1..self.order {
                let [re, im] = multiples[m - 1];
                let product = |a: &Lanes, b: &Lanes, c: &Lanes, d: &Lanes| std::array::from_fn(|i| a[i] * b[i] + c[i] * d[i]);
                let minus = im.map(|v| -v);
                multiples[m] = [product(&re, &turn[0], &minus, &turn[1]), product(&re, &turn[1], &im, &turn[0])];
            }
            multiples
        })
    }
}

/// Cosines and sines of the multiples of an angle at each place.
type Multiples = [[Lanes; 2]; MOST];

const MOST_BAND: usize = 2 * MOST - 1;

/// Cosines and sines of the angles around z, y and z again that take the axes of directions to those of a frame, seen from the sky's harmonics.
fn euler(frame: &Frame) -> [Vec2; 3] {
    let [tangent, normal] = [frame.tangent, frame.normal].map(Vec3::zxy);
    let flat = normal.truncate().length();
    let last = if flat > 1e-6 { normal.truncate() / flat } else { Vec2::X };
    // Where x and y come to lie by the other two: the tangent stands between them.
    let x = (last * normal.z).extend(-flat);
    let first = Vec2::new(tangent.dot(x), tangent.truncate().dot(last.perp()));
    [first.normalize_or(Vec2::X), Vec2::new(normal.z, flat), last]
}

/// Turns a band around z by minus the angle.
fn turn_back(band: &mut [Colours], multiples: &Multiples) {
    let l = band.len() / 2;
    for (m, [cosine, sine]) in multiples.iter().enumerate().take(l + 1).skip(1) {
        let (low, high) = band.split_at_mut(l + m);
        for (sines, cosines) in low[l - m].iter_mut().zip(&mut high[0]) {
            for i in 0..LANES {
                (cosines[i], sines[i]) = (cosines[i] * cosine[i] + sines[i] * sine[i], sines[i] * cosine[i] - cosines[i] * sine[i]);
            }
        }
    }
}

fn quarter(rows: &[Row], band: &[Colours], out: &mut [Colours]) {
    for (row, out) in rows.iter().zip(out) {
        let mut sum = Colours::default();
        row.iter().for_each(|(column, value)| add(&mut sum, &band[*column], &[*value; LANES]));
        *out = sum;
    }
}

fn add(sums: &mut Colours, colours: &Colours, factors: &Lanes) {
    for (sum, colour) in sums.iter_mut().zip(colours) {
        for i in 0..LANES {
            sum[i] += colour[i] * factors[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::harmonics::conversion::Conversion;

    /// Against the sky's rotation band by band, for frames that look everywhere, straight up and down too.
    #[test]
    fn skies_are_seen_in_any_frame() {
        let order = 9;
        let some = |seed: f64| (0..count(order)).map(|k| (seed + (k * k) as f64 * 0.37).sin()).collect::<Vec<_>>();
        let sky = [some(0.1), some(1.3), some(2.9)];
        let light = Sky::new(order, &sky);
        let normals = [
            Vec3::Y,
            Vec3::NEG_Y,
            Vec3::X,
            Vec3::NEG_Z,
            Vec3::new(0.48, 0.6, 0.64),
            Vec3::new(-0.6, 0.0, 0.8),
            Vec3::new(0.0, -0.8, 0.6),
            Vec3::new(1e-4, 1.0, 0.0),
        ];
        let mut turn = 0.0;
        let frames = normals.map(|normal| {
            turn += 0.7;
            Frame::new(normal.normalize()).turned(turn)
        });
        let lobe = Conversion::new(4, order).to_spherical(&some(0.5)[..count(4)]);
        let lanes: Vec<Lanes> = lobe.iter().map(|value| [*value as f32; LANES]).collect();
        let found = light.arriving(&frames, &lanes, &lanes[..count(3)]);
        for (lane, frame) in frames.iter().enumerate() {
            // From the world, its pole up, to the frame.
            let axes = [frame.tangent, frame.bitangent, frame.normal].map(|axis| axis.zxy().as_dvec3().to_array());
            let rotation = Rotation::new(order, axes);
            for channel in 0..3 {
                let seen = rotation.apply(&sky[channel]);
                let dot = |lobe: &[f64]| lobe.iter().zip(&seen).map(|(a, b)| a * b).sum::<f64>();
                let mut cosine = vec![0.0; count(order)];
                cosine_lobe(order).into_iter().enumerate().for_each(|(l, value)| cosine[index(l, 0)] = value);
                let known = [dot(&cosine), dot(&lobe), dot(&lobe[..count(3)])];
                for (found, known) in [&found.irradiance, &found.flat, &found.rise].map(|colours| f64::from(colours[channel][lane])).into_iter().zip(known) {
                    assert!((found - known).abs() < 2e-4, "{lane} {channel}: {found}, not {known}");
                }
            }
        }
    }

    #[test]
    fn radiance_is_asked_for_the_middles_of_cells() {
        let asked = std::cell::RefCell::new(Vec::new());
        project(1, [2, 4], |polar, azimuth| {
            asked.borrow_mut().push([polar / PI, azimuth / TAU]);
            DVec3::ZERO
        });
        let known = [0.25, 0.75].into_iter().flat_map(|row| [0.125, 0.375, 0.625, 0.875].map(|column| [row, column]));
        let asked = asked.into_inner();
        assert!(asked.len() == 8 && asked.iter().zip(known).all(|(a, b)| (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) < 1e-15), "{asked:?}");
    }

    #[test]
    fn a_harmonic_is_its_own_expansion() {
        let order = 6;
        let basis = Basis::<f64>::new(order);
        for (l, m) in [(0, 0), (1, -1), (3, 2), (5, 0), (5, -4)] {
            let at = index(l, m);
            let value = |polar: f64, azimuth: f64| basis.spherical([polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()])[at];
            let found = project(order, [256, 64], |polar, azimuth| DVec3::new(1.0, 0.5, 0.0) * value(polar, azimuth));
            for (k, coefficient) in found[0].iter().enumerate() {
                let known = if k == at { 1.0 } else { 0.0 };
                assert!((coefficient - known).abs() < 1e-3 && (found[1][k] - 0.5 * known).abs() < 1e-3 && found[2][k] == 0.0, "{l} {m} {k}: {coefficient}");
            }
        }
    }

    /// Ramamoorthi and Hanrahan's factors (2001): π, 2π/3, π/4, 0, −π/24 of the square roots that a zonal function is normalised by.
    #[test]
    fn the_cosine_has_its_known_coefficients() {
        let found = cosine_lobe(5);
        for (l, known) in [PI, TAU / 3.0, PI / 4.0, 0.0, -PI / 24.0].into_iter().enumerate() {
            let factor = found[l] * (4.0 * PI / (2 * l + 1) as f64).sqrt();
            assert!((factor - known).abs() < 1e-9, "{l}: {factor}, not {known}");
        }
    }

    /// As shaders leave them out: of a row only columns of one sign, and every second of them.
    #[test]
    fn three_quarters_of_a_quarter_turn_are_nothing() {
        let order = 8;
        let matrices = quarter_turn(order);
        let mut first = 0;
        for l in 0..order as isize {
            for row in -l..=l {
                for column in -l..=l {
                    let is_kept = (column >= 0) == ((l + row) % 2 == 0) && (l + column + isize::from(row < 0)) % 2 == 0;
                    let value = matrices[first + ((row + l) * (2 * l + 1) + column + l) as usize];
                    assert!(is_kept || value.abs() < 1e-12, "{l} {row} {column}: {value}");
                }
            }
            first += ((2 * l + 1) * (2 * l + 1)) as usize;
        }
    }
}
