//! Tiles that the host has shaded are added there, eight samples side by side: nothing is brought to the device but records.

use super::Work;
use crate::contract::Recorder;
use crate::math::sum_vectors::{Cells, Room, Wanted};
use crate::passes::record::{HostTiles, Radius, Request, summed_record};
use crate::recording::*;
use crate::scene::model::surface_offset;
use glam::Vec3;
use rayon::prelude::*;

/// Adds up the tiles in the state `of`.
pub(super) fn record(r: &mut Recorder<'_>, work: &Work<'_>, of: Resource) {
    let cells = Cells::new(&work.weighted.table);
    let samples = work.weighted.table.samples.len();
    let (records, gradients, radius) = (work.records, work.gradients, work.radius);
    let wanted = Wanted { gradients, hessian: radius == Radius::Curvature };
    r.host("add", &[], &[records], move |host| {
        let extent = host.scene().extent();
        let Some(tiles) = host.state(of).as_ref().and_then(|kept| kept.downcast_ref::<HostTiles>()) else {
            return Err("the tiles are not on the host".into());
        };
        let add = |room: &mut Room, (place, tile): (&Request, &[_])| {
            let nearest = surface_offset(extent, Vec3::from(place.position)).max(1e-30);
            summed_record(place, &cells.sum(tile, nearest, wanted, room), gradients, radius)
        };
        let new: Vec<_> = tiles.places.par_iter().zip(tiles.samples.par_chunks_exact(samples)).map_init(Room::default, add).collect();
        host.write(records, 0, bytemuck::cast_slice(&new));
        Ok(())
    });
}
