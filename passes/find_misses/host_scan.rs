//! The papers' walk over the pixels on the host.
//!
//! In a sequential fill each record is sampled and splatted on the host's copy of the weights before the walk goes on;
//! the splat sums are read back as the walk begins, and once more as it ends, for what host and device round differently.
//! In batches the sums are read back every round, and a round's records stand some pixels apart.
//! In a frame of limited time the walk does not go row by row but from pixels far apart to those between them: wherever it ends, all of the picture is served.

use super::{Work, request};
use crate::contract::Encoder;
use crate::math::{projection::Pinhole, weight::Record, weight::Rule};
use crate::passes::record::{Fresh, Request, pinhole, texels};
use crate::schedule::*;
use glam::{Vec3, Vec4, Vec4Swizzles};

/// Least distance between the records of a batch, along a row or a column [pixels].
const LEAST_SPACING: u32 = 2;

/// What the host keeps of a frame.
struct Walk {
    width: usize,
    /// Position and width of a pixel, normal and depth: one texel a pixel.
    position: Vec<Vec4>,
    normal: Vec<Vec4>,
    /// Σ w; −1 where no surface is seen.
    weights: Vec<f32>,
    /// The pixels in another order than row by row.
    order: Option<Vec<u32>>,
    /// Place in the order that the walk goes on from.
    next: usize,
    /// Pixels that the round before made records for.
    asked: Vec<usize>,
    /// Distance between the records of a batch [pixels].
    spacing: u32,
    /// A pixel whose weights add up to this or less misses a record.
    overlap: f32,
}

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work, spacing: u32) {
    let sequential = e.sequential;
    let [width, height] = work.gbuffer.size;
    let pixels = width * height;
    let walk = e.state("walk");
    // Whether this round reads the sums back, and how many records the host's weights hold.
    let [look, seen] = ["look", "seen"].map(|name| e.variable(name, false));
    let (gbuffer, overlap) = (work.gbuffer, work.overlap);
    let read_surfaces = move |host: &mut dyn HostContext| {
        let vectors = |texels: &[[f32; 4]]| texels.iter().copied().map(Vec4::from).collect();
        let (position, normal) = (vectors(texels(host, gbuffer.position)), vectors(texels(host, gbuffer.normal)));
        let walk_from = Walk { width: width as usize, position, normal, weights: Vec::new(), order: None, next: 0, asked: Vec::new(), spacing, overlap };
        *host.state(walk) = Some(Box::new(walk_from));
        host.set(look, 1);
        Ok(())
    };
    let surfaces = vec![Read::whole(gbuffer.position), Read::whole(gbuffer.normal)];
    e.before_loop(Command::Host(Host::new("read_surfaces", surfaces, Vec::new(), read_surfaces)));
    let cache = work.cache;
    e.host("look", &[], &[], move |host| {
        if host.variable(look) > 0 {
            host.set(seen, host.variable(cache.count));
        }
        Ok(())
    });
    let weights = e.buffer("weights", pixels as u64 * 4);
    let program = Program::new("find_misses/host_scan").bind("position", gbuffer.position).bind("sums", work.sums).bind("weights", weights);
    e.compute(program, "look", Groups::Counted { count: look, divisor: 1, per: pixels.div_ceil(64) });
    let fresh = Fresh::encode(e, &cache, seen, work.requests.capacity);
    let (work, requests) = (*work, work.requests);
    let reads: Vec<Read> = [Read::counted(weights, pixels as u64 * 4, look), fresh.read()].into_iter().chain(work.face_reads()).collect();
    e.host("walk", &reads, &[requests.places], move |host| {
        let looked = host.variable(look) > 0;
        let device_weights: Vec<f32> = bytemuck::pod_collect_to_vec(host.read(weights));
        let (records, camera) = (fresh.records(host), pinhole(host));
        let walked = host.state(walk).take().and_then(|state| state.downcast::<Walk>().ok());
        let mut surfaces = walked.ok_or("the surfaces were not read before the walk")?;
        if host.is_timed() && surfaces.order.is_none() {
            surfaces.order = Some(from_far_apart([width, height]));
        }
        if looked {
            (surfaces.weights, surfaces.next) = (device_weights, 0);
        }
        for record in &records {
            surfaces.splat(record, &cache.rule, &camera);
        }
        let uncovered = surfaces.asked.iter().filter(|pixel| surfaces.misses_at(**pixel)).count() as u32;
        let free = work.room(host, uncovered);
        let room = requests.capacity.min(free) as usize;
        surfaces.asked = if sequential { surfaces.first_miss().into_iter().take(room).collect() } else { surfaces.misses(room) };
        let new: Vec<Request> = surfaces.asked.iter().map(|pixel| surfaces.request(*pixel, work.face(host, *pixel, surfaces.position[*pixel]))).collect();
        *host.state(walk) = Some(surfaces);
        host.write(requests.places, 0, bytemuck::cast_slice(&new));
        host.set(requests.count, new.len() as u32);
        host.set(seen, host.variable(cache.count));
        host.set(requests.made, host.variable(requests.made) + new.len() as u32);
        // A walk that ends without having just looked at the sums looks once more.
        host.set(look, (!sequential || (new.is_empty() && !looked)) as u32);
        host.set(work.none, ((new.is_empty() && looked) || free == 0) as u32);
        Ok(())
    });
}

/// Distance of the pixels that come first of those from far apart, a power of two: there are 64 to 256 of them in a square picture.
pub(super) fn widest_spacing([width, height]: [u32; 2]) -> usize {
    1 << (width.max(height) / 8).max(1).ilog2()
}

/// All pixels: those of a wide grid, those that halve its spacing, and so on.
fn from_far_apart([width, height]: [u32; 2]) -> Vec<u32> {
    let widest = widest_spacing([width, height]);
    let mut order = Vec::with_capacity((width * height) as usize);
    let mut spacing = widest;
    while spacing > 0 {
        for row in (0..height).step_by(spacing) {
            let is_new = |column: &u32| spacing == widest || !row.is_multiple_of(2 * spacing as u32) || !column.is_multiple_of(2 * spacing as u32);
            order.extend((0..width).step_by(spacing).filter(is_new).map(|column| row * width + column));
        }
        spacing /= 2;
    }
    order
}

impl Walk {
    /// Adds a record's weight to the pixels that it covers.
    fn splat(&mut self, record: &Record, rule: &Rule, camera: &Pinhole) {
        let Some(bounds) = camera.bounds(record.position, rule.longest_validity_radius(record) * 1.0001) else { return };
        for row in bounds.min[1]..bounds.max[1] {
            for column in bounds.min[0]..bounds.max[0] {
                let pixel = row as usize * self.width + column as usize;
                if self.weights[pixel] >= 0.0 {
                    self.weights[pixel] += rule.weight(record, self.position[pixel].xyz(), self.normal[pixel].xyz());
                }
            }
        }
    }

    fn misses_at(&self, pixel: usize) -> bool {
        (0.0..=self.overlap).contains(&self.weights[pixel])
    }

    /// The pixel at a place in the order.
    fn pixel_at(&self, place: usize) -> usize {
        self.order.as_ref().map_or(place, |order| order[place] as usize)
    }

    /// The next pixel of the order that misses a record. The walk goes on behind it: another record there would cover no more.
    fn first_miss(&mut self) -> Option<usize> {
        let found = (self.next..self.weights.len()).find(|place| self.misses_at(self.pixel_at(*place)));
        self.next = found.map_or(self.weights.len(), |place| place + 1);
        found.map(|place| self.pixel_at(place))
    }

    /// Misses in their order, `room` at most, that stand apart; closer next time when these did not fill the room.
    fn misses(&mut self, room: usize) -> Vec<usize> {
        let mut found = Vec::new();
        let mut taken = vec![false; self.weights.len()];
        for pixel in (0..self.weights.len()).map(|place| self.pixel_at(place)) {
            if found.len() == room {
                return found;
            }
            if self.misses_at(pixel) && !taken[pixel] {
                found.push(pixel);
                self.take(&mut taken, pixel);
            }
        }
        self.spacing = (self.spacing / 2).max(LEAST_SPACING);
        found
    }

    /// Marks the pixels that are too close to this one; above it, row by row, the walk has been already.
    fn take(&self, taken: &mut [bool], pixel: usize) {
        let spacing = self.spacing as usize;
        let (row, column) = (pixel / self.width, pixel % self.width);
        let above = if self.order.is_some() { row.saturating_sub(spacing - 1) } else { row };
        for row in above..(row + spacing).min(taken.len() / self.width) {
            let columns = column.saturating_sub(spacing - 1)..(column + spacing).min(self.width);
            taken[row * self.width..][columns].fill(true);
        }
    }

    fn request(&self, pixel: usize, face: Option<Vec3>) -> Request {
        request(self.position[pixel], self.normal[pixel], face, pixel as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn from_far_apart_each_pixel_comes_once() {
        for size in [[1, 1], [7, 3], [40, 30], [128, 65]] {
            let mut order = from_far_apart(size);
            let spacing = widest_spacing(size) as u32;
            let first = size.map(|pixels| pixels.div_ceil(spacing)).iter().product::<u32>() as usize;
            assert!(order[..first].iter().all(|pixel| (pixel % size[0]).is_multiple_of(spacing) && (pixel / size[0]).is_multiple_of(spacing)));
            order.sort();
            assert!(order.into_iter().eq(0..size[0] * size[1]), "{size:?}");
        }
    }

    #[test]
    fn the_widest_spacing_leaves_eight_pixels_or_more_along_the_longer_side() {
        let cases = [([1, 1], 1), ([15, 15], 1), ([16, 3], 2), ([3, 16], 2), ([64, 48], 8), ([100, 130], 16), ([1024, 512], 128)];
        assert!(cases.iter().all(|(size, spacing)| widest_spacing(*size) == *spacing));
    }
}

#[cfg(test)]
mod walks {
    use super::*;
    use crate::passes::mock;
    use glam::Vec3;

    /// Of 8×6 pixels without a record, which see a wall 4 away.
    fn walk(spacing: u32, order: Option<Vec<u32>>) -> Walk {
        let across = |at: usize, pixels: usize| (at as f32 + 0.5) / pixels as f32 * 2.0 - 1.0;
        let place = |pixel: usize| Vec4::new(4.0 * across(pixel % 8, 8), -3.0 * across(pixel / 8, 6), -4.0, 1.0);
        let position = (0..48).map(place).collect();
        Walk { width: 8, position, normal: vec![Vec4::Z; 48], weights: vec![0.0; 48], order, next: 0, asked: Vec::new(), spacing, overlap: 0.25 }
    }

    #[test]
    fn a_batch_takes_pixels_that_stand_apart() {
        let mut found = walk(3, None);
        assert_eq!(found.misses(100), [0, 3, 6, 24, 27, 30]);
        // Next time they stand closer, but not side by side.
        assert_eq!(found.spacing, LEAST_SPACING);
        found.misses(100);
        assert_eq!(found.spacing, LEAST_SPACING);
        let mut wide = walk(9, None);
        assert_eq!((wide.misses(100), wide.spacing), (vec![0], 4));
    }

    #[test]
    fn a_full_batch_keeps_the_distance() {
        let mut full = walk(4, None);
        assert_eq!((full.misses(3), full.spacing), (vec![0, 4, 32], 4));
        assert_eq!((full.misses(5), full.spacing), (vec![0, 4, 32, 36], 2));
    }

    #[test]
    fn pixels_in_another_order_stand_apart_from_those_below_too() {
        let mut upwards = walk(4, Some((0..48).rev().collect()));
        assert_eq!(upwards.misses(100), [47, 43, 15, 11]);
        // A row of which the lower half has come before the upper.
        let mut halves = walk(2, Some((24..48).chain(0..24).collect()));
        let found = halves.misses(100);
        assert_eq!(found[..8], [24, 26, 28, 30, 40, 42, 44, 46]);
        assert_eq!(found[8..], [0, 2, 4, 6]);
    }

    #[test]
    fn covered_pixels_and_those_that_see_nothing_miss_no_record() {
        let mut some = walk(2, None);
        some.weights.fill(1.0);
        (some.weights[3], some.weights[20], some.weights[21], some.weights[30]) = (0.25, 0.26, -1.0, 0.0);
        assert_eq!((0..48).filter(|pixel| some.misses_at(*pixel)).collect::<Vec<_>>(), [3, 30]);
        assert_eq!(some.misses(100), [3, 30]);
        assert_eq!([some.first_miss(), some.first_miss(), some.first_miss()], [Some(3), Some(30), None]);
        // The walk is over, until it begins anew.
        some.weights[40] = 0.0;
        assert_eq!(some.first_miss(), None);
        some.next = 0;
        assert_eq!(some.first_miss(), Some(3));
        let mut backwards = walk(2, Some((0..48).rev().collect()));
        assert_eq!([backwards.first_miss(), backwards.first_miss()], [Some(47), Some(46)]);
    }

    #[test]
    fn a_record_adds_its_weight_to_all_that_it_reaches() {
        let camera = Pinhole { eye: Vec3::ZERO, right: Vec3::X, up: Vec3::Y, forward: Vec3::NEG_Z, half_extent: glam::Vec2::new(1.0, 0.75), size: [8, 6] };
        let record = Record { position: Vec3::new(1.0, -0.5, -4.0), radius: 4.0, ..mock::record() };
        let (mut walk, rule) = (walk(2, None), mock::rule());
        walk.weights[28] = -1.0;
        walk.weights[29] = 0.5;
        let before = walk.weights.clone();
        walk.splat(&record, &rule, &camera);
        let weight = |pixel: usize| rule.weight(&record, walk.position[pixel].xyz(), Vec3::Z);
        let expected: Vec<f32> = (0..48).map(|pixel| if pixel == 28 { -1.0 } else { before[pixel] + weight(pixel) }).collect();
        assert_eq!(walk.weights, expected);
        assert!((8..40).contains(&expected.iter().filter(|weight| **weight > 0.0).count()));
    }
}
