//! The hierarchy as the CPU walks it: four boxes or four triangles a step, in single instructions.
//!
//! Made from the binary hierarchy by opening the largest boxes first. Everything is relative to the ray and the boxes
//! themselves: the unit of length does not matter.

use super::{
    bvh::Node,
    model::Triangle,
    parts::{Laid, Parts},
};
use glam::{BVec4A, Vec2, Vec3, Vec4};
use smallvec::SmallVec;

/// Widens the far side of every box by the rounding of its slab distances (Ize 2013), so that none is missed.
const FAR: f32 = 1.0 + 4.0 * f32::EPSILON;

/// Direction components below this are taken as this, far from both overflow and any visible angle.
const LEAST_DIRECTION: f32 = 1e-20;

/// Four children by axis.
#[derive(Clone)]
struct Node4 {
    /// Lower and upper bounds of each axis; an empty slot has lower > upper.
    bounds: [[Vec4; 2]; 3],
    children: [Child; 4],
}

/// A node, or the packets of a leaf.
#[derive(Clone, Copy, Default)]
struct Child {
    first: u32,
    /// Packets of a leaf, 0 for a node.
    packets: u32,
}

/// Up to four triangles that are neighbours in the scene.
#[derive(Clone)]
struct Packet {
    corner: [Vec4; 3],
    edges: [[Vec4; 3]; 2],
    first: u32,
    count: u32,
}

/// A triangle that a ray meets.
pub struct Candidate {
    pub triangle: usize,
    pub distance: f32,
    pub barycentric: Vec2,
    /// Whether the ray meets the front.
    pub front: bool,
}

#[derive(Clone, Default)]
pub struct Wide {
    nodes: Vec<Node4>,
    packets: Vec<Packet>,
    root: Option<Child>,
    /// Where parts of the scene can move.
    parts: Option<Laid<Child, 4>>,
}

/// A ray made ready for boxes and packets.
struct Ray {
    origin: [Vec4; 3],
    direction: [Vec4; 3],
    inverse: [Vec4; 3],
    /// 1 where the ray goes down an axis: which of the bounds it leaves through is the other one.
    near: [usize; 3],
}

impl Wide {
    /// Over the binary hierarchy's nodes and the triangles that it has sorted.
    pub fn new(nodes: &[Node], parts: Option<&Parts>, triangles: &[Triangle]) -> Self {
        let mut wide = Self::default();
        let Some(parts) = parts else {
            wide.root = (!nodes.is_empty()).then(|| wide.tree(nodes, 0, |wide, leaf| wide.leaf(triangles, leaf), &mut Vec::new()));
            return wide;
        };
        let sizes = |wide: &Self| [wide.nodes.len(), wide.packets.len()];
        let lay = |wide: &mut Self, root, sources: &mut _| wide.tree(nodes, root, |wide, leaf| wide.leaf(triangles, leaf), sources);
        wide.parts = Some(Laid::new(parts, &mut wide, sizes, lay));
        wide.join(parts);
        wide
    }

    /// Takes over where movers, and the level over all parts, stand now.
    pub fn follow(&mut self, nodes: &[Node], parts: &Parts, movers: &[usize], triangles: &[Triangle]) {
        let Some(of) = &self.parts else { return };
        for [range, packets] in movers.iter().map(|mover| &of.movers[*mover]) {
            for node in range.clone() {
                of.children(node).for_each(|(slot, child)| self.nodes[node].place(slot, &nodes[child]));
            }
            for packet in &mut self.packets[packets.clone()] {
                *packet = Packet::new(triangles, packet.first, packet.count);
            }
        }
        self.join(parts);
    }

    fn join(&mut self, parts: &Parts) {
        let Some(of) = self.parts.take() else { return };
        self.nodes.truncate(of.upper);
        self.root = (!parts.upper.is_empty()).then(|| self.tree(&parts.upper, 0, |_, leaf| of.roots[leaf.first as usize], &mut Vec::new()));
        self.parts = Some(of);
    }

    /// What stands for a binary tree below one of its nodes; `leaf` for a leaf of it. Of each new node the children's places in the tree are added.
    fn tree(&mut self, nodes: &[Node], root: usize, mut leaf: impl FnMut(&mut Self, &Node) -> Child, sources: &mut Vec<[u32; 4]>) -> Child {
        let first = self.nodes.len();
        let children = if nodes[root].count > 0 { vec![root] } else { open(nodes, root, 4) };
        self.nodes.push(Node4::EMPTY);
        sources.push([u32::MAX; 4]);
        let (base, sources_base) = (first, sources.len() - 1);
        // An explicit list rather than recursion: a degenerate hierarchy may be deep.
        let mut open_nodes = vec![(first, children)];
        while let Some((index, children)) = open_nodes.pop() {
            for (slot, at) in children.iter().enumerate() {
                let child = &nodes[*at];
                self.nodes[index].place(slot, child);
                sources[sources_base + index - base][slot] = *at as u32;
                self.nodes[index].children[slot] = if child.count > 0 {
                    leaf(self, child)
                } else {
                    self.nodes.push(Node4::EMPTY);
                    sources.push([u32::MAX; 4]);
                    open_nodes.push((self.nodes.len() - 1, open(nodes, *at, 4)));
                    Child { first: self.nodes.len() as u32 - 1, packets: 0 }
                };
            }
        }
        Child { first: first as u32, packets: 0 }
    }

    fn leaf(&mut self, triangles: &[Triangle], leaf: &Node) -> Child {
        let first = self.packets.len() as u32;
        self.packets.extend((0..leaf.count).step_by(4).map(|k| Packet::new(triangles, leaf.first + k, (leaf.count - k).min(4))));
        Child { first, packets: self.packets.len() as u32 - first }
    }

    /// The nearest triangle for which `accept` holds, 0 < distance < `limit`.
    pub fn closest(&self, origin: Vec3, direction: Vec3, limit: f32, accept: impl Fn(&Candidate) -> bool) -> Option<Candidate> {
        let ray = Ray::new(origin, direction);
        let (mut limit, mut found) = (limit, None);
        let mut stack: SmallVec<[(f32, Child); 64]> = SmallVec::new();
        stack.extend(self.root.map(|root| (0.0, root)));
        while let Some((near, child)) = stack.pop() {
            if near >= limit {
                continue;
            }
            if child.packets == 0 {
                let node = &self.nodes[child.first as usize];
                let (near, hits) = ray.boxes(&node.bounds, limit);
                let from = stack.len();
                push_hits(&mut stack, node, near, hits);
                // The nearest on top: at most four, nearly sorted.
                for i in from + 1..stack.len() {
                    let mut k = i;
                    while k > from && stack[k - 1].0 < stack[k].0 {
                        stack.swap(k - 1, k);
                        k -= 1;
                    }
                }
                continue;
            }
            for packet in &self.packets[child.first as usize..(child.first + child.packets) as usize] {
                ray.triangles(packet, limit, |candidate| {
                    if candidate.distance < limit && accept(&candidate) {
                        limit = candidate.distance;
                        found = Some(candidate);
                    }
                    false
                });
            }
        }
        found
    }

    /// Whether there is a triangle for which `accept` holds, 0 < distance < `limit`.
    pub fn any(&self, origin: Vec3, direction: Vec3, limit: f32, accept: impl Fn(&Candidate) -> bool) -> bool {
        let ray = Ray::new(origin, direction);
        let mut stack: SmallVec<[(f32, Child); 64]> = SmallVec::new();
        stack.extend(self.root.map(|root| (0.0, root)));
        while let Some((_, child)) = stack.pop() {
            if child.packets == 0 {
                let node = &self.nodes[child.first as usize];
                let (near, hits) = ray.boxes(&node.bounds, limit);
                push_hits(&mut stack, node, near, hits);
                continue;
            }
            let packets = &self.packets[child.first as usize..(child.first + child.packets) as usize];
            if packets.iter().any(|packet| ray.triangles(packet, limit, |candidate| accept(&candidate))) {
                return true;
            }
        }
        false
    }
}

impl Node4 {
    const EMPTY: Self = Self { bounds: [[Vec4::INFINITY, Vec4::NEG_INFINITY]; 3], children: [Child { first: 0, packets: 0 }; 4] };

    fn place(&mut self, slot: usize, child: &Node) {
        for (axis, bounds) in self.bounds.iter_mut().enumerate() {
            (bounds[0][slot], bounds[1][slot]) = (child.min[axis], child.max[axis]);
        }
    }
}

impl Packet {
    fn new(triangles: &[Triangle], first: u32, count: u32) -> Self {
        // Unused lanes are triangles without area, which nothing meets.
        let mut packet = Self { corner: [Vec4::ZERO; 3], edges: [[Vec4::ZERO; 3]; 2], first, count };
        for (lane, triangle) in triangles[first as usize..(first + count) as usize].iter().enumerate() {
            let [a, b, c] = triangle.positions;
            for axis in 0..3 {
                packet.corner[axis][lane] = a[axis];
                packet.edges[0][axis][lane] = b[axis] - a[axis];
                packet.edges[1][axis][lane] = c[axis] - a[axis];
            }
        }
        packet
    }
}

/// Up to `count` descendants that stand for an inner node: the largest box is opened first.
pub(super) fn open(nodes: &[Node], node: usize, count: usize) -> Vec<usize> {
    let pair = |node: usize| [nodes[node].first as usize, nodes[node].first as usize + 1];
    let mut children = pair(node).to_vec();
    while children.len() < count {
        let inner = (0..children.len()).filter(|&i| nodes[children[i]].count == 0);
        let Some(largest) = inner.max_by(|&a, &b| half_area(&nodes[children[a]]).total_cmp(&half_area(&nodes[children[b]]))) else { break };
        let opened = children.swap_remove(largest);
        children.extend(pair(opened));
    }
    children
}

pub(super) fn half_area(node: &Node) -> f32 {
    let size = Vec3::from(node.max) - Vec3::from(node.min);
    size.x * size.y + size.y * size.z + size.z * size.x
}

#[inline(always)]
fn push_hits(stack: &mut SmallVec<[(f32, Child); 64]>, node: &Node4, near: Vec4, hits: u32) {
    let (mut hits, near) = (hits, near.to_array());
    while hits != 0 {
        let slot = hits.trailing_zeros() as usize;
        stack.push((near[slot], node.children[slot]));
        hits &= hits - 1;
    }
}

impl Ray {
    fn new(origin: Vec3, direction: Vec3) -> Self {
        let four = |v: Vec3| [Vec4::splat(v.x), Vec4::splat(v.y), Vec4::splat(v.z)];
        let inverse = |d: f32| 1.0 / if d.abs() < LEAST_DIRECTION { LEAST_DIRECTION.copysign(d) } else { d };
        Self {
            origin: four(origin),
            direction: four(direction),
            inverse: four(Vec3::new(inverse(direction.x), inverse(direction.y), inverse(direction.z))),
            near: direction.to_array().map(|d| d.is_sign_negative() as usize),
        }
    }

    /// Where the ray enters each box, and a bit for each that it meets before `limit`.
    #[inline]
    fn boxes(&self, bounds: &[[Vec4; 2]; 3], limit: f32) -> (Vec4, u32) {
        let slab = |axis: usize, side: usize| (bounds[axis][side] - self.origin[axis]) * self.inverse[axis];
        let near = |axis: usize| slab(axis, self.near[axis]);
        let far = |axis: usize| slab(axis, 1 - self.near[axis]);
        let entry = near(0).max(near(1)).max(near(2)).max(Vec4::ZERO);
        let exit = (far(0).min(far(1)).min(far(2)) * FAR).min(Vec4::splat(limit));
        (entry, entry.cmple(exit).bitmask())
    }

    /// Möller and Trumbore's test on four triangles; true as soon as `visit` is. The shaders do the same arithmetic.
    #[inline]
    fn triangles(&self, packet: &Packet, limit: f32, mut visit: impl FnMut(Candidate) -> bool) -> bool {
        let [e1, e2] = &packet.edges;
        let p = cross(&self.direction, e2);
        let determinant = dot(e1, &p);
        let inverse = determinant.recip();
        let s = [self.origin[0] - packet.corner[0], self.origin[1] - packet.corner[1], self.origin[2] - packet.corner[2]];
        let u = dot(&s, &p) * inverse;
        let q = cross(&s, e1);
        let v = dot(&self.direction, &q) * inverse;
        let t = dot(e2, &q) * inverse;
        // A degenerate triangle's NaN or infinity fails one of these.
        let inside: BVec4A = u.cmpge(Vec4::ZERO) & v.cmpge(Vec4::ZERO) & (u + v).cmple(Vec4::ONE);
        let mut hits = (inside & t.cmpgt(Vec4::ZERO) & t.cmplt(Vec4::splat(limit))).bitmask();
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize;
            let barycentric = Vec2::new(u[lane], v[lane]);
            if visit(Candidate { triangle: packet.first as usize + lane, distance: t[lane], barycentric, front: determinant[lane] > 0.0 }) {
                return true;
            }
            hits &= hits - 1;
        }
        false
    }
}

#[inline]
fn cross(a: &[Vec4; 3], b: &[Vec4; 3]) -> [Vec4; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
fn dot(a: &[Vec4; 3], b: &[Vec4; 3]) -> Vec4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
