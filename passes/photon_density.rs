//! The photon map itself, seen by the camera.

use super::photons::{DIRECT, PHOTON_BYTES, REACH, expect_direct_light, lookup::Lookup};
use super::record::texels;
use crate::contract::{Description, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Recorder, Refusal, port};
use crate::math::{frame::Frame, outline::Outline};
use crate::recording::*;
use glam::{Vec2, Vec3, Vec4};
use half::f16;
use rayon::prelude::*;
use std::f32::consts::{FRAC_1_PI, PI};

pub struct PhotonDensity;

static DESCRIPTION: Description = Description {
    name: "PhotonDensity",
    about: "Indirect light at the visible surfaces, from the photons that arrive near them: their flux over the area that they stand for",
    source: "Jensen 1996; the area: THESIS 6.3",
    parameters: &[
        Parameter {
            name: "photons",
            about: "photons of a pixel, where there are so many near",
            unit: "photons",
            kind: ParameterKind::Integer { default: 64, min: 1, max: 4096 },
        },
        REACH,
        Parameter {
            name: "edges",
            about: "find the area that photons stand for by their outline, where an edge cuts their disc; otherwise it is all of the disc",
            unit: "",
            kind: ParameterKind::Bool { default: true },
        },
        PLACE,
    ],
    inputs: &[
        Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, required: true, changes: false },
        Input { name: "map", about: "the photons", accepts: PortKind::PhotonMap, required: true, changes: false },
        DIRECT,
    ],
    outputs: &[
        Output { name: "radiance", about: "indirect radiance toward the camera that the diffuse part reflects", kind: PortKind::Image },
        Output { name: "irradiance", about: "indirect irradiance [W/m²]", kind: PortKind::Image },
    ],
};

impl Pass for PhotonDensity {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let (Some(gbuffer), Some(map)) = (r.g_buffer("gbuffer").copied(), r.photon_map("map").copied()) else { return Ok(()) };
        expect_direct_light(r)?;
        let [radiance, irradiance] = ["radiance", "irradiance"].map(|name| r.image(name, Format::Rgba32Float));
        let sought = Sought {
            wanted: r.arguments.integer("photons") as u32,
            reach: r.arguments.float("reach") as f32 * r.setting.needs.extent,
            edges: r.arguments.bool("edges"),
        };
        match r.place(r.over_pixels())? {
            Place::Host => record_on_host(r, gbuffer, map, [radiance, irradiance], sought),
            Place::Device => record_on_device(r, gbuffer, map, [radiance, irradiance], sought),
        }
        let image = |texture| Port::Image(port::Image { texture, channels: port::Channels::Colour });
        r.output("radiance", image(radiance));
        r.output("irradiance", image(irradiance));
        Ok(())
    }
}

/// Which photons count at a pixel.
#[derive(Clone, Copy)]
struct Sought {
    wanted: u32,
    /// [scene units]
    reach: f32,
    edges: bool,
}

fn record_on_device(r: &mut Recorder<'_>, gbuffer: port::GBuffer, map: port::PhotonMap, [radiance, irradiance]: [Resource; 2], sought: Sought) {
    let program = Program::new("photon_density")
        .constant("WANTED", sought.wanted)
        .constant("REACH", sought.reach)
        .constant("EDGES", sought.edges as u8)
        .bind("position", gbuffer.position)
        .bind("normal", gbuffer.normal)
        .bind("reflectance", gbuffer.reflectance)
        .bind("photon_codes", map.codes)
        .bind("photons", map.photons)
        .bind("irradiance", irradiance)
        .bind("radiance", radiance);
    r.compute_pixels(program, "estimate");
}

fn record_on_host(r: &mut Recorder<'_>, gbuffer: port::GBuffer, map: port::PhotonMap, [radiance, irradiance]: [Resource; 2], sought: Sought) {
    let surfaces = [gbuffer.position, gbuffer.normal, gbuffer.reflectance].map(Read::whole);
    let reads: Vec<Read> = surfaces.into_iter().chain([Read::whole(map.codes), Read::counted(map.photons, PHOTON_BYTES, map.count)]).collect();
    r.host("estimate", &reads, &[radiance, irradiance], move |host| {
        let mut images = [radiance, irradiance].map(|image| host.take(image));
        let lookup = Lookup::of(&map, host);
        let (positions, normals) = (texels(host, gbuffer.position), texels(host, gbuffer.normal));
        let reflectances: &[[f16; 4]] = bytemuck::cast_slice(host.read(gbuffer.reflectance));
        let [reflected, arriving] = &mut images;
        arriving.par_iter_mut().enumerate().for_each(|(at, out)| {
            let [x, y, z, width] = positions[at];
            let normal = Vec3::from_slice(&normals[at]);
            let found = if width > 0.0 { estimate(&lookup, Vec3::new(x, y, z), normal, sought) } else { Vec3::ZERO };
            *out = found.extend(1.0);
        });
        reflected.par_iter_mut().zip(&*arriving).zip(reflectances).for_each(|((out, arriving), reflectance)| {
            *out = (arriving.truncate() * Vec4::from(reflectance.map(f16::to_f32)).truncate() * FRAC_1_PI).extend(1.0);
        });
        for (image, contents) in [radiance, irradiance].into_iter().zip(images) {
            host.put(image, contents, u64::MAX);
        }
        Ok(())
    });
}

/// Irradiance at a point [W/m²].
fn estimate(lookup: &Lookup<'_>, position: Vec3, normal: Vec3, sought: Sought) -> Vec3 {
    let zone = lookup.zone(position, normal, sought.wanted, sought.reach);
    let frame = Frame::new(normal);
    let (mut flux, mut count, mut outline) = (Vec3::ZERO, 0, Outline::new());
    lookup.for_each(position, normal, zone, |photon, _| {
        flux += Vec3::from(photon.flux);
        count += 1;
        if sought.edges {
            let way = Vec3::from(photon.position) - position;
            outline.add(Vec2::new(way.dot(frame.tangent), way.dot(frame.bitangent)));
        }
    });
    let area = if sought.edges { outline.stands_for(zone.radius) } else { PI * zone.radius * zone.radius };
    flux * (zone.fair_share(count) / area.max(f32::MIN_POSITIVE))
}
