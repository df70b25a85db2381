//! Radiance that lobes reflect, added to the pixels on the host: where the device is a driver on the same cores, its loads from places that
//! differ between lanes take longer than the sums themselves.

use super::{Radiance, Work};
use crate::contract::{Encoder, Refusal, port};
use crate::math::{harmonics::Tilting, projection::PixelRectangle, weight::Record};
use crate::passes::contribution::{
    bands,
    radiance::{Placed, Reflection, fours},
};
use crate::passes::record::{RECORD_BYTES, Record as HostRecord, pinhole};
use crate::schedule::*;
use bytemuck::cast_slice;
use glam::Vec4;

/// Steps of tables of matrices.
const STEPS: usize = 64;

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work, radiance: &Radiance) -> Result<(), Refusal> {
    let width = work.gbuffer.size[0];
    let (gbuffer, cache, lobes, seen) = (work.gbuffer, work.cache, radiance.visible.lobes.on_host()?.clone(), radiance.visible.seen);
    let coefficients = radiance.coefficients;
    let keep = |name: &str, count: usize, make: &dyn Fn() -> Vec<f32>| e.table(name, count, make);
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
            positions: cast_slice(host.read(gbuffer.position)),
            normals: cast_slice(host.read(gbuffer.normal)),
            seen: cast_slice(host.read(seen)),
            eye: camera.eye,
            lobes: &lobes,
            tilting: tilting.as_ref(),
        };
        let placed: Vec<(PixelRectangle, Placed)> = records
            .iter()
            .zip(values.chunks_exact(port::Coefficients::fours(coefficients.order) as usize))
            .filter_map(|(record, planes)| {
                let bounds = camera.bounds(record.position, cache.rule.longest_validity_radius(record) * 1.0001)?;
                Some((bounds, Placed { record: cache.rule.reaching(record), planes }))
            })
            .collect();
        let mut images = vec![vec![Vec4::ZERO; reflection.positions.len()]; written.len()];
        bands::add(width, &placed, &mut images, &reflection);
        for (image, contents) in written.iter().zip(images) {
            host.put(*image, contents, u64::MAX);
        }
        Ok(())
    };
    e.command(Command::Host(Host::new("reflect", reads, images, splat)));
    Ok(())
}
