#import lib/trace

struct ClosestHit {
    // NO_TRIANGLE for none.
    triangle: u32,
    // In the scene's units, for a unit direction.
    distance: f32,
}

// The nearest surface that stops light, from both of its sides: as Bvh::first.
fn closest_hit(origin: vec3f, direction: vec3f, distance: f32) -> ClosestHit {
    return nearest_hit(origin, direction, distance, true);
}

// The nearest surface, of two at the same distance the first in the scene's order; those with one side alone from behind, too, where backs stop light.
fn nearest_hit(origin: vec3f, direction: vec3f, distance: f32, backs_stop: bool) -> ClosestHit {
    var found = ClosestHit(NO_TRIANGLE, distance);
    if EMPTY {
        return found;
    }
    let inverse = safe_inverse(direction);
    let grid = grid_from(origin);
    var limit = min(distance / grid.unit, FAR_AWAY);
    var stack: array<u32, MAX_DEPTH>;
    var top = 0u;
    var content = root_content();
    loop {
        while is_inner(content) {
            let left = scene_tables[content];
            let right = scene_tables[content + 1u];
            let to_left = entry(left, grid, inverse, limit);
            let to_right = entry(right, grid, inverse, limit);
            let left_first = to_left <= to_right;
            if max(to_left, to_right) != NOT_ENTERED {
                stack[top] = select(left.w, right.w, left_first);
                top += 1u;
            }
            if min(to_left, to_right) != NOT_ENTERED {
                content = select(right.w, left.w, left_first);
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
            let met = meeting(i, grid, direction);
            let is_nearer = met.distance < limit || (met.distance == limit && i < found.triangle);
            if met.distance > 0.0 && is_nearer && (backs_stop || !ONE_SIDED || met.is_front || is_two_sided(i)) {
                limit = met.distance;
                found = ClosestHit(i, limit * grid.unit);
            }
        }
        if top == 0u {
            break;
        }
        top -= 1u;
        content = stack[top];
    }
    return found;
}

fn is_two_sided(triangle: u32) -> bool {
    return (scene_material(material_of(triangle)).flags & TWO_SIDED) != 0u;
}

// Whether a ray meets the back of a one-sided surface, which is not seen.
fn is_back(triangle: u32, direction: vec3f) -> bool {
    let plane = cross(scene_corners[3u * triangle + 1u].xyz, scene_corners[3u * triangle + 2u].xyz);
    return ONE_SIDED && dot(plane, direction) > 0.0 && !is_two_sided(triangle);
}
