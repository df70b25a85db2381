//! Clusters boxes from the bottom up into a binary tree: neighbours on a curve through space that choose each other become one (Meister and Bittner,
//! Parallel locally-ordered clustering, 2018).
//!
//! What comes out is what `obvhs::ploc` makes, to the bit, but where hardly any choose each other: in a row of equal boxes each prefers the next, so that
//! a round joins two, and as many rounds as boxes make a tree that is as deep. Such a round joins each with the next instead.

use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, DEFAULT_MAX_STACK_DEPTH, node::Bvh2Node},
    ploc::morton::morton_encode_u64_unorm,
};
use rdst::{RadixKey, RadixSort};

/// How many boxes on either side are looked at, and the first rounds that look at one.
const REACH: usize = 14;
const SHORT_ROUNDS: usize = 3;

/// A round that joins fewer than one in so many pairs does not get on; of fewer boxes than the second no round takes long.
const FEW: usize = 64;
const SHORT: usize = 64;

/// More boxes than these are sorted by digits.
const MANY: usize = 250_000;

/// A tree whose leaves hold one box each.
pub(super) fn cluster(boxes: &[Aabb]) -> Bvh2 {
    let mut tree = Bvh2::zeroed(boxes.len());
    tree.primitive_indices = (0..boxes.len() as u32).collect();
    let mut open = along_curve(boxes);
    // Children stand behind their parents, in pairs.
    let mut end = tree.nodes.len();
    let mut rounds = 0;
    while open.len() > 1 {
        let mut chosen = if rounds < SHORT_ROUNDS { nearer_neighbours(&open) } else { nearest(&open) };
        let pairs = (0..open.len()).filter(|&i| chosen[i] < i && chosen[chosen[i]] == i).count();
        if open.len() > SHORT && pairs * FEW < open.len() {
            chosen = next_neighbours(open.len());
        }
        open = joined(&open, &chosen, |pair| {
            end -= 2;
            tree.nodes[end..end + 2].copy_from_slice(&pair);
            end as u32
        });
        rounds += 1;
    }
    if let Some(root) = open.first() {
        tree.nodes[0] = *root;
    }
    tree.max_depth = DEFAULT_MAX_STACK_DEPTH.max(rounds + 1);
    tree.children_are_ordered_after_parents = true;
    tree
}

/// A leaf for each box, in the order of their centres on Morton's curve.
fn along_curve(boxes: &[Aabb]) -> Vec<Bvh2Node> {
    #[derive(Clone, Copy)]
    struct Place {
        code: u64,
        index: u64,
    }
    impl RadixKey for Place {
        const LEVELS: usize = 8;
        fn get_level(&self, level: usize) -> u8 {
            self.code.get_level(level)
        }
    }
    let all = boxes.iter().fold(Aabb::empty(), |all, other| all.union(other));
    let scale = 1.0 / all.diagonal().as_dvec3();
    let offset = -all.min.as_dvec3() * scale;
    let place = |(index, one): (u64, &Aabb)| Place { code: morton_encode_u64_unorm(one.center().as_dvec3() * scale + offset), index };
    let mut places: Vec<Place> = (0..).zip(boxes).map(place).collect();
    if places.len() > MANY {
        places.radix_sort_unstable()
    } else {
        places.sort_unstable_by_key(|place| place.code)
    }
    places.into_iter().map(|place| Bvh2Node::new(boxes[place.index as usize], 1, place.index as u32)).collect()
}

/// Joins those that have chosen each other; `add` keeps the pair and tells where its first stands.
fn joined(open: &[Bvh2Node], chosen: &[usize], mut add: impl FnMut([Bvh2Node; 2]) -> u32) -> Vec<Bvh2Node> {
    let mut next = Vec::with_capacity(open.len());
    for (index, &other) in chosen.iter().enumerate() {
        if chosen[other] != index || other == index {
            next.push(open[index]);
        } else if other < index {
            let first = add([open[index], open[other]]);
            next.push(Bvh2Node::new(open[index].aabb().union(open[other].aabb()), 0, first));
        }
    }
    next
}

fn cost(a: &Bvh2Node, b: &Bvh2Node) -> f32 {
    a.aabb().union(b.aabb()).half_area()
}

/// Of the one before and the one after, with which a box makes the smaller one.
fn nearer_neighbours(open: &[Bvh2Node]) -> Vec<usize> {
    let mut last = f32::INFINITY;
    let nearer = |index: usize| {
        let Some(next) = open.get(index + 1) else { return index - 1 };
        let cost = cost(&open[index], next);
        let chosen = if last < cost { index - 1 } else { index + 1 };
        last = cost;
        chosen
    };
    (0..open.len()).map(nearer).collect()
}

/// The one within reach with which a box makes the smallest one; of equal ones the last.
fn nearest(open: &[Bvh2Node]) -> Vec<usize> {
    // What a box makes with those behind it is known by the time that they look back.
    let mut known = [[0.0; REACH]; REACH];
    let nearest = |index: usize| {
        let (mut best, mut least) = (index, f32::INFINITY);
        let mut consider = |other, cost| {
            if cost <= least {
                (best, least) = (other, cost);
            }
        };
        (index.saturating_sub(REACH)..index).for_each(|other| consider(other, known[other % REACH][index % REACH]));
        for other in index + 1..(index + REACH + 1).min(open.len()) {
            let cost = cost(&open[index], &open[other]);
            known[index % REACH][other % REACH] = cost;
            consider(other, cost);
        }
        best
    };
    (0..open.len()).map(nearest).collect()
}

/// Each with the one beside it; an odd one out with itself.
fn next_neighbours(count: usize) -> Vec<usize> {
    (0..count).map(|index| (index ^ 1).min(count - 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3A;
    use obvhs::{BvhBuildParams, ploc::PlocBuilder};

    fn theirs(boxes: &[Aabb]) -> Bvh2 {
        let parameters = BvhBuildParams::medium_build();
        let indices = (0..boxes.len() as u32).collect();
        PlocBuilder::new().build(parameters.ploc_search_distance, boxes, indices, parameters.sort_precision, parameters.search_depth_threshold)
    }

    /// Boxes of many sizes around places of no particular order; every other one twice.
    fn scattered(count: u32) -> Vec<Aabb> {
        let number = |k: u32, seed: u32| (k.wrapping_mul(0x9e37_79b9) ^ seed).wrapping_mul(0x85eb_ca6b).wrapping_mul(0xc2b2_ae35) >> 8;
        let at = |k: u32, seed: u32| number(k, seed) as f32 / (1 << 24) as f32;
        let point = |k: u32, seed: u32| Vec3A::new(at(k, seed), at(k, seed + 1), at(k, seed + 2));
        (0..count).map(|i| i - i % 4 / 3).map(|k| Aabb::new(point(k, 1), point(k, 1) + point(k, 7) * 0.01)).collect()
    }

    fn depth(tree: &Bvh2) -> usize {
        let mut deepest = 0;
        let mut open = vec![(0, 1)];
        while let Some((index, depth)) = open.pop() {
            let node: &Bvh2Node = &tree.nodes[index];
            deepest = deepest.max(depth);
            if !node.is_leaf() {
                open.extend([0, 1].map(|side| (node.first_index as usize + side, depth + 1)));
            }
        }
        deepest
    }

    #[test]
    fn boxes_of_no_particular_order_make_the_tree_of_the_crate() {
        for count in [0, 1, 2, 3, 10, 1000, 70_000, 300_000] {
            let boxes = scattered(count);
            let (ours, theirs) = (cluster(&boxes), theirs(&boxes));
            assert_eq!(bytemuck::cast_slice::<_, u32>(&ours.nodes), bytemuck::cast_slice::<_, u32>(&theirs.nodes), "{count}");
            assert_eq!((ours.primitive_indices, ours.max_depth), (theirs.primitive_indices, theirs.max_depth), "{count}");
        }
    }

    #[test]
    fn equal_boxes_make_a_shallow_tree() {
        const COUNT: u32 = 100_000;
        let unit = Aabb::new(Vec3A::ZERO, Vec3A::ONE);
        let moved = |by: Vec3A| Aabb::new(by, by + 1.0);
        let row = |k: u32| moved(Vec3A::X * 2.0 * k as f32);
        let growing = |k: u32| moved(Vec3A::X * (k as f32 + k as f32 * k as f32 * 1e-5));
        let nested = |k: u32| Aabb::new(Vec3A::splat(-1.0 - k as f32), Vec3A::splat(1.0 + k as f32));
        let pairs = |k: u32| row(k / 2);
        let kinds: [(&str, &dyn Fn(u32) -> Aabb); 5] =
            [("coincident", &|_| unit), ("a row", &row), ("a row of pairs", &pairs), ("a row ever wider", &growing), ("one in another", &nested)];
        for (name, kind) in kinds {
            let boxes: Vec<Aabb> = (0..COUNT).map(kind).collect();
            let tree = cluster(&boxes);
            tree.validate(&boxes, false, false);
            assert!(depth(&tree) <= 60, "{name}: {}", depth(&tree));
        }
    }
}
