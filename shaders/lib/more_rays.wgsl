#import lib/squares
#import lib/tile

// Rays of tiles besides one a stratum, in lists that hemisphere_tiles/guide has made.

// Of each tile how many they are, and of each its stratum and its number there.
@group(0) @binding(1) var<storage, read> more_rays: array<u32>;

fn more_count(tile: u32) -> u32 {
    return more_rays[tile * (TILE_WIDTH * TILE_HEIGHT + 1u)];
}

fn more_ray(tile: u32, index: u32) -> u32 {
    return more_rays[tile * (TILE_WIDTH * TILE_HEIGHT + 1u) + 1u + index];
}

// The ray of a lane, where workgroups of 64 lanes work through as many of a tile as it has strata.
fn more_item(group: vec3u, groups: vec3u, lane: u32) -> TileItem {
    var item = tile_item(TILE_WIDTH * TILE_HEIGHT, group, groups, lane);
    item.inside = item.inside && item.index < more_count(item.tile);
    return item;
}
