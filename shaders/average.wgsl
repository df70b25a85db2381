// An iteration added to the mean of all: as passes/average.rs.

struct Share {
    share: f32,
    padding_a: f32,
    padding_b: f32,
    padding_c: f32,
}

@group(0) @binding(0) var<uniform> share_of_mean: Share;
@group(0) @binding(1) var<storage, read_write> fresh: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> mean: array<vec4f>;
@group(0) @binding(3) var<storage, read> near: array<vec4f>;

override PLACES: u32 = 1u;

@compute @workgroup_size(64)
fn average(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = (group.x + group.y * groups.x) * 64u + lane;
    if place < PLACES {
        let brought = fresh[place] + near[place];
        fresh[place] = brought;
        mean[place] += (brought - mean[place]) * share_of_mean.share;
    }
}
