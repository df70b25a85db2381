//! Photons on their way: from a source through a scene, until one is absorbed.

use crate::math::{
    colour::luminance,
    frame::Frame,
    lobe::around,
    random::{combine, hash, unit},
};
use crate::passes::photons::{Photon, ways};
use crate::scene::{
    Rgb, Scene,
    bvh::Bvh,
    sources::Sources,
    surface::{Ray, Surface},
    surface_offset,
};
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, TAU};

/// Light that arrives at a grazing angle of the plane and not of the shading normal counts no more than so many times.
const MOST_BY_SHADING: f32 = 4.0;

/// What photons go through.
pub(super) struct Tracer<'a> {
    pub scene: &'a Scene,
    pub bvh: &'a Bvh,
    pub sources: Sources,
    /// Of the scene [scene units].
    pub extent: f32,
    /// Whether lobes reflect; otherwise surfaces are taken by their albedo.
    pub lobes: bool,
    /// Most surfaces that a photon meets.
    pub legs: u32,
}

/// Where a photon has been, its first surface left out: what it brings there is direct light.
#[derive(Default)]
pub(super) struct Path {
    pub photons: Vec<Photon>,
    /// Whether it was still on its way after the last leg.
    pub is_cut_off: bool,
}

impl Tracer<'_> {
    /// The way of a photon by its number. Flux is all of the light's, were it the only one.
    pub fn path(&self, number: u32) -> Path {
        let mut path = Path::default();
        let Some(emitted) = self.sources.emit(self.scene, number) else { return path };
        let (mut ray, mut flux) = (Ray { origin: emitted.origin, direction: emitted.direction }, emitted.flux);
        for leg in 0..self.legs {
            let Some(hit) = self.bvh.closest_blocker(self.scene, ray.origin, ray.direction) else { return path };
            let surface = match self.lobes {
                true => self.scene.lit_surface(hit.triangle, hit.barycentric, ray),
                false => self.scene.diffuse_surface(hit.triangle, hit.barycentric, ray),
            };
            // The side that light comes from is the back of a one-sided surface: nobody sees what it reflects.
            let triangle = &self.scene.triangles[hit.triangle as usize];
            let is_back = triangle.cross().dot(ray.direction) > 0.0 && !self.scene.materials[triangle.material as usize].two_sided;
            if is_back {
                return path;
            }
            flux *= by_shading(&surface, ray.direction);
            if leg > 0 {
                path.photons.push(Photon { position: surface.position.into(), leg: hit.distance, flux: flux.into(), ways: ways(surface.face, -ray.direction) });
            }
            let seed = combine(number, leg);
            let Some((direction, share)) = scattered(&surface, seed) else { return path };
            let survival = share.max_element().min(1.0);
            if unit(hash(seed ^ 0x68bc_21eb)) >= survival {
                return path;
            }
            flux *= share / survival;
            ray = Ray { origin: surface.position + surface.face * surface_offset(self.extent, surface.position), direction };
        }
        path.is_cut_off = true;
        path
    }
}

/// Irradiance is that of the shading normal: what light along a direction gives it, as a share of what it gives the plane.
fn by_shading(surface: &Surface, direction: Vec3) -> f32 {
    let [shaded, plane] = [surface.normal, surface.face].map(|normal| -normal.dot(direction));
    if plane > 0.0 { (shaded / plane).clamp(0.0, MOST_BY_SHADING) } else { 0.0 }
}

/// A direction in which light goes on, and its share of what arrived; none where it would go into the surface.
fn scattered(surface: &Surface, seed: u32) -> Option<(Vec3, Rgb)> {
    let [u, v, choice] = [0x5bd1_e995, 0x27d4_eb2f, 0x1656_67b1].map(|key| unit(hash(seed ^ key)));
    let Some(gloss) = &surface.glossy else { return Some((cosine_direction(surface.face, [u, v]), surface.reflectance)) };
    let [lobe, diffuse] = [gloss.lobe.reflectance, surface.reflectance].map(|colour| luminance(colour.as_dvec3()) as f32);
    // Either is drawn at times, as what a lobe reflects grows toward its horizon.
    let by_lobe = (lobe / (lobe + diffuse).max(f32::MIN_POSITIVE)).clamp(0.1, 0.9);
    let direction = match choice < by_lobe {
        true => gloss.frame.to_world(gloss.lobe.sample(gloss.outgoing, [u, v])).try_normalize()?,
        false => cosine_direction(surface.face, [u, v]),
    };
    let (leaving, cosine) = (gloss.frame.to_local(direction), surface.face.dot(direction));
    if cosine <= 0.0 || leaving.z <= 0.0 {
        return None;
    }
    let density = by_lobe * gloss.lobe.density(gloss.outgoing, leaving) + (1.0 - by_lobe) * cosine * FRAC_1_PI;
    let reflected = surface.reflectance * gloss.lobe.leaves(leaving.z) * FRAC_1_PI + gloss.lobe.value(gloss.outgoing, leaving);
    Some((direction, reflected * (cosine / density.max(f32::MIN_POSITIVE))))
}

fn cosine_direction(normal: Vec3, [u, v]: [f32; 2]) -> Vec3 {
    Frame::new(normal).to_world(around((1.0 - u).sqrt(), TAU * v))
}
