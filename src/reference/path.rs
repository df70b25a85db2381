//! Paths: the surface that a ray meets, the direct light that it gets, and the light that comes by way of others.

use super::{
    Bounces, Rounds, Stop,
    lights::Sources,
    luminance,
    random::{Random, cells, cosine_direction},
    variance_of_mean,
};
use crate::scene::{
    bvh::Bvh,
    model::{Rgb, Scene, surface_offset},
    surface::{Ray, Surface},
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

/// The means of one round of stratified rays.
#[derive(Clone, Copy, Default)]
pub struct Round {
    /// Irradiance [W/m²].
    pub direct: DVec3,
    pub indirect: DVec3,
    /// Radiance that the lobe reflects [W m⁻² sr⁻¹].
    pub glossy_direct: DVec3,
    pub glossy_indirect: DVec3,
}

/// What light is collected for, as the factor that a direction has beside π times its cosine, and how directions are drawn for it.
/// What a ray has met.
struct Met {
    surface: Surface,
    triangle: u32,
}

#[derive(Clone, Copy, PartialEq)]
enum For {
    /// The irradiance: 1.
    Irradiance,
    /// What the lobe alone reflects.
    Lobe,
    /// All that is reflected.
    Reflection,
}

impl<'a> Tracer<'a> {
    /// Prepares a scene: linear in its triangles and in the texels of its sky.
    pub fn new(scene: &'a Scene, bvh: &'a Bvh) -> Self {
        Self { scene, bvh, sources: Sources::new(scene), extent: scene.extent(), one_sided: scene.materials.iter().any(|m| !m.two_sided) }
    }

    pub(super) fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Light at one point, of `samples` rays (never fewer than two) over the hemisphere about the unit vector `normal`.
    pub fn gather(&self, position: Vec3, normal: Vec3, bounces: Bounces, samples: u32, seed: u64) -> Gather {
        let surface = Surface { position, face: normal, normal, reflectance: Vec3::ONE, emission: Vec3::ZERO, glossy: None };
        let rounds = Rounds::of(Stop::Samples(samples.max(2)));
        let [mut direct, mut direct_squared, mut indirect, mut indirect_squared] = [DVec3::ZERO; 4];
        for k in 0..rounds.count {
            let round = self.round(&surface, bounces, rounds.rays(k), &mut Random::new([seed, k as u64]));
            direct += round.direct;
            direct_squared += round.direct * round.direct;
            indirect += round.indirect;
            indirect_squared += round.indirect * round.indirect;
        }
        let n = rounds.count as f64;
        Gather {
            irradiance: indirect / n,
            variance: variance_of_mean(indirect, indirect_squared, n),
            direct_irradiance: direct / n,
            direct_variance: variance_of_mean(direct, direct_squared, n),
            samples: rounds.rays_of_first(rounds.count),
        }
    }

    /// Means over so many rays and as many points of the sources.
    pub(super) fn round(&self, at: &Surface, bounces: Bounces, rays: u32, random: &mut Random) -> Round {
        let mut sum = Round::default();
        for cell in cells(rays) {
            let direction = cosine_direction(at.normal, random.pair_in(cell));
            let met = self.met(at.start(self.extent), direction);
            sum.direct += self.light_met(at, For::Irradiance, direction, met.as_ref());
            sum.direct += self.light_sampled(at, For::Irradiance, random.pair_in(cell));
            if let Some(met) = met.filter(|_| !bounces.end_at(0) && at.cosine(direction).is_some()) {
                sum.indirect += self.reflected(met.surface, bounces, random);
            }
        }
        if at.glossy.is_some() {
            for cell in cells(rays) {
                let direction = at.sample(For::Lobe, random.pair_in(cell));
                sum.glossy_direct += self.light_sampled(at, For::Lobe, random.pair_in(cell)) / PI;
                let Some(share) = at.share(For::Lobe, direction) else { continue };
                let met = self.met(at.start(self.extent), direction);
                sum.glossy_direct += self.light_met(at, For::Lobe, direction, met.as_ref()) / PI;
                if let Some(met) = met.filter(|_| !bounces.end_at(0)) {
                    sum.glossy_indirect += share * self.reflected(met.surface, bounces, random) / PI;
                }
            }
        }
        let count = f64::from(rays);
        Round {
            direct: sum.direct / count + self.punctual(at, For::Irradiance),
            indirect: sum.indirect / count,
            glossy_direct: sum.glossy_direct / count + at.glossy.map_or(DVec3::ZERO, |_| self.punctual(at, For::Lobe) / PI),
            glossy_indirect: sum.glossy_indirect / count,
        }
    }

    /// The surface that a ray sees first.
    pub(super) fn surface(&self, ray: Ray) -> Option<Surface> {
        self.met_by(ray).map(|met| met.surface)
    }

    fn met(&self, origin: Vec3, direction: Vec3) -> Option<Met> {
        self.met_by(Ray::new(origin, direction))
    }

    fn met_by(&self, ray: Ray) -> Option<Met> {
        let hit = self.bvh.closest_hit(self.scene, ray.origin, ray.direction, f32::INFINITY)?;
        Some(Met { surface: self.scene.surface(hit.triangle, hit.barycentric, ray), triangle: hit.triangle })
    }

    /// π times the radiance that leaves `first` toward where the ray came from: an estimate of the irradiance there when
    /// the ray was cosine-distributed.
    fn reflected(&self, first: Surface, bounces: Bounces, random: &mut Random) -> DVec3 {
        let mut sum = DVec3::ZERO;
        self.walk(first, bounces, random, |_, light| sum += light);
        sum
    }

    /// The same in parts: `add` is given what each surface along the path reflects of direct light, and how many surfaces that has touched then.
    pub(super) fn walk(&self, first: Surface, bounces: Bounces, random: &mut Random, mut add: impl FnMut(u32, DVec3)) {
        let (mut at, mut throughput) = (first, DVec3::ONE);
        for bounce in 1.. {
            // What the diffuse part reflects does not depend on where it comes from.
            let wanted = if at.glossy.is_some() { For::Reflection } else { For::Irradiance };
            if wanted == For::Irradiance {
                throughput *= at.reflectance.as_dvec3();
            }
            if throughput == DVec3::ZERO {
                break;
            }
            let end = bounces.end_at(bounce);
            add(bounce, throughput * (self.punctual(&at, wanted) + self.light_sampled(&at, wanted, random.pair())));
            if end && !self.sources.visible() {
                break;
            }
            // One ray both completes the direct light here and carries the path on.
            let direction = match wanted {
                For::Irradiance => cosine_direction(at.normal, random.pair()),
                _ => at.sample(if random.number() < at.lobe_share() { For::Lobe } else { For::Irradiance }, random.pair()),
            };
            let met = self.met(at.start(self.extent), direction);
            add(bounce, throughput * self.light_met(&at, wanted, direction, met.as_ref()));
            if wanted == For::Reflection {
                let Some(share) = at.share(wanted, direction) else { break };
                throughput *= share;
            }
            let Some(next) = met.filter(|_| !end && at.cosine(direction).is_some()) else { break };
            if bounces == Bounces::All && bounce >= ROULETTE_FROM {
                let survival = (at.most_reflected() as f64).min(SURVIVAL_AT_MOST);
                if random.number() >= survival {
                    break;
                }
                throughput /= survival;
            }
            at = next.surface;
        }
    }

    /// Light of punctual lights.
    fn punctual(&self, at: &Surface, wanted: For) -> DVec3 {
        let start = at.start(self.extent);
        let mut sum = DVec3::ZERO;
        for light in &self.scene.lights {
            let Some((direction, distance, irradiance)) = light.kind.toward(start) else { continue };
            let Some(cosine) = at.cosine(direction) else { continue };
            if irradiance != DVec3::ZERO && !(light.shadows && self.shadowed(start, direction, distance)) {
                sum += irradiance * cosine as f64 * at.factor(wanted, direction);
            }
        }
        sum
    }

    /// One point of the sources: its share of the light under the balance heuristic.
    fn light_sampled(&self, at: &Surface, wanted: For, pair: [f64; 2]) -> DVec3 {
        let start = at.start(self.extent);
        let Some(sample) = self.sources.sample(self.scene, [start, at.normal], pair) else { return DVec3::ZERO };
        match at.cosine(sample.direction) {
            Some(cosine) if !self.shadowed(start, sample.direction, sample.distance) => {
                at.factor(wanted, sample.direction) * balanced(sample.radiance, cosine, at.density(wanted, sample.direction, cosine), sample.density)
            }
            _ => DVec3::ZERO,
        }
    }

    /// What a ray met that was drawn by the surface's own density: its share of the direct light under the balance heuristic.
    fn light_met(&self, at: &Surface, wanted: For, direction: Vec3, met: Option<&Met>) -> DVec3 {
        let start = at.start(self.extent);
        let (radiance, distance, density) = match met {
            None if self.sources.visible() => (self.scene.environment.radiance(direction), f32::INFINITY, self.sources.sky_density(direction)),
            Some(Met { surface: met, triangle }) if luminance(met.emission.as_dvec3()) > 0.0 => {
                let distance = met.position.distance(start);
                (met.emission, distance, self.sources.emitter_density(self.scene, [start, at.normal], *triangle, distance, -met.face.dot(direction)))
            }
            _ => return DVec3::ZERO,
        };
        match at.cosine(direction) {
            // The ray may have come through the back of a one-sided surface, which shadows.
            Some(cosine) if !(self.one_sided && self.shadowed(start, direction, distance)) => {
                at.factor(wanted, direction) * balanced(radiance, cosine, at.density(wanted, direction, cosine), density)
            }
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

    /// π times what is reflected of light from a direction, per cosine; 1 for irradiance.
    fn factor(&self, wanted: For, direction: Vec3) -> DVec3 {
        let lobe = || self.glossy.map_or(Vec3::ZERO, |gloss| gloss.value(direction)).as_dvec3() * PI;
        match wanted {
            For::Irradiance => DVec3::ONE,
            For::Lobe => lobe(),
            For::Reflection => self.reflectance.as_dvec3() + lobe(),
        }
    }

    /// How often directions of glossy surfaces are drawn from their lobe.
    fn lobe_share(&self) -> f64 {
        let Some(gloss) = &self.glossy else { return 0.0 };
        let [lobe, diffuse] = [gloss.lobe.reflectance, self.reflectance].map(|c| luminance(c.as_dvec3()));
        (lobe / (lobe + diffuse).max(f64::MIN_POSITIVE)).clamp(0.1, 0.9)
    }

    /// The most of a channel that goes on along a path.
    fn most_reflected(&self) -> f32 {
        (self.reflectance + self.glossy.map_or(Vec3::ZERO, |gloss| gloss.lobe.reflectance)).max_element()
    }

    /// A direction drawn for the irradiance or for the lobe.
    fn sample(&self, wanted: For, pair: [f64; 2]) -> Vec3 {
        match self.glossy.filter(|_| wanted == For::Lobe) {
            Some(gloss) => gloss.frame.to_world(gloss.lobe.sample(gloss.outgoing, pair.map(|x| x as f32))).normalize_or(self.normal),
            None => cosine_direction(self.normal, pair),
        }
    }

    /// Density of the directions that are drawn [1/sr].
    fn density(&self, wanted: For, direction: Vec3, cosine: f32) -> f64 {
        let diffuse = cosine as f64 / PI;
        let lobe = || self.glossy.map_or(0.0, |gloss| gloss.density(direction) as f64);
        match wanted {
            For::Irradiance => diffuse,
            For::Lobe => lobe(),
            For::Reflection => diffuse + (lobe() - diffuse) * self.lobe_share(),
        }
    }

    /// What part of the light from a direction drawn goes on along the path; none where it lies below the surface.
    fn share(&self, wanted: For, direction: Vec3) -> Option<DVec3> {
        let cosine = self.cosine(direction)?;
        let density = self.density(wanted, direction, cosine);
        (density > 0.0).then(|| self.factor(wanted, direction) * (cosine as f64 / PI / density))
    }
}

/// A direction's share of the irradiance [W/m²] when one sample is drawn with `density` here and one with `at_source` there:
/// L·cos over the sum of both, whichever of the two drew it (Veach 1997, eq. 9.8).
fn balanced(radiance: Rgb, cosine: f32, density: f64, at_source: f64) -> DVec3 {
    radiance.as_dvec3() * (cosine as f64 / (density + at_source).max(f64::MIN_POSITIVE))
}
