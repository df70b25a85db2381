#import lib/record
#import lib/variables

// Appends a batch of records to the cache.

struct Batch {
    // Records in the cache before, records in the batch.
    first: u32,
    count: u32,
    padding_a: u32,
    padding_b: u32,
}

@group(0) @binding(0) var<uniform> batch: Batch;
@group(0) @binding(1) var<uniform> weighting: Weighting;
@group(0) @binding(2) var<storage, read> records: array<Record>;
@group(0) @binding(3) var<storage, read_write> cache: array<Record>;
// Records that an earlier one of their batch would have covered.
@group(0) @binding(4) var<storage, read_write> surplus: array<atomic<u32>, 4>;

// Luminance of the picture's irradiance.
@group(0) @binding(5) var<storage, read_write> level: array<f32, 4>;

// Of each new record, and of all: numbers of four coefficients.
@group(0) @binding(6) var<storage, read> new_coefficients: array<vec4f>;
// As bits: two pairs, or one of half floats.
@group(0) @binding(7) var<storage, read_write> coefficients: array<vec2u>;

// The batch, as the device itself makes room for it.
@group(0) @binding(8) var<storage, read_write> reserved: Batch;

// Most records, and where variables stand.
override CAPACITY: u32 = 1u;
override NEW: u32 = 0u;
override RECORDS: u32 = 0u;
override ADDED: u32 = 0u;

override COEFFICIENTS: u32 = 1u;
override HALF: bool = false;
// Whether the radius may not jump over what a neighbour has seen (Křivánek 2006).
override NEIGHBOUR_CLAMPING: bool = true;
// Whether to look at each record's batch: where there is only one, it may hold all records, and nothing depends on it.
override COUNTS_SURPLUS: bool = true;

// The first records tell what the picture's irradiance is: they stand far apart.
const FIRST = 256u;

var<workgroup> parts: array<f32, FIRST>;

// Makes room at the cache's end, where the device drives the loop.
@compute @workgroup_size(1)
fn reserve() {
    let first = variables[RECORDS];
    let count = min(variables[NEW], CAPACITY - first);
    reserved = Batch(first, count, 0u, 0u);
    variables[ADDED] = count;
    variables[RECORDS] = first + count;
}

@compute @workgroup_size(256)
fn measure(@builtin(local_invocation_index) lane: u32) {
    let known = min(batch.first + batch.count, FIRST);
    var light = vec3f(0.0);
    if lane < min(batch.first, known) {
        light = cache[lane].irradiance;
    } else if lane < known {
        light = records[lane - batch.first].irradiance;
    }
    parts[lane] = luminance(light) / f32(max(known, 1u));
    for (var half = FIRST / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            parts[lane] += parts[lane + half];
        }
    }
    if lane == 0u {
        level[0] = parts[0];
    }
}

fn refined(record: Record) -> Record {
    var finer = record;
    finer.translation[1].w = fineness(record, weighting, level[0]);
    return finer;
}

// As bits, which stand in the order of the numbers, as none is negative.
var<workgroup> radius: atomic<u32>;
var<workgroup> is_covered: atomic<u32>;

// One workgroup a record.
@compute @workgroup_size(64)
fn append(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = group.x + group.y * groups.x;
    if index >= batch.count {
        return;
    }
    var record = records[index];
    if NEIGHBOUR_CLAMPING {
        if lane == 0u {
            atomicStore(&radius, bitcast<u32>(record.radius));
        }
        workgroupBarrier();
        for (var i = lane; i < batch.first; i += 64u) {
            let other = cache[i];
            if dot(other.normal, record.normal) > 0.7 {
                atomicMin(&radius, bitcast<u32>(min(record.radius, other.radius + distance(other.position, record.position))));
            }
        }
        workgroupBarrier();
        record.radius = bitcast<f32>(atomicLoad(&radius));
    }
    if COUNTS_SURPLUS {
        for (var i = lane; i < index; i += 64u) {
            if record_weight(refined(records[i]), weighting, record.position, record.normal) > weighting.overlap {
                atomicStore(&is_covered, 1u);
                break;
            }
        }
        workgroupBarrier();
    }
    if lane == 0u {
        cache[batch.first + index] = refined(record);
        atomicAdd(&surplus[0], atomicLoad(&is_covered));
    }
}

// The largest half float.
const MOST_HALF = vec4f(65504.0);

fn keep(at: u32, four: vec4f, unit: f32) {
    if HALF {
        let bounded = clamp(four / unit, -MOST_HALF, MOST_HALF);
        coefficients[at] = vec2u(pack2x16float(bounded.xy), pack2x16float(bounded.zw));
    } else {
        coefficients[2u * at] = bitcast<vec2u>(four.xy);
        coefficients[2u * at + 1u] = bitcast<vec2u>(four.zw);
    }
}

@compute @workgroup_size(64)
fn append_coefficients(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let per = (COEFFICIENTS + 63u) / 64u;
    let linear = group.x + group.y * groups.x;
    let index = (linear % per) * 64u + lane;
    let record = linear / per;
    if record < batch.count && index < COEFFICIENTS {
        let units = half_units(records[record]);
        // A third of them are expansions, the rest derivatives.
        let unit = select(units.y, units.x, 3u * index < COEFFICIENTS);
        keep((batch.first + record) * COEFFICIENTS + index, new_coefficients[record * COEFFICIENTS + index], unit);
    }
}
