//! Light of emissive surfaces and the sky that a place reflects, by shadow rays on the host: `shaders/lib/light.wgsl` has the twins, with the same samples.

use super::{
    Rgb, Scene,
    bvh::Bvh,
    packets::{ALMOST, RAYS, ShadowRays, ToDo, Until},
    surface::{Gloss, Surface},
};
use crate::math::{
    colour::luminance,
    frame::Frame,
    lobe::around,
    random::{hash, unit},
    spherical_triangle::SphericalTriangle,
    vectors::{LANES, Vectors},
};
use fearless_simd::{Simd, f32x8, prelude::*};
use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// An emissive triangle.
pub struct AreaLight {
    /// Running sum of area × luminance up to and including it.
    cumulative: f32,
    corner: Vec3,
    edges: [Vec3; 2],
    normal: Vec3,
    two_sided: bool,
    /// Emission over its luminance.
    hue: Rgb,
    /// Longest edge, squared [scene units²].
    longest: f32,
}

impl AreaLight {
    pub fn all(scene: &Scene) -> Vec<Self> {
        let light = |emitter: crate::scene::Emitter| {
            let triangle = &scene.triangles[emitter.triangle as usize];
            let material = &scene.materials[triangle.material as usize];
            let [a, b, c] = triangle.positions;
            let longest = [b - a, c - a, c - b].map(Vec3::length_squared).into_iter().fold(0.0, f32::max);
            Self {
                longest,
                cumulative: emitter.cumulative,
                corner: a,
                edges: [b - a, c - a],
                normal: triangle.face_normal(),
                two_sided: material.two_sided,
                hue: material.emission / (luminance(material.emission.as_dvec3()) as f32).max(f32::MIN_POSITIVE),
            }
        };
        scene.emitters().into_iter().map(light).collect()
    }
}

impl AreaLight {
    /// The way to a point of a lamp that is no farther than its longest edge is long, spread evenly over the solid angle that it covers, and what it stands for: the
    /// points of such a lamp are too unlike to be spread over its area. None where it is farther away, or too thin.
    #[inline(always)]
    fn near(&self, surface: &Surface, origin: Vec3, numbers: [f32; 2]) -> Option<(Vec3, f32)> {
        let corner = self.corner - origin;
        if (corner + (self.edges[0] + self.edges[1]) / 3.0).length_squared() >= self.longest {
            return None;
        }
        let seen = SphericalTriangle::new([corner, corner + self.edges[0], corner + self.edges[1]])?;
        let direction = seen.sample(numbers);
        let (leaving, arriving) = (-self.normal.dot(direction), surface.normal.dot(direction));
        let shines = (leaving > 0.0 || self.two_sided && leaving < 0.0) && arriving > 0.0 && surface.face.dot(direction) > 0.0;
        if !shines {
            return Some((Vec3::ZERO, 0.0));
        }
        let way = direction * (corner.dot(self.normal) / direction.dot(self.normal));
        let area = 0.5 * self.edges[0].cross(self.edges[1]).length();
        Some((way, arriving * seen.solid_angle / area))
    }
}

/// Emitters side by side.
struct Facing<S: Simd> {
    corner: Vectors<S>,
    edges: [Vectors<S>; 2],
    normal: Vectors<S>,
    /// 1 or 0.
    two_sided: f32x8<S>,
}

/// What lights surfaces.
pub struct Emitters<'a> {
    scene: &'a Scene,
    bvh: &'a Bvh,
    area_lights: &'a [AreaLight],
    extent: f32,
    /// Shadow rays from a place to the emitters and to the sky.
    area: u32,
    sky: u32,
}

/// Points of the emitters as a place sees them, each by the number of its ray.
struct Shining {
    rays: ShadowRays,
    area_lights: [u32; RAYS],
    /// The product of both cosines over the squared distance.
    form_factors: [f32; RAYS],
}

// All that runs within `dispatch!` is inlined into it: what is not would not have its instructions.
impl<'a> Emitters<'a> {
    /// By so many shadow rays from a place, none where there is no such light; `area_lights` are all of the scene, `extent` is its own.
    pub fn new(scene: &'a Scene, bvh: &'a Bvh, extent: f32, area_lights: &'a [AreaLight], [area, sky]: [u32; 2]) -> Self {
        let (area, sky) = (if area_lights.is_empty() { 0 } else { area }, if scene.environment.is_black() { 0 } else { sky });
        Self { scene, bvh, area_lights, extent, area, sky }
    }

    /// Whether there is any light.
    pub fn shine(&self) -> bool {
        self.area > 0 || self.sky > 0
    }

    /// Radiance that a surface reflects; `seed` shifts the samples.
    #[inline(always)]
    pub fn light<S: Simd>(&self, simd: S, surface: &Surface, seed: u32, to_do: &mut ToDo) -> Vec3 {
        let random = |key: u32| unit(hash(seed.wrapping_add(key)));
        let mut sum = Vec3::ZERO;
        if self.area > 0 {
            sum += self.of_lamps(simd, surface, Vec3::new(random(0), random(1), random(2)), to_do);
        }
        if self.sky > 0 {
            let (shift, frame) = (Vec2::new(random(3), random(4)), Frame::new(surface.normal));
            let to_sky = |i: f32| {
                let [height, azimuth] = self.of_sky(i, shift);
                Some((frame.to_world(around((1.0 - height).sqrt(), TAU * azimuth)), ()))
            };
            let light = self.of_the_sky(surface, to_do, to_sky, |(), direction| self.scene.environment.radiance(direction));
            sum += light * surface.reflectance / self.sky as f32;
        }
        if let Some(Gloss { lobe, frame, outgoing }) = surface.glossy.filter(|_| self.sky > 0) {
            let shift = Vec2::new(random(13), random(14));
            let to_sky = |i: f32| {
                let incoming = lobe.sample(outgoing, self.of_sky(i, shift));
                (incoming.z > 0.0).then(|| (frame.to_world(incoming), incoming))
            };
            let reflected = |incoming: Vec3, direction: Vec3| {
                let density = lobe.density(outgoing, incoming);
                let share = if density > 0.0 { lobe.value(outgoing, incoming) * (incoming.z / density) } else { Vec3::ZERO };
                share * self.scene.environment.radiance(direction)
            };
            sum += self.of_the_sky(surface, to_do, to_sky, reflected) / self.sky as f32;
        }
        sum
    }

    /// A bit for each of the rays that something blocks. A packet has to be worth its making.
    #[inline(always)]
    fn hidden(&self, origin: Vec3, rays: &ShadowRays, until: Until, to_do: &mut ToDo) -> u64 {
        if rays.all.count_ones() > 2 {
            return self.bvh.packets(self.scene).hidden(self.scene, origin, rays, until, to_do);
        }
        let limit = if until == Until::TheirEnd { ALMOST } else { f32::INFINITY };
        let (mut hidden, mut left) = (0, rays.all);
        while left != 0 {
            let ray = left.trailing_zeros();
            left &= left - 1;
            hidden |= u64::from(self.bvh.occluded(self.scene, origin, rays.directions[ray as usize], limit)) << ray;
        }
        hidden
    }

    /// The `i`th place of the sky's samples in the unit square.
    #[inline(always)]
    fn of_sky(&self, i: f32, shift: Vec2) -> [f32; 2] {
        [fraction(GOLDEN * i + shift.y), (i + shift.x) / self.sky as f32]
    }

    #[inline(always)]
    fn of_lamps<S: Simd>(&self, simd: S, surface: &Surface, shift: Vec3, to_do: &mut ToDo) -> Vec3 {
        let origin = surface.start(self.extent);
        let (mut arriving, mut glossy) = (Vec3::ZERO, Vec3::ZERO);
        for first in (0..self.area).step_by(RAYS) {
            let count = (self.area - first).min(RAYS as u32);
            let mut shining = Shining { rays: ShadowRays { directions: [Vec3::ZERO; RAYS], all: 0 }, area_lights: [0; RAYS], form_factors: [0.0; RAYS] };
            for group in (0..count).step_by(LANES) {
                self.sample_lamps(simd, surface, origin, shift, [first, group, count], &mut shining);
            }
            shining.rays.all &= u64::MAX >> (RAYS as u32 - count);
            let mut free = shining.rays.all & !self.hidden(origin, &shining.rays, Until::TheirEnd, to_do);
            while free != 0 {
                let ray = free.trailing_zeros() as usize % RAYS;
                free &= free - 1;
                let light = self.area_lights[shining.area_lights[ray] as usize].hue * shining.form_factors[ray];
                arriving += light;
                if let Some(Gloss { lobe, frame, outgoing }) = surface.glossy {
                    glossy += light * lobe.value(outgoing, frame.to_local(shining.rays.directions[ray].normalize()));
                }
            }
        }
        (arriving * surface.reflectance / PI + glossy) * (self.weight() / self.area as f32)
    }

    /// Of all emitters, area × luminance.
    #[inline(always)]
    fn weight(&self) -> f32 {
        self.area_lights.last().map_or(0.0, |last| last.cumulative)
    }

    /// The eight samples from the `group`th of the `count` from the `first` on: points in proportion to area × luminance, in strata of the running sum, within
    /// the triangle by a lattice.
    #[inline(always)]
    fn sample_lamps<S: Simd>(&self, simd: S, surface: &Surface, origin: Vec3, shift: Vec3, [first, group, count]: [u32; 3], shining: &mut Shining) {
        let (group, count) = (group as usize, count as usize);
        let mut area_lights = [0; LANES];
        let mut numbers = [0.0; LANES];
        for lane in 0..LANES {
            numbers[lane] = first as f32 + (group + lane) as f32;
            let at = (numbers[lane] + shift.x) / self.area as f32 * self.weight();
            area_lights[lane] = self.area_lights.partition_point(|light| light.cumulative <= at).min(self.area_lights.len() - 1);
        }
        let i = f32x8::load_array(simd, numbers);
        let (u, v) = ((i * LATTICE.x + shift.y).fract(), (i * LATTICE.y + shift.z).fract());
        let root = u.sqrt();
        let Facing { corner, edges, normal, two_sided } = self.facing(simd, &area_lights);
        let point = corner.plus(edges[0].scaled(root * (1.0 - v))).plus(edges[1].scaled(root * v));
        let way = point.minus(Vectors::splat(simd, origin));
        let squared = way.dot(way).max(1e-30);
        let inverse = 1.0 / squared.sqrt();
        let leaving = -normal.dot(way) * inverse;
        let leaving = leaving.max(leaving.abs() * two_sided);
        let arriving = way.product(surface.normal) * inverse;
        let zero = f32x8::splat(simd, 0.0);
        let shines = leaving.simd_gt(zero) & arriving.simd_gt(zero) & way.product(surface.face).simd_gt(zero);
        let [x, y, z] = [way.x.to_array(), way.y.to_array(), way.z.to_array()];
        for lane in 0..LANES {
            shining.rays.directions[group + lane] = Vec3::new(x[lane], y[lane], z[lane]);
            shining.area_lights[group + lane] = area_lights[lane] as u32;
        }
        shining.form_factors[group..group + LANES].copy_from_slice(&(leaving * arriving / squared).to_array());
        shining.rays.all |= shines.to_bitmask() << group;
        let (u, v) = (u.to_array(), v.to_array());
        for lane in 0..LANES.min(count - group) {
            let near = self.area_lights[area_lights[lane]].near(surface, origin, [u[lane], v[lane]]);
            let Some((way, form_factor)) = near else { continue };
            let ray = group + lane;
            (shining.rays.directions[ray], shining.form_factors[ray]) = (way, form_factor);
            shining.rays.all = shining.rays.all & !(1 << ray) | u64::from(form_factor > 0.0) << ray;
        }
    }

    /// The emitters of eight samples, which mostly are one.
    #[inline(always)]
    fn facing<S: Simd>(&self, simd: S, area_lights: &[usize; LANES]) -> Facing<S> {
        let mut numbers = [[0.0; LANES]; 13];
        for lane in 0..LANES {
            let AreaLight { corner, edges: [first, second], normal, two_sided, .. } = &self.area_lights[area_lights[lane]];
            for (at, vector) in [corner, first, second, normal].into_iter().enumerate() {
                numbers[3 * at][lane] = vector.x;
                numbers[3 * at + 1][lane] = vector.y;
                numbers[3 * at + 2][lane] = vector.z;
            }
            numbers[12][lane] = f32::from(u8::from(*two_sided));
        }
        let vectors = |at: usize| Vectors::load(simd, &[numbers[at], numbers[at + 1], numbers[at + 2]]);
        Facing { corner: vectors(0), edges: [vectors(3), vectors(6)], normal: vectors(9), two_sided: f32x8::load_array(simd, numbers[12]) }
    }

    /// The sum over rays to the sky of what is `reflected` of those that nothing blocks, by what `way` says of them and their directions.
    #[inline(always)]
    fn of_the_sky<T: Copy + Default>(
        &self,
        surface: &Surface,
        to_do: &mut ToDo,
        way: impl Fn(f32) -> Option<(Vec3, T)>,
        reflected: impl Fn(T, Vec3) -> Vec3,
    ) -> Vec3 {
        let origin = surface.start(self.extent);
        let mut sum = Vec3::ZERO;
        for first in (0..self.sky).step_by(RAYS) {
            let mut rays = ShadowRays { directions: [Vec3::ZERO; RAYS], all: 0 };
            let mut carried = [T::default(); RAYS];
            let count = (self.sky - first).min(RAYS as u32) as usize;
            for (ray, carried) in carried[..count].iter_mut().enumerate() {
                let Some((direction, what)) = way((first as usize + ray) as f32) else { continue };
                (rays.directions[ray], *carried) = (direction, what);
                rays.all |= u64::from(direction.dot(surface.face) > 0.0) << ray;
            }
            let mut free = rays.all & !self.hidden(origin, &rays, Until::Forever, to_do);
            while free != 0 {
                let ray = free.trailing_zeros() as usize % RAYS;
                free &= free - 1;
                sum += reflected(carried[ray], rays.directions[ray]);
            }
        }
        sum
    }
}

/// Of a number ≥ 0 and below 2³¹; `f32::fract` calls a function.
#[inline(always)]
fn fraction(value: f32) -> f32 {
    value - value as i32 as f32
}

const GOLDEN: f32 = 0.618_034;
const LATTICE: Vec2 = Vec2::new(0.754_877_7, 0.569_840_3);
