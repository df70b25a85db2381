//! The bounding volume hierarchy that the reference walks on the CPU and the ray-casting passes on the GPU.

use super::model::{Material, Scene, Texture, Triangle};
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris, node::Bvh2Node},
    ray::{Ray, RayHit},
};
use std::time::Duration;

/// The deepest path from root to leaf that the shaders' stack holds; a deeper hierarchy is refused.
pub const MAX_DEPTH: usize = 64;

/// A binary hierarchy over a scene's triangles, in whose order it has sorted them.
pub struct Bvh {
    inner: Bvh2,
}

/// A node as the GPU reads it: an inner node's children stand at `first` and `first + 1`; a leaf holds the triangles
/// `first .. first + count`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Node {
    pub min: [f32; 3],
    /// Triangles of a leaf, 0 for an inner node.
    pub count: u32,
    pub max: [f32; 3],
    pub first: u32,
}

/// Where a ray met a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    pub triangle: u32,
    /// Distance in units of the ray's direction.
    pub distance: f32,
    /// Barycentric weights of corners 1 and 2.
    pub barycentric: Vec2,
}

impl Bvh {
    /// Builds the hierarchy and sorts `scene.triangles` so that every leaf's triangles are neighbours.
    /// The result depends on the triangles alone.
    pub fn build(scene: &mut Scene) -> Self {
        let boxes: Vec<obvhs::triangle::Triangle> = scene
            .triangles
            .iter()
            .map(|t| obvhs::triangle::Triangle { v0: t.positions[0].into(), v1: t.positions[1].into(), v2: t.positions[2].into() })
            .collect();
        let mut parameters = BvhBuildParams::medium_build();
        parameters.pre_split = false;
        let mut inner = build_bvh2_from_tris(&boxes, parameters, &mut Duration::default());
        let order = sort_depth_first(&mut inner);
        scene.triangles = order.iter().map(|&i| scene.triangles[i as usize]).collect();
        Self { inner }
    }

    /// For each node the triangles below it, first and one past the last: a subtree's triangles are neighbours.
    pub fn ranges(&self) -> Vec<[u32; 2]> {
        let nodes = &self.inner.nodes;
        let mut ranges = vec![[0, 0]; nodes.len()];
        for index in depth_first(nodes).into_iter().rev() {
            let node = &nodes[index];
            let first = node.first_index as usize;
            ranges[index] = if node.is_leaf() { [node.first_index, node.first_index + node.prim_count] } else { [ranges[first][0], ranges[first + 1][1]] };
        }
        ranges
    }

    /// The nodes, root first; empty for an empty scene.
    pub fn nodes(&self) -> Vec<Node> {
        self.inner.nodes.iter().map(|n| Node { min: n.aabb().min.into(), count: n.prim_count, max: n.aabb().max.into(), first: n.first_index }).collect()
    }

    /// Nodes on the longest path from the root to a leaf.
    pub fn depth(&self) -> usize {
        if self.inner.nodes.is_empty() { 0 } else { self.inner.depth(0) }
    }

    /// The nearest surface that a viewer would see along `origin + t·direction`, 0 < t < `limit`: one-sided surfaces
    /// are seen from their front only, holes of alpha-masked textures not at all.
    pub fn closest(&self, scene: &Scene, origin: Vec3, direction: Vec3, limit: f32) -> Option<Hit> {
        let mut found = None;
        let ray = Ray::new(origin.into(), direction.into(), 0.0, limit);
        self.inner.ray_traverse(ray, &mut RayHit::none(), |ray, index| {
            let triangle = &scene.triangles[index];
            let Some((distance, barycentric, front)) = intersect(triangle, ray.origin.into(), ray.direction.into()) else {
                return f32::INFINITY;
            };
            let material = &scene.materials[triangle.material as usize];
            if distance >= ray.tmax || (!front && !material.two_sided) || is_hole(triangle, material, &scene.textures, barycentric) {
                return f32::INFINITY;
            }
            found = Some(Hit { triangle: index as u32, distance, barycentric });
            distance
        });
        found
    }

    /// Whether anything blocks light between 0 and `limit` along the ray. A surface blocks from both of its sides,
    /// whatever its sidedness; holes of alpha-masked textures let light through.
    pub fn occluded(&self, scene: &Scene, origin: Vec3, direction: Vec3, limit: f32) -> bool {
        let ray = Ray::new(origin.into(), direction.into(), 0.0, limit);
        !self.inner.ray_traverse_miss(ray, |ray, index| {
            let triangle = &scene.triangles[index];
            match intersect(triangle, ray.origin.into(), ray.direction.into()) {
                Some((distance, barycentric, _)) if !is_hole(triangle, &scene.materials[triangle.material as usize], &scene.textures, barycentric) => distance,
                _ => f32::INFINITY,
            }
        })
    }
}

/// Node indices, parents before children, left before right.
fn depth_first(nodes: &[Bvh2Node]) -> Vec<usize> {
    let mut order = Vec::with_capacity(nodes.len());
    let mut stack = if nodes.is_empty() { Vec::new() } else { vec![0] };
    while let Some(index) = stack.pop() {
        order.push(index);
        if !nodes[index].is_leaf() {
            let first = nodes[index].first_index as usize;
            stack.extend([first + 1, first]);
        }
    }
    order
}

/// Renumbers the primitives so that every subtree holds a contiguous range; returns the original index of each.
fn sort_depth_first(bvh: &mut Bvh2) -> Vec<u32> {
    let mut order: Vec<u32> = Vec::with_capacity(bvh.primitive_indices.len());
    for index in depth_first(&bvh.nodes) {
        let node = &mut bvh.nodes[index];
        if node.is_leaf() {
            let range = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            node.first_index = order.len() as u32;
            order.extend(&bvh.primitive_indices[range]);
        }
    }
    bvh.primitive_indices = (0..order.len() as u32).collect();
    order
}

/// Möller and Trumbore's test: distance > 0, barycentric weights of corners 1 and 2, and whether the front was met.
/// The shaders do the same arithmetic.
fn intersect(triangle: &Triangle, origin: Vec3A, direction: Vec3A) -> Option<(f32, Vec2, bool)> {
    let [a, b, c] = triangle.positions.map(Vec3A::from);
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let inverse = 1.0 / determinant;
    let s = origin - a;
    let u = s.dot(p) * inverse;
    let q = s.cross(e1);
    let v = direction.dot(q) * inverse;
    let t = e2.dot(q) * inverse;
    // Written so that a NaN from a degenerate triangle is a miss.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some((t, Vec2::new(u, v), determinant > 0.0))
}

/// Whether an alpha-masked texture leaves a hole at the barycentric weights of corners 1 and 2.
pub fn is_hole(triangle: &Triangle, material: &Material, textures: &[Texture], barycentric: Vec2) -> bool {
    let (Some(cutoff), Some(texture)) = (material.alpha_cutoff, material.texture) else { return false };
    textures[texture as usize].sample(triangle.uv(barycentric)).w < cutoff
}
