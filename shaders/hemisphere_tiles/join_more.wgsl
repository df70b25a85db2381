#import lib/more_rays

// Of all rays of a stratum the mean radiance, and the harmonic mean of how far they went.

// Radiance, distance: tile · strata + ray.
@group(0) @binding(0) var<storage, read> also_seen: array<vec4f>;
// Tile · strata + stratum.
@group(0) @binding(2) var<storage, read_write> radiance: array<vec4f>;

fn inverse_distance(sight: vec4f) -> vec4f {
    return vec4f(sight.xyz, 1.0 / sight.w);
}

fn stratum_of(tile: u32, index: u32) -> u32 {
    return square_of_listed(more_ray(tile, index));
}

// A lane a ray; the first of a stratum joins all.
@compute @workgroup_size(64)
fn join_more(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let item = more_item(group, groups, lane);
    if !item.inside {
        return;
    }
    let stratum = stratum_of(item.tile, item.index);
    if item.index > 0u && stratum_of(item.tile, item.index - 1u) == stratum {
        return;
    }
    let strata = TILE_WIDTH * TILE_HEIGHT;
    let place = item.tile * strata + stratum;
    var sum = inverse_distance(radiance[place]);
    var rays = 1.0;
    for (var i = item.index; i < more_count(item.tile) && stratum_of(item.tile, i) == stratum; i++) {
        sum += inverse_distance(also_seen[item.tile * strata + i]);
        rays += 1.0;
    }
    let mean = sum / rays;
    radiance[place] = vec4f(mean.xyz, 1.0 / mean.w);
}
