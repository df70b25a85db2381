//! What stands between points of one chart: a texel that a wall goes through is as many texels as it has parts, and light of neighbours is mixed only where nothing is between.

use super::{Cell, NONE, Part, Spot, neighbours};
use crate::math::{frame::Frame, hemisphere};
use crate::scene::{LightKind, Material, Scene, Triangle, bvh::Bvh};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Parts that a cell may have: two rooms, and the inside of the wall between them.
pub const PARTS: usize = 3;

/// Points by which a cell is divided.
pub(super) const POINTS: usize = 32;

/// How high above surfaces walls are looked for, over the width of a texel: lower than most things that hide light, and higher than a surface bulges.
const LIFT: f32 = 0.25;

/// Members of a part that a point looks to.
const LOOKS: usize = 4;

/// Rays along an edge of their square, by which it is found whether a point lies within something solid.
const RAYS: u32 = 8;

/// Of these, how many may tell otherwise.
const OTHERS: usize = 2;

/// How far away the insides of something solid are, over the width of a texel: what is larger may be a room.
const THICK: f32 = 16.0;

/// How many of the rays come out within that.
const NEAR: usize = 48;

/// Surfaces within each other that a ray goes into.
const DEEPEST: u32 = 4;

/// From a surface that a ray goes through on to the next, over the width of a texel.
const STEP: f32 = 1e-3;

/// How high above a surface they begin, over the width of a texel.
const ABOVE: f32 = 0.01;

/// Where the eight neighbours of a cell are, as links count them: `NEIGHBOURS` of the shader.
pub const NEIGHBOURS: [[i32; 2]; 8] = [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]];

/// Bits of a link.
pub const LINK_BITS: u32 = 2;

/// Where the bits start that tell of each neighbour whether it is of the same chart, with or without a wall between.
pub const SAME_CHART: u32 = 16;

/// All that hides light, as it is at rest.
pub(super) struct Walls {
    scene: Scene,
    bvh: Bvh,
    /// Of a texel [scene units].
    width: f32,
    /// Evenly over a half of all directions: those along a surface tell most of what stands open.
    rays: Vec<Vec3>,
    /// Whether surfaces tell their insides from their outsides: not where light comes from what would be within something solid.
    have_insides: bool,
}

/// A point of a surface.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub spot: Spot,
    /// In the texture [texels].
    pub at: Vec2,
    pub position: Vec3,
    /// Of its triangle's plane.
    pub normal: Vec3,
}

impl Walls {
    /// Among texels so wide.
    pub fn new(scene: &Scene, width: f32) -> Self {
        let opaque = |number: &u32| scene.materials.get(scene.at_rest(*number).material as usize).is_none_or(|material| material.alpha_cutoff.is_none());
        let triangles = (0..scene.triangles.len() as u32).filter(opaque).map(|number| Triangle { material: 0, ..*scene.at_rest(number) }).collect();
        let mut only_walls = Scene { triangles, materials: vec![Material::diffuse("wall", Vec3::ONE)], ..Scene::default() };
        let bvh = Bvh::build(&mut only_walls);
        let by_cosine = |cell: u32| hemisphere::ray(RAYS, [cell % RAYS, cell / RAYS], 0).as_vec3();
        let rays = (0..RAYS * RAYS).map(by_cosine).map(|ray| (ray.truncate() * (1.0 + ray.z * ray.z).sqrt()).extend(ray.z * ray.z)).collect();
        let mut walls = Self { scene: only_walls, bvh, width, rays, have_insides: true };
        walls.have_insides = !sources(scene).any(|source| walls.is_within(source));
        walls
    }

    /// Whether a point lies within something solid, where nobody ever sees it: a floor beneath a column.
    pub fn is_buried(&self, point: &Place, sides: usize) -> bool {
        let above = |normal: Vec3| (point.position + normal * (ABOVE * self.width), normal);
        let is_unseen = |place| self.is_void(place) || self.is_within(place);
        self.have_insides && self.is_within(above(point.normal)) && (sides == 1 || is_unseen(above(-point.normal)))
    }

    /// Whether all rays around a way come out of something solid, most of them soon.
    fn is_within(&self, (origin, way): (Vec3, Vec3)) -> bool {
        let frame = Frame::new(way);
        let (mut near, mut others) = (0, 0);
        self.rays.iter().all(|ray| {
            match self.way_out(origin, frame.to_world(*ray)) {
                Some(distance) => near += usize::from(distance < THICK * self.width),
                None => others += 1,
            }
            others <= OTHERS
        }) && near >= NEAR
    }

    /// How far away a ray comes out of something that it has not gone into before.
    fn way_out(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        let (mut depth, mut distance) = (0, 0.0);
        while depth <= DEEPEST {
            let hit = self.bvh.closest_blocker(&self.scene, origin + direction * distance, direction)?;
            let comes_out = self.scene.triangles[hit.triangle as usize].cross().dot(direction) > 0.0;
            if comes_out && depth == 0 {
                return Some(distance + hit.distance);
            }
            depth = if comes_out { depth - 1 } else { depth + 1 };
            distance += hit.distance + STEP * self.width;
        }
        None
    }

    /// Whether hardly a ray around a way meets anything.
    fn is_void(&self, (origin, way): (Vec3, Vec3)) -> bool {
        let frame = Frame::new(way);
        let meets = |ray: &&Vec3| self.bvh.occluded(&self.scene, origin, frame.to_world(**ray), f32::INFINITY);
        self.rays.iter().filter(meets).nth(OTHERS).is_none()
    }

    /// Whether something stands between two points, on one of their sides: the same from either.
    fn between(&self, a: &Place, b: &Place, side: usize) -> bool {
        let (a, b) = if a.position.to_array() <= b.position.to_array() { (a, b) } else { (b, a) };
        let lift = if side == 0 { LIFT * self.width } else { -LIFT * self.width };
        let from = a.position + a.normal * lift;
        let way = b.position + b.normal * lift - from;
        way != Vec3::ZERO && self.bvh.occluded(&self.scene, from, way, 1.0)
    }

    /// Points that see each other, those with the most points first.
    pub fn parts(&self, points: &[Place], sides: usize) -> Vec<Vec<usize>> {
        let mut parts: Vec<Vec<usize>> = Vec::new();
        for (number, point) in points.iter().enumerate() {
            let sees = |part: &Vec<usize>| {
                let mut nearest = part.clone();
                nearest.sort_by(|a, b| points[*a].at.distance_squared(point.at).total_cmp(&points[*b].at.distance_squared(point.at)));
                nearest.iter().take(LOOKS).any(|other| (0..sides).all(|side| !self.between(point, &points[*other], side)))
            };
            let (seen, mut apart): (Vec<_>, Vec<_>) = parts.into_iter().partition(sees);
            apart.push(seen.into_iter().flatten().chain([number]).collect());
            parts = apart;
        }
        parts.sort_by_key(|part| (usize::MAX - part.len(), part.iter().min().copied()));
        parts
    }

    /// Whether something stands between a point and any of the others.
    pub fn is_between(&self, point: &Place, mut others: impl Iterator<Item = Place>, sides: usize) -> bool {
        others.any(|other| (0..sides).any(|side| self.between(point, &other, side)))
    }

    /// Of each texel and side, which texel of each neighbouring cell of its chart nothing hides from it: 2 bits each, 0 for none, otherwise its number among those of the cell + 1; and a bit
    /// for each cell of its chart.
    pub fn links(&self, texels: &[Part], (cells, charts): (&[Cell], &[u32]), [edge, sides]: [u32; 2]) -> Vec<u32> {
        let link = |own: &Part, cell: u32, side: usize| {
            let first = cells[cell as usize].first as usize - 1;
            let others = &texels[first..first + cells[cell as usize].count()];
            let mut pairs: Vec<_> = (1..).zip(others).map(|(number, other)| (nearest_pair(&own.points, &other.points), number)).collect();
            pairs.sort_by(|(a, _), (b, _)| a.distance.total_cmp(&b.distance));
            pairs.iter().find(|(pair, _)| !self.between(&pair.one, &pair.other, side)).map_or(0, |(_, number)| *number)
        };
        let of_texel = |texel: &Part| {
            let chart = charts[texel.cell as usize];
            let goes_on = |cell: &u32| chart != NONE && charts[*cell as usize] == chart;
            let beside: Vec<(u32, u32)> = (0..).zip(neighbours(texel.cell, edge)).filter_map(|(bit, cell)| Some((bit, cell.filter(goes_on)?))).collect();
            let of_side = |side| beside.iter().map(|(bit, cell)| link(texel, *cell, side) << (LINK_BITS * bit) | 1 << (SAME_CHART + bit)).sum();
            (0..sides as usize).map(of_side).collect::<Vec<u32>>()
        };
        texels.par_iter().flat_map_iter(of_texel).collect()
    }
}

/// Where light comes from, some of it, and the ways that it goes.
fn sources(scene: &Scene) -> impl Iterator<Item = (Vec3, Vec3)> {
    let places = scene.lights.iter().filter_map(|light| match light.kind {
        LightKind::Point { position, .. } | LightKind::Spot { position, .. } => Some(position),
        LightKind::Directional { .. } => None,
    });
    let lights = places.flat_map(|position| Vec3::AXES.into_iter().flat_map(move |axis| [(position, axis), (position, -axis)]));
    let material = |number: u32| scene.materials.get(scene.at_rest(number).material as usize);
    let emitters: Vec<u32> = (0..scene.triangles.len() as u32).filter(|number| material(*number).is_some_and(Material::emits)).collect();
    let every = emitters.len().div_ceil(MOST_SOURCES).max(1);
    let middles = emitters.into_iter().step_by(every).flat_map(move |number| {
        let triangle = scene.at_rest(number);
        let (middle, size) = (triangle.positions.iter().sum::<Vec3>() / 3.0, triangle.cross().length().sqrt());
        let sides = if material(number).is_some_and(|material| material.two_sided) { 2 } else { 1 };
        [triangle.face_normal(), -triangle.face_normal()].into_iter().take(sides).map(move |normal| (middle + normal * (1e-3 * size), normal))
    });
    lights.chain(middles)
}

/// Emitters that are asked.
const MOST_SOURCES: usize = 256;

/// The two points of two lists that are the nearest in the texture.
struct Pair {
    one: Place,
    other: Place,
    /// Squared [cells²].
    distance: f32,
}

fn nearest_pair(one: &[Place], other: &[Place]) -> Pair {
    let mut nearest = Pair { one: one[0], other: other[0], distance: f32::INFINITY };
    for (a, b) in one.iter().flat_map(|a| other.iter().map(move |b| (a, b))) {
        let distance = a.at.distance_squared(b.at);
        if distance < nearest.distance {
            nearest = Pair { one: *a, other: *b, distance };
        }
    }
    nearest
}

/// A part of a cell for lookups, by its points within the cell: the middle, and how far it reaches to the others, 8 bits each. 0 is none.
pub fn packed(own: &[Vec2], others: &[Vec2]) -> u32 {
    let mean = |of: &[Vec2]| of.iter().sum::<Vec2>() / of.len().max(1) as f32;
    let middle = mean(own);
    let way = (mean(others) - middle).normalize_or_zero();
    let reach = own.iter().map(|point| (*point - middle).dot(way)).fold(0.0, f32::max);
    let bits = |number: f32| (number.clamp(0.0, 1.0) * 255.0).round() as u32;
    bits(middle.x) | bits(middle.y) << 8 | bits(reach).max(1) << 16
}
