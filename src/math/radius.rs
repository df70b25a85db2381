//! How far a record reaches, by the second derivatives of its light.

use super::frame::Frame;
use glam::{DVec2, DVec3, Vec3};

/// Where a record reaches, up to the accuracy: an ellipse in its tangent plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipse {
    /// The smaller radius R₀ [scene units].
    pub radius: f64,
    /// Along the axis of the larger radius R₁, in the record's frame, `√(1 − (R₀/R₁)²)` long; 0 for a disc.
    pub stretch: DVec2,
}

impl Ellipse {
    pub fn disc(radius: f64) -> Self {
        Self { radius, stretch: DVec2::ZERO }
    }

    /// Where an extrapolation along the gradient is off by as much as the irradiance itself: the next term of the series
    /// is `½ λ r²` along an eigenvector of the second derivatives (Schwarzhaupt et al. 2012 integrate it over a disc; the
    /// value at the rim needs no unit of length), so `R_i = √(2 E / |λ_i|)`, and within `a·R_i` the error is at most `a²`.
    /// `hessian` is xx, xy and yy [W/m² per square scene unit]. R₁ is at most 2 R₀; infinite where nothing bends.
    pub fn of_curvature(irradiance: f64, hessian: DVec3) -> Self {
        let mean = (hessian.x + hessian.z) / 2.0;
        let half = DVec2::new((hessian.x - hessian.z) / 2.0, hessian.y);
        let spread = half.length();
        let strongest = mean.abs() + spread;
        if strongest == 0.0 {
            return Self::disc(f64::INFINITY);
        }
        let weakest = (mean.abs() - spread).abs().max(strongest / 4.0);
        // Twice the angle of the eigenvector that belongs to the weaker curvature.
        let doubled = if mean >= 0.0 { -half } else { half };
        let axis = DVec2::from_angle(doubled.to_angle() / 2.0);
        Self { radius: (2.0 * irradiance / strongest).sqrt(), stretch: axis * (1.0 - weakest / strongest).max(0.0).sqrt() }
    }
}

/// How far a place stands for others, around it: an ellipsoid that is as thick as its shorter radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// The smaller radius R₀, finite and > 0 [scene units].
    pub radius: f32,
    /// Along the axis of the larger radius R₁, `√(1 − (R₀/R₁)²)` long.
    pub stretch: Vec3,
    /// The share that it is of the way to the nearest obstacle, up to 1; 0 where none is known.
    pub confinement: f32,
}

/// The larger radius is at most so many times the smaller one, as `weight::Record` bounds it.
const LONGEST: f32 = 10.0;

impl Reach {
    pub fn round(radius: f32) -> Self {
        Self { radius: radius.max(f32::MIN_POSITIVE), stretch: Vec3::ZERO, confinement: 0.0 }
    }

    /// As far as `radius`, but short of all `obstacles` on a surface with this normal, which are given as ways from the place: narrow where the
    /// nearest of them is, long beside it. The smaller radius is `least` at least, however near they are.
    pub fn before(obstacles: &[Vec3], normal: Vec3, radius: f32, least: f32) -> Self {
        let nearest = obstacles.iter().copied().min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        let Some(nearest) = nearest else { return Self::round(radius) };
        let confinement = (radius / nearest.length()).min(1.0);
        if nearest.length() >= radius {
            return Self { confinement, ..Self::round(radius) };
        }
        let shorter = nearest.length().max(least).clamp(f32::MIN_POSITIVE, radius);
        let across = (nearest - normal * nearest.dot(normal)).normalize_or(Frame::new(normal).tangent);
        let axis = normal.cross(across);
        // An obstacle at (x, y) is outside where (x/R₀)² + (y/R₁)² ≥ 1.
        let longest = |obstacle: &Vec3| {
            let [x, y] = [across, axis].map(|axis| obstacle.dot(axis).abs());
            y / (1.0 - (x / shorter).powi(2)).max(0.0).sqrt()
        };
        let longer = obstacles.iter().map(longest).filter(|most| *most > shorter).fold(radius, f32::min).clamp(shorter, LONGEST * shorter);
        Self { radius: shorter, stretch: axis * (1.0 - (shorter / longer).powi(2)).max(0.0).sqrt(), confinement }
    }

    /// The larger radius [scene units].
    pub fn longest(&self) -> f32 {
        self.radius / (1.0 - self.stretch.length_squared()).max(LONGEST.powi(-2)).sqrt()
    }

    /// How far away a point is, in radii of its direction; up to 1 within reach.
    pub fn apart(&self, way: Vec3) -> f32 {
        (way.length_squared() - way.dot(self.stretch).powi(2)).max(0.0).sqrt() / self.radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn nothing_that_bends_reaches_without_end() {
        assert_eq!(Ellipse::of_curvature(1.0, DVec3::ZERO), Ellipse::disc(f64::INFINITY));
        assert_eq!(Ellipse::of_curvature(2.0, DVec3::new(-1.0, 0.0, -1.0)), Ellipse::disc(2.0));
    }

    /// A trough along y: the axis of the longer radius, which is at most twice the shorter.
    #[test]
    fn ellipses_lie_along_the_weaker_curvature() {
        let ellipse = Ellipse::of_curvature(2.0, DVec3::new(4.0, 0.0, 0.0));
        assert_eq!(ellipse.radius, 1.0);
        assert!((ellipse.stretch.y.abs() - 0.75f64.sqrt()).abs() < 1e-12 && ellipse.stretch.x.abs() < 1e-12);
    }

    #[test]
    fn reach_ends_before_a_wall_and_follows_it() {
        let wall: Vec<Vec3> = (-20..=20).map(|at| Vec3::new(0.1, 0.05 * at as f32, 0.0)).collect();
        let reach = Reach::before(&wall, Vec3::Z, 0.5, 1e-3);
        assert!((reach.radius - 0.1).abs() < 1e-6 && (reach.longest() - 0.5).abs() < 1e-5, "{reach:?}");
        assert!((reach.apart(Vec3::Y * 0.5) - 1.0).abs() < 1e-5 && (reach.apart(Vec3::X * 0.1) - 1.0).abs() < 1e-5);
        // Of a wall that is out of reach it knows how near that is.
        let short = Reach::before(&wall, Vec3::Z, 0.09, 1e-3);
        assert!((short.confinement - 0.9).abs() < 1e-5 && Reach { confinement: 0.0, ..short } == Reach::round(0.09));
        // Where it gets to one that is all of the way, to the bit.
        assert_eq!(reach.confinement, 1.0);
        assert_eq!(Reach::before(&[], Vec3::Z, 0.09, 1e-3), Reach::round(0.09));
        // A corner leaves no room along either wall.
        let corner = [wall[20], Vec3::new(0.0, 0.15, 0.0)];
        assert!((Reach::before(&corner, Vec3::Z, 0.5, 1e-3).longest() - 0.15).abs() < 1e-5);
        assert_eq!(Reach::before(&[Vec3::ZERO], Vec3::Z, 0.5, 0.25).radius, 0.25);
    }

    proptest! {
        /// No obstacle that is farther away than the least radius is within reach.
        #[test]
        fn nothing_is_reached_that_stands_in_the_way(ways in proptest::collection::vec((-1.0..1.0f32, -1.0..1.0f32), 1..12), radius in 0.01..2.0f32) {
            let obstacles: Vec<Vec3> = ways.iter().map(|(x, y)| Vec3::new(*x, *y, 0.0)).collect();
            let reach = Reach::before(&obstacles, Vec3::Z, radius, 1e-3);
            prop_assert!(reach.longest() <= radius * 1.0001 && reach.radius <= radius);
            for way in obstacles.iter().filter(|way| way.length() > 1e-3) {
                prop_assert!(reach.apart(*way) > 0.999, "{way} by {reach:?}");
            }
        }

        /// At the rim along either axis the second-order term is at most the irradiance.
        #[test]
        fn the_next_term_is_bounded_at_the_rim(xx in -9.0..9.0f64, xy in -9.0..9.0f64, yy in -9.0..9.0f64, irradiance in 0.01..9.0f64) {
            let ellipse = Ellipse::of_curvature(irradiance, DVec3::new(xx, xy, yy));
            let axis = ellipse.stretch.normalize_or(DVec2::X);
            let longer = ellipse.radius / (1.0 - ellipse.stretch.length_squared()).sqrt();
            prop_assert!(longer <= 2.0 * ellipse.radius * (1.0 + 1e-9));
            for at in [axis * longer, axis.perp() * ellipse.radius] {
                let term = 0.5 * (xx * at.x * at.x + 2.0 * xy * at.x * at.y + yy * at.y * at.y);
                prop_assert!(term.abs() <= irradiance * (1.0 + 1e-9), "{term} of {irradiance}");
            }
        }
    }
}
