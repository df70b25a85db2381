#import lib/frame
#import lib/scene

// What the shadow maps of punctual lights show.

// The camera of a map. It follows from the light: reading it would take longer.
struct ShadowView {
    origin: vec3f,
    near: f32,
    right: vec3f,
    // Depth that an orthographic map spans, 0 for a perspective one.
    range: f32,
    up: vec3f,
    forward: vec3f,
    // Half the map's width and height, at distance 1 where it is perspective.
    half: vec2f,
}

// Whether a light has a map for each side of a cube.
fn has_cube(light: SceneLight) -> bool {
    return light.shadow_layers == 6u;
}

// Face of a cube map that a direction from the light falls on: +x, −x, +y, −y, +z, −z.
fn cube_face(d: vec3f) -> u32 {
    let a = abs(d);
    if a.x >= a.y && a.x >= a.z {
        return select(1u, 0u, d.x > 0.0);
    }
    if a.y >= a.z {
        return select(3u, 2u, d.y > 0.0);
    }
    return select(5u, 4u, d.z > 0.0);
}

// Maps along an edge of a directional light's grid.
fn shadow_grid(light: SceneLight) -> u32 {
    return u32(sqrt(f32(light.shadow_layers)) + 0.5);
}

// Place in a directional light's grid that a position falls on, row by row.
fn grid_place(light: SceneLight, position: vec3f) -> u32 {
    let frame = frame_around(light.direction, 0.0);
    let d = position - scene_parameters.centre;
    let across = vec2f(dot(d, frame[1]), dot(d, frame[0])) / light.shadow_half;
    let grid = shadow_grid(light);
    let place = vec2u(clamp(floor(0.5 * (across + f32(grid))), vec2f(0.0), vec2f(f32(grid) - 1.0)));
    return place.y * grid + place.x;
}

// Which of a light's maps shows a position.
fn map_of(light: SceneLight, position: vec3f) -> u32 {
    if light.kind == 2u {
        return grid_place(light, position);
    }
    return select(0u, cube_face(position - light.position), has_cube(light));
}

fn cube_axis(face: u32) -> vec3f {
    let axis = vec3<bool>(face / 2u == 0u, face / 2u == 1u, face / 2u == 2u);
    return select(vec3f(0.0), vec3f(select(1.0, -1.0, (face & 1u) == 1u)), axis);
}

fn shadow_view(light: SceneLight, face: u32) -> ShadowView {
    var view: ShadowView;
    view.origin = light.position;
    view.near = 1e-5 * scene_parameters.extent;
    view.half = light.shadow_half;
    view.range = 0.0;
    view.forward = light.direction;
    if has_cube(light) {
        view.forward = cube_axis(face);
    }
    let frame = frame_around(view.forward, 0.0);
    view.right = frame[1];
    view.up = frame[0];
    if light.kind == 2u {
        view.range = 1.01 * scene_parameters.extent;
        let grid = shadow_grid(light);
        let place = (2.0 * vec2f(vec2u(face % grid, face / grid)) + 1.0 - f32(grid)) * view.half;
        view.origin = scene_parameters.centre - light.direction * (0.5 * view.range) + view.right * place.x + view.up * place.y;
    }
    return view;
}
