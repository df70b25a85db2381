#import lib/record
#import IRRADIANCE_FIELD

// Irradiance of a field, added to that of records.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read_write> asked: array<vec4f>;
@group(0) @binding(2) var<storage, read> records: array<Record>;
@group(0) @binding(3) var<storage, read_write> sum: array<Record>;

override CAPACITY: u32 = 1u;

@compute @workgroup_size(64)
fn ask(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = (group.x + group.y * groups.x) * 64u + lane;
    if index < CAPACITY {
        asked[index] = vec4f(indirect_irradiance(requests[index].position, requests[index].normal, 0u), 0.0);
    }
}

@compute @workgroup_size(64)
fn add(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = (group.x + group.y * groups.x) * 64u + lane;
    if index < CAPACITY {
        var record = records[index];
        record.irradiance += asked[index].rgb;
        sum[index] = record;
    }
}
