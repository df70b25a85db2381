//! An irradiance field, seen by the camera.

use super::irradiance_field::{self, Asked, Point};
use super::record::texels;
use crate::contract::{Description, Encoder, Input, Output, PLACE, Pass, Place, Port, PortKind, Refusal, Takes, port};
use crate::schedule::*;
use fearless_simd::{Level, dispatch};
use glam::{Vec3, Vec4};
use half::f16;
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

pub struct IndirectLight;

static DESCRIPTION: Description = Description {
    name: "IndirectLight",
    about: "Indirect light at the visible surfaces, from a field that is asked at each of them",
    source: "Jensen 1996, direct visualisation of a photon map",
    parameters: &[PLACE],
    inputs: &[
        Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, takes: Takes::One, changes: false },
        Input { name: "field", about: "what is asked", accepts: PortKind::IrradianceField, takes: Takes::One, changes: false },
    ],
    outputs: &[
        Output { name: "radiance", about: "indirect radiance toward the camera that the diffuse part reflects", kind: PortKind::Image },
        Output { name: "irradiance", about: "indirect irradiance [W/m²]", kind: PortKind::Image },
    ],
};

impl Pass for IndirectLight {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(gbuffer), Some(field)) = (e.g_buffer("gbuffer").copied(), e.irradiance_field("field").copied()) else { return Ok(()) };
        let images = ["radiance", "irradiance"].map(|name| e.image(name, gbuffer.size, Format::Rgba32Float));
        match e.place(e.over_pixels(gbuffer.size))? {
            Place::Host => encode_on_host(e, gbuffer, images),
            Place::Device => encode_on_device(e, gbuffer, &field, images),
        }
        let [radiance, irradiance] = images.map(|texture| Port::Image(port::Image { texture, channels: port::Channels::Colour }));
        e.output("radiance", radiance);
        e.output("irradiance", irradiance);
        Ok(())
    }
}

fn encode_on_device(e: &mut Encoder<'_>, gbuffer: port::GBuffer, field: &port::IrradianceField, [radiance, irradiance]: [Resource; 2]) {
    let program = irradiance_field::bind(Program::new("indirect_light"), field)
        .bind("position", gbuffer.position)
        .bind("normal", gbuffer.normal)
        .bind("reflectance", gbuffer.reflectance)
        .bind("triangles", gbuffer.triangles)
        .bind("irradiance", irradiance)
        .bind("radiance", radiance);
    e.compute_pixels(program, "ask", gbuffer.size);
}

fn encode_on_host(e: &mut Encoder<'_>, gbuffer: port::GBuffer, [radiance, irradiance]: [Resource; 2]) {
    let Some(field) = Asked::of(e, "field") else { return };
    let surfaces = [gbuffer.position, gbuffer.normal, gbuffer.reflectance, gbuffer.triangles].map(Read::whole);
    let reads: Vec<Read> = surfaces.into_iter().chain(field.reads()).collect();
    e.host("ask", &reads, &[radiance, irradiance], move |host| {
        let mut images = [radiance, irradiance].map(|image| host.take(image));
        let index = field.index(host);
        let light = field.on_host(host, index.as_deref()).ok_or("the field has no index")?;
        let (positions, normals) = (texels(host, gbuffer.position), texels(host, gbuffer.normal));
        let reflectances: &[[f16; 4]] = bytemuck::cast_slice(host.read(gbuffer.reflectance));
        let triangles: &[u32] = bytemuck::cast_slice(host.read(gbuffer.triangles));
        let [reflected, arriving] = &mut images;
        let level = Level::new();
        arriving.par_iter_mut().enumerate().for_each(|(at, out)| {
            let [x, y, z, width] = positions[at];
            let point = Point { position: Vec3::new(x, y, z), normal: Vec3::from_slice(&normals[at]), triangle: triangles[at] };
            let found = if width > 0.0 { dispatch!(level, simd => light.irradiance(simd, point)) } else { Vec3::ZERO };
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
