//! The area that points in a disc stand for: all of the disc, or what an edge leaves of it.

use glam::Vec2;
use std::f32::consts::{PI, TAU};

/// Directions in which the farthest point is kept.
pub const DIRECTIONS: usize = 32;

/// The outline of points around the origin, by the farthest in each of so many directions: of few points their convex hull, of many nearly so.
#[derive(Debug, Clone)]
pub struct Outline {
    farthest: [(f32, Vec2); DIRECTIONS],
    count: u32,
}

/// Unit directions, evenly spread.
fn direction(number: usize) -> Vec2 {
    Vec2::from_angle(TAU * number as f32 / DIRECTIONS as f32)
}

/// How much wider than an outline the region is that is looked at.
const WIDER: f32 = 1.25;

/// Between the points of a spiral that fills a disc [radians].
const GOLDEN_ANGLE: f32 = 2.399_963_2;

/// Fewer points tell nothing of an edge.
const FEWEST: u32 = 10;

/// How many standard deviations an outline may be smaller than that of a whole disc.
const DEVIATIONS: f32 = 2.5;

/// What is left of a disc is no less than this share of it: points in a line have no area.
pub const LEAST_SHARE: f32 = 0.01;

impl Outline {
    pub fn new() -> Self {
        Self { farthest: [(f32::NEG_INFINITY, Vec2::ZERO); DIRECTIONS], count: 0 }
    }

    pub fn add(&mut self, point: Vec2) {
        self.count += 1;
        for (number, (most, farthest)) in self.farthest.iter_mut().enumerate() {
            let along = point.dot(direction(number));
            if along > *most {
                (*most, *farthest) = (along, point);
            }
        }
    }

    /// Area inside [the points' unit²].
    fn area(&self) -> f32 {
        let next = |number: usize| self.farthest[(number + 1) % DIRECTIONS].1;
        self.farthest.iter().enumerate().map(|(number, (_, point))| point.perp_dot(next(number))).sum::<f32>() * 0.5
    }

    /// The area that the points stand for, when they are all within `radius` of the origin: of a disc with `radius` where nothing speaks against it. Where their
    /// outline is smaller than chance allows, an edge cuts the disc, and the area is the outline's, times what outlines leave out: a share of the points inside
    /// of it, as many as there are points on it.
    pub fn stands_for(&self, radius: f32) -> f32 {
        let disc = PI * radius * radius;
        if self.is_disc(radius) {
            return disc;
        }
        let inside = self.count - self.corners();
        (self.area() * (self.count + 1) as f32 / (inside + 1) as f32).clamp(LEAST_SHARE * disc, disc)
    }

    /// Whether the points fill a disc with this radius, as far as chance allows to tell.
    fn is_disc(&self, radius: f32) -> bool {
        let whole = expected_share(self.count) - DEVIATIONS * deviation(self.count);
        self.count < FEWEST || self.area() >= whole * PI * radius * radius
    }

    /// So many points that fill evenly a region which holds all that the points stand for, and its area: the disc, or the outline made so much wider that what
    /// outlines leave out is in it. What lies beyond the disc does not count.
    pub fn region(&self, radius: f32, count: u32) -> (Vec<Vec2>, f32) {
        if self.is_disc(radius) {
            let spiral = |at: u32| Vec2::from_angle(GOLDEN_ANGLE * at as f32) * (radius * ((at as f32 + 0.5) / count as f32).sqrt());
            return ((0..count).map(spiral).collect(), PI * radius * radius);
        }
        let middle = self.farthest.iter().map(|(_, point)| *point).sum::<Vec2>() / DIRECTIONS as f32;
        // Triangles around the first point, chosen by their area.
        let corner = |number: usize| middle + (self.farthest[number].1 - middle) * WIDER;
        let sides: Vec<[Vec2; 2]> = (1..DIRECTIONS - 1).map(|number| [corner(number) - corner(0), corner(number + 1) - corner(0)]).collect();
        let mut sum = 0.0;
        let sums: Vec<f32> = sides
            .iter()
            .map(|[a, b]| {
                sum += a.perp_dot(*b).max(0.0);
                sum
            })
            .collect();
        let point = |at: u32| {
            let chosen = (at as f32 + 0.5) / count as f32 * sum;
            let number = sums.partition_point(|sum| *sum <= chosen).min(sides.len() - 1);
            let [u, v] = [0.754_877_7, 0.569_840_3].map(|step| (0.5 + step * at as f32).fract());
            let root = u.sqrt();
            corner(0) + sides[number][0] * (root * (1.0 - v)) + sides[number][1] * (root * v)
        };
        ((0..count).map(point).collect(), 0.5 * sum)
    }

    /// Different points on the outline.
    fn corners(&self) -> u32 {
        let differs = |number: &usize| self.farthest[*number].1 != self.farthest[(number + 1) % DIRECTIONS].1;
        (0..DIRECTIONS).filter(differs).count() as u32
    }
}

impl Default for Outline {
    fn default() -> Self {
        Self::new()
    }
}

/// The mean area of the convex hull of so many points in a disc, as a share of the disc's (fitted to its series).
fn expected_share(count: u32) -> f32 {
    let s = count as f32 + 0.813_19;
    let root = s.powf(-2.0 / 3.0);
    1.0 - 3.383_23 * root * (1.0 - 0.723_65 * root - 0.134_95 / s)
}

/// Its standard deviation, fitted to samples of 10 to 400 points.
fn deviation(count: u32) -> f32 {
    1.1 * (count as f32).powf(-0.82)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};

    /// Points spread over a disc of radius 2, of which those stay that `keep` says: as many as `count`.
    fn points(seed: u32, count: usize, keep: impl Fn(Vec2) -> bool) -> Outline {
        let point = |at: u32| {
            let [u, v] = [0, 1].map(|key| unit(hash(hash(seed) ^ (2 * at + key))));
            2.0 * u.sqrt() * Vec2::from_angle(TAU * v)
        };
        let mut outline = Outline::new();
        (0..).map(point).filter(|p| keep(*p)).take(count).for_each(|p| outline.add(p));
        outline
    }

    fn mean_area(count: usize, keep: impl Fn(Vec2) -> bool + Copy) -> f32 {
        let runs = 200;
        (0..runs).map(|seed| points(seed, count, keep).stands_for(2.0)).sum::<f32>() / runs as f32
    }

    #[test]
    fn a_whole_disc_is_known_for_one() {
        for count in [3, 9, 10, 30, 100, 300] {
            let share = mean_area(count, |_| true) / (4.0 * PI);
            assert!(share > 0.985 && share <= 1.0001, "{count}: {share}");
        }
    }

    /// Cut by an edge through the middle, by one beside it, and by a corner.
    #[test]
    fn what_an_edge_leaves_is_known_too() {
        for count in [50, 100, 300] {
            let half = mean_area(count, |p| p.x > 0.0) / (2.0 * PI);
            let quarter = mean_area(count, |p| p.x > 0.0 && p.y > 0.0) / PI;
            // From 60° off the axis on a segment is missing.
            let segment = 4.0 * (PI / 3.0 - (PI / 3.0).sin() * (PI / 3.0).cos());
            let beside = mean_area(count, |p| p.x > -1.0) / (4.0 * PI - segment);
            for (share, what) in [(half, "half"), (quarter, "a quarter"), (beside, "most of it")] {
                assert!((share - 1.0).abs() < 0.12, "{what} by {count}: {share}");
            }
        }
    }

    #[test]
    fn points_fill_the_disc_or_what_is_left_of_it() {
        let (disc, area) = points(1, 200, |_| true).region(2.0, 64);
        assert!(disc.iter().all(|p| p.length() < 2.0) && disc.iter().sum::<Vec2>().length() < 0.1 * 64.0 && area == PI * 2.0 * 2.0);
        // Of the region of half a disc that share is on it which takes its area to the half disc's.
        // An outline of few points leaves out more than the region is wider.
        for (count, limit) in [(20, 0.16), (50, 0.04), (200, 0.03)] {
            let runs = 100;
            let found: f32 = (0..runs)
                .map(|seed| {
                    let (half, area) = points(seed, count, |p| p.x > 0.0).region(2.0, 256);
                    area * half.iter().filter(|p| p.x > 0.0 && p.length() < 2.0).count() as f32 / 256.0
                })
                .sum();
            let share = found / runs as f32 / (2.0 * PI);
            assert!((share - 1.0).abs() < limit, "{count}: {share}");
        }
    }

    #[test]
    fn no_points_and_all_in_one_place_are_no_edge() {
        assert_eq!(Outline::new().stands_for(1.0), PI);
        let mut outline = Outline::new();
        (0..100).for_each(|_| outline.add(Vec2::new(0.3, 0.2)));
        assert!((outline.stands_for(1.0) - LEAST_SHARE * PI).abs() < 1e-6);
    }
}
