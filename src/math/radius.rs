//! How far a record reaches: limits, caps and the agreement between neighbours.

use glam::{DVec2, DVec3, Vec2, Vec3};

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

/// Width of a pixel at a depth along the camera's axis [scene units]: `half_extent` is the picture plane's half
/// width and height at distance 1, `size` the picture in pixels. The larger of width and height.
pub fn footprint(depth: f32, half_extent: Vec2, size: [u32; 2]) -> f32 {
    let pixel = 2.0 * half_extent / Vec2::new(size[0] as f32, size[1] as f32);
    depth * pixel.max_element()
}

/// Limits on the reach of a record, `accuracy · radius`, from what the scene and the picture are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReachLimits {
    /// Least and most, as shares of the scene's extent.
    pub extent: [f32; 2],
    /// Least and most, in pixels at the record.
    pub pixels: [f32; 2],
}

impl ReachLimits {
    /// The interval of radii R [scene units]: at least the larger of the two lower limits, at most the smaller of the
    /// two upper ones; where these cross the lower limit wins, so that records stay few. `footprint` is the size of a
    /// pixel at the record, `accuracy` > 0.
    pub fn radii(&self, extent: f32, footprint: f32, accuracy: f32) -> [f32; 2] {
        let least = (self.extent[0] * extent).max(self.pixels[0] * footprint) / accuracy;
        let most = (self.extent[1] * extent).min(self.pixels[1] * footprint) / accuracy;
        [least, most.max(least)]
    }
}

/// A radius in `limits`; infinite (only sky seen) becomes the upper, and what is not a number the lower limit.
pub fn clamp(radius: f32, limits: [f32; 2]) -> f32 {
    radius.max(limits[0]).min(limits[1])
}

/// A round record after the caps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capped {
    pub radius: f32,
    /// What the gradient must be multiplied by, 0..1.
    pub gradient_scale: f32,
}

/// The caps of a round record, in the order of Radiance's ambient code (after Schwarzhaupt et al. 2012): `R·g ≤ 1`, as
/// the gradient alone would then double or extinguish the irradiance; R within `limits`; the gradient scaled so that
/// `R·g ≤ 1` again where the lower limit gave back what the first cap took.
/// `relative_gradient` is g = `|∇E|/E` [1 / scene unit]; infinite or not a number where E is 0 counts as no gradient.
pub fn cap(radius: f32, relative_gradient: f32, limits: [f32; 2]) -> Capped {
    let gradient = finite_or_0(relative_gradient);
    let radius = clamp(radius.min(1.0 / gradient), limits);
    Capped { radius, gradient_scale: (1.0 / (radius * gradient)).min(1.0) }
}

/// An elliptic record after the caps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CappedEllipse {
    pub radii: [f32; 2],
    /// What the gradient must be multiplied by, 0..1.
    pub gradient_scale: f32,
}

/// The caps of an elliptic record, in order: `R_i·g_i ≤ 1`, `R_i ≥ R_min`, the longer radius at most twice the shorter,
/// `R_i ≤ R_max`, the gradient scaled so that `Σ(g_i R_i)² ≤ 1`. `relative_gradient` holds the moduli of `∂E/E` along
/// the two axes [1 / scene unit], as for [`cap`].
pub fn cap_ellipse(radii: [f32; 2], relative_gradient: [f32; 2], limits: [f32; 2]) -> CappedEllipse {
    let gradient = relative_gradient.map(finite_or_0);
    let capped = [0, 1].map(|i| radii[i].min(1.0 / gradient[i]).max(limits[0]));
    let longest = 2.0 * capped[0].min(capped[1]);
    let radii = capped.map(|r| r.min(longest).min(limits[1]));
    let overshoot = (gradient[0] * radii[0]).hypot(gradient[1] * radii[1]);
    CappedEllipse { radii, gradient_scale: (1.0 / overshoot).min(1.0) }
}

fn finite_or_0(gradient: f32) -> f32 {
    if gradient.is_finite() { gradient } else { 0.0 }
}

/// Neighbour clamping (Křivánek et al. 2006): the radius of a record at `position`, at most what each neighbour
/// (position, radius) allows, `R_j + |p − p_j|`. A feature that a neighbour has seen cannot be jumped over. One round
/// over all records with the radii of the round before does not depend on their order.
pub fn clamp_to_neighbours(position: Vec3, radius: f32, neighbours: impl IntoIterator<Item = (Vec3, f32)>) -> f32 {
    neighbours.into_iter().fold(radius, |least, (at, radius)| least.min(radius + position.distance(at)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: [f32; 2] = [0.1, 10.0];

    #[test]
    fn footprints_scale_with_depth() {
        assert_eq!(footprint(3.0, Vec2::new(1.0, 0.5), [200, 100]), 0.03);
    }

    #[test]
    fn limits_hold_for_anything() {
        assert_eq!(clamp(f32::INFINITY, LIMITS), 10.0);
        assert_eq!(clamp(f32::NAN, LIMITS), 0.1);
        assert_eq!(clamp(0.0, LIMITS), 0.1);
        let reach = ReachLimits { extent: [0.001, 0.1], pixels: [3.0, 20.0] };
        assert_eq!(reach.radii(100.0, 0.05, 0.5), [0.3, 2.0]);
        let [least, most] = reach.radii(100.0, 10.0, 0.5);
        assert!(least == 60.0 && most == 60.0, "far away the lower limit wins");
    }

    #[test]
    fn strong_gradients_shorten_the_radius_and_then_yield() {
        assert_eq!(cap(4.0, 0.5, LIMITS), Capped { radius: 2.0, gradient_scale: 1.0 });
        assert_eq!(cap(4.0, 100.0, LIMITS), Capped { radius: 0.1, gradient_scale: 0.1 });
        assert_eq!(cap(f32::INFINITY, 0.0, LIMITS), Capped { radius: 10.0, gradient_scale: 1.0 });
        assert_eq!(cap(4.0, f32::NAN, LIMITS), Capped { radius: 4.0, gradient_scale: 1.0 });
        assert_eq!(cap_ellipse([1.0, 9.0], [0.0, 0.0], LIMITS).radii, [1.0, 2.0]);
    }

    proptest! {
        #[test]
        fn caps_never_let_a_gradient_overshoot(r0 in 0.0..100.0f32, r1 in 0.0..100.0f32, g0 in 0.0..100.0f32, g1 in 0.0..100.0f32) {
            let CappedEllipse { radii, gradient_scale } = cap_ellipse([r0, r1], [g0, g1], LIMITS);
            let [a, b] = [g0 * radii[0], g1 * radii[1]].map(|x| x * gradient_scale);
            prop_assert!(a * a + b * b <= 1.0 + 1e-5);
            prop_assert!(radii.iter().all(|r| (LIMITS[0]..=LIMITS[1]).contains(r)));
            prop_assert!(radii[0] <= 2.0 * radii[1] && radii[1] <= 2.0 * radii[0]);
            let round = cap(r0, g0, LIMITS);
            prop_assert!(round.radius * g0 * round.gradient_scale <= 1.0 + 1e-5);
        }

        /// Radii settle, and then differ by no more than the distance between any two records.
        #[test]
        fn neighbours_agree_after_a_few_rounds(records in prop::collection::vec((-1.0..1.0f32, -1.0..1.0f32, 0.01..5.0f32), 2..12)) {
            let positions: Vec<Vec3> = records.iter().map(|r| Vec3::new(r.0, r.1, 0.0)).collect();
            let mut radii: Vec<f32> = records.iter().map(|r| r.2).collect();
            for _ in 0..2 {
                radii = positions.iter().zip(&radii).map(|(&p, &r)| clamp_to_neighbours(p, r, positions.iter().copied().zip(radii.iter().copied()))).collect();
            }
            for (p, r) in positions.iter().zip(&radii) {
                for (q, s) in positions.iter().zip(&radii) {
                    prop_assert!(*r <= s + p.distance(*q) + 1e-5);
                }
            }
        }
    }
}
