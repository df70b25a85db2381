// Tiles of one hemisphere each: passes/hemisphere_tiles and math::hemisphere have the host's side.

struct TileSample {
    direction: vec3f,
    cosine_weight: f32,
    plain_weight: f32,
    rotation_x: f32,
    rotation_y: f32,
    depth_cosine: f32,
}

struct TileEdge {
    gradient: vec3f,
    a: u32,
    b: u32,
    // Second derivatives along the surface.
    hessian_xx: f32,
    hessian_xy: f32,
    hessian_yy: f32,
}

override TILE_WIDTH: u32 = 64u;
override TILE_HEIGHT: u32 = 64u;
// Tiles along a row of the atlas.
override TILES_PER_ROW: u32 = 16u;
// Most tiles a batch.
override TILE_CAPACITY: u32 = 256u;

// Samples from a row of the atlas to the next.
override ATLAS_PITCH: u32 = 1024u;

// Where a sample of a tile stands in the atlas' buffer.
fn atlas_place(tile: u32, at: vec2u) -> u32 {
    let texel = tile_corner(tile) + at;
    return texel.y * ATLAS_PITCH + texel.x;
}

fn tile_corner(tile: u32) -> vec2u {
    return vec2u((tile % TILES_PER_ROW) * TILE_WIDTH, (tile / TILES_PER_ROW) * TILE_HEIGHT);
}

// One of the `items` of a tile that a lane has, where workgroups of 64 lanes work through the items of one tile after the other.
struct TileItem {
    tile: u32,
    index: u32,
    // False for lanes beyond a tile's items or the last tile.
    inside: bool,
}

fn tile_item(items: u32, group: vec3u, groups: vec3u, lane: u32) -> TileItem {
    let per = (items + 63u) / 64u;
    let linear = group.x + group.y * groups.x;
    let tile = linear / per;
    let index = (linear % per) * 64u + lane;
    return TileItem(tile, index, tile < TILE_CAPACITY && index < items);
}
