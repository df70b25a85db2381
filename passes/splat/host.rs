//! Irradiance added to the pixels on the host.

use super::Work;
use crate::contract::Recorder;
use crate::math::projection::PixelRectangle;
use crate::math::weight::{Reaching, Record};
use crate::passes::contribution::{bands, irradiance::Seen};
use crate::passes::record::{RECORD_BYTES, Record as HostRecord, pinhole};
use crate::recording::*;
use glam::Vec4;

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
    super::at_start(r, Command::Host(Host::new("clear", Vec::new(), images.clone(), clear)));
    let (gbuffer, cache, first, width, in_fill) = (work.gbuffer, work.cache, work.first, r.setting.size[0], r.batch.is_some());
    let mut reads = vec![Read::whole(gbuffer.position), Read::whole(gbuffer.normal), Read::counted(cache.records, RECORD_BYTES, cache.count)];
    reads.extend(images.iter().copied().map(Read::whole));
    let written = images.clone();
    let splat = move |host: &mut dyn HostContext| {
        let mut images: Vec<Vec<Vec4>> = written.iter().map(|image| host.take(*image)).collect();
        let camera = pinhole(host);
        let records: &[HostRecord] = bytemuck::cast_slice(host.read(cache.records));
        let from = if in_fill { host.variable(first) as usize } else { 0 };
        let new: Vec<Record> = records.get(from..).unwrap_or_default().iter().map(Record::from).collect();
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
        host.set(first, host.variable(cache.count));
        Ok(())
    };
    r.command(Command::Host(Host::new("splat", reads, images, splat)));
}
