//! One ray a sample: on the cores of the host in packets of neighbours, on hardware each in a lane of its own.

use super::{Work, each_sample};
use crate::contract::{Encoder, encoder::scene_constants};
use crate::schedule::*;

/// Samples along x and y that a workgroup's packets cover: `COVERED` of the shader.
const COVERED: [u32; 2] = [32, 16];

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work) {
    let program = work
        .layout(scene_constants(Program::new("hemisphere_tiles/ray_cast"), e.setting.needs))
        .bind("requests", work.requests.places)
        .bind("samples", work.samples)
        .bind("seen", work.seen);
    if e.setting.device.is_software {
        let parts = work.table.width.div_ceil(COVERED[0]) * work.table.height.div_ceil(COVERED[1]);
        e.compute(program, "trace_packets", Groups::Counted { count: work.requests.count, divisor: 1, per: parts });
    } else {
        e.compute(program, "trace_each", each_sample(work));
    }
}
