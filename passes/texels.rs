//! Texels of a lightmap in memory, as `shaders/lib/lightmap.wgsl` reads them, what they send out, and looks between them.

use crate::contract::port;
use crate::host_struct;
use crate::math::colour::reflectance_of;
use crate::passes::irradiance_field::Point;
use crate::scene::{
    Scene, Triangle,
    atlas::walls::{LINK_BITS, PARTS, SAME_CHART},
};
use crate::schedule::*;
use glam::{BVec2, IVec2, Vec2, Vec3, Vec4};
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

/// Where the point at weights of a triangle lies in a texture, by two vectors a triangle.
pub fn laid_at(corners: &[Vec4], triangle: u32, weights: Vec2) -> Vec2 {
    let [first, second] = [0, 1].map(|at| corners[(CORNERS * triangle + at) as usize]);
    let [a, b, c] = [Vec2::new(first.x, first.y), Vec2::new(first.z, first.w), Vec2::new(second.x, second.y)];
    a + (b - a) * weights.x + (c - a) * weights.y
}

/// Which of a cell's parts a point within the cell is in: the nearest by the middle and the reach of each, of those that light has ever come to if there is any.
pub fn part_at(parts: [u32; PARTS], within: Vec2, is_lit: impl Fn(u32) -> bool) -> u32 {
    let distance = |packed: u32| {
        let [x, y, reach] = [0, 8, 16].map(|shift| (packed >> shift & 255) as f32 / 255.0);
        within.distance_squared(Vec2::new(x, y)) - reach * reach
    };
    let (mut nearest, mut least) = (0, f32::INFINITY);
    for (part, packed) in (0..).zip(parts).filter(|(_, packed)| *packed != 0) {
        let distance = distance(packed) + if is_lit(part) { 0.0 } else { UNLIT };
        if distance < least {
            (nearest, least) = (part, distance);
        }
    }
    nearest
}

/// Further than any part of a cell is, squared.
const UNLIT: f32 = 16.0;

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

    /// Indirect irradiance at a point, between the four cells around it [W/m²].
    pub fn irradiance(&self, at: Point) -> Vec3 {
        let Some(number) = at.triangle.checked_sub(1) else { return Vec3::ZERO };
        let triangle = &self.scene.triangles[number as usize];
        let side = usize::from(self.of.sides == 2 && triangle.cross().dot(at.normal) < 0.0);
        self.between(laid_at(self.data, number, nearest(triangle, at.position)), side)
    }

    /// Between those of four cells that go on into that of the place.
    fn between(&self, place: Vec2, side: usize) -> Vec3 {
        let own = place.floor().as_ivec2();
        let Some(texel) = self.texel_at(place, own, side) else { return Vec3::ZERO };
        let light = self.light(texel, side);
        if light.w < 0.0 {
            return self.beside(place, own, (-1.0 - light.w) as u32, side);
        }
        let links = light.w as u32;
        let corner = (place - 0.5).floor();
        let share = place - 0.5 - corner;
        let mut sum = Vec4::ZERO;
        for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let along = |step: i32, share: f32| if step == 0 { 1.0 - share } else { share };
            let weight = along(x, share.x) * along(y, share.y);
            let way = corner.as_ivec2() + IVec2::new(x, y) - own;
            let light = if way == IVec2::ZERO { Some(light) } else { self.linked(links, own + way, way).map(|texel| self.light(texel, side)) };
            sum += light.map_or(Vec4::ZERO, |light| light.truncate().extend(1.0) * weight);
        }
        sum.truncate() / sum.w
    }

    /// What comes to a place whose cell has had no light, as all of its points are beneath a wall: that of the cells which are very near.
    fn beside(&self, place: Vec2, own: IVec2, links: u32, side: usize) -> Vec3 {
        let within = place - own.as_vec2();
        let toward = IVec2::select(within.cmpge(Vec2::splat(0.5)), IVec2::ONE, IVec2::NEG_ONE);
        let is_near = within.min(1.0 - within).cmplt(Vec2::splat(BESIDE_WALL));
        let mut sum = Vec4::ZERO;
        for along in [BVec2::new(true, false), BVec2::new(false, true), BVec2::TRUE] {
            let way = IVec2::select(along, toward, IVec2::ZERO);
            if (along & !is_near).any() || !is_same_chart(links, way.to_array()) {
                continue;
            }
            let light = self.texel_at(place, own + way, side).map(|texel| self.light(texel, side));
            sum += light.filter(|light| light.w >= 0.0).map_or(Vec4::ZERO, |light| light.truncate().extend(1.0));
        }
        sum.truncate() / sum.w.max(1.0)
    }

    /// The number of the texel of a cell that goes on from one by whose links it is so far away.
    fn linked(&self, links: u32, cell: IVec2, way: IVec2) -> Option<u32> {
        let part = link(links, way.to_array()).checked_sub(1)?;
        Some(self.cell(cell)?.x as u32 - 1 + part)
    }

    /// The number of the texel that a place is in; none where there is no surface.
    fn texel_at(&self, place: Vec2, cell: IVec2, side: usize) -> Option<u32> {
        let found = self.cell(cell)?;
        let first = (found.x as u32).checked_sub(1)?;
        let parts = [found.y, found.z, found.w].map(|part| part as u32);
        Some(first + part_at(parts, place - cell.as_vec2(), |part| self.light(first + part, side).w >= 0.0))
    }

    fn cell(&self, at: IVec2) -> Option<Vec4> {
        let edge = self.of.edge as i32;
        (at.cmpge(IVec2::ZERO).all() && at.cmplt(IVec2::splat(edge)).all()).then(|| self.data[self.of.first as usize + (at.y * edge + at.x) as usize])
    }

    /// Irradiance, and links, or −1 less those where there has been no light.
    fn light(&self, texel: u32, side: usize) -> Vec4 {
        self.data[self.of.lights() + (texel * self.of.sides) as usize + side]
    }
}

/// What links tell of the neighbour that is a step away along each axis: 0 for nothing, or the number of the texel in its cell + 1.
pub fn link(links: u32, way: [i32; 2]) -> u32 {
    links >> (LINK_BITS * number_of_neighbour(way)) & 3
}

fn is_same_chart(links: u32, way: [i32; 2]) -> bool {
    links >> (SAME_CHART + number_of_neighbour(way)) & 1 != 0
}

/// In [`NEIGHBOURS`](crate::scene::atlas::walls::NEIGHBOURS).
fn number_of_neighbour([x, y]: [i32; 2]) -> u32 {
    let at = 3 * (y + 1) + x + 1;
    (at - i32::from(at > 4)) as u32
}

/// How far from a cell whose points are all beneath a wall a place within may be, in cells.
const BESIDE_WALL: f32 = 0.15;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::atlas::walls::{NEIGHBOURS, packed};

    #[test]
    fn links_are_in_the_order_of_neighbours() {
        for (bit, way) in (0..).zip(NEIGHBOURS) {
            assert_eq!(link(2 << (LINK_BITS * bit), way), 2, "{way:?}");
            assert_eq!(link(!(3 << (LINK_BITS * bit)) & 0xffff, way), 0, "{way:?}");
            assert!(is_same_chart(1 << (SAME_CHART + bit), way) && !is_same_chart(!(1 << (SAME_CHART + bit)), way), "{way:?}");
        }
    }

    #[test]
    fn a_place_is_in_the_part_that_reaches_there() {
        // A wall a tenth of a cell from its left edge.
        let rows = || (0..10).map(|row| (row as f32 + 0.5) / 10.0);
        let columns =
            |from: f32, to: f32| rows().flat_map(|y| (0..9).map(move |step| Vec2::new(from + (to - from) * step as f32 / 8.0, y))).collect::<Vec<_>>();
        let (left, right) = (columns(0.01, 0.09), columns(0.11, 0.99));
        let parts = [packed(&right, &left), packed(&left, &right), 0];
        let found = |x: f32, y: f32| part_at(parts, Vec2::new(x, y), |_| true);
        for y in rows() {
            assert_eq!([found(0.05, y), found(0.15, y), found(0.6, y)], [1, 0, 0], "{y}");
        }
        // What no light has come to is beneath the wall.
        assert_eq!(part_at(parts, Vec2::new(0.5, 0.5), |part| part == 1), 1);
        assert_eq!(part_at([0; PARTS], Vec2::new(0.5, 0.5), |_| false), 0);
    }
}
