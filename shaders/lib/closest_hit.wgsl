#import lib/trace

// The nearest surface that stops light, from both of its sides: as Bvh::first.

struct ClosestHit {
    // NO_TRIANGLE for none.
    triangle: u32,
    // In the scene's units, for a unit direction.
    distance: f32,
}

fn closest_hit(origin: vec3f, direction: vec3f, distance: f32) -> ClosestHit {
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
                limit = met_at(i, grid, direction);
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

// Where a ray meets the plane of a triangle, in the hierarchy's units.
fn met_at(triangle: u32, grid: Grid, direction: vec3f) -> f32 {
    let at = corners(triangle, grid);
    let p = cross(direction, at.e2);
    let determinant = dot(at.e1, p);
    return dot(at.e2, cross(at.point, at.e1)) / determinant;
}

// Whether a ray meets the back of a one-sided surface, which is not seen.
fn is_back(triangle: u32, direction: vec3f) -> bool {
    let plane = cross(scene_corners[3u * triangle + 1u].xyz, scene_corners[3u * triangle + 2u].xyz);
    return ONE_SIDED && dot(plane, direction) > 0.0 && (scene_material(material_of(triangle)).flags & TWO_SIDED) == 0u;
}
