//! The scene's hierarchy as shaders read it: sixteen bytes a node. Loads decide how fast rays are where lanes of one instruction
//! walk to different nodes.

use crate::scene::bvh::Node;
use glam::{DVec3, Vec3};

/// Steps of the grid that boxes are rounded outwards to, along each axis of the scene.
const STEPS: f64 = 65535.0;
/// How much farther out a box is rounded [steps], more than single precision loses where the grid's extent meets a ray's origin.
const MARGIN: f64 = 1.0 / 32.0;
/// Marks a leaf; below it five bits hold its triangles, the others the first of them. Without it a child's place follows.
const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 26;
/// Most triangles of a leaf: all five bits set would be [`NONE`] at the last triangle.
const MOST: u32 = 30;
/// Levels below the root that stay as they are. What is deeper, which only extremely uneven geometry has, becomes a leaf, and where it is too
/// large is halved as a list: at most 26 levels more, fewer than the shaders' stack of 64 has room for.
const LEVELS: u32 = 38;
/// A box that no ray enters: the child of a scene without triangles.
const NONE: [u32; 4] = [0, 0, 0, u32::MAX];

/// Lower and upper bounds in sixteen bits each, x, y and z, and what the node holds.
type Packed = [u32; 4];

/// The grid's origin and step in the first two elements, then the root, then pairs of children. `ranges` are the triangles below each node, first and
/// one past the last.
pub fn packed(nodes: &[Node], ranges: &[[u32; 2]]) -> Vec<Packed> {
    let Some(root) = nodes.first() else { return vec![NONE; 3] };
    let grid = Grid::of(root);
    let mut all = vec![bits(grid.origin), bits(grid.step), NONE];
    let tree = Tree { nodes, ranges };
    let mut open = vec![(Part::Node(0), 0, 2)];
    while let Some((part, level, place)) = open.pop() {
        let part = tree.leaf_if_small_or_deep(part, level);
        let [x, y, z] = grid.rounded(tree.bounds(&part));
        all[place] = [x, y, z, part.content(all.len() as u32)];
        if let Some(children) = tree.children(&part) {
            open.extend(children.into_iter().zip(all.len()..).map(|(child, place)| (child, level + 1, place)));
            all.extend([NONE; 2]);
        }
    }
    all
}

/// A node of the hierarchy, or triangles below one.
#[derive(Clone, Copy)]
enum Part {
    Node(usize),
    Triangles { below: usize, first: u32, count: u32 },
}

impl Part {
    /// What the packed node holds, if its children come next.
    fn content(&self, next: u32) -> u32 {
        match *self {
            Self::Triangles { first, count, .. } if count <= MOST => LEAF | count << COUNT_SHIFT | first,
            _ => next,
        }
    }
}

struct Tree<'a> {
    nodes: &'a [Node],
    ranges: &'a [[u32; 2]],
}

impl Tree<'_> {
    fn bounds(&self, part: &Part) -> &Node {
        let (Part::Node(node) | Part::Triangles { below: node, .. }) = *part;
        &self.nodes[node]
    }

    fn leaf_if_small_or_deep(&self, part: Part, level: u32) -> Part {
        match part {
            Part::Node(node) if self.nodes[node].count > 0 || level >= LEVELS => {
                let [first, end] = self.ranges[node];
                Part::Triangles { below: node, first, count: end - first }
            }
            other => other,
        }
    }

    fn children(&self, part: &Part) -> Option<[Part; 2]> {
        match *part {
            Part::Node(node) => Some([0, 1].map(|side| Part::Node(self.nodes[node].first as usize + side))),
            Part::Triangles { count, .. } if count <= MOST => None,
            Part::Triangles { below, first, count } => {
                let half = count / 2;
                Some([Part::Triangles { below, first, count: half }, Part::Triangles { below, first: first + half, count: count - half }])
            }
        }
    }
}

fn bits(v: Vec3) -> Packed {
    v.extend(0.0).to_array().map(f32::to_bits)
}

struct Grid {
    origin: Vec3,
    step: Vec3,
}

impl Grid {
    fn of(root: &Node) -> Self {
        let (low, high) = (Vec3::from(root.min), Vec3::from(root.max));
        // Some steps to spare, so that rounding outwards stays inside; an axis without extent has a step all the same.
        let extent = (high.as_dvec3() - low.as_dvec3()).max(DVec3::splat(1e-6 * f64::from(low.abs().max(high.abs()).max_element()).max(1e-30)));
        let step = (extent / (STEPS - 6.0)).as_vec3();
        Self { origin: (low.as_dvec3() - 2.0 * step.as_dvec3()).as_vec3(), step }
    }

    /// Lower bounds in the low sixteen bits, upper ones in the high.
    fn rounded(&self, node: &Node) -> [u32; 3] {
        let (origin, step) = (self.origin.as_dvec3(), self.step.as_dvec3());
        let low = ((Vec3::from(node.min).as_dvec3() - origin) / step - MARGIN).floor().clamp(DVec3::ZERO, DVec3::splat(STEPS));
        let high = ((Vec3::from(node.max).as_dvec3() - origin) / step + MARGIN).ceil().clamp(DVec3::ZERO, DVec3::splat(STEPS));
        [0, 1, 2].map(|axis| low[axis] as u32 | (high[axis] as u32) << 16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn leaf(min: [f32; 3], max: [f32; 3], first: u32, count: u32) -> Node {
        Node { min, max, first, count }
    }

    /// Lower and upper bounds as a shader computes them.
    fn bounds(all: &[Packed], node: Packed) -> [Vec3; 2] {
        let vector = |i: usize| Vec3::from_array([0, 1, 2].map(|axis| f32::from_bits(all[i][axis])));
        [0, 16].map(|shift| vector(0) + vector(1) * Vec3::from_array([0, 1, 2].map(|axis| (node[axis] >> shift & 0xffff) as f32)))
    }

    /// First triangle and number of triangles of every leaf, from left to right.
    fn leaves(all: &[Packed], content: u32) -> Vec<[u32; 2]> {
        if content & LEAF != 0 {
            return vec![[content & ((1 << COUNT_SHIFT) - 1), content >> COUNT_SHIFT & 31]];
        }
        [content, content + 1].into_iter().flat_map(|child| leaves(all, all[child as usize][3])).collect()
    }

    /// The longest way from a node to a leaf.
    fn depth(all: &[Packed], content: u32) -> u32 {
        if content & LEAF != 0 { 0 } else { 1 + [content, content + 1].map(|child| depth(all, all[child as usize][3])).into_iter().max().unwrap_or(0) }
    }

    #[test]
    fn leaves_keep_their_triangles_in_parts_that_fit() {
        let unit = |first, count| leaf([0.0; 3], [1.0; 3], first, count);
        let all = packed(&[unit(1, 0), unit(0, 3), unit(3, 100)], &[[0, 103], [0, 3], [3, 103]]);
        let found = leaves(&all, all[2][3]);
        assert!(found.iter().all(|[_, count]| (1..=MOST).contains(count)), "{found:?}");
        assert_eq!(found.iter().flat_map(|[first, count]| *first..first + count).collect::<Vec<_>>(), (0..103).collect::<Vec<_>>());
        let single = packed(&[unit(7, 2)], &[[7, 9]]);
        assert_eq!(leaves(&single, single[2][3]), [[7, 2]]);
        assert_eq!(packed(&[], &[]), [NONE; 3]);
    }

    #[test]
    fn hierarchies_of_any_depth_fit_the_stack() {
        // Each node has a leaf of one triangle and all the others.
        const TRIANGLES: u32 = 100_000;
        let unit = |first, count| leaf([0.0; 3], [1.0; 3], first, count);
        let (mut nodes, mut ranges) = (vec![unit(1, 0)], vec![[0, TRIANGLES]]);
        for i in 0..TRIANGLES - 1 {
            let rest = if i + 2 == TRIANGLES { unit(i + 1, 1) } else { unit(2 * i + 3, 0) };
            nodes.extend([unit(i, 1), rest]);
            ranges.extend([[i, i + 1], [i + 1, TRIANGLES]]);
        }
        let all = packed(&nodes, &ranges);
        let found = leaves(&all, all[2][3]);
        assert_eq!(found.iter().flat_map(|[first, count]| *first..first + count).collect::<Vec<_>>(), (0..TRIANGLES).collect::<Vec<_>>());
        assert!(depth(&all, all[2][3]) < 64, "{}", depth(&all, all[2][3]));
        assert!(all.len() as u32 <= 2 * TRIANGLES + 1);
    }

    proptest! {
        #[test]
        fn boxes_hold_what_they_held(
            offset in prop::array::uniform3(-1e6..1e6f32), scale in -20..20i32, at in prop::array::uniform3(0.0..1.0f32), size in prop::array::uniform3(0.0..0.1f32)
        ) {
            let unit = 2f32.powi(scale);
            let place = |v: Vec3| ((v * 1000.0 + Vec3::from(offset)) * unit).to_array();
            let (low, high) = (Vec3::from(at) * 0.9, Vec3::from(at) * 0.9 + Vec3::from(size));
            let nodes = [leaf(place(Vec3::ZERO), place(Vec3::ONE), 1, 0), leaf(place(low), place(high), 0, 1), leaf(place(Vec3::ZERO), place(Vec3::ONE), 1, 1)];
            let all = packed(&nodes, &[[0, 2], [0, 1], [1, 2]]);
            let [lower, upper] = bounds(&all, all[all[2][3] as usize]);
            let (min, max) = (Vec3::from(nodes[1].min), Vec3::from(nodes[1].max));
            prop_assert!(lower.cmple(min).all() && upper.cmpge(max).all(), "{lower} {min}, {max} {upper}");
            // Little more than a step, and what single precision has.
            let room = Vec3::from_array([0, 1, 2].map(|axis| f32::from_bits(all[1][axis]))) * 2.1 + min.abs().max(max.abs()) * 1e-6;
            prop_assert!((min - lower).cmple(room).all() && (upper - max).cmple(room).all(), "{lower} {min}, {max} {upper}");
        }
    }
}
