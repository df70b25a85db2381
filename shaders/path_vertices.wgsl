#import lib/closest_hit
#import lib/frame
#import lib/random
#import lib/scene

// Where paths from the camera meet surfaces: as passes/path_vertices.rs walks them.

@group(0) @binding(0) var position: texture_2d<f32>;
@group(0) @binding(1) var normal: texture_2d<f32>;

struct WalkedVertex {
    position: vec3f,
    // 1 for a vertex, 0 behind a path's end.
    is_there: f32,
    normal: vec3f,
    padding: f32,
}

// Those of a path one after the other.
@group(0) @binding(2) var<storage, read_write> vertices: array<WalkedVertex>;

override PATHS: u32 = 1u;
override LEGS: u32 = 1u;

// As math::lattice.
fn pixel_of(number: u32, size: vec2u) -> vec2u {
    let along = vec2u(0x80000000u) + number * vec2u(3242174889u, 2447445414u);
    return ((along >> vec2u(16u)) * size) >> vec2u(16u);
}

fn cosine_direction(normal: vec3f, u: vec2f) -> vec3f {
    let angle = 6.2831853 * u.y;
    let radius = sqrt(u.x);
    return frame_around(normal, 0.0) * vec3f(radius * cos(angle), radius * sin(angle), sqrt(1.0 - u.x));
}

@compute @workgroup_size(64)
fn walk(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let number = (group.x + group.y * groups.x) * 64u + lane;
    if number >= PATHS {
        return;
    }
    let pixel = pixel_of(number, textureDimensions(position));
    let seen = textureLoad(position, pixel, 0);
    var at = WalkedVertex(seen.xyz, f32(seen.w > 0.0), textureLoad(normal, pixel, 0).xyz, 0.0);
    for (var leg = 0u; leg < LEGS; leg++) {
        if at.is_there > 0.0 {
            at = next_vertex(at, combine(number, leg));
        }
        vertices[LEGS * number + leg] = at;
    }
}

// By a ray whose density is that of the light that arrives from there, as far as the cosine tells.
fn next_vertex(from_here: WalkedVertex, seed: u32) -> WalkedVertex {
    let direction = cosine_direction(from_here.normal, vec2f(unit(hash(seed)), unit(hash(seed ^ 0x5bd1e995u))));
    let origin = from_here.position + from_here.normal * surface_offset(from_here.position);
    let hit = nearest_hit(origin, direction, FAR_AWAY, false);
    if hit.triangle == NO_TRIANGLE {
        return WalkedVertex(vec3f(0.0), 0.0, vec3f(0.0), 0.0);
    }
    let surface = lit_surface(hit.triangle, origin, direction);
    return WalkedVertex(surface.position, 1.0, surface.normal, 0.0);
}
