//! Light of emissive triangles: points of the lamps that matter to a place, and shadow rays to them.

use super::{Emitters, LATTICE, tree::Choice};
use crate::math::{
    colour::luminance,
    spherical_triangle::SphericalTriangle,
    vectors::{LANES, Vectors},
};
use crate::scene::{
    Rgb, Scene,
    packets::{RAYS, ShadowRays, ToDo, Until},
    surface::{Ray, Surface},
};
use fearless_simd::{Simd, f32x8, prelude::*};
use glam::Vec3;
use std::f32::consts::PI;

/// An emissive triangle.
pub(super) struct AreaLight {
    pub(super) triangle: u32,
    corner: Vec3,
    edges: [Vec3; 2],
    normal: Vec3,
    two_sided: bool,
    /// Emission over the luminance of its mean, where it is the same all over.
    hue: Option<Rgb>,
    /// One over the luminance of its mean.
    share: f32,
    /// Longest edge, squared [scene units²].
    longest: f32,
}

impl AreaLight {
    /// All of a scene, in the order of [`Scene::emitters`].
    pub(super) fn all(scene: &Scene) -> Vec<Self> {
        let light = |number: u32| {
            let triangle = &scene.triangles[number as usize];
            let material = &scene.materials[triangle.material as usize];
            let [a, b, c] = triangle.positions;
            let share = 1.0 / (luminance(scene.mean_emission(number).as_dvec3()) as f32).max(f32::MIN_POSITIVE);
            let longest = [b - a, c - a, c - b].map(Vec3::length_squared).into_iter().fold(0.0, f32::max);
            Self {
                triangle: number,
                longest,
                corner: a,
                edges: [b - a, c - a],
                normal: triangle.face_normal(),
                two_sided: material.two_sided,
                hue: material.maps.emission.is_none().then_some(material.emission * share),
                share,
            }
        };
        scene.emitters().into_iter().map(light).collect()
    }

    /// Emission over the luminance of the lamp's mean, at a way from a place.
    #[inline(always)]
    fn hue(&self, scene: &Scene, origin: Vec3, way: Vec3) -> Rgb {
        self.hue.unwrap_or_else(|| self.hue_there(scene, Ray::new(origin, way)))
    }

    #[cold]
    fn hue_there(&self, scene: &Scene, ray: Ray) -> Rgb {
        let triangle = &scene.triangles[self.triangle as usize];
        scene.emission(self.triangle, triangle.barycentric(ray)) * self.share
    }

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

/// Points of the lamps as a place sees them, each by the number of its ray.
struct Shining<const AT_ONCE: usize> {
    rays: ShadowRays,
    chosen: [Choice; AT_ONCE],
    /// The product of both cosines over the squared distance.
    form_factors: [f32; AT_ONCE],
}

// All that runs within `dispatch!` is inlined into it: what is not would not have its instructions.
impl Emitters<'_> {
    #[inline(always)]
    pub(super) fn of_lamps<S: Simd>(&self, simd: S, surface: &Surface, shift: Vec3, to_do: &mut ToDo) -> Vec3 {
        // Memory for 64 takes a while to be cleared.
        if self.area as usize <= LANES {
            self.of_lamps_at_once::<S, LANES>(simd, surface, shift, to_do)
        } else {
            self.of_lamps_at_once::<S, RAYS>(simd, surface, shift, to_do)
        }
    }

    #[inline(always)]
    fn of_lamps_at_once<S: Simd, const AT_ONCE: usize>(&self, simd: S, surface: &Surface, shift: Vec3, to_do: &mut ToDo) -> Vec3 {
        let origin = surface.start(self.extent);
        let (mut arriving, mut glossy) = (Vec3::ZERO, Vec3::ZERO);
        for first in (0..self.area).step_by(AT_ONCE) {
            let count = (self.area - first).min(AT_ONCE as u32);
            let mut shining =
                Shining { rays: ShadowRays { directions: [Vec3::ZERO; RAYS], all: 0 }, chosen: [Choice::default(); AT_ONCE], form_factors: [0.0; AT_ONCE] };
            let place = |sample: u32| ((first + sample) as f32 + shift.x) / self.area as f32;
            self.emission.tree.choose(simd, [origin, surface.normal], place, count, &mut shining.chosen);
            for group in (0..count).step_by(LANES) {
                self.sample_lamps(simd, surface, origin, shift, [first, group, count], &mut shining);
            }
            shining.rays.all &= u64::MAX >> (RAYS as u32 - count);
            let mut free = shining.rays.all & !self.hidden(origin, &shining.rays, Until::TheirEnd, to_do);
            while free != 0 {
                let ray = free.trailing_zeros() as usize % AT_ONCE;
                free &= free - 1;
                let Choice { lamp, weight } = shining.chosen[ray];
                let hue = self.emission.area_lights[lamp as usize].hue(self.scene, origin, shining.rays.directions[ray]);
                let light = hue * (weight * shining.form_factors[ray]);
                arriving += light;
                if let Some(gloss) = surface.glossy {
                    glossy += light * gloss.value(shining.rays.directions[ray].normalize());
                }
            }
        }
        (arriving * surface.reflectance / PI + glossy) / self.area as f32
    }

    /// The eight samples from the `group`th of the `count` from the `first` on: points of the lamps that were chosen, within the triangle by a lattice.
    #[inline(always)]
    fn sample_lamps<S: Simd, const AT_ONCE: usize>(
        &self,
        simd: S,
        surface: &Surface,
        origin: Vec3,
        shift: Vec3,
        [first, group, count]: [u32; 3],
        shining: &mut Shining<AT_ONCE>,
    ) {
        let (group, count) = (group as usize, count as usize);
        let area_lights: [usize; LANES] = std::array::from_fn(|lane| shining.chosen[group + lane].lamp as usize);
        let i = f32x8::load_array(simd, std::array::from_fn(|lane| first as f32 + (group + lane) as f32));
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
        }
        shining.form_factors[group..group + LANES].copy_from_slice(&(leaving * arriving / squared).to_array());
        let may_matter = (0..LANES).map(|lane| u64::from(shining.chosen[group + lane].weight > 0.0) << lane).sum::<u64>();
        shining.rays.all |= (shines.to_bitmask() & may_matter) << group;
        let (u, v) = (u.to_array(), v.to_array());
        for lane in 0..LANES.min(count - group) {
            let near = self.emission.area_lights[area_lights[lane]].near(surface, origin, [u[lane], v[lane]]);
            let Some((way, form_factor)) = near.filter(|_| shining.chosen[group + lane].weight > 0.0) else { continue };
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
            let AreaLight { corner, edges: [first, second], normal, two_sided, .. } = &self.emission.area_lights[area_lights[lane]];
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
}
