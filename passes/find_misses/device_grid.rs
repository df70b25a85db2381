//! Misses found on the device, coarse cells first.

use super::Work;
use crate::contract::{Recorder, Refusal};
use crate::host_struct;
use crate::recording::*;

host_struct! {
    /// Which cells a round looks at.
    pub struct Grid {
        cell: u32,
        phase: u32,
        capacity: u32,
        start: u32,
    }
}

/// Cells up to this edge take one lane each: a workgroup that waits for its lanes costs more than their longer walk.
const SMALL: u32 = 16;

pub(super) fn record(r: &mut Recorder<'_>, work: &Work, [coarsest, finest]: [u32; 2]) -> Result<(), Refusal> {
    if !coarsest.is_power_of_two() {
        return Err(Refusal::of_parameter(
            "by",
            "plan::coarsest",
            format!("cells of {coarsest} pixels cannot be halved down to one"),
            "give a power of two from 1 to 64",
        ));
    }
    if !finest.is_power_of_two() || finest > coarsest {
        return Err(Refusal::of_parameter(
            "by",
            "plan::finest",
            format!("cells of {coarsest} pixels cannot be halved down to {finest}"),
            "give a power of two from 1 to the edge of the coarsest cells",
        ));
    }
    let [width, height] = r.setting.size;
    let grid = r.buffer("grid", size_of::<Grid>() as u64);
    let candidates = r.buffer("candidates", 4 * width.div_ceil(2) as u64 * height.div_ceil(2) as u64);
    let counts = r.buffer("counts", 16);
    let picked = r.buffer("picked", 4 * work.requests.capacity as u64);
    // The level of cells, their phase, and how many phases in a row found nothing at the finest level.
    let [cell, phase, idle] = ["cell", "phase", "idle"].map(|name| r.variable(name, false));
    let capacity = work.requests.capacity;
    r.before_loop(Command::Host(Host {
        name: "start",
        reads: Vec::new(),
        writes: vec![grid],
        only_writes: false,
        run: std::sync::Arc::new(move |host| {
            host.set(cell, coarsest);
            host.write(grid, 0, bytemuck::bytes_of(&Grid { cell: coarsest, phase: 0, capacity, start: 0 }));
            Ok(())
        }),
    }));
    let [lanes, blocks] = ["lanes", "blocks"].map(|name| r.variable(name, false));
    r.host("size", &[], &[], move |host| {
        let edge = 2 * host.variable(cell);
        let count = width.div_ceil(edge) * height.div_ceil(edge);
        let small = host.variable(cell) <= SMALL;
        host.set(lanes, if small { count } else { 0 });
        host.set(blocks, if small { 0 } else { count });
        Ok(())
    });
    let program = Program::new("find_misses/device_grid")
        .constant("OVERLAP", work.overlap)
        .bind("grid", grid)
        .bind("position", work.gbuffer.position)
        .bind("normal", work.gbuffer.normal)
        .bind("sums", work.splats.sums)
        .bind("candidates", candidates)
        .bind("counts", counts)
        .bind("requests", work.requests.places)
        .bind("picked", picked);
    r.compute(program.clone(), "search", Groups::Counted { count: blocks, divisor: 1, per: 1 });
    r.compute(program.clone(), "search_small", Groups::Counted { count: lanes, divisor: 64, per: 1 });
    r.compute(program.clone(), "collect", Groups::Fixed([1, 1, 1]));
    r.compute(program, "ask", Groups::Fixed([capacity.div_ceil(64), 1, 1]));
    let work = *work;
    r.host("advance", &[Read::whole(counts)], &[grid], move |host| {
        let numbers: Vec<u32> = bytemuck::pod_collect_to_vec(host.read(counts));
        let room = work.room(host);
        let (found, all) = (numbers[0].min(room), numbers[1]);
        host.set(work.requests.count, found);
        host.set(work.requests.made, host.variable(work.requests.made) + found);
        let is_finest = host.variable(cell) == finest;
        host.set(idle, if is_finest && all == 0 { host.variable(idle) + 1 } else { 0 });
        // Without room the records of the round before have just been splatted: nothing is left to do.
        host.set(work.none, (host.variable(idle) == 4 || room == 0) as u32);
        // What did not fit into the batch is looked for again, among what the batch leaves uncovered. Cells that have been served wait: they
        // would ask again and again while the rest of the picture has no record at all.
        let start = if all > capacity {
            numbers[2]
        } else {
            let next = host.variable(phase) + 1;
            host.set(phase, next % 4);
            if next == 4 && !is_finest {
                host.set(cell, host.variable(cell) / 2);
            } else if next == 4 && finest > 1 {
                host.set(work.none, 1);
            }
            0
        };
        let uniform = Grid { cell: host.variable(cell), phase: host.variable(phase), capacity, start };
        host.write(grid, 0, bytemuck::bytes_of(&uniform));
        Ok(())
    });
    Ok(())
}
