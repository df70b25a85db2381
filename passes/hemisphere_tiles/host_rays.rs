//! One ray a sample, in packets of neighbours, cast on the host.

use super::Work;
use crate::contract::Recorder;
use crate::math::frame::Frame;
use crate::passes::record::{REQUEST_BYTES, Request};
use crate::recording::*;
use crate::scene::packets::{Fan, View};
use glam::Vec3;

pub(super) fn record(r: &mut Recorder<'_>, work: &Work) {
    let fan = Fan::new(&work.table);
    let (requests, seen) = (work.requests, work.seen);
    let memory = r.state("triangles");
    r.host("cast", &[Read::counted(requests.places, REQUEST_BYTES, requests.count)], &[seen], move |host| {
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let views = places.iter().map(|place| View { position: place.position.into(), frame: Frame::new(Vec3::from(place.normal)).turned(place.turn) });
        let mut triangles = host.state(memory).take().and_then(|kept| kept.downcast::<Vec<u32>>().ok()).unwrap_or_default();
        host.bvh().packets(host.scene()).look(host.scene(), &views.collect::<Vec<_>>(), &fan, &mut triangles);
        host.write(seen, 0, bytemuck::cast_slice(&triangles));
        *host.state(memory) = Some(triangles);
        Ok(())
    });
}
