#import lib/scene
#import lib/frame
#import lib/record
#import lib/record_index
#import lib/tile

// Adds what the surfaces that a tile sees reflect of indirect light.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read> samples: array<TileSample>;
// Triangle + 1.
@group(0) @binding(2) var<storage, read> seen: array<u32>;
// Radiance, distance: tile · samples + sample.
@group(0) @binding(3) var<storage, read_write> radiance: array<vec4f>;

@compute @workgroup_size(64)
fn add_indirect(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let size = TILE_WIDTH * TILE_HEIGHT;
    let item = tile_item(size, group, groups, lane);
    if !item.inside {
        return;
    }
    let tile = item.tile;
    let sample = item.index;
    let request = requests[tile];
    let triangle = seen[atlas_place(tile, vec2u(sample % TILE_WIDTH, sample / TILE_WIDTH))];
    if triangle == 0u {
        return;
    }
    let direction = frame_around(request.normal, request.turn) * samples[sample].direction;
    let origin = request.position + request.normal * surface_offset(request.position);
    let surface = surface_seen(triangle - 1u, origin, direction);
    // Lobes reflect it as if it came alike from all sides.
    let reflectance = surface.reflectance + select(vec3f(0.0), surface.specular, GLOSSY && surface.lobe != 0u);
    let reflected = indirect_irradiance(surface.position, surface.normal) * reflectance / PI;
    radiance[tile * size + sample] += vec4f(reflected, 0.0);
}
