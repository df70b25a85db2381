//! What lobes of the surfaces that samples see reflect of light that other surfaces reflect: `shaders/lib/lobe_walk.wgsl` has the twin.
//!
//! A sample that meets a lobe goes on, by the lobe or not, as chance has it, until it stays at a surface: there the irradiance field is asked. On its way it gathers what
//! surfaces reflect of direct light.

use super::{Hit, Point, Shading};
use crate::math::random::{combine, hash, unit};
use crate::scene::{
    Rgb,
    packets::{ALMOST, ToDo},
    surface::{Gloss, Ray, Surface},
};
use fearless_simd::Simd;
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

/// Lobes that a sample may go on by; the last reflects what the field tells as if it came alike from all sides.
const MOST_LOBES: u32 = 4;

/// Apart from the seeds of lights.
const FIRST_SEED: u32 = 101;

/// What a sample that met a lobe found.
#[derive(Clone, Copy)]
pub(super) struct Walked {
    /// What other surfaces reflect of direct light, and lobes of that [W m⁻² sr⁻¹].
    pub light: Vec3,
    /// Where it stayed; black where it left the scene.
    pub hit: Hit,
}

/// The way on from a surface by its lobe.
struct Step {
    direction: Vec3,
    /// What is reflected of the light from there, over how often it is drawn.
    share: Rgb,
}

// All that runs within `dispatch!` is inlined into it: what is not would not have its instructions.
impl Shading<'_> {
    #[inline(always)]
    pub(super) fn walk<S: Simd>(&self, simd: S, (first, of_triangle): (&Surface, u32), seed: u32, to_do: &mut ToDo) -> Walked {
        let (mut at, mut triangle, mut share, mut light) = (*first, of_triangle, Vec3::ONE, Vec3::ZERO);
        for number in 0..MOST_LOBES {
            let Some(gloss) = at.glossy else { break };
            let seed = combine(seed, FIRST_SEED + number);
            let by_lobe = if at.reflectance == Vec3::ZERO { 1.0 } else { gloss.lobe.share(at.reflectance) };
            if unit(hash(seed ^ 0x1656_67b1)) >= by_lobe {
                return Walked { light, hit: hit((&at, triangle), share / (1.0 - by_lobe), Vec3::ZERO) };
            }
            let met = step(&at, &gloss, seed, by_lobe).and_then(|step| {
                share *= step.share;
                self.seen_from(&at, step.direction)
            });
            let Some((next_triangle, next)) = met else { return Walked { light, hit: Hit::NONE } };
            light += share * self.direct(simd, &next, seed, to_do);
            (at, triangle) = (next, next_triangle);
        }
        let left = at.glossy.map_or(Vec3::ZERO, |gloss| gloss.lobe.albedo(gloss.outgoing));
        Walked { light, hit: hit((&at, triangle), share, left) }
    }

    fn seen_from(&self, at: &Surface, direction: Vec3) -> Option<(u32, Surface)> {
        let origin = at.start(self.extent);
        let hit = self.bvh.closest_hit(self.scene, origin, direction, f32::INFINITY)?;
        Some((hit.triangle, self.scene.surface(hit.triangle, hit.barycentric, Ray::new(origin, direction))))
    }

    /// What a surface reflects of direct light.
    #[inline(always)]
    fn direct<S: Simd>(&self, simd: S, at: &Surface, seed: u32, to_do: &mut ToDo) -> Vec3 {
        let lit = self.lit(at);
        let origin = at.start(self.extent);
        let mut light = self.emitters.light(simd, &lit, seed, to_do);
        for source in &self.scene.lights {
            let Some((way, distance, reflected)) = lit.reflected(&source.kind, origin) else { continue };
            if !(source.shadows && self.bvh.occluded(self.scene, origin, way, ALMOST * distance)) {
                light += reflected;
            }
        }
        light
    }
}

fn step(at: &Surface, gloss: &Gloss, seed: u32, by_lobe: f32) -> Option<Step> {
    let incoming = gloss.lobe.sample(gloss.outgoing, [0x5bd1_e995, 0x27d4_eb2f].map(|key| unit(hash(seed ^ key))));
    let density = by_lobe * gloss.lobe.density(gloss.outgoing, incoming);
    let direction = gloss.frame.to_world(incoming).try_normalize()?;
    let is_above = incoming.z > 0.0 && density > 0.0 && at.face.dot(direction) > 0.0;
    is_above.then(|| Step { direction, share: gloss.lobe.value(gloss.outgoing, incoming) * (incoming.z / density) })
}

fn hit((at, triangle): (&Surface, u32), share: Rgb, by_lobe: Rgb) -> Hit {
    Hit { at: Point { position: at.position, normal: at.normal, triangle: triangle + 1 }, reflectance: share * (at.reflectance + by_lobe) * FRAC_1_PI }
}
