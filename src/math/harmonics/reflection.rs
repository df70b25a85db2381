//! Lobes as expansions in hemispherical harmonics: what a surface reflects is the dot product of such an expansion with that of the
//! radiance that arrives (Gautron's thesis, 2.10 and 3.5).

use super::{Basis, Conversion, Harmonics, count, index, quadrature::hemisphere, tilt::turn};
use crate::math::lobe::{Lobe, Shape};
use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::FRAC_PI_2;

/// A lobe times the cosine, projected for every outgoing direction of a paraboloid's grid (thesis, 3.35 and 3.36).
#[derive(Debug, Clone, PartialEq)]
pub struct LobeTable {
    pub harmonics: Harmonics,
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

/// Fours of numbers that a table takes: of `edge`² directions [`PARTS`] expansions each.
pub const fn table_fours(order: usize, edge: usize) -> usize {
    edge * edge * PARTS * quads(order)
}

/// An expansion in fours.
pub fn fours(values: &[f64]) -> Vec<Vec4> {
    let mut fours = vec![Vec4::ZERO; values.len().div_ceil(4)];
    values.iter().enumerate().for_each(|(at, value)| fours[at / 4][at % 4] = *value as f32);
    fours
}

/// The inverse of [`fours`].
pub fn numbers(fours: &[Vec4], order: usize) -> Vec<f64> {
    fours.iter().flat_map(|four| four.to_array()).map(f64::from).take(count(order)).collect()
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

/// What lobes are expanded in.
#[derive(Debug, Clone, Copy)]
pub struct Series {
    pub harmonics: Harmonics,
    pub order: usize,
    pub window: Window,
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
    /// Another one wherever the numbers change: tables are kept between runs.
    pub const VERSION: u32 = 1;

    /// Projects a lobe; its reflectance is left out.
    pub fn new(shape: Shape, series: Series, edge: usize) -> Self {
        let (Series { harmonics, order, .. }, projector) = (series, Projector::new(shape, series));
        let upright = (!shape.is_anisotropic()).then(|| Upright::new(&projector));
        let places = (0..edge * edge).map(|at| (Vec2::new((at % edge) as f32, (at / edge) as f32) + 0.5) / edge as f32);
        let stride = PARTS * quads(order);
        let mut values = vec![Vec4::ZERO; table_fours(order, edge)];
        for (place, out) in places.zip(values.chunks_exact_mut(stride)) {
            let outgoing = direction_at(place);
            let parts = upright.as_ref().map_or_else(|| projector.project(outgoing), |upright| upright.toward(outgoing));
            parts.into_iter().zip(out.chunks_exact_mut(quads(order))).for_each(|(part, out)| out.copy_from_slice(&fours(&part)));
        }
        Self { harmonics, order, edge, values }
    }

    /// The same in spherical harmonics of an order.
    pub fn in_spherical(&self, order: usize) -> Self {
        let conversion = Conversion::new(self.order, order);
        let convert = |part: &[Vec4]| match self.harmonics {
            Harmonics::Hemispherical => conversion.to_spherical(&numbers(part, self.order)),
            Harmonics::Spherical => {
                let mut numbers = numbers(part, self.order);
                numbers.resize(count(order), 0.0);
                numbers
            }
        };
        let values = self.values.chunks_exact(quads(self.order)).flat_map(|part| fours(&convert(part))).collect();
        Self { harmonics: Harmonics::Spherical, order, edge: self.edge, values }
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
pub fn energy_by_order(shape: Shape, harmonics: Harmonics, most: usize) -> Vec<f64> {
    let projector = Projector::new(shape, Series { harmonics, order: most, window: Window::None });
    let mut held = vec![0.0; most];
    for angle in ANGLES {
        let (sine, cosine) = f32::to_radians(angle).sin_cos();
        let mut coefficients = vec![0.0; count(most)];
        let mut all = 0.0;
        projector.visit(Vec3::new(sine, 0.0, cosine), |point| {
            let value = point.values.iter().sum::<f64>() * point.cosine;
            all += point.solid_angle * value * value;
            coefficients.iter_mut().zip(point.basis).for_each(|(sum, basis)| *sum += point.solid_angle * value * basis);
        });
        let mut sum = 0.0;
        for (l, held) in held.iter_mut().enumerate() {
            sum += coefficients[count(l)..count(l + 1)].iter().map(|c| c * c).sum::<f64>();
            *held += (sum / all.max(f64::MIN_POSITIVE)).min(1.0) / ANGLES.len() as f64;
        }
    }
    held
}

/// Outgoing directions by which an order is judged [degrees].
const ANGLES: [f32; 3] = [0.0, 30.0, 60.0];

/// Lobes narrower than this [radians] are not met by points that do not know where they are.
const NARROW: f64 = 0.12;
/// Points along both axes of the numbers that directions are drawn by.
const DRAWN: usize = 64;

/// The projections of a lobe that is alike around the normal, toward angles from the normal to the horizon in even steps.
struct Upright(Vec<Vec<Vec<f64>>>);

/// Steps of the projections of a lobe that is alike around the normal, from the normal to the horizon.
pub const STEPS: usize = 96;

/// Outgoing direction of a step, at azimuth 0.
pub fn height_direction(step: usize) -> Vec3 {
    let angle = FRAC_PI_2 * step as f32 / STEPS as f32;
    Vec3::new(angle.sin(), 0.0, angle.cos().max(LEAST_HEIGHT))
}

impl Upright {
    fn new(projector: &Projector) -> Self {
        Self((0..=STEPS).map(|step| projector.project(height_direction(step))).collect())
    }

    fn toward(&self, outgoing: Vec3) -> Vec<Vec<f64>> {
        let at = outgoing.truncate().length().atan2(outgoing.z) / FRAC_PI_2 * STEPS as f32;
        let base = (at as usize).min(STEPS - 1);
        let share = f64::from(at) - base as f64;
        let azimuth = f64::from(outgoing.y).atan2(f64::from(outgoing.x));
        let between = |(a, b): (&Vec<f64>, &Vec<f64>)| {
            let mut part: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + (b - a) * share).collect();
            turn(&mut part, azimuth);
            part
        };
        self.0[base].iter().zip(&self.0[base + 1]).map(between).collect()
    }
}

/// A direction that a lobe is looked at from.
struct Point<'a> {
    /// Of both parts.
    values: [f64; PARTS],
    cosine: f64,
    /// What the point stands for [sr].
    solid_angle: f64,
    basis: &'a [f64],
}

/// Directions over the whole hemisphere that meet a lobe wherever it is, and what each stands for [sr]; none for narrow lobes.
pub fn even_points(shape: Shape, order: usize) -> Vec<(Vec3, f64)> {
    let width = match shape {
        Shape::Phong { exponent } => (2.0 / f64::from(exponent).max(2.0)).sqrt(),
        Shape::Ward { alpha } => f64::from(alpha.min_element()),
        Shape::Microfacets { alpha } => f64::from(alpha),
    };
    if width < NARROW {
        return Vec::new();
    }
    let heights = order + 16 + (8.0 / width) as usize;
    hemisphere(heights, 2 * heights).into_iter().map(|(d, solid_angle)| (Vec3::from(d.map(|x| x as f32)), solid_angle)).collect()
}

/// What lobes are projected by.
struct Projector {
    shape: Shape,
    series: Series,
    basis: Basis<f64>,
    /// Points over the whole hemisphere with the harmonics there; empty for narrow lobes, which directions are drawn from.
    points: Vec<(Vec3, f64, Vec<f64>)>,
}

impl Projector {
    fn new(shape: Shape, series: Series) -> Self {
        let Series { harmonics, order, .. } = series;
        let basis = Basis::<f64>::new(order);
        let points =
            even_points(shape, order).into_iter().map(|(d, solid_angle)| (d, solid_angle, basis.values(harmonics, d.to_array().map(f64::from)))).collect();
        Self { shape, series, basis, points }
    }

    /// All points of the lobe toward an outgoing direction, where it is not 0.
    fn visit(&self, outgoing: Vec3, mut visit: impl FnMut(Point<'_>)) {
        // Of no reflectance is left what rises toward grazing angles alone.
        let [white, black] = [Vec3::ONE, Vec3::ZERO].map(|reflectance| Lobe { shape: self.shape, reflectance });
        let mut meet = |incoming: Vec3, solid_angle: f64, basis: &[f64]| {
            let rise = f64::from(black.value(outgoing, incoming).x);
            let values = [f64::from(white.value(outgoing, incoming).x) - rise, rise];
            if values.iter().any(|value| value.abs() > 1e-12) {
                visit(Point { values, cosine: f64::from(incoming.z), solid_angle, basis });
            }
        };
        for (incoming, solid_angle, basis) in &self.points {
            meet(*incoming, *solid_angle, basis);
        }
        if self.points.is_empty() {
            let number = |i: usize| (i as f32 + 0.5) / DRAWN as f32;
            for pair in (0..DRAWN * DRAWN).map(|i| [number(i / DRAWN), number(i % DRAWN)]) {
                let incoming = white.sample(outgoing, pair);
                let density = f64::from(white.density(outgoing, incoming)) * (DRAWN * DRAWN) as f64;
                if incoming.z > 0.0 && density > 0.0 {
                    meet(incoming, 1.0 / density, &self.basis.values(self.series.harmonics, incoming.to_array().map(f64::from)));
                }
            }
        }
    }

    /// Both parts of the lobe toward an outgoing direction.
    fn project(&self, outgoing: Vec3) -> Vec<Vec<f64>> {
        let Series { order, window, .. } = self.series;
        let mut parts = vec![vec![0.0; count(order)]; PARTS];
        self.visit(outgoing, |point| {
            for (part, value) in parts.iter_mut().zip(point.values).filter(|(_, value)| *value != 0.0) {
                let factor = value * point.cosine * point.solid_angle;
                part.iter_mut().zip(point.basis).for_each(|(sum, basis)| *sum += factor * basis);
            }
        });
        for part in &mut parts {
            for l in 0..order {
                let factor = window.factor(l, order);
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

    fn hemispherical(order: usize) -> Series {
        Series { harmonics: Harmonics::Hemispherical, order, window: Window::None }
    }

    /// Light that is a few harmonics is reflected alike whatever the lobe was expanded in.
    /// Where this fails as the numbers are meant to change, [`LobeTable::VERSION`] has to change too.
    #[test]
    fn numbers_are_those_of_their_version() {
        let table =
            LobeTable::new(Shape::Ward { alpha: Vec2::new(0.3, 0.5) }, Series { harmonics: Harmonics::Hemispherical, order: 5, window: Window::Hann }, 8);
        let sum: f64 = table.values.iter().flat_map(|four| four.to_array()).zip(1..).map(|(number, at)| f64::from(number) * f64::from(at).sqrt()).sum();
        assert!(LobeTable::VERSION == 1 && (sum - 598.81).abs() < 0.05, "{sum}");
    }

    #[test]
    fn spherical_tables_reflect_alike() {
        let light: Vec<f64> = (0..count(3)).map(|k| (k as f64 * 0.9).cos()).collect();
        for shape in [Shape::Phong { exponent: 8.0 }, Shape::Ward { alpha: Vec2::new(0.4, 0.6) }] {
            let own = LobeTable::new(shape, Series { harmonics: Harmonics::Spherical, ..hemispherical(3) }, 16);
            let converted = LobeTable::new(shape, hemispherical(10), 16).in_spherical(3);
            for outgoing in [Vec3::Z, Vec3::new(0.48, 0.36, 0.8)] {
                let [own, converted] =
                    [&own, &converted].map(|table| coefficients(table, outgoing, 1.0).iter().zip(&light).map(|(c, l)| f64::from(*c) * l).sum::<f64>());
                assert!((own - converted).abs() < 0.01 * own.abs().max(0.1), "{shape:?} {outgoing}: {converted}, not {own}");
            }
        }
    }

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
        let shapes = [
            Shape::Phong { exponent: 12.0 },
            Shape::Phong { exponent: 200.0 },
            Shape::Ward { alpha: Vec2::new(0.3, 0.6) },
            Shape::Microfacets { alpha: 0.4 },
            Shape::Microfacets { alpha: 0.09 },
        ];
        let points: Vec<_> = hemisphere(128, 256)
            .into_iter()
            .map(|(d, w)| {
                let arriving: f64 = basis.hemispherical(d).iter().zip(&light).map(|(h, l)| h * l).sum();
                (Vec3::from(d.map(|x| x as f32)), w * d[2] * arriving)
            })
            .collect();
        for (shape, reflectance) in shapes.into_iter().zip([1.0, 1.0, 1.0, 0.3, 0.3]) {
            // Lobes of all azimuths are projected for each direction.
            let table = LobeTable::new(shape, hemispherical(order), if shape.is_anisotropic() { 32 } else { 64 });
            let lobe = Lobe { shape, reflectance: Vec3::splat(reflectance) };
            for outgoing in [Vec3::Z, Vec3::new(0.48, 0.36, 0.8), Vec3::new(-0.6, 0.48, 0.64)] {
                let known: f64 = points.iter().map(|(d, arriving)| arriving * f64::from(lobe.value(outgoing, *d).x)).sum();
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
            // A lobe that is alike around the normal is projected in all its steps, however few the directions are.
            let order = if shape.is_anisotropic() { MOST } else { 6 };
            let table = LobeTable::new(shape, hemispherical(order), 4);
            assert!(table.values.iter().all(|four| four.is_finite()), "{shape:?}");
            for held in energy_by_order(shape, Harmonics::Hemispherical, MOST) {
                assert!((0.0..=1.0 + 1e-3).contains(&held), "{shape:?}: {held}");
            }
        }
    }

    /// A lobe of exponent 0 toward its normal is a cosine, which two harmonics hold, and reflects nothing from beyond 90° of any mirrored direction.
    #[test]
    fn the_broadest_lobe_is_a_cosine() {
        let projector = Projector::new(Shape::Phong { exponent: 0.0 }, hemispherical(2));
        let held: f64 = projector.project(Vec3::Z)[0].iter().map(|c| c * c).sum();
        assert!((held - 2.0 / (3.0 * std::f64::consts::PI)).abs() < 1e-6, "{held}");
        let lobe = Lobe { shape: Shape::Phong { exponent: 0.0 }, reflectance: Vec3::ONE };
        assert_eq!(lobe.value(Vec3::new(0.8, 0.0, 0.6), Vec3::new(0.8, 0.0, 0.6)), Vec3::ZERO);
    }

    #[test]
    fn sharper_lobes_take_higher_orders() {
        let enough = |exponent: f32| energy_by_order(Shape::Phong { exponent }, Harmonics::Hemispherical, 20).iter().position(|held| *held > 0.95);
        let [broad, middle, sharp] = [enough(5.0), enough(20.0), enough(60.0)].map(|order| order.expect("an order below 20"));
        assert!(broad < middle && middle < sharp, "{broad} {middle} {sharp}");
        for pair in energy_by_order(Shape::Microfacets { alpha: 0.3 }, Harmonics::Hemispherical, 12).windows(2) {
            assert!(pair[0] <= pair[1] + 1e-9 && pair[1] <= 1.0 + 1e-3, "{pair:?}");
        }
    }

    #[test]
    fn expansions_go_in_fours_and_out() {
        assert_eq!([1, 2, 3, 4].map(quads), [1, 1, 3, 4]);
        assert_eq!(table_fours(3, 5), 5 * 5 * 2 * 3);
        let values: Vec<f64> = (0..count(3)).map(|k| k as f64 + 0.5).collect();
        let packed = fours(&values);
        assert_eq!(packed, [Vec4::new(0.5, 1.5, 2.5, 3.5), Vec4::new(4.5, 5.5, 6.5, 7.5), Vec4::new(8.5, 0.0, 0.0, 0.0)]);
        assert_eq!(numbers(&packed, 3), values);
    }

    #[test]
    fn the_window_is_half_a_cosine() {
        for (l, known) in [(0, 1.0), (1, 0.75), (2, 0.25)] {
            assert!((Window::Hann.factor(l, 3) - known).abs() < 1e-12 && Window::None.factor(l, 3) == 1.0, "{l}");
        }
    }

    #[test]
    fn the_paraboloid_has_its_known_places() {
        assert_eq!(paraboloid(Vec3::Z), Vec2::splat(0.5));
        assert!(paraboloid(Vec3::new(0.6, 0.0, 0.8)).abs_diff_eq(Vec2::new(0.5 + 1.0 / 6.0, 0.5), 1e-6));
        assert!(paraboloid(Vec3::new(0.0, -1.0, 0.0)).abs_diff_eq(Vec2::new(0.5, 0.0), 1e-6));
        // Below the horizon it is as on it.
        assert!(paraboloid(Vec3::new(0.8, 0.0, -0.6)).abs_diff_eq(Vec2::new(0.9, 0.5), 1e-6));
        // Outside of the circle the lowest direction that is looked from.
        for place in [Vec2::new(1.0, 0.0), Vec2::new(0.0, 0.2)] {
            let (found, known) = (direction_at(place), (2.0 * place - 1.0).normalize());
            assert!(found.z == 1e-3 && found.truncate().abs_diff_eq(known, 1e-6), "{found}");
        }
        // Within it, up to that height.
        let place = paraboloid(Vec3::new(0.0, (1.0f32 - 0.002 * 0.002).sqrt(), 0.002));
        assert!((direction_at(place).z - 0.002).abs() < 1e-6);
        for (step, degrees) in [(0, 0.0f32), (STEPS / 3, 30.0), (STEPS / 2, 45.0)] {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            assert!(height_direction(step).abs_diff_eq(Vec3::new(sine, 0.0, cosine), 1e-6));
        }
        assert!(height_direction(STEPS).abs_diff_eq(Vec3::new(1.0, 0.0, 1e-3), 1e-6));
    }

    /// What is linear in a place is looked up as it is, up to the middles of the outermost cells, and as there beyond.
    #[test]
    fn lookups_are_linear_between_directions() {
        let (order, edge) = (2, 4);
        let value = |part: usize, k: usize, at: Vec2| (1 + part * 4 + k) as f32 + (k as f32 - 1.5) * at.x + (0.7 + part as f32) * at.y;
        let four = |part: usize, at: Vec2| Vec4::from_array(std::array::from_fn(|k| value(part, k, at)));
        let cells = (0..edge * edge).map(|at| Vec2::new((at % edge) as f32, (at / edge) as f32));
        let values = cells.flat_map(|at| [four(0, at), four(1, at)]).collect();
        let table = LobeTable { harmonics: Harmonics::Hemispherical, order, edge, values };
        for place in [Vec2::new(0.5, 0.5), Vec2::new(0.4, 0.65), Vec2::new(0.8, 0.35), Vec2::new(0.27, 0.22), Vec2::new(0.98, 0.5), Vec2::new(0.5, 0.01)] {
            let [mut flat, mut rise] = [[Vec4::ZERO; 1]; 2];
            table.lookup(direction_at(place), [&mut flat, &mut rise]);
            let at = (place * edge as f32 - 0.5).clamp(Vec2::ZERO, Vec2::splat(3.0));
            assert!(flat[0].abs_diff_eq(four(0, at), 1e-4) && rise[0].abs_diff_eq(four(1, at), 1e-4), "{place}: {flat:?} {rise:?}");
        }
        let single = LobeTable { edge: 1, values: vec![four(0, Vec2::ONE), four(1, Vec2::ONE)], ..table };
        let [mut flat, mut rise] = [[Vec4::ZERO; 1]; 2];
        single.lookup(Vec3::new(0.6, 0.0, 0.8), [&mut flat, &mut rise]);
        assert_eq!((flat[0], rise[0]), (four(0, Vec2::ONE), four(1, Vec2::ONE)));
    }

    /// Both parts of a lobe times the cosine, by a fine sum.
    fn summed(shape: Shape, harmonics: Harmonics, order: usize, outgoing: Vec3) -> [Vec<f64>; PARTS] {
        let basis = Basis::<f64>::new(order);
        let mut parts = [vec![0.0; count(order)], vec![0.0; count(order)]];
        for (d, solid_angle) in hemisphere(64, 128) {
            let value = |reflectance: Vec3| f64::from(Lobe { shape, reflectance }.value(outgoing, Vec3::from(d.map(|x| x as f32))).x);
            let (rise, all) = (value(Vec3::ZERO), value(Vec3::ONE));
            for (part, value) in parts.iter_mut().zip([all - rise, rise]) {
                part.iter_mut().zip(basis.values(harmonics, d)).for_each(|(sum, h)| *sum += solid_angle * d[2] * value * h);
            }
        }
        parts
    }

    /// In the middles of a table's cells nothing is interpolated but the height of lobes that are alike around the normal.
    #[test]
    fn tables_hold_the_integrals_over_a_lobe() {
        let (order, edge) = (3, 4);
        let shapes = [
            (Shape::Phong { exponent: 6.0 }, Harmonics::Hemispherical, Window::None),
            (Shape::Ward { alpha: Vec2::new(0.4, 0.7) }, Harmonics::Spherical, Window::None),
            (Shape::Microfacets { alpha: 0.5 }, Harmonics::Hemispherical, Window::Hann),
        ];
        for (shape, harmonics, window) in shapes {
            let table = LobeTable::new(shape, Series { harmonics, order, window }, edge);
            assert_eq!((table.order, table.edge, table.values.len()), (order, edge, table_fours(order, edge)));
            for at in [5, 6, 9, 10, 1, 8] {
                let outgoing = direction_at((Vec2::new((at % edge) as f32, (at / edge) as f32) + 0.5) / edge as f32);
                let mut known = summed(shape, harmonics, order, outgoing);
                known.iter_mut().for_each(|part| part.iter_mut().enumerate().for_each(|(k, c)| *c *= window.factor(k.isqrt(), order)));
                for (part, known) in known.iter().enumerate() {
                    let found = numbers(&table.values[(at * PARTS + part) * quads(order)..][..quads(order)], order);
                    for (k, (found, known)) in found.iter().zip(known).enumerate() {
                        assert!((found - known).abs() < 3e-3, "{shape:?} {at} {part} {k}: {found}, not {known}");
                    }
                }
            }
        }
    }

    /// Toward the steps an upright lobe is what was projected; between two it is their mean, and turned around the normal it turns.
    #[test]
    fn upright_lobes_turn_with_the_azimuth() {
        let projector = Projector::new(Shape::Phong { exponent: 6.0 }, hemispherical(3));
        let upright = Upright::new(&projector);
        let near = |found: &[f64], known: &[f64]| assert!(found.iter().zip(known).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?}, not {known:?}");
        let [low, high] = [30, 31].map(|step| projector.project(height_direction(step)).swap_remove(0));
        near(&upright.toward(height_direction(30))[0], &low);
        let angle = FRAC_PI_2 * 30.25 / STEPS as f32;
        let mut between: Vec<f64> = low.iter().zip(&high).map(|(a, b)| 0.75 * a + 0.25 * b).collect();
        near(&upright.toward(Vec3::new(angle.sin(), 0.0, angle.cos()))[0], &between);
        turn(&mut between, 2.0);
        near(&upright.toward(crate::math::lobe::around(angle.cos(), 2.0))[0], &between);
        near(&upright.toward(Vec3::X)[0], &projector.project(height_direction(STEPS))[0]);
    }

    /// A narrow lobe is met by directions drawn from it. Phong's toward its normal: `∫ f cosθ` is 1 and the mean of cosθ is (n+2)/(n+3).
    #[test]
    fn narrow_lobes_have_their_moments() {
        let exponent = 400.0;
        let projector = Projector::new(Shape::Phong { exponent }, hemispherical(2));
        assert!(projector.points.is_empty());
        let tau = std::f64::consts::TAU;
        let mean = f64::from(exponent + 2.0) / f64::from(exponent + 3.0);
        let known = [1.0 / tau.sqrt(), 0.0, (3.0 / tau).sqrt() * (2.0 * mean - 1.0), 0.0];
        let found = projector.project(Vec3::Z);
        for (found, known) in found[0].iter().zip(known) {
            assert!((found - known).abs() < 1e-4, "{found}, not {known}");
        }
        assert!(found[1].iter().all(|c| *c == 0.0));
        // Toward others it is around the mirrored direction.
        let found = projector.project(Vec3::new(0.36, -0.48, 0.8));
        let basis = Basis::<f64>::new(2).hemispherical([-0.36, 0.48, 0.8]);
        for (found, known) in found[0].iter().zip(basis) {
            assert!((found / 0.8 - known).abs() < 0.02, "{found}, not {known}");
        }
    }

    #[test]
    fn even_points_are_as_many_as_a_lobe_takes() {
        // Widths of 1, a half, a half and a quarter.
        let shapes = [
            (Shape::Phong { exponent: 1.0 }, 8),
            (Shape::Phong { exponent: 8.0 }, 16),
            (Shape::Ward { alpha: Vec2::new(0.5, 0.7) }, 16),
            (Shape::Microfacets { alpha: 0.25 }, 32),
        ];
        for (shape, more) in shapes {
            let (points, heights) = (even_points(shape, 3), 3 + 16 + more);
            assert_eq!(points.len(), 2 * heights * heights, "{shape:?}");
            let all: f64 = points.iter().map(|(_, solid_angle)| solid_angle).sum();
            assert!((all - std::f64::consts::TAU).abs() < 1e-9);
        }
        for shape in [Shape::Phong { exponent: 200.0 }, Shape::Ward { alpha: Vec2::new(0.1, 0.7) }, Shape::Microfacets { alpha: 0.11 }] {
            assert!(even_points(shape, 3).is_empty(), "{shape:?}");
        }
    }

    /// Phong's lobe of exponent 1 is a product of two cosines above both horizons. Toward the angle θ its integral times the first is `4/3 ((π−θ) cosθ + sinθ) / 2`, that
    /// of its square times the first squared `16/15 ((π−θ) (cos²θ + 1/2) + 3/4 sin 2θ) / 4`; the first harmonic is 1/√(2π).
    #[test]
    fn the_first_harmonic_holds_its_share() {
        let share = |degrees: f64| {
            let angle = degrees.to_radians();
            let (sine, cosine) = angle.sin_cos();
            let wide = std::f64::consts::PI - angle;
            let product = 4.0 / 3.0 * 0.5 * (wide * cosine + sine);
            let square = 16.0 / 15.0 * 0.25 * (wide * (cosine * cosine + 0.5) + 0.75 * (2.0 * angle).sin());
            product * product / std::f64::consts::TAU / square
        };
        let known = [0.0, 30.0, 60.0].into_iter().map(share).sum::<f64>() / 3.0;
        let found = energy_by_order(Shape::Phong { exponent: 1.0 }, Harmonics::Hemispherical, 3);
        assert!((found[0] - known).abs() < 2e-3, "{}, not {known}", found[0]);
        assert!(found.len() == 3 && found[0] < found[1] && found[1] < found[2] && found[2] < 1.0, "{found:?}");
        // Below the horizon spherical harmonics hold nothing: half as much.
        let spherical = energy_by_order(Shape::Phong { exponent: 1.0 }, Harmonics::Spherical, 1)[0];
        assert!((spherical - 0.5 * known).abs() < 2e-3, "{spherical}");
    }

    /// In other harmonics or a higher order a table is another way to say the same.
    #[test]
    fn tables_are_converted_part_by_part() {
        let shape = Shape::Microfacets { alpha: 0.5 };
        let own = LobeTable::new(shape, hemispherical(3), 2);
        let converted = own.in_spherical(4);
        assert_eq!((converted.harmonics, converted.order, converted.edge, converted.values.len()), (Harmonics::Spherical, 4, 2, table_fours(4, 2)));
        let conversion = Conversion::new(3, 4);
        for (own, found) in own.values.chunks(quads(3)).zip(converted.values.chunks(quads(4))) {
            let known = conversion.to_spherical(&numbers(own, 3));
            assert!(numbers(found, 4).iter().zip(known).all(|(a, b)| (a - b).abs() < 1e-6));
        }
        let longer = converted.in_spherical(5);
        assert_eq!((longer.harmonics, longer.order, longer.values.len()), (Harmonics::Spherical, 5, table_fours(5, 2)));
        for (own, found) in converted.values.chunks(quads(4)).zip(longer.values.chunks(quads(5))) {
            let found = numbers(found, 5);
            assert!(found[..count(4)] == numbers(own, 4) && found[count(4)..].iter().all(|c| *c == 0.0));
        }
    }
}
