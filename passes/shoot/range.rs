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
use fearless_simd::{Level, Select, Simd, dispatch, f32x8, prelude::*};
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
    /// Of a texel.
    pub rays: f32,
    /// Of the choices of the iteration.
    pub seed: u32,
}

/// Eight texels, lane by lane, and which of the shots at each of their sides are asked: those that bring much, and of the others those at which the sum of their parts of
/// all light goes beyond a whole number, from a start by chance.
struct Eight {
    position: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    /// 1 over the square of the distance within which they take no more [1/scene units²].
    nearest: [f32; LANES],
    /// The luminance of irradiance that one ray stands for.
    each: [[f32; LANES]; 2],
    /// How far it is to the next ray, in rays.
    next: [[f32; LANES]; 2],
}

impl Eight {
    fn of(texels: &[TexelSurface]) -> Self {
        let lanes = |value: &dyn Fn(&TexelSurface) -> f32| std::array::from_fn(|lane| texels.get(lane).map_or(0.0, value));
        Self {
            position: std::array::from_fn(|axis| lanes(&|texel| texel.position[axis])),
            // Lanes without a texel face nothing.
            normal: std::array::from_fn(|axis| lanes(&|texel| texel.normal[axis])),
            nearest: lanes(&|texel| 1.0 / (texel.area * NEAREST)),
            each: [[0.0; LANES]; 2],
            next: [[0.0; LANES]; 2],
        }
    }

    /// The luminance of the irradiance that a sender brings to each side if nothing is between.
    #[inline(always)]
    fn lit<S: Simd>(&self, simd: S, sender: &Sender) -> [f32x8<S>; 2] {
        let zero = f32x8::splat(simd, 0.0);
        let (position, normal) = (Vectors::load(simd, &self.position), Vectors::load(simd, &self.normal));
        let way = Vectors { x: position.x - sender.position.x, y: position.y - sender.position.y, z: position.z - sender.position.z };
        let (leaving, along, squared) = (way.product(sender.frame.normal), way.dot(normal), way.dot(way));
        let inverse = 1.0 / squared;
        let bounded = inverse * inverse.min(f32x8::load_array_ref(simd, &self.nearest).min(1.0 / sender.nearest));
        let lit = (leaving.simd_gt(zero) & squared.simd_gt(zero)).select(leaving * bounded * sender.luminance, zero);
        [lit * (zero - along).max(zero), lit * along.max(zero)]
    }

    /// Which of the lanes a shot of such luminance at one of their sides is to be asked of.
    #[inline(always)]
    fn ask<S: Simd>(&mut self, simd: S, side: usize, lit: f32x8<S>) -> u32 {
        let zero = f32x8::splat(simd, 0.0);
        let each = f32x8::load_array_ref(simd, &self.each[side]);
        let is_much = lit.simd_ge(each);
        let next = f32x8::load_array_ref(simd, &self.next[side]) - is_much.select(zero, lit / each);
        let is_next = next.simd_lt(zero);
        is_next.select(next + 1.0, next).store_array(&mut self.next[side]);
        ((is_much & lit.simd_gt(zero)) | is_next).to_bitmask() as u32
    }
}

impl Range<'_> {
    /// The light of all senders at neighbours, from the `first` texel on.
    pub fn light(&self, first: usize, texels: &[TexelSurface], light: &mut [Vec4], to_do: &mut ToDo) {
        light.fill(Vec4::ZERO);
        let mut eights: Vec<Eight> = texels.chunks(LANES).map(Eight::of).collect();
        // Views tell of most shots, and rays of all others; few shots are all asked.
        if self.views.is_none() && self.senders.len() as f32 > self.rays {
            self.weigh(first, &mut eights);
        }
        for sender in self.senders {
            self.add(sender, (texels, &mut eights), light, to_do);
        }
    }

    fn weigh(&self, first: usize, eights: &mut [Eight]) {
        dispatch!(Level::new(), simd => self.add_up(simd, eights));
        for (number, eight) in eights.iter_mut().enumerate() {
            for side in 0..self.sides {
                let place = |lane: usize| (first + number * LANES + lane) * self.sides + side;
                eight.each[side] = eight.each[side].map(|sum| sum / self.rays);
                eight.next[side] = std::array::from_fn(|lane| unit(combine(self.seed, place(lane) as u32)));
            }
        }
    }

    #[inline(always)]
    fn add_up<S: Simd>(&self, simd: S, eights: &mut [Eight]) {
        for eight in eights {
            let mut sums = [f32x8::splat(simd, 0.0); 2];
            for sender in self.senders {
                let lit = eight.lit(simd, sender);
                sums = [sums[0] + lit[0], sums[1] + lit[1]];
            }
            eight.each = sums.map(|sum| sum.to_array());
        }
    }

    fn add(&self, sender: &Sender, (texels, eights): (&[TexelSurface], &mut [Eight]), light: &mut [Vec4], to_do: &mut ToDo) {
        let mut asked = Asked::NONE;
        dispatch!(Level::new(), simd => self.ask(simd, sender, eights, |number, side, each| {
            self.add_shot(sender, (number, &texels[number], side, each), &mut asked, light, to_do);
        }));
        self.settle(sender, &mut asked, light, to_do);
    }

    /// Tells of each shot that is to be asked the texel, the side, and what a ray stands for.
    #[inline(always)]
    fn ask<S: Simd>(&self, simd: S, sender: &Sender, eights: &mut [Eight], mut told: impl FnMut(usize, usize, f32)) {
        for (number, eight) in eights.iter_mut().enumerate() {
            let lit = eight.lit(simd, sender);
            for (side, lit) in lit.into_iter().enumerate().take(self.sides) {
                let mut lanes = eight.ask(simd, side, lit);
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize % LANES;
                    lanes &= lanes - 1;
                    told(number * LANES + lane, side, eight.each[side][lane]);
                }
            }
        }
    }

    fn add_shot(
        &self,
        sender: &Sender,
        (number, texel, side, each): (usize, &TexelSurface, usize, f32),
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
        let (place, brought) = (number * self.sides + side, sender.brings(share) * (each / lit).max(1.0));
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
