#import lib/record
#import lib/record_cells

// The irradiance at any point, from an index over records: as math::record_index.

// Exponent of the smallest cells' edge, a bit for each level, hashes, records; where the list of each hash ends; the lists; the records.
@group(0) @binding(20) var<storage, read> record_index: array<vec4u>;
@group(0) @binding(21) var<uniform> index_weighting: Weighting;

// Where the lists and the records start [words].
override INDEX_ENTRIES: u32 = 8u;
override INDEX_RECORDS: u32 = 16u;
const INDEX_HEADER = 4u;
const LEVEL_BIT = 24u;

fn index_word(at: u32) -> u32 {
    return record_index[at / 4u][at % 4u];
}

fn indexed_record(number: u32) -> Record {
    let at = INDEX_RECORDS / 4u + 9u * number;
    let a = bitcast<vec4f>(record_index[at]);
    let b = bitcast<vec4f>(record_index[at + 1u]);
    let c = bitcast<vec4f>(record_index[at + 2u]);
    let rotation = array<vec4f, 3>(bitcast<vec4f>(record_index[at + 3u]), bitcast<vec4f>(record_index[at + 4u]), bitcast<vec4f>(record_index[at + 5u]));
    let translation = array<vec4f, 3>(bitcast<vec4f>(record_index[at + 6u]), bitcast<vec4f>(record_index[at + 7u]), bitcast<vec4f>(record_index[at + 8u]));
    return Record(a.xyz, a.w, b.xyz, b.w, c.xyz, c.w, rotation, translation);
}

// How much farther records reach where none counts, and what a record in front of a point, or behind it, is told by: as math::record_index.
const COARSER = 3.0;
const FRONT = 0.05;

// As Reaching::local_weight of compact weights, of a record that reaches so many times as far.
fn local_weight(record: Record, times: f32, position: vec3f, normal: vec3f) -> f32 {
    let d = position - record.position;
    let along = dot(d, stretch_of(record));
    let reached = max(validity_radius(record, index_weighting), 1e-30);
    let apart = sqrt(max(dot(d, d) - along * along, 0.0)) / (reached * times);
    let turned = length(normal - record.normal) * 0.70710678;
    let is_level = abs(dot(d, normal + record.normal)) * 0.5 <= FRONT * times * length(d);
    if apart > 1.0 || !is_level {
        return 0.0;
    }
    let per_length = min(1.0 / reached, 1e15);
    return max(1.0 - apart - turned / (index_weighting.accuracy * times), 0.0) * per_length * per_length;
}

// Sums over the records listed at a point that reach it if they reach so many times as far: weighted irradiance, weight.
fn indexed_sums(position: vec3f, normal: vec3f, times: f32) -> vec4f {
    let header = record_index[0];
    let smallest = cell_of(position, bitcast<i32>(header.x));
    var sum = vec4f(0.0);
    var there = header.y;
    while there != 0u {
        let level = countTrailingZeros(there);
        there &= there - 1u;
        let hashed = cell_hash(smallest >> vec3u(level), level, header.z);
        let first = select(index_word(INDEX_HEADER + max(hashed, 1u) - 1u), 0u, hashed == 0u);
        let end = index_word(INDEX_HEADER + hashed);
        for (var i = first; i < end; i++) {
            let entry = index_word(INDEX_ENTRIES + i);
            if entry >> LEVEL_BIT != level {
                continue;
            }
            let record = indexed_record(entry & ((1u << LEVEL_BIT) - 1u));
            let weight = local_weight(record, times, position, normal);
            if weight > 0.0 {
                sum += vec4f(record_estimate(record, index_weighting, position, normal), 1.0) * weight;
            }
        }
    }
    return sum;
}

// The weighted mean of what the records that count at a point foretell; where none counts, of those listed there as if they reached farther.
fn indirect_irradiance(position: vec3f, normal: vec3f) -> vec3f {
    var sum = indexed_sums(position, normal, 1.0);
    if sum.w == 0.0 {
        sum = indexed_sums(position, normal, COARSER);
    }
    return select(vec3f(0.0), sum.xyz / max(sum.w, 1e-37), sum.w > 0.0);
}
