//! Light at its source: punctual lights, and points drawn on emitters and on the sky.

use super::luminance;
use crate::math::{choice::Choice, random::triangle_point};
use crate::scene::{
    bvh::is_hole,
    model::{Material, Rgb, Scene, Triangle},
    sky::Sky,
};
use glam::Vec3;

/// Everything with an extent that shines: emissive triangles by area × luminance, and a latitude-longitude sky by its
/// texels. A constant sky is left to the rays, which sample it best.
pub struct Sources {
    emitters: Vec<u32>,
    power: Choice,
    sky: Option<Sky>,
    /// Probability of choosing the sky.
    sky_share: f64,
    visible: bool,
}

/// A point of a source, seen from a receiver.
pub struct Sample {
    pub direction: Vec3,
    /// Distance to the point, infinite for the sky [scene units].
    pub distance: f32,
    /// Radiance toward the receiver [W m⁻² sr⁻¹].
    pub radiance: Rgb,
    /// Density of the choice over solid angle [1/sr].
    pub density: f64,
}

impl Sources {
    pub fn new(scene: &Scene) -> Self {
        let material = |t: &Triangle| &scene.materials[t.material as usize];
        let emitters: Vec<u32> = (0..scene.triangles.len() as u32).filter(|&i| material(&scene.triangles[i as usize]).emits()).collect();
        let weight = |&i: &u32| {
            let triangle = &scene.triangles[i as usize];
            triangle.cross().as_dvec3().length() / 2.0 * emission_luminance(material(triangle))
        };
        let power = Choice::new(emitters.iter().map(weight));
        let sky = Sky::new(&scene.environment);
        let sky_share = match (&sky, power.total() > 0.0) {
            (None, _) => 0.0,
            (Some(_), true) => 0.5,
            (Some(_), false) => 1.0,
        };
        Self { visible: power.total() > 0.0 || !scene.environment.is_black(), emitters, power, sky, sky_share }
    }

    /// Whether a ray may meet any light.
    pub fn visible(&self) -> bool {
        self.visible
    }

    /// Draws a point of a source as seen from `receiver`; none where there is no source or it does not shine there.
    pub fn sample(&self, scene: &Scene, receiver: Vec3, [a, b]: [f64; 2]) -> Option<Sample> {
        match &self.sky {
            Some(sky) if a < self.sky_share => {
                let direction = sky.sample([a / self.sky_share, b])?;
                let radiance = scene.environment.radiance(direction);
                Some(Sample { direction, distance: f32::INFINITY, radiance, density: self.sky_density(direction) })
            }
            _ if self.power.total() > 0.0 => self.sample_emitter(scene, receiver, [(a - self.sky_share) / (1.0 - self.sky_share), b]),
            _ => None,
        }
    }

    fn sample_emitter(&self, scene: &Scene, receiver: Vec3, [a, b]: [f64; 2]) -> Option<Sample> {
        let (index, rest) = self.power.pick(a);
        let triangle = &scene.triangles[self.emitters[index] as usize];
        let material = &scene.materials[triangle.material as usize];
        let barycentric = triangle_point([rest, b]);
        let to = triangle.position(barycentric) - receiver;
        let distance = to.length();
        let direction = (to / distance).try_normalize()?;
        let cosine = -direction.dot(triangle.face_normal());
        let shines = material.two_sided || cosine > 0.0;
        if !shines || is_hole(triangle, material, &scene.textures, barycentric) {
            return None;
        }
        Some(Sample { direction, distance, radiance: material.emission, density: self.emitter_density(material.emission, distance, cosine.abs()) })
    }

    /// Density with which [`Self::sample`] would have chosen a point of an emitter [1/sr]; `cosine` is the emitter's.
    pub fn emitter_density(&self, emission: Rgb, distance: f32, cosine: f32) -> f64 {
        let per_area = (1.0 - self.sky_share) * luminance(emission.as_dvec3()) / self.power.total();
        per_area * (distance as f64).powi(2) / cosine.max(f32::MIN_POSITIVE) as f64
    }

    /// Density with which [`Self::sample`] would have chosen a direction of the sky [1/sr].
    pub fn sky_density(&self, direction: Vec3) -> f64 {
        self.sky.as_ref().map_or(0.0, |sky| self.sky_share * sky.density(direction))
    }
}

fn emission_luminance(material: &Material) -> f64 {
    luminance(material.emission.as_dvec3())
}
