#import lib/closest_hit
#import lib/frame
#import lib/more_rays
#import lib/record

// The triangle that each of the rays besides one a stratum sees.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
// Triangle + 1: tile · strata + ray.
@group(0) @binding(2) var<storage, read_write> seen: array<u32>;

@compute @workgroup_size(64)
fn trace_more(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let item = more_item(group, groups, lane);
    if !item.inside {
        return;
    }
    let request = requests[item.tile];
    let origin = request.position + request.normal * surface_offset(request.position);
    let direction = frame_around(request.normal, request.turn) * listed_direction(more_ray(item.tile, item.index));
    let hit = nearest_hit(origin, direction, FAR_AWAY, false);
    seen[item.tile * TILE_WIDTH * TILE_HEIGHT + item.index] = select(hit.triangle + 1u, 0u, hit.triangle == NO_TRIANGLE);
}
