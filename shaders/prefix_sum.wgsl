// Numbers of a buffer become the sums of those before them: sums within blocks, then over blocks, then both added.

@group(0) @binding(0) var<storage, read_write> numbers: array<u32>;
// Of each block.
@group(0) @binding(1) var<storage, read_write> blocks: array<u32>;

// Where the numbers start in their buffer, and how many there are.
override FIRST: u32 = 0u;
override COUNT: u32 = 1024u;

const LANES = 256u;
// Numbers of a lane.
const RUN = 4u;
const BLOCK = 1024u;

var<workgroup> shared_sums: array<u32, 256>;

// The sum of what the lanes before this one bring.
fn before(lane: u32, own: u32) -> u32 {
    shared_sums[lane] = own;
    workgroupBarrier();
    for (var step = 1u; step < LANES; step *= 2u) {
        var more = 0u;
        if lane >= step {
            more = shared_sums[lane - step];
        }
        workgroupBarrier();
        shared_sums[lane] += more;
        workgroupBarrier();
    }
    return shared_sums[lane] - own;
}

@compute @workgroup_size(256)
fn sum_within_blocks(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group.x + group.y * groups.x;
    let first = block * BLOCK + lane * RUN;
    var run: array<u32, 4>;
    var own = 0u;
    for (var i = 0u; i < RUN; i++) {
        if first + i < COUNT {
            run[i] = numbers[FIRST + first + i];
        }
        own += run[i];
    }
    var sum = before(lane, own);
    for (var i = 0u; i < RUN; i++) {
        if first + i < COUNT {
            numbers[FIRST + first + i] = sum;
        }
        sum += run[i];
    }
    if lane == LANES - 1u && block * BLOCK < COUNT {
        blocks[block] = sum;
    }
}

// One workgroup, a stretch of blocks after the other.
@compute @workgroup_size(256)
fn sum_over_blocks(@builtin(local_invocation_index) lane: u32) {
    let all = (COUNT + BLOCK - 1u) / BLOCK;
    var carried = 0u;
    for (var start = 0u; start < all; start += LANES) {
        let block = start + lane;
        var own = 0u;
        if block < all {
            own = blocks[block];
        }
        let sum = before(lane, own);
        if block < all {
            blocks[block] = carried + sum;
        }
        carried += shared_sums[LANES - 1u];
        workgroupBarrier();
    }
}

@compute @workgroup_size(256)
fn add_blocks(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group.x + group.y * groups.x;
    for (var i = 0u; i < RUN; i++) {
        let at = block * BLOCK + i * LANES + lane;
        if at < COUNT {
            numbers[FIRST + at] += blocks[block];
        }
    }
}
