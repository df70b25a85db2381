//! Records added to images on the host: by bands of rows side by side, in the records' order.

use crate::math::projection::PixelRectangle;
use glam::Vec4;
use rayon::prelude::*;

/// Rows of pixels that are summed as one.
const ROWS: u32 = 8;

/// Adds to the first image, of so many pixels a row, what each record contributes to the pixels of its rectangle, if it does, and 1 to the second.
pub(super) fn add<R: Sync>(width: u32, placed: &[(PixelRectangle, R)], images: &mut [Vec<Vec4>], contribution: impl Fn(&R, usize) -> Option<Vec4> + Sync) {
    let band = (ROWS * width) as usize;
    let mut images = images.iter_mut();
    let sums = images.next().into_iter().flat_map(|sums| sums.chunks_mut(band));
    let mut counts = images.next().map(|counts| counts.chunks_mut(band));
    let bands: Vec<_> = sums.map(|sums| (sums, counts.as_mut().and_then(Iterator::next))).collect();
    bands.into_par_iter().enumerate().for_each(|(index, (sums, mut counts))| {
        let first = index as u32 * ROWS;
        for (bounds, record) in placed.iter().filter(|(bounds, _)| bounds.min[1] < first + ROWS && bounds.max[1] > first) {
            for row in bounds.min[1].max(first)..bounds.max[1].min(first + ROWS) {
                for column in bounds.min[0]..bounds.max[0] {
                    let Some(value) = contribution(record, (row * width + column) as usize) else { continue };
                    let at = ((row - first) * width + column) as usize;
                    sums[at] += value;
                    if let Some(counts) = &mut counts {
                        counts[at] += Vec4::ONE;
                    }
                }
            }
        }
    });
}
