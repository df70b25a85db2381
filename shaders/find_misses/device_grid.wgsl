#import lib/camera
#import lib/random
#import lib/record
#import lib/scene
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
// Of each 64 blocks how many are candidates, then how many there are in blocks before; 0 as a round begins.
@group(0) @binding(9) var<storage, read_write> tallies: array<atomic<u32>>;

@group(0) @binding(8) var<storage, read_write> any_missing: atomic<u32>;

// A pixel whose weights add up to this or less misses a record. A part of a pixel farther any weight will do.
override OVERLAP: f32 = 0.0;
// Of each pixel the triangle + 1 that it sees.
@group(0) @binding(10) var triangles: texture_2d<u32>;

// Whether the cache has the records of earlier samples of a picture.
override LASTS: bool = true;

const NONE = 0xffffffffu;

var<workgroup> best: array<u32, 64>;

// Of the picture [pixels].
fn size() -> vec2u {
    return textureDimensions(position);
}

// The plane's normal of what a pixel sees, as requests have it: as Work::face.
fn face_of(pixel: vec2u, place: vec3f) -> vec2u {
    if !(SMOOTH || NORMAL_MAPS) {
        return vec2u(0u);
    }
    let triangle = textureLoad(triangles, pixel, 0).x - 1u;
    let plane = cross(scene_corners[3u * triangle + 1u].xyz, scene_corners[3u * triangle + 2u].xyz);
    let face = plane * (select(-1.0, 1.0, dot(plane, place - camera.eye) <= 0.0) / max(length(plane), 1e-37));
    return vec2u(pack2x16snorm(face.xy), pack2x16snorm(vec2f(face.z, 0.0)));
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
    return (u32(d.x * d.x + d.y * d.y) << 12u) | (local.y << 6u) | local.x;
}

fn is_thin(pixel: vec2u) -> bool {
    return textureLoad(sums, pixel, 0).w <= select(OVERLAP, 0.0, LASTS && camera.sample > 0u);
}

fn misses(pixel: vec2u) -> bool {
    return textureLoad(position, pixel, 0).w > 0.0 && is_thin(pixel);
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
        let pixel = cell * grid.cell + vec2u(first & 63u, (first >> 6u) & 63u);
        note(block, select(candidate_of(pixel), 0u, first == NONE));
    }
}

// Keeps what the search in a block has come to.
fn note(block: u32, candidate: u32) {
    candidates[block] = candidate;
    if candidate != 0u {
        atomicAdd(&tallies[block / 64u], 1u);
    }
}

// Small cells: one lane a cell, without waiting for others.
@compute @workgroup_size(64)
fn search_small(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let count = blocks();
    let block = (group.x + group.y * groups.x) * 64u + lane;
    if block >= count.x * count.y {
        return;
    }
    let cell = vec2u(block % count.x, block / count.x) * 2u + vec2u(grid.phase & 1u, grid.phase >> 1u);
    var candidate = 0u;
    var found = NONE;
    let looked_at = select(grid.cell * grid.cell, 0u, block < grid.start);
    for (var i = 0u; i < looked_at; i++) {
        let local = in_cell(i);
        let pixel = cell * grid.cell + local;
        if all(pixel < size()) && rank(local) < found && misses(pixel) {
            found = rank(local);
            candidate = candidate_of(pixel);
        }
    }
    note(block, candidate);
}

// How many pixels of the batch before miss a record still, of those that a lane looks at.
fn uncovered(lane: u32) -> u32 {
    var missing = 0u;
    for (var i = lane; i < counts[0]; i += 256u) {
        missing += u32(is_thin(pixel_of(picked[i])));
    }
    return missing;
}

var<workgroup> totals: array<u32, 256>;
var<workgroup> missing: atomic<u32>;

// Adds up what the search has counted: one workgroup, 256 tallies at a time.
@compute @workgroup_size(256)
fn collect(@builtin(local_invocation_index) lane: u32) {
    atomicAdd(&missing, uncovered(lane));
    let count = blocks();
    let all = (count.x * count.y + 63u) / 64u;
    var before = 0u;
    for (var first = 0u; first < all; first += 256u) {
        let at = first + lane;
        var mine = 0u;
        if at < all {
            mine = atomicLoad(&tallies[at]);
        }
        totals[lane] = mine;
        for (var step = 1u; step < 256u; step *= 2u) {
            workgroupBarrier();
            let lower = select(0u, totals[max(lane, step) - step], lane >= step);
            workgroupBarrier();
            totals[lane] += lower;
        }
        if at < all {
            atomicStore(&tallies[at], before + totals[lane] - mine);
        }
        before += workgroupUniformLoad(&totals[255]);
    }
    // What the batch before picked has been looked at: all lanes have been here.
    if lane == 0u {
        counts[0] = min(before, grid.capacity);
        counts[1] = before;
        counts[3] = atomicLoad(&missing);
        counts[4] = atomicLoad(&any_missing);
    }
}

// Which of a workgroup's blocks are candidates.
var<workgroup> found_in: array<atomic<u32>, 2>;
var<workgroup> found_before: u32;

// Turns candidates into requests, as many as a batch holds, in their order, so that every run picks the same.
@compute @workgroup_size(64)
fn ask(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let count = blocks();
    let part = group.x + group.y * groups.x;
    let block = part * 64u + lane;
    var candidate = 0u;
    if block < count.x * count.y {
        candidate = candidates[block];
    }
    let bit = 1u << (lane % 32u);
    if candidate != 0u {
        atomicOr(&found_in[lane / 32u], bit);
    }
    if lane == 0u && block < count.x * count.y {
        found_before = atomicExchange(&tallies[part], 0u);
    }
    workgroupBarrier();
    let low = atomicLoad(&found_in[0]);
    let earlier = select(low & (bit - 1u), atomicLoad(&found_in[1]) & (bit - 1u), lane >= 32u);
    let slot = found_before + countOneBits(earlier) + select(0u, countOneBits(low), lane >= 32u);
    if candidate == 0u || slot >= grid.capacity {
        return;
    }
    if slot + 1u == grid.capacity {
        counts[2] = block + 1u;
    }
    picked[slot] = candidate;
    let pixel = pixel_of(candidate);
    let place = textureLoad(position, pixel, 0);
    requests[slot] = Request(place.xyz, place.w, textureLoad(normal, pixel, 0).xyz, 6.2831853 * unit(hash(candidate)), 0.0, 0.0, face_of(pixel, place.xyz));
}
