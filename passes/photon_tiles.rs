//! Tiles made of photons instead of rays: what arrives at a place, by where it comes from.

use super::photons::{
    DIRECT, PHOTON_BYTES, Photon, SEARCH_RADIUS, expect_direct_light,
    lookup::{LEAST_COSINE, Lookup},
    unpacked_ways,
};
use super::record::{REQUEST_BYTES, Request};
use super::surroundings::surface_beside;
use crate::contract::encoder::scene_constants;
use crate::contract::{
    Bodies, Choice, Description, Encoder, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, port,
};
use crate::math::frame::Frame;
use crate::math::hemisphere::{Method, Shape, Table, square};
use crate::math::outline::{DIRECTIONS, LEAST_SHARE, Outline};
use crate::scene::{Scene, bvh::Bvh, surface_offset};
use crate::schedule::*;
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::PI;
use std::sync::Arc;

pub struct PhotonTiles;

static DESCRIPTION: Description = Description {
    name: "PhotonTiles",
    about: "Radiance and distance over the hemisphere of every request, from the photons that arrive near it: their flux over the area that they stand for",
    source: "THESIS 6.3, equation 6.11; the area by rays: our own",
    parameters: &[
        Parameter {
            name: "resolution",
            about: "samples along an edge of a tile",
            unit: "samples",
            kind: ParameterKind::Integer { default: 6, min: 4, max: 64 },
        },
        Parameter {
            name: "photons",
            about: "photons of a tile, where there are so many near",
            unit: "photons",
            kind: ParameterKind::Integer { default: 64, min: 1, max: 4096 },
        },
        SEARCH_RADIUS,
        Parameter {
            name: "visible",
            about: "leave out photons that cannot be seen from the place, so that none counts on the other side of a wall",
            unit: "",
            kind: ParameterKind::Bool { default: true },
        },
        Parameter {
            name: "area",
            about: "how the area is found that photons stand for",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice {
                        name: "Probed",
                        about: "of the photons' outline that part which is on the surface and can be seen, by rays: columns and openings leave holes",
                        parameters: &[Parameter {
                            name: "rays",
                            about: "points of the outline",
                            unit: "rays",
                            kind: ParameterKind::Integer { default: 32, min: 4, max: 1024 },
                        }],
                    },
                    Choice { name: "Outline", about: "the photons' own outline, where it is smaller than a disc's would be (THESIS 6.3)", parameters: &[] },
                    Choice { name: "Disc", about: "all of the disc: dark along edges", parameters: &[] },
                ],
            },
        },
        PLACE,
    ],
    inputs: &[
        Input { name: "at", about: "places that need a record", accepts: PortKind::Requests, takes: Takes::One, changes: false },
        Input { name: "map", about: "the photons", accepts: PortKind::PhotonMap, takes: Takes::One, changes: false },
        DIRECT,
    ],
    outputs: &[Output { name: "tiles", about: "the atlas", kind: PortKind::Tiles }],
};

/// Which photons count at a place.
#[derive(Clone, Copy)]
struct Sought {
    wanted: u32,
    /// [scene units]
    search_radius: f32,
    visible: bool,
    area: Area,
}

/// The parameter `area`.
#[derive(Clone, Copy)]
enum Area {
    Probed { rays: u32 },
    Outline,
    Disc,
}

/// Photons whose sight a lane of a driver on the processor can look for before it counts too many rounds.
const MOST_BY_SOFTWARE: u32 = 32;

/// How far above the surface sight goes, as a share of the radius.
const ABOVE: f32 = 0.1;

/// Distance of what nothing arrives from [scene units].
const FAR_AWAY: f32 = 1e30;

impl Pass for PhotonTiles {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(requests), Some(map)) = (e.requests("at").copied(), e.photon_map("map").copied()) else { return Ok(()) };
        expect_direct_light(e)?;
        let resolution = e.arguments.integer("resolution") as u32;
        let table = Table::new(Shape::Concentric, resolution, Method::None)
            .map_err(|e| Refusal::of_parameter("resolution", "plan::tile", e.to_string(), "choose another resolution"))?;
        let sought = Sought {
            wanted: e.arguments.integer("photons") as u32,
            search_radius: e.arguments.float("search_radius") as f32 * e.setting.needs.extent,
            visible: e.arguments.bool("visible"),
            area: match e.arguments.choice("area") {
                ("Outline", _) => Area::Outline,
                ("Disc", _) => Area::Disc,
                (_, arguments) => Area::Probed { rays: arguments.integer("rays") as u32 },
            },
        };
        let samples = e.buffer("radiance", 16 * u64::from(requests.capacity) * u64::from(resolution * resolution));
        let is_long = e.setting.device.is_software && sought.visible && sought.wanted > MOST_BY_SOFTWARE;
        let place = e.place(Bodies::BOTH.unless_on_device(is_long, "a driver on the cores of the host ends loops after 65,536 rounds"))?;
        match place {
            Place::Host => encode_on_host(e, requests, map, samples, (resolution, sought)),
            Place::Device => encode_on_device(e, requests, map, samples, (resolution, sought)),
        }
        let tiles_per_row = (8192 / table.width).min(requests.capacity).max(1);
        let tiles = port::Tiles {
            samples,
            sureness: None,
            place,
            is_steady: false,
            sees_emission: false,
            requests,
            shape: Shape::Concentric,
            resolution,
            table: Arc::new(table),
            tiles_per_row,
        };
        e.output("tiles", Port::Tiles(tiles));
        Ok(())
    }
}

/// Words of a place's state and outline, as the shader keeps them.
const STATE_WORDS: u64 = 6 + 2 * DIRECTIONS as u64;

fn encode_on_device(e: &mut Encoder<'_>, requests: port::Requests, map: port::PhotonMap, samples: Resource, (resolution, sought): (u32, Sought)) {
    let work = e.buffer("work", 4 * u64::from(requests.capacity) * (STATE_WORDS + u64::from(resolution * resolution)));
    let program = scene_constants(Program::new("photon_tiles"), e.setting.needs)
        .constant("TILE_WIDTH", resolution)
        .constant("TILE_HEIGHT", resolution)
        .constant("TILE_CAPACITY", requests.capacity)
        .constant("WANTED", sought.wanted)
        .constant("SEARCH_RADIUS", sought.search_radius)
        .constant("VISIBLE", sought.visible as u8)
        .constant(
            "AREA",
            match sought.area {
                Area::Disc => 0,
                Area::Outline => 1,
                Area::Probed { rays } => rays,
            },
        )
        .bind("requests", requests.places)
        .bind("radiance", samples)
        .bind("work", work)
        .bind("photon_map", map.data);
    let each_place = Groups::Counted { count: requests.count, divisor: 64, per: 1 };
    e.compute(program.clone(), "find_zones", each_place);
    e.compute(program.clone(), "gather", each_place);
    if let Area::Probed { rays } = sought.area {
        e.compute(program.clone(), "probe", Groups::Counted { count: requests.count, divisor: 1, per: rays.div_ceil(64) });
    }
    e.compute(program, "finish", each_place);
}

fn encode_on_host(e: &mut Encoder<'_>, requests: port::Requests, map: port::PhotonMap, samples: Resource, (resolution, sought): (u32, Sought)) {
    let samples_per_tile = (resolution * resolution) as usize;
    let reads = [Read::counted(requests.places, REQUEST_BYTES, requests.count), Read::counted(map.data, PHOTON_BYTES, map.slots)];
    e.host("gather", &reads, &[samples], move |host| {
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let mut tiles = host.take(samples);
        let gatherer = Gatherer { lookup: Lookup::of(&map, host), scene: host.scene(), bvh: host.bvh(), extent: host.extent(), sought };
        let filled = &mut tiles[..places.len() * samples_per_tile];
        filled.par_chunks_mut(samples_per_tile).zip(&places).for_each(|(tile, place)| gatherer.fill(place, resolution, tile));
        let bytes = size_of_val(filled) as u64;
        host.put(samples, tiles, bytes);
        Ok(())
    });
}

/// What finds the photons of places.
struct Gatherer<'a> {
    lookup: Lookup<'a>,
    scene: &'a Scene,
    bvh: &'a Bvh,
    extent: f32,
    sought: Sought,
}

impl Gatherer<'_> {
    /// Photons of a place, without one that it stands on, and the area that they stand for.
    fn photons(&self, position: Vec3, normal: Vec3) -> (Vec<&Photon>, f32) {
        let zone = self.lookup.zone(position, normal, self.sought.wanted, self.sought.search_radius);
        let mut photons = Vec::new();
        self.lookup.for_each(position, normal, zone, |photon, squared| {
            if squared > 0.0 && self.sees([position, photon.position.into()], normal, zone.radius) {
                photons.push(photon);
            }
        });
        let area = self.area(position, normal, zone.radius, &photons) / zone.fair_share(photons.len());
        (photons, area)
    }

    /// The area that photons stand for, all within a radius.
    fn area(&self, position: Vec3, normal: Vec3, radius: f32, photons: &[&Photon]) -> f32 {
        let disc = PI * radius * radius;
        let frame = Frame::new(normal);
        if matches!(self.sought.area, Area::Disc) {
            return disc;
        }
        let mut outline = Outline::new();
        for photon in photons {
            let way = Vec3::from(photon.position) - position;
            outline.add(Vec2::new(way.dot(frame.tangent), way.dot(frame.bitangent)));
        }
        let Area::Probed { rays } = self.sought.area else { return outline.stands_for(radius) };
        let (points, region) = outline.region(radius, rays);
        let is_there = |at: &Vec2| at.length() <= radius && self.is_surface(position, normal, frame.tangent * at.x + frame.bitangent * at.y, radius);
        let there = points.iter().filter(|at| is_there(at)).count() as f32;
        (region * there / rays as f32).max(LEAST_SHARE * disc)
    }

    /// Whether the surface that a place is on goes on beside it, in sight.
    fn is_surface(&self, position: Vec3, normal: Vec3, aside: Vec3, radius: f32) -> bool {
        surface_beside(self.scene, self.bvh, [position, normal], aside, radius).is_some_and(|(hit, at)| {
            let face = self.scene.triangles[hit.triangle as usize].face_normal();
            face.dot(normal).abs() >= LEAST_COSINE && self.sees([position, at], normal, radius)
        })
    }

    /// Whether nothing stands between two points of a surface, seen from a little above it, so that it may bend; true where nobody asks.
    fn sees(&self, points: [Vec3; 2], normal: Vec3, radius: f32) -> bool {
        let [from, to] = points.map(|point| point + normal * (ABOVE * radius).max(surface_offset(self.extent, point)));
        !self.sought.visible || !self.bvh.occluded(self.scene, from, to - from, 1.0)
    }

    /// Each photon adds to the square that it came from; what is there is as far away as the light came, in the harmonic mean.
    fn fill(&self, place: &Request, resolution: u32, tile: &mut [Vec4]) {
        let (position, normal) = (Vec3::from(place.position), Vec3::from(place.normal));
        let frame = Frame::new(normal).turned(place.turn);
        let (photons, area) = self.photons(position, normal);
        tile.fill(Vec4::ZERO);
        let mut counts = vec![0.0; tile.len()];
        for photon in &photons {
            let from = frame.to_local(unpacked_ways(photon.ways)[1]);
            let [column, row] = square(resolution, Vec2::new(from.x, from.y));
            let index = (row * resolution + column) as usize;
            tile[index] += Vec3::from(photon.flux).extend(1.0 / photon.leg.max(f32::MIN_POSITIVE));
            counts[index] += 1.0;
        }
        // Squares are as wide as each other, by the cosine.
        let per_square = tile.len() as f32 / (PI * area.max(f32::MIN_POSITIVE));
        let inverse: f32 = tile.iter().map(|sum| sum.w).sum();
        let usual = if inverse > 0.0 { photons.len() as f32 / inverse } else { FAR_AWAY };
        for (sum, count) in tile.iter_mut().zip(counts) {
            let distance = if count > 0.0 { count / sum.w } else { usual };
            *sum = (sum.truncate() * per_square).extend(distance);
        }
    }
}
