//! What senders bring to texels that are near each other, eight at a time.

use super::{
    Sender,
    views::{Between, Views},
};
use crate::math::{
    random::{combine, unit},
    vectors::{LANES, Vectors},
};
use crate::passes::texels::{NEAREST, TexelSurface};
use crate::scene::{
    LightKind, Scene,
    bvh::Bvh,
    packets::{RAYS, ShadowRays, ToDo},
    surface_offset,
};
use fearless_simd::{Level, Select, Simd, dispatch, f32x8, mask32x8, prelude::*};
use glam::{Vec3, Vec4};

/// Texels that are shot at together: rays to them are cast side by side.
pub const TOGETHER: usize = 4096;

/// What sends light where.
pub struct Range<'a> {
    pub scene: &'a Scene,
    pub bvh: &'a Bvh,
    pub extent: f32,
    pub sides: usize,
    pub senders: &'a [Sender],
    pub views: Option<Views<'a>>,
    /// Of a texel in the mean, where not all are asked.
    pub rays: Option<f32>,
    /// Of the choices of the iteration.
    pub seed: u32,
}

/// Eight texels, lane by lane, and which of the shots at each of their sides are asked: those that bring more than a ray stands for, and of the others those at which the sum of
/// their parts goes beyond a whole number, from a start by chance.
struct Eight {
    position: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    /// 1 over the square of the distance within which they take no more [1/scene units²].
    nearest: [f32; LANES],
    sides: [Side; 2],
}

/// Of eight texels.
#[derive(Clone, Copy)]
struct Side {
    /// Rays a luminance of irradiance.
    parts: [f32; LANES],
    /// How far it is to the next ray, in rays.
    next: [f32; LANES],
    /// How many rays are to be asked in the mean.
    count: [f32; LANES],
}

impl Side {
    /// None is asked.
    const NONE: Self = Self { parts: [0.0; LANES], next: [0.0; LANES], count: [0.0; LANES] };
    /// All are asked that bring anything.
    const ALL: Self = Self { parts: [MOST_PARTS; LANES], ..Self::NONE };
}

/// What a shot would bring eight texels, each at the side that faces it.
struct Lit<S: Simd> {
    luminance: f32x8<S>,
    is_front: mask32x8<S>,
}

/// Rays a luminance where any light at all is asked for.
const MOST_PARTS: f32 = 1e38;

/// A square of a distance that is no more than 0, so that a texel brings itself nothing [scene units²].
const LEAST: f32 = 1e-28;

impl Eight {
    fn of(texels: &[TexelSurface], sides: [Side; 2]) -> Self {
        let lanes = |value: &dyn Fn(&TexelSurface) -> f32| std::array::from_fn(|lane| texels.get(lane).map_or(0.0, value));
        Self {
            position: std::array::from_fn(|axis| lanes(&|texel| texel.position[axis])),
            // Lanes without a texel face nothing.
            normal: std::array::from_fn(|axis| lanes(&|texel| texel.normal[axis])),
            nearest: lanes(&|texel| 1.0 / (texel.area * NEAREST)),
            sides,
        }
    }

    /// What a sender brings if nothing is between; none where it faces away from all.
    #[inline(always)]
    fn lit<S: Simd>(&self, simd: S, sender: &Sender) -> Option<Lit<S>> {
        let zero = f32x8::splat(simd, 0.0);
        let (position, normal) = (Vectors::load(simd, &self.position), Vectors::load(simd, &self.normal));
        let way = Vectors { x: position.x - sender.position.x, y: position.y - sender.position.y, z: position.z - sender.position.z };
        let leaving = way.product(sender.frame.normal);
        if leaving.simd_gt(zero).to_bitmask() == 0 {
            return None;
        }
        let inverse = 1.0 / way.dot(way).max(LEAST);
        let bounded = inverse * inverse.min(f32x8::load_array_ref(simd, &self.nearest).min(1.0 / sender.nearest));
        let along = way.dot(normal);
        let is_front = along.simd_lt(zero);
        Some(Lit { luminance: leaving.max(zero) * bounded * sender.luminance * is_front.select(zero - along, along), is_front })
    }

    /// The lanes that are to be asked, and those of them at their fronts.
    #[inline(always)]
    fn ask<S: Simd>(&mut self, simd: S, sender: &Sender) -> [u32; 2] {
        let Some(Lit { luminance, is_front }) = self.lit(simd, sender) else { return [0; 2] };
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let of = |values: fn(&Side) -> &[f32; LANES]| self.sides.each_ref().map(|side| f32x8::load_array_ref(simd, values(side)));
        let [parts, next, count] = [of(|side| &side.parts), of(|side| &side.next), of(|side| &side.count)];
        let rays = luminance * is_front.select(parts[0], parts[1]);
        let is_much = rays.simd_ge(one);
        let left = is_front.select(next[0], next[1]) - is_much.select(zero, rays);
        let is_next = left.simd_lt(zero);
        let left = is_next.select(left + 1.0, left);
        let counted = rays.min(one);
        let [front, back] = &mut self.sides;
        is_front.select(left, next[0]).store_array(&mut front.next);
        is_front.select(next[1], left).store_array(&mut back.next);
        (count[0] + is_front.select(counted, zero)).store_array(&mut front.count);
        (count[1] + is_front.select(zero, counted)).store_array(&mut back.count);
        let asked = (is_much.to_bitmask() | is_next.to_bitmask()) as u32;
        [asked, asked & is_front.to_bitmask() as u32]
    }

    /// Adds what all would bring each side.
    #[inline(always)]
    fn sums<S: Simd>(&self, simd: S, senders: &[Sender]) -> [[f32; LANES]; 2] {
        let zero = f32x8::splat(simd, 0.0);
        let mut sums = [zero; 2];
        for Lit { luminance, is_front } in senders.iter().filter_map(|sender| self.lit(simd, sender)) {
            sums = [sums[0] + is_front.select(luminance, zero), sums[1] + is_front.select(zero, luminance)];
        }
        sums.map(|sums| sums.to_array())
    }
}

/// Rays a luminance for the next iteration, so that they become as many as they should; 0 where light has changed too much to tell.
fn parts_next(parts: f32, count: f32, rays: f32) -> f32 {
    if count > MOST_ASKED * rays {
        0.0
    } else if count > 0.0 {
        (parts * (rays / count)).min(MOST_PARTS)
    } else {
        parts
    }
}

/// How many times as many rays as there should be tell that light has changed.
const MOST_ASKED: f32 = 4.0;

impl Range<'_> {
    /// Adds the light of all senders to that of neighbours, from the `first` texel on, where the rays a luminance of each side are known or 0.
    pub fn light(&self, (first, texels): (usize, &[TexelSurface]), parts: &mut [f32], light: &mut [Vec4], to_do: &mut ToDo) {
        let of_eight = LANES * self.sides;
        let mut eights: Vec<Eight> = match self.rays {
            None => texels.chunks(LANES).map(|texels| Eight::of(texels, [Side::ALL, if self.sides == 2 { Side::ALL } else { Side::NONE }])).collect(),
            Some(rays) => {
                let known = texels.chunks(LANES).zip(parts.chunks(of_eight)).enumerate();
                known.map(|(number, (texels, parts))| self.eight((first + number * LANES, texels), parts, rays)).collect()
            }
        };
        for sender in self.senders {
            self.add(sender, (texels, &mut eights), light, to_do);
        }
        let Some(rays) = self.rays else { return };
        for (eight, parts) in eights.iter().zip(parts.chunks_mut(of_eight)) {
            for (at, parts) in parts.iter_mut().enumerate() {
                let (side, lane) = (&eight.sides[at % self.sides], at / self.sides);
                *parts = parts_next(side.parts[lane], side.count[lane], rays);
            }
        }
    }

    fn eight(&self, (first, texels): (usize, &[TexelSurface]), parts: &[f32], rays: f32) -> Eight {
        let mut eight = Eight::of(texels, [Side::NONE; 2]);
        let is_new = parts.contains(&0.0);
        let sums = if is_new { dispatch!(Level::new(), simd => eight.sums(simd, self.senders)) } else { [[0.0; LANES]; 2] };
        for (at, parts) in parts.iter().enumerate() {
            let (side, lane) = (at % self.sides, at / self.sides);
            eight.sides[side].parts[lane] = if *parts > 0.0 { *parts } else { (rays / sums[side][lane]).min(MOST_PARTS) };
            eight.sides[side].next[lane] = unit(combine(self.seed, (first * self.sides + at) as u32));
        }
        eight
    }

    fn add(&self, sender: &Sender, (texels, eights): (&[TexelSurface], &mut [Eight]), light: &mut [Vec4], to_do: &mut ToDo) {
        let mut asked = Asked::NONE;
        dispatch!(Level::new(), simd => self.ask(simd, sender, eights, |number, side, parts| {
            self.add_shot(sender, (number, &texels[number], side, parts), &mut asked, light, to_do);
        }));
        self.settle(sender, &mut asked, light, to_do);
    }

    /// Tells of each shot that is to be asked the texel, the side, and the rays a luminance.
    #[inline(always)]
    fn ask<S: Simd>(&self, simd: S, sender: &Sender, eights: &mut [Eight], mut told: impl FnMut(usize, usize, f32)) {
        for (number, eight) in eights.iter_mut().enumerate() {
            let [mut lanes, fronts] = eight.ask(simd, sender);
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize % LANES;
                lanes &= lanes - 1;
                let side = usize::from(fronts & 1 << lane == 0);
                told(number * LANES + lane, side, eight.sides[side].parts[lane]);
            }
        }
    }

    fn add_shot(
        &self,
        sender: &Sender,
        (number, texel, side, parts): (usize, &TexelSurface, usize, f32),
        asked: &mut Asked,
        light: &mut [Vec4],
        to_do: &mut ToDo,
    ) {
        let share = sender.share(texel);
        let lit = sender.luminance * share.bounded;
        // What eight lanes find by rounding alone.
        if lit <= 0.0 {
            return;
        }
        let (place, brought) = (number * self.sides + side, sender.brings(share) * (1.0 / (lit * parts)).max(1.0));
        match self.views.as_ref().map_or(Between::Unknown, |views| views.between(sender, texel)) {
            Between::Nothing => light[place] += brought,
            Between::Something => {}
            Between::Unknown => {
                let [position, normal] = texel.place(side);
                asked.push((place, brought), position + normal * surface_offset(self.extent, position));
                if asked.count == RAYS {
                    self.settle(sender, asked, light, to_do);
                }
            }
        }
    }

    /// Adds what rays tell that nothing is before.
    fn settle(&self, sender: &Sender, asked: &mut Asked, light: &mut [Vec4], to_do: &mut ToDo) {
        if asked.count == 0 {
            return;
        }
        asked.rays.all = u64::MAX >> (RAYS - asked.count);
        let from = LightKind::Point { position: sender.position, intensity: Vec3::ONE };
        let hidden = self.bvh.hidden_from(self.scene, self.extent, &from, &mut asked.rays, to_do);
        let free = (0..asked.count).filter(|ray| hidden & 1 << ray == 0);
        free.for_each(|ray| light[asked.places[ray]] += asked.brought[ray]);
        asked.count = 0;
    }
}

/// Texels that rays have to tell of.
struct Asked {
    count: usize,
    rays: ShadowRays,
    places: [usize; RAYS],
    brought: [Vec4; RAYS],
}

impl Asked {
    const NONE: Self = Self { count: 0, rays: ShadowRays { directions: [Vec3::ZERO; RAYS], all: 0 }, places: [0; RAYS], brought: [Vec4::ZERO; RAYS] };

    fn push(&mut self, (place, brought): (usize, Vec4), start: Vec3) {
        self.rays.directions[self.count] = start;
        self.places[self.count] = place;
        self.brought[self.count] = brought;
        self.count += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_become_as_many_as_they_should_be() {
        let lights: Vec<f32> = (1..1000).map(|number| 1.0 / number as f32).collect();
        let count = |parts: f32| lights.iter().map(|light| (light * parts).min(1.0)).sum::<f32>();
        let settled = (0..8).fold(1.0, |parts, _| parts_next(parts, count(parts), 16.0));
        assert!((count(settled) - 16.0).abs() < 0.1, "{}", count(settled));
        // Where nothing comes, and where too much does.
        assert_eq!([parts_next(3.0, 0.0, 16.0), parts_next(3.0, 100.0, 16.0)], [3.0, 0.0]);
    }
}
