#import lib/closest_hit
#import lib/frame
#import lib/outline
#import lib/photon_map
#import lib/record
#import lib/squares
#import lib/tile

// Tiles of the photons that arrive near their places.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
// Radiance, distance: tile · samples + sample.
@group(0) @binding(1) var<storage, read_write> radiance: array<vec4f>;
// Of each place the words of its state, its outline, and how many photons each sample has.
@group(0) @binding(2) var<storage, read_write> work: array<atomic<u32>>;

const RADIUS = 0u;
const LEVEL = 1u;
const IS_FILLED = 2u;
const COUNT = 3u;
const INVERSE = 4u;
// Points of the region that are on the surface.
const THERE = 5u;
const OUTLINE = 6u;
const SAMPLES = OUTLINE + 2u * DIRECTIONS;

// Photons of a tile, and how far away they may be.
override WANTED: u32 = 64u;
override SEARCH_RADIUS: f32 = 1.0;
// Whether they must be seen from the place.
override VISIBLE: bool = true;
// What tells the area that they stand for: 0 all of the disc, 1 their outline, else so many rays.
override AREA: u32 = 32u;

const ABOVE = 0.1;

fn is_in_sight(place: vec3f, other: vec3f, normal: vec3f, radius: f32) -> bool {
    if !VISIBLE {
        return true;
    }
    let origin = place + normal * max(ABOVE * radius, surface_offset(place));
    let end = other + normal * max(ABOVE * radius, surface_offset(other));
    return !trace_occluded(origin, end - origin, 1.0);
}

fn is_surface(place: vec3f, aside: vec3f, normal: vec3f, radius: f32) -> bool {
    let height = FLATNESS * radius;
    let origin = place + aside + normal * height;
    let hit = closest_hit(origin, -normal, 2.0 * height);
    if hit.triangle == NO_TRIANGLE {
        return false;
    }
    let plane = cross(scene_corners[3u * hit.triangle + 1u].xyz, scene_corners[3u * hit.triangle + 2u].xyz);
    let faces = abs(dot(plane, normal)) >= LEAST_COSINE * length(plane);
    return faces && is_in_sight(place, origin - normal * hit.distance, normal, radius);
}

fn work_of(tile: u32) -> u32 {
    return tile * (SAMPLES + TILE_WIDTH * TILE_HEIGHT);
}

fn load_number(at: u32) -> f32 {
    return bitcast<f32>(atomicLoad(&work[at]));
}

fn store_number(at: u32, number: f32) {
    atomicStore(&work[at], bitcast<u32>(number));
}

fn linear_lane(group: vec3u, groups: vec3u, lane: u32) -> u32 {
    return (group.x + group.y * groups.x) * 64u + lane;
}

// A lane a place.
@compute @workgroup_size(64)
fn find_zones(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = linear_lane(group, groups, lane);
    if tile >= TILE_CAPACITY {
        return;
    }
    let request = requests[tile];
    let zone = photon_zone(request.position, request.normal, WANTED, SEARCH_RADIUS);
    let own = work_of(tile);
    store_number(own + RADIUS, zone.radius);
    atomicStore(&work[own + LEVEL], zone.level);
    atomicStore(&work[own + IS_FILLED], select(0u, 1u, zone.is_filled));
    atomicStore(&work[own + THERE], 0u);
}

fn zone_of(own: u32) -> Zone {
    return Zone(load_number(own + RADIUS), atomicLoad(&work[own + LEVEL]), atomicLoad(&work[own + IS_FILLED]) == 1u);
}

// A lane a place: the sums of each sample, and the outline.
@compute @workgroup_size(64)
fn gather(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = linear_lane(group, groups, lane);
    let samples = TILE_WIDTH * TILE_HEIGHT;
    if tile >= TILE_CAPACITY {
        return;
    }
    let own = work_of(tile);
    for (var sample = 0u; sample < samples; sample++) {
        radiance[tile * samples + sample] = vec4f(0.0);
        atomicStore(&work[own + SAMPLES + sample], 0u);
    }
    let request = requests[tile];
    let plain = frame_around(request.normal, 0.0);
    let frame = frame_around(request.normal, request.turn);
    let head = map_head();
    let zone = zone_of(own);
    let slab = slab_of(head, request.normal, zone.radius, zone.level);
    var count = 0u;
    var inverse = 0.0;
    begin_outline();
    for (var number = 0u; number < 8u; number++) {
        let range = photons_of(head, request.position, zone.level, number, request.normal, slab);
        for (var i = range.x; i < range.y; i++) {
            let photon = photon_at(i);
            // Without one that the place stands on.
            let is_near = photon_distance(photon, request.position, request.normal, zone.radius) > 0.0;
            if is_near && is_in_sight(request.position, photon.position, request.normal, zone.radius) {
                let way = photon.position - request.position;
                add_to_outline(vec2f(dot(way, plain[0]), dot(way, plain[1])));
                let origin = unpacked_way(photon.ways >> 16u);
                let sample = square_of(vec2f(dot(origin, frame[0]), dot(origin, frame[1])));
                let per_length = 1.0 / max(photon.leg, 1e-37);
                radiance[tile * samples + sample] += vec4f(photon.flux, per_length);
                atomicAdd(&work[own + SAMPLES + sample], 1u);
                count += 1u;
                inverse += per_length;
            }
        }
    }
    atomicStore(&work[own + COUNT], count);
    store_number(own + INVERSE, inverse);
    for (var number = 0u; number < DIRECTIONS; number++) {
        store_number(own + OUTLINE + 2u * number, outline_farthest[number].x);
        store_number(own + OUTLINE + 2u * number + 1u, outline_farthest[number].y);
    }
}

fn load_outline(own: u32) {
    outline_count = atomicLoad(&work[own + COUNT]);
    for (var number = 0u; number < DIRECTIONS; number++) {
        outline_farthest[number] = vec2f(load_number(own + OUTLINE + 2u * number), load_number(own + OUTLINE + 2u * number + 1u));
    }
}

// A lane a point of a place's region.
@compute @workgroup_size(64)
fn probe(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let item = tile_item(AREA, group, groups, lane);
    if !item.inside {
        return;
    }
    let own = work_of(item.tile);
    let radius = load_number(own + RADIUS);
    load_outline(own);
    let request = requests[item.tile];
    let frame = frame_around(request.normal, 0.0);
    let aside = region_point(outline_region(radius), radius, item.index, AREA);
    if length(aside) <= radius && is_surface(request.position, frame[0] * aside.x + frame[1] * aside.y, request.normal, radius) {
        atomicAdd(&work[own + THERE], 1u);
    }
}

fn area_of(own: u32, radius: f32) -> f32 {
    let disc = PI * radius * radius;
    if AREA == 0u {
        return disc;
    }
    load_outline(own);
    if AREA == 1u {
        return outline_stands_for(radius);
    }
    let there = f32(atomicLoad(&work[own + THERE]));
    return max(outline_region(radius).area * there / f32(max(AREA, 1u)), LEAST_SHARE * disc);
}

// A lane a place: from sums to radiance and distance.
@compute @workgroup_size(64)
fn finish(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = linear_lane(group, groups, lane);
    let samples = TILE_WIDTH * TILE_HEIGHT;
    if tile >= TILE_CAPACITY {
        return;
    }
    let own = work_of(tile);
    let zone = zone_of(own);
    let count = atomicLoad(&work[own + COUNT]);
    let inverse = load_number(own + INVERSE);
    let area = area_of(own, zone.radius) / fair_share(zone, count);
    let per_sample = f32(samples) / (PI * max(area, 1e-37));
    let usual = select(FAR_AWAY, f32(count) / max(inverse, 1e-37), inverse > 0.0);
    for (var sample = 0u; sample < samples; sample++) {
        let at = tile * samples + sample;
        let sum = radiance[at];
        let photons_there = atomicLoad(&work[own + SAMPLES + sample]);
        let distance = select(usual, f32(photons_there) / max(sum.w, 1e-37), photons_there > 0u);
        radiance[at] = vec4f(sum.xyz * per_sample, distance);
    }
}
