//! Eight vectors at a time, for what runs within `dispatch!`.

use fearless_simd::{Simd, f32x8, prelude::*};
use glam::Vec3;

/// Eight vectors.
#[derive(Clone, Copy)]
pub struct Vectors<S: Simd> {
    pub x: f32x8<S>,
    pub y: f32x8<S>,
    pub z: f32x8<S>,
}

impl<S: Simd> Vectors<S> {
    #[inline(always)]
    pub fn load(simd: S, axes: &[[f32; 8]; 3]) -> Self {
        let [x, y, z] = axes;
        Self { x: f32x8::load_array_ref(simd, x), y: f32x8::load_array_ref(simd, y), z: f32x8::load_array_ref(simd, z) }
    }

    /// Eight times the same.
    #[inline(always)]
    pub fn splat(simd: S, vector: Vec3) -> Self {
        Self { x: f32x8::splat(simd, vector.x), y: f32x8::splat(simd, vector.y), z: f32x8::splat(simd, vector.z) }
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
