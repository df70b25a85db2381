//! Two images take turns, each a quarter of the other's texels, until a tile has 16×16 or fewer; the host adds those.

use super::Work;
use super::reduce::{PARTS, Storage};
use crate::contract::{Arguments, Encoder};
use crate::math::sum::{Summed, standard_error};
use crate::passes::record::{RECORD_BYTES, REQUEST_BYTES, Request, summed_record};
use crate::schedule::*;
use glam::{DVec3, DVec4};

/// Side of a tile that is small enough to be read back [texels].
const ENOUGH: u32 = 16;

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work<'_>, arguments: &Arguments) {
    let levels = work.levels(ENOUGH);
    let storage = Storage::of(e, work, arguments);
    let mut from = work.level_image(e, "ping", 0, storage.format);
    work.contribute(e, &storage, from);
    let mut into = if levels > 0 { work.level_image(e, "pong", 1, storage.format) } else { from };
    for level in 1..=levels {
        work.average(e, &storage, level, from, into);
        (from, into) = (into, from);
    }
    let requests = work.weighted.tiles.requests;
    let [width, height] = work.level_size(levels);
    let tile_bytes = (width * height * PARTS) as u64 * 16;
    let rest = e.buffer("rest", requests.capacity as u64 * tile_bytes);
    let program = work.at_level("irradiance_sum/ping_pong", levels).bind_part("last", from, work.level_bytes(levels, storage.format)).bind("rest", rest);
    e.compute(program, "pack", work.groups(levels));
    let (records, gradients, radius) = (work.records, work.gradients, work.radius);
    let table = &work.weighted.table;
    let (samples, block_share) = (table.samples.len() as f64, table.block_share());
    let exposures = storage.exposures;
    let mut reads = vec![Read::counted(rest, tile_bytes, requests.count), Read::counted(requests.places, REQUEST_BYTES, requests.count)];
    reads.extend(exposures.map(|exposures| Read::counted(exposures, 4, requests.count)));
    e.host("add", &reads, &[records], move |host| {
        let extent = host.extent() as f64;
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let tiles = host.read(rest).chunks_exact(tile_bytes as usize);
        let exposures = exposures.map_or(vec![1.0; places.len()], |exposures| bytemuck::pod_collect_to_vec::<u8, f32>(host.read(exposures)));
        let summed = tiles.zip(exposures).map(|(tile, exposure)| add(tile, extent, f64::from(exposure), block_share / samples));
        let new: Vec<_> = places.iter().zip(summed).map(|(place, summed)| summed_record(place, &summed, gradients, radius)).collect();
        debug_assert_eq!(size_of_val(new.as_slice()) as u64, places.len() as u64 * RECORD_BYTES);
        host.write(records, 0, bytemuck::cast_slice(&new));
        Ok(())
    });
}

/// The sum of a tile from the averages of its parts, as `shaders/irradiance_sum/reduce.wgsl` scales them; `block_share` is the table's, a sample.
fn add(tile: &[u8], extent: f64, exposure: f64, block_share: f64) -> Summed {
    let values: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(tile);
    let texels = values.len() / PARTS as usize;
    let parts: Vec<DVec4> =
        values.chunks_exact(texels).map(|part| part.iter().map(|v| glam::Vec4::from(*v).as_dvec4()).sum::<DVec4>() / texels as f64).collect();
    let nearest = values[2 * texels..3 * texels].iter().fold(0.0f32, |most, v| most.max(v[3]));
    let (weight, inverse) = (parts[2].z, parts[0].w / extent);
    let light: Vec<DVec4> = parts.iter().map(|part| *part / exposure).collect();
    Summed {
        irradiance: light[0].truncate(),
        error: standard_error(light[6].truncate() / exposure, block_share),
        rotation: [DVec3::new(light[1].x, light[1].y, 0.0), DVec3::new(light[1].z, light[1].w, 0.0), DVec3::new(light[2].x, light[2].y, 0.0)],
        translation: [3, 4, 5].map(|part| light[part].truncate() / extent),
        hessian: DVec3::new(light[3].w, light[4].w, light[5].w) / (extent * extent),
        harmonic_mean_cosine: weight / inverse,
        // Not among the parts, and of no use to a record of irradiance.
        harmonic_mean_plain: weight / inverse,
        min_distance: extent / f64::from(nearest),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec4;

    /// Four texels of each part, which are what is given on average.
    fn tile(parts: [Vec4; PARTS as usize]) -> Vec<u8> {
        let around = [Vec4::splat(0.5), Vec4::splat(-0.5), Vec4::new(-0.25, 0.25, 0.25, -1.0), Vec4::new(0.25, -0.25, -0.25, 1.0)];
        let texels: Vec<Vec4> = parts.iter().flat_map(|part| around.map(|off| *part + off)).collect();
        bytemuck::cast_slice(&texels).to_vec()
    }

    #[test]
    fn parts_are_undone_as_they_were_scaled() {
        let part = |x: f32| Vec4::new(x, x + 1.0, x + 2.0, x + 3.0);
        let summed = add(&tile([part(1.0), part(11.0), part(21.0), part(31.0), part(41.0), part(51.0), part(61.0)]), 4.0, 2.0, 0.5);
        // Light is over the exposure, gradients over the extent, second derivatives over its square.
        assert_eq!(summed.irradiance, DVec3::new(0.5, 1.0, 1.5));
        // The root of a quarter of the squares in half a share, over the exposure.
        assert!((summed.error * summed.error * 32.0 - DVec3::new(61.0, 62.0, 63.0)).length() < 1e-12);
        assert_eq!(summed.rotation, [DVec3::new(5.5, 6.0, 0.0), DVec3::new(6.5, 7.0, 0.0), DVec3::new(10.5, 11.0, 0.0)]);
        assert_eq!(summed.translation, [31.0, 41.0, 51.0].map(|x| DVec3::new(x, x + 1.0, x + 2.0) / 8.0));
        assert_eq!(summed.hessian, DVec3::new(34.0, 44.0, 54.0) / 32.0);
        // The weight over the weighted inverses of distances, which are in extents; neither has the exposure.
        assert_eq!([summed.harmonic_mean_cosine, summed.harmonic_mean_plain], [23.0 / (4.0 / 4.0); 2]);
        // The largest inverse of the four.
        assert_eq!(summed.min_distance, 4.0 / 25.0);
    }
}
