//! Misses found on the host, coarse cells first: the twin of `shaders/find_misses/device_grid.wgsl`.

use super::grid::{Found, Grid};
use super::{Work, request};
use crate::contract::Recorder;
use crate::passes::record::Request;
use crate::recording::*;
use glam::Vec4;
use rayon::prelude::*;

pub(super) fn record(r: &mut Recorder<'_>, work: &Work, grid: Grid) {
    let size = r.setting.size;
    let start = r.variable("start", false);
    let asked = r.state("asked");
    grid.record_start(r, None);
    let work = *work;
    let (gbuffer, sums, places) = (work.gbuffer, work.sums, work.requests.places);
    let reads = [Read::whole(gbuffer.position), Read::whole(gbuffer.normal), Read::whole(sums)];
    r.host("search", &reads, &[places], move |host| {
        let before = host.state(asked).take().and_then(|pixels| pixels.downcast::<Vec<u32>>().ok()).unwrap_or_default();
        let picture =
            Picture { position: bytemuck::cast_slice(host.read(gbuffer.position)), sums: bytemuck::cast_slice(host.read(sums)), size, overlap: work.overlap };
        let most = work.requests.capacity as usize;
        let some = picture.search(host.variable(grid.cell), host.variable(grid.phase), host.variable(start), most);
        let uncovered = before.iter().filter(|pixel| picture.misses(**pixel)).count() as u32;
        let picked = &some[..some.len().min(most)];
        let normals: &[Vec4] = bytemuck::cast_slice(host.read(gbuffer.normal));
        let new: Vec<Request> = picked.iter().map(|(_, pixel)| request(picture.position[*pixel as usize], normals[*pixel as usize], *pixel)).collect();
        let next_block = picked.last().map_or(0, |(block, _)| block + 1);
        let found = Found { requests: picked.len() as u32, candidates: some.len() as u32, next_block, uncovered };
        *host.state(asked) = Some(Box::new(picked.iter().map(|(_, pixel)| *pixel).collect::<Vec<u32>>()));
        host.write(places, 0, bytemuck::cast_slice(&new));
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
