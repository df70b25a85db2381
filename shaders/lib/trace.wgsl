#import lib/scene

// Rays against the scene's binary hierarchy: as scene::bvh.

struct SceneNode {
    min: vec3f,
    count: u32,
    max: vec3f,
    first: u32,
}

@group(1) @binding(3) var<storage, read> scene_nodes: array<SceneNode>;

// Whether the plan found alpha masks, one-sided surfaces.
override ALPHA_MASKS: bool = true;
override ONE_SIDED: bool = true;

fn safe_inverse(direction: vec3f) -> vec3f {
    let tiny = abs(direction) <= vec3f(1e-12);
    return select(1.0 / direction, select(vec3f(-1e12), vec3f(1e12), direction >= vec3f(0.0)), tiny);
}

// Where a ray enters a box, or FAR_AWAY where it misses it before `limit`.
fn enter(node: u32, origin: vec3f, inverse: vec3f, limit: f32) -> f32 {
    let a = (scene_nodes[node].min - origin) * inverse;
    let b = (scene_nodes[node].max - origin) * inverse;
    let low = min(a, b);
    let high = max(a, b);
    let near = max(max(low.x, low.y), max(low.z, 0.0));
    let far = min(min(high.x, high.y), min(high.z, limit));
    // Widened so that rounding opens no gaps between boxes.
    return select(FAR_AWAY, near, near <= far * 1.0000004);
}

struct Hit {
    triangle: u32,
    distance: f32,
}

// The nearest surface that a viewer sees.
fn trace_closest(origin: vec3f, direction: vec3f) -> Hit {
    var hit = Hit(NO_TRIANGLE, FAR_AWAY);
    let inverse = safe_inverse(direction);
    var stack: array<u32, 64>;
    var top = 0u;
    var node = 0u;
    if scene_parameters.nodes == 0u || enter(0u, origin, inverse, FAR_AWAY) >= FAR_AWAY {
        return hit;
    }
    loop {
        let count = scene_nodes[node].count;
        let first = scene_nodes[node].first;
        if count > 0u {
            for (var i = first; i < first + count; i++) {
                let plane = intersect_plane(i, origin, direction);
                let b = plane.barycentric;
                if plane.determinant != 0.0 && b.x >= 0.0 && b.y >= 0.0 && b.x + b.y <= 1.0 && plane.distance > 0.0 && plane.distance < hit.distance {
                    if ONE_SIDED && plane.determinant < 0.0 && (scene_materials[material_of(i)].flags & TWO_SIDED) == 0u {
                        continue;
                    }
                    if ALPHA_MASKS && is_hole(i, b) {
                        continue;
                    }
                    hit = Hit(i, plane.distance);
                }
            }
        } else {
            let left = enter(first, origin, inverse, hit.distance);
            let right = enter(first + 1u, origin, inverse, hit.distance);
            let nearer = select(first, first + 1u, right < left);
            if max(left, right) < FAR_AWAY {
                stack[top] = 2u * first + 1u - nearer;
                top += 1u;
                node = nearer;
                continue;
            }
            if min(left, right) < FAR_AWAY {
                node = nearer;
                continue;
            }
        }
        if top == 0u {
            break;
        }
        top -= 1u;
        node = stack[top];
    }
    return hit;
}

// Whether anything blocks light between 0 and `limit`; surfaces block from both sides.
fn trace_occluded(origin: vec3f, direction: vec3f, limit: f32) -> bool {
    let inverse = safe_inverse(direction);
    var stack: array<u32, 64>;
    var top = 0u;
    var node = 0u;
    if scene_parameters.nodes == 0u || enter(0u, origin, inverse, limit) >= FAR_AWAY {
        return false;
    }
    loop {
        let count = scene_nodes[node].count;
        let first = scene_nodes[node].first;
        if count > 0u {
            for (var i = first; i < first + count; i++) {
                let plane = intersect_plane(i, origin, direction);
                let b = plane.barycentric;
                if plane.determinant != 0.0 && b.x >= 0.0 && b.y >= 0.0 && b.x + b.y <= 1.0 && plane.distance > 0.0 && plane.distance < limit {
                    if !ALPHA_MASKS || !is_hole(i, b) {
                        return true;
                    }
                }
            }
        } else {
            let left = enter(first, origin, inverse, limit) < FAR_AWAY;
            let right = enter(first + 1u, origin, inverse, limit) < FAR_AWAY;
            if left && right {
                stack[top] = first + 1u;
                top += 1u;
                node = first;
                continue;
            }
            if left || right {
                node = select(first + 1u, first, left);
                continue;
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
