//! One ray a sample, in packets of neighbours, cast on the host.

use super::{SAMPLES_OF_EMITTERS, Work, host_shade};
use crate::contract::{Encoder, port};
use crate::math::frame::Frame;
use crate::passes::irradiance_field;
use crate::passes::record::{REQUEST_BYTES, Request};
use crate::scene::{
    packets::{Numbers, RayBundle, View},
    shadow_maps::ShadowMaps,
};
use crate::schedule::*;
use glam::Vec3;

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
pub(super) fn encode_shaded(
    e: &mut Encoder<'_>,
    work: &Work,
    maps: Option<port::ShadowMaps>,
    indirect: Option<port::IrradianceField>,
    sees_emission: bool,
) -> Resource {
    let bundle = RayBundle::new(&work.table);
    let (requests, radiance) = (work.requests, work.radiance(e));
    let lighting = host_shade::encode(e, SAMPLES_OF_EMITTERS, sees_emission);
    let lit_by = maps.iter().map(|maps| Read::whole(maps.depth)).chain(indirect.iter().flat_map(irradiance_field::reads));
    let reads: Vec<Read> = lit_by.chain([Read::counted(requests.places, REQUEST_BYTES, requests.count)]).collect();
    e.host("cast_and_shade", &reads, &[radiance], move |host| {
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let mut samples = host.take(radiance);
        let lighting = host_shade::lighting(host, lighting)?;
        let maps = maps.map_or_else(ShadowMaps::default, |maps| host_shade::shadow_maps(&maps, host));
        let emitters = lighting.emitters(host.scene(), host.bvh(), host.extent());
        let records = indirect.map_or_else(Vec::new, |field| irradiance_field::records(&field, host));
        let indirect = indirect.map(|field| irradiance_field::on_host(&field, host, &records));
        let shader = host_shade::Shading { lighting: &lighting, maps, scene: host.scene(), emitters, places: &places, indirect: indirect.as_ref() };
        let seen = &mut samples[..places.len() * bundle.samples];
        host.bvh().packets(host.scene()).trace(host.scene(), &views(&places), &bundle, &shader, seen);
        let bytes = size_of_val(seen) as u64;
        host.put(radiance, samples, bytes);
        Ok(())
    });
    radiance
}

fn views(places: &[Request]) -> Vec<View> {
    places.iter().map(|place| View { position: place.position.into(), frame: Frame::new(Vec3::from(place.normal)).turned(place.turn) }).collect()
}
