#import lib/hierarchy

// Single rays against the scene's hierarchy.

const NOT_ENTERED = 3e38;

// Where a ray enters a box, in the hierarchy's units; NOT_ENTERED where it does not before `limit`.
fn entry(node: vec4u, grid: Grid, inverse: vec3f, limit: f32) -> f32 {
    let a = lower_bound(node, grid) * inverse;
    let b = upper_bound(node, grid) * inverse;
    let low = min(a, b);
    let high = max(a, b);
    let near = max(max(low.x, low.y), max(low.z, 0.0));
    let far = min(min(high.x, high.y), min(high.z, limit));
    // Widened so that rounding opens no gaps between boxes.
    return select(NOT_ENTERED, near, near <= far * 1.0000004);
}

fn enters_box(node: vec4u, grid: Grid, inverse: vec3f, limit: f32) -> bool {
    return entry(node, grid, inverse, limit) != NOT_ENTERED;
}

// How a ray meets a triangle.
struct Meeting {
    // How far it is, in the hierarchy's units; at most 0 where they do not meet.
    distance: f32,
    is_front: bool,
}

fn meeting(triangle: u32, grid: Grid, direction: vec3f) -> Meeting {
    let at = corners(triangle, grid);
    let p = cross(direction, at.e2);
    let q = cross(at.point, at.e1);
    let determinant = dot(at.e1, p);
    let inverse = select(1.0 / determinant, 0.0, determinant == 0.0);
    let b = vec2f(dot(at.point, p), dot(direction, q)) * inverse;
    let distance = dot(at.e2, q) * inverse;
    let least = -at.rounding * length(direction) * abs(inverse);
    let inside = determinant != 0.0 && b.x >= least && b.y >= least && b.x + b.y <= 1.0 - least;
    let is_met = inside && distance > 0.0 && !(ALPHA_MASKS && is_hole(triangle, b));
    return Meeting(select(0.0, distance, is_met), determinant > 0.0);
}

fn blocks(triangle: u32, grid: Grid, direction: vec3f, limit: f32) -> bool {
    let distance = meeting(triangle, grid, direction).distance;
    return distance > 0.0 && distance < limit;
}

// Whether anything blocks light between 0 and `distance`; surfaces block from both sides.
fn trace_occluded(origin: vec3f, direction: vec3f, distance: f32) -> bool {
    if EMPTY {
        return false;
    }
    let inverse = safe_inverse(direction);
    let grid = grid_from(origin);
    let limit = min(distance / grid.unit, FAR_AWAY);
    var stack: array<u32, MAX_DEPTH>;
    var top = 0u;
    var content = root_content();
    loop {
        while is_inner(content) {
            let left = scene_tables[content];
            let right = scene_tables[content + 1u];
            let enters_left = enters_box(left, grid, inverse, limit);
            let enters_right = enters_box(right, grid, inverse, limit);
            if enters_left && enters_right {
                stack[top] = right.w;
                top += 1u;
            }
            if enters_left || enters_right {
                content = select(right.w, left.w, enters_left);
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
            if blocks(i, grid, direction, limit) {
                return true;
            }
        }
        if top == 0u {
            break;
        }
        top -= 1u;
        content = stack[top];
    }
    return false;
}
