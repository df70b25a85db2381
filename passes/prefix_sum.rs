//! Sums of all numbers before each, on the device: what lists of different lengths are laid out by.

use crate::contract::Encoder;
use crate::schedule::*;

/// Numbers that a workgroup sums: `BLOCK` of the shader.
const BLOCK: u32 = 1024;

/// Replaces `count` words of a buffer, from the word `first` on, by the sums of those before them.
pub fn encode(e: &mut Encoder<'_>, numbers: Resource, first: u32, count: u32) {
    let blocks = count.div_ceil(BLOCK).max(1);
    let sums = e.buffer("block_sums", 4 * u64::from(blocks));
    let program = Program::new("prefix_sum").constant("FIRST", first).constant("COUNT", count).bind("numbers", numbers).bind("blocks", sums);
    let groups = Groups::linear(blocks);
    e.compute(program.clone(), "sum_within_blocks", groups);
    e.compute(program.clone(), "sum_over_blocks", Groups::ONE);
    e.compute(program, "add_blocks", groups);
}
