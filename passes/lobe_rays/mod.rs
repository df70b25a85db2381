//! Light that sharp lobes of the visible surfaces reflect, by rays at each pixel.

mod filter;

use super::irradiance_field::{self, Asked};
use super::record::{Request, texels};
use super::seen_light::{self, Highlights, INDIRECT, SAMPLES_OF_EMITTERS, SHADOW, Sees, Shading, TAPS, direct_leaves_emission, shading_place};
use crate::contract::{
    Arguments, Bodies, Choice, Description, Encoder, Input, Need, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes,
    encoder::{bind_visibility, light_constants, shadow_taps},
    port,
};
use crate::math::{
    colour::luminance,
    frame::Frame,
    lattice::golden,
    lobe::around,
    random::{combine, hash, unit},
};
use crate::scene::{
    Camera, Rgb, Scene,
    needs::Needs,
    packets::{RayBundle, View},
    surface::{Gloss, Ray, Surface},
};
use crate::schedule::*;
use filter::{Filter, Traced};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::{FRAC_1_PI, TAU};

pub struct LobeRays;

static DESCRIPTION: Description = Description {
    name: "LobeRays",
    about: "Light that lobes of the visible surfaces reflect, by rays drawn from the lobe at each pixel: for lobes that are too sharp for records",
    source: "rays drawn from lobes: Heitz 2018; two ways of drawing together: Veach and Guibas 1995; for lobes that records do not hold: our own",
    parameters: &[
        Parameter { name: "rays", about: "rays a pixel", unit: "rays", kind: ParameterKind::Integer { default: 64, min: 1, max: 4096 } },
        Parameter {
            name: "highlights",
            about: "lobes of the surfaces seen that reflect direct light",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Soft", about: "narrow ones as wider ones of the same light, which few rays do not miss", parameters: &[] },
                    Choice { name: "All", about: "as they are: dots where a ray meets what it hardly ever meets", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "tolerance",
            about: "how far what two pixels beside each other see may lie apart, and count together; 0 for each pixel alone",
            unit: "standard errors",
            kind: ParameterKind::Float { default: 0.5, min: 0.0, max: 100.0 },
        },
        TAPS,
        PLACE,
    ],
    inputs: &[
        Input { name: "gbuffer", about: "surfaces with such lobes", accepts: PortKind::GBuffer, takes: Takes::One, changes: false },
        Input {
            name: "direct",
            about: "the direct pass: what it lights surfaces from, rays leave out; without it they see all emission",
            accepts: PortKind::DirectLight,
            takes: Takes::AtMostOne,
            changes: false,
        },
        SHADOW,
        INDIRECT,
    ],
    outputs: &[Output { name: "radiance", about: "indirect radiance toward the camera that the lobes reflect", kind: PortKind::Image }],
};

/// Rays that are in memory together.
const TOGETHER: usize = 1 << 18;

/// What both places do.
struct Work {
    gbuffer: port::GBuffer,
    maps: Option<port::ShadowMaps>,
    sees: Sees,
    rays: u32,
    tolerance: f32,
    radiance: Resource,
}

impl Pass for LobeRays {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn need(&self, _arguments: &Arguments, needs: &Needs) -> Need {
        if needs.lobes { Need::Kept } else { Need::Dropped("no material is glossy") }
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = e.g_buffer("gbuffer").copied() else { return Ok(()) };
        let taps = shadow_taps(e.arguments)?;
        let maps = e.shadow_maps("shadow").map(|maps| port::ShadowMaps { taps, ..*maps });
        if e.setting.needs.shadowed_lights == 0 {
            e.idle("taps", "no punctual light casts shadows");
        }
        if !e.setting.needs.narrow_lobes {
            e.idle("highlights", "no surface has a narrow lobe");
        }
        let cast = e.place(Bodies::BOTH)?;
        let place = shading_place(e, cast, maps.as_ref())?;
        let sees = Sees {
            emission: direct_leaves_emission(e),
            highlights: if e.arguments.choice("highlights").0 == "All" { Highlights::All } else { Highlights::Soft },
        };
        let radiance = e.image("radiance", gbuffer.size, Format::Rgba32Float);
        // Its square times the least variance has to be a number.
        let tolerance = (e.arguments.float("tolerance") as f32).max(1e-3);
        let work = Work { gbuffer, maps, sees, rays: e.arguments.integer("rays") as u32, tolerance, radiance };
        match place {
            Place::Host => work.encode_on_host(e),
            Place::Device => work.encode_on_device(e),
        }
        e.output("radiance", Port::Image(port::Image { texture: radiance, channels: port::Channels::Colour }));
        Ok(())
    }
}

impl Work {
    fn encode_on_device(&self, e: &mut Encoder<'_>) {
        let [seen, albedo] = ["seen", "albedo"].map(|name| e.image(name, self.gbuffer.size, Format::Rgba32Float));
        let program = light_constants(Program::new("lobe_rays/trace"), e.setting.needs, SAMPLES_OF_EMITTERS);
        let field = e.irradiance_field("indirect").copied();
        let program = match &field {
            Some(field) => irradiance_field::bind(program, field),
            None => program.import("IRRADIANCE_FIELD", "lib/irradiance_field/none"),
        };
        let program = bind_visibility(program, self.maps.as_ref())
            .constant("RAYS", self.rays)
            .constant("SEES_EMISSION", self.sees.emission as u8)
            .constant("HIGHLIGHTS", self.sees.highlights as u8)
            .constant("WALKS", field.is_some() as u8)
            .bind("position", self.gbuffer.position)
            .bind("triangles", self.gbuffer.triangles)
            .bind("seen", seen)
            .bind("albedo", albedo);
        e.compute_pixels(program, "trace", self.gbuffer.size);
        let program = Program::new("lobe_rays/filter")
            .constant("TOLERANCE", self.tolerance)
            .bind("position", self.gbuffer.position)
            .bind("normal", self.gbuffer.normal)
            .bind("seen", seen)
            .bind("albedo", albedo)
            .bind("radiance", self.radiance);
        e.compute_pixels(program, "filter_pixels", self.gbuffer.size);
    }

    fn encode_on_host(&self, e: &mut Encoder<'_>) {
        let Self { gbuffer, maps, sees, rays, tolerance, radiance } = *self;
        let field = Asked::of(e, "indirect");
        let lighting = seen_light::encode(e, sees);
        let surfaces = [gbuffer.position, gbuffer.triangles].map(Read::whole);
        let lit_by = maps.iter().map(|maps| Read::whole(maps.depth)).chain(field.iter().flat_map(Asked::reads));
        let reads: Vec<Read> = surfaces.into_iter().chain(lit_by).collect();
        e.host("trace", &reads, &[radiance], move |host| {
            let mut image = host.take(radiance);
            let (lighting, index) = (seen_light::lighting(host, lighting)?, field.and_then(|field| field.index(host)));
            let indirect = field.and_then(|field| field.on_host(host, index.as_deref()));
            let scene = host.scene();
            let (camera, triangles): (&Camera, &[u32]) = (host.camera().0, bytemuck::cast_slice(host.read(gbuffer.triangles)));
            let is_seen = |pixel: &usize| texels(host, gbuffer.position)[*pixel][3] > 0.0 && triangles[*pixel] > 0;
            let pixels: Vec<usize> = (0..triangles.len()).filter(is_seen).collect();
            let mut traced = vec![None; triangles.len()];
            for pixels in pixels.chunks(TOGETHER.div_ceil(rays as usize)) {
                let fans = pixels.par_iter().map(|pixel| {
                    let at = [*pixel as u32 % gbuffer.size[0], *pixel as u32 / gbuffer.size[0]];
                    Fan::new(scene, (triangles[*pixel] - 1, camera.ray(gbuffer.size, at)), combine(at[0], at[1]), rays)
                });
                let fans: Vec<Fan> = fans.collect();
                let places: Vec<Request> = fans.iter().map(Fan::place).collect();
                let shader = Shading { indirect: indirect.as_ref(), ..Shading::of(host, &lighting, maps, &places) };
                let (views, bundles): (Vec<View>, Vec<&RayBundle>) = fans.iter().map(|fan| (fan.view(), &fan.bundle)).unzip();
                let packets = host.bvh().packets(scene);
                let found = packets.trace_own(scene, &views, &bundles, &shader, |number, seen| fans[number].traced(&seen));
                pixels.iter().zip(found).for_each(|(pixel, found)| traced[*pixel] = Some(found));
            }
            let filter = Filter { pixels: &traced, size: gbuffer.size, tolerance };
            image.par_iter_mut().enumerate().for_each(|(pixel, out)| *out = filter.radiance(pixel).extend(1.0));
            host.put(radiance, image, u64::MAX);
            Ok(())
        });
    }
}

/// Of so many rays one goes anywhere over the surface: what a lobe hardly reflects may be a hundred times as bright as the rest, and be seen by too few of its own.
const ANYWHERE: u32 = 4;

/// Where the number-th ray of a pixel comes from, in the lobe's frame.
fn incoming(gloss: &Gloss, number: u32, rays: u32, shift: [f32; 2]) -> Vec3 {
    let anywhere = rays / ANYWHERE;
    if let Some(number) = number.checked_sub(anywhere) {
        return gloss.lobe.sample(gloss.outgoing, golden(number, rays - anywhere, shift));
    }
    let [along, turn] = golden(number, anywhere, shift);
    around((1.0 - along).sqrt(), TAU * turn)
}

/// How many of a pixel's rays come from around a direction [1/sr].
fn density(gloss: &Gloss, incoming: Vec3, rays: u32) -> f32 {
    let anywhere = rays / ANYWHERE;
    (rays - anywhere) as f32 * gloss.lobe.density(gloss.outgoing, incoming) + anywhere as f32 * incoming.z * FRAC_1_PI
}

/// The rays of a pixel.
struct Fan {
    surface: Surface,
    seed: u32,
    bundle: RayBundle,
    /// What comes of the light along each.
    shares: Vec<Rgb>,
}

impl Fan {
    /// Of the lobe of the surface that a ray of the camera sees.
    fn new(scene: &Scene, (triangle, ray): (u32, Ray), seed: u32, rays: u32) -> Self {
        let surface = scene.seen(triangle, ray, true);
        // Around the plane's normal, on whose side rays have to be.
        let frame = Frame::new(surface.face);
        let shift = [0x9e37_79b9, 0x85eb_ca6b].map(|key| unit(hash(seed ^ key)));
        let (mut directions, mut shares) = (Vec::new(), Vec::new());
        if let Some(gloss) = surface.glossy {
            for number in 0..rays {
                let incoming = incoming(&gloss, number, rays, shift);
                let direction = gloss.frame.to_world(incoming).normalize_or_zero();
                let density = density(&gloss, incoming, rays);
                if incoming.z > 0.0 && density > 0.0 && surface.face.dot(direction) > 0.0 {
                    directions.push(frame.to_local(direction));
                    shares.push(gloss.lobe.value(gloss.outgoing, incoming) * (incoming.z / density));
                }
            }
        }
        Self { surface, seed, bundle: RayBundle::of(&directions), shares }
    }

    fn view(&self) -> View {
        View { position: self.surface.position, frame: Frame::new(self.surface.face) }
    }

    /// Whose turn is what its samples are drawn by.
    fn place(&self) -> Request {
        Request::new(self.surface.position, 0.0, self.surface.face, unit(self.seed))
    }

    fn traced(&self, seen: &[Vec4]) -> Traced {
        let Surface { position, normal, .. } = self.surface;
        let rays = || self.shares.iter().zip(seen.iter().map(|seen| seen.truncate()));
        let albedo: Rgb = self.shares.iter().sum();
        let mean = rays().map(|(share, light)| *share * light).sum::<Vec3>() / albedo;
        let mean = Vec3::select(albedo.cmpgt(Vec3::ZERO), mean, Vec3::ZERO);
        let bright = |colour: Vec3| luminance(colour.as_dvec3()) as f32;
        let variance: f32 = rays().map(|(share, light)| (bright(*share) * (bright(light) - bright(mean))).powi(2)).sum();
        Traced { position, normal, seen: mean, error: variance.sqrt() / bright(albedo).max(f32::MIN_POSITIVE), albedo }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::harmonics::quadrature::hemisphere;
    use crate::math::lobe::Lobe;
    use crate::passes::mock::MockHost;
    use crate::scene::{Glossy, Material, Triangle};
    use glam::{Vec2, Vec3Swizzles};

    /// A floor of a material, seen from above at some cosine.
    fn floor(glossy: Glossy, cosine: f32) -> (MockHost, Ray) {
        let corners = [Vec3::new(-9.0, -9.0, 0.0), Vec3::new(9.0, -9.0, 0.0), Vec3::new(0.0, 9.0, 0.0)];
        let floor = Triangle { positions: corners, normals: [Vec3::Z; 3], uvs: corners.map(Vec3Swizzles::xy), tints: Default::default(), material: 0 };
        let mut host = MockHost::new(vec![floor], [4, 4]);
        host.scene.materials = vec![Material { glossy: Some(glossy), ..Material::diffuse("floor", Vec3::ZERO) }];
        let outgoing = around(cosine, 0.7);
        (host, Ray::new(outgoing, -outgoing))
    }

    /// The share of light from all sides alike that a lobe reflects.
    fn albedo(lobe: &Lobe, outgoing: Vec3) -> f32 {
        let points = hemisphere(400, 800).into_iter();
        points.map(|(d, weight)| f64::from(lobe.value(outgoing, Vec3::from(d.map(|x| x as f32))).x) * d[2] * weight).sum::<f64>() as f32
    }

    /// From few rays as from many: fewer than four have none that goes anywhere.
    #[test]
    fn fans_reflect_what_their_lobes_do() {
        let reflectance = Vec3::splat(0.7);
        let phong = |exponent| Glossy::Phong { reflectance, exponent };
        let ward = Glossy::Ward { reflectance, alpha: Vec2::new(0.1, 0.3) };
        for (glossy, cosine) in [(phong(60.0), 0.9), (phong(400.0), 0.4), (ward, 0.8), (phong(60.0), 0.2)] {
            let (host, ray) = floor(glossy, cosine);
            let gloss = host.scene.seen(0, ray, true).glossy.unwrap();
            let expected = albedo(&gloss.lobe, gloss.outgoing);
            for rays in [3, 64] {
                let seeds = 40_000 / rays;
                let fans = (0..seeds).map(|seed| Fan::new(&host.scene, (0, ray), hash(seed), rays));
                let found = fans.map(|fan| fan.traced(&vec![Vec4::ONE; fan.shares.len()]).albedo.x).sum::<f32>() / seeds as f32;
                assert!((found - expected).abs() < 0.02 * expected, "{:?} at {cosine}, {rays} rays: {found}, not {expected}", gloss.lobe.shape);
            }
        }
    }

    /// Of a lamp that its tail reflects, a hundred times as bright as the rest, over a hundredth of the hemisphere.
    #[test]
    fn tails_are_not_left_to_chance() {
        let (host, ray) = floor(Glossy::Ward { reflectance: Vec3::ONE, alpha: Vec2::splat(0.15) }, 0.95);
        let lamp = around(0.5, 2.0);
        let seen = |fan: &Fan| -> f32 {
            let directions = fan.bundle.directions().map(|local| Frame::new(fan.surface.face).to_world(local));
            let light: Vec<Vec4> = directions.map(|direction| Vec4::splat(if direction.dot(lamp) > 0.99 { 100.0 } else { 1.0 })).collect();
            let traced = fan.traced(&light);
            traced.seen.x * traced.albedo.x
        };
        let all: Vec<f32> = (0..2000).map(|seed| seen(&Fan::new(&host.scene, (0, ray), hash(seed), 64))).collect();
        let mean = all.iter().sum::<f32>() / all.len() as f32;
        let deviation = (all.iter().map(|light| (light - mean).powi(2)).sum::<f32>() / all.len() as f32).sqrt();
        assert!(deviation < 0.2 * mean, "{deviation} around {mean}");
    }
}
