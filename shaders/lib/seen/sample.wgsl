#import lib/scene
#import lib/frame
#import lib/record
#import lib/tile

// What a ray of a tile sees, of whatever list it is.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
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

// Of a ray along a direction of the tile's frame, and the triangle that it met; from below the surface none is cast.
fn sample_along(item: TileItem, direction: vec3f, triangle: u32) -> SeenSample {
    let request = requests[item.tile];
    let origin = request.position + request.normal * surface_offset(request.position);
    let place = item.tile * TILE_WIDTH * TILE_HEIGHT + item.index;
    let way = frame_around(request.normal, request.turn) * direction;
    let is_cast = !is_below(request, way);
    return SeenSample(place, item.index, true, is_cast, select(0u, triangle, is_cast), request.turn, origin, way);
}
