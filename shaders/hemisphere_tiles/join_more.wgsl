#import lib/record
#import lib/squares
#import lib/tile

// Of all rays of a stratum the mean radiance, and the harmonic mean of how far they went.

@group(0) @binding(0) var<storage, read> more_rays: array<u32>;
// Radiance, distance: tile · strata + ray.
@group(0) @binding(1) var<storage, read> also_seen: array<vec4f>;
// Tile · strata + stratum.
@group(0) @binding(2) var<storage, read_write> radiance: array<vec4f>;

fn inverse_distance(sight: vec4f) -> vec4f {
    return vec4f(sight.xyz, 1.0 / sight.w);
}

// A lane a ray; the first of a stratum joins all.
@compute @workgroup_size(64)
fn join_more(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let strata = TILE_WIDTH * TILE_HEIGHT;
    let item = tile_item(strata, group, groups, lane);
    let list = item.tile * (strata + 1u);
    if !item.inside || item.index >= more_rays[list] {
        return;
    }
    let count = more_rays[list];
    let stratum = square_of_listed(more_rays[list + 1u + item.index]);
    if item.index > 0u && square_of_listed(more_rays[list + item.index]) == stratum {
        return;
    }
    let place = item.tile * strata + stratum;
    var sum = inverse_distance(radiance[place]);
    var rays = 1.0;
    for (var i = item.index; i < count && square_of_listed(more_rays[list + 1u + i]) == stratum; i++) {
        sum += inverse_distance(also_seen[item.tile * strata + i]);
        rays += 1.0;
    }
    let mean = sum / rays;
    radiance[place] = vec4f(mean.xyz, 1.0 / mean.w);
}
