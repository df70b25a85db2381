//! Misses found on the host, coarse cells first: the twin of `shaders/find_misses/device_grid.wgsl`.

use super::grid::{Found, Grid};
use super::{Work, request};
use crate::contract::Encoder;
use crate::passes::record::Request;
use crate::schedule::*;
use glam::Vec4;
use rayon::prelude::*;

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work, grid: Grid) {
    let size = work.gbuffer.size;
    let [start, looked_over] = ["start", "looked_over"].map(|name| e.variable(name, false));
    let asked = e.state("asked");
    let begin = move |host: &mut dyn HostContext| {
        grid.start(host);
        Ok(())
    };
    e.before_loop(Command::Host(Host::new("start", Vec::new(), Vec::new(), begin)));
    let work = *work;
    let (gbuffer, sums, places) = (work.gbuffer, work.sums, work.requests.places);
    let surfaces = [gbuffer.position, gbuffer.normal, sums].map(Read::whole);
    let reads: Vec<Read> = surfaces.into_iter().chain(work.face_reads()).collect();
    e.host("search", &reads, &[places], move |host| {
        let before = host.state(asked).take().and_then(|pixels| pixels.downcast::<Vec<u32>>().ok()).unwrap_or_default();
        // A part of a pixel farther any weight will do.
        let overlap = if work.has_earlier_samples(host) { 0.0 } else { work.overlap };
        let picture = Picture { position: bytemuck::cast_slice(host.read(gbuffer.position)), sums: bytemuck::cast_slice(host.read(sums)), size, overlap };
        let any_missing = host.variable(looked_over) != 0 || (0..picture.sums.len() as u32).into_par_iter().any(|pixel| picture.misses(pixel));
        let most = work.requests.capacity as usize;
        let some = picture.search(host.variable(grid.cell), host.variable(grid.phase), host.variable(start), most);
        let uncovered = before.iter().filter(|pixel| picture.misses(**pixel)).count() as u32;
        let picked = &some[..some.len().min(most)];
        let normals: &[Vec4] = bytemuck::cast_slice(host.read(gbuffer.normal));
        let asked_for = |pixel: u32| {
            let (at, place) = (pixel as usize, picture.position[pixel as usize]);
            request(place, normals[at], work.face(host, at, place), pixel)
        };
        let new: Vec<Request> = picked.iter().map(|(_, pixel)| asked_for(*pixel)).collect();
        let next_block = picked.last().map_or(0, |(block, _)| block + 1);
        let found = Found { requests: picked.len() as u32, candidates: some.len() as u32, next_block, uncovered, any_missing };
        *host.state(asked) = Some(Box::new(picked.iter().map(|(_, pixel)| *pixel).collect::<Vec<u32>>()));
        host.write(places, 0, bytemuck::cast_slice(&new));
        host.set(looked_over, 1);
        let next = grid.advance(host, &work, found);
        host.set(start, next);
        Ok(())
    });
}

/// Blocks that are looked at side by side, before it is asked whether a batch is full.
const STRETCH: u32 = 4096;

/// What there is of each pixel.
struct Picture<'a> {
    position: &'a [Vec4],
    sums: &'a [Vec4],
    size: [u32; 2],
    overlap: f32,
}

impl Picture<'_> {
    /// Blocks of 2×2 cells from `start` on that miss a record in the cell of the phase, with the pixel that asks for it: all of them, or the first
    /// ones and more than `most`.
    fn search(&self, cell: u32, phase: u32, start: u32, most: usize) -> Vec<(u32, u32)> {
        let [across, down] = self.size.map(|edge| edge.div_ceil(2 * cell));
        let candidate = |block: u32| {
            let corner = [(block % across * 2 + (phase & 1)) * cell, (block / across * 2 + (phase >> 1)) * cell];
            Some((block, self.first_miss(corner, cell)?))
        };
        let (mut found, mut blocks) = (Vec::new(), start..across * down);
        while found.len() <= most && !blocks.is_empty() {
            let next = blocks.end.min(blocks.start + STRETCH);
            found.par_extend((blocks.start..next).into_par_iter().with_min_len(64).filter_map(candidate));
            blocks.start = next;
        }
        found
    }

    /// Whether a pixel sees a surface and no record covers it.
    fn misses(&self, pixel: u32) -> bool {
        self.sums[pixel as usize].w <= self.overlap && self.position[pixel as usize].w > 0.0
    }

    /// Of a cell, from its middle outwards.
    fn first_miss(&self, [left, top]: [u32; 2], cell: u32) -> Option<u32> {
        let [right, bottom] = [(left + cell).min(self.size[0]), (top + cell).min(self.size[1])];
        let mut first = None;
        for y in top..bottom {
            for x in left..right {
                let pixel = y * self.size[0] + x;
                if self.misses(pixel) {
                    let rank = rank([x - left, y - top], cell);
                    first = first.filter(|(other, _)| *other < rank).or(Some((rank, pixel)));
                }
            }
        }
        first.map(|(_, pixel)| pixel)
    }
}

/// Order in which the misses of a cell are served.
fn rank([x, y]: [u32; 2], cell: u32) -> u32 {
    let [dx, dy] = [x, y].map(|at| (2 * at + 1).abs_diff(cell));
    (dx * dx + dy * dy) << 12 | y << 6 | x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_served_from_their_middle_outwards() {
        let mut served: Vec<[u32; 2]> = (0..16).map(|at| [at % 4, at / 4]).collect();
        served.sort_by_key(|at| rank(*at, 4));
        let middle = [[1, 1], [2, 1], [1, 2], [2, 2]];
        let edges = [[1, 0], [2, 0], [0, 1], [3, 1], [0, 2], [3, 2], [1, 3], [2, 3]];
        assert_eq!(served, [&middle[..], &edges, &[[0, 0], [3, 0], [0, 3], [3, 3]]].concat());
        // Cells of odd edges have a pixel in the middle.
        assert_eq!((0..25).map(|at| [at % 5, at / 5]).min_by_key(|at| rank(*at, 5)), Some([2, 2]));
    }

    /// Of a block, as a look at all of its pixels tells.
    fn expected(picture: &Picture<'_>, block: u32, cell: u32, phase: u32) -> Option<u32> {
        let [width, height] = picture.size;
        let across = width.div_ceil(2 * cell);
        let corner = [(2 * (block % across) + phase % 2) * cell, (2 * (block / across) + phase / 2) * cell];
        let inside = |pixel: &u32| [pixel % width, pixel / width].into_iter().zip(corner).all(|(at, first)| (first..first + cell).contains(&at));
        let misses = |pixel: &u32| picture.position[*pixel as usize].w > 0.0 && picture.sums[*pixel as usize].w <= picture.overlap;
        (0..width * height).filter(inside).filter(misses).min_by_key(|pixel| rank([pixel % width - corner[0], pixel / width - corner[1]], cell))
    }

    #[test]
    fn blocks_find_the_first_miss_of_their_cell() {
        for (size, cell) in [([37, 22], 4), ([9, 30], 3), ([5, 5], 8)] {
            let pixels = (size[0] * size[1]) as usize;
            // Some see nothing, most are covered, and some of those that are not are so by a weight of exactly the overlap.
            let position: Vec<Vec4> = (0..pixels).map(|at| Vec4::splat(f32::from(at % 5 != 0))).collect();
            let sums: Vec<Vec4> = (0..pixels).map(|at| Vec4::splat([0.5, 2.0, 0.7, 1.5, 0.0, 0.6, 3.0][at * at % 7])).collect();
            let picture = Picture { position: &position, sums: &sums, size, overlap: 0.5 };
            for phase in 0..4 {
                let blocks = size[0].div_ceil(2 * cell) * size[1].div_ceil(2 * cell);
                let all: Vec<_> = (0..blocks).filter_map(|block| Some((block, expected(&picture, block, cell, phase)?))).collect();
                assert_eq!(picture.search(cell, phase, 0, pixels), all, "{size:?} {cell} {phase}");
                let later: Vec<_> = all.iter().copied().filter(|(block, _)| *block >= blocks / 2).collect();
                assert_eq!(picture.search(cell, phase, blocks / 2, pixels), later);
            }
        }
    }

    #[test]
    fn a_search_ends_soon_after_its_batch_is_full() {
        let size = [400, 100];
        let (position, sums) = (vec![Vec4::ONE; 40_000], vec![Vec4::ZERO; 40_000]);
        let picture = Picture { position: &position, sums: &sums, size, overlap: 0.0 };
        // Cells of one pixel, a quarter of them in each phase; each block misses.
        let blocks = |most| picture.search(1, 3, 0, most).into_iter().map(|(block, _)| block).collect::<Vec<_>>();
        assert_eq!(blocks(10), (0..STRETCH).collect::<Vec<_>>());
        assert_eq!(blocks(STRETCH as usize), (0..2 * STRETCH).collect::<Vec<_>>());
        assert_eq!(blocks(40_000), (0..10_000).collect::<Vec<_>>());
    }
}
