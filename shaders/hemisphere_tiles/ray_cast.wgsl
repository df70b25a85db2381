#import lib/trace
#import lib/frame
#import lib/record
#import lib/tile

// The triangle that each sample of a tile sees, by one ray a sample.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read> samples: array<TileSample>;
@group(0) @binding(2) var seen: texture_storage_2d<r32uint, write>;

@compute @workgroup_size(64)
fn trace(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let size = TILE_WIDTH * TILE_HEIGHT;
    let per = (size + 63u) / 64u;
    let linear = group.x + group.y * groups.x;
    let tile = linear / per;
    let sample = (linear % per) * 64u + lane;
    if tile >= TILE_CAPACITY || sample >= size {
        return;
    }
    var triangle = 0u;
    if samples[sample].plain_weight > 0.0 {
        let request = requests[tile];
        let direction = frame_around(request.normal, request.turn) * samples[sample].direction;
        let hit = trace_closest(request.position + request.normal * surface_offset(request.position), direction);
        triangle = select(hit.triangle + 1u, 0u, hit.triangle == NO_TRIANGLE);
    }
    textureStore(seen, tile_corner(tile) + vec2u(sample % TILE_WIDTH, sample / TILE_WIDTH), vec4u(triangle));
}
