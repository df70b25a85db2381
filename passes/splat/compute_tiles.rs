//! Records binned over tiles of 16×16 pixels and added in their order, without blending.

use super::{Work, at_start, fresh};
use crate::contract::Recorder;
use crate::recording::*;

/// Edge of a tile [pixels].
const TILE: u32 = 16;
/// Most records that are binned at a time; fewer for large pictures, but 1024 at least.
const CHUNK: u32 = 32_768;
/// Most bytes of all tiles' masks.
const MASK_BYTES: u64 = 32 << 20;

pub(super) fn record(r: &mut Recorder<'_>, work: &Work) {
    let [width, height] = r.setting.size;
    let tiles = width.div_ceil(TILE) * height.div_ceil(TILE);
    // A bit a record, and a bit a word of those.
    let summary = (MASK_BYTES / 4 / 33 / tiles as u64).clamp(1, CHUNK as u64 / 1024) as u32;
    let words = 32 * summary;
    let chunk = 32 * words;
    let pixels = width as u64 * height as u64;
    let masks = r.buffer("masks", tiles as u64 * (summary + words) as u64 * 4);
    let added = r.buffer("added", pixels * 16);
    let counted = work.counts.map(|counts| (r.buffer("counted", pixels * 4), counts));
    for buffer in [Some(masks), Some(added), counted.map(|c| c.0)].into_iter().flatten() {
        at_start(r, Command::Clear(buffer));
    }
    for (stretch, records) in fresh::record(r, work, chunk) {
        let program = work
            .contribution(Program::new("splat/compute_tiles"))
            .constant("MASK_WORDS", words)
            .constant("SUMMARY_WORDS", summary)
            .bind("records", work.cache.records)
            .bind("weighting", work.cache.weighting)
            .bind("stretch", stretch)
            .bind("masks", masks);
        r.compute(program.clone(), "bin", Groups::Counted { count: records, divisor: 64, per: 1 });
        let program = program.bind("position", work.gbuffer.position).bind("normal", work.gbuffer.normal).bind("added", added).bind("sums", work.sums);
        // As many groups as tiles where the chunk has any record.
        let groups = Groups::Counted { count: records, divisor: chunk, per: tiles };
        match counted {
            Some((counted, counts)) => r.compute(program.bind("counted", counted).bind("counts", counts), "add_counted", groups),
            None => r.compute(program, "add", groups),
        }
    }
}
