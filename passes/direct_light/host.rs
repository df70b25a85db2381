//! Shadow rays to emitters and the sky, cast on the host: where the device is a driver on the same cores, each lane of it walks the hierarchy
//! alone, while the rays of a pixel, 64 from one point, can share most of the way.

use crate::contract::Recorder;
use crate::contract::port;
use crate::math::{
    frame::Frame,
    lobe::{Lobe, around},
    random::{combine, hash, unit},
};
use crate::passes::record::texels;
use crate::recording::*;
use crate::scene::{
    Emitter, Scene, Triangle,
    bvh::Bvh,
    packets::{RAYS, ShadowRays, ToDo, Until},
    surface_offset,
};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Pixels that are computed as one.
const PIXELS: usize = 1024;

/// Bits of a word.
const WORD: usize = 32;

/// Shadow rays of a pixel, in the order of their bits: those of each kind begin a word.
#[derive(Debug, Clone, Copy)]
pub(super) struct Counts {
    pub area: u32,
    /// To the sky, as the diffuse part reflects it.
    pub sky: u32,
    /// To the sky, as the lobe does.
    pub lobe: u32,
}

impl Counts {
    fn words(self) -> [usize; 3] {
        [self.area, self.sky, self.lobe].map(|rays| (rays as usize).div_ceil(WORD))
    }

    /// Of all pixels [bytes].
    pub fn bytes(self, [width, height]: [u32; 2]) -> u64 {
        self.words().iter().sum::<usize>() as u64 * 4 * u64::from(width) * u64::from(height)
    }
}

/// A bit for each shadow ray of each pixel: whether it is blocked. The first words of all pixels, then the second.
pub(super) fn record(r: &mut Recorder<'_>, gbuffer: &port::GBuffer, counts: Counts) -> Resource {
    let blocked = r.buffer("blocked", counts.bytes(r.setting.size).max(4));
    let gbuffer = *gbuffer;
    let is_anisotropic = r.setting.needs.anisotropic;
    let reads = [gbuffer.triangles, gbuffer.position, gbuffer.normal].map(Read::whole);
    r.host("cast", &reads, &[blocked], move |host| {
        let triangles: Vec<u32> = bytemuck::pod_collect_to_vec(host.read(gbuffer.triangles));
        let (positions, normals) = (texels(host, gbuffer.position), texels(host, gbuffer.normal));
        let (camera, size) = host.camera();
        let caster = Caster {
            scene: host.scene(),
            bvh: host.bvh(),
            emitters: host.scene().emitters(),
            extent: host.scene().extent(),
            eye: camera.eye,
            is_anisotropic,
            counts,
        };
        let words = counts.words().iter().sum::<usize>();
        let mut bits = vec![0u32; triangles.len() * words];
        bits.par_chunks_mut(PIXELS * words.max(1)).enumerate().for_each_init(ToDo::default, |to_do, (chunk, bits)| {
            for (at, bits) in (chunk * PIXELS..).zip(bits.chunks_exact_mut(words)) {
                let Some(triangle) = triangles[at].checked_sub(1) else { continue };
                let xyz = |texel: [f32; 4]| Vec3::new(texel[0], texel[1], texel[2]);
                let seed = combine(at as u32 % size[0], at as u32 / size[0]);
                let place = caster.place(triangle, xyz(positions[at]), xyz(normals[at]), seed);
                caster.cast(&place, to_do, bits);
            }
        });
        let planes = (0..words).flat_map(|word| bits[word..].iter().step_by(words).copied());
        host.write(blocked, 0, bytemuck::cast_slice(&planes.collect::<Vec<u32>>()));
        Ok(())
    });
    blocked
}

struct Caster<'a> {
    scene: &'a Scene,
    bvh: &'a Bvh,
    emitters: Vec<Emitter>,
    extent: f32,
    eye: Vec3,
    is_anisotropic: bool,
    counts: Counts,
}

/// What a pixel sees.
struct Place {
    origin: Vec3,
    /// On the side seen, of the plane and of the shading.
    face: Vec3,
    normal: Vec3,
    /// With the frame that it is in, and the unit direction to the eye in that.
    lobe: Option<(Lobe, Frame, Vec3)>,
    seed: u32,
}

impl Caster<'_> {
    fn place(&self, triangle: u32, position: Vec3, normal: Vec3, seed: u32) -> Place {
        let triangle = &self.scene.triangles[triangle as usize];
        let toward = self.eye - position;
        let face = triangle.face_normal();
        let face = if face.dot(toward) < 0.0 { -face } else { face };
        let origin = position + face * surface_offset(self.extent, position);
        let lobe = (self.counts.lobe > 0).then(|| self.lobe(triangle, normal, toward.normalize_or(normal))).flatten();
        Place { origin, face, normal, lobe, seed }
    }

    fn lobe(&self, triangle: &Triangle, normal: Vec3, toward: Vec3) -> Option<(Lobe, Frame, Vec3)> {
        let material = &self.scene.materials[triangle.material as usize];
        let lobe = material.reflection(material.reflectance).lobe?;
        let frame = if self.is_anisotropic { triangle.tangent_frame(normal) } else { Frame::new(normal) };
        Some((lobe, frame, frame.to_local(toward)))
    }

    /// The directions are those of shaders/lib/light.wgsl.
    fn cast(&self, place: &Place, to_do: &mut ToDo, bits: &mut [u32]) {
        let [area, sky, _] = self.counts.words();
        let random = |key: u32| unit(hash(place.seed.wrapping_add(key)));
        let shift = Vec3::new(random(0), random(1), random(2));
        self.cast_some(place, self.counts.area, Until::TheirEnd, to_do, &mut bits[..area], |i| self.point_of_emitter(i, shift) - place.origin);
        if self.counts.sky > 0 {
            let (shift, frame) = (Vec2::new(random(3), random(4)), Frame::new(place.normal));
            self.cast_some(place, self.counts.sky, Until::Forever, to_do, &mut bits[area..area + sky], |i| {
                let [height, azimuth] = [(GOLDEN * i + shift.y).fract(), (i + shift.x) / self.counts.sky as f32];
                frame.to_world(around((1.0 - height).sqrt(), TAU * azimuth))
            });
        }
        if let Some((lobe, frame, outgoing)) = &place.lobe {
            let shift = Vec2::new(random(13), random(14));
            self.cast_some(place, self.counts.lobe, Until::Forever, to_do, &mut bits[area + sky..], |i| {
                frame.to_world(lobe.sample(*outgoing, [(GOLDEN * i + shift.y).fract(), (i + shift.x) / self.counts.lobe as f32]))
            });
        }
    }

    /// Rays that leave below the surface bring nothing, so they are not cast.
    fn cast_some(&self, place: &Place, count: u32, until: Until, to_do: &mut ToDo, bits: &mut [u32], direction: impl Fn(f32) -> Vec3) {
        for (first, bits) in (0..count).step_by(RAYS).zip(bits.chunks_mut(RAYS / WORD)) {
            let mut rays = ShadowRays { directions: [Vec3::ZERO; RAYS], all: 0 };
            for ray in 0..(count - first).min(RAYS as u32) {
                let direction = direction((first + ray) as f32);
                rays.directions[ray as usize] = direction;
                rays.all |= u64::from(direction.dot(place.face) > 0.0 && direction.dot(place.normal) > 0.0) << ray;
            }
            let hidden = self.bvh.packets(self.scene).hidden(self.scene, place.origin, &rays, until, to_do);
            bits.iter_mut().zip([hidden as u32, (hidden >> WORD) as u32]).for_each(|(word, hidden)| *word = hidden);
        }
    }

    fn point_of_emitter(&self, i: f32, shift: Vec3) -> Vec3 {
        let weight = self.emitters.last().map_or(0.0, |last| last.cumulative);
        let at = (i + shift.x) / self.counts.area as f32 * weight;
        let chosen = self.emitters.partition_point(|emitter| emitter.cumulative <= at).min(self.emitters.len() - 1);
        let (u, v) = ((LATTICE.x * i + shift.y).fract(), (LATTICE.y * i + shift.z).fract());
        let root = u.sqrt();
        self.scene.triangles[self.emitters[chosen].triangle as usize].position(Vec2::new(root * (1.0 - v), root * v))
    }
}

const GOLDEN: f32 = 0.618_034;
const LATTICE: Vec2 = Vec2::new(0.754_877_7, 0.569_840_3);
