//! Directions toward a triangle, spread evenly over the solid angle that it covers: `shaders/lib/spherical_triangle.wgsl` has the twin.

use glam::Vec3;

/// A triangle as a point sees it.
#[derive(Debug, Clone, Copy)]
pub struct SphericalTriangle {
    /// Unit vectors to the corners.
    corners: [Vec3; 3],
    /// Solid angle [sr].
    pub solid_angle: f32,
    /// Cosine and sine of the angle at the first corner.
    angle: [f32; 2],
}

/// So small a sine of an angle cannot be divided by.
const FLAT: f32 = 1e-3;

impl SphericalTriangle {
    /// The triangle with corners along these ways; none where it is too thin to be sampled.
    pub fn new(ways: [Vec3; 3]) -> Option<Self> {
        let [a, b, c] = ways.map(Vec3::normalize_or_zero);
        // Van Oosterom and Strackee 1983; the side that is seen does not matter.
        let solid_angle = 2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        let [ab, ac] = [a.cross(b), a.cross(c)].map(Vec3::normalize_or_zero);
        let angle = [ab.dot(ac), ab.cross(ac).length()];
        let is_wide = solid_angle > FLAT && angle[1] > FLAT;
        is_wide.then_some(Self { corners: [a, b, c], solid_angle, angle })
    }

    /// A unit direction for two numbers in 0..1 (Arvo 1995).
    pub fn sample(&self, [u, v]: [f32; 2]) -> Vec3 {
        let ([a, b, c], [cosine, sine]) = (self.corners, self.angle);
        let (s, t) = (u * self.solid_angle - sine.atan2(cosine)).sin_cos();
        let (x, y) = (t - cosine, s + sine * a.dot(b));
        let share = (((y * t - x * s) * cosine - y) / ((y * s + x * t) * sine)).clamp(-1.0, 1.0);
        let across = between(a, c, share);
        between(b, across, 1.0 - v * (1.0 - across.dot(b)))
    }
}

/// On the great circle from one unit vector toward another, where the cosine to the first is this.
fn between(from: Vec3, toward: Vec3, cosine: f32) -> Vec3 {
    let aside = (toward - from * toward.dot(from)).normalize_or_zero();
    (from * cosine + aside * (1.0 - cosine * cosine).max(0.0).sqrt()).normalize_or(from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::solid_angle::{polygon_moment, polygon_solid_angle};

    /// The mean of directions is the triangle's moment over its solid angle; all lie within it.
    #[test]
    fn directions_fill_the_triangle_evenly() {
        let triangles = [
            [Vec3::new(1.0, 0.0, 0.2), Vec3::new(0.0, 1.0, 0.2), Vec3::new(-1.0, -1.0, 0.2)],
            [Vec3::new(3.0, 0.0, 1.0), Vec3::new(3.0, 2.0, 1.0), Vec3::new(-2.0, 2.0, 1.0)],
            [Vec3::new(0.1, 0.0, 1.0), Vec3::new(0.3, 0.1, 1.0), Vec3::new(0.0, 0.2, 1.0)],
            [Vec3::new(-5.0, 1.0, 0.1), Vec3::new(5.0, 1.0, 0.1), Vec3::new(0.0, -0.3, 0.1)],
        ];
        for ways in triangles {
            let triangle = SphericalTriangle::new(ways).unwrap();
            let corners = ways.map(|way| way.as_dvec3().normalize());
            let known = polygon_solid_angle(&corners).abs();
            assert!((f64::from(triangle.solid_angle) / known - 1.0).abs() < 1e-4, "{} is not {known}", triangle.solid_angle);
            let steps = 64u16;
            let number = |at: u16| (f32::from(at) + 0.5) / f32::from(steps);
            let mut mean = Vec3::ZERO;
            for (i, j) in (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j))) {
                let direction = triangle.sample([number(i), number(j)]);
                let inside = [0, 1, 2].map(|at| ways[at].cross(ways[(at + 1) % 3]).normalize().dot(direction));
                let same_side = inside.iter().all(|side| *side > -2e-3) || inside.iter().all(|side| *side < 2e-3);
                assert!(direction.is_normalized() && same_side, "{direction} is outside: {inside:?}");
                mean += direction / f32::from(steps).powi(2);
            }
            let moment = polygon_moment(&corners).as_vec3() * known.signum() as f32 / known as f32;
            let moment = if moment.dot(mean) < 0.0 { -moment } else { moment };
            assert!(mean.distance(moment) < 3e-3, "{mean} is not {moment}");
        }
        let line = [Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)];
        assert!(SphericalTriangle::new(line).is_none() && SphericalTriangle::new([Vec3::ZERO; 3]).is_none());
    }
}
