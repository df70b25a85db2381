//! Points on surfaces, thinned: groups of neighbours that one place each can stand for.

use super::radius::Reach;
use glam::Vec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A place on a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vertex {
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
}

/// How much more than a distance along the surface one across it counts: what lies in front of a plane sees other things.
const ACROSS: f32 = 10.0;

/// How much a difference of normals counts, in sizes of the group.
const TURNED: f32 = 4.0;

/// Groups of so few are not divided, so that their size says how far apart places are.
const FEWEST: usize = 3;

/// At most `most` of these vertices, and of each the radius within which it stands for others. The group that many vertices are far from the middle of is divided
/// first, across the direction in which it is widest: along the surface, across it, or by the normals. Then the sum of squared distances falls the fastest, as that
/// of k-means does, in O(n log n).
pub fn thinned(mut vertices: Vec<Vertex>, most: usize) -> Vec<(Vertex, Reach)> {
    if vertices.is_empty() || most == 0 {
        return Vec::new();
    }
    let likely = vertices.len().div_ceil(most);
    let mut turns = BinaryHeap::from([Turn::of(Box::new(Group::divided_down_to(likely, &mut vertices, 0)))]);
    let mut whole = Vec::with_capacity(most);
    while turns.len() + whole.len() < most
        && let Some(Turn { mut group, .. }) = turns.pop()
    {
        if let Some(halves) = group.halves.take() {
            turns.extend(halves.map(Turn::of));
            continue;
        }
        let members = &mut vertices[group.first..group.first + group.count];
        let divided = if group.count > FEWEST { group.divide(members) } else { 0 };
        if divided == 0 || divided == group.count {
            whole.push(group);
            continue;
        }
        let (left, right) = members.split_at(divided);
        turns.extend([Group::of(left, group.first), Group::of(right, group.first + divided)].map(Box::new).map(Turn::of));
    }
    whole.extend(turns.into_iter().map(|turn| turn.group));
    whole.sort_unstable_by_key(|group| group.first);
    // Vertices in one spot tell nothing of how far another is.
    let places: Vec<(Vertex, f32)> = whole.par_iter().map(|group| group.place(&vertices[group.first..][..group.count])).collect();
    let mut radii: Vec<f32> = places.iter().map(|(_, radius)| *radius).collect();
    radii.sort_unstable_by(f32::total_cmp);
    let least = LEAST_RADIUS * radii[radii.len() / 2];
    places.into_iter().map(|(place, radius)| (place, Reach::round(radius.max(least)))).collect()
}

/// The least radius, as a share of the middle one.
const LEAST_RADIUS: f32 = 0.25;

/// Vertices side by side in the list.
struct Group {
    first: usize,
    count: usize,
    middle: Vertex,
    /// What is divided by.
    widest: Width,
    /// The sum of squares along it.
    spread: f32,
    /// Of one that has been divided ahead of its turn.
    halves: Option<[Box<Self>; 2]>,
}

/// When a group is divided: the more it is spread the sooner. It is small, as a heap moves it often.
struct Turn {
    spread: f32,
    first: u32,
    group: Box<Group>,
}

impl Turn {
    fn of(group: Box<Group>) -> Self {
        Self { spread: group.spread, first: group.first as u32, group }
    }
}

/// A direction in which vertices differ, as what a vertex is multiplied with.
#[derive(Clone, Copy)]
enum Width {
    Position(Vec3),
    Normal(Vec3),
}

impl Width {
    fn of(self, vertex: &Vertex) -> f32 {
        match self {
            Self::Position(axis) => vertex.position.dot(axis),
            Self::Normal(axis) => vertex.normal.dot(axis),
        }
    }
}

impl Group {
    fn of(members: &[Vertex], first: usize) -> Self {
        let count = members.len() as f32;
        let [position, normal] = sums(members, |vertex| [vertex.position, vertex.normal]);
        let middle = Vertex { position: position / count, normal: normal / count };
        let up = middle.normal.normalize_or_zero();
        let [position, normal, across] = sums(members, |vertex| {
            let (way, turn) = (vertex.position - middle.position, vertex.normal - middle.normal);
            [way * way, turn * turn, Vec3::splat(way.dot(up).powi(2))]
        });
        let across = across.x;
        let size = position.element_sum() / count;
        let axes = [Vec3::X, Vec3::Y, Vec3::Z];
        let along = axes.into_iter().map(|axis| (Width::Position(axis), position.dot(axis)));
        let turned = axes.into_iter().map(|axis| (Width::Normal(axis), normal.dot(axis) * size * TURNED * TURNED));
        let widths = along.chain(turned).chain([(Width::Position(up), across * ACROSS * ACROSS)]);
        let (widest, spread) = widths.fold((Width::Position(Vec3::X), -1.0), |best, width| if width.1 > best.1 { width } else { best });
        Self { first, count: members.len(), middle, widest, spread, halves: None }
    }

    /// Divides all groups of more than so many, whose turn is likely to come: how a group is divided does not depend on when, so that cores share this.
    fn divided_down_to(likely: usize, members: &mut [Vertex], first: usize) -> Self {
        let mut group = Self::of(members, first);
        let divided = if group.count > likely.max(FEWEST) { group.divide(members) } else { 0 };
        if divided > 0 && divided < group.count {
            let (left, right) = members.split_at_mut(divided);
            let (left, right) =
                rayon::join(|| Box::new(Self::divided_down_to(likely, left, first)), || Box::new(Self::divided_down_to(likely, right, first + divided)));
            group.halves = Some([left, right]);
        }
        group
    }

    /// Puts those on one side of the middle before the others: how many there are.
    fn divide(&self, members: &mut [Vertex]) -> usize {
        let middle = self.widest.of(&self.middle);
        let (mut low, mut high) = (0, members.len());
        while low < high {
            if self.widest.of(&members[low]) < middle {
                low += 1;
            } else {
                high -= 1;
                members.swap(low, high);
            }
        }
        low
    }

    /// The member next to the middle, and how far the others are from it.
    fn place(&self, members: &[Vertex]) -> (Vertex, f32) {
        let size = members.iter().map(|vertex| vertex.position.distance_squared(self.middle.position)).fold(0.0, f32::max);
        let apart = |vertex: &Vertex| vertex.position.distance_squared(self.middle.position) + size * vertex.normal.distance_squared(self.middle.normal);
        let nearest = members.iter().fold(members[0], |best, vertex| if apart(vertex) < apart(&best) { *vertex } else { best });
        let radius = members.iter().map(|vertex| vertex.position.distance(nearest.position)).fold(0.0, f32::max);
        (nearest, radius)
    }
}

/// Vertices that a core adds up at once.
const TOGETHER: usize = 1 << 13;

/// Sums over vertices, which cores share; the order in which numbers are added does not depend on them.
fn sums<const N: usize>(members: &[Vertex], of: impl Fn(&Vertex) -> [Vec3; N] + Sync) -> [Vec3; N] {
    let add = |sum: [Vec3; N], other: [Vec3; N]| std::array::from_fn(|at| sum[at] + other[at]);
    let of_part = |part: &[Vertex]| part.iter().map(&of).fold([Vec3::ZERO; N], add);
    if members.len() <= TOGETHER {
        return of_part(members);
    }
    let parts: Vec<_> = members.par_chunks(TOGETHER).map(of_part).collect();
    parts.into_iter().fold([Vec3::ZERO; N], add)
}

impl PartialEq for Turn {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Turn {}

impl PartialOrd for Turn {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Turn {
    fn cmp(&self, other: &Self) -> Ordering {
        self.spread.total_cmp(&other.spread).then(other.first.cmp(&self.first))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};

    /// On the floor of a room, and on a table top over a part of it.
    fn vertices(count: u32) -> Vec<Vertex> {
        let number = |at: u32| unit(hash(at));
        let floor = (0..count).map(|at| Vec3::new(10.0 * number(2 * at), 10.0 * number(2 * at + 1), 0.0));
        let table = (0..count / 4).map(|at| Vec3::new(2.0 * number(9000 + 2 * at), 2.0 * number(9001 + 2 * at), 0.8));
        let wall = (0..count).map(|at| Vec3::new(10.0 * number(70_000 + 2 * at), 0.0, 4.0 * number(70_001 + 2 * at)));
        let up = floor.chain(table).map(|position| Vertex { position, normal: Vec3::Z });
        up.chain(wall.map(|position| Vertex { position, normal: Vec3::Y })).collect()
    }

    #[test]
    fn every_vertex_has_a_place_that_stands_for_it() {
        let all = vertices(4000);
        let places = thinned(all.clone(), 300);
        assert_eq!(places.len(), 300);
        assert!(places.iter().all(|(place, _)| all.contains(place)));
        let stands_for = |(place, reach): &(Vertex, Reach), vertex: &Vertex| {
            place.normal == vertex.normal
                && reach.apart(place.position - vertex.position) <= 1.0001
                && (place.position.z - vertex.position.z).abs() < 1e-3 + f32::from(u8::from(place.normal == Vec3::Y)) * 9.0
        };
        assert!(all.iter().all(|vertex| places.iter().any(|place| stands_for(place, vertex))));
        // 180 m² by 300 places: a circle of 0.6 m² has a radius of 0.44 m.
        let mean = places.iter().map(|(_, reach)| reach.radius).sum::<f32>() / 300.0;
        assert!((0.3..0.9).contains(&mean), "{mean}");
    }

    #[test]
    fn few_vertices_are_left_as_they_are_and_none_make_no_place() {
        assert!(thinned(Vec::new(), 10).is_empty() && thinned(vertices(4), 0).is_empty());
        assert_eq!(thinned(vertices(4), 1).len(), 1);
        let same = vec![Vertex { position: Vec3::ONE, normal: Vec3::X }; 50];
        assert_eq!(thinned(same.clone(), 10), [(same[0], Reach::round(0.0))]);
    }
}
