#import lib/seen/sample
#import lib/more_rays

// What rays of tiles see besides one a stratum.

// The ray of a lane, where workgroups of 64 lanes work through as many of a tile as it has strata.
fn seen_sample(group: vec3u, groups: vec3u, lane: u32) -> SeenSample {
    let item = more_item(group, groups, lane);
    if !item.inside {
        return SeenSample();
    }
    return sample_along(item, listed_direction(more_ray(item.tile, item.index)), seen[item.tile * TILE_WIDTH * TILE_HEIGHT + item.index]);
}
