//! A hierarchy in two levels, for scenes of which parts move: below, one tree over each part, which keeps its shape as the part is moved; above, one over all
//! parts, which is built anew.
//!
//! What stands still is cut into many parts, so that what moves can be joined with what it is near.

use super::{
    bvh::{Node, depth_first, node, tree},
    clusters::cluster,
    wide::half_area,
};
use obvhs::{aabb::Aabb, bvh2::reinsertion::ReinsertionOptimizer};
use rayon::prelude::*;
use std::ops::Range;

/// Parts that what stands still is cut into, at most.
const CUTS: usize = 1024;
/// Levels above the parts, at most: shaders have a stack for so many.
pub const LEVELS: u32 = 24;
/// The share of the upper nodes that are taken out and put where they cost less, and how often.
const REINSERTED: f32 = 0.2;

#[derive(Clone, Default)]
pub struct Parts {
    /// Over the parts, the root first: a leaf holds one, by its number.
    pub upper: Vec<Node>,
    /// Of each part, among the nodes of the lower level. Those that can move are the last.
    pub roots: Vec<u32>,
    pub movers: Vec<Mover>,
}

/// Triangles that are moved together.
#[derive(Clone)]
pub struct Mover {
    pub part: usize,
    /// Of the lower level: children stand behind their parents.
    pub nodes: Range<usize>,
    pub triangles: Range<usize>,
}

impl Parts {
    /// The nodes of the lower level, and the order of the boxes in it.
    pub fn build(boxes: &[Aabb], movers: &[Range<usize>]) -> (Vec<Node>, Self, Vec<u32>) {
        let mut moves = vec![false; boxes.len()];
        movers.iter().for_each(|mover| moves[mover.clone()].fill(true));
        let still: Vec<u32> = (0..boxes.len() as u32).filter(|index| !moves[*index as usize]).collect();
        let (mut nodes, mut order) = part(boxes, still);
        let mut roots: Vec<u32> = if nodes.is_empty() { Vec::new() } else { cut(&nodes) };
        let moving: Vec<_> = movers.par_iter().map(|mover| part(boxes, (mover.start as u32..mover.end as u32).collect())).collect();
        let mut places = Vec::new();
        for (tree, triangles) in moving {
            let (first_node, first_triangle) = (nodes.len(), order.len());
            roots.push(first_node as u32);
            nodes.extend(behind_parents(&tree).into_iter().map(|node| {
                let base = if node.count > 0 { first_triangle } else { first_node };
                Node { first: node.first + base as u32, ..node }
            }));
            order.extend(triangles);
            places.push(Mover { part: roots.len() - 1, nodes: first_node..nodes.len(), triangles: first_triangle..order.len() });
        }
        let mut parts = Self { upper: Vec::new(), roots, movers: places };
        parts.join(&nodes);
        (nodes, parts, order)
    }

    /// Builds the upper level.
    pub fn join(&mut self, nodes: &[Node]) {
        let boxes: Vec<Aabb> = self.roots.iter().map(|root| aabb(&nodes[*root as usize])).collect();
        let mut tree = cluster(&boxes);
        ReinsertionOptimizer::default().run(&mut tree, REINSERTED, None);
        self.upper = tree.nodes.iter().map(node).collect();
        if depth(&self.upper) > LEVELS {
            self.upper = balanced(&boxes);
        }
    }
}

/// What of a hierarchy with `N` children a node that is made of this one stands for which part; `R` stands for a root.
#[derive(Clone)]
pub(super) struct Laid<R, const N: usize> {
    /// Of each node which of the lower level's its children are.
    sources: Vec<[u32; N]>,
    pub roots: Vec<R>,
    /// Nodes of each mover, and what its leaves hold.
    pub movers: Vec<[Range<usize>; 2]>,
    /// The first node of the level over all parts, which is the last.
    pub upper: usize,
}

impl<R, const N: usize> Laid<R, N> {
    /// `lay` adds what stands for the tree below a node, and the sources of its nodes; `sizes` tells how many nodes there are, and how much leaves hold.
    pub fn new<H>(parts: &Parts, made: &mut H, sizes: impl Fn(&H) -> [usize; 2], lay: impl Fn(&mut H, usize, &mut Vec<[u32; N]>) -> R) -> Self {
        let (mut sources, mut starts) = (Vec::new(), vec![sizes(made)]);
        let mut laid = |root: &u32| {
            let stands = lay(made, *root as usize, &mut sources);
            starts.push(sizes(made));
            stands
        };
        let roots = parts.roots.iter().map(&mut laid).collect();
        let movers = parts.movers.iter().map(|mover| [0, 1].map(|kind| starts[mover.part][kind]..starts[mover.part + 1][kind])).collect();
        Self { sources, roots, movers, upper: starts[parts.roots.len()][0] }
    }

    /// The children of a node, each by its slot, among the nodes of the lower level.
    pub fn children(&self, node: usize) -> impl Iterator<Item = (usize, usize)> {
        self.sources[node].iter().enumerate().filter(|(_, source)| **source != u32::MAX).map(|(slot, source)| (slot, *source as usize))
    }
}

/// A tree over some of the boxes, and these in its order.
fn part(boxes: &[Aabb], of: Vec<u32>) -> (Vec<Node>, Vec<u32>) {
    if of.is_empty() {
        return Default::default();
    }
    let (nodes, order) = tree(&of.iter().map(|index| boxes[*index as usize]).collect::<Vec<_>>());
    (nodes, order.into_iter().map(|index| of[index as usize]).collect())
}

/// Nodes that hold all the others, so many at most: the largest is opened first.
fn cut(nodes: &[Node]) -> Vec<u32> {
    #[derive(PartialEq)]
    struct Open(f32, u32);
    impl Eq for Open {}
    impl PartialOrd for Open {
        fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
            Some(self.cmp(other))
        }
    }
    impl Ord for Open {
        fn cmp(&self, other: &Self) -> std::cmp::Ordering {
            self.0.total_cmp(&other.0).then(other.1.cmp(&self.1))
        }
    }
    let open = |index: u32| Open(half_area(&nodes[index as usize]), index);
    let (mut inner, mut leaves) = (std::collections::BinaryHeap::from([open(0)]), Vec::new());
    while inner.len() + leaves.len() < CUTS {
        let Some(Open(_, index)) = inner.pop() else { break };
        let node = &nodes[index as usize];
        if node.count > 0 {
            leaves.push(index);
        } else {
            inner.extend([node.first, node.first + 1].map(open));
        }
    }
    leaves.extend(inner.into_iter().map(|Open(_, index)| index));
    leaves.sort_unstable();
    leaves
}

/// The same tree with children behind their parents and no node besides.
fn behind_parents(nodes: &[Node]) -> Vec<Node> {
    let mut places = vec![0; nodes.len()];
    let mut sorted = vec![nodes[0]];
    for index in depth_first(nodes, 0) {
        if nodes[index].count == 0 {
            let (from, to) = (nodes[index].first as usize, sorted.len());
            sorted[places[index] as usize].first = to as u32;
            (places[from], places[from + 1]) = (to as u32, to as u32 + 1);
            sorted.extend_from_slice(&nodes[from..from + 2]);
        }
    }
    sorted
}

fn depth(nodes: &[Node]) -> u32 {
    let (mut deepest, mut stack) = (0, vec![(0usize, 0)]);
    while let Some((index, level)) = stack.pop() {
        deepest = deepest.max(level);
        if nodes[index].count == 0 {
            let first = nodes[index].first as usize;
            stack.extend([(first, level + 1), (first + 1, level + 1)]);
        }
    }
    deepest
}

/// A tree that halves the parts along their longest extent: as deep as their number has digits.
fn balanced(boxes: &[Aabb]) -> Vec<Node> {
    let empty = Node { min: [0.0; 3], max: [0.0; 3], count: 0, first: 0 };
    let mut nodes = vec![empty];
    let mut open = vec![(0, (0..boxes.len() as u32).collect::<Vec<_>>())];
    while let Some((place, mut parts)) = open.pop() {
        let all = parts.iter().fold(Aabb::empty(), |all, part| all.union(&boxes[*part as usize]));
        let first = if parts.len() == 1 { parts[0] } else { nodes.len() as u32 };
        nodes[place] = Node { min: all.min.into(), max: all.max.into(), count: u32::from(parts.len() == 1), first };
        if parts.len() > 1 {
            let axis = all.largest_axis();
            parts.sort_unstable_by(|a, b| boxes[*a as usize].center()[axis].total_cmp(&boxes[*b as usize].center()[axis]).then(a.cmp(b)));
            let rest = parts.split_off(parts.len() / 2);
            open.extend([(nodes.len(), parts), (nodes.len() + 1, rest)]);
            nodes.extend([empty; 2]);
        }
    }
    nodes
}

fn aabb(node: &Node) -> Aabb {
    Aabb::new(node.min.into(), node.max.into())
}
