//! Directions drawn from a sky.

use super::Environment;
use crate::math::{choice::Choice, colour::luminance};
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// The texels of a latitude-longitude sky, chosen by luminance × solid angle.
pub struct Sky {
    width: u32,
    height: u32,
    texels: Choice,
}

impl Sky {
    /// None where the sky has no texels, or all are black.
    pub fn new(environment: &Environment) -> Option<Self> {
        let Environment::LatLong { width, height, texels } = environment else { return None };
        let sine = |row: usize| ((row as f64 + 0.5) / *height as f64 * PI).sin();
        let weights = texels.iter().enumerate().map(|(i, texel)| luminance(texel.as_dvec3()).max(0.0) * sine(i / *width as usize));
        let texels = Choice::new(weights);
        (texels.total() > 0.0).then_some(Self { width: *width, height: *height, texels })
    }

    /// Luminance over all directions [W m⁻²], by the texels.
    pub fn luminance(&self) -> f64 {
        self.texels.total() * TAU / f64::from(self.width) * PI / f64::from(self.height)
    }

    /// Where the share of each texel ends, as [`Choice::end`] tells it.
    pub fn ends(&self) -> impl Iterator<Item = u32> {
        (0..(self.width * self.height) as usize).map(|texel| self.texels.end(texel))
    }

    /// A direction with the density of the bilinear lookup: a texel, and a place within the tent that spreads it.
    pub fn sample(&self, [a, b]: [f64; 2]) -> Option<Vec3> {
        let (index, rest) = self.texels.pick(a);
        let (column, row) = (index as u32 % self.width, index as u32 / self.width);
        let azimuth = ((column as f64 + 0.5 + tent(rest)) / self.width as f64 - 0.5) * TAU;
        // What spills over a pole comes back by reflection, as the lookup repeats the outermost row.
        let polar = (row as f64 + 0.5 + tent(b)) / self.height as f64 * PI;
        let sine = polar.sin().abs();
        DVec3::new(sine * azimuth.sin(), polar.cos(), -sine * azimuth.cos()).as_vec3().try_normalize()
    }

    /// Density over solid angle [1/sr].
    pub fn density(&self, direction: Vec3) -> f64 {
        let direction = direction.as_dvec3();
        let (width, height) = (self.width as f64, self.height as f64);
        let polar = direction.y.clamp(-1.0, 1.0).acos();
        let x = (0.5 + direction.x.atan2(-direction.z) / TAU) * width - 0.5;
        let y = polar / PI * height - 0.5;
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let weight = |dx: f64, dy: f64| {
            let column = (x.floor() + dx).rem_euclid(width) as usize;
            let row = (y.floor() + dy).clamp(0.0, height - 1.0) as usize;
            self.texels.weight(row * self.width as usize + column)
        };
        let upper = weight(0.0, 0.0) * (1.0 - fx) + weight(1.0, 0.0) * fx;
        let lower = weight(0.0, 1.0) * (1.0 - fx) + weight(1.0, 1.0) * fx;
        (upper * (1.0 - fy) + lower * fy) / self.texels.total() * width * height / (TAU * PI * polar.sin().max(f64::MIN_POSITIVE))
    }
}

/// Maps 0..1 to −1..1 with density 1 − |x|.
fn tent(number: f64) -> f64 {
    if number < 0.5 { (2.0 * number).sqrt() - 1.0 } else { 1.0 - (2.0 - 2.0 * number).sqrt() }
}
