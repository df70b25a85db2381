//! What the diffuse parts of the visible surfaces reflect of the broad sky: a few rays a pixel, and what pixels beside each other see, together, in two passes of
//! which the second asks pixels farther apart (Dammertz and others 2010). How far apart they may lie by chance the rays tell. `shaders/broad_sky.wgsl` does the same.

use crate::contract::{
    Encoder,
    encoder::{bind_visibility, light_constants},
    port,
};
use crate::math::{beside::is_beside, colour::REC_709};
use crate::scene::Rgb;
use crate::schedule::{Format, Program, Resource};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// Pixels to either side that are asked.
const REACH: i32 = 2;

/// One of the passes.
#[derive(Clone, Copy)]
struct Smoothing {
    /// From one pixel that is asked to the next.
    step: i32,
    /// Standard errors that what two pixels see may lie apart.
    tolerance: f32,
}

/// The first is wide, as few rays that get through are more often too few than too many: leaving out what is rare would lose light.
fn passes(tolerance: f32) -> impl Iterator<Item = Smoothing> {
    [(1, 3.0), (4, 1.0)].into_iter().filter(move |_| tolerance > 0.0).map(move |(step, times)| Smoothing { step, tolerance: times * tolerance })
}

/// What squared standard errors count as at least, so that what is sure divides by a number.
const LEAST_VARIANCE: f32 = 1e-30;

/// What a pixel counts for anyway: all there is where none is near what is usual.
const LEAST_WEIGHT: f32 = 1e-20;

/// A surface that a pixel shows.
#[derive(Clone, Copy)]
pub(super) struct Shown {
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    pub albedo: Rgb,
}

impl Shown {
    /// Whether another is on the same surface.
    fn is_beside(&self, other: &Self) -> bool {
        is_beside([self.position, self.normal], [other.position, other.normal])
    }
}

/// What the pixels of a picture show, and what each sees of the sky: the mean radiance, and the standard error of its luminance.
pub(super) struct Skies {
    pub size: [u32; 2],
    pub shown: Vec<Option<Shown>>,
    pub seen: Vec<Vec4>,
}

impl Skies {
    /// What each pixel reflects, with others that lie no farther apart than so many standard errors.
    pub fn reflected(mut self, tolerance: f32) -> Vec<Vec3> {
        for pass in passes(tolerance) {
            self.seen = (0..self.seen.len()).into_par_iter().map(|pixel| self.smoothed(pixel, pass)).collect();
        }
        let reflected = |(shown, seen): (&Option<Shown>, &Vec4)| shown.map_or(Vec3::ZERO, |shown| shown.albedo * seen.truncate());
        self.shown.par_iter().zip(&self.seen).map(reflected).collect()
    }

    fn smoothed(&self, pixel: usize, Smoothing { step, tolerance }: Smoothing) -> Vec4 {
        let own = self.seen[pixel];
        let Some(shown) = &self.shown[pixel] else { return own };
        let at = [pixel % self.size[0] as usize, pixel / self.size[0] as usize].map(|along| along as i32);
        let (mut others, mut count) = ([own; (2 * REACH + 1).pow(2) as usize], 1);
        let (mut middle, mut near) = (own.truncate(), 1.0);
        for y in -REACH..=REACH {
            for x in -REACH..=REACH {
                let there = [at[0] + step * x, at[1] + step * y];
                if let Some(other) = self.at(there).filter(|_| [x, y] != [0, 0])
                    && self.shown[other].is_some_and(|other| shown.is_beside(&other))
                {
                    others[count] = self.seen[other];
                    count += 1;
                    if step * x.abs().max(y.abs()) == 1 {
                        middle += self.seen[other].truncate();
                        near += 1.0;
                    }
                }
            }
        }
        // Of a pixel's own rays too many may have got through by chance, or none: it does not know by how much they vary, nor what is usual.
        let variance = others[..count].iter().map(|other| other.w * other.w).sum::<f32>() / count as f32;
        let (middle, apart_by_chance) = (middle / near, tolerance * tolerance * 2.0 * variance.max(LEAST_VARIANCE));
        let (mut sum, mut squares, mut weights) = (LEAST_WEIGHT * own.truncate(), 0.0, LEAST_WEIGHT);
        for other in &others[..count] {
            let apart = (other.truncate() - middle).dot(REC_709.as_vec3());
            let weight = (-0.5 * apart * apart / apart_by_chance).exp();
            // Not so where what is seen is no number.
            if weight > 0.0 {
                sum += other.truncate() * weight;
                squares += other.w * other.w * weight * weight;
                weights += weight;
            }
        }
        sum.extend(squares.sqrt()) / weights
    }

    fn at(&self, pixel: [i32; 2]) -> Option<usize> {
        let is_inside = (0..2).all(|axis| (0..self.size[axis] as i32).contains(&pixel[axis]));
        is_inside.then(|| (pixel[1] * self.size[0] as i32 + pixel[0]) as usize)
    }
}

/// Adds the sky to the rest of the light, on the device.
pub(super) fn encode(e: &mut Encoder<'_>, gbuffer: &port::GBuffer, (rest, radiance): (Resource, Resource), (samples, tolerance): (u32, f32)) {
    let image = |e: &mut Encoder<'_>, name: &str| e.image(name, gbuffer.size, Format::Rgba32Float);
    let (first, second, albedo) = (image(e, "sky"), image(e, "smoothed_sky"), image(e, "albedo"));
    let program = bind_visibility(light_constants(Program::new("broad_sky"), e.setting.needs, [samples; 2]), None);
    let see = program.clone().bind("triangles", gbuffer.triangles).bind("seen_out", first).bind("albedo_out", albedo);
    e.compute_pixels(see, "see", gbuffer.size);
    let mut ways = [first, second];
    for Smoothing { step, tolerance } in passes(tolerance) {
        let smooth =
            program.clone().constant("STEP", step as u32).constant("TOLERANCE", tolerance).bind("position", gbuffer.position).bind("normal", gbuffer.normal);
        e.compute_pixels(smooth.bind("seen", ways[0]).bind("seen_out", ways[1]), "smooth_sky", gbuffer.size);
        ways.reverse();
    }
    let add = program.bind("rest", rest).bind("albedo", albedo).bind("seen", ways[0]).bind("radiance", radiance);
    e.compute_pixels(add, "add", gbuffer.size);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};

    const EDGE: u32 = 40;
    const RAYS: u32 = 64;

    /// A floor that sees such a share of a sky of 1 at each place, by a few rays.
    fn floor(share: impl Fn(f32) -> f32) -> Skies {
        let of = |at: u32| {
            let position = Vec3::new((at % EDGE) as f32, (at / EDGE) as f32, 0.0);
            let free = (0..RAYS).filter(|ray| unit(hash(at * RAYS + ray)) < share(position.x)).count();
            let mean = free as f32 / RAYS as f32;
            (Some(Shown { position, normal: Vec3::Z, albedo: Vec3::splat(0.5) }), Vec3::splat(mean).extend((mean * (1.0 - mean) / RAYS as f32).sqrt()))
        };
        let (shown, seen) = (0..EDGE * EDGE).map(of).unzip();
        Skies { size: [EDGE; 2], shown, seen }
    }

    /// The root of the mean square of what pixels are wrong by, over what they reflect of all of the sky.
    fn wrong(reflected: &[Vec3], share: impl Fn(f32) -> f32) -> f32 {
        let squares = reflected.iter().zip(0u32..).map(|(light, at)| (2.0 * light.x - share((at % EDGE) as f32)).powi(2));
        (squares.sum::<f32>() / reflected.len() as f32).sqrt()
    }

    #[test]
    fn noise_is_less_by_what_neighbours_see() {
        for share in [0.02, 0.1, 0.5, 0.98] {
            let noise = wrong(&floor(|_| share).seen.iter().map(|seen| 0.5 * seen.truncate()).collect::<Vec<_>>(), |_| share);
            let left = wrong(&floor(|_| share).reflected(1.0), |_| share);
            assert!(left < 0.2 * noise, "{share}: {left} of {noise}");
        }
    }

    #[test]
    fn no_light_is_lost() {
        for share in [0.02, 0.3, 0.9] {
            let floor = floor(|_| share);
            let mean = |light: &mut dyn Iterator<Item = f32>| light.sum::<f32>() / (EDGE * EDGE) as f32;
            let seen = mean(&mut floor.seen.iter().map(|seen| 0.5 * seen.x));
            let reflected = mean(&mut floor.reflected(1.0).iter().map(|light| light.x));
            assert!((reflected - seen).abs() < 0.02 * seen, "{share}: {reflected}, not {seen}");
        }
    }

    #[test]
    fn shadows_stay() {
        let step = |x: f32| if x < 20.0 { 0.2 } else { 0.8 };
        assert!(wrong(&floor(step).reflected(1.0), step) < 0.03);
        let slope = |x: f32| 0.1 + 0.02 * x;
        assert!(wrong(&floor(slope).reflected(1.0), slope) < 0.03);
    }

    #[test]
    fn pixels_count_alone_without_tolerance() {
        let (floor, seen) = (floor(|_| 0.5), floor(|_| 0.5).seen);
        assert!(floor.reflected(0.0).iter().zip(seen).all(|(light, seen)| (2.0 * light.x - seen.x).abs() < 1e-6));
    }

    #[test]
    fn what_is_no_number_stays_where_it_is() {
        let mut floor = floor(|_| 0.5);
        let own = (EDGE * 20 + 20) as usize;
        (floor.seen[own + 1], floor.seen[own - 1]) = (Vec4::NAN, Vec4::INFINITY);
        let reflected = floor.reflected(1.0);
        assert!((0..reflected.len()).filter(|pixel| ![own + 1, own - 1].contains(pixel)).all(|pixel| reflected[pixel].is_finite()));
    }

    #[test]
    fn other_surfaces_do_not_count() {
        let own = (EDGE * 20 + 20) as usize;
        let light = |other: Vec4| {
            let mut floor = floor(|_| 0.5);
            floor.shown[own + 1].as_mut().unwrap().normal = Vec3::X;
            floor.shown[own - 1].as_mut().unwrap().position.z = 0.5;
            (floor.seen[own + 1], floor.seen[own - 1]) = (other, other);
            floor.smoothed(own, Smoothing { step: 1, tolerance: 1.0 })
        };
        assert_eq!(light(Vec4::new(0.5, 0.5, 0.5, 0.06)), light(Vec4::new(0.6, 0.5, 0.5, 0.06)));
    }
}
