#import lib/hierarchy

// Single rays against the scene's hierarchy.

// Whether a ray enters a box before `limit`.
fn enters_box(node: u32, origin: vec3f, inverse: vec3f, limit: f32) -> bool {
    let a = (scene_nodes[node].min - origin) * inverse;
    let b = (scene_nodes[node].max - origin) * inverse;
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
    var stack: array<u32, MAX_DEPTH>;
    var top = 0u;
    var node = 0u;
    loop {
        while is_inner(node) {
            let child = scene_nodes[node].first;
            let left = enters_box(child, origin, inverse, limit);
            let right = enters_box(child + 1u, origin, inverse, limit);
            if left && right {
                stack[top] = child + 1u;
                top += 1u;
            }
            if left || right {
                node = select(child + 1u, child, left);
            } else if top > 0u {
                top -= 1u;
                node = stack[top];
            } else {
                node = NO_NODE;
            }
        }
        if node == NO_NODE {
            break;
        }
        let first = scene_nodes[node].first;
        let last = first + scene_nodes[node].count;
        for (var i = first; i < last; i++) {
            if blocks(i, origin, direction, limit) {
                return true;
            }
        }
        if top == 0u {
            break;
        }
        top -= 1u;
        node = stack[top];
    }
    return false;
}
