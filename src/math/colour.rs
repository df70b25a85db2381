//! Brightness of linear Rec. 709 colours.

use glam::DVec3;

/// Share of red, green and blue in the luminance.
pub const REC_709: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// Luminance of a linear colour, in the colour's unit.
pub fn luminance(colour: DVec3) -> f64 {
    colour.dot(REC_709)
}
