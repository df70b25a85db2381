//! Directions drawn from a sky, and its suns: what is so small and bright that rays would not find it by chance.

use super::{Environment, Rgb, model::lookup};
use crate::math::{
    choice::Choice,
    colour::{REC_709, luminance},
};
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
        let weights = texels.iter().enumerate().map(|(i, texel)| luminance(texel.as_dvec3()).max(0.0) * sine(i, [*width, *height]));
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

    /// A direction with the density of the bilinear lookup.
    pub fn sample(&self, [a, b]: [f64; 2]) -> Option<Vec3> {
        let (index, rest) = self.texels.pick(a);
        within_tent(index, [self.width, self.height], [rest, b])
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

/// More luminance than this, in means of all that is no brighter, is a sun's: what is left is found well by rays that know nothing of it.
const BRIGHT: f64 = 8.0;

/// What of the sky is so bright that rays go there by choice: of each texel that is brighter than `limit` its light above that. The rest is the broad sky; both
/// add up to the whole.
#[derive(Default)]
pub struct Suns {
    /// Luminance of the broad sky at most [W m⁻² sr⁻¹]; above all that there is where there are no suns.
    pub limit: f32,
    size: [u32; 2],
    /// Of each row the solid angle of its texels over that of one at the horizon.
    sines: Vec<f32>,
    /// Those that are brighter, with the running sum of luminance × solid angle up to and including each.
    texels: Vec<(u32, f32)>,
}

/// The sky in a direction.
pub struct InSky {
    /// Radiance of the broad sky and of suns [W m⁻² sr⁻¹].
    pub broad: Rgb,
    pub suns: Rgb,
    /// With which [`Suns::sample`] draws the direction [1/sr].
    pub density: f32,
}

impl Suns {
    pub fn new(environment: &Environment) -> Self {
        let Environment::LatLong { width, height, texels } = environment else { return Self { limit: f32::MAX, ..Self::default() } };
        let size = [*width, *height];
        let limit = limit(size, texels);
        let mut sum = 0.0;
        let bright = texels.iter().enumerate().filter(|(_, texel)| brightness(**texel) > limit);
        let texels = bright
            .map(|(texel, radiance)| {
                sum += f64::from(brightness(*radiance) - limit) * sine(texel, size);
                (texel as u32, sum as f32)
            })
            .collect();
        Self { limit, size, sines: (0..size[1]).map(|row| sine((row * size[0]) as usize, size) as f32).collect(), texels }
    }

    /// Luminance × solid angle of all, in texels at the horizon; 0 where there are none.
    pub fn weight(&self) -> f32 {
        self.texels.last().map_or(0.0, |last| last.1)
    }

    pub fn shine(&self) -> bool {
        !self.texels.is_empty()
    }

    /// The texels with their running sums.
    pub fn texels(&self) -> &[(u32, f32)] {
        &self.texels
    }

    /// A direction of suns: by a number of 0..1 that chooses the texel, and two for the place within the tent that spreads it.
    pub fn sample(&self, chosen: f32, place: [f32; 2]) -> Option<Vec3> {
        let at = chosen * self.weight();
        let found = self.texels.partition_point(|(_, sum)| *sum <= at).min(self.texels.len().checked_sub(1)?);
        let ([width, height], texel) = (self.size, self.texels[found].0);
        let [aside, below] = place.map(|number| tent(f64::from(number)) as f32);
        let azimuth = (((texel % width) as f32 + 0.5 + aside) / width as f32 - 0.5) * TAU as f32;
        let polar = ((texel / width) as f32 + 0.5 + below) / height as f32 * PI as f32;
        let ((across, along), (flat, up)) = (azimuth.sin_cos(), polar.sin_cos());
        // What spills over a pole comes back by reflection, as the lookup repeats the outermost row.
        Some(Vec3::new(flat.abs() * across, up, -flat.abs() * along))
    }

    /// What there is in a unit direction.
    pub fn seen(&self, environment: &Environment, direction: Vec3) -> InSky {
        let (Environment::LatLong { texels, .. }, true) = (environment, self.shine()) else {
            return InSky { broad: environment.radiance(direction), suns: Vec3::ZERO, density: 0.0 };
        };
        let (around, across, down) = lookup(self.size, direction);
        let shares = [[(1.0 - across) * (1.0 - down), across * (1.0 - down)], [(1.0 - across) * down, across * down]];
        let mut seen = InSky { broad: Vec3::ZERO, suns: Vec3::ZERO, density: 0.0 };
        for (row, shares) in around.into_iter().zip(shares) {
            for (texel, share) in row.into_iter().zip(shares) {
                let radiance = texels[texel];
                let brightness = brightness(radiance);
                // Of the whole the share below the limit: the difference would cancel out.
                let below = if brightness > self.limit { self.limit / brightness } else { 1.0 };
                seen.broad += radiance * (below * share);
                if brightness > self.limit {
                    seen.suns += radiance * ((1.0 - below) * share);
                    seen.density += share * (brightness - self.limit) * self.sines[texel / self.size[0] as usize];
                }
            }
        }
        if seen.density > 0.0 {
            let [width, height] = self.size.map(|size| size as f32);
            let polar = direction.x.hypot(direction.z).max(1e-6);
            seen.density *= width * height / (self.weight() * (TAU * PI) as f32 * polar);
        }
        seen
    }
}

/// The luminance that is [`BRIGHT`] means of what is no brighter: each mean is below the one before, down to the one that fits.
fn limit(size: [u32; 2], texels: &[Rgb]) -> f32 {
    // Texels of one brightness are one: eight steps to each doubling. Solid angle, and luminance times it.
    let mut steps = vec![[0.0f64; 2]; 1 + (f32::MAX.to_bits() >> STEP_BITS) as usize];
    for (row, texels) in texels.chunks(size[0] as usize).enumerate() {
        let share = sine(row * size[0] as usize, size);
        for texel in texels {
            let brightness = brightness(*texel).max(0.0);
            let step = &mut steps[(brightness.to_bits() >> STEP_BITS) as usize];
            *step = [step[0] + share, step[1] + share * f64::from(brightness)];
        }
    }
    let steps: Vec<[f64; 2]> = steps.into_iter().filter(|step| step[0] > 0.0).collect();
    let all: f64 = steps.iter().map(|step| step[0]).sum();
    let mut limit = f64::from(f32::MAX);
    for _ in 0..MOST_MEANS {
        let next = BRIGHT * steps.iter().map(|[share, light]| light.min(limit * share)).sum::<f64>() / all;
        if next >= 0.99 * limit {
            break;
        }
        limit = next;
    }
    limit as f32
}

/// Of [`limit`]'s means: a sky that is black but for a few texels has all of its light in suns, and each mean is a fraction of the one before.
const MOST_MEANS: u32 = 64;

/// Of a number those that are left off: its exponent and three bits of its mantissa are kept.
const STEP_BITS: u32 = 20;

/// Luminance, as shaders have it.
#[inline(always)]
fn brightness(radiance: Rgb) -> f32 {
    radiance.dot(REC_709.as_vec3())
}

/// Solid angle of a texel over that of one at the horizon.
fn sine(texel: usize, [width, height]: [u32; 2]) -> f64 {
    (((texel / width as usize) as f64 + 0.5) / f64::from(height) * PI).sin()
}

/// A direction within the tent that the bilinear lookup spreads a texel over.
fn within_tent(texel: usize, [width, height]: [u32; 2], [a, b]: [f64; 2]) -> Option<Vec3> {
    let (column, row) = (texel % width as usize, texel / width as usize);
    let azimuth = ((column as f64 + 0.5 + tent(a)) / f64::from(width) - 0.5) * TAU;
    // What spills over a pole comes back by reflection, as the lookup repeats the outermost row.
    let polar = (row as f64 + 0.5 + tent(b)) / f64::from(height) * PI;
    let sine = polar.sin().abs();
    DVec3::new(sine * azimuth.sin(), polar.cos(), -sine * azimuth.cos()).as_vec3().try_normalize()
}

/// Maps 0..1 to −1..1 with density 1 − |x|.
fn tent(number: f64) -> f64 {
    if number < 0.5 { (2.0 * number).sqrt() - 1.0 } else { 1.0 - (2.0 - 2.0 * number).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};

    /// A sky that grows brighter towards +y, with two suns, one of them at a pole.
    fn sky(sun: f32) -> Environment {
        let (width, height) = (64, 32);
        let texel = |at: u32| {
            let (x, y) = (at % width, at / width);
            let broad = Vec3::new(0.5, 0.7, 1.0) * (1.0 - 0.02 * y as f32);
            broad + if (x, y) == (40, 9) || y == 0 && x < 8 { sun * Vec3::new(1.0, 0.9, 0.7) } else { Vec3::ZERO }
        };
        Environment::LatLong { width, height, texels: (0..width * height).map(texel).collect() }
    }

    #[test]
    fn a_sky_without_suns_is_broad() {
        let broad = sky(0.0);
        let suns = Suns::new(&broad);
        assert!(!suns.shine() && suns.weight() == 0.0 && suns.sample(0.5, [0.5; 2]).is_none());
        assert!(!Suns::new(&Environment::Constant(Vec3::ONE)).shine());
        let seen = suns.seen(&broad, Vec3::new(0.6, 0.0, 0.8));
        assert!((seen.broad - broad.radiance(Vec3::new(0.6, 0.0, 0.8))).length() < 1e-6);
        assert_eq!((seen.suns, seen.density), (Vec3::ZERO, 0.0));
    }

    /// Both parts are the whole; directions are drawn with the density that is told, and what suns send adds up.
    #[test]
    fn suns_and_the_broad_sky_are_the_whole_sky() {
        let bright = sky(1e5);
        let suns = Suns::new(&bright);
        assert_eq!(suns.texels().len(), 9);
        let (mut by_suns, mut by_chance, mut missed) = (Vec3::ZERO, Vec3::ZERO, 0);
        const SAMPLES: u32 = 400_000;
        for i in 0..SAMPLES {
            let number = |key: u32| unit(hash(5 * i + key));
            let direction = suns.sample(number(0), [number(1), number(2)]).unwrap();
            let seen = suns.seen(&bright, direction);
            assert!((seen.broad + seen.suns - bright.radiance(direction)).abs().max_element() <= 1e-5 * bright.radiance(direction).max_element());
            assert!(luminance(seen.broad.as_dvec3()) <= 1.0001 * f64::from(suns.limit));
            // At the edge of a tent rounding may find nothing.
            if seen.density == 0.0 {
                missed += 1;
                continue;
            }
            by_suns += seen.suns / seen.density / SAMPLES as f32;
            let height = 2.0 * number(3) - 1.0;
            let (sine, cosine) = (TAU as f32 * number(4)).sin_cos();
            let flat = (1.0 - height * height).sqrt();
            by_chance += suns.seen(&bright, Vec3::new(flat * cosine, height, flat * sine)).suns * (2.0 * TAU as f32 / SAMPLES as f32);
        }
        assert!(missed < SAMPLES / 10_000, "{missed} samples see no sun");
        assert!((by_suns / by_chance - 1.0).abs().max_element() < 0.08, "{by_suns} by choice, {by_chance} by chance");
    }

    #[test]
    fn a_black_sky_with_one_lamp_is_all_suns() {
        let mut texels = vec![Vec3::ZERO; 512];
        texels[100] = Vec3::splat(3.0);
        let sky = Environment::LatLong { width: 32, height: 16, texels };
        let suns = Suns::new(&sky);
        assert!(suns.limit < 1e-6 && suns.texels().len() == 1);
        let black = Environment::LatLong { width: 32, height: 16, texels: vec![Vec3::ZERO; 512] };
        assert!(!Suns::new(&black).shine());
    }
}
