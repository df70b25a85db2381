//! Tiles are added on the host in single precision, eight samples side by side.

use super::Work;
use crate::contract::Encoder;
use crate::math::{
    sum::Summed,
    sum_vectors::{Cells, Room, Wanted},
};
use crate::passes::record::{REQUEST_BYTES, Radius, Request, summed_record};
use crate::scene::model::surface_offset;
use crate::schedule::*;
use glam::{Vec3, Vec4};
use rayon::prelude::*;

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work<'_>) {
    let cells = Cells::new(&work.weighted.table);
    let length = work.weighted.table.samples.len();
    let (samples, requests) = (work.weighted.tiles.samples, work.weighted.tiles.requests);
    let (records, gradients, radius) = (work.records, work.gradients, work.radius);
    let wanted = Wanted { gradients, hessian: radius == Radius::Curvature };
    let sureness = work.weighted.tiles.sureness;
    let tiles = [Read::counted(samples, (length * size_of::<Vec4>()) as u64, requests.count), Read::counted(requests.places, REQUEST_BYTES, requests.count)];
    let reads: Vec<Read> = tiles.into_iter().chain(sureness.map(|sureness| Read::counted(sureness, 4, requests.count))).collect();
    e.host("add", &reads, &[records], move |host| {
        let extent = host.extent();
        let places: &[Request] = bytemuck::cast_slice(host.read(requests.places));
        let tiles: &[Vec4] = bytemuck::cast_slice(host.read(samples));
        let sureness: &[f32] = sureness.map_or(&[], |sureness| bytemuck::cast_slice(host.read(sureness)));
        let add = |room: &mut Room, (number, (place, tile)): (usize, (&Request, &[Vec4]))| {
            let nearest = surface_offset(extent, Vec3::from(place.position)).max(1e-30);
            let summed = cells.sum(tile, nearest, wanted, room);
            let error = summed.error * f64::from(sureness.get(number).copied().unwrap_or(1.0));
            summed_record(place, &Summed { error, ..summed }, gradients, radius)
        };
        let new: Vec<_> = places.par_iter().zip(tiles.par_chunks_exact(length)).enumerate().map_init(Room::default, add).collect();
        host.write(records, 0, bytemuck::cast_slice(&new));
        Ok(())
    });
}
