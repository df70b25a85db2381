#import lib/record
#import lib/record_cells

// Builds an index over records: as math::record_index does, which tells what it is.

@group(0) @binding(0) var<uniform> weighting: Weighting;
@group(0) @binding(1) var<storage, read> records: array<Record>;
// As lib/irradiance_field/records reads it. As its steps begin, the header tells the number of hashes and that of the records.
@group(0) @binding(2) var<storage, read_write> words: array<atomic<u32>>;
// Records by the exponent of the edge of the cells that they are listed in, from BIAS on.
@group(0) @binding(3) var<storage, read_write> held: array<atomic<u32>, 256>;

// Where the lists' header and their entries start [words].
override INDEX_LISTS: u32 = 0u;
override INDEX_ENTRIES: u32 = 8u;
override INDEX_RECORDS: u32 = 16u;
// Whether lists are those of small cells, in parts of which a record counts; otherwise those that its reach touches are two to four times as wide as it.
override NEAR: bool = false;
// How far above its plane a record may count, over how far it reaches.
override STEEPEST: f32 = 1.0;
const INDEX_HEADER = 4u;
const LEVEL_BIT = 24u;
const LEVELS = 24u;
const FEW = 16u;
const BIAS = 128;
const EXPONENTS = 256u;
// For what devices round differently.
const LONGER = 1.0001;

fn record_count() -> u32 {
    return atomicLoad(&words[INDEX_LISTS + 3u]);
}

fn hash_count() -> u32 {
    return atomicLoad(&words[INDEX_LISTS + 2u]);
}

fn touched_radius(record: Record) -> f32 {
    return longest_validity_radius(record, weighting) * LONGER;
}

// The exponent of the least power of two that is no less than a number.
fn exponent(number: f32) -> i32 {
    let bits = bitcast<u32>(clamp(number, 1e-30, 1e30));
    return i32(bits >> 23u) - 127 + select(0, 1, (bits & 0x7fffffu) != 0u);
}

// Of the cells that a record of some reach is listed in.
fn edge_exponent(radius: f32) -> i32 {
    return exponent(select(2.0, 1.0, NEAR) * radius);
}

@compute @workgroup_size(64)
fn measure(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let number = (group.x + group.y * groups.x) * 64u + lane;
    if number >= record_count() {
        return;
    }
    atomicAdd(&held[edge_exponent(touched_radius(records[number])) + BIAS], 1u);
}

var<workgroup> shared_held: array<u32, 256>;

// As Levels::of.
@compute @workgroup_size(256)
fn tell_levels(@builtin(local_invocation_index) lane: u32) {
    shared_held[lane] = atomicLoad(&held[lane]);
    workgroupBarrier();
    let all = record_count();
    if lane > 0u || all == 0u {
        return;
    }
    var highest = 0u;
    for (var at = 0u; at < EXPONENTS; at++) {
        highest = select(highest, at, shared_held[at] > 0u);
    }
    // Those of the smallest cells and of none that are so small.
    let lowest = max(highest, LEVELS) - LEVELS + 1u;
    var there = 0u;
    var waiting = 0u;
    for (var at = 0u; at <= highest; at++) {
        waiting += shared_held[at];
        if at >= lowest && (at == highest || waiting * FEW >= all) {
            there |= 1u << (at - lowest);
            waiting = 0u;
        }
    }
    let first = countTrailingZeros(there);
    atomicStore(&words[INDEX_LISTS], bitcast<u32>(i32(lowest + first) - BIAS));
    atomicStore(&words[INDEX_LISTS + 1u], there >> first);
}

// The hashes of the cells that a record is listed in, each once.
struct Touched {
    count: u32,
    level: u32,
    hashes: array<u32, 27>,
}

fn touched(record: Record) -> Touched {
    let radius = touched_radius(record);
    let lowest = bitcast<i32>(atomicLoad(&words[INDEX_LISTS]));
    let least = u32(max(edge_exponent(radius) - lowest, 0));
    var all: Touched;
    all.level = least + countTrailingZeros(atomicLoad(&words[INDEX_LISTS + 1u]) >> least);
    let low = cell_of(record.position - radius, lowest) >> vec3u(all.level);
    let high = cell_of(record.position + radius, lowest) >> vec3u(all.level);
    let edge = bitcast<f32>(u32(127 + lowest + i32(all.level)) << 23u);
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                let cell = vec3i(x, y, z);
                let hashed = cell_hash(cell, all.level, hash_count());
                var is_new = all.count < select(8u, 27u, NEAR) && (!NEAR || counts_within(record, radius, (vec3f(cell) + 0.5) * edge, 0.5 * edge));
                for (var i = 0u; i < all.count; i++) {
                    is_new = is_new && all.hashes[i] != hashed;
                }
                if is_new {
                    all.hashes[all.count] = hashed;
                    all.count++;
                }
            }
        }
    }
    return all;
}

// Whether a record may count somewhere in a cell: as Region::touches of math::record_tree.
fn counts_within(record: Record, radius: f32, middle: vec3f, half_edge: f32) -> bool {
    let half = half_edge * 1.001 + 4e-7 * abs(middle);
    let offset = middle - record.position;
    let outside = max(abs(offset) - half, vec3f(0.0));
    let above = abs(dot(offset, record.normal)) - dot(half, abs(record.normal));
    return dot(outside, outside) <= radius * radius && above <= radius * STEEPEST;
}

@compute @workgroup_size(64)
fn count(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let number = (group.x + group.y * groups.x) * 64u + lane;
    if number >= record_count() {
        return;
    }
    let all = touched(records[number]);
    for (var i = 0u; i < all.count; i++) {
        atomicAdd(&words[INDEX_LISTS + INDEX_HEADER + all.hashes[i]], 1u);
    }
}

// Each list's start moves to its end as it is filled.
@compute @workgroup_size(64)
fn list(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let number = (group.x + group.y * groups.x) * 64u + lane;
    if number >= record_count() {
        return;
    }
    let all = touched(records[number]);
    for (var i = 0u; i < all.count; i++) {
        let at = atomicAdd(&words[INDEX_LISTS + INDEX_HEADER + all.hashes[i]], 1u);
        atomicStore(&words[INDEX_ENTRIES + at], number | (all.level << LEVEL_BIT));
    }
}

@compute @workgroup_size(64)
fn keep_records(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let number = (group.x + group.y * groups.x) * 64u + lane;
    if number >= record_count() {
        return;
    }
    let record = records[number];
    keep(number, 0u, vec4f(record.position, record.radius));
    keep(number, 1u, vec4f(record.normal, record.minimum_distance));
    keep(number, 2u, vec4f(record.irradiance, record.footprint));
    for (var i = 0u; i < 3u; i++) {
        keep(number, 3u + i, record.rotation[i]);
        keep(number, 6u + i, record.translation[i]);
    }
    keep(number, 9u, vec4f(record.error, 0.0));
}

fn keep(number: u32, part: u32, value: vec4f) {
    let at = INDEX_RECORDS + 40u * number + 4u * part;
    for (var i = 0u; i < 4u; i++) {
        atomicStore(&words[at + i], bitcast<u32>(value[i]));
    }
}

// Lists in the order of the records, so that sums over them are the same each time.
@compute @workgroup_size(64)
fn sort(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let hashed = (group.x + group.y * groups.x) * 64u + lane;
    if hashed >= hash_count() {
        return;
    }
    var first = 0u;
    if hashed > 0u {
        first = atomicLoad(&words[INDEX_LISTS + INDEX_HEADER + hashed - 1u]);
    }
    let end = atomicLoad(&words[INDEX_LISTS + INDEX_HEADER + hashed]);
    let mask = (1u << LEVEL_BIT) - 1u;
    for (var i = first + 1u; i < end; i++) {
        let entry = atomicLoad(&words[INDEX_ENTRIES + i]);
        var at = i;
        while at > first {
            let other = atomicLoad(&words[INDEX_ENTRIES + at - 1u]);
            if (other & mask) <= (entry & mask) {
                break;
            }
            atomicStore(&words[INDEX_ENTRIES + at], other);
            at--;
        }
        atomicStore(&words[INDEX_ENTRIES + at], entry);
    }
}

var<workgroup> shared_light: array<f32, 256>;

// The sum of the records' luminance, in a fixed order.
@group(0) @binding(4) var<storage, read_write> light: array<f32, 4>;

@compute @workgroup_size(256)
fn add_light(@builtin(local_invocation_index) lane: u32) {
    var sum = 0.0;
    for (var number = lane; number < record_count(); number += 256u) {
        sum += luminance(records[number].irradiance);
    }
    shared_light[lane] = sum;
    workgroupBarrier();
    for (var step = 128u; step > 0u; step /= 2u) {
        if lane < step {
            shared_light[lane] += shared_light[lane + step];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        light[0] = shared_light[0];
    }
}
