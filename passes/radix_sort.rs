//! Pairs of a key and a value sorted by their keys, on the device; those of the same key stay in their order.

use super::prefix_sum;
use crate::contract::Encoder;
use crate::schedule::*;

/// Pairs that a workgroup moves, and bits of a key that it looks at: `shaders/radix_sort.wgsl`.
const BLOCK: u32 = 1024;
const DIGIT_BITS: u32 = 6;

/// What is sorted.
#[derive(Clone, Copy)]
pub struct Keys {
    /// Of a key, from the lowest on, that are not 0.
    pub bits: u32,
    /// Most pairs.
    pub capacity: u32,
    /// Pairs, as the host knows them, and by a word of a buffer.
    pub count: Variable,
    pub counted: (Resource, u32),
}

/// Sorts the pairs of the first of two buffers, which takes both; tells which has them in the end.
pub fn encode(e: &mut Encoder<'_>, [mut from, mut to]: [Resource; 2], keys: Keys) -> Resource {
    let blocks = keys.capacity.div_ceil(BLOCK).max(1);
    let digits = 1 << DIGIT_BITS;
    let counts = e.buffer("digits", 4 * u64::from(digits * blocks));
    for digit in 0..keys.bits.div_ceil(DIGIT_BITS) {
        let program = Program::new("radix_sort")
            .constant("COUNT_AT", keys.counted.1)
            .constant("BLOCKS", blocks)
            .constant("SHIFT", digit * DIGIT_BITS)
            .bind("unsorted", from)
            .bind("sorted", to)
            .bind("counts", counts)
            .bind("sizes", keys.counted.0);
        // Blocks without pairs too, which have none of each digit.
        e.compute(program.clone(), "count_digits", Groups::linear(blocks));
        prefix_sum::encode(e, counts, 0, digits * blocks, None);
        e.compute(program, "scatter", Groups::Counted { count: keys.count, divisor: BLOCK, per: 1 });
        (from, to) = (to, from);
    }
    from
}
