// Objects that can be moved, or single triangles of what deforms: SceneMover in src/gpu/scene.rs, in the order of their triangles.

struct SceneMover {
    first: u32,
    end: u32,
    padding: vec2u,
    backward_x: vec4f,
    backward_y: vec4f,
    backward_z: vec4f,
}

@group(1) @binding(7) var<storage, read> scene_movers: array<SceneMover>;

// Where a point of a triangle was in the picture before.
fn point_before(triangle: u32, point: vec3f) -> vec3f {
    var from_here = 0u;
    var end = camera.movers;
    while from_here < end {
        let middle = (from_here + end) / 2u;
        if scene_movers[middle].end <= triangle {
            from_here = middle + 1u;
        } else {
            end = middle;
        }
    }
    if from_here == camera.movers || triangle < scene_movers[from_here].first {
        return point;
    }
    let mover = scene_movers[from_here];
    let at = vec4f(point, 1.0);
    return vec3f(dot(mover.backward_x, at), dot(mover.backward_y, at), dot(mover.backward_z, at));
}
