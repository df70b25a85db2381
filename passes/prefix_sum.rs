//! Sums of all numbers before each, on the device: what lists of different lengths are laid out by.

use crate::contract::Encoder;
use crate::schedule::*;

/// Numbers that a workgroup sums: `BLOCK` of the shader.
const BLOCK: u32 = 1024;

/// Replaces `count` words of a buffer, from the word `first` on, by the sums of those before them; not in rounds of a loop in which the variable is 0.
pub fn encode(e: &mut Encoder<'_>, numbers: Resource, first: u32, count: u32, unless_zero: Option<Variable>) {
    let blocks = count.div_ceil(BLOCK).max(1);
    let sums = e.buffer("block_sums", 4 * u64::from(blocks));
    let program = Program::new("prefix_sum").constant("FIRST", first).constant("COUNT", count).bind("numbers", numbers).bind("blocks", sums);
    let groups = |count| unless_zero.map_or(Groups::linear(count), |variable| Groups::Counted { count: variable, divisor: 1, per: count });
    e.compute(program.clone(), "sum_within_blocks", groups(blocks));
    e.compute(program.clone(), "sum_over_blocks", groups(1));
    e.compute(program, "add_blocks", groups(blocks));
}
