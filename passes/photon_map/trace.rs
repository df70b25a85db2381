//! Photons on their way: from a source through a scene, until one is absorbed.

use super::{Reflects, guide::Guide};
use crate::math::{
    frame::Frame,
    lobe::around,
    random::{combine, hash, unit},
};
use crate::passes::photons::{Photon, ways};
use crate::scene::{
    Rgb, Scene,
    bvh::Bvh,
    sources::{Sources, Start, start},
    surface::{Gloss, Ray, Surface},
};
use crate::schedule::HostContext;
use glam::Vec3;
use rayon::prelude::*;
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
    pub reflects: Reflects,
    /// Most surfaces that a photon meets.
    pub legs: u32,
    /// Where photons start that are wanted; all alike without one.
    pub guide: Option<Guide>,
}

/// Where a photon has been, its first surface left out: what it brings there is direct light.
#[derive(Default)]
pub(super) struct Path {
    pub photons: Vec<Photon>,
    /// Whether it was still on its way after the last leg.
    pub is_cut_off: bool,
}

impl<'a> Tracer<'a> {
    /// In a host step.
    pub fn of(host: &'a dyn HostContext, reflects: Reflects, legs: u32) -> Self {
        let scene = host.scene();
        Self { scene, bvh: host.bvh(), sources: Sources::new(scene), extent: host.extent(), reflects, legs, guide: None }
    }

    /// Looks where photons start that meet a narrow lobe first, if these alone reflect.
    pub fn guided(self) -> Self {
        if self.reflects != Reflects::NarrowLobes {
            return self;
        }
        let found: Vec<Start> = (0..Guide::scouts(self.sources.count())).into_par_iter().map(start).filter(|start| self.meets_lobe(*start)).collect();
        Self { guide: Some(Guide::new(self.sources.count(), &found)), ..self }
    }

    /// Whether the surface that a photon meets first has a narrow lobe.
    fn meets_lobe(&self, start: Start) -> bool {
        let Some(emitted) = self.sources.emit(self.scene, start) else { return false };
        let ray = Ray::new(emitted.origin, emitted.direction);
        let Some(hit) = self.bvh.closest_blocker(self.scene, ray.origin, ray.direction) else { return false };
        self.scene.lit_surface(hit.triangle, hit.barycentric, ray).glossy.is_some_and(|gloss| gloss.lobe.shape.is_narrow())
    }

    /// The way of a photon by its number. Flux is all of the light's, were it the only one.
    pub fn path(&self, number: u32) -> Path {
        let mut path = Path::default();
        let (start, density) = self.guide.as_ref().map_or((start(number), 1.0), |guide| guide.start(number));
        let Some(emitted) = self.sources.emit(self.scene, start) else { return path };
        let (mut ray, mut flux) = (Ray::new(emitted.origin, emitted.direction), emitted.flux / density);
        for leg in 0..self.legs {
            let Some(hit) = self.bvh.closest_blocker(self.scene, ray.origin, ray.direction) else { return path };
            let surface = match self.reflects {
                Reflects::Albedo => self.scene.diffuse_surface(hit.triangle, hit.barycentric, ray),
                Reflects::All | Reflects::NarrowLobes => self.scene.lit_surface(hit.triangle, hit.barycentric, ray),
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
            let Some((direction, share)) = self.scattered(&surface, seed) else { return path };
            let survival = share.max_element().min(1.0);
            if unit(hash(seed ^ 0x68bc_21eb)) >= survival {
                return path;
            }
            flux *= share / survival;
            ray = Ray::new(surface.start(self.extent), direction);
        }
        path.is_cut_off = true;
        path
    }

    /// A direction in which light goes on, and its share of what arrived; none where it would go into the surface, or nothing reflects it.
    fn scattered(&self, surface: &Surface, seed: u32) -> Option<(Vec3, Rgb)> {
        let numbers = [0x5bd1_e995, 0x27d4_eb2f, 0x1656_67b1].map(|key| unit(hash(seed ^ key)));
        match (&surface.glossy, self.reflects) {
            (Some(gloss), Reflects::NarrowLobes) if !gloss.lobe.shape.is_narrow() => None,
            (None, Reflects::NarrowLobes) => None,
            (None, _) => Some((cosine_direction(surface.face, [numbers[0], numbers[1]]), surface.reflectance)),
            (Some(gloss), reflects) => scattered_by_lobe(surface, gloss, reflects == Reflects::All, numbers),
        }
    }
}

/// Irradiance is that of the shading normal: what light along a direction gives it, as a share of what it gives the plane.
fn by_shading(surface: &Surface, direction: Vec3) -> f32 {
    let [shaded, plane] = [surface.normal, surface.face].map(|normal| -normal.dot(direction));
    if plane > 0.0 { (shaded / plane).clamp(0.0, MOST_BY_SHADING) } else { 0.0 }
}

/// The same where there is a lobe, with the diffuse part or without it.
fn scattered_by_lobe(surface: &Surface, gloss: &Gloss, with_diffuse: bool, [u, v, choice]: [f32; 3]) -> Option<(Vec3, Rgb)> {
    let diffuse = if with_diffuse { surface.reflectance } else { Vec3::ZERO };
    let by_lobe = if with_diffuse { gloss.lobe.share(diffuse) } else { 1.0 };
    let direction = match choice < by_lobe {
        true => gloss.frame.to_world(gloss.lobe.sample(gloss.outgoing, [u, v])).try_normalize()?,
        false => cosine_direction(surface.face, [u, v]),
    };
    let (leaving, cosine) = (gloss.frame.to_local(direction), surface.face.dot(direction));
    if cosine <= 0.0 || leaving.z <= 0.0 {
        return None;
    }
    let density = by_lobe * gloss.lobe.density(gloss.outgoing, leaving) + (1.0 - by_lobe) * cosine * FRAC_1_PI;
    let reflected = diffuse * gloss.lobe.leaves(leaving.z) * FRAC_1_PI + gloss.lobe.value(gloss.outgoing, leaving);
    Some((direction, reflected * (cosine / density.max(f32::MIN_POSITIVE))))
}

fn cosine_direction(normal: Vec3, [u, v]: [f32; 2]) -> Vec3 {
    Frame::new(normal).to_world(around((1.0 - u).sqrt(), TAU * v))
}
