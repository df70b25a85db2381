//! Which pixels show one surface, for what is smoothed over pixels: `shaders/lib/beside.wgsl` has the twin.

use glam::Vec3;

/// The cosine that normals of one surface have at least, and how far off its plane a pixel's place may be, as a share of the way to it.
const FACING: f32 = 0.9;
const BESIDE: f32 = 0.1;

/// Whether another place is on the same surface as one with a unit normal.
pub fn is_beside([position, normal]: [Vec3; 2], [other, other_normal]: [Vec3; 2]) -> bool {
    let way = other - position;
    normal.dot(other_normal) >= FACING && way.dot(normal).abs() <= BESIDE * way.length()
}
