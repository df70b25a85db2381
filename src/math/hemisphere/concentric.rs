//! Squares of a square that is mapped to the disc under the hemisphere (Shirley and Chiu 1997).
//!
//! The square's diagonals part it into four sectors. In the first, a ≥ |b|, the point (a, b) has the radius a and the azimuth φ = π/4 · b/a; a quarter turn
//! takes a sector to the next. Areas keep their proportion, `dA = π/4 da db`: squares are strata of equal cosine-weighted solid angle. A ring of squares has arcs
//! for its inner and outer walls, where `a` is constant; the spokes between its squares, where `b` is, wind a little. What has no closed form is a smooth integral
//! over θ = asin a.

use super::{Builder, Table, Wall, grid};
use crate::math::harmonics::quadrature::gauss_legendre;
use crate::math::solid_angle::Interval;
use glam::{DVec2, DVec3, Vec2};
use std::f64::consts::FRAC_PI_4;

/// Points of the rule of Gauss and Legendre: enough for the widest ring, half the hemisphere.
const POINTS: usize = 24;
/// The golden ratio's fraction, whose multiples spread best.
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// 1/p and 1/p² of the root of p³ = p + 1: the golden ratio's like in the plane.
const SPREAD: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3];

pub(super) fn table(resolution: u32) -> Table {
    let mut builder = Builder::new(resolution, resolution);
    let rule = gauss_legendre(POINTS);
    for (row, column) in grid(resolution, resolution) {
        builder.place(row * resolution + column, sample(resolution, column, row), 1.0);
    }
    let sector = Sector { resolution, rule: &rule };
    (resolution / 2..resolution).for_each(|ring| sector.add_ring(&mut builder, ring));
    builder.finish()
}

/// Where the ray of a square goes. Through the middles of all, rays would have N/2 heights above the horizon, and none would be near it: a contact with
/// a wall would go unseen, and edges that run along a ring would be half of a ring off. So columns are shifted by golden fractions from row to row, and rows from
/// column to column: no two of a tile's rows or columns have the same place in their squares.
fn sample(resolution: u32, column: u32, row: u32) -> DVec3 {
    ray(resolution, [column, row], 0)
}

/// Where the rays of a square go, however many: the first is the sample's, others follow it by steps that spread over the square (the sequence R2).
pub fn ray(resolution: u32, [column, row]: [u32; 2], number: u32) -> DVec3 {
    let at = |square: u32, across: u32, step: f64| {
        let within = ((f64::from(across) + 0.5) * GOLDEN + f64::from(number) * step).fract();
        2.0 * (f64::from(square) + within) / f64::from(resolution) - 1.0
    };
    let (x, y) = (at(column, row, SPREAD[0]), at(row, column, SPREAD[1]));
    // Each sector is a quarter turn of another; opposite ones are each other's negatives.
    if x.abs() >= y.abs() { direction(x, y) } else { quarter_turn(direction(y, -x)) }
}

/// The square that a direction above the horizon is in, of so many along an edge, as column and row; `aside` are its x and y.
pub fn square(resolution: u32, aside: Vec2) -> [u32; 2] {
    let turned = aside.x.abs() < aside.y.abs();
    // The azimuth from the sector's own axis, which is x or y, forward or backward.
    let [along, across] = if turned { [aside.y, -aside.x] } else { [aside.x, aside.y] };
    let a = aside.length().min(1.0).copysign(along);
    let b = if along == 0.0 { 0.0 } else { a * (across / along).atan() / std::f32::consts::FRAC_PI_4 };
    let [x, y] = if turned { [-b, a] } else { [a, b] };
    [x, y].map(|at| (((at + 1.0) * 0.5 * resolution as f32).max(0.0) as u32).min(resolution - 1))
}

/// The first of the four sectors; its squares are counted by a and b. The others are quarter turns of it.
struct Sector<'a> {
    resolution: u32,
    rule: &'a [[f64; 2]],
}

impl Sector<'_> {
    /// A ring's part in all sectors. What a diagonal cuts belongs to two sectors, the square in the middle to all.
    fn add_ring(&self, builder: &mut Builder, ring: u32) {
        let a = self.bounds(ring).map(|a| a.max(0.0));
        let first = self.resolution - 1 - ring;
        for column in first..=ring {
            let b = self.bounds(column);
            let (moment, solid_angle) = self.region(a, b);
            let outer = (ring + 1 < self.resolution).then(|| arc(a[1], b));
            let side = (column > first).then(|| self.spoke(a, b[0]));
            for turns in 0..4 {
                let index = self.index([ring, column], turns);
                builder.region(index, turned(moment, turns), solid_angle);
                if let Some(wall) = outer {
                    builder.wall(index, self.index([ring + 1, column], turns), turned_wall(wall, turns));
                }
                if let Some(wall) = side {
                    builder.wall(self.index([ring, column - 1], turns), index, turned_wall(wall, turns));
                }
            }
        }
    }

    fn bounds(&self, square: u32) -> Interval {
        [square, square + 1].map(|line| 2.0 * f64::from(line) / f64::from(self.resolution) - 1.0)
    }

    /// The sample that a square is after so many quarter turns: rows grow with y, and each takes (x, y) to (−y, x).
    fn index(&self, square: [u32; 2], turns: u32) -> u32 {
        let [x, y] = (0..turns).fold(square, |[x, y], _| [self.resolution - 1 - y, x]);
        y * self.resolution + x
    }

    /// `∫ f(sinθ, cosθ) dθ` over an interval of sines.
    fn integral<T: std::ops::Mul<f64, Output = T> + std::iter::Sum>(&self, sines: Interval, f: impl Fn(f64, f64) -> T) -> T {
        let [from, to] = sines.map(f64::asin);
        let at = |&[t, weight]: &[f64; 2]| {
            let (sine, cosine) = (from + t * (to - from)).sin_cos();
            f(sine, cosine) * (weight * (to - from))
        };
        self.rule.iter().map(at).sum()
    }

    /// Moment and solid angle of what lies within the bounds and the sector: with `∫ (cosφ, sinφ) db = 4a/π (sinφ, −cosφ)` and `da = cosθ dθ`,
    /// the moment is `∫ ∫ (a cosφ, a sinφ, cosθ) π/4 db dθ`.
    fn region(&self, a: Interval, b: Interval) -> (DVec3, f64) {
        let across = |a: f64| [b[0].max(-a), b[1].min(a)];
        let moment = self.integral(a, |a, cosine| {
            let [low, high] = across(a);
            let [from, to] = [low, high].map(|b| DVec2::from_angle(azimuth(a, b)));
            (-(to - from).perp() * (a * a)).extend(FRAC_PI_4 * (high - low) * cosine)
        });
        let solid_angle = self.integral(a, |a, _| {
            let [low, high] = across(a);
            FRAC_PI_4 * (high - low)
        });
        (moment, solid_angle)
    }

    /// The wall where b is constant, towards larger b: `∫ cosθ p × dp` along p = (q, cosθ). With q = a (cosφ, sinφ) and
    /// a dφ/da = −φ, `dq/da` is (cosφ, sinφ) − φ (−sinφ, cosφ).
    fn spoke(&self, a: Interval, b: f64) -> Wall {
        let gradient = self.integral(a, |a, cosine| {
            let azimuth = azimuth(a, b);
            let along = DVec2::from_angle(azimuth);
            let slope = along - along.perp() * azimuth;
            let flat = (slope * (cosine * cosine) + along * (a * a)).perp();
            flat.extend(-cosine * FRAC_PI_4 * b) * cosine
        });
        Wall { gradient, ends: a.map(|a| direction(a, b)) }
    }
}

/// The wall where a is constant, outward.
fn arc(a: f64, b: Interval) -> Wall {
    let azimuths = b.map(|b| azimuth(a, b));
    Wall::along_parallel(DVec2::new(a, (1.0 - a * a).max(0.0).sqrt()), azimuths.map(DVec2::from_angle), azimuths[1] - azimuths[0])
}

fn turned(v: DVec3, turns: u32) -> DVec3 {
    (0..turns).fold(v, |v, _| quarter_turn(v))
}

fn turned_wall(wall: Wall, turns: u32) -> Wall {
    Wall { gradient: turned(wall.gradient, turns), ends: wall.ends.map(|end| turned(end, turns)) }
}

fn quarter_turn(v: DVec3) -> DVec3 {
    DVec3::new(-v.y, v.x, v.z)
}

fn azimuth(a: f64, b: f64) -> f64 {
    if a == 0.0 { 0.0 } else { FRAC_PI_4 * b / a }
}

fn direction(a: f64, b: f64) -> DVec3 {
    (DVec2::from_angle(azimuth(a, b)) * a).extend((1.0 - a * a).max(0.0).sqrt())
}
