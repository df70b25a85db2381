//! One workgroup a tile.

use super::Work;
use crate::contract::Recorder;
use crate::recording::*;

pub(super) fn record(r: &mut Recorder<'_>, work: &Work<'_>) {
    let tiles = &work.weighted.tiles;
    let program = work
        .layout(Program::new("irradiance_sum/workgroup_tree"))
        .constant("EDGES", work.weighted.table.edges.len() as u32)
        .bind("requests", tiles.requests.places)
        .bind("weights", work.weighted.weights)
        .bind("edges", work.weighted.edges)
        .bind("radiance", tiles.samples)
        .bind("records", work.records);
    r.compute(program, "sum", Groups::Counted { count: tiles.requests.count, divisor: 1, per: 1 });
}
