//! Lobes as expansions in hemispherical harmonics: what a surface reflects is the dot product of such an expansion with that of the
//! radiance that arrives (Gautron's thesis, 2.10 and 3.5).

use super::{Basis, count, index, quadrature::hemisphere};
use crate::math::lobe::{Lobe, Shape};
use glam::{Vec2, Vec3, Vec4};

/// A lobe times the cosine, projected for every outgoing direction of a paraboloid's grid (thesis, 3.35 and 3.36).
#[derive(Debug, Clone, PartialEq)]
pub struct LobeTable {
    pub order: usize,
    /// Directions along an edge of the grid.
    pub edge: usize,
    /// Row by row; of each direction [`PARTS`] expansions of [`quads`], four coefficients each.
    pub values: Vec<Vec4>,
}

/// A lobe is the first part times its reflectance and the second: Schlick's rise toward grazing angles, 0 for lobes without it.
pub const PARTS: usize = 2;

/// Fours of numbers that an expansion of an order takes, 0 beyond [`count`].
pub const fn quads(order: usize) -> usize {
    count(order).div_ceil(4)
}

/// Numbers in fours.
pub fn in_fours(values: impl Iterator<Item = f64>, fours: &mut [Vec4]) {
    for (at, value) in values.enumerate() {
        fours[at / 4][at % 4] = value as f32;
    }
}

/// How the terms of high degree are faded out, so that what the order cuts off does not ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Window {
    None,
    /// By half a period of a cosine (von Hann), which also widens the lobe.
    Hann,
}

impl Window {
    /// Of terms of degree `l` in an expansion of `order`.
    pub fn factor(self, l: usize, order: usize) -> f64 {
        match self {
            Self::None => 1.0,
            Self::Hann => 0.5 * (1.0 + (std::f64::consts::PI * l as f64 / order as f64).cos()),
        }
    }
}

/// Place of a direction with z ≥ 0 in the unit square of the paraboloid.
pub fn paraboloid(direction: Vec3) -> Vec2 {
    0.5 + 0.5 * direction.truncate() / (1.0 + direction.z.max(0.0))
}

/// Unit direction of a place in the unit square; where it lies below the horizon, the nearest above.
pub fn direction_at(place: Vec2) -> Vec3 {
    let at = 2.0 * place - 1.0;
    let squared = at.length_squared();
    if squared > LEAST_HEIGHT_SQUARED {
        return (at.normalize() * (1.0 - LEAST_HEIGHT * LEAST_HEIGHT).sqrt()).extend(LEAST_HEIGHT);
    }
    (2.0 * at).extend(1.0 - squared) / (1.0 + squared)
}

/// Lowest outgoing directions: along the horizon itself nothing is seen.
const LEAST_HEIGHT: f32 = 1e-3;
const LEAST_HEIGHT_SQUARED: f32 = (1.0 - LEAST_HEIGHT) / (1.0 + LEAST_HEIGHT);

impl LobeTable {
    /// Projects a lobe; its reflectance is left out.
    pub fn new(shape: Shape, order: usize, edge: usize, window: Window) -> Self {
        let projector = Projector::new(shape, order, window);
        let places = (0..edge * edge).map(|at| (Vec2::new((at % edge) as f32, (at / edge) as f32) + 0.5) / edge as f32);
        let stride = PARTS * quads(order);
        let mut values = vec![Vec4::ZERO; edge * edge * stride];
        let mut upright: Vec<(u32, Vec<Vec<f64>>)> = Vec::new();
        for (place, out) in places.zip(values.chunks_exact_mut(stride)) {
            let outgoing = direction_at(place);
            let parts = match shape {
                Shape::Ward { alpha } if alpha.x != alpha.y => projector.project(outgoing),
                // Alike around the normal: one projection a height, turned.
                _ => {
                    let key = (outgoing.z * 1e6) as u32;
                    let known = upright.iter().position(|(known, _)| *known == key).unwrap_or_else(|| {
                        upright.push((key, projector.project(Vec3::new((1.0 - outgoing.z * outgoing.z).max(0.0).sqrt(), 0.0, outgoing.z))));
                        upright.len() - 1
                    });
                    let azimuth = (outgoing.y as f64).atan2(outgoing.x as f64);
                    let mut parts = upright[known].1.clone();
                    parts.iter_mut().for_each(|part| super::tilt::turn(part, azimuth));
                    parts
                }
            };
            parts.into_iter().zip(out.chunks_exact_mut(quads(order))).for_each(|(part, out)| in_fours(part.into_iter(), out));
        }
        Self { order, edge, values }
    }

    /// Both parts toward an outgoing direction, [`quads`] each, interpolated.
    pub fn lookup(&self, outgoing: Vec3, parts: [&mut [Vec4]; PARTS]) {
        let stride = PARTS * quads(self.order);
        let last = self.edge as f32 - 1.0;
        let at = (paraboloid(outgoing) * self.edge as f32 - 0.5).clamp(Vec2::ZERO, Vec2::splat(last));
        let base = at.floor().min(Vec2::splat((last - 1.0).max(0.0)));
        let f = at - base;
        let first = (base.y as usize * self.edge + base.x as usize) * stride;
        let (right, below) = if self.edge > 1 { (stride, stride * self.edge) } else { (0, 0) };
        let weights = [(1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y];
        for (part, out) in parts.into_iter().enumerate() {
            let corner = |offset: usize| &self.values[first + offset + part * quads(self.order)..][..out.len()];
            let [a, b, c, d] = [corner(0), corner(right), corner(below), corner(right + below)];
            for (i, out) in out.iter_mut().enumerate() {
                *out = a[i] * weights[0] + b[i] * weights[1] + c[i] * weights[2] + d[i] * weights[3];
            }
        }
    }
}

/// The share of a lobe's energy that an expansion of each order from 1 to `most` holds, averaged over some outgoing directions: the integral
/// of its square, times the cosine (thesis, 3.32).
pub fn energy_by_order(shape: Shape, most: usize) -> Vec<f64> {
    let lobe = Lobe { shape, reflectance: Vec3::ONE };
    let mut held = vec![0.0; most];
    for angle in ANGLES {
        let (sine, cosine) = (angle as f32).to_radians().sin_cos();
        let outgoing = Vec3::new(sine, 0.0, cosine);
        let function = |d: [f64; 3]| lobe.value(outgoing, Vec3::from(d.map(|x| x as f32))).x as f64 * d[2];
        let (heights, azimuths) = points(shape, most);
        let basis = Basis::<f64>::new(most);
        let mut coefficients = vec![0.0; count(most)];
        let mut all = 0.0;
        for (direction, weight) in hemisphere(heights, azimuths) {
            let value = function(direction);
            all += weight * value * value;
            if value.abs() > 1e-12 {
                let values = basis.hemispherical(direction);
                coefficients.iter_mut().zip(values).for_each(|(sum, basis)| *sum += weight * value * basis);
            }
        }
        let mut sum = 0.0;
        for (l, held) in held.iter_mut().enumerate() {
            sum += coefficients[count(l)..count(l + 1)].iter().map(|c| c * c).sum::<f64>();
            *held += sum / all.max(f64::MIN_POSITIVE) / ANGLES.len() as f64;
        }
    }
    held
}

/// Outgoing directions by which an order is judged [degrees].
const ANGLES: [f64; 3] = [0.0, 30.0, 60.0];

/// Heights and azimuths of the points that a lobe takes, for products with functions of an order.
fn points(shape: Shape, order: usize) -> (usize, usize) {
    let width = match shape {
        Shape::Phong { exponent } => (2.0 / (exponent as f64).max(2.0)).sqrt(),
        Shape::Ward { alpha } => alpha.min_element() as f64,
        Shape::Microfacets { alpha } => alpha as f64,
    };
    let heights = (order + 16 + (8.0 / width.max(0.02)) as usize).min(320);
    (heights, 2 * heights)
}

/// Points over the hemisphere with the values of the basis there.
struct Projector {
    shape: Shape,
    order: usize,
    window: Window,
    points: Vec<(Vec3, f64)>,
    /// Point by point.
    basis: Vec<f64>,
}

impl Projector {
    fn new(shape: Shape, order: usize, window: Window) -> Self {
        let (heights, azimuths) = points(shape, order);
        let basis = Basis::<f64>::new(order);
        let points = hemisphere(heights, azimuths);
        let values = points.iter().flat_map(|(direction, _)| basis.hemispherical(*direction)).collect();
        let points = points.into_iter().map(|(d, weight)| (Vec3::from(d.map(|x| x as f32)), weight * d[2])).collect();
        Self { shape, order, window, points, basis: values }
    }

    /// Both parts of the lobe toward an outgoing direction.
    fn project(&self, outgoing: Vec3) -> Vec<Vec<f64>> {
        // Of no reflectance is left what rises toward grazing angles alone.
        let [white, black] = [Vec3::ONE, Vec3::ZERO].map(|reflectance| Lobe { shape: self.shape, reflectance });
        let mut parts = vec![vec![0.0; count(self.order)]; PARTS];
        for ((incoming, weight), basis) in self.points.iter().zip(self.basis.chunks_exact(count(self.order))) {
            let rise = black.value(outgoing, *incoming).x as f64;
            let values = [white.value(outgoing, *incoming).x as f64 - rise, rise];
            for (part, value) in parts.iter_mut().zip(values) {
                let factor = value * weight;
                if factor.abs() > 1e-12 {
                    part.iter_mut().zip(basis).for_each(|(sum, basis)| *sum += factor * basis);
                }
            }
        }
        for part in &mut parts {
            for l in 0..self.order {
                let factor = self.window.factor(l, self.order);
                part[index(l, -(l as isize))..=index(l, l as isize)].iter_mut().for_each(|c| *c *= factor);
            }
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::super::MOST;
    use super::*;

    fn coefficients(table: &LobeTable, outgoing: Vec3, reflectance: f32) -> Vec<f32> {
        let [mut a, mut b] = [vec![Vec4::ZERO; quads(table.order)], vec![Vec4::ZERO; quads(table.order)]];
        table.lookup(outgoing, [&mut a, &mut b]);
        a.iter().zip(&b).flat_map(|(a, b)| (*a * reflectance + *b).to_array()).collect()
    }

    #[test]
    fn the_paraboloid_inverts() {
        for direction in [Vec3::Z, Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.48, 0.6, 0.64)] {
            assert!(direction_at(paraboloid(direction)).distance(direction) < 1e-6);
        }
        assert!((direction_at(Vec2::new(1.0, 1.0)).length() - 1.0).abs() < 1e-6);
    }

    /// Light that is an expansion itself is reflected as by the integral over the lobe.
    #[test]
    fn dot_products_are_integrals() {
        let order = 8;
        let basis = Basis::<f64>::new(order);
        let light: Vec<f64> = (0..count(order)).map(|k| (k as f64 * 0.7).cos() / (1.0 + k as f64)).collect();
        let shapes = [Shape::Phong { exponent: 12.0 }, Shape::Ward { alpha: Vec2::new(0.3, 0.6) }, Shape::Microfacets { alpha: 0.4 }];
        for (shape, reflectance) in shapes.into_iter().zip([1.0, 1.0, 0.3]) {
            let table = LobeTable::new(shape, order, 64, Window::None);
            let lobe = Lobe { shape, reflectance: Vec3::splat(reflectance) };
            for outgoing in [Vec3::Z, Vec3::new(0.48, 0.36, 0.8), Vec3::new(-0.6, 0.48, 0.64)] {
                let known: f64 = hemisphere(96, 192)
                    .into_iter()
                    .map(|(d, w)| {
                        let arriving: f64 = basis.hemispherical(d).iter().zip(&light).map(|(h, l)| h * l).sum();
                        w * d[2] * arriving * lobe.value(outgoing, Vec3::from(d.map(|x| x as f32))).x as f64
                    })
                    .sum();
                let found: f64 = coefficients(&table, outgoing, reflectance).iter().zip(&light).map(|(c, l)| *c as f64 * l).sum();
                assert!((found - known).abs() < 0.01 * known.abs().max(0.1), "{shape:?} {outgoing}: {found}, not {known}");
            }
        }
    }

    /// The highest order, and lobes that no order holds.
    #[test]
    fn extremes_are_finite() {
        let shapes =
            [Shape::Phong { exponent: 1e4 }, Shape::Phong { exponent: 0.0 }, Shape::Ward { alpha: Vec2::new(1e-3, 1.0) }, Shape::Microfacets { alpha: 0.0 }];
        for shape in shapes {
            let table = LobeTable::new(shape, MOST, 4, Window::None);
            assert!(table.values.iter().all(|four| four.is_finite()), "{shape:?}");
            for held in energy_by_order(shape, MOST) {
                assert!((0.0..=1.0 + 1e-3).contains(&held), "{shape:?}: {held}");
            }
        }
        let broad = energy_by_order(Shape::Phong { exponent: 0.0 }, 2);
        assert!(broad[1] > 1.0 - 1e-6, "a cosine is two harmonics: {broad:?}");
    }

    #[test]
    fn sharper_lobes_take_higher_orders() {
        let enough = |exponent: f32| energy_by_order(Shape::Phong { exponent }, 20).iter().position(|held| *held > 0.95);
        let [broad, middle, sharp] = [enough(5.0), enough(20.0), enough(60.0)].map(|order| order.expect("an order below 20"));
        assert!(broad < middle && middle < sharp, "{broad} {middle} {sharp}");
        for pair in energy_by_order(Shape::Microfacets { alpha: 0.3 }, 12).windows(2) {
            assert!(pair[0] <= pair[1] + 1e-9 && pair[1] <= 1.0 + 1e-3, "{pair:?}");
        }
    }
}
