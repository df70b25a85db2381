#import lib/scene
#import lib/frame
#import lib/record
#import lib/squares
#import lib/tile

// What rays of tiles see besides one a stratum.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
// Of each tile how many they are, and of each its stratum and its number there.
@group(0) @binding(1) var<storage, read> more_rays: array<u32>;
// Triangle + 1.
@group(0) @binding(2) var<storage, read> seen: array<u32>;

// A ray: as lib/seen/strata.
struct SeenSample {
    place: u32,
    index: u32,
    inside: bool,
    is_cast: bool,
    triangle: u32,
    turn: f32,
    origin: vec3f,
    direction: vec3f,
}

// The ray of a lane, where workgroups of 64 lanes work through as many of a tile as it has strata.
fn seen_sample(group: vec3u, groups: vec3u, lane: u32) -> SeenSample {
    var ray: SeenSample;
    let size = TILE_WIDTH * TILE_HEIGHT;
    let item = tile_item(size, group, groups, lane);
    ray.inside = item.inside && item.index < more_rays[item.tile * (size + 1u)];
    if !ray.inside {
        return ray;
    }
    let request = requests[item.tile];
    ray.place = item.tile * size + item.index;
    ray.index = item.index;
    ray.is_cast = true;
    ray.triangle = seen[ray.place];
    ray.turn = request.turn;
    ray.origin = request.position + request.normal * surface_offset(request.position);
    ray.direction = frame_around(request.normal, request.turn) * listed_direction(more_rays[item.tile * (size + 1u) + 1u + item.index]);
    return ray;
}
