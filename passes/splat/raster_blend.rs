//! A screen rectangle a record, blended additively into 32-bit floats.

use super::{Work, fresh};
use crate::contract::Recorder;
use crate::recording::*;

pub(super) fn record(r: &mut Recorder<'_>, work: &Work) {
    for (stretch, count) in fresh::record(r, work, u32::MAX) {
        draw(r, work, stretch, count);
    }
}

fn draw(r: &mut Recorder<'_>, work: &Work, stretch: Resource, count: Variable) {
    let add = |texture| Target { texture, clear: None, blend: Blend::Add };
    r.command(Command::Raster(Raster {
        program: work
            .contribution(Program::new("splat/raster_blend"))
            .bind("records", work.cache.records)
            .bind("weighting", work.cache.weighting)
            .bind("stretch", stretch)
            .bind("position", work.gbuffer.position)
            .bind("normal", work.gbuffer.normal),
        vertex: "vertex",
        fragment: Some(if work.counts.is_some() { "fragment_counted" } else { "fragment" }),
        colours: [Some(work.sums), work.counts].into_iter().flatten().map(add).collect(),
        depth: None,
        vertices: None,
        instances: None,
        indices: None,
        topology: Topology::TriangleStrip,
        draws: Draws::Instances { vertices: 4, count },
    }));
}
