//! Light as it leaves its sources, in photons.

use super::{Environment, LightKind, Material, Rgb, Scene, Triangle, bvh::is_hole, sky::Sky, surface_offset};
use crate::math::{choice::Choice, colour::luminance, frame::Frame, lobe::around, random::triangle_point};
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// All that shines, each source chosen in proportion to its flux.
pub struct Sources {
    sources: Vec<Source>,
    flux: Choice,
    /// The sphere that light from far away has to cross.
    centre: Vec3,
    radius: f32,
    /// Of the scene [scene units].
    extent: f32,
}

enum Source {
    /// One of the scene's lights, by its number.
    Light(u32),
    Emitter(u32),
    /// A sky of one radiance.
    Dome(Rgb),
    Sky(Sky),
}

/// A photon on its way from a source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emitted {
    pub origin: Vec3,
    /// Unit vector.
    pub direction: Vec3,
    /// All of the light, were this the only photon [W]: the mean over many is what the sources send out.
    pub flux: Rgb,
}

/// How far each photon is along the five sides of a unit cube: a lattice of rank 1 (Roberts' generator for five dimensions), which fills it evenly however
/// many there are. In units of 2⁻³², so that the host and devices have the same.
const STEPS: [u32; 5] = [3_785_032_107, 3_335_640_777, 2_939_605_023, 2_590_590_015, 2_283_013_049];

/// Where a photon is along the sides of the unit cube that tells how it starts, in units of 2⁻³²: which source, then two numbers for where and two for which way
/// it goes; of what comes from afar, and of points, the first two tell the way.
pub type Start = [u32; 5];

/// Where a photon is by its number.
pub fn start(number: u32) -> Start {
    STEPS.map(|step| step.wrapping_mul(number.wrapping_add(1)).wrapping_add(1 << 31))
}

const TWO_TO_32: f64 = 4_294_967_296.0;

impl Sources {
    pub fn new(scene: &Scene) -> Self {
        let bounds = scene.bounds();
        let (extent, radius) = (scene.extent(), 0.5 * bounds.diagonal());
        let disc = PI * f64::from(radius).powi(2);
        let lights = (0..).zip(&scene.lights).map(|(at, light)| (Source::Light(at), flux_of_light(&light.kind, disc)));
        let emitters = scene.emitters().into_iter().map(|number| {
            let triangle = &scene.triangles[number as usize];
            (Source::Emitter(number), luminance(flux_of_emitter(triangle, material(scene, triangle), scene.mean_emission(number))))
        });
        let sky = match &scene.environment {
            Environment::Constant(radiance) => Some((Source::Dome(*radiance), 2.0 * TAU * disc * luminance(radiance.as_dvec3()))),
            sky @ Environment::LatLong { .. } => Sky::new(sky).map(|sky| {
                let flux = sky.luminance() * disc;
                (Source::Sky(sky), flux)
            }),
        };
        let (sources, flux): (Vec<_>, Vec<_>) = lights.chain(emitters).chain(sky).filter(|(_, flux)| *flux > 0.0).unzip();
        Self { sources, flux: Choice::new(flux.into_iter()), centre: bounds.centre(), radius, extent }
    }

    pub fn count(&self) -> usize {
        self.sources.len()
    }

    /// A photon by where it starts; none where there is no light, or none that goes that way.
    pub fn emit(&self, scene: &Scene, start: Start) -> Option<Emitted> {
        if self.sources.is_empty() {
            return None;
        }
        let [choice, u, v, s, t] = start.map(|place| f64::from(place) / TWO_TO_32);
        let (index, _) = self.flux.pick(choice);
        let emitted = match &self.sources[index] {
            Source::Light(at) => Some(self.leaving_light(&scene.lights[*at as usize].kind, [u, v])),
            Source::Emitter(triangle) => self.leaving_emitter(scene, *triangle, [u, v], [s, t]),
            Source::Dome(radiance) => {
                let direction = on_sphere([u, v]);
                Some(Emitted { flux: *radiance * (2.0 * TAU * self.disc()) as f32, ..self.coming_from_afar(direction, [s, t]) })
            }
            Source::Sky(sky) => sky.sample([u, v]).map(|from| {
                let flux = scene.environment.radiance(from).as_dvec3() * (self.disc() / sky.density(from).max(f64::MIN_POSITIVE));
                Emitted { flux: flux.as_vec3(), ..self.coming_from_afar(-from, [s, t]) }
            }),
        }?;
        let share = self.flux.weight(index) / self.flux.total();
        Some(Emitted { flux: emitted.flux / share as f32, ..emitted })
    }

    /// What `shaders/lib/sources.wgsl` reads: a head, each source, and where the share of each of the sky's texels ends.
    pub fn words(&self) -> Vec<u32> {
        let mut words = vec![self.sources.len() as u32, 0, 0, 0];
        for (at, source) in self.sources.iter().enumerate() {
            let (kind, index) = match source {
                Source::Light(light) => (0, *light),
                Source::Emitter(triangle) => (1, *triangle),
                Source::Dome(_) => (2, 0),
                Source::Sky(_) => (3, 0),
            };
            let inverse_share = (self.flux.total() / self.flux.weight(at)) as f32;
            words.extend([kind, index, self.flux.end(at), inverse_share.to_bits()]);
        }
        let sky = self.sources.iter().find_map(|source| if let Source::Sky(sky) = source { Some(sky) } else { None });
        words.extend(sky.into_iter().flat_map(Sky::ends));
        words
    }

    /// Area of the disc that stands for the scene seen from far away [scene units²].
    fn disc(&self) -> f64 {
        PI * f64::from(self.radius).powi(2)
    }

    fn leaving_light(&self, kind: &LightKind, [u, v]: [f64; 2]) -> Emitted {
        match *kind {
            LightKind::Point { position, intensity } => Emitted { origin: position, direction: on_sphere([u, v]), flux: intensity * (2.0 * TAU) as f32 },
            LightKind::Spot { position, direction, inner, outer, .. } => {
                let [full, ramp] = spot_parts(inner, outer);
                let [inner, outer] = [inner, outer].map(|angle| f64::from(angle).cos());
                let chosen = u * (full + ramp);
                // The square of a ramp in the cosine has the third root as the inverse of its sum.
                let cosine = if chosen < full { 1.0 - chosen / full * (1.0 - inner) } else { outer + (inner - outer) * ((chosen - full) / ramp).cbrt() };
                let local = around(cosine as f32, (TAU * v) as f32);
                Emitted { origin: position, direction: Frame::new(direction).to_world(local), flux: kind.intensity() * (full + ramp) as f32 }
            }
            LightKind::Directional { direction, irradiance } => Emitted { flux: irradiance * self.disc() as f32, ..self.coming_from_afar(direction, [u, v]) },
        }
    }

    /// From a triangle, in proportion to the cosine.
    fn leaving_emitter(&self, scene: &Scene, number: u32, [u, v]: [f64; 2], [s, t]: [f64; 2]) -> Option<Emitted> {
        let triangle = &scene.triangles[number as usize];
        let material = material(scene, triangle);
        let barycentric = triangle_point([u, v]);
        // Light of both sides: the first half of the numbers goes to the front.
        let (side, s) = match material.two_sided {
            true => (if s < 0.5 { 1.0 } else { -1.0 }, (2.0 * s).fract()),
            false => (1.0, s),
        };
        let normal = triangle.face_normal() * side;
        let local = around((1.0 - s).sqrt() as f32, (TAU * t) as f32);
        let position = triangle.position(barycentric);
        let origin = position + normal * surface_offset(self.extent, position);
        let flux = flux_of_emitter(triangle, material, scene.emission(number, barycentric)).as_vec3();
        let is_there = normal != Vec3::ZERO && !is_hole(triangle, material, &scene.textures, barycentric);
        is_there.then(|| Emitted { origin, direction: Frame::new(normal).to_world(local), flux })
    }

    /// From far away along a unit direction, on a disc before the scene; without flux.
    fn coming_from_afar(&self, direction: Vec3, [u, v]: [f64; 2]) -> Emitted {
        let frame = Frame::new(direction);
        let (sine, cosine) = (TAU * v).sin_cos();
        let radius = f64::from(self.radius) * u.sqrt();
        let aside = frame.tangent * (radius * cosine) as f32 + frame.bitangent * (radius * sine) as f32;
        Emitted { origin: self.centre + aside - direction * (1.01 * self.radius), direction, flux: Vec3::ZERO }
    }
}

fn material<'a>(scene: &'a Scene, triangle: &Triangle) -> &'a Material {
    &scene.materials[triangle.material as usize]
}

/// Luminance of all that a light sends out [W]; `disc` is what a directional one crosses.
fn flux_of_light(kind: &LightKind, disc: f64) -> f64 {
    let intensity = luminance(kind.intensity().as_dvec3());
    match *kind {
        LightKind::Point { .. } => 2.0 * TAU * intensity,
        LightKind::Spot { inner, outer, .. } => spot_parts(inner, outer).iter().sum::<f64>() * intensity,
        LightKind::Directional { .. } => disc * intensity,
    }
}

/// Of a spot's intensity over all directions, what its inner cone has, and what its ramp has [sr].
fn spot_parts(inner: f32, outer: f32) -> [f64; 2] {
    let [inner, outer] = [inner, outer].map(|angle| f64::from(angle).cos());
    [TAU * (1.0 - inner), TAU * (inner - outer).max(0.0) / 3.0]
}

/// All that an emissive triangle sends out by some radiance [W].
fn flux_of_emitter(triangle: &Triangle, material: &Material, radiance: Vec3) -> DVec3 {
    let sides = if material.two_sided { 2.0 } else { 1.0 };
    radiance.as_dvec3() * (0.5 * f64::from(triangle.cross().length()) * PI * sides)
}

fn on_sphere([u, v]: [f64; 2]) -> Vec3 {
    around((1.0 - 2.0 * u) as f32, (TAU * v) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Camera, FieldOfView, Light};
    use glam::Vec2;

    fn scene(triangles: Vec<Triangle>, lights: Vec<LightKind>, environment: Environment) -> Scene {
        let camera = Camera {
            name: String::new(),
            eye: Vec3::ZERO,
            direction: Vec3::X,
            up: Vec3::Y,
            field_of_view: FieldOfView::Shorter(1.0),
            size: None,
            sample: Default::default(),
        };
        let lights = lights.into_iter().map(|kind| Light { name: String::new(), kind, shadows: true }).collect();
        let lamp = |two_sided| Material { emission: Vec3::new(1.0, 2.0, 3.0), two_sided, ..Material::diffuse("lamp", Vec3::ONE) };
        Scene {
            triangles,
            materials: vec![lamp(false), lamp(true), Material::diffuse("grey", Vec3::splat(0.5))],
            lights,
            environment,
            cameras: vec![camera],
            ..Scene::default()
        }
    }

    fn triangle(material: u32) -> Triangle {
        Triangle { positions: [Vec3::ZERO, 2.0 * Vec3::X, 3.0 * Vec3::Y], normals: [Vec3::Z; 3], uvs: [Vec2::ZERO; 3], tints: Default::default(), material }
    }

    const PHOTONS: u32 = 40_000;

    /// Means over photons of their flux, and of it times a number of theirs.
    fn means(scene: &Scene, number: impl Fn(&Emitted) -> f64) -> (DVec3, f64) {
        let sources = Sources::new(scene);
        let photons = (0..PHOTONS).filter_map(|at| sources.emit(scene, start(at)));
        let sums = photons.fold((DVec3::ZERO, 0.0), |(flux, sum), p| (flux + p.flux.as_dvec3(), sum + f64::from(p.flux.x) * number(&p)));
        (sums.0 / f64::from(PHOTONS), sums.1 / f64::from(PHOTONS))
    }

    fn expect(found: f64, known: f64, what: &str) {
        assert!((found - known).abs() < 0.015 * known.abs().max(1.0), "{what}: {found}, not {known}");
    }

    /// Flux of each kind of light, and where it goes, in closed form.
    #[test]
    fn sources_send_out_what_they_have() {
        let black = || Environment::Constant(Vec3::ZERO);
        let point = LightKind::Point { position: Vec3::ONE, intensity: Vec3::new(1.0, 2.0, 3.0) };
        let (flux, up) = means(&scene(vec![triangle(2)], vec![point], black()), |p| f64::from(p.direction.z).powi(2));
        expect(flux.y, 8.0 * PI, "a point");
        expect(up / flux.x, 1.0 / 3.0, "the second moment of a sphere");

        let (inner, outer) = (0.3f32, 0.7f32);
        let spot = LightKind::Spot { position: Vec3::ONE, direction: Vec3::NEG_Z, intensity: Vec3::ONE, inner, outer };
        let (flux, cosine) = means(&scene(vec![triangle(2)], vec![spot], black()), |p| f64::from(-p.direction.z));
        // By numerical integration of the falloff over the cone.
        let steps = 100_000;
        let [ci, co] = [inner, outer].map(|angle| f64::from(angle).cos());
        let (mut all, mut mean) = (0.0, 0.0);
        for step in 0..steps {
            let c = co + (1.0 - co) * (f64::from(step) + 0.5) / f64::from(steps);
            let falloff = ((c - co) / (ci - co)).min(1.0).powi(2) * TAU * (1.0 - co) / f64::from(steps);
            (all, mean) = (all + falloff, mean + falloff * c);
        }
        expect(flux.x, all, "a spot");
        expect(cosine, mean, "a spot's cosines");

        for (material, sides) in [(0, 1.0), (1, 2.0)] {
            let (flux, cosine) = means(&scene(vec![triangle(material)], Vec::new(), black()), |p| f64::from(p.direction.z.abs()));
            expect(flux.z, 9.0 * PI * sides, "a triangle");
            expect(cosine / flux.x, 2.0 / 3.0, "its cosines");
        }
        // Both sides alike: nothing is left of the sum of cosines.
        expect(means(&scene(vec![triangle(1)], Vec::new(), black()), |p| f64::from(p.direction.z)).1, 0.0, "both sides");
    }

    /// From far away: what a triangle receives is the irradiance times its area, whatever the disc.
    #[test]
    fn light_from_afar_crosses_the_scene_evenly() {
        let sun = LightKind::Directional { direction: Vec3::new(0.0, 0.6, -0.8), irradiance: Vec3::splat(5.0) };
        let crosses = |p: &Emitted| {
            let at = p.origin - p.direction * (p.origin.z / p.direction.z);
            let inside = at.x >= 0.0 && at.y >= 0.0 && at.x / 2.0 + at.y / 3.0 <= 1.0 && p.direction.z < 0.0 && p.origin.z > 0.0;
            f64::from(u8::from(inside))
        };
        let (_, received) = means(&scene(vec![triangle(2)], vec![sun], Environment::Constant(Vec3::ZERO)), crosses);
        expect(received, 5.0 * 0.8 * 3.0, "the sun");
        let (_, received) = means(&scene(vec![triangle(2)], Vec::new(), Environment::Constant(Vec3::ONE)), crosses);
        expect(received, PI * 3.0, "a dome");
        let texels = (0..32 * 16).map(|at| Vec3::splat(if at < 256 { 2.0 } else { 0.0 })).collect();
        let above = scene(vec![triangle(2)], Vec::new(), Environment::LatLong { width: 32, height: 16, texels });
        // +y is up in a sky: a triangle that faces z sees half of its upper half.
        expect(means(&above, crosses).1, PI * 3.0, "half a sky");
    }

    #[test]
    fn a_scene_without_light_sends_out_nothing() {
        let dark = scene(vec![triangle(2)], Vec::new(), Environment::Constant(Vec3::ZERO));
        assert_eq!(Sources::new(&dark).emit(&dark, start(7)), None);
    }
}
