//! How far a record reaches, by the second derivatives of its light.

use glam::{DVec2, DVec3};

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

    proptest! {
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
