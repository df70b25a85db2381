//! Cells of pixels, from coarse to fine: what the searches on the device and on the host share.

use super::Work;
use crate::contract::{Encoder, Refusal};
use crate::host_struct;
use crate::schedule::*;

host_struct! {
    /// Which cells a round looks at, as the device is told.
    pub struct Round {
        cell: u32,
        phase: u32,
        capacity: u32,
        start: u32,
    }
}

/// Edges of the first cells and of the last, and where the search stands.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    coarsest: u32,
    pub finest: u32,
    /// Edge of the cells.
    pub cell: Variable,
    /// Which of the four cells of a block.
    pub phase: Variable,
    /// How many phases in a row found nothing at the finest level.
    pub idle: Variable,
}

/// What a round found.
pub(super) struct Found {
    /// Requests made, and candidates for them.
    pub requests: u32,
    pub candidates: u32,
    /// One past the last block that was served.
    pub next_block: u32,
    /// How many pixels of the batch before miss a record still.
    pub uncovered: u32,
    /// Whether any pixel missed one as the loop started.
    pub any_missing: bool,
}

impl Grid {
    pub fn new(e: &mut Encoder<'_>, [coarsest, finest]: [u32; 2]) -> Result<Self, Refusal> {
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
        let [cell, phase, idle] = ["cell", "phase", "idle"].map(|name| e.variable(name, false));
        Ok(Self { coarsest, finest, cell, phase, idle })
    }

    /// Before the loop; all that its first round reads, for the device may be ahead of the host.
    pub fn start(&self, host: &mut dyn HostContext) {
        host.set(self.cell, self.coarsest);
        host.set(self.phase, 0);
    }

    /// Counts what was found and goes on to the next cells; the block from which on those are looked at.
    pub fn advance(&self, host: &mut dyn HostContext, work: &Work, found: Found) -> u32 {
        // A part of a pixel farther only slivers are seen for the first time, for which the rays of a later search's records are enough.
        let is_left = self.finest > 1 && work.has_earlier_samples(host);
        let room = if is_left { 0 } else { work.room(host, found.uncovered) };
        let requests = found.requests.min(room);
        host.set(work.requests.count, requests);
        host.set(work.requests.made, host.variable(work.requests.made) + requests);
        let is_finest = host.variable(self.cell) == self.finest;
        host.set(self.idle, if is_finest && found.candidates == 0 { host.variable(self.idle) + 1 } else { 0 });
        // Where no pixel misses a record, nothing is to be done. Without room the records of the round before have just been splatted: nothing is left to do.
        host.set(work.none, (host.variable(self.idle) == 4 || room == 0 || !found.any_missing) as u32);
        // What did not fit into the batch is looked for again, among what the batch leaves uncovered. Cells that have been served wait: they
        // would ask again and again while the rest of the picture has no record at all.
        if found.candidates > work.requests.capacity {
            return found.next_block;
        }
        let next = host.variable(self.phase) + 1;
        host.set(self.phase, next % 4);
        if next == 4 && !is_finest {
            host.set(self.cell, host.variable(self.cell) / 2);
        } else if next == 4 && self.finest > 1 {
            host.set(work.none, 1);
        }
        0
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::work;
    use super::*;
    use crate::contract::port;
    use crate::passes::mock::MockHost;

    const GRID: Grid = Grid { coarsest: 4, finest: 1, cell: Variable(10), phase: Variable(11), idle: Variable(12) };

    fn host_at(cell: u32, phase: u32) -> MockHost {
        let mut host = MockHost::new(Vec::new(), [4, 4]);
        host.variables.extend([(GRID.cell, cell), (GRID.phase, phase)]);
        host
    }

    fn found(requests: u32, candidates: u32) -> Found {
        Found { requests, candidates, next_block: 77, uncovered: 0, any_missing: true }
    }

    #[test]
    fn a_picture_has_records_of_its_first_sample_but_for_slivers() {
        let work = work();
        for (finest, number, lasts, expected) in [(1, 0, true, (5, 0)), (1, 3, true, (5, 0)), (2, 0, true, (5, 0)), (2, 3, true, (0, 1)), (2, 3, false, (5, 0))]
        {
            let (grid, mut host) = (Grid { finest, ..GRID }, host_at(4, 0));
            host.scene.cameras[0].sample.number = number;
            let work = Work { cache: port::RecordCache { lasts, ..work.cache }, ..work };
            grid.advance(&mut host, &work, found(5, 5));
            assert_eq!((host.variable(work.requests.count), host.variable(work.none)), expected, "{finest} {number}");
        }
    }

    #[test]
    fn cells_are_halved_after_their_four_phases() {
        let (work, mut host) = (work(), host_at(4, 0));
        let mut looked_at = Vec::new();
        for _ in 0..13 {
            looked_at.push((host.variable(GRID.cell), host.variable(GRID.phase)));
            assert_eq!(GRID.advance(&mut host, &work, found(1, 1)), 0);
            assert_eq!(host.variable(work.none), 0);
        }
        let each = |cell| (0..4).map(move |phase| (cell, phase));
        assert!(looked_at.into_iter().eq(each(4).chain(each(2)).chain(each(1)).chain([(1, 0)])));
        assert_eq!((host.variable(work.requests.count), host.variable(work.requests.made)), (1, 13));
    }

    #[test]
    fn what_does_not_fit_into_a_batch_is_looked_for_again() {
        let (work, mut host) = (work(), host_at(2, 3));
        assert_eq!(GRID.advance(&mut host, &work, found(10, 11)), 77);
        assert_eq!((host.variable(GRID.cell), host.variable(GRID.phase), host.variable(work.none)), (2, 3, 0));
        assert_eq!(GRID.advance(&mut host, &work, found(10, 10)), 0);
        assert_eq!((host.variable(GRID.cell), host.variable(GRID.phase)), (1, 0));
    }

    #[test]
    fn a_search_ends_when_four_phases_of_single_pixels_find_nothing() {
        let (work, mut host) = (work(), host_at(1, 2));
        for (candidates, ends) in [(0, 0), (0, 0), (0, 0), (1, 0), (0, 0), (0, 0), (0, 0), (0, 1)] {
            GRID.advance(&mut host, &work, found(candidates, candidates));
            assert_eq!(host.variable(work.none), ends);
        }
        // Of coarser cells it ends nothing.
        let mut host = host_at(4, 0);
        (0..8).for_each(|_| _ = GRID.advance(&mut host, &work, found(0, 0)));
        assert_eq!((host.variable(work.none), host.variable(GRID.idle)), (0, 0));
    }

    #[test]
    fn a_search_down_to_larger_cells_ends_after_their_phases() {
        let grid = Grid { finest: 2, ..GRID };
        let (work, mut host) = (work(), host_at(4, 3));
        for ends in [0, 0, 0, 0, 1] {
            grid.advance(&mut host, &work, found(1, 1));
            assert_eq!((host.variable(work.none), host.variable(GRID.cell)), (ends, 2));
        }
    }

    #[test]
    fn a_search_ends_at_once_where_no_pixel_misses_a_record() {
        let (work, mut host) = (work(), host_at(4, 0));
        GRID.advance(&mut host, &work, Found { any_missing: false, ..found(0, 0) });
        assert_eq!(host.variable(work.none), 1);
        assert_eq!(host.cut_short, None);
    }

    #[test]
    fn a_search_ends_without_room() {
        let (work, mut host) = (work(), host_at(2, 0));
        host.set(work.requests.made, 47);
        GRID.advance(&mut host, &work, found(10, 20));
        assert_eq!([work.requests.count, work.requests.made, work.none].map(|variable| host.variable(variable)), [3, 50, 0]);
        GRID.advance(&mut host, &work, found(10, 20));
        assert_eq!([work.requests.count, work.requests.made, work.none].map(|variable| host.variable(variable)), [0, 50, 1]);
    }
}
