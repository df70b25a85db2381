//! Coarser levels of textures, and looks that are as wide as what a pixel sees of them: the shaders do the same arithmetic.

use super::{Reading, Texture};
use glam::{Vec2, Vec3};

/// Looks along the longer axis of a footprint at most.
const MOST_LOOKS: f32 = 8.0;

/// The most that red and green of a coarse texel can say, and what blue can.
const MOST: Vec3 = Vec3::new(2047.0, 2047.0, 1023.0);

/// How little a hole counts for the colour around it: something, so that what is nothing but holes has a colour.
const OF_HOLES: f32 = 1e-4;

/// One of the levels of a texture: its place among all of their texels, and its size.
#[derive(Clone, Copy)]
struct Level {
    start: usize,
    size: [u32; 2],
}

impl Level {
    fn next(self) -> Self {
        let [width, height] = self.size;
        Self { start: self.start + width as usize * height as usize, size: self.size.map(|side| (side / 2).max(1)) }
    }
}

impl Texture {
    /// Those of all levels.
    pub fn all_texels(&self) -> usize {
        self.texels.len() + self.coarser.len()
    }

    /// With its coarser levels, each half as wide and high as the one before, down to one texel; what alpha below `cutoff` cuts out does not count for the colours.
    pub fn with_levels(mut self, cutoff: Option<f32>) -> Self {
        let alpha = |texel: &[u8; 4]| f32::from(texel[3]) / 255.0;
        let mut weights = cutoff.map(|cutoff| self.texels.iter().map(|texel| if alpha(texel) < cutoff { OF_HOLES } else { 1.0 }).collect::<Vec<_>>());
        let mut level = self.level(0);
        while level.size != [1, 1] {
            let (texels, means) = self.halved(level, weights.as_deref());
            self.coarser.extend(texels);
            weights = weights.map(|_| means);
            level = level.next();
        }
        self
    }

    /// The level after one of them: means over its texels by area, and those of the weights, if there are any.
    fn halved(&self, level: Level, weights: Option<&[f32]>) -> (Vec<u32>, Vec<f32>) {
        let [width, height] = level.size;
        let (mut texels, mut means) = (Vec::new(), Vec::new());
        for row in 0..level.next().size[1] {
            for column in 0..level.next().size[0] {
                let (mut sum, mut total) = (Vec3::ZERO, 0.0);
                for (y, tall) in halving(row, height) {
                    for (x, wide) in halving(column, width) {
                        let weight = tall * wide * weights.map_or(1.0, |weights| weights[(y * width + x) as usize]);
                        sum += self.texel(level, x, y) * weight;
                        total += weight;
                    }
                }
                texels.push(packed(self.reading, sum / total));
                if weights.is_some() {
                    means.push(total);
                }
            }
        }
        (texels, means)
    }

    fn level(&self, number: u32) -> Level {
        (0..number).fold(Level { start: 0, size: [self.width, self.height] }, |level, _| level.next())
    }

    fn texel(&self, level: Level, column: u32, row: u32) -> Vec3 {
        let at = level.start + row as usize * level.size[0] as usize + column as usize;
        match at.checked_sub(self.texels.len()) {
            None => self.colour(at).truncate(),
            Some(beyond) => unpacked(self.reading, self.coarser[beyond]),
        }
    }

    /// Bilinear lookup in a level.
    fn sample_level(&self, level: Level, uv: Vec2) -> Vec3 {
        let ([left, right], [upper, lower], share) = self.nearest(uv, level.size);
        let texel = |column, row| self.texel(level, column, row);
        texel(left, upper).lerp(texel(right, upper), share.x).lerp(texel(left, lower).lerp(texel(right, lower), share.x), share.y)
    }

    /// The mean colour over a parallelogram of these sides around a texture coordinate: looks along its longer axis, each as wide as the shorter one.
    pub fn sample_over(&self, uv: Vec2, sides: [Vec2; 2]) -> Vec3 {
        let size = Vec2::new(self.width as f32, self.height as f32);
        let footprint = Footprint::of(sides.map(|side| side * size));
        if self.coarser.is_empty() || !footprint.is_wide() {
            return self.sample(uv).truncate();
        }
        let (level, last) = (footprint.width.log2(), self.width.max(self.height).ilog2());
        if level >= last as f32 {
            return self.sample_level(self.level(last), uv);
        }
        let fine = self.level(level as u32);
        let step = footprint.step / size;
        let first = uv - step * (0.5 * (footprint.looks - 1.0));
        let look = |number: u32| {
            let at = first + step * number as f32;
            self.sample_level(fine, at).lerp(self.sample_level(fine.next(), at), level.fract())
        };
        (0..footprint.looks as u32).map(look).sum::<Vec3>() / footprint.looks
    }
}

/// The two or three texels of a line of so many that make one of the next level, and how much of it each is.
fn halving(at: u32, size: u32) -> impl Iterator<Item = (u32, f32)> {
    let half = size / 2;
    let shares = match size {
        1 => [1.0, 0.0, 0.0],
        _ if size.is_multiple_of(2) => [0.5, 0.5, 0.0],
        _ => [half - at, half, at + 1].map(|share| share as f32 / size as f32),
    };
    (2 * at..).zip(shares).filter(|(_, share)| *share > 0.0)
}

/// A colour of a coarse level by 11, 11 and 10 bits, as its root where the image is sRGB: with 8 bits, the mean of black and white would be off by 0.6 %.
fn packed(reading: Reading, colour: Vec3) -> u32 {
    let value = if reading.is_linear { colour } else { colour.max(Vec3::ZERO).map(f32::sqrt) };
    let [r, g, b] = (value.clamp(Vec3::ZERO, Vec3::ONE) * MOST).round().to_array().map(|channel| channel as u32);
    r | g << 11 | b << 22
}

fn unpacked(reading: Reading, bits: u32) -> Vec3 {
    let value = Vec3::new((bits & 2047) as f32, (bits >> 11 & 2047) as f32, (bits >> 22) as f32) / MOST;
    if reading.is_linear { value } else { value * value }
}

/// How wide a pixel is on a texture [texels].
struct Footprint {
    /// Of each look; of one, all of the footprint.
    width: f32,
    looks: f32,
    /// From a look to the next.
    step: Vec2,
}

impl Footprint {
    /// Of the ellipse in a parallelogram: its axes are the singular values of the sides.
    fn of([a, b]: [Vec2; 2]) -> Self {
        let squares = a * a + b * b;
        let (sum, area) = (squares.element_sum().min(1e30), a.perp_dot(b).abs().min(1e30));
        let longer = 0.5 * ((sum + 2.0 * area).sqrt() + (sum - 2.0 * area).max(0.0).sqrt());
        let shorter = (area / longer.max(1.0)).max(1.0);
        let looks = (longer / shorter + 0.5).floor().clamp(1.0, MOST_LOOKS);
        let (square, mixed) = (longer * longer, a.x * a.y + b.x * b.y);
        let axis = if squares.x >= squares.y { Vec2::new(square - squares.y, mixed) } else { Vec2::new(mixed, square - squares.x) };
        Self { width: shorter.max(longer / looks), looks, step: axis / axis.length().max(f32::MIN_POSITIVE) * (longer / looks) }
    }

    /// Whether it is wider than a texel.
    fn is_wide(&self) -> bool {
        self.width > 1.0 || self.looks > 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};
    use crate::scene::Wrap;
    use proptest::prelude::*;

    /// An image of noise, and its mean.
    fn noise([width, height]: [u32; 2], is_linear: bool, seed: u32) -> (Texture, Vec3) {
        let channel = |at: u32| (255.99 * unit(hash(seed ^ hash(at)))) as u8;
        let texels: Vec<_> = (0..width * height).map(|at| [channel(4 * at), channel(4 * at + 1), channel(4 * at + 2), 255]).collect();
        let texture = Texture { width, height, texels, reading: Reading { is_linear, ..Default::default() }, ..Default::default() }.with_levels(None);
        let mean = (0..texture.texels.len()).map(|at| texture.colour(at).truncate()).sum::<Vec3>() / texture.texels.len() as f32;
        (texture, mean)
    }

    /// Vertical stripes a texel wide, black and white.
    fn stripes() -> Texture {
        let texels = (0..64 * 64).map(|at| [if at % 2 == 0 { 0 } else { 255 }; 4]).collect();
        Texture { width: 64, height: 64, texels, ..Default::default() }.with_levels(None)
    }

    proptest! {
        #[test]
        fn coarse_levels_keep_the_light(width in 1..40u32, height in 1..40u32, is_linear: bool, seed: u32) {
            let (texture, mean) = noise([width, height], is_linear, seed);
            for number in 0..=width.max(height).ilog2() {
                let level = texture.level(number);
                let [across, down] = level.size;
                let sum: Vec3 = (0..across * down).map(|at| texture.texel(level, at % across, at / across)).sum();
                let found = sum / (across * down) as f32;
                prop_assert!(found.distance(mean) < 2e-3, "{found}, not {mean}, in level {number}");
            }
            prop_assert!(texture.sample_over(Vec2::splat(0.3), [Vec2::X * 9.0, Vec2::Y * 9.0]).distance(mean) < 2e-3);
            // At most a third, but for the rows of images that are thin.
            prop_assert!(texture.coarser.len() <= texture.texels.len() / 3 + (width + height) as usize);
        }

        /// The axes are those of the ellipse: no direction is longer, and the area is kept where there are looks enough.
        #[test]
        fn looks_lie_along_the_longer_axis(a in [-20.0..20.0f32, -20.0..20.0f32], b in [-20.0..20.0f32, -20.0..20.0f32]) {
            let [a, b] = [a, b].map(Vec2::from_array);
            let longest = (0..3600).map(|turn| (a * (turn as f32 * 1.745_33e-3).cos() + b * (turn as f32 * 1.745_33e-3).sin()).length()).fold(0.0, f32::max);
            let found = Footprint::of([a, b]);
            let length = found.step.length() * found.looks;
            prop_assert!((length - longest).abs() < 1e-3 * longest.max(1.0), "{length}, not {longest}");
            prop_assert!(found.width >= 0.999 * (a.perp_dot(b).abs() / longest) && found.width >= 0.999 * longest / MOST_LOOKS);
            // The quadratic form of the ellipse is longest there.
            let along = found.step.normalize();
            let across = Vec2::new(a.dot(along), b.dot(along)).length();
            prop_assert!(found.looks < 1.5 || (across - longest).abs() < 1e-2 * longest, "{across} along the axis, not {longest}");
        }

        /// What is not wider than a texel is looked up as ever, to the bit; what is as wide as anything is still a colour.
        #[test]
        fn narrow_looks_are_plain(u in -3.0..3.0f32, v in -3.0..3.0f32, wide in 0.0..1.0f32, seed: u32) {
            let (texture, mean) = noise([16, 16], false, seed);
            let uv = Vec2::new(u, v);
            prop_assert_eq!(texture.sample_over(uv, [Vec2::X, Vec2::Y].map(|side| side * wide / 16.0)), texture.sample(uv).truncate());
            for size in [1e3, 1e12, 1e25, f32::INFINITY] {
                prop_assert!(texture.sample_over(uv, [Vec2::X * size, Vec2::Y * size]).distance(mean) < 2e-3);
            }
            prop_assert!(texture.sample_over(uv, [Vec2::NAN; 2]).is_finite());
        }
    }

    #[test]
    fn stripes_are_seen_along_and_not_across() {
        let stripes = stripes();
        let [along, across] = [Vec2::new(0.4, 6.0), Vec2::new(6.0, 0.4)].map(|size| {
            let sides = [Vec2::X * size.x / 64.0, Vec2::Y * size.y / 64.0];
            [10.5, 11.5].map(|column| stripes.sample_over(Vec2::new(column, 7.5) / 64.0, sides).x)
        });
        assert!(along[1] - along[0] > 0.4, "{along:?}");
        assert!(across.iter().all(|grey| (grey - 0.5).abs() < 0.01), "{across:?}");
    }

    /// Leaves on black that a mask cuts out stay green; an image that is a hole all over has the colour of what is cut out.
    #[test]
    fn holes_do_not_darken_what_is_left() {
        let leaf = |x: u32, y: u32| if (x / 3 + y / 5).is_multiple_of(4) { [40, 200, 60, 255] } else { [0, 0, 0, 0] };
        let texels: Vec<_> = (0..32 * 32).map(|at| leaf(at % 32, at / 32)).collect();
        let texture = Texture { width: 32, height: 32, texels, ..Default::default() }.with_levels(Some(0.5));
        let green = texture.texels.iter().position(|texel| texel[3] > 0).map(|at| texture.colour(at).truncate()).unwrap();
        let found = texture.sample_over(Vec2::splat(0.5), [Vec2::X, Vec2::Y]);
        assert!(found.distance(green) < 5e-3, "{found}, not {green}");
        let hole = Texture { width: 4, height: 4, texels: vec![[255, 255, 255, 0]; 16], ..Default::default() }.with_levels(Some(0.5));
        assert_eq!(hole.sample_over(Vec2::ZERO, [Vec2::X, Vec2::Y]), Vec3::ONE);
    }

    /// Levels lie as the image does beyond its edges.
    #[test]
    fn coarse_levels_are_clamped_and_repeated() {
        let image = |wrap| {
            let texels = (0..64).map(|at| [if at % 8 < 4 { 0 } else { 255 }; 4]).collect();
            let reading = Reading { wrap: [wrap; 2], ..Default::default() };
            Texture { width: 8, height: 8, texels, reading, ..Default::default() }.with_levels(None)
        };
        let beyond = |wrap| image(wrap).sample_over(Vec2::new(1.25, 0.5), [Vec2::X / 4.0, Vec2::Y / 4.0]).x;
        assert_eq!([Wrap::Repeat, Wrap::Clamp, Wrap::Mirror].map(beyond), [0.0, 1.0, 1.0]);
    }
}
