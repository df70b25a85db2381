#import lib/light
#import lib/record
#import lib/tile

// Radiance and distance of what each sample sees, shaded once.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read> samples: array<TileSample>;
// Triangle + 1.
@group(0) @binding(2) var<storage, read> seen: array<u32>;
// Radiance, distance: tile · samples + sample.
@group(0) @binding(3) var<storage, read_write> radiance: array<vec4f>;

// Whether records see emitters and the sky themselves; otherwise the direct pass lights from them.
override SEES_EMISSION: bool = false;

@compute @workgroup_size(64)
fn shade(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let size = TILE_WIDTH * TILE_HEIGHT;
    let item = tile_item(size, group, groups, lane);
    if !item.inside {
        return;
    }
    let tile = item.tile;
    let sample = item.index;
    let request = requests[tile];
    let direction = frame_around(request.normal, request.turn) * samples[sample].direction;
    let triangle = seen[atlas_place(tile, vec2u(sample % TILE_WIDTH, sample / TILE_WIDTH))];
    var value = vec4f(0.0, 0.0, 0.0, FAR_AWAY);
    if triangle != 0u {
        let origin = request.position + request.normal * surface_offset(request.position);
        let surface = surface_seen(triangle - 1u, origin, direction);
        let seed = combine(bitcast<u32>(request.turn), sample);
        var light = direct_reflected(surface, seed);
        if SEES_EMISSION {
            light += surface.emission;
        }
        value = vec4f(light, surface.distance);
    } else if SEES_EMISSION && samples[sample].plain_weight > 0.0 {
        value = vec4f(environment_radiance(direction), FAR_AWAY);
    }
    radiance[tile * size + sample] = value;
}
