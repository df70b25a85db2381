//! Brightness of linear Rec. 709 colours.

use glam::{DVec3, Vec3};

/// Share of red, green and blue in the luminance.
pub const REC_709: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// Luminance of a linear colour, in the colour's unit.
pub fn luminance(colour: DVec3) -> f64 {
    colour.dot(REC_709)
}

/// What the bits of a reflectance say at most.
const MOST: Vec3 = Vec3::new(2047.0, 2047.0, 1023.0);

/// A colour of 0..1 in 32 bits: the roots of its parts, so that what is dark is as exact as what is bright; eleven bits each for red and green, ten for blue.
pub fn reflectance_bits(colour: Vec3) -> u32 {
    let rounded = (colour.clamp(Vec3::ZERO, Vec3::ONE).map(f32::sqrt) * MOST + 0.5).as_uvec3();
    rounded.x | rounded.y << 11 | rounded.z << 22
}

/// The colour of [`reflectance_bits`].
pub fn reflectance_of(bits: u32) -> Vec3 {
    let root = glam::UVec3::new(bits & 2047, bits >> 11 & 2047, bits >> 22).as_vec3() / MOST;
    root * root
}
