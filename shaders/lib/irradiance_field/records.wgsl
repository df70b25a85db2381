#import lib/record
#import lib/record_cells

// The irradiance at any point, from an index over records: as math::record_index.

// Exponent of the smallest cells' edge, a bit for each level, hashes, records; where the list of each hash ends; the lists; the records.
@group(0) @binding(20) var<storage, read> record_index: array<vec4u>;

// What the rule of the records says. No uniform, as shaders that know the scene, its first lights and the camera have as many as Mesa 22 stands.
override INDEX_ACCURACY: f32 = 1.0;
override INDEX_MINIMUM_SPACING: f32 = 1.0;
override INDEX_MAXIMUM_SPACING: f32 = 1.0;
override INDEX_NEAREST: f32 = 1e6;
override INDEX_CHANGE: f32 = 1e6;

// Where the near lists and their entries start [words].
override NEAR_HEADER: u32 = 0u;
override NEAR_ENTRIES: u32 = 8u;
// Where the lists and the records start [words].
override INDEX_ENTRIES: u32 = 8u;
override INDEX_RECORDS: u32 = 16u;
const INDEX_HEADER = 4u;
const LEVEL_BIT = 24u;

// Compact, without what only pictures ask for.
fn index_weighting() -> Weighting {
    return Weighting(INDEX_ACCURACY, INDEX_MINIMUM_SPACING, INDEX_MAXIMUM_SPACING, 2u, INDEX_NEAREST, INDEX_CHANGE, 0.0, 0.0, 0.0, 0u, 0u, 0u);
}

fn index_word(at: u32) -> u32 {
    return record_index[at / 4u][at % 4u];
}

fn indexed_record(number: u32) -> Record {
    let at = INDEX_RECORDS / 4u + 10u * number;
    let a = bitcast<vec4f>(record_index[at]);
    let b = bitcast<vec4f>(record_index[at + 1u]);
    let c = bitcast<vec4f>(record_index[at + 2u]);
    let rotation = array<vec4f, 3>(bitcast<vec4f>(record_index[at + 3u]), bitcast<vec4f>(record_index[at + 4u]), bitcast<vec4f>(record_index[at + 5u]));
    let translation = array<vec4f, 3>(bitcast<vec4f>(record_index[at + 6u]), bitcast<vec4f>(record_index[at + 7u]), bitcast<vec4f>(record_index[at + 8u]));
    return Record(a.xyz, a.w, b.xyz, b.w, c.xyz, c.w, rotation, translation, bitcast<vec3f>(record_index[at + 9u].xyz), 0u);
}

// How much farther records reach where none counts, what one counts that may be hidden by an obstacle, and what a record in front of a point, or behind it, is told
// by: as math::record_index.
const COARSER = 3.0;
const LITTLE = 1e-8;
const FRONT = 0.05;

// Where a point is, seen from a record: the square of the way, and its product with the stretch. `times` says how much more records count that are turned or not
// level.
struct Beside {
    square: f32,
    along: f32,
    // What the normals take of the weight; more than 1 where the record cannot count.
    turned: f32,
    // One over the reach.
    per_length: f32,
}

fn beside(record: Record, times: f32, position: vec3f, normal: vec3f) -> Beside {
    let d = position - record.position;
    let is_level = abs(dot(d, normal + record.normal)) * 0.5 <= FRONT * times * length(d);
    let turned = length(normal - record.normal) * 0.70710678 / (INDEX_ACCURACY * times);
    return Beside(dot(d, d), dot(d, stretch_of(record)), select(2.0, turned, is_level), min(1.0 / max(validity_radius(record, index_weighting()), 1e-30), 1e15));
}

// By how far apart they are, in reaches.
fn weight_apart(at: Beside, apart: f32) -> f32 {
    return select(0.0, max(1.0 - apart - at.turned, 0.0) * at.per_length * at.per_length, apart <= 1.0);
}

// As Reaching::local_weight of compact weights.
fn local_weight(record: Record, position: vec3f, normal: vec3f) -> f32 {
    let at = beside(record, 1.0, position, normal);
    return weight_apart(at, sqrt(max(at.square - at.along * at.along, 0.0)) * at.per_length);
}

// Of a record that reaches farther, up to an obstacle.
fn coarser_weight(record: Record, position: vec3f, normal: vec3f) -> f32 {
    let at = beside(record, COARSER, position, normal);
    let confinement = record.translation[2].w;
    let stretch = stretch_of(record);
    let longer = 1.0 - dot(stretch, stretch);
    // Where an obstacle keeps the shorter axis as it is, the longer one grows.
    let grown = select(1.0, (1.0 - max(longer / (COARSER * COARSER), 0.01)) / (1.0 - longer), longer < 1.0 && confinement >= 1.0);
    let in_sight = sqrt(max(at.square - at.along * at.along * grown, 0.0)) * at.per_length * max(1.0 / COARSER, confinement);
    let past_all = sqrt(at.square * longer) * at.per_length / COARSER;
    if in_sight <= 1.0 {
        return weight_apart(at, in_sight);
    }
    return LITTLE * weight_apart(at, past_all);
}

// Weighted irradiance and weight of a record that an entry of a list names, if it is of cells of the level and reaches a point.
fn listed_sums(entry: u32, level: u32, position: vec3f, normal: vec3f, is_coarser: bool) -> vec4f {
    if entry >> LEVEL_BIT != level {
        return vec4f(0.0);
    }
    let record = indexed_record(entry & ((1u << LEVEL_BIT) - 1u));
    var weight = 0.0;
    if is_coarser {
        weight = coarser_weight(record, position, normal);
    } else {
        weight = local_weight(record, position, normal);
    }
    if weight <= 0.0 {
        return vec4f(0.0);
    }
    return vec4f(record_estimate(record, index_weighting(), position, normal), 1.0) * weight;
}

// Sums over the records that lists name at a point and that reach it, by themselves or coarser: weighted irradiance, weight. Of each list the entry
// with the number `from` counts, and then each that is `stride` after.
fn indexed_sums(header_at: u32, entries: u32, position: vec3f, normal: vec3f, is_coarser: bool, from_entry: u32, stride: u32) -> vec4f {
    let header = record_index[header_at / 4u];
    let smallest = cell_of(position, bitcast<i32>(header.x));
    var sum = vec4f(0.0);
    var there = header.y;
    while there != 0u {
        let level = countTrailingZeros(there);
        there &= there - 1u;
        let ends = header_at + INDEX_HEADER + cell_hash(smallest >> vec3u(level), level, header.z);
        let first = select(index_word(ends - 1u), 0u, ends == header_at + INDEX_HEADER);
        let end = index_word(ends);
        for (var i = first + from_entry; i < end; i += stride) {
            sum += listed_sums(index_word(entries + i), level, position, normal, is_coarser);
        }
    }
    return sum;
}

// Over the records that count.
fn near_sums(position: vec3f, normal: vec3f) -> vec4f {
    return indexed_sums(NEAR_HEADER, NEAR_ENTRIES, position, normal, false, 0u, 1u);
}

// Over those that would if they reached farther.
fn far_sums(position: vec3f, normal: vec3f, from_entry: u32, stride: u32) -> vec4f {
    return indexed_sums(0u, INDEX_ENTRIES, position, normal, true, from_entry, stride);
}

fn mean_of(sum: vec4f) -> vec3f {
    return select(vec3f(0.0), sum.xyz / max(sum.w, 1e-37), sum.w > 0.0);
}

// The weighted mean of what the records that count at a point foretell; where none counts, of those listed there as if they reached farther.
fn indirect_irradiance(position: vec3f, normal: vec3f, triangle: u32) -> vec3f {
    var sum = near_sums(position, normal);
    if sum.w == 0.0 {
        sum = far_sums(position, normal, 0u, 1u);
    }
    return mean_of(sum);
}

var<workgroup> far_lanes: array<atomic<u32>, 2>;
var<workgroup> all_far_lanes: vec2u;
var<workgroup> far_points: array<vec3f, 64>;
var<workgroup> far_normals: array<vec3f, 64>;
var<workgroup> far_parts: array<vec4f, 64>;

// The same at a point of each lane that asks, of a workgroup of 64 that are all here. Where no record counts the lanes share the work, as few points would
// have all the others wait: the lists are long.
fn irradiance_of_lanes(lane: u32, asks: bool, position: vec3f, normal: vec3f, triangle: u32) -> vec3f {
    var sum = vec4f(0.0);
    if asks {
        sum = near_sums(position, normal);
    }
    far_points[lane] = position;
    far_normals[lane] = normal;
    if asks && sum.w == 0.0 {
        atomicOr(&far_lanes[lane / 32u], 1u << (lane % 32u));
    }
    workgroupBarrier();
    if lane == 0u {
        all_far_lanes = vec2u(atomicLoad(&far_lanes[0]), atomicLoad(&far_lanes[1]));
    }
    let all = workgroupUniformLoad(&all_far_lanes);
    for (var half = 0u; half < 2u; half++) {
        var rest = all[half];
        while rest != 0u {
            let at = 32u * half + countTrailingZeros(rest);
            rest &= rest - 1u;
            far_parts[lane] = far_sums(far_points[at], far_normals[at], lane, 64u);
            for (var step = 32u; step > 0u; step /= 2u) {
                workgroupBarrier();
                if lane < step {
                    far_parts[lane] += far_parts[lane + step];
                }
            }
            workgroupBarrier();
            if lane == at {
                sum = far_parts[0];
            }
            workgroupBarrier();
        }
    }
    return mean_of(sum);
}
