//! One ray a sample, in packets of neighbours, cast on the host.

use super::{Work, host_shade};
use crate::contract::{Recorder, port};
use crate::math::frame::Frame;
use crate::passes::record::{HostTiles, REQUEST_BYTES, Request};
use crate::recording::*;
use crate::scene::packets::{Fan, Numbers, View};
use glam::Vec3;

/// The host finds the triangles, the device is to shade them.
pub(super) fn record(r: &mut Recorder<'_>, work: &Work) {
    let fan = Fan::new(&work.table);
    let (requests, seen) = (work.requests, work.seen);
    let memory = r.state("triangles");
    r.host("cast", &[Read::counted(requests.places, REQUEST_BYTES, requests.count)], &[seen], move |host| {
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let mut triangles = host.state(memory).take().and_then(|kept| kept.downcast().ok()).map_or_else(Vec::new, |kept: Box<Vec<u32>>| *kept);
        host.bvh().packets(host.scene()).look(host.scene(), &views(&places), &fan, &Numbers, &mut triangles);
        host.write(seen, 0, bytemuck::cast_slice(&triangles));
        *host.state(memory) = Some(Box::new(triangles));
        Ok(())
    });
}

/// The host shades them, too, and keeps them: the buffer of radiance and distance, for those on the device who read it, and the state of [`HostTiles`].
pub(super) fn record_shaded(r: &mut Recorder<'_>, work: &Work, maps: Option<port::ShadowMaps>) -> [Resource; 2] {
    let fan = Fan::new(&work.table);
    let (requests, radiance) = (work.requests, work.radiance(r));
    let lighting = host_shade::record(r, maps);
    let memory = r.state("tiles");
    r.host("cast_and_shade", &[Read::counted(requests.places, REQUEST_BYTES, requests.count)], &[], move |host| {
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let mut samples = host.state(memory).take().and_then(|kept| kept.downcast().ok()).map_or_else(Vec::new, |kept: Box<HostTiles>| kept.samples);
        let lighting = host_shade::lighting(host, lighting)?;
        let eye = host_shade::Shading { lighting: &lighting, scene: host.scene(), places: &places };
        host.bvh().packets(host.scene()).look(host.scene(), &views(&places), &fan, &eye, &mut samples);
        *host.state(memory) = Some(Box::new(HostTiles { places, samples }));
        Ok(())
    });
    r.hand_over(radiance, move |host| {
        if let Some(tiles) = host.state(memory).take() {
            let samples = tiles.downcast_ref::<HostTiles>().map_or(&[][..], |tiles| &tiles.samples);
            host.write(radiance, 0, bytemuck::cast_slice(samples));
            *host.state(memory) = Some(tiles);
        }
        Ok(())
    });
    [radiance, memory]
}

fn views(places: &[Request]) -> Vec<View> {
    places.iter().map(|place| View { position: place.position.into(), frame: Frame::new(Vec3::from(place.normal)).turned(place.turn) }).collect()
}
