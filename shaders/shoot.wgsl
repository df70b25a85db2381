#import lib/colour
#import lib/lightmap
#import lib/frame
#import lib/random
#import lib/tile
#import lib/trace
#import lib/scene

// What chosen texels send out, brought to every texel that they see: as passes/shoot/mod.rs.

@group(0) @binding(0) var<storage, read> surfaces: array<TexelSurface>;
// Rays a luminance, as the last iteration has found them to be as many as they should; 0 where that is not known: texel · SIDES + side.
@group(0) @binding(1) var<storage, read_write> parts: array<f32>;
@group(0) @binding(2) var<storage, read> shots: array<Shot>;
// Irradiance, and the luminance of what the bound takes: texel · SIDES + side.
@group(0) @binding(3) var<storage, read_write> fresh: array<vec4f>;

// The triangle that each sample of a shooter's view sees, + 1; 0 where it sees none, or is none.
@group(0) @binding(4) var<storage, read> seen: array<u32>;

// The seed of its choices.
@group(0) @binding(5) var<uniform> iteration: vec4u;

override HAS_VIEWS: bool = false;
// Five squares; otherwise x and y of the unit direction.
override HEMICUBE: bool = false;
override VIEW_RESOLUTION: u32 = 64u;
override SIDES: u32 = 1u;
override TEXELS: u32 = 1u;
override SHOOTERS: u32 = 1u;
// Shadow rays of a side of a texel in the mean; 0 where all shots are asked.
override RAYS: f32 = 0.0;

// What a shooter brings to a side of a texel that it sees; nothing where that is turned away.
struct Brought {
    side: u32,
    light: vec4f,
}

fn brought(shooter: u32, surface: TexelSurface) -> Brought {
    let way = surface.position - shots[shooter].position;
    let leaving = dot(way, shots[shooter].normal);
    let along = -dot(way, surface.normal);
    let side = select(0u, 1u, along < 0.0);
    if !(leaving > 0.0 && along != 0.0) || side >= SIDES {
        return Brought(0u, vec4f(0.0));
    }
    let shot = shots[shooter];
    let inverse = 1.0 / dot(way, way);
    let share = leaving * inverse * (abs(along) * inverse);
    let bounded = share * min(1.0 / (inverse * max(shot.nearest, surface.area * NEAREST_TEXEL)), 1.0);
    return Brought(side, vec4f(shot.flux * bounded, luminance(shot.flux) * (share - bounded)));
}

// The share of the way to a shooter that has to be free: it is on a surface itself.
const FREE = 0.9999;

fn is_hidden(shooter: u32, surface: vec3f, normal: vec3f) -> bool {
    let start = surface + normal * surface_offset(surface);
    let way = shots[shooter].position - start;
    return trace_occluded(start, way, FREE);
}

fn along_edge(share: f32, samples: u32) -> u32 {
    return min(u32(max(0.5 * (share + 1.0) * f32(samples), 0.0)), samples - 1u);
}

// The sample of a view that a direction in its frame falls on, of any length: as Shape::sample_at.
fn sample_at(direction: vec3f) -> vec2u {
    if !HEMICUBE {
        let flat = direction.xy / length(direction);
        return vec2u(along_edge(flat.x, VIEW_RESOLUTION), along_edge(flat.y, VIEW_RESOLUTION));
    }
    let size = abs(direction.xy);
    if direction.z >= max(size.x, size.y) {
        let flat = direction.xy / direction.z;
        return vec2u(along_edge(flat.x, VIEW_RESOLUTION), along_edge(flat.y, VIEW_RESOLUTION));
    }
    var side = 0u;
    var ahead = vec2f(direction.x, -direction.y);
    if size.x >= size.y {
        if direction.x <= 0.0 {
            side = 2u;
            ahead = vec2f(-direction.x, direction.y);
        }
    } else if direction.y < 0.0 {
        side = 1u;
        ahead = vec2f(-direction.y, -direction.x);
    } else {
        side = 3u;
        ahead = vec2f(direction.y, direction.x);
    }
    let half = VIEW_RESOLUTION / 2u;
    let row = min(u32(max((1.0 - direction.z / ahead.x) * f32(half), 0.0)), half - 1u);
    return vec2u(along_edge(ahead.y / ahead.x, VIEW_RESOLUTION), VIEW_RESOLUTION + side * half + row);
}

const NOTHING = 0u;
const SOMETHING = 1u;
const UNKNOWN = 2u;
// As passes/shoot/views.rs.
const LEVEL = 1e-3;

// What is between a shooter and a texel, by the triangle that the nearest sample sees: as Views::between.
fn between(shooter: u32, surface: TexelSurface) -> u32 {
    if !HAS_VIEWS {
        return UNKNOWN;
    }
    let way = surface.position - shots[shooter].position;
    let frame = frame_around(shots[shooter].normal, 0.0);
    let number = seen[atlas_place(shooter, sample_at(transpose(frame) * way))];
    if number == 0u {
        return UNKNOWN;
    }
    let triangle = number - 1u;
    if triangle == surface.triangle {
        return NOTHING;
    }
    if ALPHA_MASKS && (scene_material(material_of(triangle)).flags & HOLES) != 0u {
        return UNKNOWN;
    }
    let hit = intersect_plane(triangle, shots[shooter].position, way);
    if hit.determinant == 0.0 {
        return UNKNOWN;
    }
    if abs(hit.distance - 1.0) < LEVEL {
        return NOTHING;
    }
    let b = hit.barycentric;
    let is_met = hit.distance > LEVEL && hit.distance < 1.0 && b.x >= 0.0 && b.y >= 0.0 && b.x + b.y <= 1.0;
    return select(UNKNOWN, SOMETHING, is_met);
}

// Which of the shots at a side of a texel are asked: as Side of passes/shoot/eight.rs.
struct Side {
    parts: f32,
    start: f32,
    next: f32,
    asked: f32,
}

const MOST_PARTS = 1e38;
const MOST_ASKED = 4.0;
const LEAST_ASKED = 1e-3;

fn sides_of(texel: u32, surface: TexelSurface) -> array<Side, 2> {
    var sides = array(Side(MOST_PARTS, 0.0, 0.0, 0.0), Side(MOST_PARTS, 0.0, 0.0, 0.0));
    if RAYS == 0.0 {
        return sides;
    }
    var is_new = false;
    for (var side = 0u; side < SIDES; side++) {
        sides[side].parts = parts[texel * SIDES + side];
        sides[side].start = unit(combine(iteration.x, texel * SIDES + side));
        sides[side].next = sides[side].start;
        is_new = is_new || sides[side].parts == 0.0;
    }
    if !is_new {
        return sides;
    }
    var sums = array<f32, 2>();
    for (var shooter = 0u; shooter < SHOOTERS; shooter++) {
        let own = brought(shooter, surface);
        sums[own.side] += luminance(own.light.rgb);
    }
    for (var side = 0u; side < SIDES; side++) {
        if sides[side].parts == 0.0 {
            sides[side].parts = select(MOST_PARTS, min(RAYS / sums[side], MOST_PARTS), sums[side] > 0.0);
        }
    }
    return sides;
}

fn parts_next(side: Side) -> f32 {
    let count = side.asked + side.start - side.next;
    if count > MOST_ASKED * RAYS {
        return 0.0;
    }
    if count > LEAST_ASKED * RAYS {
        return min(side.parts * (RAYS / count), MOST_PARTS);
    }
    return select(side.parts, 0.0, side.parts < MOST_PARTS);
}

@compute @workgroup_size(64)
fn shoot(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let texel = (group.x + group.y * groups.x) * 64u + lane;
    if texel >= TEXELS {
        return;
    }
    let surface = surfaces[texel];
    var sides = sides_of(texel, surface);
    var light = array<vec4f, 2>();
    for (var shooter = 0u; shooter < SHOOTERS; shooter++) {
        let own = brought(shooter, surface);
        let rays = luminance(own.light.rgb) * sides[own.side].parts;
        if rays < 1.0 {
            sides[own.side].next -= rays;
            if sides[own.side].next >= 0.0 {
                continue;
            }
            sides[own.side].next += 1.0;
        }
        sides[own.side].asked += 1.0;
        let told = between(shooter, surface);
        if told == NOTHING || (told == UNKNOWN && !is_hidden(shooter, surface.position, normal_of_side(surface, own.side))) {
            light[own.side] += own.light * max(1.0 / rays, 1.0);
        }
    }
    for (var side = 0u; side < SIDES; side++) {
        fresh[texel * SIDES + side] = light[side];
        if RAYS > 0.0 {
            parts[texel * SIDES + side] = parts_next(sides[side]);
        }
    }
}
