#import lib/closest_hit
#import lib/lobe
#import lib/random

// Where samples that meet a lobe go on to, until they stay at a surface: as passes/seen_light/lobe_walk.rs.

// Lobes that a sample may go on by.
const MOST_LOBES = 4u;
// Apart from the seeds of lights.
const FIRST_WALK_SEED = 101u;
// Backs of one-sided surfaces that a ray may pass.
const MOST_BACKS = 8u;

struct WalkStep {
    // Whether the sample goes on; otherwise it stays, or has left the scene where its share is black.
    goes_on: bool,
    // What is reflected of the light from where it is now, over how often it comes there.
    share: vec3f,
    surface: Surface,
    // The triangle that it is on, + 1.
    triangle: u32,
}

fn walk_seed(seed: u32, number: u32) -> u32 {
    return combine(seed, FIRST_WALK_SEED + number);
}

// From a surface with a lobe by it to the next, or not, as chance has it.
fn walk_step(surface: Surface, seed: u32) -> WalkStep {
    let lobe = lobe_of(surface);
    let by_lobe = select(1.0, lobe_share(lobe, surface.reflectance), any(surface.reflectance != vec3f(0.0)));
    if unit(hash(seed ^ 0x165667b1u)) >= by_lobe {
        return WalkStep(false, vec3f(1.0 / (1.0 - by_lobe)), surface, 0u);
    }
    let u = vec2f(unit(hash(seed ^ 0x5bd1e995u)), unit(hash(seed ^ 0x27d4eb2fu)));
    let incoming = lobe_sample(lobe, surface.outgoing, u);
    let density = by_lobe * lobe_density(lobe, surface.outgoing, incoming);
    let direction = normalize(surface.tangent * incoming.x + surface.bitangent * incoming.y + surface.normal * incoming.z);
    if !(incoming.z > 0.0 && density > 0.0 && dot(surface.face_normal, direction) > 0.0) {
        return WalkStep(false, vec3f(0.0), surface, 0u);
    }
    var origin = surface.position + surface.face_normal * surface_offset(surface.position);
    for (var backs = 0u; backs < MOST_BACKS; backs++) {
        let hit = closest_hit(origin, direction, FAR_AWAY);
        if hit.triangle == NO_TRIANGLE {
            break;
        }
        if !is_back(hit.triangle, direction) {
            let share = lobe_value(lobe, surface.outgoing, incoming) * (incoming.z / density);
            return WalkStep(true, share, surface_seen(hit.triangle, origin, direction), hit.triangle + 1u);
        }
        let behind = origin + direction * hit.distance;
        origin = behind + direction * surface_offset(behind);
    }
    return WalkStep(false, vec3f(0.0), surface, 0u);
}

fn with_lobe_albedo(surface: Surface) -> vec3f {
    if surface.lobe == 0u {
        return surface.reflectance;
    }
    return surface.reflectance + lobe_albedo(lobe_of(surface), surface.outgoing);
}

// Where the irradiance is asked that a sample brings.
struct Stay {
    position: vec3f,
    normal: vec3f,
    // What comes back of it, times pi.
    reflectance: vec3f,
    // The triangle that it is on, + 1.
    triangle: u32,
}

// Where the sample stays that meets a surface of a triangle, whose number + 1 is given.
fn stay_of(first: Surface, of_triangle: u32, seed: u32) -> Stay {
    var at = first;
    var triangle = of_triangle;
    var share = vec3f(1.0);
    for (var number = 0u; GLOSSY && number < MOST_LOBES && at.lobe != 0u; number++) {
        let next = walk_step(at, walk_seed(seed, number));
        share *= next.share;
        if !next.goes_on {
            return Stay(at.position, at.normal, share * at.reflectance, triangle);
        }
        at = next.surface;
        triangle = next.triangle;
    }
    // The last lobe reflects as if light came alike from all sides.
    return Stay(at.position, at.normal, share * with_lobe_albedo(at), triangle);
}
