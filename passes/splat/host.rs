//! Irradiance added to the pixels on the host, eight neighbours side by side.

use super::{
    Work,
    bands::{self, Band, Contribution},
};
use crate::contract::Recorder;
use crate::math::projection::PixelRectangle;
use crate::math::vectors::{LANES, Vectors, apart, together};
use crate::math::weight::{Reaching, Record};
use crate::passes::record::{RECORD_BYTES, Record as HostRecord, pinhole};
use crate::recording::*;
use fearless_simd::{Simd, prelude::*};
use glam::Vec4;
use std::{ops::Range, sync::Arc};

pub(super) fn record(r: &mut Recorder<'_>, work: &Work) {
    let images: Vec<Resource> = [Some(work.sums), work.counts].into_iter().flatten().collect();
    let cleared = images.clone();
    let clear = move |host: &mut dyn HostContext| {
        for &image in &cleared {
            let mut contents = host.take(image);
            contents.fill(Vec4::ZERO);
            host.put(image, contents, u64::MAX);
        }
        Ok(())
    };
    super::at_start(r, Command::Host(Host { name: "clear", reads: Vec::new(), writes: images.clone(), run: Arc::new(clear) }));
    let (gbuffer, cache, first, width) = (work.gbuffer, work.cache, work.first, r.setting.size[0]);
    let mut reads = vec![Read::whole(gbuffer.position), Read::whole(gbuffer.normal), Read::counted(cache.records, RECORD_BYTES, cache.count)];
    reads.extend(images.iter().copied().map(Read::whole));
    let written = images.clone();
    let splat = move |host: &mut dyn HostContext| {
        let mut images: Vec<Vec<Vec4>> = written.iter().map(|image| host.take(*image)).collect();
        let camera = pinhole(host);
        let records: &[HostRecord] = bytemuck::cast_slice(host.read(cache.records));
        let new: Vec<Record> = records.get(host.variable(first) as usize..).unwrap_or_default().iter().map(Record::from).collect();
        let placed: Vec<(PixelRectangle, Reaching<'_>)> = new
            .iter()
            .filter_map(|record| Some((camera.bounds(record.position, cache.rule.longest_reach(record) * 1.0001)?, cache.rule.reaching(record))))
            .collect();
        let positions = bytemuck::cast_slice(host.read(gbuffer.position));
        let seen = Seen { positions, normals: bytemuck::cast_slice(host.read(gbuffer.normal)) };
        bands::add(width, &placed, &mut images, &seen);
        for (image, contents) in written.iter().zip(images) {
            host.put(*image, contents, u64::MAX);
        }
        Ok(())
    };
    r.command(Command::Host(Host { name: "splat", reads, writes: images, run: Arc::new(splat) }));
}

/// What pixels see.
struct Seen<'a> {
    positions: &'a [Vec4],
    normals: &'a [Vec4],
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
