//! Geometry that deforms: vertices that targets bend and joints carry, each for itself.

use super::{
    Triangle,
    animation::Post,
    load::draft::{Face, Normals, has_area, mirrors, normal_map, to_triangle},
};
use crate::math::curve::Curve;
use glam::{DMat4, DVec3, Vec3};
use rayon::prelude::*;
use smallvec::SmallVec;

/// A vertex of a mesh, or where it is at a time. Normal and tangent are zero where the file has none.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Vertex {
    pub position: DVec3,
    pub normal: Vec3,
    pub tangent: Vec3,
}

/// What a target adds to a vertex, as far as it has a weight.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Shift {
    pub vertex: u32,
    pub position: Vec3,
    pub normal: Vec3,
    pub tangent: Vec3,
}

/// A shape that vertices may go toward: of those that differ in it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Target(pub Vec<Shift>);

impl Target {
    /// Moves vertices toward it, of which the first is the one with this number.
    pub fn bend(&self, vertices: &mut [Vertex], weight: f64) {
        if weight == 0.0 {
            return;
        }
        for Shift { vertex, position, normal, tangent } in &self.0 {
            let vertex = &mut vertices[*vertex as usize];
            vertex.position += weight * position.as_dvec3();
            vertex.normal += weight as f32 * *normal;
            vertex.tangent += weight as f32 * *tangent;
        }
    }
}

/// What carries vertices, and the map from the mesh's coordinates to its own.
#[derive(Debug, Clone)]
pub(crate) struct Joint {
    pub post: Post,
    pub bind: DMat4,
}

/// By which joints a vertex is carried; the shares add up to 1.
pub(crate) type Shares = SmallVec<[(u32, f64); 4]>;

/// A mesh that deforms.
#[derive(Debug, Clone)]
pub(crate) struct Shape {
    pub name: String,
    vertices: Vec<Vertex>,
    shares: Vec<Shares>,
    targets: Vec<Target>,
    /// Of the targets, in their order.
    weights: Vec<Curve<f64>>,
    pub joints: Vec<Joint>,
    /// Which vertices each triangle has.
    pub corners: Vec<[u32; 3]>,
    /// Where its shading normals come from.
    pub(super) normals: Normals,
}

/// Where the corners of a triangle are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corners {
    /// Relative to the scene's origin [scene units].
    pub positions: [Vec3; 3],
    /// Unit shading normals, on the front side.
    pub normals: [Vec3; 3],
    /// As [`Scene::tangents`](super::Scene::tangents) has them.
    pub tangents: [Vec3; 3],
}

impl Shape {
    /// One without vertices.
    pub fn new(name: String, joints: Vec<Joint>, weights: Vec<Curve<f64>>) -> Self {
        let targets = vec![Target::default(); weights.len()];
        Self { name, vertices: Vec::new(), shares: Vec::new(), targets, weights, joints, corners: Vec::new(), normals: Normals::File }
    }

    /// Adds vertices, what its targets make of them, what carries them, and triangles of them, all numbered from 0.
    pub fn add(&mut self, vertices: &[Vertex], targets: &[Target], shares: impl IntoIterator<Item = Shares>, triangles: &[[u32; 3]]) {
        let first = self.vertices.len() as u32;
        self.vertices.extend_from_slice(vertices);
        self.shares.extend(shares);
        for (all, target) in self.targets.iter_mut().zip(targets) {
            all.0.extend(target.0.iter().map(|shift| Shift { vertex: first + shift.vertex, ..*shift }));
        }
        self.corners.extend(triangles.iter().map(|corners| corners.map(|corner| first + corner)));
    }

    /// Whether it is otherwise at other times.
    pub fn moves(&self) -> bool {
        let is_bent = self.targets.iter().zip(&self.weights).any(|(target, weight)| !target.0.is_empty() && !weight.is_constant());
        is_bent || self.shares.iter().flatten().any(|(joint, _)| self.joints[*joint as usize].post.on.is_some())
    }

    /// Whether normals are other than those of planes.
    pub fn is_smooth(&self) -> bool {
        match self.normals {
            Normals::File => self.vertices.iter().any(|vertex| vertex.normal != Vec3::ZERO),
            Normals::Face => false,
            Normals::Smooth(_) => true,
        }
    }

    /// When its weights have come to their end [s].
    pub fn end(&self) -> f64 {
        self.weights.iter().map(Curve::end).fold(0.0, f64::max)
    }

    /// Numbers that it keeps for each time: vertices and what targets add to them.
    pub fn size(&self) -> usize {
        self.vertices.len() + self.targets.iter().map(|target| target.0.len()).sum::<usize>()
    }

    fn maps(&self, worlds: &[DMat4]) -> Vec<DMat4> {
        self.joints.iter().map(|joint| joint.post.map_in(worlds) * joint.bind).collect()
    }

    /// The same in another scene, where its nodes count from a number on and what stood on none stands so; `mirrored` where faces are turned round for it.
    pub fn absorbed(mut self, first_node: usize, onto: &Post, mirrored: bool) -> Self {
        for post in self.joints.iter_mut().map(|joint| &mut joint.post) {
            *post = post.on.map_or(Post { on: onto.on, map: onto.map * post.map }, |node| Post { on: Some(first_node + node), ..*post });
        }
        if mirrored {
            self.corners.iter_mut().for_each(|corners| corners.swap(1, 2));
        }
        self
    }

    /// Turns round the triangles that joints mirror, so that their fronts stay the fronts.
    pub fn face_outward(&mut self, worlds: &[DMat4]) {
        let maps = self.maps(worlds);
        for corners in &mut self.corners {
            if mirrors(&blended(&maps, &self.shares[corners[0] as usize])) {
                corners.swap(1, 2);
            }
        }
    }

    /// Its vertices at a time, when nodes stand so in the world.
    pub fn vertices(&self, worlds: &[DMat4], time: f64) -> Vec<Vertex> {
        let (maps, mut vertices) = (self.maps(worlds), self.vertices.clone());
        for (target, weight) in self.targets.iter().zip(&self.weights) {
            target.bend(&mut vertices, weight.at(time));
        }
        vertices.par_iter_mut().zip(&self.shares).for_each(|(vertex, shares)| *vertex = vertex.carried(&blended(&maps, shares)));
        vertices
    }

    /// Its triangles likewise, relative to an origin. What has no area then is there, too small to be seen.
    pub fn corners(&self, worlds: &[DMat4], time: f64, origin: DVec3) -> Vec<Corners> {
        let vertices = self.vertices(worlds, time);
        let faces: Vec<Face> = self.corners.iter().map(|corners| face(corners.map(|corner| &vertices[corner as usize]))).collect();
        let normals = self.normals.of(&faces);
        let least = 1e-7 * extent(&vertices) as f32;
        let tangents = self.corners.iter().map(|corners| corners.map(|corner| vertices[corner as usize].tangent));
        let corners = |((face, normals), tangents): ((&Face, [Vec3; 3]), [Vec3; 3])| {
            let triangle = to_triangle(face, normals, origin);
            if has_area(&triangle) || !triangle.positions.iter().all(|position| position.is_finite()) {
                return Corners { positions: triangle.positions, normals: triangle.normals, tangents };
            }
            let [positions, normals] = speck(triangle.positions[0], least);
            Corners { positions, normals, tangents }
        };
        faces.iter().zip(normals).zip(tangents).map(corners).collect()
    }
}

impl Vertex {
    fn carried(&self, map: &DMat4) -> Self {
        let normal = normal_map(map) * self.normal.as_dvec3();
        Self {
            position: map.transform_point3(self.position),
            normal: normal.normalize_or_zero().as_vec3(),
            tangent: map.transform_vector3(self.tangent.as_dvec3()).normalize_or_zero().as_vec3(),
        }
    }
}

/// Diagonal of the bounds of vertices.
fn extent(vertices: &[Vertex]) -> f64 {
    let grown = |(low, high): (DVec3, DVec3), vertex: &Vertex| (low.min(vertex.position), high.max(vertex.position));
    let (low, high) = vertices.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), grown);
    low.distance(high)
}

/// The map of what several joints carry.
fn blended(maps: &[DMat4], shares: &Shares) -> DMat4 {
    match shares.as_slice() {
        [(joint, _)] => maps[*joint as usize],
        shares => shares.iter().fold(DMat4::ZERO, |sum, (joint, share)| sum + maps[*joint as usize] * *share),
    }
}

fn face(vertices: [&Vertex; 3]) -> Face {
    Face { normals: vertices.map(|vertex| vertex.normal), ..Face::flat(vertices.map(|vertex| vertex.position), 0) }
}

/// Corners and normals of what stands for a triangle that is not seen: as small as single precision tells from nothing, or as `least`.
pub(super) fn speck(corner: Vec3, least: f32) -> [[Vec3; 3]; 2] {
    /// The square of its area is not nothing yet.
    const LEAST: f32 = 1e-9;
    let side = (16.0 * f32::EPSILON * corner.abs().max_element()).max(least).max(LEAST);
    [[corner, corner + side * Vec3::X, corner + side * Vec3::Y], [Vec3::Z; 3]]
}

/// The coordinates of a triangle: along its edges and its normal, from its first corner. What is on another triangle at the same coordinates is at the same place of it.
pub fn frame(positions: [Vec3; 3]) -> DMat4 {
    let [a, b, c] = positions.map(|position| position.as_dvec3());
    let (along, across) = (b - a, c - a);
    let columns = [along.extend(0.0), across.extend(0.0), along.cross(across).normalize_or(DVec3::Z).extend(0.0), a.extend(1.0)];
    DMat4::from_cols(columns[0], columns[1], columns[2], columns[3])
}

impl Corners {
    /// Those of a triangle.
    pub(super) fn of(triangle: &Triangle, tangents: [Vec3; 3]) -> Self {
        Self { positions: triangle.positions, normals: triangle.normals, tangents }
    }

    pub(super) fn cross(&self) -> Vec3 {
        let [a, b, c] = self.positions;
        (b - a).cross(c - a)
    }

    /// A triangle that has them.
    pub(super) fn put(&self, triangle: &mut Triangle) {
        (triangle.positions, triangle.normals) = (self.positions, self.normals);
    }
}
