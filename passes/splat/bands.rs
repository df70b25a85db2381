//! Records added to images on the host: by bands of rows side by side, in the records' order.

use crate::math::projection::PixelRectangle;
use fearless_simd::{Level, Simd, dispatch};
use glam::Vec4;
use rayon::prelude::*;
use std::ops::Range;

/// Rows of pixels that are summed as one.
const ROWS: u32 = 8;

/// Some rows of the images.
pub(super) struct Band<'a> {
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
pub(super) trait Contribution: Sync {
    type Record: Sync;

    /// Adds what a record contributes to neighbours in a row, by their numbers in the images. To be inlined always.
    fn add<S: Simd>(&self, simd: S, record: &Self::Record, pixels: Range<usize>, band: &mut Band<'_>);
}

/// Adds to images of so many pixels a row what each record contributes to the pixels of its rectangle: sums, and counts if there is a second image.
pub(super) fn add<C: Contribution>(width: u32, placed: &[(PixelRectangle, C::Record)], images: &mut [Vec<Vec4>], contribution: &C) {
    let size = (ROWS * width) as usize;
    let mut images = images.iter_mut();
    let sums = images.next().into_iter().flat_map(|sums| sums.chunks_mut(size));
    let mut counts = images.next().map(|counts| counts.chunks_mut(size));
    let bands: Vec<_> = sums.enumerate().map(|(index, sums)| Band { first: index * size, sums, counts: counts.as_mut().and_then(Iterator::next) }).collect();
    bands.into_par_iter().enumerate().for_each(|(index, mut band)| {
        let first = index as u32 * ROWS;
        dispatch!(Level::new(), simd => add_to_band(simd, width, first, placed, contribution, &mut band));
    });
}

/// What runs within `dispatch!` is inlined into it: what is not would not have its vector instructions.
#[inline(always)]
fn add_to_band<S: Simd, C: Contribution>(simd: S, width: u32, first: u32, placed: &[(PixelRectangle, C::Record)], contribution: &C, band: &mut Band<'_>) {
    for (bounds, record) in placed.iter().filter(|(bounds, _)| bounds.min[1] < first + ROWS && bounds.max[1] > first) {
        for row in bounds.min[1].max(first)..bounds.max[1].min(first + ROWS) {
            let [from, to] = [bounds.min[0], bounds.max[0]].map(|column| (row * width + column) as usize);
            contribution.add(simd, record, from..to, band);
        }
    }
}
