//! Misses found on the device, coarse cells first.

use super::Work;
use super::grid::{Found, Grid, Round};
use crate::contract::Recorder;
use crate::recording::*;

/// Cells up to this edge take one lane each: a workgroup that waits for its lanes costs more than their longer walk.
const SMALL: u32 = 16;

pub(super) fn record(r: &mut Recorder<'_>, work: &Work, grid: Grid) {
    let [width, height] = r.setting.size;
    let round = r.buffer("grid", size_of::<Round>() as u64);
    let candidates = r.buffer("candidates", 4 * width.div_ceil(2) as u64 * height.div_ceil(2) as u64);
    let counts = r.buffer("counts", 16);
    let picked = r.buffer("picked", 4 * work.requests.capacity as u64);
    let capacity = work.requests.capacity;
    grid.record_start(r, Some((round, capacity)));
    r.before_loop(Command::Clear(counts));
    let [lanes, blocks] = ["lanes", "blocks"].map(|name| r.variable(name, false));
    r.host("size", &[], &[], move |host| {
        let edge = 2 * host.variable(grid.cell);
        let count = width.div_ceil(edge) * height.div_ceil(edge);
        let small = host.variable(grid.cell) <= SMALL;
        host.set(lanes, if small { count } else { 0 });
        host.set(blocks, if small { 0 } else { count });
        Ok(())
    });
    let program = Program::new("find_misses/device_grid")
        .constant("OVERLAP", work.overlap)
        .bind("grid", round)
        .bind("position", work.gbuffer.position)
        .bind("normal", work.gbuffer.normal)
        .bind("sums", work.sums)
        .bind("candidates", candidates)
        .bind("counts", counts)
        .bind("requests", work.requests.places)
        .bind("picked", picked);
    r.compute(program.clone(), "search", Groups::Counted { count: blocks, divisor: 1, per: 1 });
    r.compute(program.clone(), "search_small", Groups::Counted { count: lanes, divisor: 64, per: 1 });
    r.compute(program.clone(), "collect", Groups::Fixed([1, 1, 1]));
    r.compute(program, "ask", Groups::Fixed([capacity.div_ceil(64), 1, 1]));
    let work = *work;
    r.host("advance", &[Read::whole(counts)], &[round], move |host| {
        let numbers: Vec<u32> = bytemuck::pod_collect_to_vec(host.read(counts));
        let start = grid.advance(host, &work, Found { requests: numbers[0], candidates: numbers[1], next_block: numbers[2], uncovered: numbers[3] });
        let next = Round { cell: host.variable(grid.cell), phase: host.variable(grid.phase), capacity, start };
        host.write(round, 0, bytemuck::bytes_of(&next));
        Ok(())
    });
}
