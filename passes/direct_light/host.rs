//! Direct light by shadow rays, added up on the host: where the device is a driver on the same cores, each lane of it walks the hierarchy and looks emitters up
//! alone, while rays that share a point, 64 from a pixel to emitters or from a light to 64 pixels, can share most of both.

use super::sky::{Shown, Skies};
use crate::contract::{Encoder, port};
use crate::math::random::combine;
use crate::scene::{
    Light, Scene,
    bvh::Bvh,
    emitters::Emitters,
    packets::{RAYS, ShadowRays, ToDo},
    surface::Surface,
};
use crate::schedule::*;
use fearless_simd::{Level, dispatch};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// Edge of the squares of pixels that are lit together [pixels].
const EDGE: u32 = 8;

/// What the host lights surfaces by.
#[derive(Debug, Clone, Copy)]
pub(super) struct By {
    /// Whether punctual lights are among it.
    pub punctual: bool,
    /// Shadow rays a pixel to emissive surfaces and to the sky.
    pub samples: [u32; 2],
    /// Standard errors that what two pixels see of the broad sky may lie apart, and count together.
    pub tolerance: f32,
}

/// Of all pixels [bytes].
pub(super) fn bytes([width, height]: [u32; 2]) -> u64 {
    16 * u64::from(width) * u64::from(height)
}

/// A buffer of the light at each pixel.
pub(super) fn encode(e: &mut Encoder<'_>, gbuffer: &port::GBuffer, by: By) -> Resource {
    let light = e.buffer("light_by_rays", bytes(gbuffer.size));
    let (triangles, size, by_albedo) = (gbuffer.triangles, gbuffer.size, e.setting.needs.by_albedo);
    e.host("light", &[Read::whole(triangles)], &[light], move |host| {
        let seen: Vec<u32> = bytemuck::pod_collect_to_vec(host.read(triangles));
        let (camera, scene) = (host.camera().0, host.scene());
        let lights = if by.punctual { &scene.lights[..] } else { &[] };
        let emitters = Emitters::new(scene, host.bvh(), host.extent(), host.emission(), by.samples);
        let lighting = Lighting { scene, bvh: host.bvh(), extent: host.extent(), lights, emitters };
        let [width, height] = size;
        let surface = |[x, y]: [u32; 2]| {
            let triangle = seen[(y * width + x) as usize].checked_sub(1)?;
            Some(scene.seen(triangle, camera.ray(size, [x, y]), !by_albedo))
        };
        let mut sums = vec![Vec4::ZERO; seen.len()];
        let bands = sums.par_chunks_mut((EDGE * width) as usize).enumerate();
        bands.for_each_init(Room::default, |room, (band, sums)| {
            let top = band as u32 * EDGE;
            for left in (0..width).step_by(EDGE as usize) {
                let rows = top..(top + EDGE).min(height);
                let pixels = rows.flat_map(|y| (left..(left + EDGE).min(width)).map(move |x| [x, y]));
                room.seen.clear();
                room.seen.extend(pixels.filter_map(|pixel| Some(Seen { pixel, surface: surface(pixel)?, light: Vec3::ZERO })));
                lighting.light(&mut room.seen, &mut room.to_do);
                room.seen.iter().for_each(|seen| sums[((seen.pixel[1] - top) * width + seen.pixel[0]) as usize] = seen.light.extend(1.0));
            }
        });
        if lighting.emitters.see_sky() {
            let reflected = lighting.skies(size, &surface).reflected(by.tolerance);
            sums.par_iter_mut().zip(reflected).for_each(|(sum, sky)| *sum += sky.extend(0.0));
        }
        host.write(light, 0, bytemuck::cast_slice(&sums));
        Ok(())
    });
    light
}

/// What is seen at a pixel, and the light that it reflects.
struct Seen {
    pixel: [u32; 2],
    surface: Surface,
    light: Vec3,
}

/// Memory that is used again.
#[derive(Default)]
struct Room {
    seen: Vec<Seen>,
    to_do: ToDo,
}

struct Lighting<'a> {
    scene: &'a Scene,
    bvh: &'a Bvh,
    extent: f32,
    lights: &'a [Light],
    emitters: Emitters<'a>,
}

impl Lighting<'_> {
    /// What each pixel sees of the broad sky.
    fn skies(&self, size: [u32; 2], surface: &(impl Fn([u32; 2]) -> Option<Surface> + Sync)) -> Skies {
        let seen = |to_do: &mut ToDo, pixel: u32| {
            let at = [pixel % size[0], pixel / size[0]];
            let Some(surface) = surface(at) else { return (None, Vec4::ZERO) };
            let Surface { position, normal, reflectance: albedo, .. } = surface;
            let seen = dispatch!(Level::new(), _simd => self.emitters.broad_sky(&surface, combine(at[0], at[1]), to_do));
            (Some(Shown { position, normal, albedo }), seen)
        };
        let (shown, seen) = (0..size[0] * size[1]).into_par_iter().map_init(ToDo::default, seen).unzip();
        Skies { size, shown, seen }
    }

    /// Adds what reaches up to 64 surfaces, but for what they reflect diffusely of the broad sky.
    fn light(&self, seen: &mut [Seen], to_do: &mut ToDo) {
        for light in self.lights {
            self.add_light(light, seen, to_do);
        }
        if self.emitters.shine() {
            for Seen { pixel, surface, light } in seen {
                *light += dispatch!(Level::new(), simd => self.emitters.light_but_broad_sky(simd, surface, combine(pixel[0], pixel[1]), to_do));
            }
        }
    }

    fn add_light(&self, light: &Light, seen: &mut [Seen], to_do: &mut ToDo) {
        let mut reflected = [Vec3::ZERO; RAYS];
        let mut rays = ShadowRays { directions: [Vec3::ZERO; RAYS], all: 0 };
        for (ray, Seen { surface, .. }) in seen.iter().enumerate() {
            let Some((_, _, light)) = surface.reflected(&light.kind, surface.position) else { continue };
            reflected[ray] = light;
            rays.directions[ray] = surface.start(self.extent);
            rays.all |= 1 << ray;
        }
        let hidden = if light.shadows { self.bvh.hidden_from(self.scene, self.extent, &light.kind, &mut rays, to_do) } else { 0 };
        for (ray, seen) in seen.iter_mut().enumerate().filter(|(ray, _)| rays.all & !hidden & 1 << ray != 0) {
            seen.light += reflected[ray];
        }
    }
}
