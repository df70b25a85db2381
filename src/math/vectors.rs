//! Eight vectors at a time, for what runs within `dispatch!`.

use fearless_simd::{Simd, f32x8, prelude::*};
use glam::{Vec3, Vec4};

/// How many are computed side by side.
pub const LANES: usize = 8;

/// Eight vectors.
#[derive(Clone, Copy)]
pub struct Vectors<S: Simd> {
    pub x: f32x8<S>,
    pub y: f32x8<S>,
    pub z: f32x8<S>,
}

impl<S: Simd> Vectors<S> {
    #[inline(always)]
    pub fn load(simd: S, axes: &[[f32; LANES]; 3]) -> Self {
        let [x, y, z] = axes;
        Self { x: f32x8::load_array_ref(simd, x), y: f32x8::load_array_ref(simd, y), z: f32x8::load_array_ref(simd, z) }
    }

    /// Eight times the same.
    #[inline(always)]
    pub fn splat(simd: S, vector: Vec3) -> Self {
        Self { x: f32x8::splat(simd, vector.x), y: f32x8::splat(simd, vector.y), z: f32x8::splat(simd, vector.z) }
    }

    /// One by one.
    #[inline(always)]
    pub fn lanes(self) -> [Vec3; LANES] {
        let [x, y, z] = [self.x, self.y, self.z].map(|axis| axis.to_array());
        std::array::from_fn(|lane| Vec3::new(x[lane], y[lane], z[lane]))
    }

    #[inline(always)]
    pub fn product(&self, other: Vec3) -> f32x8<S> {
        self.x.mul_add(other.x, self.y.mul_add(other.y, self.z * other.z))
    }

    #[inline(always)]
    pub fn dot(&self, other: Self) -> f32x8<S> {
        self.x.mul_add(other.x, self.y.mul_add(other.y, self.z * other.z))
    }

    #[inline(always)]
    pub fn scaled(self, factor: f32x8<S>) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }

    /// Component by component.
    #[inline(always)]
    pub fn times(self, other: Self) -> Self {
        Self { x: self.x * other.x, y: self.y * other.y, z: self.z * other.z }
    }

    #[inline(always)]
    pub fn magnitude(&self) -> Self {
        Self { x: self.x.abs(), y: self.y.abs(), z: self.z.abs() }
    }

    #[inline(always)]
    pub fn plus(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }

    #[inline(always)]
    pub fn minus(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }

    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self { x: self.y * other.z - self.z * other.y, y: self.z * other.x - self.x * other.z, z: self.x * other.y - self.y * other.x }
    }
}

/// Eight items of a list from a place on, by component; zeros beyond its end.
#[inline(always)]
pub fn apart<S: Simd>(simd: S, items: &[Vec4], from: usize) -> [f32x8<S>; 4] {
    let items = &items[from..];
    let mut padded = [Vec4::ZERO; LANES];
    let eight = items.first_chunk().unwrap_or_else(|| {
        padded[..items.len()].copy_from_slice(items);
        &padded
    });
    let [low, high] = bytemuck::cast_ref::<[Vec4; LANES], [[f32; 16]; 2]>(eight);
    let [[a, b, c, d], [e, f, g, h]] = [simd.load_four_interleaved_f32x4(low), simd.load_four_interleaved_f32x4(high)];
    [a.combine(e), b.combine(f), c.combine(g), d.combine(h)]
}

/// Eight items of their components.
#[inline(always)]
pub fn together<S: Simd>(simd: S, components: [f32x8<S>; 4]) -> [Vec4; LANES] {
    let mut items = [[0.0; 16]; 2];
    let [[a, e], [b, f], [c, g], [d, h]] = [components[0], components[1], components[2], components[3]].map(|component| {
        let (low, high) = component.split();
        [low, high]
    });
    simd.store_four_interleaved_f32x4([a, b, c, d], &mut items[0]);
    simd.store_four_interleaved_f32x4([e, f, g, h], &mut items[1]);
    bytemuck::cast(items)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn each_lane_is_a_vector() {
        let one = |k: usize, lane: usize| Vec3::new((k + lane) as f32 - 3.5, 0.3 * (2 * k + lane) as f32 - 1.0, 2.0 - 0.7 * (lane + k * k) as f32);
        let axes = |k: usize| std::array::from_fn(|axis| std::array::from_fn(|lane| one(k, lane)[axis]));
        let factors: [f32; LANES] = std::array::from_fn(|lane| 1.5 - lane as f32);
        dispatch!(Level::new(), simd => {
            let (a, b) = (Vectors::load(simd, &axes(1)), Vectors::load(simd, &axes(2)));
            let found = [a.plus(b), a.minus(b), a.times(b), a.cross(b), a.magnitude(), a.scaled(f32x8::load_array_ref(simd, &factors))];
            let found = found.map(|found| [found.x.to_array(), found.y.to_array(), found.z.to_array()]);
            let (dots, products) = (a.dot(b).to_array(), a.product(Vec3::new(0.5, -2.0, 3.0)).to_array());
            for lane in 0..LANES {
                let (a, b) = (one(1, lane), one(2, lane));
                let expected = [a + b, a - b, a * b, a.cross(b), a.abs(), a * factors[lane]];
                let found = found.map(|[x, y, z]| Vec3::new(x[lane], y[lane], z[lane]));
                assert!(found.iter().zip(expected).all(|(found, expected)| found.abs_diff_eq(expected, 1e-5)), "{found:?}, not {expected:?}");
                assert!((dots[lane] - a.dot(b)).abs() < 1e-5 && (products[lane] - a.dot(Vec3::new(0.5, -2.0, 3.0))).abs() < 1e-5);
            }
        });
    }

    #[test]
    fn what_is_taken_apart_goes_together_again() {
        let items: Vec<Vec4> = (0..13).map(|k| Vec4::new(k as f32, 0.5, -(k as f32), 2.0 * k as f32)).collect();
        dispatch!(Level::new(), simd => {
            for from in 0..13 {
                let components = apart(simd, &items, from);
                assert_eq!(components[0].to_array()[0], from as f32);
                let again = together(simd, components);
                let there = (items.len() - from).min(LANES);
                assert_eq!(again[..there], items[from..from + there]);
                assert!(again[there..].iter().all(|item| *item == Vec4::ZERO));
            }
        });
    }
}
