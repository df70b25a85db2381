//! Light of the sky: of its broad part by rays that are spread as surfaces reflect, of its suns by rays to them.

use super::{Emitters, GOLDEN, LATTICE, fraction};
use crate::math::{colour::REC_709, frame::Frame, lobe::around};
use crate::scene::{
    packets::{RAYS, ShadowRays, ToDo, Until},
    surface::{Gloss, Surface},
};
use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::{FRAC_1_PI, TAU};
use std::ops::AddAssign;

// All that runs within `dispatch!` is inlined into it: what is not would not have its instructions.
impl Emitters<'_> {
    /// The mean radiance of the broad sky, by the cosine, in strata of the azimuth, and the standard error of its luminance as if rays were drawn by themselves.
    #[inline(always)]
    pub(super) fn of_sky(&self, surface: &Surface, shift: Vec2, to_do: &mut ToDo) -> Vec4 {
        let frame = Frame::new(surface.normal);
        let to_sky = |i: f32| {
            let [height, azimuth] = self.place(i, shift);
            Some((frame.to_world(around((1.0 - height).sqrt(), TAU * azimuth)), ()))
        };
        let seen = |(), direction: Vec3| {
            let broad = self.emission.suns.seen(&self.scene.environment, direction).broad;
            broad.extend(broad.dot(REC_709.as_vec3()).powi(2))
        };
        let mean = self.of_free(surface, self.sky, to_do, to_sky, seen) / self.sky as f32;
        let light = mean.truncate();
        let variance = (mean.w - light.dot(REC_709.as_vec3()).powi(2)).max(0.0) / self.sky as f32;
        light.extend(variance.sqrt())
    }

    /// What the lobe reflects, of suns by the share that [`Self::of_suns`] leaves to it.
    #[inline(always)]
    pub(super) fn of_sky_by_lobe(&self, surface: &Surface, shift: Vec2, to_do: &mut ToDo) -> Vec3 {
        let Some(Gloss { lobe, frame, outgoing }) = surface.glossy else { return Vec3::ZERO };
        let to_sky = |i: f32| {
            let incoming = lobe.sample(outgoing, self.place(i, shift));
            (incoming.z > 0.0).then(|| (frame.to_world(incoming), incoming))
        };
        let reflected = |incoming: Vec3, direction: Vec3| {
            let density = lobe.density(outgoing, incoming);
            if density <= 0.0 {
                return Vec3::ZERO;
            }
            let seen = self.emission.suns.seen(&self.scene.environment, direction);
            let share = self.sky as f32 * density / (self.sky as f32 * density + self.suns as f32 * seen.density);
            lobe.value(outgoing, incoming) * (incoming.z / density) * (seen.broad + seen.suns * share)
        };
        self.of_free(surface, self.sky, to_do, to_sky, reflected) / self.sky as f32
    }

    /// Of suns, what the diffuse part reflects, and of the lobe the share that is not left to its own rays: each by how densely it sends rays there (E. Veach and
    /// L. Guibas, Optimally combining sampling techniques for Monte Carlo rendering, 1995, the balance heuristic).
    #[inline(always)]
    pub(super) fn of_suns(&self, surface: &Surface, shift: Vec3, to_do: &mut ToDo) -> Vec3 {
        let to_sun = |i: f32| {
            let place = [fraction(LATTICE.x * i + shift.y), fraction(LATTICE.y * i + shift.z)];
            let direction = self.emission.suns.sample((i + shift.x) / self.suns as f32, place)?;
            (surface.normal.dot(direction) > 0.0).then_some((direction, ()))
        };
        let reflected = |(), direction: Vec3| {
            let seen = self.emission.suns.seen(&self.scene.environment, direction);
            let density = self.suns as f32 * seen.density;
            if density <= 0.0 {
                return Vec3::ZERO;
            }
            let arriving = seen.suns * surface.normal.dot(direction);
            let glossy = surface.glossy.map_or(Vec3::ZERO, |gloss| gloss.value(direction) / (density + self.sky as f32 * gloss.density(direction)));
            arriving * (surface.reflectance * FRAC_1_PI / density + glossy)
        };
        self.of_free(surface, self.suns, to_do, to_sun, reflected)
    }

    /// The `i`th place of the sky's samples in the unit square.
    #[inline(always)]
    fn place(&self, i: f32, shift: Vec2) -> [f32; 2] {
        [fraction(GOLDEN * i + shift.y), (i + shift.x) / self.sky as f32]
    }

    /// The sum over so many rays to the sky of what is `reflected` of those that nothing blocks, by what `way` says of them and their directions.
    #[inline(always)]
    fn of_free<T: Copy + Default, R: Default + AddAssign>(
        &self,
        surface: &Surface,
        count: u32,
        to_do: &mut ToDo,
        way: impl Fn(f32) -> Option<(Vec3, T)>,
        reflected: impl Fn(T, Vec3) -> R,
    ) -> R {
        let origin = surface.start(self.extent);
        let mut sum = R::default();
        for first in (0..count).step_by(RAYS) {
            let mut rays = ShadowRays { directions: [Vec3::ZERO; RAYS], all: 0 };
            let mut carried = [T::default(); RAYS];
            let count = (count - first).min(RAYS as u32) as usize;
            for (ray, carried) in carried[..count].iter_mut().enumerate() {
                let Some((direction, what)) = way((first as usize + ray) as f32) else { continue };
                (rays.directions[ray], *carried) = (direction, what);
                rays.all |= u64::from(direction.dot(surface.face) > 0.0) << ray;
            }
            let mut free = rays.all & !self.hidden(origin, &rays, Until::Forever, to_do);
            while free != 0 {
                let ray = free.trailing_zeros() as usize % RAYS;
                free &= free - 1;
                sum += reflected(carried[ray], rays.directions[ray]);
            }
        }
        sum
    }
}
