#import lib/sums

// A record from the last level of a tile's mipmap chain.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
// A part a layer, as irradiance_sum/reduce leaves them: one texel a tile, or what cannot be halved any more.
@group(0) @binding(1) var last: texture_2d_array<f32>;
@group(0) @binding(2) var<storage, read_write> records: array<Record>;

// What half floats were multiplied by.
@group(0) @binding(3) var<storage, read> exposures: array<f32>;

// The sums of a tile whose light was stored times an exposure.
fn finished(tile: u32, exposure: f32) -> Sums {
    let texels = LEVEL_WIDTH * LEVEL_HEIGHT;
    let corner = level_corner(tile);
    var sums: Sums;
    for (var i = 0u; i < texels; i++) {
        for (var part = 0u; part < PARTS; part++) {
            let value = textureLoad(last, corner + vec2u(i % LEVEL_WIDTH, i / LEVEL_WIDTH), part, 0);
            sums.parts[part] = joined(part, sums.parts[part], value);
        }
    }
    let share = 1.0 / f32(texels);
    let light = share / exposure;
    let extent = scene_parameters.extent;
    sums.parts[0] *= vec4f(vec3f(light), share / extent);
    sums.parts[1] *= light;
    sums.parts[2] *= vec4f(vec2f(light), share, 1.0 / extent);
    for (var part = 3u; part < 6u; part++) {
        sums.parts[part] *= light / extent * vec4f(1.0, 1.0, 1.0, 1.0 / extent);
    }
    sums.parts[6] *= light / exposure / f32(TILE_WIDTH * TILE_HEIGHT);
    return sums;
}

@compute @workgroup_size(64)
fn finish_f32(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = (group.x + group.y * groups.x) * 64u + lane;
    if tile < TILE_CAPACITY {
        records[tile] = record_of(requests[tile], finished(tile, 1.0));
    }
}

@compute @workgroup_size(64)
fn finish_f16(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = (group.x + group.y * groups.x) * 64u + lane;
    if tile < TILE_CAPACITY {
        records[tile] = record_of(requests[tile], finished(tile, exposures[tile]));
    }
}
