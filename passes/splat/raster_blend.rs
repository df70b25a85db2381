//! A screen rectangle a record, blended additively into 32-bit floats.

use super::{Work, fresh};
use crate::contract::Encoder;
use crate::schedule::*;

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work) {
    for (stretch, count) in fresh::encode(e, work, u32::MAX) {
        draw(e, work, stretch, count);
    }
}

fn draw(e: &mut Encoder<'_>, work: &Work, stretch: Resource, count: Variable) {
    let add = |texture| Target { texture, clear: None, blend: Blend::Add };
    e.command(Command::Raster(Raster {
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
