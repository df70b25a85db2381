//! Records added to images on the host: by bands of rows side by side, in the records' order.

use crate::math::projection::PixelRectangle;
use fearless_simd::{Level, Simd, dispatch};
use glam::Vec4;
use rayon::prelude::*;
use std::ops::Range;

/// Rows of pixels that are summed as one.
const ROWS: u32 = 8;

/// Some rows of the images.
pub struct Band<'a> {
    /// Number of its first pixel in the images.
    first: usize,
    sums: &'a mut [Vec4],
    counts: Option<&'a mut [Vec4]>,
}

impl Band<'_> {
    /// Adds what a record contributes to a pixel, by its number in the images.
    #[inline(always)]
    pub fn add(&mut self, pixel: usize, contribution: Vec4) {
        self.sums[pixel - self.first] += contribution;
        if let Some(counts) = &mut self.counts {
            counts[pixel - self.first] += Vec4::ONE;
        }
    }
}

/// What records make of pixels.
pub trait Contribution: Sync {
    type Record: Sync;

    /// Adds what a record contributes to neighbours in a row, by their numbers in the images. To be inlined always.
    fn add<S: Simd>(&self, simd: S, record: &Self::Record, pixels: Range<usize>, band: &mut Band<'_>);
}

/// Adds to images of so many pixels a row what each record contributes to the pixels of its rectangle: sums, and counts if there is a second image.
pub fn add<C: Contribution>(width: u32, placed: &[(PixelRectangle, C::Record)], images: &mut [Vec<Vec4>], contribution: &C) {
    let height = images.first().map_or(0, |image| image.len() as u32 / width);
    add_some([width, height], placed, images, contribution, &|pixel| pixel);
}

/// The same for lists of some of a picture's pixels in their order: `place` tells how many of them come before a pixel.
pub fn add_some<C: Contribution>(
    [width, height]: [u32; 2],
    placed: &[(PixelRectangle, C::Record)],
    images: &mut [Vec<Vec4>],
    contribution: &C,
    place: &(impl Fn(usize) -> usize + Sync),
) {
    let ends: Vec<usize> = (0..height).step_by(ROWS as usize).map(|first| place(((first + ROWS).min(height) * width) as usize)).collect();
    bands(images, &ends).into_par_iter().enumerate().for_each(|(index, mut band)| {
        let first = index as u32 * ROWS;
        dispatch!(Level::new(), simd => add_to_band(simd, width, first, placed, contribution, &mut band, place));
    });
}

/// The bands that end at these pixels.
fn bands<'a>(images: &'a mut [Vec<Vec4>], ends: &[usize]) -> Vec<Band<'a>> {
    let mut images = images.iter_mut().map(|image| parts(image, ends).into_iter());
    let (sums, mut counts) = (images.next(), images.next());
    let firsts = std::iter::once(0).chain(ends.iter().copied());
    firsts.zip(sums.into_iter().flatten()).map(|(first, sums)| Band { first, sums, counts: counts.as_mut().and_then(Iterator::next) }).collect()
}

fn parts<'a>(mut image: &'a mut [Vec4], ends: &[usize]) -> Vec<&'a mut [Vec4]> {
    let mut start = 0;
    let part = |end: &usize| {
        let (part, rest) = std::mem::take(&mut image).split_at_mut(end - start);
        (image, start) = (rest, *end);
        part
    };
    ends.iter().map(part).collect()
}

/// What runs within `dispatch!` is inlined into it: what is not would not have its vector instructions.
#[inline(always)]
fn add_to_band<S: Simd, C: Contribution>(
    simd: S,
    width: u32,
    first: u32,
    placed: &[(PixelRectangle, C::Record)],
    contribution: &C,
    band: &mut Band<'_>,
    place: &impl Fn(usize) -> usize,
) {
    for (bounds, record) in placed.iter().filter(|(bounds, _)| bounds.min[1] < first + ROWS && bounds.max[1] > first) {
        for row in bounds.min[1].max(first)..bounds.max[1].min(first + ROWS) {
            let [from, to] = [bounds.min[0], bounds.max[0]].map(|column| place((row * width + column) as usize));
            if from < to {
                contribution.add(simd, record, from..to, band);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Adds a number a pixel, and which of them it was.
    struct Numbers;

    impl Contribution for Numbers {
        type Record = f32;

        fn add<S: Simd>(&self, _simd: S, record: &f32, pixels: Range<usize>, band: &mut Band<'_>) {
            pixels.for_each(|pixel| band.add(pixel, Vec4::new(*record, 1.0, pixel as f32, 0.0)));
        }
    }

    #[test]
    fn each_pixel_of_a_rectangle_is_added_to_once() {
        let size = [5, 2 * ROWS + 3];
        let rectangle = |min: [u32; 2], max: [u32; 2]| PixelRectangle { min, max };
        let rows = |first: u32, end: u32| rectangle([1, first], [4, end]);
        let placed = [
            (rectangle([0, 0], size), 1.0),
            (rows(0, ROWS), 2.0),
            (rows(ROWS, ROWS + 1), 4.0),
            (rows(ROWS - 1, ROWS), 8.0),
            (rows(ROWS - 2, 2 * ROWS + 1), 16.0),
            (rows(2 * ROWS + 2, 2 * ROWS + 3), 32.0),
            (rectangle([2, 3], [2, 9]), 64.0),
        ];
        let pixels = (size[0] * size[1]) as usize;
        let mut images = [vec![Vec4::ZERO; pixels], vec![Vec4::ZERO; pixels]];
        add(size[0], &placed, &mut images, &Numbers);
        for pixel in 0..size[0] * size[1] {
            let at = [pixel % size[0], pixel / size[0]];
            let inside = |bounds: &PixelRectangle| (0..2).all(|axis| (bounds.min[axis]..bounds.max[axis]).contains(&at[axis]));
            let of = placed.iter().filter(|(bounds, _)| inside(bounds));
            let (count, sum) = of.fold((0.0, 0.0), |(count, sum), (_, number)| (count + 1.0, sum + number));
            assert_eq!(images[0][pixel as usize], Vec4::new(sum, count, count * pixel as f32, 0.0), "{at:?}");
            assert_eq!(images[1][pixel as usize], Vec4::splat(count));
        }
        // Without a second image nothing is counted.
        let [both, _] = images;
        let mut alone = [vec![Vec4::ZERO; pixels]];
        add(size[0], &placed, &mut alone, &Numbers);
        assert_eq!(alone[0], both);
    }
}
