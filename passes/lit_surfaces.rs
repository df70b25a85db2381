//! Direct light at surfaces side by side, by shadow rays on the host: where the device is a driver on the same cores, each lane of it walks the hierarchy and looks emitters up
//! alone, while rays that share a point, 64 from a surface to emitters or from a light to 64 surfaces, can share most of both.

use crate::scene::{
    Light, Scene,
    bvh::Bvh,
    emitters::Emitters,
    packets::{RAYS, ShadowRays, ToDo},
    surface::Surface,
};
use fearless_simd::{Level, dispatch};
use glam::Vec3;

/// A surface, and the light that it reflects.
pub struct Lit {
    /// What it is to whoever asks.
    pub place: u32,
    pub surface: Surface,
    /// Of its rays.
    pub seed: u32,
    /// [W m⁻² sr⁻¹]
    pub light: Vec3,
}

/// What surfaces are lit by.
pub struct Lighting<'a> {
    pub scene: &'a Scene,
    pub bvh: &'a Bvh,
    /// Of the scene [scene units].
    pub extent: f32,
    pub lights: &'a [Light],
    pub emitters: Emitters<'a>,
}

impl Lighting<'_> {
    /// Adds what reaches up to 64 surfaces, but for what they reflect diffusely of the broad sky.
    pub fn light(&self, surfaces: &mut [Lit], to_do: &mut ToDo) {
        for light in self.lights {
            self.add_light(light, surfaces, to_do);
        }
        if self.emitters.shine() {
            for Lit { surface, seed, light, .. } in surfaces {
                *light += dispatch!(Level::new(), simd => self.emitters.light_but_broad_sky(simd, surface, *seed, to_do));
            }
        }
    }

    fn add_light(&self, light: &Light, surfaces: &mut [Lit], to_do: &mut ToDo) {
        let mut reflected = [Vec3::ZERO; RAYS];
        let mut rays = ShadowRays { directions: [Vec3::ZERO; RAYS], all: 0 };
        for (ray, Lit { surface, .. }) in surfaces.iter().enumerate() {
            let Some((_, _, light)) = surface.reflected(&light.kind, surface.position) else { continue };
            reflected[ray] = light;
            rays.directions[ray] = surface.start(self.extent);
            rays.all |= 1 << ray;
        }
        let hidden = if light.shadows { self.bvh.hidden_from(self.scene, self.extent, &light.kind, &mut rays, to_do) } else { 0 };
        for (ray, lit) in surfaces.iter_mut().enumerate().filter(|(ray, _)| rays.all & !hidden & 1 << ray != 0) {
            lit.light += reflected[ray];
        }
    }
}
