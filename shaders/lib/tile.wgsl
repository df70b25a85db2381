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
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
}

override TILE_WIDTH: u32 = 64u;
override TILE_HEIGHT: u32 = 64u;
// Tiles along a row of the atlas.
override TILES_PER_ROW: u32 = 16u;
// Most tiles a batch.
override TILE_CAPACITY: u32 = 256u;

fn tile_corner(tile: u32) -> vec2u {
    return vec2u((tile % TILES_PER_ROW) * TILE_WIDTH, (tile / TILES_PER_ROW) * TILE_HEIGHT);
}
