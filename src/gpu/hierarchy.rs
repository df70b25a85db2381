//! The scene's hierarchy as shaders read it: sixteen bytes a node and thirty-two a triangle. Loads decide how fast rays are where lanes of
//! one instruction walk to different nodes.

use crate::scene::{
    bvh::{Bvh, Node},
    model::{Bounds, Triangle},
    parts,
    stage::Stage,
};
use glam::{DVec3, Vec3};

/// Steps of the grid that boxes are rounded outwards to, along each axis of the scene.
const STEPS: f64 = 65535.0;
/// How much farther out a box is rounded [steps], more than corners are rounded, and than single precision loses where the grid's extent
/// meets a ray's origin.
const MARGIN: f64 = 1.0 / 32.0;
/// The scene's largest extent over the least that an axis' steps span, where it has less: what keeps `MARGIN` above the rounding of corners.
const FLATTEST: f64 = 256.0;
/// Steps of the grid that corners are rounded to, along every axis: 28 bits, sixteen times what single precision has at the extent.
const FINE_STEPS: f64 = 268_435_456.0;
/// Marks a leaf; below it five bits hold its triangles, the others the first of them. Without it a child's place follows.
const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 26;
/// Most triangles of a leaf: all five bits set would be [`NONE`] at the last triangle.
const MOST: u32 = 30;
/// How far around the scene the grid reaches where parts of it can move [extents].
const ROOM: f32 = 0.25;
/// Levels that the shaders' stack has room for.
const STACK: u32 = 63;
/// Levels below the root that stay as they are. What is deeper, which only extremely uneven geometry has, becomes a leaf, and where it is too
/// large is halved as a list: at most 26 levels more, fewer than the shaders' stack of 64 has room for.
const LEVELS: u32 = 38;
/// A box that no ray enters: the child of a scene without triangles.
const NONE: [u32; 4] = [0, 0, 0, u32::MAX];

/// Lower and upper bounds in sixteen bits each, x, y and z, and what the node holds.
type Packed = [u32; 4];

/// Elements of a hierarchy over so many triangles, at most.
pub fn most_elements(triangles: u64) -> u64 {
    2 * triangles.max(1) + 1 + 2 * triangles
}

/// The grid's origin with its unit, its steps with the place of the triangles, the root, pairs of children, then two elements a triangle. `ranges`
/// are the triangles below each node, first and one past the last.
pub fn packed(nodes: &[Node], ranges: &[[u32; 2]], triangles: &[Triangle]) -> Vec<Packed> {
    let Some(root) = nodes.first() else { return vec![NONE; 3] };
    let grid = Grid::of(&root.bounds());
    let mut all = vec![NONE; 3];
    let tree = Tree { nodes, ranges, levels: LEVELS };
    tree.pack(&grid, vec![(Part::Node(0), 0, 2)], 0, &mut all);
    let head = grid.head(all.len() as u32);
    all[..2].copy_from_slice(&head);
    all.extend(triangles.iter().flat_map(|triangle| grid.corners(triangle)));
    all
}

/// Where the parts of a hierarchy in two levels stand, so that each can be packed anew.
///
/// Elements are as in [`packed`]: the pairs of the upper level first, then those of each part.
pub struct Packing {
    grid: Grid,
    ranges: Vec<[u32; 2]>,
    /// Of each part the first element of its pairs.
    starts: Vec<u32>,
    triangles: u32,
}

/// Elements from a place on.
pub type Patch = (u32, Vec<Packed>);

impl Packing {
    /// None of a hierarchy in one level.
    pub fn new(bvh: &Bvh) -> Option<Self> {
        let parts = bvh.parts().filter(|parts| !parts.roots.is_empty())?;
        let grid = Grid::of(&bvh.bounds().grown(ROOM * bvh.bounds().diagonal()));
        let mut packing = Self { grid, ranges: bvh.ranges(), starts: Vec::new(), triangles: 0 };
        let mut end = 3 + 2 * (parts.roots.len() as u32 - 1);
        for root in &parts.roots {
            packing.starts.push(end);
            end += packing.pairs(bvh, *root as usize, end).len() as u32;
        }
        packing.triangles = end;
        Some(packing)
    }

    pub fn whole(&self, bvh: &Bvh, triangles: &[Triangle]) -> Vec<Packed> {
        let mut all = self.grid.head(self.triangles).to_vec();
        all.extend(self.upper(bvh).1);
        all.extend(bvh.roots().into_iter().zip(&self.starts).flat_map(|(root, start)| self.pairs(bvh, root, *start)));
        all.extend(self.corners(triangles, 0).1);
        all
    }

    /// What follows from movers that stand elsewhere: the level over all parts, and of each mover its pairs and its triangles.
    pub fn patches(&self, stage: &Stage, movers: &[usize]) -> Vec<Patch> {
        let Some(parts) = stage.bvh.parts().filter(|_| !movers.is_empty()) else { return Vec::new() };
        let of_mover = |mover: &usize| {
            let (triangles, part) = (stage.triangles_of(*mover), parts.movers[*mover].part);
            let start = self.starts[part];
            [(start, self.pairs(&stage.bvh, parts.roots[part] as usize, start)), self.corners(&stage.scene.triangles[triangles.clone()], triangles.start)]
        };
        std::iter::once(self.upper(&stage.bvh)).chain(movers.iter().flat_map(of_mover)).collect()
    }

    /// Whether the grid reaches as far as the scene.
    pub fn holds(&self, bounds: &Bounds) -> bool {
        let [low, high] = [bounds.min, bounds.max].map(|corner| self.grid.units(corner) / self.grid.step.as_dvec3());
        low.cmpge(DVec3::ONE).all() && high.cmple(DVec3::splat(STEPS - 1.0)).all() && self.grid.units(bounds.max).max_element() < 1.0
    }

    fn upper(&self, bvh: &Bvh) -> Patch {
        let Some(parts) = bvh.parts() else { return (2, Vec::new()) };
        let mut all = vec![NONE];
        let mut open = vec![(0, 0)];
        while let Some((index, place)) = open.pop() {
            let node: &Node = &parts.upper[index];
            let part = node.first as usize;
            let content = if node.count > 0 { self.content(bvh, parts.roots[part] as usize, self.starts[part]) } else { 2 + all.len() as u32 };
            all[place] = self.grid.node(node, content);
            if node.count == 0 {
                open.extend([0, 1].map(|side| (node.first as usize + side, all.len() + side)));
                all.extend([NONE; 2]);
            }
        }
        (2, all)
    }

    /// What the node of a part holds, whose pairs stand at `start`.
    fn content(&self, bvh: &Bvh, root: usize, start: u32) -> u32 {
        self.tree(bvh, root).top(root).content(start)
    }

    /// The pairs of a part, which stand at `start`.
    fn pairs(&self, bvh: &Bvh, root: usize, start: u32) -> Vec<Packed> {
        let tree = self.tree(bvh, root);
        let mut all = Vec::new();
        if let Some(children) = tree.children(&tree.top(root)) {
            all.extend([NONE; 2]);
            tree.pack(&self.grid, children.into_iter().zip(0..).map(|(child, place)| (child, 1, place)).collect(), start, &mut all);
        }
        all
    }

    /// The stack that the levels above, those below and the halves of the lists at their end take together is no larger than that of a hierarchy in one level.
    fn tree<'a>(&'a self, bvh: &'a Bvh, root: usize) -> Tree<'a> {
        let [first, end] = self.ranges[root];
        let halvings = ((end - first).div_ceil(MOST)).next_power_of_two().ilog2() + 1;
        Tree { nodes: bvh.nodes(), ranges: &self.ranges, levels: STACK - parts::LEVELS - halvings }
    }

    /// Triangles from the first of these on.
    fn corners(&self, triangles: &[Triangle], first: usize) -> Patch {
        (self.triangles + 2 * first as u32, triangles.iter().flat_map(|triangle| self.grid.corners(triangle)).collect())
    }
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
    /// Below the root, that stay as they are.
    levels: u32,
}

impl Tree<'_> {
    /// Packs parts, each with its level and place, and what is below them; the first element is said to stand at `base`.
    fn pack(&self, grid: &Grid, mut open: Vec<(Part, u32, usize)>, base: u32, all: &mut Vec<Packed>) {
        while let Some((part, level, place)) = open.pop() {
            let part = self.leaf_if_small_or_deep(part, level);
            all[place] = grid.node(self.bounds(&part), part.content(base + all.len() as u32));
            if let Some(children) = self.children(&part) {
                open.extend(children.into_iter().zip(all.len()..).map(|(child, place)| (child, level + 1, place)));
                all.extend([NONE; 2]);
            }
        }
    }

    /// What stands for a root.
    fn top(&self, root: usize) -> Part {
        self.leaf_if_small_or_deep(Part::Node(root), 0)
    }

    fn bounds(&self, part: &Part) -> &Node {
        let (Part::Node(node) | Part::Triangles { below: node, .. }) = *part;
        &self.nodes[node]
    }

    fn leaf_if_small_or_deep(&self, part: Part, level: u32) -> Part {
        match part {
            Part::Node(node) if self.nodes[node].count > 0 || level >= self.levels => {
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

fn bits(v: Vec3, last: u32) -> Packed {
    let [x, y, z] = v.to_array().map(f32::to_bits);
    [x, y, z, last]
}

struct Grid {
    origin: Vec3,
    /// The scene's largest extent, in which shaders measure while they walk: products of lengths neither overflow nor vanish.
    unit: f32,
    /// Of boxes [units].
    step: Vec3,
}

impl Grid {
    fn of(bounds: &Bounds) -> Self {
        let (low, high) = (bounds.min, bounds.max);
        let extent = high.as_dvec3() - low.as_dvec3();
        // A scene without extent has a unit all the same.
        let largest = extent.max_element().max(1e-6 * f64::from(low.abs().max(high.abs()).max_element()).max(1e-30));
        // Some steps to spare, so that rounding outwards stays inside.
        let step = extent.max(DVec3::splat(largest / FLATTEST)) / (STEPS - 6.0);
        let origin = (low.as_dvec3() - 2.0 * step).as_vec3();
        // Room for the corners above their origin.
        let unit = (largest * 1.001) as f32;
        Self { origin, unit, step: (step / f64::from(unit)).as_vec3() }
    }

    /// What stands before the nodes; `triangles` is where those begin.
    fn head(&self, triangles: u32) -> [Packed; 2] {
        [bits(self.origin, self.unit.to_bits()), bits(self.step, triangles)]
    }

    fn node(&self, node: &Node, content: u32) -> Packed {
        let [x, y, z] = self.rounded(node);
        [x, y, z, content]
    }

    /// Lower bounds in the low sixteen bits, upper ones in the high.
    fn rounded(&self, node: &Node) -> [u32; 3] {
        let steps = |bound: [f32; 3]| self.units(Vec3::from(bound)) / self.step.as_dvec3();
        let low = (steps(node.min) - MARGIN).floor().clamp(DVec3::ZERO, DVec3::splat(STEPS));
        let high = (steps(node.max) + MARGIN).ceil().clamp(DVec3::ZERO, DVec3::splat(STEPS));
        [0, 1, 2].map(|axis| low[axis] as u32 | (high[axis] as u32) << 16)
    }

    /// Nine coordinates of 28 bits: eight stand above the four bits of a word that, from the lowest on, seven of the words have of the ninth.
    fn corners(&self, triangle: &Triangle) -> [Packed; 2] {
        let [a, b, c] =
            triangle.positions.map(|p| (self.units(p) * FINE_STEPS).round().clamp(DVec3::ZERO, DVec3::splat(FINE_STEPS - 1.0)).as_uvec3().to_array());
        let word = |i: u32, coordinate: u32| coordinate << 4 | c[2] >> (4 * i) & 15;
        [[word(0, a[0]), word(1, a[1]), word(2, a[2]), word(3, b[0])], [word(4, b[1]), word(5, b[2]), word(6, c[0]), c[1] << 4]]
    }

    fn units(&self, position: Vec3) -> DVec3 {
        (position.as_dvec3() - self.origin.as_dvec3()) / f64::from(self.unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Material, Object, Scene, stage::Change};
    use glam::DAffine3;
    use proptest::prelude::*;

    fn triangle(positions: [Vec3; 3]) -> Triangle {
        Triangle { positions, normals: [Vec3::Y; 3], uvs: [glam::Vec2::ZERO; 3], tints: Default::default(), material: 0 }
    }

    /// A triangle's corners [units] as a shader reads them.
    fn corners(words: [Packed; 2]) -> [DVec3; 3] {
        let [x, y] = words;
        let words = [x, y].concat();
        let last = (0..7).map(|i| (words[i] & 15) << (4 * i)).sum();
        let coordinates = [x.map(|w| w >> 4), y.map(|w| w >> 4)].concat();
        let at = |i: usize| if i < 8 { coordinates[i] } else { last };
        [0, 3, 6].map(|i| DVec3::new(at(i).into(), at(i + 1).into(), at(i + 2).into()) / FINE_STEPS)
    }

    fn leaf(min: [f32; 3], max: [f32; 3], first: u32, count: u32) -> Node {
        Node { min, max, first, count }
    }

    fn vector(all: &[Packed], element: usize) -> Vec3 {
        Vec3::from_array([0, 1, 2].map(|axis| f32::from_bits(all[element][axis])))
    }

    /// Lower and upper bounds [units] as a shader computes them.
    fn bounds(all: &[Packed], node: Packed) -> [Vec3; 2] {
        [0, 16].map(|shift| vector(all, 1) * Vec3::from_array([0, 1, 2].map(|axis| (node[axis] >> shift & 0xffff) as f32)))
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
        let all = packed(&[unit(1, 0), unit(0, 3), unit(3, 100)], &[[0, 103], [0, 3], [3, 103]], &[]);
        let found = leaves(&all, all[2][3]);
        assert!(found.iter().all(|[_, count]| (1..=MOST).contains(count)), "{found:?}");
        assert_eq!(found.iter().flat_map(|[first, count]| *first..first + count).collect::<Vec<_>>(), (0..103).collect::<Vec<_>>());
        let single = packed(&[unit(7, 2)], &[[7, 9]], &[]);
        assert_eq!(leaves(&single, single[2][3]), [[7, 2]]);
        assert_eq!(packed(&[], &[], &[]), [NONE; 3]);
    }

    /// What is patched is what is packed anew, and holds every triangle once.
    #[test]
    fn parts_are_packed_anew_one_by_one() {
        let quad = |at: f32| Triangle { ..triangle([Vec3::new(at, 0.0, 0.0), Vec3::new(at + 1.0, 0.0, at % 7.0), Vec3::new(at, 1.0, at % 3.0)]) };
        let scene =
            Scene { triangles: (0..3000).map(|k| quad(k as f32 / 10.0)).collect(), materials: vec![Material::diffuse("", Vec3::ONE)], ..Scene::default() };
        let objects = [100..400, 401..402, 2000..3000].map(|triangles| Object { name: String::new(), triangles });
        let mut stage = Stage::moving(Scene { objects: objects.into(), ..scene }, &[0, 1, 2]).unwrap();
        let packing = Packing::new(&stage.bvh).unwrap();
        let mut all = packing.whole(&stage.bvh, &stage.scene.triangles);
        assert!(all.len() as u64 <= most_elements(3000));
        for (mover, shift) in [(0, DVec3::Y), (2, DVec3::new(-20.0, 1.0, 0.0)), (1, DVec3::Z)] {
            let changed = stage.change(&[Change::Place { mover, map: DAffine3::from_translation(shift) }]).unwrap();
            assert!(packing.holds(&stage.bounds()));
            for (first, elements) in packing.patches(&stage, &changed.movers) {
                all[first as usize..first as usize + elements.len()].copy_from_slice(&elements);
            }
            assert!(all == packing.whole(&stage.bvh, &stage.scene.triangles), "mover {mover}");
            let mut held: Vec<u32> = leaves(&all, all[2][3]).into_iter().flat_map(|[first, count]| first..first + count).collect();
            held.sort_unstable();
            assert_eq!(held, (0..3000).collect::<Vec<_>>());
            assert!(depth(&all, all[2][3]) < 64);
        }
        stage.change(&[Change::Place { mover: 1, map: DAffine3::from_translation(DVec3::X * 900.0) }]).unwrap();
        assert!(!packing.holds(&stage.bounds()));
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
        let all = packed(&nodes, &ranges, &[]);
        let found = leaves(&all, all[2][3]);
        assert_eq!(found.iter().flat_map(|[first, count]| *first..first + count).collect::<Vec<_>>(), (0..TRIANGLES).collect::<Vec<_>>());
        assert!(depth(&all, all[2][3]) < 64, "{}", depth(&all, all[2][3]));
        assert!(all.len() as u32 <= 2 * TRIANGLES + 1);
    }

    proptest! {
        #[test]
        fn boxes_hold_the_corners_of_their_triangles(
            offset in prop::array::uniform3(-1.0..1.0f32), far in 0..20i32, scale in -20..20i32, flat in prop::array::uniform3(prop::bool::ANY),
            at in prop::array::uniform3(0.0..1.0f32), size in prop::array::uniform3(0.0..0.1f32)
        ) {
            let (far, scale) = (2f32.powi(far), 2f32.powi(scale));
            let flat = Vec3::from_array(flat.map(|flat| if flat { 1e-7 } else { 1.0 }));
            let place = |v: Vec3| (v * flat * 1000.0 + Vec3::from(offset) * far) * scale;
            let (low, high) = (place(Vec3::from(at) * 0.9), place(Vec3::from(at) * 0.9 + Vec3::from(size)));
            let root = leaf(place(Vec3::ZERO).to_array(), place(Vec3::ONE).to_array(), 1, 0);
            let nodes = [root, leaf(low.to_array(), high.to_array(), 0, 1), leaf(root.min, root.max, 1, 1)];
            let positions = [low, high, low.lerp(high, 0.3).clamp(low, high)];
            let all = packed(&nodes, &[[0, 2], [0, 1], [1, 2]], &[triangle([low; 3]), triangle(positions)]);
            let [lower, upper] = bounds(&all, all[all[2][3] as usize]).map(|bound| bound.as_dvec3());
            let step = vector(&all, 1).as_dvec3();
            let first = all[1][3] as usize;
            prop_assert_eq!(all.len(), first + 4);
            let (origin, unit) = (vector(&all, 0).as_dvec3(), f64::from(f32::from_bits(all[0][3])));
            for (corner, position) in corners([all[first + 2], all[first + 3]]).into_iter().zip(positions) {
                prop_assert!(lower.cmple(corner).all() && upper.cmpge(corner).all(), "{lower} {corner} {upper}");
                let exact = (position.as_dvec3() - origin) / unit;
                prop_assert!((corner - exact).abs().max_element() <= 0.51 / FINE_STEPS, "{corner}, not {exact}");
            }
            // Little more than a step on either side.
            let size = (high.as_dvec3() - low.as_dvec3()) / unit;
            prop_assert!((upper - lower - size).cmple(2.2 * step).all(), "{lower} to {upper} for {size}");
        }
    }
}
