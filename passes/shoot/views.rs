//! What shooters see, asked before rays are.

use super::Sender;
use crate::contract::port;
use crate::passes::texels::TexelSurface;
use crate::scene::Scene;
use glam::Vec3;

/// Whether something is between two points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Between {
    Nothing,
    Something,
    /// A ray has to tell.
    Unknown,
}

/// What shooters see.
pub struct Views<'a> {
    pub of: port::ShooterViews,
    pub seen: &'a [u32],
    pub scene: &'a Scene,
}

/// How much nearer than a point, as a share of the way, the plane of the triangle seen beside it may be, and be on its surface.
const LEVEL: f32 = 1e-3;

impl Views<'_> {
    /// By the triangle that the nearest sample sees: the point's own, one that the way to the point meets before its end, or one in whose plane it is. Any other tells nothing.
    pub fn between(&self, sender: &Sender, texel: &TexelSurface) -> Between {
        let way = Vec3::from(texel.position) - sender.position;
        let Some(at) = self.of.shape.sample_at(self.of.resolution, sender.frame.to_local(way)) else { return Between::Unknown };
        let Some(number) = self.seen[self.of.place(sender.number, at)].checked_sub(1) else { return Between::Unknown };
        if number == texel.triangle {
            return Between::Nothing;
        }
        let triangle = &self.scene.triangles[number as usize];
        if self.scene.materials[triangle.material as usize].alpha_cutoff.is_some() {
            return Between::Unknown;
        }
        let [a, b, c] = triangle.positions;
        let (e1, e2, s) = (b - a, c - a, sender.position - a);
        let p = way.cross(e2);
        let determinant = e1.dot(p);
        if determinant == 0.0 {
            return Between::Unknown;
        }
        let q = s.cross(e1);
        let (distance, u, v) = (e2.dot(q) / determinant, s.dot(p) / determinant, way.dot(q) / determinant);
        if (distance - 1.0).abs() < LEVEL {
            Between::Nothing
        } else if distance > LEVEL && distance < 1.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
            Between::Something
        } else {
            Between::Unknown
        }
    }
}
