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
    // Samples along the edges.
    width: f32,
    height: f32,
    padding: f32,
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

// A view's part of what the sift reads and writes.
struct SiftView {
    // Words of what may be seen: the first, and the one after the last.
    first: u32,
    end: u32,
    // Room for what is seen, in triangles.
    base: u32,
    room: u32,
}

// Up to 32 triangles each: the number of the first × 64, and how many.
@group(0) @binding(4) var<storage, read> words: array<u32>;
// For each word the triangles that lie wholly in the view, and those that cross its bounds: a bit each.
@group(0) @binding(5) var<storage, read_write> masks: array<vec2u>;
@group(0) @binding(6) var<storage, read> sifted: array<SiftView>;
// How many triangles each view keeps: inside, crossing.
@group(0) @binding(7) var<storage, read_write> kept: array<vec2u>;
// Three of each triangle: those inside from the start of a view's room on, those that cross from its end back.
@group(0) @binding(8) var<storage, read_write> indices: array<u32>;

const OUT_OF_SIGHT = 0u;
const INSIDE = 1u;
const CROSSING = 2u;

// How far rounding and the fixed grid of rasterisers move an edge, in widths of a sample.
const MOVED = 0.02;

// x, y and w in the clip space.
fn projected(camera: TileCamera, vector: vec3f) -> vec3f {
    return vec3f(dot(vector, camera.right), dot(vector, camera.up), dot(vector, camera.forward));
}

// Whether a triangle may hold the centre of a sample.
fn sight(camera: TileCamera, size: vec2f, triangle: u32) -> u32 {
    let a = projected(camera, scene_corners[3u * triangle].xyz - camera.origin);
    let b = a + projected(camera, scene_corners[3u * triangle + 1u].xyz);
    let c = a + projected(camera, scene_corners[3u * triangle + 2u].xyz);
    let nearest = min(a.z, min(b.z, c.z));
    let margin = surface_offset(camera.origin);
    if nearest <= margin {
        // In front of the record and behind it.
        let w = vec3f(a.z, b.z, c.z) + margin;
        let x = vec3f(a.x, b.x, c.x);
        let y = vec3f(a.y, b.y, c.y);
        let is_beside = all(x > w) || all(-x > w) || all(y > w) || all(-y > w);
        return select(CROSSING, OUT_OF_SIGHT, is_beside || max(w.x, max(w.y, w.z)) < 0.0);
    }
    // In widths of a sample.
    let p = (a.xy / a.z * 0.5 + 0.5) * size;
    let q = (b.xy / b.z * 0.5 + 0.5) * size;
    let r = (c.xy / c.z * 0.5 + 0.5) * size;
    let moved = MOVED + max(size.x, size.y) * margin / nearest;
    let low = min(p, min(q, r)) - moved;
    let high = max(p, max(q, r)) + moved;
    let first = ceil(low - 0.5) + 0.5;
    let last = floor(high - 0.5) + 0.5;
    let is_beside = any((first > last) | (last < vec2f(0.0)) | (first > size));
    let few = all(last - first < vec2f(1.5));
    if is_beside || (few && !holds(p, q, r, first, moved) && !holds(p, q, r, vec2f(last.x, first.y), moved)
            && !holds(p, q, r, vec2f(first.x, last.y), moved) && !holds(p, q, r, last, moved)) {
        return OUT_OF_SIGHT;
    }
    return select(INSIDE, CROSSING, any((low < vec2f(0.0)) | (high > size)));
}

// Whether a triangle holds a point, or nearly.
fn holds(p: vec2f, q: vec2f, r: vec2f, point: vec2f, moved: f32) -> bool {
    let sides = vec3f(side(p, q, point), side(q, r, point), side(r, p, point));
    let slack = moved * vec3f(length_1(q - p), length_1(r - q), length_1(p - r));
    return all(sides >= -slack) || all(sides <= slack);
}

fn side(p: vec2f, q: vec2f, point: vec2f) -> f32 {
    return (q.x - p.x) * (point.y - p.y) - (q.y - p.y) * (point.x - p.x);
}

fn length_1(vector: vec2f) -> f32 {
    return abs(vector.x) + abs(vector.y);
}

var<workgroup> counts: array<vec2u, 64>;

// Keeps the triangles that a view's samples may see, in the order in which they come: a workgroup a view.
@compute @workgroup_size(64)
fn sift(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = group.x + group.y * groups.x;
    if index >= TILE_CAPACITY * VIEWS {
        return;
    }
    let view = sifted[index];
    let camera = cameras[index];
    let size = vec2f(views[index % VIEWS].width, views[index % VIEWS].height);
    let share = (view.end - view.first + 63u) / 64u;
    let first = min(view.first + lane * share, view.end);
    let end = min(first + share, view.end);
    var mine = vec2u(0u);
    for (var at = first; at < end; at++) {
        let word = words[at];
        let triangle = word >> 6u;
        var mask = vec2u(0u);
        for (var bit = 0u; bit < (word & 63u); bit++) {
            let seen = sight(camera, size, triangle + bit);
            mask |= vec2u(select(0u, 1u, seen == INSIDE), select(0u, 1u, seen == CROSSING)) << vec2u(bit);
        }
        masks[at] = mask;
        mine += countOneBits(mask);
    }
    counts[lane] = mine;
    workgroupBarrier();
    var before = vec2u(0u);
    var total = vec2u(0u);
    for (var other = 0u; other < 64u; other++) {
        before += select(vec2u(0u), counts[other], other < lane);
        total += counts[other];
    }
    if view.first == view.end {
        // What it may see found no room in the words.
        total.x = view.room + 1u;
    }
    if lane == 0u {
        kept[index] = total;
    }
    if total.x + total.y > view.room {
        return;
    }
    var inside = view.base + before.x;
    var crossing = view.base + view.room - before.y;
    for (var at = first; at < end; at++) {
        let triangle = words[at] >> 6u;
        let mask = masks[at];
        for (var left = mask.x; left != 0u; left &= left - 1u) {
            write_triangle(inside, triangle + firstTrailingBit(left));
            inside++;
        }
        for (var left = mask.y; left != 0u; left &= left - 1u) {
            crossing--;
            write_triangle(crossing, triangle + firstTrailingBit(left));
        }
    }
}

fn write_triangle(at: u32, triangle: u32) {
    for (var corner = 0u; corner < 3u; corner++) {
        indices[3u * at + corner] = 3u * triangle + corner;
    }
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
    let from_behind = ONE_SIDED && hit.determinant < 0.0 && (scene_material(material_of(triangle)).flags & TWO_SIDED) == 0u;
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
