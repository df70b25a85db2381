#import lib/record
#import lib/record_lists

// Neighbouring records together: math::record_filter is the twin, and tells why.

// How records count here: farther than where they are splatted.
@group(0) @binding(0) var<uniform> weighting: Weighting;
@group(0) @binding(1) var<storage, read> records: array<Record>;
@group(0) @binding(2) var<storage, read_write> filtered: array<Record>;

// How far what two records say of a place may lie apart [standard errors].
override TOLERANCE: f32 = 2.0;

const FRONT = 0.05;
const LEAST_ERROR = 1e-30;
// Most entries of a list that are looked at: where all records reach each other, the work would grow with their square. The host takes those at one place for one.
const MOST_LISTED = 16384u;

// What a record says of the irradiance at the place of another.
fn told_at(other: Record, at: Record) -> vec3f {
    let step = at.position - other.position;
    let turn = cross(other.normal, at.normal);
    var change: vec3f;
    for (var channel = 0u; channel < 3u; channel++) {
        let moved = dot(step, other.translation[channel].xyz + at.translation[channel].xyz);
        change[channel] = 0.5 * (moved + dot(turn, other.rotation[channel].xyz + at.rotation[channel].xyz));
    }
    return clamp(other.irradiance + change, other.irradiance * LEAST_FALL, other.irradiance * (1.0 + MOST_RISE));
}

fn likeness(other: Record, at: Record, told: vec3f) -> f32 {
    let own = luminance(at.error);
    let its = luminance(other.error);
    // The length of both, whose squares may be no numbers.
    let larger = max(max(own, its), LEAST_ERROR);
    let error = larger * length(vec2f(own, its) / larger);
    let apart = luminance(told - at.irradiance) / max(TOLERANCE * error, LEAST_ERROR);
    return exp(-0.5 * apart * apart);
}

fn level_weight(other: Record, at: Record) -> f32 {
    let offset = at.position - other.position;
    if dot(offset, at.normal + other.normal) * 0.5 > FRONT * length(offset) {
        return 0.0;
    }
    return record_weight(other, weighting, at.position, at.normal);
}

struct FilterSums {
    weight: f32,
    irradiance: vec3f,
    squares: vec3f,
    rotation: array<vec3f, 3>,
    translation: array<vec3f, 3>,
}

fn add_record(sums: ptr<function, FilterSums>, other: Record, told: vec3f, weight: f32) {
    // Nothing where it is not a number, as of light that is none.
    if !(weight > 0.0) {
        return;
    }
    (*sums).weight += weight;
    (*sums).irradiance += told * weight;
    (*sums).squares += other.error * weight * (other.error * weight);
    for (var channel = 0u; channel < 3u; channel++) {
        (*sums).rotation[channel] += other.rotation[channel].xyz * weight;
        (*sums).translation[channel] += other.translation[channel].xyz * weight;
    }
}

fn mean_record(sums: FilterSums, record: Record) -> Record {
    var mean = record;
    if sums.weight <= 0.0 {
        return mean;
    }
    let share = 1.0 / sums.weight;
    mean.irradiance = sums.irradiance * share;
    mean.error = sqrt(sums.squares) * share;
    for (var channel = 0u; channel < 3u; channel++) {
        mean.rotation[channel] = vec4f(sums.rotation[channel] * share, record.rotation[channel].w);
        mean.translation[channel] = vec4f(sums.translation[channel] * share, record.translation[channel].w);
    }
    return mean;
}

@compute @workgroup_size(64)
fn filter_record(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let number = (group.x + group.y * groups.x) * 64u + lane;
    if number >= listed_count() {
        return;
    }
    let record = records[number];
    var sums: FilterSums;
    var there = record_lists[1];
    while there != 0u {
        let list = record_list(record.position, countTrailingZeros(there));
        there &= there - 1u;
        let all = list.end - list.first;
        let parts = min(all, MOST_LISTED);
        let whole = all / parts;
        let longer = all % parts;
        for (var part = 0u; part < parts; part++) {
            // All entries, or where these are more one by chance in each of so many parts.
            let first = part * whole + min(part, longer);
            let count = whole + select(0u, 1u, part < longer);
            let listed = listed_record(list, list.first + first + hash(part) % count);
            if !listed.is_of_list {
                continue;
            }
            let other = records[listed.number];
            let weight = level_weight(other, record);
            if weight > 0.0 {
                let told = told_at(other, record);
                add_record(&sums, other, told, weight * likeness(other, record, told));
            }
        }
    }
    filtered[number] = mean_record(sums, record);
}
