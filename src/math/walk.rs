//! Points on surfaces, walked through one after the other: where none stands yet that reaches it, a place is made.

use super::record_index::{cell, exponent};
use super::{radius::Reach, thinning::Vertex};
use glam::IVec3;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};

/// Places by the cells that they touch, of the size that is twice to four times their reach.
#[derive(Default)]
struct Grid {
    cells: HashMap<(i32, IVec3), Vec<u32>>,
    /// Of the cells that there are.
    sizes: BTreeSet<i32>,
    places: Vec<(Vertex, Reach)>,
}

/// How far beside the plane of a place a point may be, as a share of its distance.
const LEVEL: f32 = 0.1;

impl Grid {
    fn add(&mut self, place: Vertex, reach: Reach) {
        let size = exponent(2.0 * reach.longest());
        let (first, last) = (cell(place.position - reach.longest(), size), cell(place.position + reach.longest(), size));
        for z in first.z..=last.z {
            for y in first.y..=last.y {
                for x in first.x..=last.x {
                    self.cells.entry((size, IVec3::new(x, y, z))).or_default().push(self.places.len() as u32);
                }
            }
        }
        self.sizes.insert(size);
        self.places.push((place, reach));
    }

    /// Whether a place reaches a point: its distance in reaches and the turn of its normal in `accuracy` add to less than 1.
    fn covers(&self, point: &Vertex, accuracy: f32) -> bool {
        let reaches = |number: &u32| {
            let (place, reach) = &self.places[*number as usize];
            let way = point.position - place.position;
            let turned = (1.0 - point.normal.dot(place.normal)).max(0.0).sqrt();
            let is_level = way.dot(point.normal + place.normal).abs() * 0.5 <= LEVEL * way.length();
            reach.apart(way) + turned / accuracy < 1.0 && is_level
        };
        self.sizes.iter().any(|size| self.cells.get(&(*size, cell(point.position, *size))).is_some_and(|listed| listed.iter().any(reaches)))
    }
}

/// Points that are looked at side by side before places are made of them.
const CHUNK: usize = 4096;

/// Of points in this order the places, `most` at most, and how far each reaches, as `reach` says. Every point is reached by one where there are no more. All cores
/// look at points; the places are those of one after the other.
pub fn walked(points: &[Vertex], accuracy: f32, most: usize, reach: impl Fn(&Vertex) -> Reach + Sync) -> Vec<(Vertex, Reach)> {
    let mut grid = Grid::default();
    for chunk in points.chunks(CHUNK) {
        let unreached = chunk.par_iter().filter(|point| !grid.covers(point, accuracy));
        let places: Vec<(Vertex, Reach)> = unreached.map(|point| (*point, reach(point))).collect();
        for (place, reach) in places {
            if grid.places.len() == most {
                return grid.places;
            }
            if !grid.covers(&place, accuracy) {
                grid.add(place, reach);
            }
        }
    }
    grid.places
}

/// Numbers below `count` in an order in which neighbours are far apart: each once.
pub fn spread(count: usize) -> impl Iterator<Item = usize> {
    let golden = (count as f64 * 0.618_033_988_749_895) as usize;
    // A step that shares no divisor with the count comes by each number.
    let step = (golden.max(1)..).find(|step| greatest_common_divisor(*step, count) == 1).unwrap_or(1);
    (0..count as u64).map(move |at| (at * step as u64 % count as u64) as usize)
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};
    use glam::Vec3;

    #[test]
    fn every_point_is_reached_and_no_place_stands_in_the_reach_of_one_before() {
        let number = |at: u32| unit(hash(at));
        let points: Vec<Vertex> = (0..3000)
            .map(|at| {
                let [x, y] = [number(2 * at), number(2 * at + 1)].map(|side| 10.0 * side);
                let normal = if at % 3 == 0 { Vec3::NEG_Z } else { Vec3::Z };
                Vertex { position: Vec3::new(x, y, if at % 5 == 0 { 1.0 } else { 0.0 }), normal }
            })
            .collect();
        let reach = |point: &Vertex| Reach { stretch: Vec3::new(0.0, 0.8, 0.0), ..Reach::round(0.2 + 0.1 * point.position.x) };
        let places = walked(&points, 0.5, usize::MAX, reach);
        let apart = |(place, reach): &(Vertex, Reach), point: &Vertex| reach.apart(point.position - place.position);
        let is_level = |place: &Vertex, point: &Vertex| place.normal == point.normal && place.position.z == point.position.z;
        let covers = |place: &(Vertex, Reach), point: &Vertex| is_level(&place.0, point) && apart(place, point) < 1.0001;
        assert!(points.iter().all(|point| places.iter().any(|place| covers(place, point) || place.0 == *point)));
        for (at, (place, _)) in places.iter().enumerate() {
            assert!(!places[..at].iter().any(|before| is_level(&before.0, place) && apart(before, place) < 0.999));
        }
        assert!(places.len() > 100 && places.len() < 1500, "{}", places.len());
        assert_eq!(walked(&points, 0.5, 7, reach).len(), 7);
    }

    #[test]
    fn numbers_are_spread_and_come_once_each() {
        for count in [0, 1, 2, 3, 10, 97, 1000] {
            let mut all: Vec<usize> = spread(count).collect();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..count));
        }
    }
}
