//! Radiance that lobes reflect, added to the pixels on the host: where the device is a driver on the same cores, its loads from places that
//! differ between lanes take longer than the sums themselves.

use super::{
    Radiance, Work,
    bands::{self, Band, Contribution},
};
use crate::contract::{Recorder, Refusal, port};
use crate::math::{
    harmonics::{Tilting, reflection::LobeTable},
    projection::PixelRectangle,
    radiance::{Viewed, reflected, reflected_rotated},
    weight::Record,
};
use crate::passes::record::{RECORD_BYTES, Record as HostRecord, pinhole, texels};
use crate::recording::*;
use fearless_simd::Simd;
use glam::{Vec3, Vec4};
use half::f16;
use std::{ops::Range, sync::Arc};

/// Steps of tables of matrices.
const STEPS: usize = 64;

/// What lobes reflect of records.
struct Reflection<'a> {
    /// What pixels see.
    position: Vec<[f32; 4]>,
    normal: Vec<[f32; 4]>,
    seen: Vec<[f32; 4]>,
    eye: Vec3,
    cache: &'a port::RecordCache,
    lobes: &'a [LobeTable],
    /// None where the viewer is moved in place of it.
    tilting: Option<&'a Tilting>,
}

/// A record that covers some of the picture.
struct Placed<'a> {
    record: &'a Record,
    planes: &'a [Vec4],
}

pub(super) fn record(r: &mut Recorder<'_>, work: &Work, radiance: &Radiance) -> Result<(), Refusal> {
    let width = r.setting.size[0];
    let (gbuffer, cache, lobes, seen) = (work.gbuffer, work.cache, radiance.visible.lobes.on_host()?.clone(), radiance.visible.seen);
    let coefficients = radiance.coefficients;
    let keep = |name: &str, count: usize, make: &dyn Fn() -> Vec<f32>| r.table(name, count, make);
    let tilting = radiance.rotation.map(|method| Tilting::kept(coefficients.order as usize, method, STEPS, keep));
    let images: Vec<Resource> = [Some(work.sums), work.counts].into_iter().flatten().collect();
    let written = images.clone();
    let reads = vec![
        Read::whole(gbuffer.position),
        Read::whole(gbuffer.normal),
        Read::whole(seen),
        Read::counted(cache.records, RECORD_BYTES, cache.count),
        Read::counted(coefficients.values, port::Coefficients::bytes(coefficients.order, coefficients.precision), cache.count),
    ];
    let splat = move |host: &mut dyn HostContext| {
        let records: Vec<Record> = bytemuck::pod_collect_to_vec::<u8, HostRecord>(host.read(cache.records)).iter().map(Record::from).collect();
        let values = fours(host.read(coefficients.values), coefficients.precision, &records);
        let camera = pinhole(host);
        let reflection = Reflection {
            position: texels(host, gbuffer.position),
            normal: texels(host, gbuffer.normal),
            seen: texels(host, seen),
            eye: camera.eye,
            cache: &cache,
            lobes: &lobes,
            tilting: tilting.as_ref(),
        };
        let placed: Vec<(PixelRectangle, Placed)> = records
            .iter()
            .zip(values.chunks_exact(port::Coefficients::fours(coefficients.order) as usize))
            .filter_map(|(record, planes)| Some((camera.bounds(record.position, cache.rule.longest_reach(record) * 1.0001)?, Placed { record, planes })))
            .collect();
        let mut images = vec![vec![Vec4::ZERO; reflection.position.len()]; written.len()];
        bands::add(width, &placed, &mut images, &reflection);
        for (image, contents) in written.iter().zip(images) {
            host.put(*image, contents, u64::MAX);
        }
        Ok(())
    };
    r.command(Command::Host(Host { name: "reflect", reads, writes: images, run: Arc::new(splat) }));
    Ok(())
}

/// Coefficients as they are computed with.
fn fours(bytes: &[u8], precision: port::Precision, records: &[Record]) -> Vec<Vec4> {
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
        let [x, y, z, footprint] = self.position[pixel];
        if footprint <= 0.0 {
            return None;
        }
        let [a, b, c, _] = self.normal[pixel];
        let (position, normal) = (Vec3::new(x, y, z), Vec3::new(a, b, c));
        let weight = self.cache.rule.weight(placed.record, position, normal);
        if weight <= 0.0 {
            return None;
        }
        let [red, green, blue, table] = self.seen[pixel];
        let viewed = Viewed {
            toward: (self.eye - position).normalize_or(normal),
            normal,
            record_normal: placed.record.normal,
            offset: self.cache.rule.step(placed.record, position),
            reflectance: Vec3::new(red, green, blue),
            azimuth: table.fract(),
        };
        let table = &self.lobes[table as usize];
        let radiance = match self.tilting {
            Some(tilting) => reflected_rotated(placed.planes, table, tilting, &viewed),
            None => reflected(placed.planes, table, &viewed),
        };
        Some(radiance.extend(1.0) * weight)
    }
}
