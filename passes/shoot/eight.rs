//! What senders bring eight texels at once, and which of that is asked of rays.

use super::Sender;
use crate::math::vectors::{LANES, Vectors};
use crate::passes::texels::{NEAREST, TexelSurface};
use fearless_simd::{Select, Simd, f32x8, prelude::*};

/// Rays a luminance where any light at all is asked for.
pub const MOST_PARTS: f32 = 1e38;

/// A square of a distance that is no more than 0, so that a texel brings itself nothing [scene units²].
const LEAST: f32 = 1e-28;

/// Eight texels, lane by lane.
pub struct Eight<S: Simd> {
    position: Vectors<S>,
    normal: Vectors<S>,
    /// 1 over the square of the distance within which they take no more [1/scene units²].
    nearest: f32x8<S>,
}

impl<S: Simd> Eight<S> {
    #[inline(always)]
    pub fn of(simd: S, texels: &[TexelSurface]) -> Self {
        let (mut position, mut normal, mut nearest) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3], [0.0; LANES]);
        // Lanes without a texel face nothing.
        for (lane, texel) in texels.iter().enumerate() {
            for axis in 0..3 {
                position[axis][lane] = texel.position[axis];
                normal[axis][lane] = texel.normal[axis];
            }
            nearest[lane] = 1.0 / (texel.area * NEAREST);
        }
        Self { position: Vectors::load(simd, &position), normal: Vectors::load(simd, &normal), nearest: f32x8::load_array(simd, nearest) }
    }

    /// What a sender brings at the fronts and at the backs if nothing is between, as luminance of irradiance; none where it faces away from all.
    #[inline(always)]
    pub fn lit(&self, simd: S, sender: &Sender) -> Option<[f32x8<S>; 2]> {
        let zero = f32x8::splat(simd, 0.0);
        let way = self.position.minus(Vectors::splat(simd, sender.position));
        let leaving = way.product(sender.frame.normal);
        if leaving.simd_gt(zero).to_bitmask() == 0 {
            return None;
        }
        let inverse = 1.0 / way.dot(way).max(LEAST);
        let bounded = inverse * inverse.min(self.nearest.min(1.0 / sender.nearest));
        let light = leaving.max(zero) * bounded * sender.luminance;
        let along = way.dot(self.normal);
        Some([light * (zero - along).max(zero), light * along.max(zero)])
    }
}

/// Which of the shots at a side of eight texels are asked: those that bring more than a ray stands for, and of the others those at which the sum of their parts goes beyond a whole
/// number, from a start by chance.
pub struct Side<S: Simd> {
    /// Rays a luminance of irradiance.
    pub parts: f32x8<S>,
    /// How far it was to the next ray at first, and is now, in rays.
    start: f32x8<S>,
    next: f32x8<S>,
    /// Rays so far.
    asked: f32x8<S>,
}

impl<S: Simd> Side<S> {
    #[inline(always)]
    pub fn new(simd: S, parts: [f32; LANES], start: [f32; LANES]) -> Self {
        let start = f32x8::load_array(simd, start);
        Self { parts: f32x8::load_array(simd, parts), start, next: start, asked: f32x8::splat(simd, 0.0) }
    }

    /// The lanes that are to be asked for a shot, by what it would bring.
    #[inline(always)]
    pub fn ask(&mut self, simd: S, light: f32x8<S>) -> u64 {
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let rays = light * self.parts;
        let is_much = rays.simd_ge(one);
        self.next -= is_much.select(zero, rays);
        let is_next = self.next.simd_lt(zero);
        let asked = is_much.to_bitmask() | is_next.to_bitmask();
        if asked != 0 {
            let passed = is_next.select(one, zero);
            self.next += passed;
            self.asked += passed + is_much.select(one, zero);
        }
        asked
    }

    /// How many rays were to be asked in the mean.
    #[inline(always)]
    pub fn count(&self) -> f32x8<S> {
        self.asked + self.start - self.next
    }
}

/// Rays a luminance for the next iteration, so that they become as many as they should; 0 where light has changed too much to tell.
pub fn parts_next(parts: f32, count: f32, rays: f32) -> f32 {
    if count > MOST_ASKED * rays {
        0.0
    } else if count > LEAST_ASKED * rays {
        (parts * (rays / count)).min(MOST_PARTS)
    } else if parts < MOST_PARTS {
        0.0
    } else {
        parts
    }
}

/// How many times as many rays as there should be tell that light has changed, and how few.
const MOST_ASKED: f32 = 4.0;
const LEAST_ASKED: f32 = 1e-3;

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn rays_become_as_many_as_they_should_be() {
        let lights: Vec<f32> = (1..1000).map(|number| 1.0 / number as f32).collect();
        let count = |parts: f32| lights.iter().map(|light| (light * parts).min(1.0)).sum::<f32>();
        let settled = (0..8).fold(1.0, |parts, _| parts_next(parts, count(parts), 16.0));
        assert!((count(settled) - 16.0).abs() < 0.1, "{}", count(settled));
        // Where nothing comes, where nothing comes any more, and where too much does.
        assert_eq!([parts_next(MOST_PARTS, 0.0, 16.0), parts_next(3.0, 0.0, 16.0), parts_next(3.0, 100.0, 16.0)], [MOST_PARTS, 0.0, 0.0]);
    }

    #[test]
    fn rays_are_counted_by_what_they_stand_for() {
        let starts: [f32; LANES] = std::array::from_fn(|lane| lane as f32 / 8.0);
        let lights: Vec<f32> = (1..200).map(|number| 3.0 / number as f32).collect();
        let expected: f32 = lights.iter().map(|light| (0.7 * light).min(1.0)).sum();
        dispatch!(Level::new(), simd => {
            let mut side = Side::new(simd, [0.7; LANES], starts);
            let asked: u32 = lights.iter().map(|light| side.ask(simd, f32x8::splat(simd, *light)).count_ones()).sum();
            assert!(side.count().to_array().iter().all(|count| (count - expected).abs() < 1e-4), "{:?}, not {expected}", side.count());
            assert!((asked as f32 / 8.0 - expected).abs() < 0.2, "{asked}");
        });
    }
}
