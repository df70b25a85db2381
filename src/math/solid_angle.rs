//! Exact integrals over regions of directions.
//!
//! Two numbers describe what a region of the unit sphere stands for: its solid angle `∫ dω` in sr and its moment
//! `∫ ω dω`, a vector. The moment's component along a normal is the cosine-weighted solid angle (Lambert 1760), its
//! cross product with the normal the region's share of the rotation gradient; both need no sampling.
//!
//! Regions come in three families: rectangles of a plane at distance 1 (gnomonic faces), convex polygons with
//! great-circle edges, and rectangles of the disc under the hemisphere (orthographic projection).

use glam::DVec3;
use std::f64::consts::{FRAC_PI_4, PI};

/// Lower and upper bound of one coordinate.
pub type Interval = [f64; 2];

/// The integral of the hemisphere's `sinθ dω`: what the moduli of the rotation gradient add to in a uniform furnace.
pub const ROTATION_TOTAL: f64 = PI * PI / 2.0;

/// Sum of a mixed antiderivative over the corners of a rectangle.
fn corners<T>(u: Interval, v: Interval, antiderivative: impl Fn(f64, f64) -> T) -> T
where
    T: std::ops::Add<Output = T> + std::ops::Sub<Output = T>,
{
    (antiderivative(u[1], v[1]) - antiderivative(u[0], v[1])) - (antiderivative(u[1], v[0]) - antiderivative(u[0], v[0]))
}

/// Solid angle in sr of the rectangle `u × v` of the plane at distance 1: `∫∫ du dv / (1+u²+v²)^{3/2}`.
pub fn rectangle_solid_angle(u: Interval, v: Interval) -> f64 {
    corners(u, v, |u, v| (u * v).atan2((1.0 + u * u + v * v).sqrt()))
}

/// Moment of the rectangle `u × v` of the plane at distance 1: `∫∫ (u, v, 1) du dv / (1+u²+v²)²`, in the plane's own
/// axes (along u, along v, away from the eye).
pub fn rectangle_moment(u: Interval, v: Interval) -> DVec3 {
    corners(u, v, |u, v| {
        let (a, b) = ((1.0 + u * u).sqrt(), (1.0 + v * v).sqrt());
        let (x, y) = ((v / a).atan() / a, (u / b).atan() / b);
        DVec3::new(-x, -y, u * x + v * y) / 2.0
    })
}

/// `∫ (u, v, 1) dv / (1+u²+v²)²` along the line of constant `u` of the plane at distance 1: the weight of a wall
/// between two pixels, whose component along the normal enters the translation gradient.
pub fn line_moment(u: f64, v: Interval) -> DVec3 {
    let square = 1.0 + u * u;
    let length = square.sqrt();
    let even = |v: f64| (v / (square + v * v) + (v / length).atan() / length) / (2.0 * square);
    let odd = |v: f64| -0.5 / (square + v * v);
    let (even, odd) = (even(v[1]) - even(v[0]), odd(v[1]) - odd(v[0]));
    DVec3::new(u * even, odd, even)
}

/// Solid angle in sr of a convex spherical polygon of unit vectors, counter-clockwise seen from outside the sphere
/// (negative when clockwise); triangles after Van Oosterom and Strackee 1983.
pub fn polygon_solid_angle(corners: &[DVec3]) -> f64 {
    let Some((&a, rest)) = corners.split_first() else { return 0.0 };
    let triangle = |b: DVec3, c: DVec3| 2.0 * a.dot(b.cross(c)).atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
    rest.windows(2).map(|edge| triangle(edge[0], edge[1])).sum()
}

/// Moment of a spherical polygon of unit vectors, oriented as for [`polygon_solid_angle`]; its component along a
/// normal is the polygon's form factor times π, if all of it is above the horizon (Lambert 1760).
pub fn polygon_moment(corners: &[DVec3]) -> DVec3 {
    let edge = |a: DVec3, b: DVec3| {
        let cross = a.cross(b);
        let sine = cross.length();
        if sine > 0.0 { cross * (sine.atan2(a.dot(b)) / sine / 2.0) } else { DVec3::ZERO }
    };
    corners.iter().zip(corners.iter().cycle().skip(1)).map(|(&a, &b)| edge(a, b)).sum()
}

/// `∫₀^y √(1−x²−t²) dt`, cut off at the disc's edge.
fn chord_area(x: f64, y: f64) -> f64 {
    let square = (1.0 - x * x).max(0.0);
    let z = (square - y * y).max(0.0).sqrt();
    let y_inside = y.clamp(-square.sqrt(), square.sqrt());
    (y_inside * z + square * y.atan2(z)) / 2.0
}

/// Area of the rectangle `x × y` within the unit disc.
fn disc_area(x: Interval, y: Interval) -> f64 {
    corners(x, y, |x, y| {
        let inside = x * x + y * y <= 1.0;
        let area = if inside { (x * y).abs() } else { chord_area(0.0, x.abs()) + chord_area(0.0, y.abs()) - FRAC_PI_4 };
        area * x.signum() * y.signum()
    })
}

/// Solid angle in sr of the directions whose x and y components lie in the rectangle `x × y`: `∫∫ dx dy / z` within
/// the unit disc. Bounds within −1..1.
pub fn disc_solid_angle(x: Interval, y: Interval) -> f64 {
    corners(x, y, |x, y| {
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        x * y.atan2(z) + y * x.atan2(z) - (x * y).atan2(z)
    })
}

/// Moment of the directions whose x and y components lie in the rectangle `x × y`: `∫∫ (x/z, y/z, 1) dx dy` within
/// the unit disc. Bounds within −1..1.
pub fn disc_moment(x: Interval, y: Interval) -> DVec3 {
    let along = |x: Interval, y: Interval| corners(x, y, |x, y| -chord_area(x, y));
    DVec3::new(along(x, y), along(y, x), disc_area(x, y))
}

/// `∫ cosθ n dℓ` along the arc of constant x component over the interval `y` of y components, with n the tangent of
/// the sphere across the arc towards larger x; cut off at the disc's edge. Bounds within −1..1.
pub fn disc_wall(x: f64, y: Interval) -> DVec3 {
    let limit = (1.0 - x * x).max(0.0).sqrt();
    let [low, high] = y.map(|y| y.clamp(-limit, limit));
    let length = high - low;
    DVec3::new(length * (1.0 - x * x), -x * length * (high + low) / 2.0, -x * (chord_area(x, high) - chord_area(x, low)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn near(a: f64, b: f64, tolerance: f64) -> bool {
        (a - b).abs() <= tolerance
    }

    fn gnomonic_corners(u: Interval, v: Interval) -> [DVec3; 4] {
        // Seen from outside the sphere, +z towards the viewer, (x, y) turns counter-clockwise.
        [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| DVec3::new(u[i], v[j], 1.0).normalize())
    }

    /// Midpoint rule over a rectangle.
    fn midpoint<T: std::iter::Sum<T> + std::ops::Mul<f64, Output = T>>(x: Interval, y: Interval, steps: u32, f: impl Fn(f64, f64) -> T) -> T {
        let (dx, dy) = ((x[1] - x[0]) / f64::from(steps), (y[1] - y[0]) / f64::from(steps));
        let at = |i: u32| (x[0] + (f64::from(i % steps) + 0.5) * dx, y[0] + (f64::from(i / steps) + 0.5) * dy);
        (0..steps * steps)
            .map(|i| {
                let (x, y) = at(i);
                f(x, y) * (dx * dy)
            })
            .sum()
    }

    proptest! {
        #[test]
        fn rectangles_are_polygons(u0 in -3.0..3.0f64, v0 in -3.0..3.0f64, du in 0.01..2.0f64, dv in 0.01..2.0f64) {
            let (u, v) = ([u0, u0 + du], [v0, v0 + dv]);
            let polygon = gnomonic_corners(u, v);
            prop_assert!(near(rectangle_solid_angle(u, v), polygon_solid_angle(&polygon), 1e-13));
            prop_assert!(rectangle_moment(u, v).abs_diff_eq(polygon_moment(&polygon), 1e-13));
        }

        #[test]
        fn parts_add_up_to_the_whole(u0 in -3.0..3.0f64, v0 in -3.0..3.0f64, du in 0.01..2.0f64, dv in 0.01..2.0f64, at in 0.01..0.99f64) {
            let (u, v, cut) = ([u0, u0 + du], [v0, v0 + dv], u0 + at * du);
            let parts = [[u[0], cut], [cut, u[1]]];
            let halves: DVec3 = parts.iter().map(|part| rectangle_moment(*part, v)).sum();
            prop_assert!(near(rectangle_solid_angle(u, v), parts.iter().map(|part| rectangle_solid_angle(*part, v)).sum(), 1e-14));
            prop_assert!(rectangle_moment(u, v).abs_diff_eq(halves, 1e-14));
            // Along the diagonal.
            let corners = gnomonic_corners(u, v);
            let triangles = [[0, 1, 2], [0, 2, 3]].map(|triangle| triangle.map(|corner| corners[corner]));
            let halves: DVec3 = triangles.iter().map(|triangle| polygon_moment(triangle)).sum();
            prop_assert!(near(polygon_solid_angle(&corners), triangles.iter().map(|triangle| polygon_solid_angle(triangle)).sum(), 1e-13));
            prop_assert!(polygon_moment(&corners).abs_diff_eq(halves, 1e-13));
        }

        #[test]
        fn lines_are_the_derivative_of_rectangles(u in -3.0..3.0f64, v0 in -3.0..3.0f64, dv in 0.01..2.0f64) {
            let (v, h) = ([v0, v0 + dv], 1e-5);
            let difference = rectangle_moment([u - h, u + h], v) / (2.0 * h);
            prop_assert!(difference.abs_diff_eq(line_moment(u, v), 1e-8));
        }

        #[test]
        fn discs_match_quadrature(x0 in -0.6..0.5f64, y0 in -0.6..0.5f64, dx in 0.01..0.15f64, dy in 0.01..0.15f64) {
            let (x, y) = ([x0, x0 + dx], [y0, y0 + dy]);
            let z = |x: f64, y: f64| (1.0 - x * x - y * y).sqrt();
            prop_assert!(near(disc_solid_angle(x, y), midpoint(x, y, 64, |x, y| 1.0 / z(x, y)), 1e-5 * dx * dy));
            prop_assert!(disc_moment(x, y).abs_diff_eq(midpoint(x, y, 64, |x, y| DVec3::new(x / z(x, y), y / z(x, y), 1.0)), 1e-5 * dx * dy));
        }
    }

    #[test]
    fn whole_hemispheres_are_exact() {
        let all = [-1.0, 1.0];
        assert!(near(disc_solid_angle(all, all), 2.0 * PI, 1e-14));
        assert!(disc_moment(all, all).abs_diff_eq(DVec3::Z * PI, 1e-14));
        let octant = [DVec3::X, DVec3::Y, DVec3::Z];
        assert!(near(polygon_solid_angle(&octant), PI / 2.0, 1e-15));
        assert!(polygon_moment(&octant).abs_diff_eq(DVec3::splat(FRAC_PI_4), 1e-15));
    }

    #[test]
    fn cells_cut_by_the_rim_hold_what_is_inside() {
        let (x, y) = ([0.6, 0.9], [0.5, 0.8]);
        let inside = |x: f64, y: f64| 1.0 - x * x - y * y;
        let area = midpoint(x, y, 2000, |x, y| if inside(x, y) > 0.0 { 1.0 } else { 0.0 });
        assert!(near(disc_moment(x, y).z, area, 1e-5));
        let plain = midpoint(x, y, 2000, |x, y| if inside(x, y) > 0.0 { inside(x, y).sqrt().recip() } else { 0.0 });
        assert!(near(disc_solid_angle(x, y), plain, 2e-3), "{} {plain}", disc_solid_angle(x, y));
        assert_eq!(disc_wall(0.9, [0.5, 0.8]), DVec3::ZERO);
    }

    #[test]
    fn disc_walls_match_quadrature() {
        let (x, y) = (0.4, [-0.3, 0.7]);
        let steps = 20_000;
        let dy = (y[1] - y[0]) / f64::from(steps);
        let sum: DVec3 = (0..steps)
            .map(|i| {
                let t = y[0] + (f64::from(i) + 0.5) * dy;
                let r = DVec3::new(x, t, (1.0 - x * x - t * t).sqrt());
                (DVec3::X - r * x) * dy
            })
            .sum();
        assert!(disc_wall(x, y).abs_diff_eq(sum, 1e-8));
    }
}
