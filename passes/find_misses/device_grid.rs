//! Misses found on the device, coarse cells first.

use super::grid::{Found, Grid, Round};
use super::{STALLED_ROUNDS, Work};
use crate::contract::{Encoder, encoder::scene_constants};
use crate::schedule::*;

/// Cells up to this edge take one lane each, larger ones a workgroup: a lane looks at one pixel after the other.
const SMALL: u32 = 4;

/// Where the device looks in a round.
#[derive(Clone, Copy)]
struct Search {
    grid: Grid,
    /// The [`Round`].
    round: Resource,
    capacity: u32,
    size: [u32; 2],
    /// Blocks that a lane each looks at, and blocks that a workgroup each does.
    lanes: Variable,
    blocks: Variable,
    /// All blocks that are looked at.
    all: Variable,
    /// 1 in the first round, which looks at all pixels.
    looks_over: Variable,
}

impl Search {
    /// Tells the device of the next round, whose blocks before `start` have been served.
    fn aim(&self, host: &mut dyn HostContext, start: u32) {
        let cell = host.variable(self.grid.cell);
        let round = Round { cell, phase: host.variable(self.grid.phase), capacity: self.capacity, start };
        host.write(self.round, 0, bytemuck::bytes_of(&round));
        let count = self.size.map(|edge| edge.div_ceil(2 * cell)).iter().product();
        let is_small = cell <= SMALL;
        host.set(self.lanes, if is_small { count } else { 0 });
        host.set(self.blocks, if is_small { 0 } else { count });
        host.set(self.all, count);
    }

    /// What [`Grid::advance`] and [`Self::aim`] do, on the device.
    fn advance(&self, work: &Work, counts: Resource) -> Compute {
        let (grid, requests) = (self.grid, work.requests);
        let program = Program::new("find_misses/advance")
            .constant("WIDTH", self.size[0])
            .constant("HEIGHT", self.size[1])
            .constant("SMALL", SMALL)
            .constant("FINEST", grid.finest)
            .constant("LASTS", work.cache.lasts as u8)
            .constant("MOST_REQUESTS", self.capacity)
            .constant("MOST_MADE", requests.at_most)
            .constant("MOST_RECORDS", work.cache.capacity)
            .constant("STALLED_ROUNDS", STALLED_ROUNDS)
            .constant("NO_PROGRESS", Shortfall::NoProgress.code())
            .constant("CACHE_FULL", Shortfall::CacheFull.code())
            .constant("FRAME_LIMIT", Shortfall::FrameLimit.code())
            .variable("COUNT", requests.count)
            .variable("MADE", requests.made)
            .variable("RECORDS", work.cache.count)
            .variable("NONE", work.none)
            .variable("STALLED", work.stalled)
            .variable("CELL", grid.cell)
            .variable("PHASE", grid.phase)
            .variable("IDLE", grid.idle)
            .variable("LANES", self.lanes)
            .variable("BLOCKS", self.blocks)
            .variable("ALL_BLOCKS", self.all)
            .variable("LOOKS_OVER", self.looks_over)
            .bind("next", self.round)
            .bind("counts", counts);
        Compute { program, entry: "advance", groups: Groups::ONE }
    }
}

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work, grid: Grid) {
    let [width, height] = work.gbuffer.size;
    let round = e.buffer("grid", size_of::<Round>() as u64);
    let blocks = u64::from(width.div_ceil(2)) * u64::from(height.div_ceil(2));
    let (candidates, tallies) = (e.buffer("candidates", 4 * blocks), e.buffer("tallies", 4 * blocks.div_ceil(64)));
    let (counts, any_missing) = (e.buffer("counts", 32), e.buffer("any_missing", 16));
    let picked = e.buffer("picked", 4 * work.requests.capacity as u64);
    let capacity = work.requests.capacity;
    let [lanes, blocks, all, looks_over] = ["lanes", "blocks", "all", "looks_over"].map(|name| e.variable(name, false));
    let search = Search { grid, round, capacity, size: work.gbuffer.size, lanes, blocks, all, looks_over };
    let start = move |host: &mut dyn HostContext| {
        grid.start(host);
        search.aim(host, 0);
        host.set(looks_over, 1);
        Ok(())
    };
    e.before_loop(Command::Host(Host::new("start", Vec::new(), vec![round], start)));
    e.before_loop(Command::Clear(counts));
    e.before_loop(Command::Clear(any_missing));
    e.before_loop(Command::Clear(tallies));
    let program = scene_constants(Program::new("find_misses/device_grid"), e.setting.needs)
        .constant("OVERLAP", work.overlap)
        .constant("LASTS", work.cache.lasts as u8)
        .bind("grid", round)
        .bind("position", work.gbuffer.position)
        .bind("normal", work.gbuffer.normal)
        .bind("triangles", work.gbuffer.triangles)
        .bind("sums", work.sums)
        .bind("candidates", candidates)
        .bind("counts", counts)
        .bind("any_missing", any_missing)
        .bind("requests", work.requests.places)
        .bind("picked", picked)
        .bind("tallies", tallies);
    e.compute(program.clone(), "look_over", Groups::Counted { count: looks_over, divisor: 1, per: (width * height).div_ceil(64) });
    e.compute(program.clone(), "search", Groups::Counted { count: blocks, divisor: 1, per: 1 });
    e.compute(program.clone(), "search_small", Groups::Counted { count: lanes, divisor: 64, per: 1 });
    e.compute(program.clone(), "collect", Groups::ONE);
    e.compute(program, "ask", Groups::Counted { count: all, divisor: 64, per: 1 });
    let work = *work;
    let advance = move |host: &mut dyn HostContext| {
        let numbers: Vec<u32> = bytemuck::pod_collect_to_vec(host.read(counts));
        let [requests, candidates, next_block, uncovered, any_missing, ..] = numbers[..] else { return Err("the search has counted too little".into()) };
        host.set(looks_over, 0);
        let start = grid.advance(host, &work, Found { requests, candidates, next_block, uncovered, any_missing: any_missing != 0 });
        search.aim(host, start);
        Ok(())
    };
    e.twin("advance", &[Read::whole(counts)], &[round], advance, vec![search.advance(&work, counts)]);
}
