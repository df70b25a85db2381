//! Light at its source: punctual lights, and points drawn on emitters and on the sky.

use crate::math::random::triangle_point;
use crate::scene::{
    bvh::is_hole,
    emitters::tree::LightTree,
    model::{Rgb, Scene},
    sky::Sky,
};
use fearless_simd::{Level, dispatch};
use glam::Vec3;

/// Everything with an extent that shines: emissive triangles by how they matter to a place, and a latitude-longitude sky by its
/// texels. A constant sky is left to the rays, which sample it best.
pub struct Sources {
    /// Rising.
    emitters: Vec<u32>,
    tree: LightTree,
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
        let emitters = scene.emitters();
        let sky = Sky::new(&scene.environment);
        let sky_share = match (&sky, emitters.is_empty()) {
            (None, _) => 0.0,
            (Some(_), false) => 0.5,
            (Some(_), true) => 1.0,
        };
        Self { visible: !emitters.is_empty() || !scene.environment.is_black(), emitters, tree: LightTree::new(scene), sky, sky_share }
    }

    /// Whether a ray may meet any light.
    pub fn visible(&self) -> bool {
        self.visible
    }

    /// Draws a point of a source as a receiver sees it, by its place and its normal; none where there is no source or it does not shine there.
    pub fn sample(&self, scene: &Scene, receiver: [Vec3; 2], [a, b]: [f64; 2]) -> Option<Sample> {
        match &self.sky {
            Some(sky) if a < self.sky_share => {
                let direction = sky.sample([a / self.sky_share, b])?;
                let radiance = scene.environment.radiance(direction);
                Some(Sample { direction, distance: f32::INFINITY, radiance, density: self.sky_density(direction) })
            }
            _ => self.sample_emitter(scene, receiver, [(a - self.sky_share) / (1.0 - self.sky_share), b]),
        }
    }

    fn sample_emitter(&self, scene: &Scene, receiver: [Vec3; 2], [a, b]: [f64; 2]) -> Option<Sample> {
        let (lamp, rest) = dispatch!(Level::new(), simd => self.tree.pick(simd, receiver, a))?;
        let number = self.emitters[lamp as usize];
        let triangle = &scene.triangles[number as usize];
        let material = &scene.materials[triangle.material as usize];
        let barycentric = triangle_point([rest, b]);
        let to = triangle.position(barycentric) - receiver[0];
        let distance = to.length();
        let direction = (to / distance).try_normalize()?;
        let cosine = -direction.dot(triangle.face_normal());
        let shines = material.two_sided || cosine > 0.0;
        if !shines || is_hole(triangle, material, &scene.textures, barycentric) {
            return None;
        }
        Some(Sample {
            direction,
            distance,
            radiance: scene.emission(number, barycentric),
            density: self.emitter_density(scene, receiver, number, distance, cosine.abs()),
        })
    }

    /// Density with which [`Self::sample`] would have chosen a point of an emissive triangle [1/sr]; `cosine` is the emitter's.
    pub fn emitter_density(&self, scene: &Scene, receiver: [Vec3; 2], triangle: u32, distance: f32, cosine: f32) -> f64 {
        let Ok(lamp) = self.emitters.binary_search(&triangle) else { return 0.0 };
        let share = f64::from(dispatch!(Level::new(), simd => self.tree.probability(simd, receiver, lamp as u32)));
        let area = 0.5 * f64::from(scene.triangles[triangle as usize].cross().length());
        (1.0 - self.sky_share) * share / area * f64::from(distance).powi(2) / f64::from(cosine.max(f32::MIN_POSITIVE))
    }

    /// Density with which [`Self::sample`] would have chosen a direction of the sky [1/sr].
    pub fn sky_density(&self, direction: Vec3) -> f64 {
        self.sky.as_ref().map_or(0.0, |sky| self.sky_share * sky.density(direction))
    }
}
