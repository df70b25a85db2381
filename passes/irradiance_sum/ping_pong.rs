//! Two images take turns, each a quarter of the other's texels, until a tile has 16×16 or fewer; the host adds those.

use super::Work;
use super::reduce::{PARTS, Storage};
use crate::contract::{Arguments, Recorder};
use crate::math::sum::Summed;
use crate::passes::record::{RECORD_BYTES, REQUEST_BYTES, Request, summed_record};
use crate::recording::*;
use glam::{DVec3, DVec4};

/// Side of a tile that is small enough to be read back [texels].
const ENOUGH: u32 = 16;

pub(super) fn record(r: &mut Recorder<'_>, work: &Work<'_>, arguments: &Arguments) {
    let levels = work.levels(ENOUGH);
    let storage = Storage::of(r, arguments);
    let mut from = work.level_image(r, "ping", 0, storage.format);
    work.contribute(r, &storage, from);
    let mut into = if levels > 0 { work.level_image(r, "pong", 1, storage.format) } else { from };
    for level in 1..=levels {
        work.average(r, &storage, level, from, into);
        (from, into) = (into, from);
    }
    let requests = work.weighted.tiles.requests;
    let [width, height] = work.level_size(levels);
    let tile_bytes = (width * height * PARTS) as u64 * 16;
    let rest = r.buffer("rest", requests.capacity as u64 * tile_bytes);
    let program = work.at_level("irradiance_sum/ping_pong", levels).bind("last", from).bind("rest", rest);
    r.compute(program, "pack", work.groups(levels));
    let (records, gradients, radius) = (work.records, work.gradients, work.radius);
    let reads = [Read::counted(rest, tile_bytes, requests.count), Read::counted(requests.places, REQUEST_BYTES, requests.count)];
    r.host("add", &reads, &[records], move |host| {
        let extent = host.scene().extent() as f64;
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let tiles = host.read(rest).chunks_exact(tile_bytes as usize);
        let new: Vec<_> = places.iter().zip(tiles).map(|(place, tile)| summed_record(place, &add(tile, extent), gradients, radius)).collect();
        debug_assert_eq!(size_of_val(new.as_slice()) as u64, places.len() as u64 * RECORD_BYTES);
        host.write(records, 0, bytemuck::cast_slice(&new));
        Ok(())
    });
}

/// The sum of a tile from the averages of its parts, as `shaders/irradiance_sum/reduce.wgsl` scales them.
fn add(tile: &[u8], extent: f64) -> Summed {
    let values: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(tile);
    let texels = values.len() / PARTS as usize;
    let parts: Vec<DVec4> =
        values.chunks_exact(texels).map(|part| part.iter().map(|v| glam::Vec4::from(*v).as_dvec4()).sum::<DVec4>() / texels as f64).collect();
    let nearest = values[2 * texels..3 * texels].iter().fold(0.0f32, |most, v| most.max(v[3]));
    let (weight, inverse) = (parts[2].z, parts[0].w / extent);
    Summed {
        irradiance: parts[0].truncate(),
        rotation: [DVec3::new(parts[1].x, parts[1].y, 0.0), DVec3::new(parts[1].z, parts[1].w, 0.0), DVec3::new(parts[2].x, parts[2].y, 0.0)],
        translation: [3, 4, 5].map(|part| parts[part].truncate() / extent),
        hessian: DVec3::new(parts[3].w, parts[4].w, parts[5].w) / (extent * extent),
        harmonic_mean_cosine: weight / inverse,
        // Not among the parts, and of no use to a record of irradiance.
        harmonic_mean_plain: weight / inverse,
        min_distance: extent / f64::from(nearest),
    }
}
