//! Lists of records by the cells that they reach, made on the device: `shaders/record_index.wgsl`.

use super::prefix_sum;
use crate::contract::Encoder;
use crate::math::record_index::{HEADER, Layout, Levels};
use crate::schedule::*;

/// Powers of two that the shader counts records by.
const EXPONENTS: u64 = 256;

/// Lists of records by the cells that their reaches touch, as a program reads them that imports `lib/record_lists`.
pub struct RecordLists {
    words: Resource,
    layout: Layout,
}

impl RecordLists {
    /// Commands of the device that list the first records of a buffer, `count` of them and at most `capacity`.
    pub fn encode(e: &mut Encoder<'_>, records: Resource, weighting: Resource, count: Variable, capacity: u32) -> Self {
        let layout = Layout::of(capacity as usize);
        let words = e.buffer("lists", 4 * layout.records as u64);
        let [lists, listed] = ["lists", "listed"].map(|name| e.variable(name, false));
        e.clear(words);
        let twin = Program::new("record_lists").constant("HASHES", layout.hashes as u32).bind("header", words);
        let twin = twin.variable("RECORDS", count).variable("LISTED", listed).variable("LISTS", lists);
        let begin = move |host: &mut dyn HostContext| {
            let count = host.variable(count);
            host.set(lists, 1);
            host.set(listed, count);
            host.write(words, 0, bytemuck::cast_slice(&Levels::NONE.header(layout.hashes, count)));
            Ok(())
        };
        e.twin("begin_lists", &[], &[words], begin, vec![Compute { program: twin, entry: "begin", groups: Groups::ONE }]);
        let program = Program::new("record_index").constant("INDEX_ENTRIES", layout.entries as u32);
        let program = program.bind("weighting", weighting).bind("records", records).bind("words", words);
        make_lists(e, program, (words, HEADER, layout.hashes), [lists, listed]);
        Self { words, layout }
    }

    pub fn bind(&self, program: Program) -> Program {
        program.constant("LIST_ENTRIES", self.layout.entries as u32).bind("record_lists", self.words)
    }
}

/// In rounds in which `lists` is 1 and `listed` the number of records. The lists' ends are told by where they start, and how many there are.
pub fn make_lists(e: &mut Encoder<'_>, program: Program, (words, first, hashes): (Resource, usize, usize), [lists, listed]: [Variable; 2]) {
    let held = e.buffer("held", 4 * EXPONENTS);
    e.clear(held);
    let program = program.bind("held", held);
    let each_record = Groups::Counted { count: listed, divisor: 64, per: 1 };
    let each_list = |groups| Groups::Counted { count: lists, divisor: 1, per: groups };
    e.compute(program.clone(), "measure", each_record);
    e.compute(program.clone(), "tell_levels", each_list(1));
    e.compute(program.clone(), "count", each_record);
    prefix_sum::encode(e, words, first as u32, hashes as u32, Some(lists));
    e.compute(program.clone(), "list", each_record);
    e.compute(program, "sort", each_list((hashes as u32).div_ceil(64)));
}
