#import lib/photon_map

// Puts photons into the map: by the cells that they are in, with the table of cells and the size of cells that lookups begin with.

@group(0) @binding(0) var<storage, read> photons: array<Photon>;
// The cell of each photon, and its number among `photons`.
@group(0) @binding(1) var<storage, read_write> pairs: array<vec2u>;
@group(0) @binding(2) var<storage, read> totals: array<u32>;
// The head and the table a word each; eight words a photon.
@group(0) @binding(3) var<storage, read_write> words: array<u32>;
// Of each size of cells, how many cells of that size have photons, and not those that are larger.
@group(0) @binding(4) var<storage, read_write> entered: array<atomic<u32>, 16>;

// The cube around the scene.
override CORNER_X: f32 = 0.0;
override CORNER_Y: f32 = 0.0;
override CORNER_Z: f32 = 0.0;
override CELLS_PER_UNIT: f32 = 1.0;

const LEVELS = BITS + 1u;
// Photons that lookups mostly ask for.
const USUAL = 64u;
const COUNT = 1u;

fn own_head() -> MapHead {
    return MapHead(vec3f(CORNER_X, CORNER_Y, CORNER_Z), CELLS_PER_UNIT, totals[COUNT], 0u, 0u, 0u);
}

fn linear_lane(group: vec3u, groups: vec3u, lane: u32) -> u32 {
    return (group.x + group.y * groups.x) * 64u + lane;
}

@compute @workgroup_size(64)
fn code(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let number = linear_lane(group, groups, lane);
    if number < totals[COUNT] {
        pairs[number] = vec2u(code_of(own_head(), photons[number].position), number);
    }
}

var<workgroup> entered_here: array<atomic<u32>, 16>;

// A lane a photon of the map: moves it there, and notes from which size of cells on it is in that of the one before it.
@compute @workgroup_size(64)
fn gather(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let number = linear_lane(group, groups, lane);
    if number < totals[COUNT] {
        let pair = pairs[number];
        move_photon(photons[pair.y], 8u * (SLOTS_BEFORE + number));
        var level = LEVELS;
        if number > 0u {
            level = (34u - countLeadingZeros(pair.x ^ pairs[number - 1u].x)) / 3u;
        }
        atomicAdd(&entered_here[level], 1u);
    }
    workgroupBarrier();
    if lane < 16u {
        atomicAdd(&entered[lane], atomicLoad(&entered_here[lane]));
    }
}

fn move_photon(photon: Photon, at: u32) {
    words[at] = bitcast<u32>(photon.position.x);
    words[at + 1u] = bitcast<u32>(photon.position.y);
    words[at + 2u] = bitcast<u32>(photon.position.z);
    words[at + 3u] = bitcast<u32>(photon.leg);
    words[at + 4u] = bitcast<u32>(photon.flux.x);
    words[at + 5u] = bitcast<u32>(photon.flux.y);
    words[at + 6u] = bitcast<u32>(photon.flux.z);
    words[at + 7u] = photon.ways;
}

// A lane a cell of the table: its first photon.
@compute @workgroup_size(64)
fn tabulate(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let cell = linear_lane(group, groups, lane);
    if cell > (1u << (3u * BITS - TABLE_BITS)) {
        return;
    }
    var low = 0u;
    var high = totals[COUNT];
    while low < high {
        let middle = (low + high) / 2u;
        if pairs[middle].x < cell << TABLE_BITS {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    words[HEAD_WORDS + cell] = low;
}

// As usual_level of passes/photons/lookup.rs.
fn usual_level() -> u32 {
    var cells = 0u;
    for (var level = 0u; level < LEVELS; level++) {
        cells += atomicLoad(&entered[LEVELS - level]);
    }
    for (var level = 0u; level < BITS; level++) {
        if 4u * totals[COUNT] >= CROWD * USUAL * cells {
            return level;
        }
        cells -= atomicLoad(&entered[level + 1u]);
    }
    return BITS;
}

@compute @workgroup_size(1)
fn tell_head() {
    words[0] = bitcast<u32>(CORNER_X);
    words[1] = bitcast<u32>(CORNER_Y);
    words[2] = bitcast<u32>(CORNER_Z);
    words[3] = bitcast<u32>(CELLS_PER_UNIT);
    words[4] = totals[COUNT];
    words[5] = usual_level();
    words[6] = 0u;
    words[7] = 0u;
}
