//! Orthonormal frames on surfaces; the shaders hold the same code.

use glam::{Mat3, Vec3};

/// A right-handed orthonormal frame: local x, y and z (the normal) in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    pub tangent: Vec3,
    pub bitangent: Vec3,
    pub normal: Vec3,
}

impl Frame {
    /// A frame around any unit `normal`, without a singular direction (Duff et al. 2017, "Building an Orthonormal
    /// Basis, Revisited").
    pub fn new(normal: Vec3) -> Self {
        let sign = if normal.z >= 0.0 { 1.0 } else { -1.0 };
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        let tangent = Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
        let bitangent = Vec3::new(b, sign + normal.y * normal.y * a, -normal.y);
        Self { tangent, bitangent, normal }
    }

    /// The same normal with the tangents turned by `angle` in radians, counter-clockwise seen against the normal:
    /// what keeps the pixel grids of neighbouring records from lining up.
    pub fn turned(self, angle: f32) -> Self {
        let (sine, cosine) = angle.sin_cos();
        Self { tangent: self.tangent * cosine + self.bitangent * sine, bitangent: self.bitangent * cosine - self.tangent * sine, ..self }
    }

    /// A local vector in world space.
    pub fn to_world(&self, local: Vec3) -> Vec3 {
        Mat3::from_cols(self.tangent, self.bitangent, self.normal) * local
    }

    /// A world vector in the local axes.
    pub fn to_local(&self, world: Vec3) -> Vec3 {
        Vec3::new(world.dot(self.tangent), world.dot(self.bitangent), world.dot(self.normal))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn assert_orthonormal(frame: Frame) -> Result<(), TestCaseError> {
        let Frame { tangent, bitangent, normal } = frame;
        for (length, what) in [(tangent.length(), "tangent"), (bitangent.length(), "bitangent"), (normal.length(), "normal")] {
            prop_assert!((length - 1.0).abs() < 2e-6, "{what} of {frame:?}");
        }
        prop_assert!(tangent.cross(bitangent).abs_diff_eq(normal, 2e-6), "{frame:?}");
        prop_assert!(tangent.dot(normal).abs() < 2e-6 && bitangent.dot(normal).abs() < 2e-6, "{frame:?}");
        Ok(())
    }

    proptest! {
        #[test]
        fn every_direction_has_a_frame(z in -1.0..=1.0f32, azimuth in 0.0..6.3f32, angle in -10.0..10.0f32) {
            let sine = (1.0 - z * z).sqrt();
            let frame = Frame::new(Vec3::new(sine * azimuth.cos(), sine * azimuth.sin(), z).normalize()).turned(angle);
            assert_orthonormal(frame)?;
            let v = Vec3::new(0.3, -2.0, 1.1);
            prop_assert!(frame.to_local(frame.to_world(v)).abs_diff_eq(v, 1e-5));
        }
    }

    #[test]
    fn axes_and_their_neighbours_are_no_exception() -> Result<(), TestCaseError> {
        let tiny = 1e-20;
        for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z] {
            for nudge in [Vec3::ZERO, Vec3::splat(tiny), Vec3::splat(-tiny), Vec3::splat(1e-4), Vec3::splat(-1e-4)] {
                assert_orthonormal(Frame::new((axis + nudge).normalize()))?;
            }
        }
        assert_orthonormal(Frame::new(Vec3::new(1.0, 0.0, -0.0)))
    }

    #[test]
    fn turning_is_counter_clockwise() {
        let turned = Frame { tangent: Vec3::X, bitangent: Vec3::Y, normal: Vec3::Z }.turned(std::f32::consts::FRAC_PI_2);
        assert!(turned.tangent.abs_diff_eq(Vec3::Y, 1e-6) && turned.bitangent.abs_diff_eq(Vec3::NEG_X, 1e-6));
    }
}
