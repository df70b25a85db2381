#import lib/seen/sample

// What the samples of tiles see, one a stratum.

@group(0) @binding(1) var<storage, read> samples: array<TileSample>;

// The sample of a lane, where workgroups of 64 lanes work through the samples of one tile after the other.
fn seen_sample(group: vec3u, groups: vec3u, lane: u32) -> SeenSample {
    let item = tile_item(TILE_WIDTH * TILE_HEIGHT, group, groups, lane);
    if !item.inside {
        return SeenSample();
    }
    let triangle = seen[atlas_place(item.tile, vec2u(item.index % TILE_WIDTH, item.index / TILE_WIDTH))];
    var ray = sample_along(item, samples[item.index].direction, triangle);
    ray.is_cast = ray.is_cast && samples[item.index].plain_weight > 0.0;
    return ray;
}
