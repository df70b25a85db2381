//! Where eight records stand and how far they reach, side by side, for what runs within `dispatch!`.

use super::vectors::{LANES, Vectors};
use super::weight::{FRONT_TOLERANCE, MOST_PER_LENGTH, Reaching};
use fearless_simd::{Simd, f32x8, mask32x8, prelude::*};
use glam::Vec3;

/// Eight records.
#[derive(Clone)]
pub(super) struct Standing {
    position: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    stretch: [[f32; LANES]; 3],
    /// One over the validity radius; 0 of lanes without a record.
    inverse: [f32; LANES],
}

/// How a point stands to eight records, as compact weights ask.
pub(super) struct Apart<S: Simd> {
    /// Square of the distance, and of that across the ellipse along which a record reaches [scene units²].
    pub square: f32x8<S>,
    pub across: f32x8<S>,
    /// One over the square of the validity radius.
    pub per_area: f32x8<S>,
    /// Square of how far the normals differ, over how far they may.
    pub turned: f32x8<S>,
    pub is_level: mask32x8<S>,
}

impl Standing {
    pub const NOWHERE: Self = Self { position: [[0.0; LANES]; 3], normal: [[0.0; LANES]; 3], stretch: [[0.0; LANES]; 3], inverse: [0.0; LANES] };

    /// Puts a record into a lane, which reaches along an ellipse of this stretch.
    pub fn set(&mut self, lane: usize, reaching: &Reaching<'_>, stretch: Vec3) {
        let record = reaching.record();
        for (all, vector) in [(&mut self.position, record.position), (&mut self.normal, record.normal), (&mut self.stretch, stretch)] {
            (0..3).for_each(|axis| all[axis][lane] = vector[axis]);
        }
        self.inverse[lane] = reaching.validity_radius().recip().min(MOST_PER_LENGTH);
    }

    /// Of a point and its normal, where records may count `coarser` times as far as they do by this accuracy.
    #[inline(always)]
    pub fn apart<S: Simd>(&self, simd: S, [position, normal]: [Vectors<S>; 2], accuracy: f32, coarser: f32) -> Apart<S> {
        let facing = Vectors::load(simd, &self.normal);
        let offset = position.minus(Vectors::load(simd, &self.position));
        let (along, square) = (offset.dot(Vectors::load(simd, &self.stretch)), offset.dot(offset));
        let inverse = f32x8::load_array_ref(simd, &self.inverse);
        let difference = normal.minus(facing);
        let behind = offset.dot(facing.plus(normal)) * 0.5;
        Apart {
            square,
            across: (square - along * along).max(f32x8::splat(simd, 0.0)),
            per_area: inverse * inverse,
            turned: difference.dot(difference) * (0.5 / (accuracy * coarser).powi(2)),
            is_level: (behind * behind).simd_le(square * (FRONT_TOLERANCE * coarser).powi(2)),
        }
    }

    /// A number that takes a look at each line of memory that they are in, so that it is fetched.
    #[inline(always)]
    pub fn touched(&self) -> f32 {
        self.position[0][0] + self.position[2][0] + self.normal[1][0] + self.stretch[0][0] + self.stretch[2][0] + self.inverse[LANES - 1]
    }
}
