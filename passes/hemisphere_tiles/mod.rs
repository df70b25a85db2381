//! What records see.

use super::irradiance_field;
use super::photons::SEARCH_RADIUS;
use super::record::{TileSample, sample_bytes};
use super::seen_light::{Highlights, INDIRECT, SAMPLES_OF_EMITTERS, SHADOW, Sees, TAPS, direct_leaves_emission, shading_place};
use crate::contract::encoder::{bind_visibility, light_constants, scene_constants, shadow_taps};
use crate::contract::{
    Arguments, Bodies, Choice, Description, Encoder, Input, MOST_BYTES, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes,
    port,
};
use crate::math::hemisphere::{Shape, Table};
use crate::schedule::*;
use growth::Growth;
use guide::Guide;
use std::sync::Arc;
use steering::Steering;

mod cells;
mod cull;
mod growth;
mod guide;
mod host_rays;
pub mod raster;
mod ray_cast;
pub mod shooter_view;
pub mod sift;
mod steering;

pub struct HemisphereTiles;

static DESCRIPTION: Description = Description {
    name: "HemisphereTiles",
    about: "Radiance and distance over the hemisphere of every request: one tile each, in an atlas; every visible sample is shaded once",
    source: "RCS section 5.2; hemispherical projection: STOCH; hemicube: Cohen and Greenberg 1985; strata: Ward and Heckbert 1992, Shirley and Chiu 1997",
    parameters: &[
        Parameter {
            name: "shape",
            about: "how directions are laid out in a tile",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Cosine", about: "strata of equal cosine-weighted solid angle; for rays", parameters: &[] },
                    Choice {
                        name: "Plane",
                        about: "one raster along the normal; what lies below its edge is left to compensation",
                        parameters: &[Parameter {
                            name: "fov",
                            about: "full opening angle",
                            unit: "degrees",
                            kind: ParameterKind::Float { default: 126.87, min: 10.0, max: 175.0 },
                        }],
                    },
                    Choice { name: "Hemicube", about: "five rasters, nothing left out", parameters: &[] },
                    Choice { name: "Concentric", about: "strata of equal cosine-weighted solid angle, nearly square; for rays", parameters: &[] },
                    Choice { name: "Hemispherical", about: "x and y of the unit direction, projected per vertex", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "by",
            about: "how a sample finds what it sees",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Rays", about: "one ray a sample through the hierarchy; the host shades what they see as they end", parameters: &[] },
                    Choice {
                        name: "Raster",
                        about: "the device rasterises the scene from each record; parts outside of a view are culled by the host",
                        parameters: &[Parameter {
                            name: "sift",
                            about: "drop triangles that fall between the samples on the device, where a scene has more triangles than a view has samples",
                            unit: "",
                            kind: ParameterKind::Bool { default: true },
                        }],
                    },
                ],
            },
        },
        Parameter {
            name: "resolution",
            about: "samples along an edge of a tile",
            unit: "samples",
            kind: ParameterKind::Integer { default: 64, min: 4, max: 512 },
        },
        TAPS,
        Parameter {
            name: "emission",
            about: "whether emitters and the sky are seen",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Auto", about: "where the direct pass leaves them to records", parameters: &[] },
                    Choice { name: "Never", about: "not at all: for records that tell what surfaces receive of each other", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "highlights",
            about: "lobes of the surfaces seen that reflect direct light",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "All", about: "all; narrow ones make blots of what they reflect of small lights", parameters: &[] },
                    Choice { name: "Wide", about: "all but narrow ones, whose light photons bring", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "photons",
            about: "photons of the guide that are looked at for a tile",
            unit: "photons",
            kind: ParameterKind::Integer { default: 64, min: 1, max: 4096 },
        },
        SEARCH_RADIUS,
        Parameter {
            name: "share",
            about: "share of a tile's light that is worth a second ray to a stratum; twice the share is worth four more",
            unit: "",
            kind: ParameterKind::Float { default: 0.02, min: 1e-4, max: 1.0 },
        },
        Parameter {
            name: "quality",
            about: "standard error of a tile's sum, as a share of it, above which tiles beside it are finer; 1e6 leaves all as they are; host",
            unit: "",
            kind: ParameterKind::Float { default: 1e6, min: 1e-4, max: 1e6 },
        },
        Parameter {
            name: "finest",
            about: "how many times as fine along an edge tiles may be for that: 2, 4 or 8, each as fine as it has to be",
            unit: "",
            kind: ParameterKind::Integer { default: 2, min: 2, max: 8 },
        },
        PLACE,
    ],
    inputs: &[
        Input { name: "at", about: "places that need a record", accepts: PortKind::Requests, takes: Takes::One, changes: false },
        Input {
            name: "direct",
            about: "the direct pass: what it lights surfaces from, records leave out; without it records see all emission",
            accepts: PortKind::DirectLight,
            takes: Takes::AtMostOne,
            changes: false,
        },
        SHADOW,
        INDIRECT,
        Input {
            name: "guide",
            about: "photons that say where light comes from: strata that much comes from have more rays than one, and hold what they see in the mean",
            accepts: PortKind::PhotonMap,
            takes: Takes::AtMostOne,
            changes: false,
        },
    ],
    outputs: &[Output { name: "tiles", about: "the atlas", kind: PortKind::Tiles }],
};

/// From here on tiles may be as unsure as they are.
const ANY_QUALITY: f64 = 1e6;

/// Widest atlas [texels].
const ATLAS: u32 = 8192;

/// What the ways of seeing share.
struct Work {
    requests: port::Requests,
    table: Arc<Table>,
    shape: Shape,
    /// The table's samples as a buffer.
    samples: Resource,
    /// Buffer of u32: triangle + 1. As a raster leaves them, in the order of the atlas' texels; as rays do, a tile after the other.
    seen: Resource,
    /// Of the atlas [texels].
    size: [u32; 2],
    tiles_per_row: u32,
    is_raster: bool,
}

impl Work {
    fn layout(&self, program: Program) -> Program {
        let [tiles_per_row, pitch] = self.rows();
        program
            .constant("TILE_WIDTH", self.table.width)
            .constant("TILE_HEIGHT", self.table.height)
            .constant("TILES_PER_ROW", tiles_per_row)
            .constant("TILE_CAPACITY", self.requests.capacity)
            .constant("ATLAS_PITCH", pitch)
    }

    /// Tiles along a row of what is seen, and samples from a row to the next.
    fn rows(&self) -> [u32; 2] {
        if self.is_raster { [self.tiles_per_row, (Format::R32Uint.row_bytes(self.size[0]) / Format::R32Uint.bytes()) as u32] } else { [1, self.table.width] }
    }

    fn samples_per_tile(&self) -> u32 {
        self.table.width * self.table.height
    }

    /// A buffer of radiance and distance, a tile after the other.
    fn radiance(&self, e: &mut Encoder<'_>) -> Resource {
        e.buffer("radiance", self.radiance_bytes())
    }

    fn radiance_bytes(&self) -> u64 {
        self.requests.capacity as u64 * self.samples_per_tile() as u64 * 16
    }

    fn corner(&self, tile: u32) -> [u32; 2] {
        [tile % self.tiles_per_row * self.table.width, tile / self.tiles_per_row * self.table.height]
    }
}

impl Pass for HemisphereTiles {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn most_of_batch(&self, arguments: &Arguments) -> u32 {
        let size = shape(arguments).size(arguments.integer("resolution") as u32);
        let in_atlas = size.map(|edge| ATLAS / edge).iter().product::<u32>();
        let in_buffer = MOST_BYTES / (16 * u64::from(size[0]) * u64::from(size[1]));
        in_atlas.min(in_buffer as u32).max(1)
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(requests) = e.requests("at").copied() else { return Ok(()) };
        let shape = shape(e.arguments);
        let resolution = e.arguments.integer("resolution") as u32;
        let (by, way) = e.arguments.choice("by");
        let taps = shadow_taps(e.arguments)?;
        if e.setting.needs.shadowed_lights == 0 {
            e.idle("taps", "no punctual light casts shadows");
        }
        let table = Table::new(shape, resolution, crate::math::hemisphere::Method::None)
            .map_err(|e| Refusal::of_parameter("resolution", "plan::tile", e.to_string(), "choose another shape or resolution"))?;
        if by == "Raster" && table.views.is_empty() {
            return Err(Refusal::of_parameter(
                "by",
                "plan::raster_shape",
                format!("the shape {} cannot be rasterised", e.arguments.choice("shape").0),
                "cast rays, or choose Plane, Hemicube or Hemispherical",
            ));
        }
        let work = layout(e, requests, shape, table, by == "Raster");
        let maps = e.shadow_maps("shadow").map(|maps| port::ShadowMaps { taps, ..*maps });
        let cast = e.place(Bodies::BOTH.unless(by == "Raster", "the scene is rasterised"))?;
        let shaded = shading_place(e, cast, maps.as_ref())?;
        let indirect = e.irradiance_field("indirect").copied();
        let sees = sees(e);
        let guide = guide(e, &work);
        // Places that stay where they are while a loop runs see the same in each round; what lights that by way of other surfaces may change.
        let steady = match indirect {
            Some(port::IrradianceField::Records(index)) if e.is_steady("at") && !e.is_steady("indirect") && guide.is_none() => Some(index),
            _ => None,
        };
        let growth = growth(e, &work, shaded, steady.is_some());
        let (samples, sureness) = match (shaded, steady) {
            (Place::Host, None) => {
                let steering = Steering::new(e, &work, guide, growth);
                let sureness = steering.sureness;
                (host_rays::encode_shaded(e, &work, maps, (sees, steering)), sureness)
            }
            (Place::Host, Some(index)) => (host_rays::encode_steady(e, &work, maps, index, sees), None),
            (Place::Device, _) => {
                let see = |e: &mut Encoder<'_>| {
                    match cast {
                        Place::Host => host_rays::encode(e, &work),
                        Place::Device if by == "Raster" => raster::encode(e, &work, way.bool("sift")),
                        Place::Device => ray_cast::encode(e, &work),
                    }
                    shade(e, &work, Seen::Strata, (maps.as_ref(), sees))
                };
                let radiance = match steady {
                    None => see(e),
                    Some(_) => {
                        let (from, to) = (e.all_before_loop(see), work.radiance(e));
                        e.command(Command::Copy { from, to });
                        to
                    }
                };
                indirect.iter().for_each(|field| add_indirect(e, &work, Seen::Strata, (field, radiance)));
                if let Some(guide) = &guide {
                    guide.encode(e, &work, radiance, |e, seen| {
                        let radiance = shade(e, &work, seen, (maps.as_ref(), sees));
                        indirect.iter().for_each(|field| add_indirect(e, &work, seen, (field, radiance)));
                        radiance
                    });
                }
                (radiance, None)
            }
        };
        let sees_emission = sees.emission && (e.setting.needs.emissive_triangles > 0 || e.setting.needs.environment);
        let (is_steady, table, tiles_per_row) = (e.is_steady("at"), work.table, work.tiles_per_row);
        let tiles = port::Tiles { samples, sureness, place: shaded, is_steady, sees_emission, requests, shape, resolution, table, tiles_per_row };
        e.output("tiles", Port::Tiles(tiles));
        Ok(())
    }
}

/// The triangles that places see, without what light these reflect.
///
/// # Errors
/// A resolution that the shape does not have.
pub fn see(
    e: &mut Encoder<'_>,
    requests: port::Requests,
    (shape, resolution): (Shape, u32),
    (cast, is_raster): (Place, bool),
) -> Result<port::ShooterViews, Refusal> {
    let table = Table::new(shape, resolution, crate::math::hemisphere::Method::None)
        .map_err(|e| Refusal::of_parameter("resolution", "plan::tile", e.to_string(), "choose another resolution"))?;
    let work = layout(e, requests, shape, table, is_raster);
    match cast {
        Place::Host => host_rays::encode(e, &work),
        Place::Device if is_raster => raster::encode(e, &work, true),
        Place::Device => ray_cast::encode(e, &work),
    }
    let [tiles_per_row, pitch] = work.rows();
    Ok(port::ShooterViews { seen: work.seen, shape, resolution, size: [work.table.width, work.table.height], tiles_per_row, pitch })
}

fn sees(e: &mut Encoder<'_>) -> Sees {
    let emission = e.arguments.choice("emission").0 == "Auto" && direct_leaves_emission(e);
    if !e.setting.needs.narrow_lobes {
        e.idle("highlights", "no surface has a narrow lobe that is rendered");
    }
    Sees { emission, highlights: if e.arguments.choice("highlights").0 == "All" { Highlights::All } else { Highlights::Wide } }
}

fn shape(arguments: &Arguments) -> Shape {
    match arguments.choice("shape") {
        ("Plane", arguments) => Shape::Plane { fov_degrees: arguments.float("fov") },
        ("Hemicube", _) => Shape::Hemicube,
        ("Hemispherical", _) => Shape::Hemispherical,
        ("Concentric", _) => Shape::Concentric,
        _ => Shape::Cosine,
    }
}

fn layout(e: &mut Encoder<'_>, requests: port::Requests, shape: Shape, table: Table, is_raster: bool) -> Work {
    let bytes = requests.capacity as u64 * (table.width * table.height) as u64 * 16;
    let tiles_per_row = (ATLAS / table.width).min(requests.capacity).max(1);
    let rows = requests.capacity.div_ceil(tiles_per_row);
    let samples = e.constant_buffer("directions", &sample_bytes(&table));
    let size = [tiles_per_row * table.width, rows * table.height];
    let seen_bytes = if is_raster { Format::R32Uint.row_bytes(size[0]) * size[1] as u64 } else { bytes / 4 };
    let seen = e.buffer("seen", seen_bytes);
    debug_assert_eq!(size_of::<TileSample>(), 32);
    Work { requests, table: Arc::new(table), shape, samples, seen, size, tiles_per_row, is_raster }
}

/// Rays, and what each of them has met.
#[derive(Clone, Copy)]
enum Seen {
    /// One a stratum.
    Strata,
    /// Those of a list, and the triangles that they met.
    More { rays: Resource, triangles: Resource },
}

/// Joins rays to a program that works through them.
fn bind_seen(program: Program, work: &Work, seen: Seen) -> Program {
    let program = work.layout(program).bind("requests", work.requests.places);
    match seen {
        Seen::Strata => program.import("SEEN", "lib/seen/strata").bind("samples", work.samples).bind("seen", work.seen),
        // They stand a tile after the other, whatever the atlas.
        Seen::More { rays, triangles } => program.import("SEEN", "lib/seen/more").bind("more_rays", rays).bind("seen", triangles),
    }
}

fn shade(e: &mut Encoder<'_>, work: &Work, seen: Seen, (maps, sees): (Option<&port::ShadowMaps>, Sees)) -> Resource {
    let radiance = e.buffer(if matches!(seen, Seen::Strata) { "radiance" } else { "more_radiance" }, work.radiance_bytes());
    let walks = e.irradiance_field("indirect").is_some();
    let program = light_constants(Program::new("hemisphere_tiles/shade"), e.setting.needs, SAMPLES_OF_EMITTERS);
    let program = bind_seen(bind_visibility(program, maps), work, seen)
        .constant("SEES_EMISSION", sees.emission as u8)
        .constant("HIGHLIGHTS", sees.highlights as u8)
        .constant("WALKS", walks as u8)
        .bind("radiance", radiance);
    e.compute(program, "shade", each_sample(work));
    radiance
}

/// Adds what the surfaces that are seen reflect of indirect light.
fn add_indirect(e: &mut Encoder<'_>, work: &Work, seen: Seen, (field, radiance): (&port::IrradianceField, Resource)) {
    let program = scene_constants(irradiance_field::bind(Program::new("hemisphere_tiles/indirect"), field), e.setting.needs);
    e.compute(bind_seen(program, work, seen).bind("radiance", radiance), "add_indirect", each_sample(work));
}

/// What photons say, where they are asked; they know strata of the concentric shape, and rays.
fn guide(e: &mut Encoder<'_>, work: &Work) -> Option<Guide> {
    let guide = Guide::of(e, work);
    let because = match &guide {
        None => "no photons guide the rays",
        Some(_) if work.is_raster || work.shape != Shape::Concentric => "photons guide rays of the shape Concentric alone",
        Some(_) => return guide,
    };
    ["photons", "search_radius", "share"].into_iter().for_each(|parameter| e.idle(parameter, because));
    None
}

/// How tiles grow, where they are asked to and can.
fn growth(e: &mut Encoder<'_>, work: &Work, shaded: Place, is_steady: bool) -> Option<Growth> {
    let quality = e.arguments.float("quality");
    if quality >= ANY_QUALITY {
        e.idle("finest", "all tiles are as fine as others");
        return None;
    }
    let because = match shaded {
        _ if work.is_raster || work.shape != Shape::Concentric => "only rays of the shape Concentric become more",
        Place::Device => "the device casts as many rays for all tiles",
        Place::Host if is_steady => "the tiles of a loop over the same places are seen once",
        Place::Host => match Growth::new(quality as f32, work.table.width, e.arguments.integer("finest") as u32) {
            Some(growth) => return Some(growth),
            None => "tiles of twice the resolution would be larger than tiles may",
        },
    };
    ["quality", "finest"].into_iter().for_each(|parameter| e.idle(parameter, because));
    None
}

fn each_sample(work: &Work) -> Groups {
    Groups::Counted { count: work.requests.count, divisor: 1, per: work.samples_per_tile().div_ceil(64) }
}
