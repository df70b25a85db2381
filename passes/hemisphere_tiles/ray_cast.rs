//! One ray a sample, in packets of neighbours.

use super::Work;
use crate::contract::{Recorder, recorder::scene_constants};
use crate::recording::*;

/// Samples along x and y that a workgroup's packets cover: `COVERED` of the shader.
const COVERED: [u32; 2] = [32, 16];

pub(super) fn record(r: &mut Recorder<'_>, work: &Work) {
    let program = work
        .layout(scene_constants(Program::new("hemisphere_tiles/ray_cast"), r.setting.needs))
        .bind("requests", work.requests.places)
        .bind("samples", work.samples)
        .bind("seen", work.seen);
    let parts = work.table.width.div_ceil(COVERED[0]) * work.table.height.div_ceil(COVERED[1]);
    r.compute(program, "trace", Groups::Counted { count: work.requests.count, divisor: 1, per: parts });
}
