//! Averages of 2×2 texels down to one a tile, in seven images; the average times the number of samples is the sum.

use super::Work;
use super::reduce::Storage;
use crate::contract::{Arguments, Encoder, Refusal};
use crate::schedule::*;

/// Texels that one lane adds where a side is odd before it is 1.
const MOST_REST: u32 = 64;

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work<'_>, arguments: &Arguments) -> Result<(), Refusal> {
    let levels = work.levels(1);
    let [width, height] = work.level_size(levels);
    if width * height > MOST_REST {
        return Err(Refusal::of_parameter(
            "by",
            "plan::mipmap",
            format!("tiles of {}×{} samples cannot be halved down to {MOST_REST} texels", work.weighted.table.width, work.weighted.table.height),
            "give the tiles a resolution that is a power of two, or sum them another way",
        ));
    }
    let storage = Storage::of(e, work, arguments);
    let mut image = work.level_image(e, "level0", 0, storage.format);
    work.contribute(e, &storage, image);
    for level in 1..=levels {
        let coarse = work.level_image(e, &format!("level{level}"), level, storage.format);
        work.average(e, &storage, level, image, coarse);
        image = coarse;
    }
    let requests = work.weighted.tiles.requests;
    let mut program = work
        .at_level("irradiance_sum/mipmap_chain", levels)
        .bind("requests", requests.places)
        .bind_part("last", image, work.level_bytes(levels, storage.format))
        .bind("records", work.records);
    if let Some(exposures) = storage.exposures {
        program = program.bind("exposures", exposures);
    }
    e.compute(program, storage.finish, Groups::Counted { count: requests.count, divisor: 64, per: 1 });
    Ok(())
}
