//! Texels of a lightmap in memory, as `shaders/lib/lightmap.wgsl` reads them, what they send out, and looks between them.

use crate::contract::port;
use crate::host_struct;
use crate::math::colour::reflectance_of;
use crate::passes::irradiance_field::Point;
use crate::scene::{Scene, Triangle};
use crate::schedule::*;
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

host_struct! {
    /// A point that a texel stands for, as [`crate::scene::atlas::Spot`] has it.
    pub struct TexelPlace {
        triangle: u32,
        barycentric_u: f32,
        barycentric_v: f32,
        /// The texel's area, over that of this triangle.
        share: f32,
    }
}

host_struct! {
    /// Where a texel is now.
    pub struct TexelSurface {
        position: [f32; 3],
        /// [scene units²]
        area: f32,
        /// Of the front.
        normal: [f32; 3],
        triangle: u32,
    }
}

host_struct! {
    /// What a texel sends out.
    pub struct Shot {
        /// Where it is.
        position: [f32; 3],
        /// The square of the distance below which it brings no more [scene units²].
        nearest: f32,
        /// Of its triangle's plane, on the side that sends: that of the shading does not tell how large it looks.
        normal: [f32; 3],
        /// The area that it would stand for as the only one of an iteration [scene units²].
        stands_for: f32,
        /// Its radiance times the area that it stands for among all [W/sr].
        flux: [f32; 3],
        padding: u32,
    }
}

/// Texels of a block, which are lit together.
pub const BLOCK: usize = 64;

/// The square of the distance within which a texel neither brings nor takes more, over its area: two texels away it is hardly wrong to take a texel for its middle.
pub const NEAREST: f32 = 4.0;

/// By what an area is chosen whose radiance has such a luminance.
pub fn favour(luminance: f32, by: port::Favour) -> f32 {
    match by {
        port::Favour::Light => luminance,
        port::Favour::Root => luminance.sqrt(),
    }
}

/// What a texel reflects, by its direct light, with the bits of its reflectance, and by its irradiance [W m⁻² sr⁻¹].
pub fn radiance(direct: Vec4, irradiance: Vec4) -> Vec3 {
    direct.truncate() + reflectance_of(direct.w.to_bits()) * irradiance.truncate() * FRAC_1_PI
}

impl TexelSurface {
    /// Its position, and its normal on one of its sides.
    pub fn place(&self, side: usize) -> [Vec3; 2] {
        let normal = Vec3::from(self.normal);
        [self.position.into(), if side == 0 { normal } else { -normal }]
    }
}

/// Vec4 that a triangle's corners take in a field.
pub const CORNERS: u32 = 2;

/// Where the point at weights of a triangle lies in a texture, and in which chart, by two vectors a triangle.
pub fn laid_at(corners: &[Vec4], triangle: u32, weights: Vec2) -> (Vec2, f32) {
    let [first, second] = [0, 1].map(|at| corners[(CORNERS * triangle + at) as usize]);
    let [a, b, c] = [Vec2::new(first.x, first.y), Vec2::new(first.z, first.w), Vec2::new(second.x, second.y)];
    (a + (b - a) * weights.x + (c - a) * weights.y, second.z)
}

/// A lightmap that host steps ask: `shaders/lib/irradiance_field/lightmap.wgsl` has the twin.
pub struct Looks<'a> {
    scene: &'a Scene,
    data: &'a [Vec4],
    of: port::LightmapField,
}

impl<'a> Looks<'a> {
    /// In a host step that reads the field.
    pub fn of(field: &port::LightmapField, host: &'a dyn HostContext) -> Self {
        Self { scene: host.scene(), data: bytemuck::cast_slice(host.read(field.data)), of: *field }
    }

    /// Indirect irradiance at a point, between the four texels around it [W/m²].
    pub fn irradiance(&self, at: Point) -> Vec3 {
        let Some(number) = at.triangle.checked_sub(1) else { return Vec3::ZERO };
        let triangle = &self.scene.triangles[number as usize];
        let side = usize::from(self.of.sides == 2 && triangle.cross().dot(at.normal) < 0.0);
        let (place, chart) = laid_at(self.data, number, nearest(triangle, at.position));
        self.between(place, side, chart)
    }

    /// Between those of four texels that are of a chart.
    fn between(&self, place: Vec2, side: usize, chart: f32) -> Vec3 {
        let corner = (place - 0.5).floor();
        let share = place - 0.5 - corner;
        let mut sum = Vec4::ZERO;
        for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let along = |step: i32, share: f32| if step == 0 { 1.0 - share } else { share };
            let weight = along(x, share.x) * along(y, share.y);
            let texel = self.texel([corner.x as i32 + x, corner.y as i32 + y], side);
            if texel.w == chart {
                sum += texel.truncate().extend(1.0) * weight;
            }
        }
        if sum.w > 0.0 {
            return sum.truncate() / sum.w;
        }
        self.texel([place.x as i32, place.y as i32], side).truncate()
    }

    /// Irradiance, and the number of the chart; 0 where there is none.
    fn texel(&self, at: [i32; 2], side: usize) -> Vec4 {
        if at.iter().any(|at| !(0..self.of.edge as i32).contains(at)) {
            return Vec4::ZERO;
        }
        let place = (at[1] as usize * self.of.edge as usize + at[0] as usize) * self.of.sides as usize + side;
        self.data[self.of.first as usize + place]
    }
}

/// Weights of corners 1 and 2 at the point of a triangle that is nearest to one beside its plane.
pub fn nearest(triangle: &Triangle, position: Vec3) -> Vec2 {
    let [a, b, c] = triangle.positions;
    let (s, t, way) = (b - a, c - a, position - a);
    let (ss, st, tt, sw, tw) = (s.dot(s), s.dot(t), t.dot(t), s.dot(way), t.dot(way));
    let determinant = ss * tt - st * st;
    if determinant <= 0.0 {
        return Vec2::ZERO;
    }
    let weights = (Vec2::new(tt * sw - st * tw, ss * tw - st * sw) / determinant).clamp(Vec2::ZERO, Vec2::ONE);
    weights / weights.element_sum().max(1.0)
}

/// Where a texel is, its triangle as it lies now.
pub fn surface(scene: &Scene, texel: &TexelPlace) -> TexelSurface {
    let triangle = &scene.triangles[texel.triangle as usize];
    let weights = Vec2::new(texel.barycentric_u, texel.barycentric_v);
    let normal = triangle.normal(weights);
    TexelSurface { position: triangle.position(weights).into(), area: texel.area(triangle), normal: normal.into(), triangle: texel.triangle }
}

/// Where all texels are, by the first of their points.
pub fn place(scene: &Scene, places: &[TexelPlace], surfaces: &mut [TexelSurface]) {
    surfaces.par_iter_mut().zip(places).for_each(|(into, place)| *into = surface(scene, place));
}

impl TexelPlace {
    /// Of the texel, its triangle as it lies now [scene units²].
    pub fn area(&self, triangle: &Triangle) -> f32 {
        self.share * 0.5 * triangle.cross().length()
    }
}
