//! What senders bring to texels that are near each other.

use super::{
    Sender,
    eight::{Eight, MOST_PARTS, Side, parts_next},
    views::{Between, Views},
};
use crate::math::{
    random::{combine, unit},
    vectors::LANES,
};
use crate::passes::texels::TexelSurface;
use crate::scene::{
    LightKind, Scene,
    bvh::Bvh,
    packets::{RAYS, ShadowRays, ToDo},
    surface_offset,
};
use fearless_simd::{Level, Simd, dispatch, f32x8, prelude::*};
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

/// Eight texels, and who of them is asked.
struct Asking<S: Simd> {
    eight: Eight<S>,
    sides: [Side<S>; 2],
}

impl Range<'_> {
    /// Adds the light of all senders to that of neighbours, from the `first` texel on, where the rays a luminance of each side are known or 0.
    pub fn light(&self, (first, texels): (usize, &[TexelSurface]), parts: &mut [f32], light: &mut [Vec4], to_do: &mut ToDo) {
        dispatch!(Level::new(), simd => self.light_by(simd, (first, texels), parts, light, to_do));
    }

    // All that runs within `dispatch!` is inlined into it: what is not would not have its instructions.
    #[inline(always)]
    fn light_by<S: Simd>(&self, simd: S, (first, texels): (usize, &[TexelSurface]), parts: &mut [f32], light: &mut [Vec4], to_do: &mut ToDo) {
        let of_eight = LANES * self.sides;
        let mut eights = Vec::with_capacity(texels.len().div_ceil(LANES));
        for (number, texels) in texels.chunks(LANES).enumerate() {
            let known = parts.get(number * of_eight..).unwrap_or_default();
            eights.push(self.asking(simd, (first + number * LANES, texels), &known[..known.len().min(of_eight)]));
        }
        let mut asked = Asked::NONE;
        for sender in self.senders {
            for (number, Asking { eight, sides }) in eights.iter_mut().enumerate() {
                let Some(lit) = eight.lit(simd, sender) else { continue };
                for side in 0..self.sides {
                    let mut lanes = sides[side].ask(simd, lit[side]);
                    while lanes != 0 {
                        let lane = lanes.trailing_zeros() as usize % LANES;
                        lanes &= lanes - 1;
                        let texel = number * LANES + lane;
                        self.add_shot(sender, (texel, &texels[texel], side, sides[side].parts[lane]), &mut asked, light, to_do);
                    }
                }
            }
            self.settle(sender, &mut asked, light, to_do);
        }
        let Some(rays) = self.rays else { return };
        for (Asking { sides, .. }, parts) in eights.iter().zip(parts.chunks_mut(of_eight)) {
            let counts = sides.each_ref().map(|side| side.count().to_array());
            for (at, parts) in parts.iter_mut().enumerate() {
                let (side, lane) = (at % self.sides, at / self.sides);
                *parts = parts_next(sides[side].parts[lane], counts[side][lane], rays);
            }
        }
    }

    /// By the rays a luminance that are `known` of each side; all are asked where there are none.
    #[inline(always)]
    fn asking<S: Simd>(&self, simd: S, (first, texels): (usize, &[TexelSurface]), known: &[f32]) -> Asking<S> {
        let eight = Eight::of(simd, texels);
        let (mut parts, mut starts) = ([[MOST_PARTS; LANES]; 2], [[0.0; LANES]; 2]);
        if let Some(rays) = self.rays {
            let mut sums = [f32x8::splat(simd, 0.0); 2];
            if known.contains(&0.0) {
                for sender in self.senders {
                    let Some(lit) = eight.lit(simd, sender) else { continue };
                    sums = [sums[0] + lit[0], sums[1] + lit[1]];
                }
            }
            for (at, known) in known.iter().enumerate() {
                let (side, lane) = (at % self.sides, at / self.sides);
                parts[side][lane] = if *known > 0.0 { *known } else { (rays / sums[side][lane]).min(MOST_PARTS) };
                starts[side][lane] = unit(combine(self.seed, (first * self.sides + at) as u32));
            }
        }
        let [front, back] = [0, 1].map(|side| Side::new(simd, parts[side], starts[side]));
        Asking { eight, sides: [front, back] }
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
