//! Paths: the surface that a ray meets, the direct light that it gets, and the light that comes by way of others.

use super::{
    Bounces, Stop,
    lights::{Sources, punctual},
    luminance, plan,
    random::{Random, cosine_direction},
    variance_of_mean,
};
use crate::scene::{
    bvh::Bvh,
    model::{Rgb, Scene, surface_offset},
};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// The bounce from which paths of any length may end by Russian roulette.
const ROULETTE_FROM: u32 = 3;

/// Survival is never surer than this, so that paths end in a closed room of white walls too.
const SURVIVAL_AT_MOST: f64 = 0.95;

/// What traces: a scene with its hierarchy, and tables of its lights.
pub struct Tracer<'a> {
    scene: &'a Scene,
    bvh: &'a Bvh,
    sources: Sources,
    extent: f32,
    one_sided: bool,
}

/// An estimate of the light at one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gather {
    /// Indirect irradiance [W/m²].
    pub irradiance: DVec3,
    /// Variance of `irradiance` as an estimate.
    pub variance: DVec3,
    /// Direct irradiance [W/m²].
    pub direct_irradiance: DVec3,
    /// Variance of `direct_irradiance` as an estimate.
    pub direct_variance: DVec3,
    /// Rays that were averaged.
    pub samples: u32,
}

/// The means of one round of stratified rays [W/m²].
#[derive(Clone, Copy, Default)]
pub struct Round {
    pub direct: DVec3,
    pub indirect: DVec3,
}

/// A place on a surface, from the side that a ray saw.
#[derive(Clone, Copy)]
pub struct Surface {
    pub position: Vec3,
    /// Unit normal of the plane, on the side seen.
    pub face: Vec3,
    /// Unit shading normal, on the side seen.
    pub normal: Vec3,
    pub reflectance: Rgb,
    pub emission: Rgb,
}

impl<'a> Tracer<'a> {
    /// Prepares a scene: linear in its triangles and in the texels of its sky.
    pub fn new(scene: &'a Scene, bvh: &'a Bvh) -> Self {
        Self { scene, bvh, sources: Sources::new(scene), extent: scene.extent(), one_sided: scene.materials.iter().any(|m| !m.two_sided) }
    }

    pub(super) fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Light at one point, of at least `samples` rays (never fewer than two rounds) over the hemisphere about the unit
    /// vector `normal`.
    pub fn gather(&self, position: Vec3, normal: Vec3, bounces: Bounces, samples: u32, seed: u64) -> Gather {
        let surface = Surface { position, face: normal, normal, reflectance: Vec3::ONE, emission: Vec3::ZERO };
        let (strata, rounds) = plan(Stop::Samples(samples.max(1)));
        let [mut direct, mut direct_squared, mut indirect, mut indirect_squared] = [DVec3::ZERO; 4];
        for k in 0..rounds {
            let round = self.round(&surface, bounces, strata, &mut Random::new([seed, k as u64]));
            direct += round.direct;
            direct_squared += round.direct * round.direct;
            indirect += round.indirect;
            indirect_squared += round.indirect * round.indirect;
        }
        let n = rounds as f64;
        Gather {
            irradiance: indirect / n,
            variance: variance_of_mean(indirect, indirect_squared, n),
            direct_irradiance: direct / n,
            direct_variance: variance_of_mean(direct, direct_squared, n),
            samples: rounds * strata * strata,
        }
    }

    /// Means over `strata`² rays and as many points of the sources.
    pub(super) fn round(&self, at: &Surface, bounces: Bounces, strata: u32, random: &mut Random) -> Round {
        let mut sum = Round::default();
        for cell in (0..strata).flat_map(|y| (0..strata).map(move |x| [x, y])) {
            let direction = cosine_direction(at.normal, random.pair_in(cell, strata));
            let met = self.surface(self.start(at), direction);
            sum.direct += self.light_met(at, direction, met.as_ref());
            sum.direct += self.light_sampled(at, random.pair_in(cell, strata));
            if let Some(met) = met.filter(|_| !bounces.end_at(0)) {
                sum.indirect += self.reflected(met, bounces, random);
            }
        }
        let count = (strata * strata) as f64;
        Round { direct: sum.direct / count + self.punctual(at), indirect: sum.indirect / count }
    }

    /// The surface that a ray sees first.
    pub(super) fn surface(&self, origin: Vec3, direction: Vec3) -> Option<Surface> {
        let hit = self.bvh.closest(self.scene, origin, direction, f32::INFINITY)?;
        let triangle = &self.scene.triangles[hit.triangle as usize];
        let material = &self.scene.materials[triangle.material as usize];
        let face = triangle.face_normal();
        let side = if face.dot(direction) > 0.0 { -1.0 } else { 1.0 };
        let texture = material.texture.map(|i| self.scene.textures[i as usize].sample(triangle.uv(hit.barycentric)).truncate());
        Some(Surface {
            // From the corners rather than along the ray: the error stays in the plane.
            position: triangle.position(hit.barycentric),
            face: face * side,
            normal: triangle.normal(hit.barycentric) * side,
            reflectance: material.reflectance * texture.unwrap_or(Vec3::ONE),
            emission: material.emission,
        })
    }

    /// Where rays that leave a surface start.
    fn start(&self, at: &Surface) -> Vec3 {
        at.position + at.face * surface_offset(self.extent, at.position)
    }

    /// π times the radiance that leaves `first` toward where the ray came from: an estimate of the irradiance there when
    /// the ray was cosine-distributed.
    fn reflected(&self, first: Surface, bounces: Bounces, random: &mut Random) -> DVec3 {
        let (mut at, mut throughput, mut sum) = (first, DVec3::ONE, DVec3::ZERO);
        for bounce in 1.. {
            throughput *= at.reflectance.as_dvec3();
            if throughput == DVec3::ZERO {
                break;
            }
            let end = bounces.end_at(bounce);
            sum += throughput * (self.punctual(&at) + self.light_sampled(&at, random.pair()));
            if end && !self.sources.visible() {
                break;
            }
            // One ray both completes the direct light here and carries the path on.
            let direction = cosine_direction(at.normal, random.pair());
            let met = self.surface(self.start(&at), direction);
            sum += throughput * self.light_met(&at, direction, met.as_ref());
            let Some(next) = met.filter(|_| !end) else { break };
            if bounces == Bounces::All && bounce >= ROULETTE_FROM {
                let survival = (at.reflectance.max_element() as f64).min(SURVIVAL_AT_MOST);
                if random.number() >= survival {
                    break;
                }
                throughput /= survival;
            }
            at = next;
        }
        sum
    }

    /// Irradiance from punctual lights.
    fn punctual(&self, at: &Surface) -> DVec3 {
        let start = self.start(at);
        let mut sum = DVec3::ZERO;
        for light in &self.scene.lights {
            let Some((direction, distance, irradiance)) = punctual(&light.kind, start) else { continue };
            let Some(cosine) = at.cosine(direction) else { continue };
            if irradiance != DVec3::ZERO && !(light.shadows && self.shadowed(start, direction, distance)) {
                sum += irradiance * cosine as f64;
            }
        }
        sum
    }

    /// One point of the sources: its share of the irradiance under the balance heuristic.
    fn light_sampled(&self, at: &Surface, pair: [f64; 2]) -> DVec3 {
        let start = self.start(at);
        let Some(sample) = self.sources.sample(self.scene, start, pair) else { return DVec3::ZERO };
        match at.cosine(sample.direction) {
            Some(cosine) if !self.shadowed(start, sample.direction, sample.distance) => balanced(sample.radiance, cosine, sample.density),
            _ => DVec3::ZERO,
        }
    }

    /// What a cosine-distributed ray met: its share of the direct irradiance under the balance heuristic.
    fn light_met(&self, at: &Surface, direction: Vec3, met: Option<&Surface>) -> DVec3 {
        let start = self.start(at);
        let (radiance, distance, density) = match met {
            None if self.sources.visible() => (self.scene.environment.radiance(direction), f32::INFINITY, self.sources.sky_density(direction)),
            Some(met) if luminance(met.emission.as_dvec3()) > 0.0 => {
                let distance = met.position.distance(start);
                (met.emission, distance, self.sources.emitter_density(met.emission, distance, -met.face.dot(direction)))
            }
            _ => return DVec3::ZERO,
        };
        match at.cosine(direction) {
            // The ray may have come through the back of a one-sided surface, which shadows.
            Some(cosine) if !(self.one_sided && self.shadowed(start, direction, distance)) => balanced(radiance, cosine, density),
            _ => DVec3::ZERO,
        }
    }

    /// Whether something stands between `start` and a light at `distance`, short of the surface that the light may be on.
    fn shadowed(&self, start: Vec3, direction: Vec3, distance: f32) -> bool {
        let limit = if distance.is_finite() { distance - 2.0 * surface_offset(self.extent, start + direction * distance) } else { distance };
        limit > 0.0 && self.bvh.occluded(self.scene, start, direction, limit)
    }
}

impl Surface {
    /// Cosine of a direction from which light may arrive: above the plane and about the shading normal.
    fn cosine(&self, direction: Vec3) -> Option<f32> {
        let cosine = self.normal.dot(direction);
        (cosine > 0.0 && self.face.dot(direction) > 0.0).then_some(cosine)
    }
}

/// A direction's share of the irradiance [W/m²] when one sample is drawn by cosine/π and one with `density` at the
/// source: L·cos / (p_cosine + p_source), whichever of the two drew it (Veach 1997, eq. 9.8).
fn balanced(radiance: Rgb, cosine: f32, density: f64) -> DVec3 {
    radiance.as_dvec3() * (cosine as f64 / (cosine as f64 / PI + density))
}
