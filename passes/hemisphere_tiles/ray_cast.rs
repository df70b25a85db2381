//! One ray a sample.

use super::Work;
use crate::contract::{Recorder, recorder::scene_constants};
use crate::recording::*;

pub(super) fn record(r: &mut Recorder<'_>, work: &Work) {
    let program = work
        .layout(scene_constants(Program::new("hemisphere_tiles/ray_cast"), r.setting.needs))
        .bind("requests", work.requests.places)
        .bind("samples", work.samples)
        .bind("seen", work.seen);
    r.compute(program, "trace", Groups::Counted { count: work.requests.count, divisor: 1, per: work.samples_per_tile().div_ceil(64) });
}
