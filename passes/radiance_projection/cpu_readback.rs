//! The tiles of a batch are read back and projected on the host in double precision.

use super::{Work, keep};
use crate::contract::Encoder;
use crate::passes::record::{RECORD_BYTES, REQUEST_BYTES, Record, Request};
use crate::scene::model::surface_offset;
use crate::schedule::*;
use glam::{Vec3, Vec4};

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work<'_>) {
    let tiles = &work.weighted.tiles;
    let (table, expansion, requests, samples, values) = (work.weighted.table.clone(), work.expansion.clone(), tiles.requests, tiles.samples, work.values);
    let tile_bytes = table.samples.len() as u64 * 16;
    let records = work.records;
    let reads = [
        Read::counted(samples, tile_bytes, requests.count),
        Read::counted(requests.places, REQUEST_BYTES, requests.count),
        Read::counted(records, RECORD_BYTES, requests.count),
    ];
    e.host("project", &reads, &[values, records], move |host| {
        let extent = host.extent();
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let mut heads: Vec<Record> = bytemuck::pod_collect_to_vec(host.read(records));
        let mut all: Vec<Vec4> = Vec::new();
        for ((place, head), tile) in places.iter().zip(&mut heads).zip(host.read(samples).chunks_exact(tile_bytes as usize)) {
            let radiance: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(tile);
            let nearest = f64::from(surface_offset(extent, Vec3::from(place.position)).max(1e-30));
            let projected = expansion.project(&table, &radiance, nearest).map_err(|e| e.to_string())?;
            keep(projected, !expansion.walls.is_empty(), place, head, &mut all);
        }
        host.write(values, 0, bytemuck::cast_slice(&all));
        host.write(records, 0, bytemuck::cast_slice(&heads));
        Ok(())
    });
}
