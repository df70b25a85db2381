#import lib/sums

// The last level of the ping-pong as a buffer that is read back: tile by tile, part by part, row by row.

@group(0) @binding(0) var last: texture_2d_array<f32>;
@group(0) @binding(1) var<storage, read_write> rest: array<vec4f>;

@compute @workgroup_size(64)
fn pack(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let texels = LEVEL_WIDTH * LEVEL_HEIGHT;
    let per = (texels + 63u) / 64u;
    let linear = group.x + group.y * groups.x;
    let tile = linear / per;
    let index = (linear % per) * 64u + lane;
    if tile >= TILE_CAPACITY || index >= texels {
        return;
    }
    let at = level_corner(tile) + vec2u(index % LEVEL_WIDTH, index / LEVEL_WIDTH);
    for (var part = 0u; part < PARTS; part++) {
        rest[(tile * PARTS + part) * texels + index] = textureLoad(last, at, part, 0);
    }
}
