#import lib/closest_hit
#import lib/guide
#import lib/lobe
#import lib/photon_map
#import lib/sources

// Photons on their way: as passes/photon_map/trace.rs. A lane a path, which is walked twice: first the photons of each are counted, then kept, in the order of
// the paths.

// Of each path how many photons it keeps, and one for their sum; then of all before it.
@group(0) @binding(0) var<storage, read_write> counts: array<u32>;
@group(0) @binding(1) var<storage, read_write> totals: Totals;
@group(0) @binding(2) var<storage, read_write> photons: array<Photon>;

struct Totals {
    // Paths that are kept, and their photons.
    emitted: u32,
    count: u32,
    cut_off: atomic<u32>,
    padding: u32,
}

// Paths, the most photons kept, and the most surfaces that a path meets.
override PATHS: u32 = 1u;
override CAPACITY: u32 = 1u;
override LEGS: u32 = 64u;
// Whether narrow lobes alone reflect photons: they are caustics, which end at whatever else they meet.
override CAUSTICS: bool = false;

const MOST_BY_SHADING = 4.0;

// Irradiance is that of the shading normal: what light along a direction gives it, as a share of what it gives the plane.
fn by_shading(surface: Surface, direction: vec3f) -> f32 {
    let shaded = -dot(surface.normal, direction);
    let plane = -dot(surface.face_normal, direction);
    return select(0.0, clamp(shaded / max(plane, 1e-37), 0.0, MOST_BY_SHADING), plane > 0.0);
}

fn cosine_direction(normal: vec3f, u: vec2f) -> vec3f {
    return frame_around(normal, 0.0) * around(sqrt(1.0 - u.x), 2.0 * PI * u.y);
}

struct Scattered {
    direction: vec3f,
    // Of what arrived; 0 where light would go into the surface.
    share: vec3f,
}

// A direction in which light goes on.
fn scattered(surface: Surface, seed: u32) -> Scattered {
    let u = vec2f(unit(hash(seed ^ 0x5bd1e995u)), unit(hash(seed ^ 0x27d4eb2fu)));
    if !GLOSSY || surface.lobe == 0u {
        return Scattered(cosine_direction(surface.face_normal, u), select(surface.reflectance, vec3f(0.0), CAUSTICS));
    }
    let lobe = lobe_of(surface);
    if CAUSTICS && !is_narrow(lobe) {
        return Scattered(surface.face_normal, vec3f(0.0));
    }
    let by_lobe = select(lobe_share(lobe, surface.reflectance), 1.0, CAUSTICS);
    let axes = mat3x3f(surface.tangent, surface.bitangent, surface.normal);
    var direction = cosine_direction(surface.face_normal, u);
    if unit(hash(seed ^ 0x165667b1u)) < by_lobe {
        direction = normalize(axes * lobe_sample(lobe, surface.outgoing, u));
    }
    let leaving = direction * axes;
    let cosine = dot(surface.face_normal, direction);
    if !(cosine > 0.0 && leaving.z > 0.0) {
        return Scattered(direction, vec3f(0.0));
    }
    let density = by_lobe * lobe_density(lobe, surface.outgoing, leaving) + (1.0 - by_lobe) * cosine / PI;
    var diffuse = select(surface.reflectance, vec3f(0.0), CAUSTICS);
    if surface.lobe == MICROFACETS {
        diffuse *= facets_leave(surface.specular, leaving.z);
    }
    let reflected = diffuse / PI + lobe_value(lobe, surface.outgoing, leaving);
    return Scattered(direction, reflected * (cosine / max(density, 1e-37)));
}

// Follows a path, and keeps its photons from a slot on where it is to keep them; how many there are.
fn walk(number: u32, keeps: bool, slot: u32) -> u32 {
    var start = start_of(number);
    var density = 1.0;
    if CAUSTICS {
        let chosen = guided(number);
        start = chosen.start;
        density = chosen.density;
    }
    let photon = emitted(start);
    if !photon.is_there {
        return 0u;
    }
    var origin = photon.origin;
    var direction = photon.direction;
    var flux = photon.flux / density;
    var count = 0u;
    for (var leg = 0u; leg < LEGS; leg++) {
        let hit = closest_hit(origin, direction, FAR_AWAY);
        // The side that light comes from may be the back of a one-sided surface: nobody sees what that reflects.
        if hit.triangle == NO_TRIANGLE || is_back(hit.triangle, direction) {
            return count;
        }
        let surface = lit_surface(hit.triangle, origin, direction);
        flux *= by_shading(surface, direction);
        if leg > 0u {
            if keeps {
                let ways = packed_way(surface.face_normal) | (packed_way(-direction) << 16u);
                photons[slot + count] = Photon(surface.position, hit.distance, flux / f32(totals.emitted), ways);
            }
            count += 1u;
        }
        let seed = combine(number, leg);
        let next = scattered(surface, seed);
        let survival = min(max(next.share.x, max(next.share.y, next.share.z)), 1.0);
        if unit(hash(seed ^ 0x68bc21ebu)) >= survival {
            return count;
        }
        flux *= next.share / survival;
        origin = surface.position + surface.face_normal * surface_offset(surface.position);
        direction = next.direction;
    }
    if keeps {
        atomicAdd(&totals.cut_off, 1u);
    }
    return count;
}

@compute @workgroup_size(64)
fn count(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let number = (group.x + group.y * groups.x) * 64u + lane;
    if number < PATHS {
        counts[number] = walk(number, false, 0u);
    } else if number == PATHS {
        counts[number] = 0u;
    }
}

// Paths are kept while there is room for all of their photons.
@compute @workgroup_size(1)
fn tell() {
    var low = 0u;
    var high = PATHS;
    while low < high {
        let middle = (low + high + 1u) / 2u;
        if counts[middle] <= CAPACITY {
            low = middle;
        } else {
            high = middle - 1u;
        }
    }
    totals.emitted = low;
    totals.count = counts[low];
    atomicStore(&totals.cut_off, 0u);
}

@compute @workgroup_size(64)
fn keep(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let number = (group.x + group.y * groups.x) * 64u + lane;
    if number < totals.emitted {
        walk(number, true, counts[number]);
    }
}
