#import lib/scene
#import lib/frame
#import lib/record
#import lib/tile

// The triangle that each sample of a tile sees, by rasterising the scene from the record.

struct TileView {
    right: vec3f,
    minimum_x: f32,
    up: vec3f,
    minimum_y: f32,
    forward: vec3f,
    maximum_x: f32,
    maximum_y: f32,
    padding_a: f32,
    padding_b: f32,
    padding_c: f32,
}

// A camera where a request stands, as vertices read it.
struct TileCamera {
    // A point relative to the origin, times these: coordinates in the clip space, the last of them its w.
    right: vec3f,
    near: f32,
    up: vec3f,
    padding_a: f32,
    forward: vec3f,
    padding_b: f32,
    origin: vec3f,
    padding_c: f32,
}

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read> views: array<TileView>;

// tile · VIEWS + view.
@group(0) @binding(3) var<storage, read_write> cameras: array<TileCamera>;

override VIEWS: u32 = 1u;

@compute @workgroup_size(64)
fn aim(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = (group.x + group.y * groups.x) * 64u + lane;
    if index >= TILE_CAPACITY * VIEWS {
        return;
    }
    let request = requests[index / VIEWS];
    let view = views[index % VIEWS];
    let frame = frame_around(request.normal, request.turn);
    let centre = 0.5 * vec2f(view.maximum_x + view.minimum_x, view.maximum_y + view.minimum_y);
    let half = 0.5 * vec2f(view.maximum_x - view.minimum_x, view.maximum_y - view.minimum_y);
    let offset = surface_offset(request.position);
    var camera: TileCamera;
    camera.right = frame * (view.right - view.forward * centre.x) / half.x;
    camera.up = frame * (view.up - view.forward * centre.y) / half.y;
    camera.forward = frame * view.forward;
    // Nearer than any wall beside a visible point; depths are floats, which keep their precision all the same.
    camera.near = 1e-4 * offset;
    camera.origin = request.position + request.normal * offset;
    cameras[index] = camera;
}

struct Fragment {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat, either) triangle: u32,
    @location(1) @interpolate(flat, either) instance: u32,
}

fn in_frame(request: Request, point: vec3f) -> vec3f {
    let origin = request.position + request.normal * surface_offset(request.position);
    return transpose(frame_around(request.normal, request.turn)) * (point - origin);
}

// Perspective views. The instance is tile · VIEWS + view, the vectors are its camera.
@vertex
fn vertex(
    @location(0) position: vec3f,
    @location(1) right_near: vec4f,
    @location(2) up: vec4f,
    @location(3) forward: vec4f,
    @location(4) origin: vec4f,
    @builtin(vertex_index) index: u32,
    @builtin(instance_index) instance: u32,
) -> Fragment {
    let local = position - origin.xyz;
    let clip = vec4f(dot(local, right_near.xyz), dot(local, up.xyz), right_near.w, dot(local, forward.xyz));
    return Fragment(clip, index / 3u, instance);
}

// A corner of one of the 4^level parts of a triangle: barycentric weights of corners 1 and 2.
fn part_corner(part: u32, corner: u32, level: u32) -> vec2f {
    var row = u32(sqrt(f32(part)));
    // The root of a large number may round across a square.
    row = select(row, row - 1u, row * row > part);
    row = select(row, row + 1u, (row + 1u) * (row + 1u) <= part);
    let along = part - row * row;
    let column = along / 2u;
    var at = vec2u(row, column);
    if along % 2u == 0u {
        at = select(at, vec2u(row + 1u, column + corner - 1u), corner > 0u);
    } else if corner == 1u {
        at = vec2u(row + 1u, column + 1u);
    } else if corner == 2u {
        at = vec2u(row, column + 1u);
    }
    return vec2f(f32(at.x - at.y), f32(at.y)) / f32(1u << level);
}

fn part_position(triangle: u32, part: u32, corner: u32, level: u32) -> vec3f {
    let b = part_corner(part, corner, level);
    return scene_corners[3u * triangle].xyz + scene_corners[3u * triangle + 1u].xyz * b.x + scene_corners[3u * triangle + 2u].xyz * b.y;
}

// How far outside the disc the horizon's underside begins: parts up to 96° wide reach all around it.
const BEYOND = 1.5;

// The level of a triangle so near and so large that its parts would still bend too much: it is drawn over the whole tile, and
// each sample's ray tells whether it meets it.
const WHOLE = 15u;

fn whole_tile(index: u32, instance: u32) -> Fragment {
    let corner = index % 6u;
    let right = corner == 1u || corner >= 4u;
    let up = corner == 2u || corner == 3u || corner == 5u;
    return Fragment(vec4f(select(-1.0, 1.0, right), select(-1.0, 1.0, up), 0.5, 1.0), index / 6u, instance);
}

fn hemispherical_depth(request: Request, distance: f32) -> f32 {
    let near = 0.5 * surface_offset(request.position);
    return near / (near + distance);
}

// The hemispherical projection: x and y of the unit direction. The instance is tile + level << 24: each triangle is
// drawn as 4^level parts, so that its edges may curve.
@vertex
fn vertex_hemispherical(@builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> Fragment {
    let level = instance >> 24u;
    if level == WHOLE {
        return whole_tile(index, instance);
    }
    let request = requests[instance & 0xffffffu];
    let parts = 1u << (2u * level);
    let triangle = index / (3u * parts);
    let part = (index / 3u) % parts;
    let corners = array(part_position(triangle, part, 0u, level), part_position(triangle, part, 1u, level), part_position(triangle, part, 2u, level));
    let origin = request.position + request.normal * surface_offset(request.position);
    let heights = vec3f(dot(corners[0] - origin, request.normal), dot(corners[1] - origin, request.normal), dot(corners[2] - origin, request.normal));
    if max(heights.x, max(heights.y, heights.z)) <= 0.0 {
        // Below the horizon: bent upwards, a part that surrounds the record's foot would hide everything.
        return Fragment(vec4f(2.0, 2.0, 0.5, 1.0), triangle, instance);
    }
    let local = in_frame(request, part_position(triangle, part, index % 3u, level));
    let distance = max(length(local), 1e-30);
    let direction = local / distance;
    let radius = max(length(direction.xy), 1e-12);
    // Below the horizon the disc is continued outwards, so that triangles that cross it keep their shape, and so far that
    // the straight edge of a part lies outside the round horizon: corners on it would leave a gap.
    let at = direction.xy * select(1.0, BEYOND * (2.0 - radius) / radius, direction.z < 0.0);
    return Fragment(vec4f(at.x, -at.y, hemispherical_depth(request, distance), 1.0), triangle, instance);
}

@fragment
fn fragment(in: Fragment) -> @location(0) u32 {
    return in.triangle + 1u;
}

@group(0) @binding(2) var<storage, read> samples: array<TileSample>;

// Where a sample's ray meets the plane of the triangle.
fn plane_hit(in: Fragment, tile: u32) -> PlaneHit {
    let at = vec2u(in.clip.xy) - tile_corner(tile);
    let request = requests[tile];
    let direction = frame_around(request.normal, request.turn) * samples[at.y * TILE_WIDTH + at.x].direction;
    let origin = request.position + request.normal * surface_offset(request.position);
    return intersect_plane(in.triangle, origin, direction);
}

// For scenes with one-sided surfaces or alpha masks.
fn is_seen(triangle: u32, hit: PlaneHit) -> bool {
    let from_behind = ONE_SIDED && hit.determinant < 0.0 && (scene_materials[material_of(triangle)].flags & TWO_SIDED) == 0u;
    return !from_behind && !(ALPHA_MASKS && is_hole(triangle, hit.barycentric));
}

@fragment
fn fragment_tested(in: Fragment) -> @location(0) u32 {
    if !is_seen(in.triangle, plane_hit(in, in.instance / VIEWS)) {
        discard;
    }
    return in.triangle + 1u;
}

struct Seen {
    @location(0) triangle: u32,
    @builtin(frag_depth) depth: f32,
}

// Widens triangles that rays are tested against, so that rounding opens no gaps between them.
const RIM = 1e-5;

@fragment
fn fragment_hemispherical(in: Fragment) -> Seen {
    let tile = in.instance & 0xffffffu;
    var seen = Seen(in.triangle + 1u, in.clip.z);
    let is_whole = in.instance >> 24u == WHOLE;
    if is_whole || ONE_SIDED || ALPHA_MASKS {
        let hit = plane_hit(in, tile);
        if is_whole {
            let b = hit.barycentric;
            let meets = hit.determinant != 0.0 && hit.distance > 0.0 && min(b.x, b.y) >= -RIM && b.x + b.y <= 1.0 + RIM;
            if !meets {
                discard;
            }
            seen.depth = hemispherical_depth(requests[tile], hit.distance);
        }
        if !is_seen(in.triangle, hit) {
            discard;
        }
    }
    return seen;
}
