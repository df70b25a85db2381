//! Direct light by shadow rays, added up on the host.

use super::sky::{Shown, Skies};
use crate::contract::{Encoder, port};
use crate::math::random::combine;
use crate::passes::lit_surfaces::{Lighting, Lit};
use crate::scene::{emitters::Emitters, packets::ToDo, surface::Surface};
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
                let lit = |[x, y]: [u32; 2]| {
                    let (place, seed) = ((y - top) * width + x, combine(x, y));
                    Some(Lit { place, surface: surface([x, y])?, seed, light: Vec3::ZERO })
                };
                room.seen.extend(pixels.filter_map(lit));
                lighting.light(&mut room.seen, &mut room.to_do);
                room.seen.iter().for_each(|seen| sums[seen.place as usize] = seen.light.extend(1.0));
            }
        });
        if lighting.emitters.see_sky() {
            let reflected = skies(&lighting.emitters, size, &surface).reflected(by.tolerance);
            sums.par_iter_mut().zip(reflected).for_each(|(sum, sky)| *sum += sky.extend(0.0));
        }
        host.write(light, 0, bytemuck::cast_slice(&sums));
        Ok(())
    });
    light
}

/// Memory that is used again.
#[derive(Default)]
struct Room {
    seen: Vec<Lit>,
    to_do: ToDo,
}

/// What each pixel sees of the broad sky.
fn skies(emitters: &Emitters<'_>, size: [u32; 2], surface: &(impl Fn([u32; 2]) -> Option<Surface> + Sync)) -> Skies {
    let seen = |to_do: &mut ToDo, pixel: u32| {
        let at = [pixel % size[0], pixel / size[0]];
        let Some(surface) = surface(at) else { return (None, Vec4::ZERO) };
        let Surface { position, normal, reflectance: albedo, .. } = surface;
        let seen = dispatch!(Level::new(), _simd => emitters.broad_sky(&surface, combine(at[0], at[1]), to_do));
        (Some(Shown { position, normal, albedo }), seen)
    };
    let (shown, seen) = (0..size[0] * size[1]).into_par_iter().map_init(ToDo::default, seen).unzip();
    Skies { size, shown, seen }
}
