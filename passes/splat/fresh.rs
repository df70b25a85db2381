//! Records that the sums do not have yet, in stretches for the device.

use super::Work;
use crate::contract::Encoder;
use crate::passes::record::Stretch;
use crate::schedule::*;

/// Records of one stretch: a [`Stretch`], and how many they are.
pub(super) type Fresh = (Resource, Variable);

/// Encodes a step that splits up the records to be splatted, `most` a stretch, and takes them for splatted: outside of a fill all of them each time.
pub(super) fn encode(e: &mut Encoder<'_>, work: &Work, most: u32) -> Vec<Fresh> {
    let count = work.cache.capacity.div_ceil(most);
    let buffers: Vec<_> = (0..count).map(|i| e.buffer(&format!("stretch{i}"), size_of::<Stretch>() as u64)).collect();
    // One after the other, as the device counts them from the first on.
    let counts: Vec<_> = (0..count).map(|i| e.variable(&format!("count{i}"), false)).collect();
    let next = e.variable("next", false);
    let stretches: Vec<Fresh> = buffers.iter().copied().zip(counts).collect();
    let (first, all, in_fill) = (work.first, work.cache.count, e.batch.is_some());
    let twin = twin(work, most, &stretches, next);
    let list = stretches.clone();
    let run = move |host: &mut dyn HostContext| {
        let (mut from, last) = (if in_fill { host.variable(first) } else { 0 }, host.variable(all));
        for &(stretch, records) in &list {
            let count = last.saturating_sub(from).min(most);
            host.set(records, count);
            if count > 0 {
                host.write(stretch, 0, bytemuck::bytes_of(&Stretch { first: from, count, padding_a: 0, padding_b: 0 }));
            }
            from += count;
        }
        host.set(first, last);
        Ok(())
    };
    e.twin("fresh", &[], &buffers, run, twin);
    stretches
}

/// One dispatch a stretch, which takes up where the one before has ended.
fn twin(work: &Work, most: u32, stretches: &[Fresh], next: Variable) -> Vec<Compute> {
    let program = Program::new("splat/fresh").constant("MOST", most).constant("STRETCHES", stretches.len() as u32);
    let program = program.variable("ALL", work.cache.count).variable("FIRST", work.first).variable("NEXT", next).variable("COUNTS", stretches[0].1);
    let fresh = |(stretch, _): &Fresh| Compute { program: program.clone().bind("fresh_stretch", *stretch), entry: "fresh", groups: Groups::ONE };
    stretches.iter().map(fresh).collect()
}
