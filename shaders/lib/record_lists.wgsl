#import lib/record_cells

// Lists of records by the cells that they reach, as shaders/record_index makes them: which records may count at a point? The header tells the exponent of the smallest
// cells' edge, a bit for each level, hashes and records; then come where the list of each hash ends, and the lists.
@group(0) @binding(22) var<storage, read> record_lists: array<u32>;

override LIST_ENTRIES: u32 = 8u;
const LIST_HEADER = 4u;
const LIST_LEVEL_BIT = 24u;

struct RecordList {
    first: u32,
    end: u32,
    level: u32,
}

fn listed_count() -> u32 {
    return record_lists[3];
}

// Of the cell of a level that a point is in.
fn record_list(position: vec3f, level: u32) -> RecordList {
    let cell = cell_of(position, bitcast<i32>(record_lists[0])) >> vec3u(level);
    let at = LIST_HEADER + cell_hash(cell, level, record_lists[2]);
    return RecordList(select(record_lists[at - 1u], 0u, at == LIST_HEADER), record_lists[at], level);
}

struct ListedRecord {
    number: u32,
    // Whether it is of this list: others have the same hash.
    is_of_list: bool,
}

fn listed_record(list: RecordList, at: u32) -> ListedRecord {
    let entry = record_lists[LIST_ENTRIES + at];
    return ListedRecord(entry & ((1u << LIST_LEVEL_BIT) - 1u), entry >> LIST_LEVEL_BIT == list.level);
}
