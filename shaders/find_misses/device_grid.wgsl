#import lib/random
#import lib/record
#import lib/search

// Pixels that need a record, from coarse cells to fine ones: at most one a cell, and only every second cell along
// each axis in a round, so that the records of a batch stand at least a cell apart.

@group(0) @binding(0) var<uniform> grid: Round;
@group(0) @binding(1) var position: texture_2d<f32>;
@group(0) @binding(2) var normal: texture_2d<f32>;
@group(0) @binding(3) var sums: texture_2d<f32>;
// Per block of 2×2 cells: pixel index + 1 of the cell's request, or 0.
@group(0) @binding(4) var<storage, read_write> candidates: array<u32>;
// Requests made, candidates found, one past the last block that was served, pixels of the batch before that miss a record still, and whether any pixel
// missed one as the loop started.
@group(0) @binding(5) var<storage, read_write> counts: array<u32, 5>;
@group(0) @binding(6) var<storage, read_write> requests: array<Request>;
// Pixel index + 1 of each request.
@group(0) @binding(7) var<storage, read_write> picked: array<u32>;

@group(0) @binding(8) var<storage, read_write> any_missing: atomic<u32>;

// A pixel whose weights add up to this or less misses a record.
override OVERLAP: f32 = 0.0;

const NONE = 0xffffffffu;

var<workgroup> best: array<u32, 64>;

// Of the picture [pixels].
fn size() -> vec2u {
    return textureDimensions(position);
}

fn pixel_of(candidate: u32) -> vec2u {
    let width = size().x;
    return vec2u((candidate - 1u) % width, (candidate - 1u) / width);
}

fn candidate_of(pixel: vec2u) -> u32 {
    return pixel.y * size().x + pixel.x + 1u;
}

fn blocks() -> vec2u {
    return (size() + 2u * grid.cell - 1u) / (2u * grid.cell);
}

// A pixel of a cell; its edge is a power of two.
fn in_cell(i: u32) -> vec2u {
    return vec2u(i & (grid.cell - 1u), i >> firstTrailingBit(grid.cell));
}

// Order in which the misses of a cell are served: from its middle outwards. 0 is first; the low bits say where.
fn rank(local: vec2u) -> u32 {
    let d = vec2i(2u * local + 1u) - i32(grid.cell);
    return u32(d.x * d.x + d.y * d.y) << 12u | local.y << 6u | local.x;
}

fn misses(pixel: vec2u) -> bool {
    return textureLoad(position, pixel, 0).w > 0.0 && textureLoad(sums, pixel, 0).w <= OVERLAP;
}

// Looks at all pixels.
@compute @workgroup_size(64)
fn look_over(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = (group.x + group.y * groups.x) * 64u + lane;
    let across = size();
    if index < across.x * across.y && misses(pixel_of(index + 1u)) {
        atomicStore(&any_missing, 1u);
    }
}

// One workgroup of 64 lanes a cell.
@compute @workgroup_size(64)
fn search(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let count = blocks();
    let block = group.x + group.y * groups.x;
    var found = NONE;
    let cell = vec2u(block % count.x, block / count.x) * 2u + vec2u(grid.phase & 1u, grid.phase >> 1u);
    if block >= grid.start && block < count.x * count.y {
        for (var i = lane; i < grid.cell * grid.cell; i += 64u) {
            let local = in_cell(i);
            let pixel = cell * grid.cell + local;
            if all(pixel < size()) && misses(pixel) {
                found = min(found, rank(local));
            }
        }
    }
    best[lane] = found;
    for (var half = 32u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            best[lane] = min(best[lane], best[lane + half]);
        }
    }
    if lane == 0u && block < count.x * count.y {
        let first = best[0];
        let pixel = cell * grid.cell + vec2u(first & 63u, first >> 6u & 63u);
        candidates[block] = select(candidate_of(pixel), 0u, first == NONE);
    }
}

// Small cells: one lane a cell, without waiting for others.
@compute @workgroup_size(64)
fn search_small(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let count = blocks();
    let block = (group.x + group.y * groups.x) * 64u + lane;
    if block < grid.start || block >= count.x * count.y {
        return;
    }
    let cell = vec2u(block % count.x, block / count.x) * 2u + vec2u(grid.phase & 1u, grid.phase >> 1u);
    var candidate = 0u;
    var found = NONE;
    for (var i = 0u; i < grid.cell * grid.cell; i++) {
        let local = in_cell(i);
        let pixel = cell * grid.cell + local;
        if all(pixel < size()) && rank(local) < found && misses(pixel) {
            found = rank(local);
            candidate = candidate_of(pixel);
        }
    }
    candidates[block] = candidate;
}

// How many pixels of the batch before miss a record still, of those that a lane looks at.
fn uncovered(lane: u32) -> u32 {
    var missing = 0u;
    for (var i = lane; i < counts[0]; i += 256u) {
        missing += u32(textureLoad(sums, pixel_of(picked[i]), 0).w <= OVERLAP);
    }
    return missing;
}

var<workgroup> starts: array<u32, 256>;
var<workgroup> missing: atomic<u32>;

// Picks candidates in their order, so that every run picks the same: one workgroup, each lane a stretch.
@compute @workgroup_size(256)
fn collect(@builtin(local_invocation_index) lane: u32) {
    let count = blocks();
    let total = count.x * count.y;
    let stretch = (total + 255u) / 256u;
    let first = clamp(lane * stretch, grid.start, total);
    let last = clamp(lane * stretch + stretch, grid.start, total);
    var mine = 0u;
    for (var i = first; i < last; i++) {
        mine += select(0u, 1u, candidates[i] != 0u);
    }
    starts[lane] = mine;
    atomicAdd(&missing, uncovered(lane));
    // What the batch before picked has been looked at once all lanes are here.
    storageBarrier();
    workgroupBarrier();
    for (var step = 1u; step < 256u; step *= 2u) {
        let before = select(0u, starts[max(lane, step) - step], lane >= step);
        workgroupBarrier();
        starts[lane] += before;
        workgroupBarrier();
    }
    let before = starts[lane] - mine;
    var slot = before;
    var next = first;
    for (; next < last && slot < grid.capacity; next++) {
        let candidate = candidates[next];
        if candidate != 0u {
            picked[slot] = candidate;
            slot += 1u;
        }
    }
    if before < slot && slot == grid.capacity {
        counts[2] = next;
    }
    if lane == 255u {
        counts[0] = min(starts[255], grid.capacity);
        counts[1] = starts[255];
        counts[3] = atomicLoad(&missing);
        counts[4] = atomicLoad(&any_missing);
    }
}

// Turns what is picked into requests.
@compute @workgroup_size(64)
fn ask(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= counts[0] {
        return;
    }
    let candidate = picked[id.x];
    let pixel = pixel_of(candidate);
    let place = textureLoad(position, pixel, 0);
    requests[id.x] = Request(place.xyz, place.w, textureLoad(normal, pixel, 0).xyz, 6.2831853 * unit(hash(candidate)));
}
