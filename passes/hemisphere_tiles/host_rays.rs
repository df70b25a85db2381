//! One ray a sample, in packets of neighbours, cast on the host.

use super::Work;
use super::steering::{Steering, Tile, TileRays};
use crate::contract::{Encoder, port};
use crate::math::{frame::Frame, record_index::Shares};
use crate::passes::irradiance_field::Asked;
use crate::passes::record::{REQUEST_BYTES, Request, index_of, light_of};
use crate::passes::seen_light::{self, Hit, Keeping, Sees, Shading};
use crate::scene::packets::{HitShader, Numbers, RayBundle, View};
use crate::schedule::*;
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// The host finds the triangles, the device is to shade them.
pub(super) fn encode(e: &mut Encoder<'_>, work: &Work) {
    let bundle = RayBundle::new(&work.table);
    let (requests, seen) = (work.requests, work.seen);
    e.host("cast", &[Read::counted(requests.places, REQUEST_BYTES, requests.count)], &[seen], move |host| {
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let mut triangles = host.take(seen);
        let numbers: &mut [u32] = &mut bytemuck::cast_slice_mut(&mut triangles)[..places.len() * bundle.samples];
        host.bvh().packets(host.scene()).trace(host.scene(), &views(&places), &bundle, &Numbers, numbers);
        let bytes = size_of_val(numbers) as u64;
        host.put(seen, triangles, bytes);
        Ok(())
    });
}

/// The host shades them, too: the buffer of radiance and distance.
pub(super) fn encode_shaded(e: &mut Encoder<'_>, work: &Work, maps: Option<port::ShadowMaps>, (sees, steering): (Sees, Steering)) -> Resource {
    let indirect = Asked::of(e, "indirect");
    let bundle = RayBundle::new(&work.table);
    let (requests, radiance) = (work.requests, work.radiance(e));
    let lighting = seen_light::encode(e, sees);
    let lit_by = maps.iter().map(|maps| Read::whole(maps.depth)).chain(indirect.iter().flat_map(Asked::reads)).chain(steering.reads());
    let reads: Vec<Read> = lit_by.chain([Read::counted(requests.places, REQUEST_BYTES, requests.count)]).collect();
    let written: Vec<Resource> = [radiance].into_iter().chain(steering.sureness).collect();
    e.host("cast_and_shade", &reads, &written, move |host| {
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let mut known = steering.known(host, &places);
        let mut samples = host.take(radiance);
        let (lighting, index) = (seen_light::lighting(host, lighting)?, indirect.and_then(|field| field.index(host)));
        let indirect = indirect.and_then(|field| field.on_host(host, index.as_deref()));
        let seen = &mut samples[..places.len() * bundle.samples];
        let mut sureness = vec![1.0f32; places.len()];
        for wave in steering.waves(&known, &places) {
            let chosen: Vec<Request> = wave.iter().map(|number| places[*number]).collect();
            let shader = Shading { indirect: indirect.as_ref(), ..Shading::of(host, &lighting, maps, &chosen) };
            let rays = steering.rays(&known, &chosen);
            let tiles = see(host, &shader, &bundle, (&steering, &rays));
            for (number, tile) in wave.iter().zip(&tiles) {
                seen[number * bundle.samples..][..bundle.samples].copy_from_slice(&tile.seen);
                sureness[*number] = tile.sureness;
            }
            steering.learn(&mut known, &chosen, &rays, &tiles);
        }
        let bytes = size_of_val(seen) as u64;
        host.put(radiance, samples, bytes);
        steering.keep(host, known, &sureness);
        Ok(())
    });
    radiance
}

/// The tiles of a shader's places.
fn see(host: &dyn HostContext, shader: &Shading<'_>, bundle: &RayBundle, (steering, rays): (&Steering, &[TileRays])) -> Vec<Tile> {
    let (views, packets) = (views(shader.places), host.bvh().packets(host.scene()));
    let bundles: Vec<&RayBundle> = rays.iter().map(|rays| steering.bundle(rays, bundle)).collect();
    let mut tiles = packets.trace_own(host.scene(), &views, &bundles, shader, |number, seen| steering.tile(&rays[number], seen));
    let bundles: Vec<&RayBundle> = rays.iter().map(|rays| &rays.more.bundle).collect();
    let also_seen = packets.trace_own(host.scene(), &views, &bundles, shader, |_, seen| seen);
    tiles.par_iter_mut().zip(rays).zip(&also_seen).for_each(|((tile, rays), seen)| rays.join(seen, tile));
    tiles
}

/// What the places of a loop see in each of its rounds.
struct Kept {
    /// Radiance and distance, with direct light alone.
    seen: Vec<Vec4>,
    hits: Vec<Hit>,
    /// Which records of the round before count where; none before there are any.
    shares: Option<Shares>,
}

/// The same where the places stay as they are while a loop runs, whose records of the round before light what they see: rays are cast and what they see is shaded
/// as the loop starts, each round adds what the records tell.
pub(super) fn encode_steady(e: &mut Encoder<'_>, work: &Work, maps: Option<port::ShadowMaps>, index: port::RecordIndex, sees: Sees) -> Resource {
    let bundle = RayBundle::new(&work.table);
    let (requests, radiance, memory) = (work.requests, work.radiance(e), e.state("kept"));
    let lighting = seen_light::encode(e, sees);
    let reads: Vec<Read> = maps.iter().map(|maps| Read::whole(maps.depth)).chain([Read::counted(requests.places, REQUEST_BYTES, requests.count)]).collect();
    let samples = bundle.samples;
    let cast = move |host: &mut dyn HostContext| {
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let lighting = seen_light::lighting(host, lighting)?;
        let shader = Keeping(Shading::of(host, &lighting, maps, &places));
        let mut sights = vec![Keeping::NOTHING; places.len() * bundle.samples];
        host.bvh().packets(host.scene()).trace(host.scene(), &views(&places), &bundle, &shader, &mut sights);
        let (seen, hits) = sights.into_iter().map(|sight| (sight.seen, sight.hit)).unzip();
        *host.state(memory) = Some(Box::new(Kept { seen, hits, shares: None }));
        Ok(())
    };
    e.before_loop(Command::Host(Host::new("cast_and_shade", reads, Vec::new(), cast)));
    e.host("add_indirect", &[Read::whole(index.data)], &[radiance], move |host| {
        let mut kept = host.state(memory).take().and_then(|kept| kept.downcast::<Kept>().ok()).ok_or("no ray was cast before the loop")?;
        let mut tiles = host.take(radiance);
        let seen = &mut tiles[..kept.seen.len()];
        kept.light(host, &index, samples, seen);
        let bytes = size_of_val(seen) as u64;
        host.put(radiance, tiles, bytes);
        *host.state(memory) = Some(kept);
        Ok(())
    });
    radiance
}

impl Kept {
    /// What the surfaces send back, lit by records too.
    fn light(&mut self, host: &mut dyn HostContext, index: &port::RecordIndex, samples: usize, tiles: &mut [Vec4]) {
        let light = light_of(index, host);
        if !light.is_flat() {
            let all = index_of(index, host);
            return self.add(samples, tiles, |hit, _| all.estimate_at(hit.at.position, hit.at.normal).0);
        }
        let points = || self.hits.iter().map(|hit| [hit.at.position, hit.at.normal]).collect::<Vec<_>>();
        let known = self.shares.take().filter(|shares| shares.are_of(&light));
        let shares = known.unwrap_or_else(|| Shares::of(&index_of(index, host), &points()));
        self.add(samples, tiles, |_, number| shares.irradiance(&light, number));
        self.shares = Some(shares);
    }

    fn add(&self, samples: usize, tiles: &mut [Vec4], irradiance: impl Fn(&Hit, usize) -> Vec3 + Sync) {
        let light = |number: usize| {
            let (hit, seen) = (&self.hits[number], self.seen[number]);
            if hit.reflectance == Vec3::ZERO { seen } else { seen + (hit.reflectance * irradiance(hit, number)).extend(0.0) }
        };
        tiles.par_chunks_mut(samples).enumerate().for_each(|(tile, seen)| (tile * samples..).zip(seen).for_each(|(number, seen)| *seen = light(number)));
    }
}

fn views(places: &[Request]) -> Vec<View> {
    places.iter().map(|place| View { position: place.position.into(), frame: Frame::new(Vec3::from(place.normal)).turned(place.turn) }).collect()
}
