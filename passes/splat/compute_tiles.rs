//! Records binned over tiles of 16×16 pixels and added in their order, without blending.

use super::{Work, at_start, fresh};
use crate::contract::Encoder;
use crate::schedule::*;

/// Edge of a tile [pixels].
const TILE: u32 = 16;
/// Most records that are binned at a time; fewer for large pictures, but 1024 at least.
const CHUNK: u32 = 32_768;
/// Most bytes of all tiles' masks.
const MASK_BYTES: u64 = 32 << 20;

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work) {
    let [width, height] = work.gbuffer.size;
    let tiles = width.div_ceil(TILE) * height.div_ceil(TILE);
    // A bit a record, and a bit a word of those.
    let summary = (MASK_BYTES / 4 / 33 / tiles as u64).clamp(1, CHUNK as u64 / 1024) as u32;
    let words = 32 * summary;
    let chunk = 32 * words;
    let pixels = width as u64 * height as u64;
    let masks = e.buffer("masks", tiles as u64 * (summary + words) as u64 * 4);
    let added = e.buffer("added", pixels * 16);
    let counted = work.counts.map(|counts| (e.buffer("counted", pixels * 4), counts));
    for buffer in [Some(masks), Some(added), counted.map(|c| c.0)].into_iter().flatten() {
        at_start(e, Command::Clear(buffer));
    }
    for (stretch, records) in fresh::encode(e, work, chunk) {
        let program = work
            .contribution(Program::new("splat/compute_tiles"))
            .constant("MASK_WORDS", words)
            .constant("SUMMARY_WORDS", summary)
            .bind("records", work.cache.records)
            .bind("weighting", work.cache.weighting)
            .bind("stretch", stretch)
            .bind("masks", masks);
        e.compute(program.clone(), "bin", Groups::Counted { count: records, divisor: 64, per: 1 });
        let program = program.bind("position", work.gbuffer.position).bind("normal", work.gbuffer.normal).bind("added", added).bind("sums", work.sums);
        // As many groups as tiles where the chunk has any record.
        let groups = Groups::Counted { count: records, divisor: chunk, per: tiles };
        match counted {
            Some((counted, counts)) => e.compute(program.bind("counted", counted).bind("counts", counts), "add_counted", groups),
            None => e.compute(program, "add", groups),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::{Arguments, encoder::Encoded, encoder::Setting, port};
    use crate::passes::mock::{self, MockHost};
    use crate::scene::needs::Needs;
    use std::collections::BTreeMap;

    fn encoded(size: [u32; 2], capacity: u32, schedule: &mut Schedule) -> Encoded {
        let (host, needs, inputs, arguments) = (MockHost::new(Vec::new(), size), Needs::default(), BTreeMap::new(), Arguments::defaults(&[]));
        schedule.variables.extend((0..8).map(|_| VariableDescription { name: String::new(), history: false }));
        schedule.resources.extend((0..8).map(|_| ResourceDescription { name: String::new(), kind: ResourceKind::State, lifetime: Lifetime::Transient }));
        let setting = Setting { scene: host.scene(), needs: &needs, device: Device::ABLE, size, tables: None };
        let mut e = Encoder::new("splat", &arguments, setting, &inputs, schedule).in_loop(10, false);
        let [position, normal, reflectance, triangles, sums] = [2, 3, 4, 5, 6].map(Resource);
        let gbuffer = port::GBuffer { size, position, normal, reflectance, triangles };
        encode(&mut e, &Work { gbuffer, cache: mock::cache(capacity), sums, counts: None, first: Variable(1), of_errors: false, radiance: None });
        e.finish()
    }

    /// Bytes of the buffer of masks, and records that a chunk may have.
    fn masks(size: [u32; 2]) -> (u64, u32) {
        let mut schedule = Schedule::default();
        let encoded = encoded(size, 100, &mut schedule);
        let divisor = encoded.commands.iter().find_map(|command| match command {
            Command::Compute(Compute { entry: "add", groups: Groups::Counted { divisor, .. }, .. }) => Some(*divisor),
            _ => None,
        });
        let masks = schedule.resources.iter().find(|resource| resource.name == "splat.masks").map(|resource| &resource.kind);
        let Some(ResourceKind::Buffer { bytes }) = masks else { panic!("a buffer") };
        (*bytes, divisor.unwrap())
    }

    #[test]
    fn masks_of_large_pictures_have_room_for_fewer_records() {
        // A bit for each record, and a bit for each word of those, of each tile.
        assert_eq!(masks([64, 49]), (4 * 4 * (1024 + 32) * 4, 32_768));
        assert_eq!(masks([4096, 4096]), (65_536 * (96 + 3) * 4, 3072));
        assert_eq!(masks([16_384, 16_384]), (1_048_576 * (32 + 1) * 4, 1024));
    }

    #[test]
    fn new_records_are_shared_out_to_chunks() {
        let mut schedule = Schedule::default();
        let encoded = encoded([64, 48], 70_000, &mut schedule);
        let step = encoded.commands.iter().find_map(|command| if let Command::Host(step) = command { Some(step) } else { None }).unwrap();
        let counts = encoded.commands.iter().filter_map(|command| match command {
            Command::Compute(Compute { entry: "bin", groups: Groups::Counted { count, .. }, .. }) => Some(*count),
            _ => None,
        });
        let counts: Vec<Variable> = counts.collect();
        let mut host = MockHost::new(Vec::new(), [64, 48]);
        let mut stretches = |first: u32, last: u32| {
            host.variables.extend([(Variable(1), first), (Variable(0), last)]);
            (step.run)(&mut host).unwrap();
            let stretches = step.writes.iter().zip(&counts).map(|(stretch, count)| match host.variable(*count) {
                0 => [0; 2],
                count => {
                    let [first, listed, ..] = *bytemuck::cast_slice::<_, u32>(host.read(*stretch)) else { panic!("a stretch") };
                    assert_eq!(count, listed);
                    [first, count]
                }
            });
            stretches.collect::<Vec<_>>()
        };
        assert_eq!(stretches(10, 40_000), [[10, 32_768], [32_778, 7222], [0; 2]]);
        assert_eq!(stretches(0, 70_000), [[0, 32_768], [32_768, 32_768], [65_536, 4464]]);
        assert_eq!(stretches(500, 500), [[0; 2]; 3]);
    }
}
