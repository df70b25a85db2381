//! What a ray sees of a surface.

use super::{Rgb, Scene, Triangle};
use crate::math::{frame::Frame, lobe::Lobe};
use glam::{Vec2, Vec3};

/// A place on a surface, from the side that a ray saw.
#[derive(Clone, Copy)]
pub struct Surface {
    pub position: Vec3,
    /// Unit normal of the plane, on the side seen.
    pub face: Vec3,
    /// Unit shading normal, on the side seen.
    pub normal: Vec3,
    /// Of the diffuse part, toward where the ray came from.
    pub reflectance: Rgb,
    pub emission: Rgb,
    pub glossy: Option<Gloss>,
}

/// The lobe of a place, and the way to where the ray came from.
#[derive(Clone, Copy)]
pub struct Gloss {
    pub lobe: Lobe,
    pub frame: Frame,
    /// In the frame.
    pub outgoing: Vec3,
}

impl Scene {
    /// What a ray along `direction` sees where it meets a triangle.
    pub fn surface(&self, triangle: u32, barycentric: Vec2, direction: Vec3) -> Surface {
        let (plain, texture) = self.without_lobe(triangle, barycentric, direction);
        let triangle = &self.triangles[triangle as usize];
        let material = &self.materials[triangle.material as usize];
        let reflection = material.reflection(material.reflectance * texture.unwrap_or(Vec3::ONE));
        let glossy = reflection.lobe.map(|lobe| {
            let frame = if lobe.shape.is_anisotropic() { triangle.tangent_frame(plain.normal) } else { Frame::new(plain.normal) };
            Gloss { lobe, frame, outgoing: frame.to_local(-direction.normalize()) }
        });
        let reflectance = glossy.map_or(reflection.diffuse, |gloss| reflection.diffuse * gloss.lobe.leaves(gloss.outgoing.z));
        Surface { reflectance, glossy, ..plain }
    }

    /// The same where nothing renders lobes: [`Material::albedo`](super::Material::albedo) stands for them.
    pub fn diffuse_surface(&self, triangle: u32, barycentric: Vec2, direction: Vec3) -> Surface {
        self.without_lobe(triangle, barycentric, direction).0
    }

    /// The surface by its albedo, and what its texture holds there.
    fn without_lobe(&self, triangle: u32, barycentric: Vec2, direction: Vec3) -> (Surface, Option<Rgb>) {
        let triangle = &self.triangles[triangle as usize];
        let material = &self.materials[triangle.material as usize];
        let face = triangle.face_normal();
        let side = if face.dot(direction) > 0.0 { -1.0 } else { 1.0 };
        let texture = material.texture.map(|i| self.textures[i as usize].sample(triangle.uv(barycentric)).truncate());
        let (albedo, multiplied) = material.albedo();
        let surface = Surface {
            // From the corners rather than along the ray: the error stays in the plane.
            position: triangle.position(barycentric),
            face: face * side,
            normal: triangle.normal(barycentric) * side,
            reflectance: albedo * texture.filter(|_| multiplied.is_some()).unwrap_or(Vec3::ONE),
            emission: material.emission,
            glossy: None,
        };
        (surface, texture)
    }
}

impl Triangle {
    /// Barycentric weights of corners 1 and 2 where a ray, known to meet the triangle, meets it. What rounding puts outside is moved to the edge.
    pub fn barycentric(&self, origin: Vec3, direction: Vec3) -> Vec2 {
        let [a, b, c] = self.positions;
        let (e1, e2, s) = (b - a, c - a, origin - a);
        let p = direction.cross(e2);
        let determinant = e1.dot(p);
        let inverse = if determinant == 0.0 { 0.0 } else { 1.0 / determinant };
        let weights = (Vec2::new(s.dot(p), direction.dot(s.cross(e1))) * inverse).clamp(Vec2::ZERO, Vec2::ONE);
        weights / weights.element_sum().max(1.0)
    }
}
