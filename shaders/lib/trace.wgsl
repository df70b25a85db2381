#import lib/hierarchy

// Single rays against the scene's hierarchy.

// Whether a ray enters a box before `limit`.
fn enters_box(node: vec4u, grid: Grid, inverse: vec3f, limit: f32) -> bool {
    let a = lower_bound(node, grid) * inverse;
    let b = upper_bound(node, grid) * inverse;
    let low = min(a, b);
    let high = max(a, b);
    let near = max(max(low.x, low.y), max(low.z, 0.0));
    let far = min(min(high.x, high.y), min(high.z, limit));
    // Widened so that rounding opens no gaps between boxes.
    return near <= far * 1.0000004;
}

fn blocks(triangle: u32, origin: vec3f, direction: vec3f, limit: f32) -> bool {
    let hit = intersect_plane(triangle, origin, direction);
    let b = hit.barycentric;
    let inside = hit.determinant != 0.0 && b.x >= 0.0 && b.y >= 0.0 && b.x + b.y <= 1.0 && hit.distance > 0.0 && hit.distance < limit;
    return inside && !(ALPHA_MASKS && is_hole(triangle, b));
}

// Whether anything blocks light between 0 and `limit`; surfaces block from both sides.
fn trace_occluded(origin: vec3f, direction: vec3f, limit: f32) -> bool {
    if EMPTY {
        return false;
    }
    let inverse = safe_inverse(direction);
    let grid = grid_from(origin);
    var stack: array<u32, MAX_DEPTH>;
    var top = 0u;
    var content = root_content();
    loop {
        while is_inner(content) {
            let left = scene_nodes[content];
            let right = scene_nodes[content + 1u];
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
            if blocks(i, origin, direction, limit) {
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
