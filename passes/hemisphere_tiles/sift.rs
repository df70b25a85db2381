//! Drops triangles that fall between the samples of a view, on the device: where a scene has more triangles than a view has
//! samples, most of them do, and each would cost the driver as much as one that is seen.

use super::Work;
use super::cull::{Culled, GAP, cull};
use crate::contract::Encoder;
use crate::host_struct;
use crate::schedule::*;

host_struct! {
    /// A view's part of what the sift reads and writes.
    pub struct SiftView {
        /// Words of what may be seen: the first, and the one after the last.
        first: u32,
        end: u32,
        /// Room for what is seen [triangles].
        base: u32,
        room: u32,
    }
}

/// Triangles that a word stands for: the first one's number × 64 and how many.
const WORD: u32 = 32;
/// Room for a view's triangles, in samples of the view, and at least. A view that keeps more is drawn without the sift.
const ROOM: u64 = 4;
const LEAST_ROOM: u64 = 4096;
/// Most bytes of each of the buffers; a view that finds no room is drawn without the sift.
const MOST_BYTES: u64 = 64 << 20;

/// With fewer triangles than samples, most are seen.
pub(super) fn pays(work: &Work, triangles: u32) -> bool {
    triangles > work.samples_per_tile()
}

/// Where each view's triangles go.
#[derive(Clone)]
struct Room {
    /// Of each view of a tile: first triangle from the tile's, triangles.
    views: Vec<[u32; 2]>,
    per_tile: u32,
}

impl Room {
    fn new(work: &Work, triangles: u32) -> Self {
        let most = MOST_BYTES / (12 * work.requests.capacity as u64 * work.table.views.len() as u64);
        let mut per_tile = 0;
        let mut views = Vec::new();
        for view in &work.table.views {
            let samples = view.rectangle[2] as u64 * view.rectangle[3] as u64;
            let room = (ROOM * samples).max(LEAST_ROOM).min(most).min(triangles as u64) as u32;
            views.push([per_tile, room]);
            per_tile += room;
        }
        Self { views, per_tile }
    }

    /// First triangle and number of triangles of a view of the batch.
    fn of(&self, view: usize) -> [u32; 2] {
        let [first, room] = self.views[view % self.views.len()];
        [(view / self.views.len()) as u32 * self.per_tile + first, room]
    }
}

/// The draws of the triangles that samples may see, and the indices that they go by.
pub(super) fn encode(e: &mut Encoder<'_>, work: &Work, program: &Program) -> (Resource, Option<Resource>) {
    let views = work.requests.capacity as u64 * work.table.views.len() as u64;
    let triangles = e.setting.needs.triangles;
    let room = Room::new(work, triangles);
    let samples = work.samples_per_tile();
    e.remark(format!("the scene has {triangles} triangles, a tile {samples} samples: triangles between samples are dropped before they are drawn"));
    // Ranges are more than a gap apart, and each has one word that is not full.
    let words = (views * (triangles / WORD + triangles / (GAP + 1) + 2) as u64).min(MOST_BYTES / 8);
    let [to, masks, sifted, kept] = [("words", 4 * words), ("masks", 8 * words), ("sifted", views * size_of::<SiftView>() as u64), ("kept", 8 * views)]
        .map(|(name, bytes)| e.buffer(name, bytes));
    let indices = e.buffer("indices", 12 * work.requests.capacity as u64 * room.per_tile as u64);
    let draws = e.draws("draws");
    let layout = room.clone();
    let culled = cull(e, work, &[to, sifted], move |found, host| {
        let (words, views) = ask(found, &layout, words as usize);
        host.write(to, 0, bytemuck::cast_slice(&words));
        host.write(sifted, 0, bytemuck::cast_slice(&views));
    });
    let program = program.clone().bind("words", to).bind("masks", masks).bind("sifted", sifted).bind("kept", kept).bind("indices", indices);
    let per = work.table.views.len() as u32;
    e.compute(program, "sift", Groups::Counted { count: work.requests.count, divisor: 1, per });
    e.host("list", &[Read::counted(kept, 8 * per as u64, work.requests.count)], &[], move |host| {
        let kept: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(host.read(kept));
        Culled::with(host, culled, |found, host| list(found, &kept, &room, host.draws(draws)));
        Ok(())
    });
    (draws, Some(indices))
}

/// What each view may see, in words; the words of a view that finds no room for them are left away.
fn ask(found: &Culled, room: &Room, capacity: usize) -> (Vec<u32>, Vec<SiftView>) {
    let mut words: Vec<u32> = Vec::new();
    let mut views = Vec::new();
    for (index, part) in found.views.iter().enumerate() {
        let first = words.len();
        found.draws[part.clone()].iter().for_each(|draw| words.extend(split(draw.vertices.map(|vertex| vertex / 3))));
        if words.len() > capacity {
            words.truncate(first);
        }
        let [base, room] = room.of(index);
        views.push(SiftView { first: first as u32, end: words.len() as u32, base, room });
    }
    (words, views)
}

/// Lists the draws of the triangles that each view keeps, those wholly inside and those that cross its bounds; of all that
/// it may see where they found no room.
fn list(found: &Culled, kept: &[[u32; 2]], room: &Room, draws: &mut Vec<Draw>) {
    draws.clear();
    for (index, (part, &[inside, crossing])) in found.views.iter().zip(kept).enumerate() {
        let all = &found.draws[part.clone()];
        let [base, room] = room.of(index);
        let Some(draw) = all.first() else { continue };
        if inside + crossing > room {
            draws.extend(all);
            continue;
        }
        let kept = [[base, base + inside], [base + room - crossing, base + room]].into_iter().filter(|[first, end]| first < end);
        draws.extend(kept.map(|triangles| Draw { vertices: triangles.map(|triangle| 3 * triangle), is_indexed: true, ..*draw }));
    }
}

/// The words of a range of triangles.
fn split([first, end]: [u32; 2]) -> impl Iterator<Item = u32> {
    (first..end).step_by(WORD as usize).map(move |at| at << 6 | (end - at).min(WORD))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_stand_for_all_triangles_of_a_range() {
        for range in [[0, 1], [5, 37], [5, 38], [31, 32], [7, 200], [9, 9]] {
            let words: Vec<u32> = split(range).collect();
            let triangles = words.iter().flat_map(|word| (word >> 6)..(word >> 6) + word % 64);
            assert!(triangles.eq(range[0]..range[1]), "{range:?}");
            assert_eq!(words.len() as u32, (range[1] - range[0]).div_ceil(WORD));
        }
    }
}

#[cfg(test)]
mod lists {
    use super::*;
    use crate::contract::port;
    use crate::math::hemisphere::{Method, Shape, Table};
    use crate::passes::mock::MockHost;
    use std::sync::Arc;

    fn work(shape: Shape, resolution: u32, capacity: u32) -> Work {
        let requests = port::Requests { places: Resource(0), count: Variable(0), capacity, made: Variable(1), at_most: 1000, slots: None };
        let table = Arc::new(Table::new(shape, resolution, Method::None).unwrap());
        Work { requests, table, shape, samples: Resource(1), seen: Resource(2), size: [64, 64], tiles_per_row: 2, is_raster: true }
    }

    #[test]
    fn views_have_room_for_what_their_samples_may_see() {
        // Of many samples, of few, of few triangles, and where all tiles share what a buffer may have.
        let wide = Room::new(&work(Shape::Hemispherical, 64, 3), 100_000);
        assert_eq!((&wide.views[..], wide.per_tile), (&[[0, 4 * 64 * 64]][..], 4 * 64 * 64));
        let cube = Room::new(&work(Shape::Hemicube, 8, 3), 100_000);
        let each: Vec<[u32; 2]> = (0..5).map(|view| [4096 * view, 4096]).collect();
        assert_eq!((&cube.views, cube.per_tile), (&each, 5 * 4096));
        assert_eq!([cube.of(0), cube.of(4), cube.of(7)], [[0, 4096], [4 * 4096, 4096], [7 * 4096, 4096]]);
        assert_eq!(Room::new(&work(Shape::Hemicube, 8, 3), 100).views[2], [200, 100]);
        let many = Room::new(&work(Shape::Hemicube, 8, 1024), 100_000);
        assert_eq!(many.views[1], [(64 << 20) / (12 * 1024 * 5); 2]);
        assert!(!pays(&work(Shape::Hemispherical, 64, 3), 64 * 64) && pays(&work(Shape::Hemispherical, 64, 3), 64 * 64 + 1));
    }

    fn draw(first: u32, end: u32) -> Draw {
        Draw { rectangle: Some([1, 2, 3, 4]), vertices: [3 * first, 3 * end], is_indexed: false, instances: [9, 10] }
    }

    /// Views of three draws, one draw, none and one.
    fn with_views(step: impl Fn(&mut Culled)) {
        Culled::with(&mut MockHost::new(Vec::new(), [4, 4]), Resource(0), |found, _| {
            found.draws = vec![draw(0, 40), draw(60, 61), draw(100, 132), draw(5, 9), draw(7, 300)];
            found.views = vec![0..3, 3..4, 4..4, 4..5];
            step(found);
        });
    }

    fn room() -> Room {
        Room { views: vec![[0, 50], [50, 10]], per_tile: 60 }
    }

    #[test]
    fn views_ask_for_all_that_they_may_see_where_it_fits() {
        with_views(|found| {
            let told = |capacity: usize| {
                let (words, views) = ask(found, &room(), capacity);
                (words, views.iter().map(|view| [view.first, view.end, view.base, view.room]).collect::<Vec<_>>())
            };
            let word = |first: u32, count: u32| first << 6 | count;
            let mut expected = vec![word(0, 32), word(32, 8), word(60, 1), word(100, 32), word(5, 4)];
            let rooms = [[0, 50], [50, 10], [60, 50], [110, 10]];
            let views = |ends: [[u32; 2]; 4]| (0..4).map(|view| [ends[view][0], ends[view][1], rooms[view][0], rooms[view][1]]).collect::<Vec<_>>();
            // The last view takes ten words.
            assert_eq!(told(14), (expected.clone(), views([[0, 4], [4, 5], [5, 5], [5, 5]])));
            expected.extend(split([7, 300]));
            assert_eq!(told(15), (expected, views([[0, 4], [4, 5], [5, 5], [5, 15]])));
            assert_eq!(told(3), (vec![word(5, 4)], views([[0, 0], [0, 1], [1, 1], [1, 1]])));
        });
    }

    #[test]
    fn views_draw_what_was_kept_or_all_where_it_found_no_room() {
        with_views(|found| {
            let listed = |kept: [[u32; 2]; 4]| {
                let mut draws = vec![draw(0, 1)];
                list(found, &kept, &room(), &mut draws);
                draws
            };
            let kept = |first: u32, end: u32| Draw { is_indexed: true, ..draw(first, end) };
            // Those inside stand at the front of the room, those that cross bounds at its end.
            assert_eq!(listed([[3, 2], [10, 0], [0, 0], [0, 0]]), [kept(0, 3), kept(48, 50), kept(50, 60)]);
            assert_eq!(listed([[0, 0], [0, 1], [0, 0], [4, 6]]), [kept(59, 60), kept(110, 114), kept(114, 120)]);
            assert_eq!(listed([[49, 2], [0, 0], [0, 0], [5, 6]]), [draw(0, 40), draw(60, 61), draw(100, 132), draw(7, 300)]);
        });
    }
}
