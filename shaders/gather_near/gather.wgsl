#import lib/closest_hit
#import lib/frame
#import lib/in_texture
#import lib/lightmap
#import lib/random

// What is nearer to texels than the bound of shots: as passes/gather_near.rs.

@group(0) @binding(0) var<storage, read> surfaces: array<TexelSurface>;
// Of each cell of the texture the number of its first texel + 1, 0 where there is none, and its parts.
@group(0) @binding(1) var<storage, read> cells: array<vec4u>;
// Where each triangle's corners lie: two a triangle.
@group(0) @binding(2) var<storage, read> atlas_corners: array<vec4f>;
// Radiance, and the square of the distance within which shots are bounded; less than 0 where no shot has come yet.
@group(0) @binding(3) var<storage, read> shine: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> near: array<vec4f>;
// Directions by the cosine, one set after the other.
@group(0) @binding(5) var<uniform> rays: array<vec4f, 1024>;

// The seed of the gathering.
@group(0) @binding(6) var<uniform> gathering: vec4u;

override SIDES: u32 = 1u;
override PLACES: u32 = 1u;
override EDGE: u32 = 16u;
override RAYS: u32 = 64u;
override SETS: u32 = 1u;

@compute @workgroup_size(64)
fn gather(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = (group.x + group.y * groups.x) * 64u + lane;
    if place >= PLACES {
        return;
    }
    if shine[place].w < 0.0 {
        near[place] = vec4f(0.0);
        return;
    }
    let own = surfaces[place / SIDES];
    let normal = normal_of_side(own, place % SIDES);
    let origin = own.position + normal * surface_offset(own.position);
    let frame = frame_around(normal, 6.2831853 * unit(combine(gathering.x, place)));
    let chosen = hash(combine(gathering.x, place)) % SETS;
    var sum = vec3f(0.0);
    for (var ray = 0u; ray < RAYS; ray++) {
        sum += along(own, origin, frame * rays[chosen * RAYS + ray].xyz);
    }
    near[place] = vec4f(sum * (3.14159265 / f32(RAYS)), 0.0);
}

// The light along a ray, in the share that is not shot.
fn along(own: TexelSurface, origin: vec3f, direction: vec3f) -> vec3f {
    let hit = nearest_hit(origin, direction, FAR_AWAY, false);
    if hit.triangle == NO_TRIANGLE {
        return vec3f(0.0);
    }
    let e1 = scene_corners[3u * hit.triangle + 1u].xyz;
    let e2 = scene_corners[3u * hit.triangle + 2u].xyz;
    let position = origin + direction * hit.distance;
    let weights = nearest_weights(e1, e2, position - scene_corners[3u * hit.triangle].xyz);
    let place = laid_at(atlas_corners[2u * hit.triangle], atlas_corners[2u * hit.triangle + 1u], weights);
    let at = min(vec2u(place), vec2u(EDGE - 1u));
    let cell = cells[at.y * EDGE + at.x];
    let from_behind = dot(cross(e1, e2), direction) > 0.0;
    if cell.x == 0u || (from_behind && SIDES == 1u) {
        return vec3f(0.0);
    }
    // What is beneath a wall sees what is there, not what its cell has beside it.
    let there = shine[(cell.x - 1u + part_at(cell, place - vec2f(at), vec3<bool>(true))) * SIDES + u32(from_behind)];
    let bound = max(abs(there.w), own.area * NEAREST_TEXEL);
    return there.rgb * max(1.0 - hit.distance * hit.distance / bound, 0.0);
}
