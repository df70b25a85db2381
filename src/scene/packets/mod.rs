//! Many rays from one point, as the CPU casts them: 64 neighbours walk the hierarchy together and share what does not depend on a direction.
//! At each node a vector instruction compares one ray with eight boxes, in each leaf with eight triangles: triangles are smaller than the distance
//! between rays, so that deep in the hierarchy few rays are left of a packet.
//!
//! Lengths are in extents of the scene, from its centre: the unit of length does not matter.

mod shadow;

pub use shadow::{ALMOST, ShadowRays, ToDo, Until};

use super::{
    bvh::{Node, is_hole, is_seen},
    model::{Bounds, Scene, surface_offset},
    parts::{Laid, Parts},
    wide::{Candidate, open},
};
use crate::math::{
    frame::Frame,
    hemisphere::Table,
    vectors::{LANES, Vectors},
};
use fearless_simd::{Level, Simd, dispatch, f32x8, prelude::*, u8x64, u32x8};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// Most rays of a packet.
pub const RAYS: usize = 64;
/// Triangles of a block. A leaf takes as long with one triangle as with a whole block.
pub(super) const BLOCK: usize = 8;
/// Children of a node.
const CHILDREN: usize = 8;
/// Marks a child as the number of a block of triangles, not of a node.
const LEAF: u32 = 1 << 31;
/// Boxes are wider by what rounding may take from their distances [extents], for rays that start within seven extents.
const ROUNDING: f32 = 2e-6;
const FARTHEST: f32 = 7.0;
/// Direction components below this are taken as this.
const LEAST_DIRECTION: f32 = 1e-12;
/// Farther than anything [extents].
const FAR_AWAY: f32 = 1e9;

/// Eight children by axis.
#[derive(Clone)]
#[repr(align(64))]
struct Node8 {
    centres: [[f32; CHILDREN]; 3],
    /// Half their sizes; far below 0 where there is no child.
    halves: [[f32; CHILDREN]; 3],
    contents: [u32; CHILDREN],
}

/// Up to eight triangles that are neighbours in the scene.
#[derive(Clone)]
struct Block {
    /// Corner, axis, triangle; places that are not taken are triangles without area, which nothing meets.
    corners: [[[f32; BLOCK]; 3]; 3],
    first: u32,
    count: u32,
    /// Whether the next block belongs to the same leaf.
    goes_on: bool,
    /// Whether any of the triangles is one-sided or may have holes.
    is_special: bool,
    has_holes: bool,
}

/// The hierarchy that packets walk.
#[derive(Clone)]
pub struct Packets {
    nodes: Vec<Node8>,
    blocks: Vec<Block>,
    /// A node, or a leaf's first block.
    root: Option<u32>,
    centre: Vec3,
    /// Extents in a unit of length, as it was built.
    scale: f32,
    /// Of the scene [scene units].
    extent: f32,
    /// Where parts of the scene can move.
    parts: Option<Laid<u32, CHILDREN>>,
}

/// The directions of a tile's samples in packets of neighbours, in the tile's frame.
pub struct RayBundle {
    packets: Vec<Directions>,
    /// Samples of the tile.
    pub samples: usize,
}

struct Directions {
    rays: [Vec3; RAYS],
    /// Which sample of the tile a ray is; `u32::MAX` for none.
    samples: [u32; RAYS],
    /// Their mean.
    middle: Vec3,
}

impl RayBundle {
    /// Samples without weight have no ray.
    pub fn new(table: &Table) -> Self {
        let [width, height] = blocks([table.width, table.height]);
        let rows = (0..table.height).step_by(height).map(|y| y..(y + height as u32).min(table.height));
        let columns = || (0..table.width).step_by(width).map(|x| x..(x + width as u32).min(table.width));
        let packets = rows.flat_map(|rows| columns().filter_map(move |columns| Directions::new(table, columns, rows.clone())));
        Self { packets: packets.collect(), samples: table.samples.len() }
    }

    /// Of any directions, of which those next to each other should be neighbours.
    pub fn of(directions: &[Vec3]) -> Self {
        let packets = directions.chunks(RAYS).zip((0..).step_by(RAYS)).map(|(rays, first)| Directions::of(rays, first..));
        Self { packets: packets.collect(), samples: directions.len() }
    }

    /// Of its samples, in their order if it was made of a list.
    #[cfg(test)]
    pub fn directions(&self) -> impl Iterator<Item = Vec3> {
        let rays = self.packets.iter().flat_map(|packet| packet.samples.iter().zip(packet.rays));
        rays.filter(|(sample, _)| **sample != u32::MAX).map(|(_, ray)| ray)
    }
}

impl Directions {
    const NONE: Self = Self { rays: [Vec3::ZERO; RAYS], samples: [u32::MAX; RAYS], middle: Vec3::ZERO };

    fn of(rays: &[Vec3], samples: impl IntoIterator<Item = u32>) -> Self {
        let mut packet = Self { middle: rays.iter().sum::<Vec3>().normalize_or_zero(), ..Self::NONE };
        packet.rays[..rays.len()].copy_from_slice(rays);
        packet.samples[..rays.len()].iter_mut().zip(samples).for_each(|(sample, number)| *sample = number);
        packet
    }

    /// Of a block of samples; None where none of them has a ray.
    fn new(table: &Table, columns: Range<u32>, rows: Range<u32>) -> Option<Self> {
        let all = rows.flat_map(|y| columns.clone().map(move |x| y * table.width + x));
        let with_ray = all.map(|index| (index, &table.samples[index as usize])).filter(|(_, sample)| sample.plain_weight > 0.0);
        let (samples, rays): (Vec<u32>, Vec<Vec3>) = with_ray.map(|(index, sample)| (index, Vec3::from(sample.direction.map(|d| d as f32)))).unzip();
        (!rays.is_empty()).then(|| Self::of(&rays, samples))
    }
}

/// Width and height of blocks that cover a tile with the fewest packets: the squarest of those, as neighbours see what is alike.
fn blocks(size: [u32; 2]) -> [usize; 2] {
    let most = RAYS as u32;
    let widths = (1..=size[0]).map(|columns| (columns, size[0].div_ceil(columns))).filter(|(_, width)| *width <= most);
    let all = widths.map(|(columns, width)| {
        let rows = size[1].div_ceil(most / width);
        let height = size[1].div_ceil(rows);
        (columns * rows, width.abs_diff(height), [width, height])
    });
    all.min().map_or([1; 2], |(_, _, block)| block.map(|edge| edge as usize))
}

/// A node that is still to be made.
struct Unopened {
    /// Of the binary tree.
    children: Vec<usize>,
    /// Whose child it is, and which; None for the root.
    parent: Option<(usize, usize)>,
}

impl Packets {
    /// Over the binary hierarchy's nodes and the triangles that it has sorted, which have these bounds.
    pub fn new(nodes: &[Node], parts: Option<&Parts>, scene: &Scene, bounds: &Bounds) -> Self {
        let (centre, scale) = (bounds.centre(), scale(bounds));
        let mut packets = Self { nodes: Vec::new(), blocks: Vec::new(), root: None, centre, scale, extent: 1.0 / scale, parts: None };
        let Some(parts) = parts else {
            packets.root = (!nodes.is_empty()).then(|| packets.tree(nodes, 0, |packets, leaf| packets.leaf(leaf, scene), &mut Vec::new()));
            return packets;
        };
        let sizes = |packets: &Self| [packets.nodes.len(), packets.blocks.len()];
        let lay = |packets: &mut Self, root, sources: &mut _| packets.tree(nodes, root, |packets, leaf| packets.leaf(leaf, scene), sources);
        packets.parts = Some(Laid::new(parts, &mut packets, sizes, lay));
        packets.join(parts);
        packets
    }

    /// The same with movers, and the level over all parts, where they stand now. None where the bounds are so different that all must be made anew.
    pub fn follow(mut self, nodes: &[Node], parts: &Parts, movers: &[usize], scene: &Scene, bounds: &Bounds) -> Option<Self> {
        let now = bounds.diagonal() * self.scale;
        if (self.inside(bounds.centre())).length() > 0.5 || !(0.5..2.0).contains(&now) {
            return None;
        }
        self.extent = 1.0 / scale(bounds);
        let of = self.parts.take()?;
        for [range, blocks] in movers.iter().map(|mover| &of.movers[*mover]) {
            for node in range.clone() {
                of.children(node).for_each(|(slot, child)| self.place(node, slot, &nodes[child]));
            }
            for at in blocks.clone() {
                let Block { first, count, goes_on, .. } = self.blocks[at];
                self.blocks[at] = Block { goes_on, ..self.block(scene, first, count) };
            }
        }
        self.parts = Some(of);
        self.join(parts);
        Some(self)
    }

    fn join(&mut self, parts: &Parts) {
        let Some(of) = self.parts.take() else { return };
        self.nodes.truncate(of.upper);
        self.root = (!parts.upper.is_empty()).then(|| self.tree(&parts.upper, 0, |_, leaf| of.roots[leaf.first as usize], &mut Vec::new()));
        self.parts = Some(of);
    }

    /// What stands for a binary tree below one of its nodes; `leaf` for a leaf of it. Of each new node the children's places in the tree are added.
    fn tree(&mut self, nodes: &[Node], root: usize, mut leaf: impl FnMut(&mut Self, &Node) -> u32, sources: &mut Vec<[u32; CHILDREN]>) -> u32 {
        let first = self.nodes.len();
        let children = if nodes[root].count > 0 { vec![root] } else { open(nodes, root, CHILDREN) };
        // An explicit list rather than recursion: a degenerate hierarchy may be deep. Nodes stand in the order of a walk.
        let mut unopened = vec![Unopened { children, parent: None }];
        while let Some(Unopened { children, parent }) = unopened.pop() {
            let place = self.nodes.len();
            if let Some((parent, slot)) = parent {
                self.nodes[parent].contents[slot] = place as u32;
            }
            self.nodes.push(Node8 { centres: [[0.0; CHILDREN]; 3], halves: [[-FAR_AWAY; CHILDREN]; 3], contents: [0; CHILDREN] });
            let mut of_node = [u32::MAX; CHILDREN];
            for (slot, at) in children.iter().enumerate() {
                let child = &nodes[*at];
                of_node[slot] = *at as u32;
                self.place(place, slot, child);
                if child.count > 0 {
                    self.nodes[place].contents[slot] = leaf(self, child);
                }
            }
            sources.push(of_node);
            let inner = children.iter().enumerate().rev().filter(|(_, at)| nodes[**at].count == 0);
            unopened.extend(inner.map(|(slot, at)| Unopened { children: open(nodes, *at, CHILDREN), parent: Some((place, slot)) }));
        }
        first as u32
    }

    /// Says where a child of a node is.
    fn place(&mut self, node: usize, slot: usize, child: &Node) {
        let (min, max) = (self.inside(child.min.into()), self.inside(child.max.into()));
        let node = &mut self.nodes[node];
        for axis in 0..3 {
            node.centres[axis][slot] = 0.5 * (min[axis] + max[axis]);
            node.halves[axis][slot] = 0.5 * (max[axis] - min[axis]) + ROUNDING;
        }
    }

    fn leaf(&mut self, leaf: &Node, scene: &Scene) -> u32 {
        let place = self.blocks.len() as u32;
        for k in (0..leaf.count).step_by(BLOCK) {
            let count = (leaf.count - k).min(BLOCK as u32);
            let block = self.block(scene, leaf.first + k, count);
            self.blocks.push(Block { goes_on: k + count < leaf.count, ..block });
        }
        LEAF | place
    }

    fn block(&self, scene: &Scene, first: u32, count: u32) -> Block {
        let triangles = &scene.triangles[first as usize..(first + count) as usize];
        let mut corners = [[[0.0; BLOCK]; 3]; 3];
        for (lane, triangle) in triangles.iter().enumerate() {
            for (corner, position) in corners.iter_mut().zip(triangle.positions) {
                for (axis, value) in corner.iter_mut().zip(self.inside(position).to_array()) {
                    axis[lane] = value;
                }
            }
        }
        let mut materials = triangles.iter().map(|t| &scene.materials[t.material as usize]);
        let has_holes = materials.clone().any(|material| material.alpha_cutoff.is_some() && material.texture.is_some());
        Block { corners, first, count, goes_on: false, is_special: has_holes || materials.any(|material| !material.two_sided), has_holes }
    }

    /// In extents from the centre.
    fn inside(&self, point: Vec3) -> Vec3 {
        (point - self.centre) * self.scale
    }

    /// For each sample of each view what `eye` makes of the triangle that it sees: one-sided surfaces are seen from their front only,
    /// holes of alpha-masked textures not at all. Samples without a ray see nothing.
    pub fn trace<E: HitShader>(&self, scene: &Scene, views: &[View], bundle: &RayBundle, shader: &E, seen: &mut [E::Seen]) {
        seen.par_chunks_exact_mut(bundle.samples).zip(views).enumerate().for_each_init(Vec::new, |stack, (index, (seen, view))| {
            self.trace_view(scene, (index, view), bundle, shader, stack, seen);
        });
    }

    /// The same with rays of its own for each view, whose number `made` takes with what it sees.
    pub fn trace_own<E: HitShader, T: Send>(
        &self,
        scene: &Scene,
        views: &[View],
        bundles: &[&RayBundle],
        shader: &E,
        made: impl Fn(usize, Vec<E::Seen>) -> T + Sync,
    ) -> Vec<T> {
        let each = views.par_iter().zip(bundles).enumerate();
        let seen = each.map_init(Vec::new, |stack, (index, (view, bundle))| {
            let mut seen = vec![E::NOTHING; bundle.samples];
            self.trace_view(scene, (index, view), bundle, shader, stack, &mut seen);
            made(index, seen)
        });
        seen.collect()
    }

    fn trace_view<E: HitShader>(
        &self,
        scene: &Scene,
        (index, view): (usize, &View),
        bundle: &RayBundle,
        shader: &E,
        stack: &mut Vec<Visit>,
        seen: &mut [E::Seen],
    ) {
        seen.fill(E::NOTHING);
        let start = view.position + view.frame.normal * surface_offset(self.extent, view.position);
        let origin = self.inside(start).clamp(Vec3::splat(-FARTHEST), Vec3::splat(FARTHEST));
        let walker = Walker { packets: self, scene, origin };
        let from = Start { view: index, place: start, frame: &view.frame };
        dispatch!(Level::new(), simd => walker.trace(simd, &from, bundle, shader, stack, seen));
    }
}

/// Extents in a unit of length.
fn scale(bounds: &Bounds) -> f32 {
    1.0 / bounds.diagonal().max(f32::MIN_POSITIVE)
}

/// Where the rays of a tile start, off the surface.
struct Start<'a> {
    /// Of the list of views.
    view: usize,
    place: Vec3,
    frame: &'a Frame,
}

/// What the rays of a packet met.
pub struct Hits<'a> {
    /// Of the list of views.
    pub view: usize,
    /// Where the rays start.
    pub origin: Vec3,
    /// Which sample of the tile a ray is; `u32::MAX` for none.
    pub samples: &'a [u32; RAYS],
    /// Unit vectors.
    pub directions: &'a [Vec3; RAYS],
    /// Which triangle each met, + 1, or 0.
    pub triangles: &'a [u32; RAYS],
}

/// What becomes of what rays meet.
pub trait HitShader: Sync {
    type Seen: Copy + Send;
    const NOTHING: Self::Seen;

    /// Puts what a packet sees into its places of a tile. To be inlined always.
    fn shade<S: Simd>(&self, simd: S, hits: &Hits<'_>, tile: &mut [Self::Seen]);
}

/// Sees the numbers of triangles, + 1, or 0.
pub struct Numbers;

impl HitShader for Numbers {
    type Seen = u32;
    const NOTHING: u32 = 0;

    #[inline(always)]
    fn shade<S: Simd>(&self, _simd: S, hits: &Hits<'_>, tile: &mut [u32]) {
        for (&sample, &triangle) in hits.samples.iter().zip(hits.triangles) {
            if sample != u32::MAX {
                tile[sample as usize] = triangle;
            }
        }
    }
}

/// Where a tile's rays start, off the surface, and how it stands.
pub struct View {
    pub position: Vec3,
    pub frame: Frame,
}

struct Walker<'a> {
    packets: &'a Packets,
    scene: &'a Scene,
    origin: Vec3,
}

/// The rays of a packet, each by its place.
struct Rays {
    direction: [Vec3; RAYS],
    inverse: [Vec3; RAYS],
    middle: Vec3,
    /// A bit for each that there is.
    all: u64,
    /// Distance of the nearest triangle met so far [extents]; 0 of a ray that there is not.
    limit: [f32; RAYS],
    /// Which it is, + 1, or 0.
    seen: [u32; RAYS],
}

/// What is still to be visited: a child, the rays that enter it, and how far at least it is from the origin.
struct Visit {
    near: f32,
    rays: u64,
    content: u32,
}

/// A block's triangles as seen from the origin.
struct SeenBlock<S: Simd> {
    /// The normals of the planes through the origin and an edge: their products with a direction have one sign if it meets the triangle.
    edges: [Vectors<S>; 3],
    /// Twice as long as the area.
    normal: Vectors<S>,
    /// Products of a corner with it.
    heights: f32x8<S>,
}

/// Which of a block's triangles a ray meets, a bit for each, and where.
struct Meeting<S: Simd> {
    lanes: u32,
    distance: f32x8<S>,
    v: f32x8<S>,
    w: f32x8<S>,
    sum: f32x8<S>,
}

// All that runs within `dispatch!` is inlined into it, closures too: what is not would not have its vector instructions.
impl Walker<'_> {
    #[inline(always)]
    fn trace<S: Simd, E: HitShader>(&self, simd: S, from: &Start<'_>, bundle: &RayBundle, shader: &E, stack: &mut Vec<Visit>, seen: &mut [E::Seen]) {
        for packet in &bundle.packets {
            let mut rays = Rays::new(from.frame, packet);
            self.walk(simd, &mut rays, stack);
            let hits = Hits { view: from.view, origin: from.place, samples: &packet.samples, directions: &rays.direction, triangles: &rays.seen };
            shader.shade(simd, &hits, seen);
        }
    }

    #[inline(always)]
    fn walk<S: Simd>(&self, simd: S, rays: &mut Rays, stack: &mut Vec<Visit>) {
        // Of the farthest ray.
        let mut limit = FAR_AWAY;
        stack.extend(self.packets.root.map(|content| Visit { near: 0.0, rays: rays.all, content }));
        while let Some(visit) = stack.pop() {
            if visit.near > limit {
                continue;
            }
            if visit.content & LEAF == 0 {
                self.enter(simd, &visit, rays, stack);
            } else if self.meet_leaf(simd, &visit, rays) {
                limit = rays.farthest(simd);
            }
        }
    }

    /// Puts the children of a node that rays enter on the stack, the nearest on top.
    #[inline(always)]
    fn enter<S: Simd>(&self, simd: S, visit: &Visit, rays: &Rays, stack: &mut Vec<Visit>) {
        let node = &self.packets.nodes[visit.content as usize];
        let (centre, half) = (self.relative(simd, &node.centres), Vectors::load(simd, &node.halves));
        let zero = f32x8::splat(simd, 0.0);
        let (mut entered, mut slots) = ([0u8; RAYS], 0);
        let mut left = visit.rays;
        while left != 0 {
            let ray = left.trailing_zeros() as usize % RAYS;
            left &= left - 1;
            let [x, y, z] = rays.inverse[ray].to_array();
            let (wide, tall, deep) = (half.x * x.abs(), half.y * y.abs(), half.z * z.abs());
            let near = centre.x.mul_sub(x, wide).max(centre.y.mul_sub(y, tall)).max(centre.z.mul_sub(z, deep).max(zero));
            let far = centre.x.mul_add(x, wide).min(centre.y.mul_add(y, tall)).min(centre.z.mul_add(z, deep).min(rays.limit[ray]));
            let mask = near.simd_le(far).to_bitmask() as u32;
            slots |= mask;
            entered[ray] = mask as u8;
        }
        let middle = rays.middle;
        let near = (centre.product(middle) - half.product(middle.abs())).to_array();
        let entered = u8x64::load_array(simd, entered);
        let from = stack.len();
        while slots != 0 {
            let slot = slots.trailing_zeros() as usize % CHILDREN;
            slots &= slots - 1;
            let bit = u8x64::splat(simd, 1 << slot);
            let into = (entered & bit).simd_eq(bit).to_bitmask();
            let visit = Visit { near: near[slot], rays: into, content: node.contents[slot] };
            let nearer = stack[from..].iter().rev().take_while(|other| other.near < visit.near).count();
            stack.insert(stack.len() - nearer, visit);
        }
    }

    /// Whether any ray has met a triangle of a leaf.
    #[inline(always)]
    fn meet_leaf<S: Simd>(&self, simd: S, visit: &Visit, rays: &mut Rays) -> bool {
        let (mut place, mut hits) = ((visit.content & !LEAF) as usize, false);
        loop {
            let block = &self.packets.blocks[place];
            let seen = self.seen_block(simd, block);
            let mut left = visit.rays;
            while left != 0 {
                hits |= self.meet(simd, block, &seen, rays, left.trailing_zeros() as usize % RAYS);
                left &= left - 1;
            }
            if !block.goes_on {
                return hits;
            }
            place += 1;
        }
    }

    #[inline(always)]
    fn seen_block<S: Simd>(&self, simd: S, block: &Block) -> SeenBlock<S> {
        let [a, b, c] = &block.corners;
        let (a, b, c) = (self.relative(simd, a), self.relative(simd, b), self.relative(simd, c));
        let normal = b.minus(a).cross(c.minus(a));
        let heights = a.x * normal.x + a.y * normal.y + a.z * normal.z;
        // An edge that two triangles share has opposite normals in them, to the bit: no ray passes between.
        SeenBlock { edges: [b.cross(c), c.cross(a), a.cross(b)], normal, heights }
    }

    #[inline(always)]
    fn relative<S: Simd>(&self, simd: S, points: &[[f32; 8]; 3]) -> Vectors<S> {
        let points = Vectors::load(simd, points);
        Vectors { x: points.x - self.origin.x, y: points.y - self.origin.y, z: points.z - self.origin.z }
    }

    /// Whether a ray has met a triangle of a block. Of two at the same distance the first in the scene's order is seen, so that the order of
    /// the walk does not show.
    #[inline(always)]
    fn meet<S: Simd>(&self, simd: S, block: &Block, seen: &SeenBlock<S>, rays: &mut Rays, ray: usize) -> bool {
        let meeting = seen.meet(simd, rays.direction[ray], rays.limit[ray]);
        let mut left = meeting.lanes;
        let mut any = false;
        while left != 0 {
            let lane = left.trailing_zeros() as usize % BLOCK;
            left &= left - 1;
            let (distance, number) = (meeting.distance[lane], block.first + lane as u32 + 1);
            let is_nearer = distance < rays.limit[ray] || (distance == rays.limit[ray] && number < rays.seen[ray]);
            if is_nearer && (!block.is_special || is_seen(self.scene, &meeting.candidate(block, lane))) {
                (rays.limit[ray], rays.seen[ray], any) = (distance, number, true);
            }
        }
        any
    }
}

impl<S: Simd> SeenBlock<S> {
    /// The triangles that a ray meets no farther than `limit`.
    #[inline(always)]
    fn meet(&self, simd: S, direction: Vec3, limit: f32) -> Meeting<S> {
        let [u, v, w] = [self.edges[0].product(direction), self.edges[1].product(direction), self.edges[2].product(direction)];
        let sum = u + v + w;
        let sign = sum.to_bits() & u32x8::splat(simd, 0x8000_0000);
        let zero = f32x8::splat(simd, 0.0);
        let inside = changed(u, sign).min(changed(v, sign)).min(changed(w, sign)).simd_ge(zero);
        if inside.to_bitmask() == 0 {
            return Meeting { lanes: 0, distance: zero, v, w, sum };
        }
        // The sum of three would do, but most of it cancels out where a triangle is small and far away.
        let distance = self.heights / self.normal.product(direction);
        let hits = inside & distance.simd_gt(zero) & distance.simd_le(f32x8::splat(simd, limit));
        Meeting { lanes: hits.to_bitmask() as u32, distance, v, w, sum }
    }
}

impl<S: Simd> Meeting<S> {
    fn candidate(&self, block: &Block, lane: usize) -> Candidate {
        Candidate {
            triangle: block.first as usize + lane,
            distance: self.distance[lane],
            barycentric: Vec2::new(self.v[lane], self.w[lane]) / self.sum[lane],
            front: self.sum[lane] < 0.0,
        }
    }
}

impl Rays {
    fn none() -> Self {
        Self { direction: [Vec3::ZERO; RAYS], inverse: [Vec3::ZERO; RAYS], middle: Vec3::ZERO, all: 0, limit: [0.0; RAYS], seen: [0; RAYS] }
    }

    #[inline(always)]
    fn new(frame: &Frame, packet: &Directions) -> Self {
        let mut rays = Self { middle: frame.to_world(packet.middle), ..Self::none() };
        for (ray, local) in packet.rays.iter().enumerate() {
            rays.direction[ray] = frame.to_world(*local);
            rays.inverse[ray] = rays.direction[ray].map(inverse);
            if packet.samples[ray] != u32::MAX {
                (rays.all, rays.limit[ray]) = (rays.all | 1 << ray, FAR_AWAY);
            }
        }
        rays
    }

    #[inline(always)]
    fn farthest<S: Simd>(&self, simd: S) -> f32 {
        let mut farthest = f32x8::splat(simd, 0.0);
        for limits in self.limit.as_chunks::<LANES>().0 {
            farthest = farthest.max(f32x8::load_array_ref(simd, limits));
        }
        farthest.to_array().into_iter().fold(0.0, f32::max)
    }
}

fn inverse(component: f32) -> f32 {
    1.0 / if component.abs() < LEAST_DIRECTION { LEAST_DIRECTION.copysign(component) } else { component }
}

/// Numbers of which some have changed their signs.
#[inline(always)]
fn changed<S: Simd>(v: f32x8<S>, sign: u32x8<S>) -> f32x8<S> {
    f32x8::from_bits(v.to_bits() ^ sign)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hemisphere::{Method, Shape};
    use crate::scene::Triangle;
    use crate::scene::bvh::{Bvh, tests::clutter};

    fn table(shape: Shape, resolution: u32) -> Table {
        Table::new(shape, resolution, Method::None).unwrap()
    }

    #[test]
    fn packets_see_what_single_rays_see() {
        let plane = Shape::Plane { fov_degrees: 126.87 };
        let cases = [(1.0, Shape::Hemispherical, 40), (1e-3, Shape::Cosine, 13), (1e6, Shape::Hemicube, 16), (1.0, plane, 20), (1.0, Shape::Concentric, 18)];
        for (scale, shape, resolution) in cases {
            let mut scene = clutter(scale);
            let bvh = Bvh::build(&mut scene);
            let table = table(shape, resolution);
            let bundle = RayBundle::new(&table);
            let views: Vec<View> = scene.triangles.iter().step_by(29).map(|t| view(t.positions.iter().sum::<Vec3>() / 3.0, t.face_normal())).collect();
            let mut seen = vec![0; views.len() * bundle.samples];
            bvh.packets(&scene).trace(&scene, &views, &bundle, &Numbers, &mut seen);
            let (mut rays, mut others) = (0, 0);
            for (view, tile) in views.iter().zip(seen.chunks(bundle.samples)) {
                let origin = view.position + view.frame.normal * surface_offset(scene.extent(), view.position);
                for (sample, found) in table.samples.iter().zip(tile) {
                    if sample.plain_weight == 0.0 {
                        assert_eq!(*found, 0);
                        continue;
                    }
                    let direction = view.frame.to_world(Vec3::from(sample.direction.map(|d| d as f32)));
                    let hit = bvh.closest_hit(&scene, origin, direction, f32::INFINITY);
                    rays += 1;
                    others += (hit.map_or(0, |hit| hit.triangle + 1) != *found) as u32;
                }
            }
            // Edges and triangles that lie in each other, where either is right.
            assert!(rays > 3000 && others * 200 < rays, "{others} of {rays} rays see something else in {shape:?} at scale {scale}");
        }
    }

    #[test]
    fn blocks_cover_a_tile_with_the_fewest_packets() {
        for [width, height] in [[18, 18], [36, 36], [1, 200], [200, 1], [13, 9], [512, 512], [24, 12]] {
            let [across, down] = blocks([width, height]).map(|edge| edge as u32);
            let packets = width.div_ceil(across) * height.div_ceil(down);
            assert!(across * down <= RAYS as u32 && packets <= width.div_ceil(8) * height.div_ceil(8), "{width}×{height}: {across}×{down}");
        }
        assert_eq!(blocks([18, 18]), [6, 9]);
    }

    fn view(position: Vec3, normal: Vec3) -> View {
        View { position, frame: Frame::new(normal.normalize_or(Vec3::Z)).turned(0.7) }
    }

    /// A sphere of many triangles around the viewer: whatever leaves it went between two of them.
    #[test]
    fn no_ray_passes_between_triangles_that_share_an_edge() {
        let mut scene = sphere(40);
        let bvh = Bvh::build(&mut scene);
        let table = table(Shape::Hemispherical, 160);
        let views: Vec<View> = (0..40).map(|k| view(Vec3::new(0.3 * (k as f32).sin(), 0.01 * k as f32, 0.2), Vec3::new((k as f32).cos(), 1.0, 0.3))).collect();
        let bundle = RayBundle::new(&table);
        let mut seen = vec![0; views.len() * bundle.samples];
        bvh.packets(&scene).trace(&scene, &views, &bundle, &Numbers, &mut seen);
        let with_ray = table.samples.iter().cycle().zip(&seen).filter(|(sample, _)| sample.plain_weight > 0.0);
        assert_eq!(with_ray.filter(|(_, found)| **found == 0).count(), 0);
    }

    fn sphere(rings: u32) -> Scene {
        let mut scene = clutter(1.0);
        let blank = Triangle { material: 0, ..scene.triangles[0] };
        let point = |ring: u32, step: u32| {
            let (polar, azimuth) =
                (std::f32::consts::PI * ring as f32 / rings as f32, std::f32::consts::TAU * (step % (2 * rings)) as f32 / (2 * rings) as f32);
            Vec3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()) * if ring.is_multiple_of(rings) { Vec3::Z } else { Vec3::ONE }
        };
        let quads = (0..rings).flat_map(|ring| (0..2 * rings).map(move |step| (ring, step)));
        let corners = quads.map(|(r, s)| [point(r, s), point(r, s + 1), point(r + 1, s), point(r + 1, s + 1)]);
        scene.triangles = corners.flat_map(|[a, b, c, d]| [[a, b, c], [b, d, c]]).map(|positions| Triangle { positions, ..blank }).collect();
        scene
    }
}
