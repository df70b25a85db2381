#import lib/sums

// The last level of the ping-pong as a buffer that is read back: tile by tile, part by part, row by row.

@group(0) @binding(0) var last: texture_2d_array<f32>;
@group(0) @binding(1) var<storage, read_write> rest: array<vec4f>;

@compute @workgroup_size(64)
fn pack(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let texels = LEVEL_WIDTH * LEVEL_HEIGHT;
    let item = tile_item(texels, group, groups, lane);
    if !item.inside {
        return;
    }
    let at = level_corner(item.tile) + vec2u(item.index % LEVEL_WIDTH, item.index / LEVEL_WIDTH);
    for (var part = 0u; part < PARTS; part++) {
        rest[(item.tile * PARTS + part) * texels + item.index] = textureLoad(last, at, part, 0);
    }
}
