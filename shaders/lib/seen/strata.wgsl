#import lib/scene
#import lib/frame
#import lib/record
#import lib/tile

// What the samples of tiles see.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read> samples: array<TileSample>;
// Triangle + 1.
@group(0) @binding(2) var<storage, read> seen: array<u32>;

// A sample and its ray.
struct SeenSample {
    // Among all samples: tile · samples + sample.
    place: u32,
    index: u32,
    // False for lanes beyond a tile's samples or the last tile.
    inside: bool,
    // Whether a ray is cast for it.
    is_cast: bool,
    // Triangle + 1, 0 for none.
    triangle: u32,
    // Of the frame that the tile stands in.
    turn: f32,
    origin: vec3f,
    direction: vec3f,
}

// The sample of a lane, where workgroups of 64 lanes work through the samples of one tile after the other.
fn seen_sample(group: vec3u, groups: vec3u, lane: u32) -> SeenSample {
    var ray: SeenSample;
    let size = TILE_WIDTH * TILE_HEIGHT;
    let item = tile_item(size, group, groups, lane);
    ray.inside = item.inside;
    if !item.inside {
        return ray;
    }
    let request = requests[item.tile];
    ray.place = item.tile * size + item.index;
    ray.index = item.index;
    ray.is_cast = samples[item.index].plain_weight > 0.0;
    ray.triangle = seen[atlas_place(item.tile, vec2u(item.index % TILE_WIDTH, item.index / TILE_WIDTH))];
    ray.turn = request.turn;
    ray.origin = request.position + request.normal * surface_offset(request.position);
    ray.direction = frame_around(request.normal, request.turn) * samples[item.index].direction;
    return ray;
}
