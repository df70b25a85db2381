//! Where light is looked for beyond what the camera sees: places for the records of a second cache.

use super::record::{hand_on, requests, texels};
use crate::contract::{Description, Encoder, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Refusal, Takes};
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
    about: "Places where paths from the camera meet surfaces, thinned to one for each group of neighbours: dense where much light is gathered from; by the host",
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
        let size = gbuffer.size;
        e.host("walk", &[Read::whole(gbuffer.position), Read::whole(gbuffer.normal)], &[requests.places], move |host| {
            let (positions, normals) = (texels(host, gbuffer.position), texels(host, gbuffer.normal));
            let (scene, bvh, extent) = (host.scene(), host.bvh(), host.extent());
            let walk = |number: u32| {
                let [column, row] = pixel(number, size);
                let pixel = row as usize * size[0] as usize + column as usize;
                let [x, y, z, width] = positions[pixel];
                let start = Vertex { position: Vec3::new(x, y, z), normal: Vec3::from_slice(&normals[pixel]) };
                if width > 0.0 { walked(scene, bvh, extent, start, number, legs) } else { Vec::new() }
            };
            let vertices: Vec<Vertex> = (0..paths).into_par_iter().flat_map_iter(walk).collect();
            hand_on(host, &requests, thinned(vertices, capacity as usize));
            Ok(())
        });
        e.report_variable("records_of_bounces", requests.made);
        e.output("requests", Port::Requests(requests));
        Ok(())
    }
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
        let surface = scene.diffuse_surface(hit.triangle, hit.barycentric, Ray { origin, direction });
        at = Vertex { position: surface.position, normal: surface.normal };
        vertices.push(at);
    }
    vertices
}

fn cosine_direction(normal: Vec3, [u, v]: [f32; 2]) -> Vec3 {
    let (radius, (sine, cosine)) = (u.sqrt(), (TAU * v).sin_cos());
    Frame::new(normal).to_world(Vec3::new(radius * cosine, radius * sine, (1.0 - u).sqrt()))
}
