//! Light kept in the surfaces' own texture.

use super::lit_surfaces::{Lighting, Lit};
use super::texels::{self, BLOCK, TexelPlace, TexelSurface};
use crate::contract::{
    Arguments, Bodies, Choice, Description, Encoder, MOST_BYTES, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal,
    encoder::{bind_visibility, light_constants},
    port,
};
use crate::math::{
    bounces::Bounces,
    colour::reflectance_bits,
    random::{combine, hash},
};
use crate::scene::{
    Scene,
    atlas::{Atlas, Cell, Charts, Spot, Texel, Wanted},
    emitters::Emitters,
    packets::ToDo,
    surface::{Ray, Surface},
};
use crate::schedule::*;
use fearless_simd::{Level, dispatch};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

pub struct Lightmap;

static DESCRIPTION: Description = Description {
    name: "Lightmap",
    about: "A texture of all surfaces, and the direct light that each of its texels reflects: what light is shot from and to",
    source: "STOCH section 3; charts of what goes on without an edge: our own",
    parameters: &[
        Parameter {
            name: "resolution",
            about: "texels along an edge; where surfaces have two sides each has as many",
            unit: "texels",
            kind: ParameterKind::Integer { default: 512, min: 8, max: 2048 },
        },
        Parameter {
            name: "charts",
            about: "which triangles lie together",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Smooth", about: "those that go on into each other without an edge", parameters: &[] },
                    Choice { name: "Each", about: "each alone", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "points",
            about: "points by chance of a texel's surface, which are lit by direct light, and take turns where there is DrawPoints: 1 for one in its middle; fewer where they find no room",
            unit: "",
            kind: ParameterKind::Integer { default: 4, min: 1, max: 16 },
        },
        Parameter {
            name: "area_samples",
            about: "shadow rays a texel to area lights",
            unit: "rays",
            kind: ParameterKind::Integer { default: 16, min: 1, max: 4096 },
        },
        Parameter {
            name: "sky_samples",
            about: "shadow rays a texel to the sky",
            unit: "rays",
            kind: ParameterKind::Integer { default: 64, min: 1, max: 4096 },
        },
        Parameter {
            name: "iterations",
            about: "how often light is shot in all; `settled` of the Average tells when",
            unit: "iterations",
            kind: ParameterKind::Integer { default: 64, min: 1, max: 65_536 },
        },
        Parameter {
            name: "remembers",
            about: "how many iterations the light of a scene counts as once that has changed, so that it comes to what it is now by and by: 0 to start anew. Light of a scene where surfaces have moved is \
                    forgotten in any case",
            unit: "iterations",
            kind: ParameterKind::Integer { default: 0, min: 0, max: 65_536 },
        },
        PLACE,
    ],
    inputs: &[],
    outputs: &[Output { name: "lightmap", about: "the texture", kind: PortKind::Lightmap }],
};

impl Pass for Lightmap {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn reflections(&self, _: &Arguments) -> Option<Bounces> {
        Some(Bounces::All)
    }

    fn only_longer(&self) -> &'static [&'static str] {
        &["iterations", "remembers"]
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let atlas = atlas(e);
        let lightmap = declared(e, &atlas);
        let samples = ["area_samples", "sky_samples"].map(|name| (e.arguments.integer(name) as u32).div_ceil(lightmap.points));
        tell_idle(e);
        match e.place(Bodies::BOTH)? {
            Place::Host => light_on_host(e, &lightmap, samples),
            Place::Device => light_on_device(e, &lightmap, samples),
        }
        e.output("lightmap", Port::Lightmap(lightmap));
        Ok(())
    }
}

fn atlas(e: &mut Encoder<'_>) -> Atlas {
    let edge = e.arguments.integer("resolution") as u32;
    let by = if e.arguments.choice("charts").0 == "Each" { Charts::Each } else { Charts::Smooth };
    let most = MOST_BYTES / (size_of::<TexelPlace>() as u64 * u64::from(edge).pow(2));
    let points = (e.arguments.integer("points") as u32).min(most.max(1) as u32);
    let wanted = Wanted { edge, charts: by, draws: if points > 1 { points } else { 0 }, sides: sides(e) };
    let atlas = Atlas::new(e.setting.scene, wanted);
    e.remark(format!("{} charts", atlas.charts));
    if u64::from(points) < e.arguments.integer("points") as u64 {
        e.remark(format!("texels have {points} points, for which there is room"));
    }
    if atlas.cut > 0 {
        e.remark(format!("walls go through {} texels, which are kept in parts", atlas.cut));
    }
    if atlas.buried > 0 {
        e.remark(format!("{} texels are within something solid, and count nothing", atlas.buried));
    }
    if atlas.uncut > 0 {
        e.remark(format!("walls go through {} more, for whose parts there is no room", atlas.uncut));
    }
    if atlas.crowded > 0 {
        e.remark(format!("{} of {} triangles share their texels with others, whose light they take", atlas.crowded, e.setting.needs.triangles));
    }
    atlas
}

/// Of surfaces.
fn sides(e: &Encoder<'_>) -> u32 {
    if e.setting.needs.two_sides { 2 } else { 1 }
}

fn declared(e: &mut Encoder<'_>, atlas: &Atlas) -> port::Lightmap {
    let sides = sides(e);
    let texels = atlas.texels.len() as u64;
    let cells: Vec<[u32; 4]> = atlas.cells.iter().map(|Cell { first, parts: [a, b, c] }| [*first, *a, *b, *c]).collect();
    let links: Vec<[u32; 2]> = (0..).zip(&atlas.links).map(|(place, links)| [*links, atlas.texels[place / sides as usize].cell]).collect();
    let corners: Vec<[Vec4; 2]> = atlas.corners.iter().map(|[a, b, c]| [Vec4::new(a.x, a.y, b.x, b.y), Vec4::new(c.x, c.y, 0.0, 0.0)]).collect();
    // A scene without surfaces has room for one that is none.
    let room = texels.max(1);
    let bytes = 16 * room * u64::from(sides);
    debug_assert!(bytes <= MOST_BYTES);
    let cells = e.constant_buffer("cells", bytemuck::cast_slice(&cells));
    let links = e.constant_buffer("links", bytemuck::cast_slice(&links));
    let corners = e.constant_buffer("corners", bytemuck::cast_slice(&corners));
    let points = places_of_points(e.setting.scene, atlas);
    let sets = points.len().max(1) as u32;
    let points = e.constant_buffer("points", bytemuck::cast_slice(&points.concat()));
    let surfaces = e.history_buffer("surfaces", size_of::<TexelSurface>() as u64 * room);
    let [direct, fresh, near, mean] = ["direct", "fresh", "near", "mean"].map(|name| e.history_buffer(name, bytes));
    let [iterations, counted, rounds] = ["iterations", "counted", "rounds"].map(|name| e.variable(name, true));
    let known = e.variable("known", true);
    e.report_variable("iterations", rounds);
    let remembers = e.arguments.integer("remembers") as u32;
    if remembers > 0 {
        e.survives_with(cells, &[fresh, near, mean], &[counted, rounds, known]);
    }
    port::Lightmap {
        edge: atlas.edge,
        texels: texels as u32,
        sides,
        cells,
        links,
        corners,
        places: points,
        points: sets,
        surfaces,
        direct,
        fresh,
        near,
        mean,
        iterations,
        counted,
        rounds,
        known,
        wanted: e.arguments.integer("iterations") as u32,
        remembers,
    }
}

fn tell_idle(e: &mut Encoder<'_>) {
    let (emits, shines) = (e.setting.needs.emissive_triangles > 0, e.setting.needs.environment);
    if shines && !emits {
        e.idle("area_samples", "no surface emits light");
    }
    if emits && !shines {
        e.idle("sky_samples", "the sky is black");
    }
}

/// Of all texels, one set of points after the other.
fn places_of_points(scene: &Scene, atlas: &Atlas) -> Vec<Vec<TexelPlace>> {
    let place = |(texel, spot): (&Texel, Spot)| {
        let triangle = spot.triangle - 1;
        let share = texel.area / (0.5 * scene.at_rest(triangle).cross().length());
        TexelPlace { triangle, barycentric_u: spot.barycentric.x, barycentric_v: spot.barycentric.y, share }
    };
    if atlas.draws.is_empty() {
        return vec![atlas.texels.iter().map(|texel| place((texel, texel.spot))).collect()];
    }
    atlas.draws.iter().map(|draw| atlas.texels.iter().zip(draw.iter().copied()).map(place).collect()).collect()
}

/// Whether texels are to be lit: nothing has been shot since the scene has changed last.
fn is_new(host: &dyn HostContext, lightmap: &port::Lightmap) -> bool {
    host.variable(lightmap.iterations) == 0
}

fn light_on_device(e: &mut Encoder<'_>, lightmap: &port::Lightmap, samples: [u32; 2]) {
    let program = bind_visibility(light_constants(Program::new("lightmap"), e.setting.needs, samples), None)
        .constant("SIDES", lightmap.sides)
        .constant("TEXELS", lightmap.texels)
        .constant("POINTS", lightmap.points)
        .bind("texels", lightmap.places)
        .bind("surfaces", lightmap.surfaces)
        .bind("direct", lightmap.direct);
    let (of, lighting) = (*lightmap, e.variable("lighting", false));
    e.host("begin", &[], &[], move |host| {
        host.set(lighting, if is_new(host, &of) { of.places() } else { 0 });
        Ok(())
    });
    e.compute(program, "light", Groups::Counted { count: lighting, divisor: BLOCK as u32, per: 1 });
}

fn light_on_host(e: &mut Encoder<'_>, lightmap: &port::Lightmap, samples: [u32; 2]) {
    let of @ port::Lightmap { sides, surfaces, direct, places, .. } = *lightmap;
    e.host("light", &[Read::whole(places)], &[surfaces, direct], move |host| {
        if !is_new(host, &of) {
            return Ok(());
        }
        let [mut found, mut light] = [surfaces, direct].map(|resource| host.take(resource));
        let (scene, bvh, extent) = (host.scene(), host.bvh(), host.extent());
        let places: &[TexelPlace] = &bytemuck::cast_slice(host.read(places))[..(of.texels * of.points) as usize];
        let emitters = Emitters::new(scene, bvh, extent, host.emission(), samples);
        let lighting = Lighting { scene, bvh, extent, lights: &scene.lights, emitters };
        texels::place(scene, places, bytemuck::cast_slice_mut(&mut found));
        let blocks = light[..of.places() as usize].par_chunks_mut(BLOCK * sides as usize).enumerate();
        blocks.for_each_init(ToDo::default, |to_do, (block, light)| {
            let first = block * BLOCK;
            light.fill(Vec4::ZERO);
            let mut reflectance = vec![Vec3::ZERO; light.len()];
            for point in 0..of.points as usize {
                let places = &places[point * of.texels as usize + first..][..light.len() / sides as usize];
                for side in 0..sides as usize {
                    let block = Block { first, places, side, sides: sides as usize, point: point as u32 };
                    block.light(&lighting, (light, &mut reflectance), to_do);
                }
            }
            let share = 1.0 / of.points as f32;
            let means = light.iter_mut().zip(reflectance);
            means.for_each(|(light, reflectance)| *light = (light.truncate() * share).extend(f32::from_bits(reflectance_bits(reflectance * share))));
        });
        host.put(surfaces, found, u64::MAX);
        host.put(direct, light, u64::MAX);
        Ok(())
    });
}

/// One side of neighbours, from the `first` texel on, by one of their points.
struct Block<'a> {
    first: usize,
    places: &'a [TexelPlace],
    side: usize,
    sides: usize,
    point: u32,
}

impl Block<'_> {
    /// Adds its light, and what it reflects of any.
    fn light(&self, lighting: &Lighting<'_>, (light, reflectance): (&mut [Vec4], &mut [Vec3]), to_do: &mut ToDo) {
        let lit = |(at, texel): (usize, &TexelPlace)| {
            let surface = seen(lighting.scene, lighting.extent, texel, self.side)?;
            let seed = combine(hash(((self.first + at) * self.sides + self.side) as u32), self.point);
            Some(Lit { place: at as u32, surface, seed, light: Vec3::ZERO })
        };
        let mut surfaces: Vec<Lit> = self.places.iter().enumerate().filter_map(lit).collect();
        lighting.light(&mut surfaces, to_do);
        for Lit { place, surface, seed, light: own } in &surfaces {
            let sky = lighting.emitters.see_sky().then(|| dispatch!(Level::new(), _simd => lighting.emitters.broad_sky(surface, *seed, to_do)));
            let own = *own + sky.map_or(Vec3::ZERO, |sky| sky.truncate() * surface.reflectance);
            let at = *place as usize * self.sides + self.side;
            light[at] += own.extend(0.0);
            reflectance[at] += surface.reflectance;
        }
    }
}

/// A side of a texel by its albedo, with its maps as wide as the texel; none where nothing is seen from there.
fn seen(scene: &Scene, extent: f32, texel: &TexelPlace, side: usize) -> Option<Surface> {
    let triangle = &scene.triangles[texel.triangle as usize];
    if side == 1 && !scene.materials[triangle.material as usize].two_sided {
        return None;
    }
    let weights = glam::Vec2::new(texel.barycentric_u, texel.barycentric_v);
    let face = if side == 0 { triangle.face_normal() } else { -triangle.face_normal() };
    let (tangent, bitangent) = face.any_orthonormal_pair();
    let width = texel.area(triangle).sqrt() / extent.max(f32::MIN_POSITIVE);
    let ray = Ray { origin: triangle.position(weights) + face * extent, direction: -face, sides: [tangent * width, bitangent * width] };
    Some(scene.diffuse_surface(texel.triangle, weights, ray))
}
