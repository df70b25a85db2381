//! Light of emissive surfaces and the sky, added up on the host: where the device is a driver on the same cores, each lane of it walks the hierarchy
//! and looks emitters up alone, while the shadow rays of a pixel, 64 from one point, can share most of both.

use crate::contract::{Encoder, port};
use crate::math::random::combine;
use crate::scene::{
    emitters::{AreaLight, Emitters},
    packets::ToDo,
    surface::Ray,
};
use crate::schedule::*;
use fearless_simd::{Level, dispatch};
use glam::Vec4;
use rayon::prelude::*;

/// Pixels that are computed as one.
const PIXELS: usize = 1024;

/// Of all pixels [bytes].
pub(super) fn bytes([width, height]: [u32; 2]) -> u64 {
    16 * u64::from(width) * u64::from(height)
}

/// A buffer of the light at each pixel, by so many shadow rays to emissive surfaces and to the sky.
pub(super) fn encode(e: &mut Encoder<'_>, gbuffer: &port::GBuffer, [area, sky]: [u32; 2]) -> Resource {
    let light = e.buffer("light_of_emitters", bytes(gbuffer.size));
    let (triangles, size, by_albedo) = (gbuffer.triangles, gbuffer.size, e.setting.needs.by_albedo);
    e.host("light", &[Read::whole(triangles)], &[light], move |host| {
        let seen: Vec<u32> = bytemuck::pod_collect_to_vec(host.read(triangles));
        let (camera, scene) = (host.camera().0, host.scene());
        let area_lights = AreaLight::all(scene);
        let emitters = Emitters::new(scene, host.bvh(), host.extent(), &area_lights, [area, sky]);
        let mut lights = vec![Vec4::ZERO; seen.len()];
        lights.par_chunks_mut(PIXELS).enumerate().for_each_init(ToDo::default, |to_do, (chunk, lights)| {
            for (at, out) in (chunk * PIXELS..).zip(lights) {
                let Some(triangle) = seen[at].checked_sub(1) else { continue };
                let pixel = [at as u32 % size[0], at as u32 / size[0]];
                let ray = Ray { origin: camera.eye, direction: camera.pixel_ray(size, pixel) };
                let barycentric = scene.triangles[triangle as usize].barycentric(ray);
                let surface = if by_albedo { scene.diffuse_surface(triangle, barycentric, ray) } else { scene.surface(triangle, barycentric, ray) };
                let seed = combine(pixel[0], pixel[1]);
                *out = dispatch!(Level::new(), simd => emitters.light(simd, &surface, seed, to_do)).extend(1.0);
            }
        });
        host.write(light, 0, bytemuck::cast_slice(&lights));
        Ok(())
    });
    light
}
