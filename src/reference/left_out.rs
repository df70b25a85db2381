//! How much of the light a picture lacks that counts only so many bounces.

use super::{Bounces, luminance, path::Tracer, random::Random};
use crate::math::lattice::pixel;
use crate::scene::{Camera, Scene, bvh::Bvh};
use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

/// Pixels that one path each is traced from.
const PATHS: u32 = 1024;

/// Tells these paths' random numbers from those of references.
const STREAM: u64 = 0x6c65_6674;

/// Quantile of the normal distribution for 95 % to both sides.
const QUANTILE: f64 = 1.96;

/// An estimate of what is left out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LeftOut {
    /// Of all light that surfaces reflect toward the camera, by luminance.
    pub share: f64,
    /// Where the share is, with 95 % confidence as far as the paths are many.
    pub interval: [f64; 2],
    /// Bounces that are counted.
    pub bounces: u32,
}

/// Estimates the share of the light that reaches the camera by more than so many bounces, from 1,024 pixels spread over the picture: the ratio of two sums
/// over the same paths. None where no surface is seen, or none that any light reaches.
pub fn left_out(scene: &Scene, bvh: &Bvh, camera: &Camera, size: [u32; 2], bounces: u32) -> Option<LeftOut> {
    let tracer = Tracer::new(scene, bvh);
    let paths: Vec<[f64; 2]> = (0..PATHS).into_par_iter().filter_map(|number| path(&tracer, camera, size, number, bounces)).collect();
    let [beyond, all] = paths.iter().fold([0.0; 2], |[beyond, all], path| [beyond + path[0], all + path[1]]);
    let share = (all > 0.0).then(|| beyond / all)?;
    let squares: f64 = paths.iter().map(|[beyond, all]| (beyond - share * all).powi(2)).sum();
    // What no path has met may still be met by one of as many: the rule of three.
    let half = (QUANTILE * squares.sqrt() / all).max(if beyond > 0.0 { 0.0 } else { 3.0 / paths.len() as f64 });
    Some(LeftOut { share, interval: [(share - half).max(0.0), (share + half).min(1.0)], bounces })
}

/// Of the number-th path, the luminance of what came by more bounces, and of all. None where its pixel sees no surface.
fn path(tracer: &Tracer, camera: &Camera, size: [u32; 2], number: u32, bounces: u32) -> Option<[f64; 2]> {
    let surface = tracer.surface(camera.ray(size, pixel(number, size)))?;
    let mut sums = [DVec3::ZERO; 2];
    tracer.walk(surface, Bounces::All, &mut Random::new([STREAM, number.into()]), |touched, light| {
        // What the visible surface itself reflects has touched one surface, and bounced off none before.
        sums[0] += if touched > bounces + 1 { light } else { DVec3::ZERO };
        sums[1] += light;
    });
    Some(sums.map(luminance))
}
