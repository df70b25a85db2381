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
