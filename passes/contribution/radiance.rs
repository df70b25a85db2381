//! Radiance that lobes reflect.

use super::bands::{Band, Contribution};
use crate::contract::port;
use crate::math::{
    harmonics::{Tilting, reflection::LobeTable},
    radiance::{Viewed, reflected, reflected_rotated},
    weight::{Reaching, Record},
};
use fearless_simd::Simd;
use glam::{Vec3, Vec4, Vec4Swizzles};
use half::f16;
use std::ops::Range;

/// What lobes reflect of records.
pub struct Reflection<'a> {
    /// What pixels see.
    pub positions: &'a [Vec4],
    pub normals: &'a [Vec4],
    pub seen: &'a [Vec4],
    pub eye: Vec3,
    pub lobes: &'a [LobeTable],
    /// None where the viewer is moved in place of it.
    pub tilting: Option<&'a Tilting>,
}

/// A record that covers some of the picture.
pub struct Placed<'a> {
    pub record: Reaching<'a>,
    pub planes: &'a [Vec4],
}

/// Coefficients as they are computed with.
pub fn fours(bytes: &[u8], precision: port::Precision, records: &[Record]) -> Vec<Vec4> {
    if precision == port::Precision::Single {
        return bytemuck::pod_collect_to_vec(bytes);
    }
    let halves: Vec<[f16; 4]> = bytemuck::pod_collect_to_vec(bytes);
    let each = halves.len() / records.len().max(1);
    let multiples = halves.chunks_exact(each.max(1)).zip(records).flat_map(|(halves, record)| {
        let [light, change] = record.half_units();
        // A third of them are expansions, the rest derivatives.
        halves.iter().zip(0..).map(move |(four, at)| Vec4::from(four.map(f16::to_f32)) * if 3 * at < each { light } else { change })
    });
    multiples.collect()
}

impl<'a> Contribution for Reflection<'a> {
    type Record = Placed<'a>;

    #[inline(always)]
    fn add<S: Simd>(&self, _simd: S, record: &Placed<'a>, pixels: Range<usize>, band: &mut Band<'_>) {
        for pixel in pixels {
            if let Some(added) = self.contribution(record, pixel) {
                band.add(pixel, added);
            }
        }
    }
}

impl Reflection<'_> {
    /// Weighted radiance and weight of a record at a pixel, if it counts there.
    fn contribution(&self, placed: &Placed<'_>, pixel: usize) -> Option<Vec4> {
        let place = self.positions[pixel];
        if place.w <= 0.0 {
            return None;
        }
        let (position, normal) = (place.xyz(), self.normals[pixel].xyz());
        let weight = placed.record.weight(position, normal);
        if weight <= 0.0 {
            return None;
        }
        let seen = self.seen[pixel];
        let viewed = Viewed {
            toward: (self.eye - position).normalize_or(normal),
            normal,
            record_normal: placed.record.record().normal,
            offset: placed.record.step(position),
            reflectance: seen.xyz(),
            azimuth: seen.w.fract(),
        };
        let table = &self.lobes[seen.w as usize];
        let radiance = match self.tilting {
            Some(tilting) => reflected_rotated(placed.planes, table, tilting, &viewed),
            None => reflected(placed.planes, table, &viewed),
        };
        Some(radiance.extend(1.0) * weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::passes::mock;

    fn record(light: f32, relative_gradient: f32) -> Record {
        Record { irradiance: Vec3::splat(light), relative_gradient, ..mock::record() }
    }

    #[test]
    fn halves_are_in_units_of_their_record() {
        let records = [record(4.0, 0.5), record(1.0, 8.0)];
        // Six fours each: two of expansions, four of derivatives.
        let halves: Vec<[f16; 4]> = (0..12).map(|at| [0.0, 0.25, 0.5, 0.75].map(|more| f16::from_f32(at as f32 + more))).collect();
        let values = fours(bytemuck::cast_slice(&halves), port::Precision::Half, &records);
        let units = [[4.0, 2.0], [1.0, 8.0]];
        for (at, value) in values.iter().enumerate() {
            let unit = units[at / 6][usize::from(at % 6 >= 2)];
            assert_eq!(*value, (at as f32 + Vec4::new(0.0, 0.25, 0.5, 0.75)) * unit, "{at}");
        }
        assert_eq!(values.len(), 12);
        assert!(fours(&[], port::Precision::Half, &[]).is_empty());
    }

    #[test]
    fn whole_floats_are_as_they_are() {
        let values = [Vec4::new(1.0, 2.0, 3.0, 4.0), Vec4::splat(0.1)];
        assert_eq!(fours(bytemuck::cast_slice(&values), port::Precision::Single, &[record(4.0, 0.5)]), values);
    }
}
