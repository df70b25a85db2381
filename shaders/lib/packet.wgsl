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
    // Of the nearest surface seen so far, in units of the direction.
    distance: vec4f,
    // Triangle + 1, or 0.
    seen: vec4u,
}

// Rays that are not alive meet nothing.
fn rays(a: vec3f, b: vec3f, c: vec3f, d: vec3f, alive: vec4<bool>) -> Rays {
    let directions = transpose(mat4x3f(a, b, c, d));
    let inverses = transpose(mat4x3f(safe_inverse(a), safe_inverse(b), safe_inverse(c), safe_inverse(d)));
    let limit = select(vec4f(-1.0), vec4f(FAR_AWAY), alive);
    return Rays(directions[0], directions[1], directions[2], inverses[0], inverses[1], inverses[2], limit, vec4u(0u));
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
    let near = max(max(x - wide, y - tall), max(z - deep, vec4f(0.0)));
    let far = min(min(x + wide, y + tall), min(z + deep, rays.distance));
    return near <= far;
}

// A triangle as seen from the rays' origin: with it each ray needs three inner products (Möller and Trumbore 1997).
struct SeenTriangle {
    index: u32,
    plane: vec3f,
    // Products with a direction, over the determinant, are the barycentric weights of corners 1 and 2.
    first: vec3f,
    second: vec3f,
    height: f32,
    two_sided: bool,
}

fn seen_triangle(index: u32, origin: vec3f) -> SeenTriangle {
    let e1 = scene_corners[3u * index + 1u].xyz;
    let e2 = scene_corners[3u * index + 2u].xyz;
    let s = origin - scene_corners[3u * index].xyz;
    let second = cross(s, e1);
    var two_sided = true;
    if ONE_SIDED {
        two_sided = (scene_materials[material_of(index)].flags & TWO_SIDED) != 0u;
    }
    return SeenTriangle(index, cross(e2, e1), cross(e2, s), second, dot(e2, second), two_sided);
}

fn products(rays: Rays, v: vec3f) -> vec4f {
    return rays.x * v.x + rays.y * v.y + rays.z * v.z;
}

// The rays after they have met a triangle. Of two at the same distance the first in the scene's order is seen, so that
// the order of the walk does not show.
fn meet(before: Rays, triangle: SeenTriangle) -> Rays {
    let determinant = products(before, triangle.plane);
    let inverse = select(1.0 / determinant, vec4f(0.0), determinant == vec4f(0.0));
    let u = products(before, triangle.first) * inverse;
    let v = products(before, triangle.second) * inverse;
    let distance = triangle.height * inverse;
    let inside = (determinant != vec4f(0.0)) & (min(u, v) >= vec4f(0.0)) & (u + v <= vec4f(1.0)) & (distance > vec4f(0.0));
    let number = vec4u(triangle.index + 1u);
    var met = inside & ((distance < before.distance) | ((distance == before.distance) & (number < before.seen)));
    if ONE_SIDED {
        met = met & ((determinant > vec4f(0.0)) | vec4<bool>(triangle.two_sided));
    }
    if ALPHA_MASKS {
        let i = triangle.index;
        let holes = vec4<bool>(is_hole(i, vec2f(u.x, v.x)), is_hole(i, vec2f(u.y, v.y)), is_hole(i, vec2f(u.z, v.z)), is_hole(i, vec2f(u.w, v.w)));
        met = met & !holes;
    }
    var after = before;
    after.distance = select(before.distance, distance, met);
    after.seen = select(before.seen, number, met);
    return after;
}

struct Packet {
    a: Rays,
    b: Rays,
}

// What the rays see: triangle + 1, or 0. The walk goes down to a leaf before it looks at triangles, as lanes in lockstep
// pay for both wherever they take turns.
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
        while is_inner(content) {
            let first = scene_nodes[content];
            let second = scene_nodes[content + 1u];
            let left = seen_box(first, grid);
            let right = seen_box(second, grid);
            let enters_left = any(enters(packet.a, left) | enters(packet.b, left));
            let enters_right = any(enters(packet.a, right) | enters(packet.b, right));
            let right_first = !enters_left || (enters_right && dot(right.centre - left.centre, middle) < 0.0);
            if enters_left && enters_right {
                stack[top] = select(second.w, first.w, right_first);
                top += 1u;
            }
            if enters_left || enters_right {
                content = select(first.w, second.w, right_first);
            } else if top > 0u {
                top -= 1u;
                content = stack[top];
            } else {
                content = NO_NODE;
            }
        }
        if content == NO_NODE {
            break;
        }
        let triangles = triangles_of(content);
        for (var i = triangles.first; i < triangles.end; i++) {
            let triangle = seen_triangle(i, origin);
            packet.a = meet(packet.a, triangle);
            packet.b = meet(packet.b, triangle);
        }
        if top == 0u {
            break;
        }
        top -= 1u;
        content = stack[top];
    }
    return packet;
}
