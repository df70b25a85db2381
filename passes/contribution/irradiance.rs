//! Irradiance, eight neighbours side by side.

use super::bands::{Band, Contribution};
use crate::math::vectors::{LANES, Vectors, apart, together};
use crate::math::weight::Reaching;
use fearless_simd::{Simd, prelude::*};
use glam::Vec4;
use std::ops::Range;

/// What pixels see.
pub struct Seen<'a> {
    pub positions: &'a [Vec4],
    pub normals: &'a [Vec4],
}

impl<'a> Contribution for Seen<'a> {
    type Record = Reaching<'a>;

    #[inline(always)]
    fn add<S: Simd>(&self, simd: S, record: &Reaching<'a>, pixels: Range<usize>, band: &mut Band<'_>) {
        for from in pixels.clone().step_by(LANES) {
            let lanes = (pixels.end - from).min(LANES);
            let [x, y, z, is_there] = apart(simd, self.positions, from);
            let [a, b, c, _] = apart(simd, self.normals, from);
            let (position, normal) = (Vectors { x, y, z }, Vectors { x: a, y: b, z: c });
            let weight = record.weights(simd, position, normal);
            let which = (weight.simd_gt(0.0) & is_there.simd_gt(0.0)).to_bitmask();
            if which & ((1 << lanes) - 1) == 0 {
                continue;
            }
            let light = record.estimates(simd, position, normal).scaled(weight);
            let added = together(simd, [light.x, light.y, light.z, weight]);
            (0..lanes).filter(|lane| which & 1 << lane != 0).for_each(|lane| band.add(from + lane, added[lane]));
        }
    }
}
