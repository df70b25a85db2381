// Sorts pairs of a key and a value by their keys, in the order that they have where keys are the same: a digit after the other, from the lowest.

@group(0) @binding(0) var<storage, read> unsorted: array<vec2u>;
@group(0) @binding(1) var<storage, read_write> sorted: array<vec2u>;
// Of each digit, how many pairs of each block have it; then of all before them.
@group(0) @binding(2) var<storage, read_write> counts: array<u32>;
// How many pairs there are.
@group(0) @binding(3) var<storage, read> sizes: array<u32>;

override COUNT_AT: u32 = 0u;
// Blocks that there is room for.
override BLOCKS: u32 = 1u;
// The lowest bit of the digit.
override SHIFT: u32 = 0u;

const DIGITS = 64u;
const LANES = 64u;
// Pairs of a lane.
const RUN = 16u;

// Of each digit and lane, how many of the lane's pairs have the digit.
var<workgroup> lane_counts: array<u32, 4096>;

fn digit_of(pair: vec2u) -> u32 {
    return (pair.x >> SHIFT) & (DIGITS - 1u);
}

fn count_run(block: u32, lane: u32) {
    for (var digit = 0u; digit < DIGITS; digit++) {
        lane_counts[digit * LANES + lane] = 0u;
    }
    let first = (block * LANES + lane) * RUN;
    for (var at = first; at < min(first + RUN, sizes[COUNT_AT]); at++) {
        lane_counts[digit_of(unsorted[at]) * LANES + lane] += 1u;
    }
    workgroupBarrier();
}

@compute @workgroup_size(64)
fn count_digits(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group.x + group.y * groups.x;
    count_run(block, lane);
    // A lane a digit from here on.
    var sum = 0u;
    for (var other = 0u; other < LANES; other++) {
        sum += lane_counts[lane * LANES + other];
    }
    if block < BLOCKS {
        counts[lane * BLOCKS + block] = sum;
    }
}

@compute @workgroup_size(64)
fn scatter(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group.x + group.y * groups.x;
    count_run(block, lane);
    var sum = counts[lane * BLOCKS + min(block, BLOCKS - 1u)];
    for (var other = 0u; other < LANES; other++) {
        let own = lane_counts[lane * LANES + other];
        lane_counts[lane * LANES + other] = sum;
        sum += own;
    }
    workgroupBarrier();
    let first = (block * LANES + lane) * RUN;
    for (var at = first; at < min(first + RUN, sizes[COUNT_AT]); at++) {
        let pair = unsorted[at];
        let digit = digit_of(pair);
        sorted[lane_counts[digit * LANES + lane]] = pair;
        lane_counts[digit * LANES + lane] += 1u;
    }
}
