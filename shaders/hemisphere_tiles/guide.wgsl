#import lib/colour
#import lib/frame
#import lib/photon_map
#import lib/record
#import lib/scene
#import lib/squares
#import lib/tile

// Lists the rays that strata are worth besides their own: as passes/hemisphere_tiles/guide.rs, a lane a place.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
// Of each tile how many they are, and of each its stratum and its number there.
@group(0) @binding(1) var<storage, read_write> more_rays: array<u32>;
// How much light comes from each stratum: tile · strata + stratum.
@group(0) @binding(2) var<storage, read_write> light: array<f32>;

// Photons that are looked at for a place, and how far away they may be, as a share of the scene's extent.
override WANTED: u32 = 64u;
override SEARCH_RADIUS: f32 = 0.05;
// A stratum with this share of a tile's light is worth a ray; with twice the share four.
override SHARE: f32 = 0.02;

const FEWEST = 2.0;
const MOST = 63.0;
const MOST_OF_ALL = 1.0;

fn add_light(first: u32, at: vec2i, amount: f32) {
    if all(at >= vec2i(0)) && all(at < vec2i(i32(TILE_WIDTH))) {
        light[first + u32(at.y) * TILE_WIDTH + u32(at.x)] += amount;
    }
}

// A photon's light, spread over the strata next to the one that it came from.
fn spread_light(first: u32, square: u32, amount: f32) {
    let at = vec2i(vec2u(square % TILE_WIDTH, square / TILE_WIDTH));
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            add_light(first, at + vec2i(x, y), amount * select(0.25, 0.5, x == 0) * select(0.25, 0.5, y == 0));
        }
    }
}

// Adds up where photons that arrive near a place have come from.
fn gather_light(request: Request, first: u32) {
    let frame = frame_around(request.normal, request.turn);
    let head = map_head();
    let zone = photon_zone(request.position, request.normal, WANTED, SEARCH_RADIUS * scene_parameters.extent);
    let slab = slab_of(head, request.normal, zone.radius, zone.level);
    for (var number = 0u; number < 8u; number++) {
        let range = photons_of(head, request.position, zone.level, number, request.normal, slab);
        for (var i = range.x; i < range.y; i++) {
            let photon = photon_at(i);
            let way = photon.position + unpacked_way(photon.ways >> 16u) * photon.leg - request.position;
            let origin = (way / max(length(way), 1e-37)) * frame;
            if photon_distance(photon, request.position, request.normal, zone.radius) >= 0.0 && origin.z > 0.0 {
                spread_light(first, square_of(origin.xy), luminance(photon.flux));
            }
        }
    }
}

fn wished(amount: f32) -> f32 {
    let rays = amount * amount / (SHARE * SHARE);
    return select(0.0, min(rays, MOST), rays >= FEWEST);
}

@compute @workgroup_size(64)
fn list_rays(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = (group.x + group.y * groups.x) * 64u + lane;
    if tile >= TILE_CAPACITY {
        return;
    }
    let strata = TILE_WIDTH * TILE_HEIGHT;
    let first = tile * strata;
    for (var stratum = 0u; stratum < strata; stratum++) {
        light[first + stratum] = 0.0;
    }
    gather_light(requests[tile], first);
    var all_light = 0.0;
    for (var stratum = 0u; stratum < strata; stratum++) {
        all_light += light[first + stratum];
    }
    let per_light = select(0.0, 1.0 / all_light, all_light > 0.0);
    var together = 0.0;
    for (var stratum = 0u; stratum < strata; stratum++) {
        together += wished(light[first + stratum] * per_light);
    }
    let scale = min(MOST_OF_ALL * f32(strata) / max(together, 1e-37), 1.0);
    let list = tile * (strata + 1u);
    var count = 0u;
    for (var stratum = 0u; stratum < strata; stratum++) {
        let rays = min(u32(scale * wished(light[first + stratum] * per_light) + 0.5), strata - count);
        for (var number = 1u; number <= rays; number++) {
            count++;
            more_rays[list + count] = listed_ray(stratum, number);
        }
    }
    more_rays[list] = count;
}
