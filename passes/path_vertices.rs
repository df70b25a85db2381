//! Where light is looked for beyond what the camera sees: places for the records of a second cache.

use super::record::{hand_on, requests, texels};
use super::surroundings::Surroundings;
use crate::contract::{
    Bodies, Description, Encoder, Input, MOST_BYTES, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes,
    encoder::scene_constants, port,
};
use crate::host_struct;
use crate::math::frame::Frame;
use crate::math::lattice::pixel;
use crate::math::random::{combine, hash, unit};
use crate::math::thinning::{Vertex, thinned};
use crate::scene::{Scene, bvh::Bvh, surface::Ray, surface_offset};
use crate::schedule::*;
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::TAU;

pub struct PathVertices;

static DESCRIPTION: Description = Description {
    name: "PathVertices",
    about: "Places where paths from the camera meet surfaces, thinned to one for each group of neighbours: dense where much light is gathered from",
    source: "our own",
    parameters: &[
        Parameter {
            name: "paths",
            about: "paths, from pixels spread over the picture",
            unit: "paths",
            kind: ParameterKind::Integer { default: 32_768, min: 1, max: 1 << 22 },
        },
        Parameter {
            name: "legs",
            about: "most surfaces that a path meets behind the visible one",
            unit: "",
            kind: ParameterKind::Integer { default: 3, min: 1, max: 64 },
        },
        Parameter { name: "records", about: "most places", unit: "records", kind: ParameterKind::Integer { default: 8192, min: 1, max: 1 << 20 } },
        PLACE,
    ],
    inputs: &[Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, takes: Takes::One, changes: false }],
    outputs: &[Output { name: "requests", about: "places for records", kind: PortKind::Requests }],
};

impl Pass for PathVertices {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = e.g_buffer("gbuffer").copied() else { return Ok(()) };
        let [paths, legs, capacity] = ["paths", "legs", "records"].map(|name| e.arguments.integer(name) as u32);
        let requests = requests(e, capacity);
        let is_large = vertex_bytes([paths, legs]) > MOST_BYTES;
        match e.place(Bodies::BOTH.unless_on_device(is_large, "what so many paths meet does not fit into a buffer"))? {
            Place::Host => walk_on_host(e, &gbuffer, requests, [paths, legs]),
            Place::Device => walk_on_device(e, &gbuffer, requests, [paths, legs]),
        }
        e.report_variable("records_of_bounces", requests.made);
        e.output("requests", Port::Requests(requests));
        Ok(())
    }
}

fn walk_on_host(e: &mut Encoder<'_>, gbuffer: &port::GBuffer, requests: port::Requests, [paths, legs]: [u32; 2]) {
    let gbuffer = *gbuffer;
    e.host("walk", &[Read::whole(gbuffer.position), Read::whole(gbuffer.normal)], &[requests.places], move |host| {
        let (positions, normals) = (texels(host, gbuffer.position), texels(host, gbuffer.normal));
        let (scene, bvh, extent) = (host.scene(), host.bvh(), host.extent());
        let walk = |number: u32| {
            let [column, row] = pixel(number, gbuffer.size);
            let pixel = row as usize * gbuffer.size[0] as usize + column as usize;
            let [x, y, z, width] = positions[pixel];
            let start = Vertex { position: Vec3::new(x, y, z), normal: Vec3::from_slice(&normals[pixel]) };
            if width > 0.0 { walked(scene, bvh, extent, start, number, legs) } else { Vec::new() }
        };
        let vertices: Vec<Vertex> = (0..paths).into_par_iter().flat_map_iter(walk).collect();
        place(host, &requests, vertices);
        Ok(())
    });
}

host_struct! {
    /// A vertex as the device hands it on.
    pub struct WalkedVertex {
        position: [f32; 3],
        /// 1 for a vertex, 0 behind a path's end.
        is_there: f32,
        normal: [f32; 3],
        padding: f32,
    }
}

fn vertex_bytes([paths, legs]: [u32; 2]) -> u64 {
    size_of::<WalkedVertex>() as u64 * u64::from(paths) * u64::from(legs)
}

/// The host thins what the device finds: the latter would decide on each division after the one before.
fn walk_on_device(e: &mut Encoder<'_>, gbuffer: &port::GBuffer, requests: port::Requests, [paths, legs]: [u32; 2]) {
    let vertices = e.buffer("vertices", vertex_bytes([paths, legs]));
    let program = scene_constants(Program::new("path_vertices"), e.setting.needs)
        .constant("PATHS", paths)
        .constant("LEGS", legs)
        .bind("position", gbuffer.position)
        .bind("normal", gbuffer.normal)
        .bind("vertices", vertices);
    e.compute(program, "walk", Groups::linear(paths.div_ceil(64)));
    e.host("thin", &[Read::whole(vertices)], &[requests.places], move |host| {
        let walked: &[WalkedVertex] = bytemuck::cast_slice(host.read(vertices));
        let met = walked.par_iter().filter(|vertex| vertex.is_there > 0.0);
        let met = met.map(|vertex| Vertex { position: vertex.position.into(), normal: vertex.normal.into() }).collect();
        place(host, &requests, met);
        Ok(())
    });
}

/// Thins them, and hands on what is left.
fn place(host: &mut dyn HostContext, requests: &port::Requests, vertices: Vec<Vertex>) {
    let places = Surroundings::of(host).kept_apart(thinned(vertices, requests.capacity as usize));
    hand_on(host, requests, &places);
}

/// The surfaces that a path meets behind its first, each by a ray whose density is that of the light which arrives from there, as far as the cosine tells.
fn walked(scene: &Scene, bvh: &Bvh, extent: f32, start: Vertex, number: u32, legs: u32) -> Vec<Vertex> {
    let mut vertices = Vec::with_capacity(legs as usize);
    let mut at = start;
    for leg in 0..legs {
        let seed = combine(number, leg);
        let direction = cosine_direction(at.normal, [unit(hash(seed)), unit(hash(seed ^ 0x5bd1_e995))]);
        let origin = at.position + at.normal * surface_offset(extent, at.position);
        let Some(hit) = bvh.closest_hit(scene, origin, direction, f32::INFINITY) else { break };
        let surface = scene.diffuse_surface(hit.triangle, hit.barycentric, Ray::new(origin, direction));
        at = Vertex { position: surface.position, normal: surface.normal };
        vertices.push(at);
    }
    vertices
}

fn cosine_direction(normal: Vec3, [u, v]: [f32; 2]) -> Vec3 {
    let (radius, (sine, cosine)) = (u.sqrt(), (TAU * v).sin_cos());
    Frame::new(normal).to_world(Vec3::new(radius * cosine, radius * sine, (1.0 - u).sqrt()))
}
