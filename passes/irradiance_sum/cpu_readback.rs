//! The tiles of a batch are read back and added on the host in double precision.

use super::Work;
use crate::contract::Encoder;
use crate::math::sum::sum;
use crate::passes::record::{REQUEST_BYTES, Request, summed_record};
use crate::scene::model::surface_offset;
use crate::schedule::*;
use glam::Vec3;

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work<'_>) {
    let tiles = &work.weighted.tiles;
    let (table, samples, requests) = (work.weighted.table.clone(), tiles.samples, tiles.requests);
    let (records, gradients, radius) = (work.records, work.gradients, work.radius);
    let tile_bytes = table.samples.len() as u64 * 16;
    let reads = [Read::counted(samples, tile_bytes, requests.count), Read::counted(requests.places, REQUEST_BYTES, requests.count)];
    e.host("add", &reads, &[records], move |host| {
        let extent = host.extent();
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let mut new = Vec::with_capacity(places.len());
        for (place, tile) in places.iter().zip(host.read(samples).chunks_exact(tile_bytes as usize)) {
            let radiance: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(tile);
            let nearest = f64::from(surface_offset(extent, Vec3::from(place.position)).max(1e-30));
            let summed = sum(&table, &radiance, nearest).map_err(|e| e.to_string())?;
            new.push(summed_record(place, &summed, gradients, radius));
        }
        host.write(records, 0, bytemuck::cast_slice(&new));
        Ok(())
    });
}
