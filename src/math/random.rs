//! Counter-based random numbers as the shaders have them: shaders/lib/random.wgsl.

use fearless_simd::{Simd, f32x8, prelude::*, u32x8};

/// One round of the PCG output permutation (Jarzynski and Olano 2020, "pcg").
#[inline]
pub fn hash(value: u32) -> u32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

pub fn combine(a: u32, b: u32) -> u32 {
    hash(a ^ hash(b).wrapping_add(0x9e37_79b9))
}

/// In 0..1, 1 excluded.
pub fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 / 16_777_216.0
}

/// Barycentric weights of corners 1 and 2 of a point uniform over a triangle.
pub fn triangle_point([u, v]: [f64; 2]) -> glam::Vec2 {
    let root = u.sqrt();
    glam::Vec2::new((root * (1.0 - v)) as f32, (root * v) as f32)
}

/// Eight of [`hash`], for what runs within `dispatch!`.
#[inline(always)]
pub fn hashes<S: Simd>(value: u32x8<S>) -> u32x8<S> {
    let state = value * 747_796_405 + 2_891_336_453;
    let word = ((state >> ((state >> 28) + 4)) ^ state) * 277_803_737;
    (word >> 22) ^ word
}

/// Eight of [`combine`].
#[inline(always)]
pub fn combinations<S: Simd>(a: u32x8<S>, b: u32x8<S>) -> u32x8<S> {
    hashes(a ^ (hashes(b) + 0x9e37_79b9))
}

/// Eight of [`unit`].
#[inline(always)]
pub fn units<S: Simd>(bits: u32x8<S>) -> f32x8<S> {
    f32x8::float_from(bits >> 8) * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn eight_are_as_one_by_one() {
        #[inline(always)]
        fn eight<S: Simd>(simd: S, a: [u32; 8], b: [u32; 8]) -> ([u32; 8], [f32; 8]) {
            let bits = combinations(u32x8::load_array(simd, a), u32x8::load_array(simd, b));
            (bits.to_array(), units(bits).to_array())
        }
        let (a, b) = ([0, 1, 2, 77, 0x8000_0000, u32::MAX, 12_345, 9], [3, 0, u32::MAX, 1 << 31, 5, 6, 7, 8]);
        let (bits, numbers) = dispatch!(Level::new(), simd => eight(simd, a, b));
        for lane in 0..8 {
            assert_eq!((bits[lane], numbers[lane]), (combine(a[lane], b[lane]), unit(combine(a[lane], b[lane]))));
        }
    }

    #[test]
    fn numbers_are_uniform_and_depend_on_both_keys() {
        let mut bins = [0u32; 16];
        (0..160).for_each(|a| (0..100).for_each(|b| bins[(unit(combine(a, b)) * 16.0) as usize] += 1));
        // χ² of 15 degrees of freedom stays below 37.7 with probability 0.999.
        let chi_squared: f64 = bins.iter().map(|&n| (f64::from(n) - 1000.0).powi(2) / 1000.0).sum();
        assert!(chi_squared < 37.7, "χ² {chi_squared}");
        assert!(combine(1, 2) != combine(2, 1) && unit(u32::MAX) < 1.0);
    }
}
