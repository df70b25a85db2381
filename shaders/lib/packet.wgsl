#import lib/hierarchy

// Eight rays from one point, walked through the hierarchy by one lane. What depends on the point and a node or a
// triangle alone is computed once for all of them, and neighbouring rays visit nearly the same nodes.

// Four rays: a component of a vector a ray.
struct Rays {
    x: vec4f,
    y: vec4f,
    z: vec4f,
    inverse_x: vec4f,
    inverse_y: vec4f,
    inverse_z: vec4f,
    // Of the nearest surface seen so far, in extents of the scene; and as a fraction, which is ahead of it within a leaf.
    distance: vec4f,
    height: vec4f,
    size: vec4f,
    // Triangle + 1, or 0.
    seen: vec4u,
}

// Rays that are not alive meet nothing.
fn rays(a: vec3f, b: vec3f, c: vec3f, d: vec3f, alive: vec4<bool>) -> Rays {
    let directions = transpose(mat4x3f(a, b, c, d));
    let inverses = transpose(mat4x3f(safe_inverse(a), safe_inverse(b), safe_inverse(c), safe_inverse(d)));
    let limit = select(vec4f(-1.0), vec4f(FAR_AWAY), alive);
    return Rays(directions[0], directions[1], directions[2], inverses[0], inverses[1], inverses[2], limit, limit, vec4f(1.0), vec4u(0u));
}

// A box as seen from the rays' origin.
struct SeenBox {
    centre: vec3f,
    // Half its size, widened by the rounding of its distances so that no box is missed.
    half: vec3f,
}

fn seen_box(node: vec4u, grid: Grid) -> SeenBox {
    let low = lower_bound(node, grid);
    let high = upper_bound(node, grid);
    return SeenBox(0.5 * (low + high), 0.5 * (high - low) + 4e-7 * (abs(low) + abs(high)));
}

// Which rays enter a box before what they have seen.
fn enters(rays: Rays, at: SeenBox) -> vec4<bool> {
    let x = at.centre.x * rays.inverse_x;
    let y = at.centre.y * rays.inverse_y;
    let z = at.centre.z * rays.inverse_z;
    let wide = at.half.x * abs(rays.inverse_x);
    let tall = at.half.y * abs(rays.inverse_y);
    let deep = at.half.z * abs(rays.inverse_z);
    // Numbers as bits stand in the order of the numbers as long as at most one is negative, and 0 is above all negative ones. Drivers that run on
    // the CPU spend three instructions on the least of floats, for NaN's sake, and one on that of integers.
    let near = max(max(bits(x - wide), bits(y - tall)), max(bits(z - deep), vec4i(0)));
    let far = min(min(bits(x + wide), bits(y + tall)), min(bits(z + deep), bits(rays.distance)));
    return near <= far;
}

fn bits(v: vec4f) -> vec4i {
    return bitcast<vec4i>(v);
}

// A triangle as seen from the rays' origin: with it each ray needs three inner products (Möller and Trumbore 1997).
struct SeenTriangle {
    index: u32,
    plane: vec3f,
    // Products with a direction, over the determinant, are the barycentric weights of corners 1 and 2.
    first: vec3f,
    second: vec3f,
    height: f32,
    rounding: f32,
    two_sided: bool,
}

fn seen_triangle(index: u32, grid: Grid) -> SeenTriangle {
    let at = corners(index, grid);
    let second = cross(at.point, at.e1);
    var two_sided = true;
    if ONE_SIDED {
        two_sided = (scene_material(material_of(index)).flags & TWO_SIDED) != 0u;
    }
    return SeenTriangle(index, cross(at.e2, at.e1), cross(at.e2, at.point), second, dot(at.e2, second), at.rounding, two_sided);
}

fn products(rays: Rays, v: vec3f) -> vec4f {
    return rays.x * v.x + rays.y * v.y + rays.z * v.z;
}

// The signs of some numbers, and numbers of which some have changed theirs.
fn signs(v: vec4f) -> vec4u {
    return bitcast<vec4u>(v) & vec4u(0x80000000u);
}

fn turned(v: vec4f, signs: vec4u) -> vec4f {
    return bitcast<vec4f>(bitcast<vec4u>(v) ^ signs);
}

// The rays after they have met a triangle. Distances are compared as fractions, without a division. Of two at the same distance the first in the
// scene's order is seen, so that the order of the walk does not show.
fn meet(before: Rays, triangle: SeenTriangle) -> Rays {
    let determinant = products(before, triangle.plane);
    let sign = signs(determinant);
    let size = abs(determinant);
    let u = turned(products(before, triangle.first), sign);
    let v = turned(products(before, triangle.second), sign);
    let height = turned(vec4f(triangle.height), sign);
    let here = height * before.size;
    let there = before.height * size;
    let number = vec4u(triangle.index + 1u);
    let least = vec4f(-triangle.rounding);
    let inside = (u >= least) & (v >= least) & (u + v <= size - least) & (height > vec4f(0.0));
    var met = inside & ((here < there) | ((here == there) & (number < before.seen)));
    if ONE_SIDED {
        met = met & ((sign == vec4u(0u)) | vec4<bool>(triangle.two_sided));
    }
    if ALPHA_MASKS {
        let i = triangle.index;
        let s = u / size;
        let t = v / size;
        let holes = vec4<bool>(is_hole(i, vec2f(s.x, t.x)), is_hole(i, vec2f(s.y, t.y)), is_hole(i, vec2f(s.z, t.z)), is_hole(i, vec2f(s.w, t.w)));
        met = met & !holes;
    }
    var after = before;
    after.height = select(before.height, height, met);
    after.size = select(before.size, size, met);
    after.seen = select(before.seen, number, met);
    return after;
}

struct Packet {
    a: Rays,
    b: Rays,
}

// What the rays see: triangle + 1, or 0. The walk goes on to a second leaf before it looks at the triangles of both, as lanes in lockstep pay
// for nodes and triangles wherever they take turns, and for the longest of each.
fn trace_packet(origin: vec3f, given: Packet) -> Packet {
    var packet = given;
    if EMPTY {
        return packet;
    }
    let middle = vec3f(given.a.x.w + given.b.x.x, given.a.y.w + given.b.y.x, given.a.z.w + given.b.z.x);
    let grid = grid_from(origin);
    var stack: array<u32, MAX_DEPTH>;
    var top = 0u;
    var content = root_content();
    loop {
        var held = NO_NODE;
        while is_inner(content) {
            let first = scene_tables[content];
            let second = scene_tables[content + 1u];
            let left = seen_box(first, grid);
            let right = seen_box(second, grid);
            let enters_left = any(enters(packet.a, left) | enters(packet.b, left));
            let enters_right = any(enters(packet.a, right) | enters(packet.b, right));
            let right_first = !enters_left || (enters_right && dot(right.centre - left.centre, middle) < 0.0);
            if enters_left && enters_right {
                stack[top] = select(second.w, first.w, right_first);
                top += 1u;
            }
            content = select(first.w, second.w, right_first);
            var pop = !enters_left && !enters_right;
            if !pop && !is_inner(content) && held == NO_NODE {
                held = content;
                pop = true;
            }
            if pop {
                content = NO_NODE;
                if top > 0u {
                    top -= 1u;
                    content = stack[top];
                }
            }
        }
        let nearer = triangles_of(held);
        let farther = triangles_of(content);
        let split = nearer.end - nearer.first;
        let total = split + farther.end - farther.first;
        for (var k = 0u; k < total; k++) {
            let triangle = seen_triangle(select(farther.first + k - split, nearer.first + k, k < split), grid);
            packet.a = meet(packet.a, triangle);
            packet.b = meet(packet.b, triangle);
        }
        packet.a.distance = packet.a.height / packet.a.size;
        packet.b.distance = packet.b.height / packet.b.size;
        if top == 0u {
            break;
        }
        top -= 1u;
        content = stack[top];
    }
    return packet;
}
