//! What neighbouring pixels see by their lobes, together, as `shaders/lobe_rays/filter.wgsl` does: what one got wrong by chance, others have not.

use crate::math::{beside::is_beside, colour::luminance};
use crate::scene::Rgb;
use glam::Vec3;

/// Pixels to either side that are asked.
const REACH: i32 = 3;

/// What squared standard errors count as at least, so that what is sure divides by a number.
const LEAST_VARIANCE: f32 = 1e-30;

/// What the rays of a pixel bring, and where they start.
#[derive(Clone, Copy)]
pub(super) struct Traced {
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// The light that they see, in the mean over what the lobe reflects of it [W m⁻² sr⁻¹], and the standard error of its luminance.
    pub seen: Rgb,
    pub error: f32,
    /// The share of light that the lobe reflects.
    pub albedo: Rgb,
}

impl Traced {
    /// Whether another is on the same surface.
    fn is_beside(&self, other: &Self) -> bool {
        is_beside([self.position, self.normal], [other.position, other.normal])
    }

    /// How much what another sees counts: less where it is many standard errors of the two away.
    fn likeness(&self, other: &Self, tolerance: f32) -> f32 {
        let apart = luminance((other.seen - self.seen).as_dvec3()) as f32;
        let variance = (self.error * self.error + other.error * other.error).max(LEAST_VARIANCE);
        (-0.5 * apart * apart / (tolerance * tolerance * variance)).exp()
    }
}

/// The pixels of a picture; none where no sharp lobe is seen.
pub(super) struct Filter<'a> {
    pub pixels: &'a [Option<Traced>],
    pub size: [u32; 2],
    /// Standard errors that what two pixels see may lie apart.
    pub tolerance: f32,
}

impl Filter<'_> {
    /// What the lobe of a pixel reflects; black where there is none.
    pub fn radiance(&self, pixel: usize) -> Vec3 {
        let Some(own) = &self.pixels[pixel] else { return Vec3::ZERO };
        let at = [pixel % self.size[0] as usize, pixel / self.size[0] as usize].map(|along| along as i32);
        let (mut sum, mut weights) = (own.seen, 1.0);
        for y in at[1] - REACH..=at[1] + REACH {
            for x in at[0] - REACH..=at[0] + REACH {
                let Some(other) = self.at([x, y]).filter(|other| [x, y] != at && own.is_beside(other)) else { continue };
                let weight = own.likeness(other, self.tolerance);
                // Not so where what is seen is no number.
                if weight > 0.0 {
                    sum += other.seen * weight;
                    weights += weight;
                }
            }
        }
        own.albedo * sum / weights
    }

    fn at(&self, pixel: [i32; 2]) -> Option<&Traced> {
        let is_inside = (0..2).all(|axis| (0..self.size[axis] as i32).contains(&pixel[axis]));
        if is_inside { self.pixels[(pixel[1] * self.size[0] as i32 + pixel[0]) as usize].as_ref() } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};

    const EDGE: u32 = 24;

    /// A floor that mirrors something, and the noise of a few rays.
    fn floor(mirrored: impl Fn(f32) -> f32, noise: f32) -> Vec<Option<Traced>> {
        let of = |at: u32| {
            let position = Vec3::new((at % EDGE) as f32, (at / EDGE) as f32, 0.0);
            let chance = 3f32.sqrt() * (2.0 * unit(hash(at)) - 1.0);
            let seen = Vec3::splat(mirrored(position.x) + noise * chance);
            Some(Traced { position, normal: Vec3::Z, seen, error: noise, albedo: Vec3::new(0.5, 0.25, 1.0) })
        };
        (0..EDGE * EDGE).map(of).collect()
    }

    /// The root of the mean square of what pixels are wrong by, over their albedo.
    fn wrong(pixels: &[Option<Traced>], mirrored: impl Fn(f32) -> f32) -> f32 {
        let filter = Filter { pixels, size: [EDGE; 2], tolerance: 2.0 };
        let squares = (0..pixels.len()).map(|pixel| (filter.radiance(pixel).x / 0.5 - mirrored((pixel as u32 % EDGE) as f32)).powi(2));
        (squares.sum::<f32>() / pixels.len() as f32).sqrt()
    }

    #[test]
    fn noise_is_less_by_what_neighbours_know() {
        assert!(wrong(&floor(|_| 10.0, 1.0), |_| 10.0) < 0.3);
    }

    #[test]
    fn what_is_mirrored_stays() {
        let step = |x: f32| if x < 12.0 { 1.0 } else { 3.0 };
        assert!(wrong(&floor(step, 0.1), step) < 0.04);
        let stripes = |x: f32| 2.0 + (x as u32 % 2) as f32;
        assert!(wrong(&floor(stripes, 0.0), stripes) < 1e-6);
    }

    #[test]
    fn what_is_no_number_stays_where_it_is() {
        let mut pixels = floor(|_| 1.0, 0.1);
        let own = (EDGE * 12 + 12) as usize;
        pixels[own + 1].as_mut().unwrap().seen = Vec3::NAN;
        pixels[own - 1].as_mut().unwrap().seen = Vec3::INFINITY;
        assert!(Filter { pixels: &pixels, size: [EDGE; 2], tolerance: 2.0 }.radiance(own).is_finite());
    }

    #[test]
    fn other_surfaces_do_not_count() {
        let mut pixels = floor(|_| 1.0, 0.1);
        let own = (EDGE * 12 + 12) as usize;
        let radiance = |pixels: &[Option<Traced>]| Filter { pixels, size: [EDGE; 2], tolerance: 2.0 }.radiance(own);
        pixels[own + 1].as_mut().unwrap().normal = Vec3::X;
        pixels[own - 1].as_mut().unwrap().position.z = 0.5;
        let before = radiance(&pixels);
        pixels[own + 1].as_mut().unwrap().seen += 0.1;
        pixels[own - 1].as_mut().unwrap().seen += 0.1;
        assert_eq!(radiance(&pixels), before);
        pixels[own] = None;
        assert_eq!(radiance(&pixels), Vec3::ZERO);
    }
}
