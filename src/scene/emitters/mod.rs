//! Light of emissive surfaces and the sky that a place reflects, by shadow rays on the host: `shaders/lib/light.wgsl` has the twins, with the same samples.

mod lamps;
mod sky;
pub mod tree;

use super::{
    Scene,
    bvh::Bvh,
    packets::{ALMOST, ShadowRays, ToDo, Until},
    sky::Suns,
    surface::Surface,
};
use crate::math::random::{hash, unit};
use fearless_simd::Simd;
use glam::{Vec2, Vec3, Vec4};
use lamps::AreaLight;
use tree::LightTree;

/// What emits light and is no point, made ready to be sampled: once for a scene.
pub struct Emission {
    area_lights: Vec<AreaLight>,
    pub tree: LightTree,
    pub suns: Suns,
}

impl Emission {
    pub fn of(scene: &Scene) -> Self {
        Self { area_lights: AreaLight::all(scene), tree: LightTree::new(scene), suns: Suns::new(&scene.environment) }
    }

    /// How many emissive triangles there are.
    pub fn lamps(&self) -> usize {
        self.area_lights.len()
    }

    /// The triangle of a lamp of the tree.
    pub fn triangle(&self, lamp: u32) -> u32 {
        self.area_lights[lamp as usize].triangle
    }
}

/// What lights surfaces.
pub struct Emitters<'a> {
    scene: &'a Scene,
    bvh: &'a Bvh,
    emission: &'a Emission,
    extent: f32,
    /// Shadow rays from a place to the lamps, to the broad sky and to its suns.
    area: u32,
    sky: u32,
    suns: u32,
}

/// Rays to suns beside so many to the rest of the sky: suns are small.
pub fn rays_to_suns(rays: u32) -> u32 {
    rays.div_ceil(2)
}

// All that runs within `dispatch!` is inlined into it: what is not would not have its instructions.
impl<'a> Emitters<'a> {
    /// By so many shadow rays from a place to lamps and to the sky, none where there is no such light; `emission` and `extent` are the scene's.
    pub fn new(scene: &'a Scene, bvh: &'a Bvh, extent: f32, emission: &'a Emission, [area, sky]: [u32; 2]) -> Self {
        let area = if emission.area_lights.is_empty() { 0 } else { area };
        let sky = if scene.environment.is_black() { 0 } else { sky };
        let suns = if emission.suns.shine() { rays_to_suns(sky) } else { 0 };
        Self { scene, bvh, emission, extent, area, sky, suns }
    }

    /// Whether there is any light.
    pub fn shine(&self) -> bool {
        self.area > 0 || self.sky > 0
    }

    /// Whether there is a sky.
    pub fn see_sky(&self) -> bool {
        self.sky > 0
    }

    /// Radiance that a surface reflects; `seed` shifts the samples.
    #[inline(always)]
    pub fn light<S: Simd>(&self, simd: S, surface: &Surface, seed: u32, to_do: &mut ToDo) -> Vec3 {
        let sharp = self.light_but_broad_sky(simd, surface, seed, to_do);
        if self.see_sky() { self.broad_sky(surface, seed, to_do).truncate() * surface.reflectance + sharp } else { sharp }
    }

    /// The mean radiance of the broad sky, by the cosine, that a surface sees, and the standard error of its luminance.
    #[inline(always)]
    pub fn broad_sky(&self, surface: &Surface, seed: u32, to_do: &mut ToDo) -> Vec4 {
        let random = |key: u32| unit(hash(seed.wrapping_add(key)));
        self.of_sky(surface, Vec2::new(random(3), random(4)), to_do)
    }

    /// Of all light but what the diffuse part reflects of the broad sky.
    #[inline(always)]
    pub fn light_but_broad_sky<S: Simd>(&self, simd: S, surface: &Surface, seed: u32, to_do: &mut ToDo) -> Vec3 {
        let random = |key: u32| unit(hash(seed.wrapping_add(key)));
        let mut sum = Vec3::ZERO;
        if self.area > 0 {
            sum += self.of_lamps(simd, surface, Vec3::new(random(0), random(1), random(2)), to_do);
        }
        if self.sky > 0 && surface.glossy.is_some() {
            sum += self.of_sky_by_lobe(surface, Vec2::new(random(13), random(14)), to_do);
        }
        if self.suns > 0 {
            sum += self.of_suns(surface, Vec3::new(random(15), random(16), random(17)), to_do);
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
}

/// Of a number ≥ 0 and below 2³¹; `f32::fract` calls a function.
#[inline(always)]
fn fraction(value: f32) -> f32 {
    value - value as i32 as f32
}

const GOLDEN: f32 = 0.618_034;

/// Steps of a lattice in the unit square.
const LATTICE: Vec2 = Vec2::new(0.754_877_7, 0.569_840_3);
