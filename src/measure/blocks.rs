//! The lines of an EXR file, compressed without loss by all cores.
//!
//! Blocks of 16 lines are compressed as ZIP, which every program that reads EXR knows. The crate `exr` compresses at a level that takes six times as
//! long as the fastest and makes files 5 % smaller; so blocks are made here, by the fastest.

use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::error::UnitResult;
use exr::meta::attribute::SampleType;
use half::f16;
use miniz_oxide::deflate::{CompressionLevel, compress_to_vec_zlib};
use rayon::prelude::*;
use std::ops::Range;

/// Lines of a block, as the format has it for ZIP.
const LINES: usize = 16;

/// Blocks that each thread makes before they are written: what is not yet written stays in memory.
const BLOCKS_PER_THREAD: usize = 2;

/// The largest finite half float.
const HALF_MAX: f32 = 65504.0;

/// A plane as it is written.
#[derive(Debug, Clone, Copy)]
pub struct Plane<'p> {
    values: &'p [f32],
    is_half: bool,
}

impl<'p> Plane<'p> {
    /// Of half floats if they are wanted and all values are within their range.
    pub fn of(values: &'p [f32], half: bool) -> Self {
        Self { values, is_half: half && values.iter().all(|value| value.abs() <= HALF_MAX) }
    }

    pub fn sample_type(&self) -> SampleType {
        if self.is_half { SampleType::F16 } else { SampleType::F32 }
    }

    fn sample_bytes(&self) -> usize {
        if self.is_half { size_of::<f16>() } else { size_of::<f32>() }
    }

    fn write(&self, samples: Range<usize>, to: &mut [u8]) {
        let values = &self.values[samples];
        if self.is_half {
            to.chunks_exact_mut(2).zip(values).for_each(|(to, value)| to.copy_from_slice(&f16::from_f32(*value).to_le_bytes()));
        } else {
            to.chunks_exact_mut(4).zip(values).for_each(|(to, value)| to.copy_from_slice(&value.to_le_bytes()));
        }
    }
}

/// Writes all blocks of a picture of so many columns and rows; the planes in the order of the file's channels.
pub fn write(planes: &[Plane<'_>], [width, height]: [usize; 2], writer: &mut impl ChunksWriter) -> UnitResult {
    let blocks: Vec<usize> = (0..height.div_ceil(LINES)).collect();
    for group in blocks.chunks(BLOCKS_PER_THREAD * rayon::current_num_threads()) {
        let lines = |block: usize| block * LINES..height.min((block + 1) * LINES);
        let compressed: Vec<Vec<u8>> = group.par_iter().map(|&block| compress(&bytes(planes, width, lines(block)))).collect();
        for (&block, compressed_pixels_le) in group.iter().zip(compressed) {
            let block_of_lines = CompressedScanLineBlock { y_coordinate: lines(block).start as i32, compressed_pixels_le };
            writer.write_chunk(block, Chunk { layer_index: 0, compressed_block: CompressedBlock::ScanLine(block_of_lines) })?;
        }
    }
    Ok(())
}

/// Lines as they are without compression: of each line the samples of each channel, the lowest byte first.
fn bytes(planes: &[Plane<'_>], width: usize, lines: Range<usize>) -> Vec<u8> {
    let mut bytes = vec![0; planes.iter().map(Plane::sample_bytes).sum::<usize>() * width * lines.len()];
    let mut rest = bytes.as_mut_slice();
    for line in lines {
        for plane in planes {
            let (own, behind) = rest.split_at_mut(plane.sample_bytes() * width);
            plane.write(line * width..(line + 1) * width, own);
            rest = behind;
        }
    }
    bytes
}

/// As ZIP: first every other byte, then those between, each as its difference from the one before. Samples have an even number of bytes. Bytes that do not
/// shrink stay as they are, by which readers know them.
fn compress(bytes: &[u8]) -> Vec<u8> {
    let mut apart = vec![0; bytes.len()];
    let (even, odd) = apart.split_at_mut(bytes.len() / 2);
    for ((pair, even), odd) in bytes.chunks_exact(2).zip(even).zip(odd) {
        (*even, *odd) = (pair[0], pair[1]);
    }
    let mut differences = apart.clone();
    for (difference, pair) in differences.iter_mut().skip(1).zip(apart.windows(2)) {
        *difference = pair[1].wrapping_sub(pair[0]).wrapping_add(128);
    }
    let compressed = compress_to_vec_zlib(&differences, CompressionLevel::BestSpeed as u8);
    if compressed.len() < bytes.len() { compressed } else { bytes.to_vec() }
}
