#import lib/frame
#import lib/random
#import lib/scene

// How much of a punctual light arrives at a surface point, by percentage-closer filtering of its shadow map
// (Reeves et al. 1987) against the receiver's own plane.

@group(2) @binding(0) var shadow_depth: texture_depth_2d_array;

// Taps along each axis: 4 × 4 is 16-tap filtering. 1: one of the 4-tap filter's, drawn by its weight.
override SHADOW_TAPS: i32 = 4;
// Texels along an edge of a map.
override SHADOW_RESOLUTION: f32 = 1024.0;

// The camera of a map. It follows from the light: reading it would take longer.
struct ShadowView {
    origin: vec3f,
    near: f32,
    right: vec3f,
    // Half the map's width, at distance 1 where it is perspective.
    half: f32,
    up: vec3f,
    // Depth that an orthographic map spans, 0 for a perspective one.
    range: f32,
    forward: vec3f,
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
    } else if light.kind == 2u {
        view.range = 2.0 * view.half;
        view.origin = scene_parameters.centre - light.direction * view.half;
    }
    let frame = frame_around(view.forward, 0.0);
    view.right = frame[1];
    view.up = frame[0];
    return view;
}

fn stored_depth(view: ShadowView, layer: u32, texel: vec2i) -> f32 {
    let value = textureLoad(shadow_depth, texel, i32(layer), 0);
    if view.range > 0.0 {
        return (1.0 - value) * view.range;
    }
    return view.near / max(value, 1e-20);
}

// A surface point before a map.
struct Receiver {
    view: ShadowView,
    layer: u32,
    normal: vec3f,
    depth: f32,
    // Height of the light's side of the surface: the origin's distance behind its plane.
    facing: f32,
    slack: f32,
}

fn is_lit(receiver: Receiver, texel: vec2i) -> bool {
    let view = receiver.view;
    let inside = clamp(texel, vec2i(0), vec2i(i32(SHADOW_RESOLUTION) - 1));
    let ndc = (vec2f(inside) + 0.5) * (2.0 / SHADOW_RESOLUTION) - 1.0;
    let lateral = (view.right * ndc.x - view.up * ndc.y) * view.half;
    // Depth of the receiver's plane behind the texel.
    var slope = dot(view.forward, receiver.normal);
    var facing = receiver.facing;
    if view.range == 0.0 {
        slope += dot(lateral, receiver.normal);
    } else {
        facing -= dot(lateral, receiver.normal);
    }
    let plane = select(receiver.depth, facing / slope, slope * receiver.facing > 0.0);
    return stored_depth(view, receiver.layer, inside) >= min(plane, receiver.depth) - receiver.slack;
}

fn light_visibility(light: SceneLight, position: vec3f, normal: vec3f, to_light: vec3f, distance: f32, seed: u32) -> f32 {
    if light.shadow_layer == NO_SHADOW {
        return 1.0;
    }
    let face = select(0u, cube_face(position - light.position), has_cube(light));
    let view = shadow_view(light, face);
    let d = position - view.origin;
    let z = dot(d, view.forward);
    let scale = select(1.0, z, view.range == 0.0);
    if scale <= 0.0 {
        return 1.0;
    }
    let at = (vec2f(dot(d, view.right), -dot(d, view.up)) / (scale * view.half) * 0.5 + 0.5) * SHADOW_RESOLUTION;
    // A texel's width where the receiver is: what is nearer than that to the receiver does not shadow it.
    let slack = 2.0 * view.half * scale / SHADOW_RESOLUTION + 2.0 * surface_offset(position);
    let receiver = Receiver(view, light.shadow_layer + face, normal, z, dot(d, normal), slack);
    if SHADOW_TAPS == 1 {
        let shift = vec2f(unit(hash(seed)), unit(hash(seed + 1u))) - 0.5;
        return select(0.0, 1.0, is_lit(receiver, vec2i(floor(at + shift))));
    }
    let corner = at - 0.5 * f32(SHADOW_TAPS - 1);
    let base = floor(corner);
    let f = corner - base;
    var lit = 0.0;
    var weights = 0.0;
    for (var j = 0; j < SHADOW_TAPS; j++) {
        let wy = select(1.0, select(f.y, 1.0 - f.y, j == 0), j == 0 || j == SHADOW_TAPS - 1);
        for (var i = 0; i < SHADOW_TAPS; i++) {
            let wx = select(1.0, select(f.x, 1.0 - f.x, i == 0), i == 0 || i == SHADOW_TAPS - 1);
            weights += wx * wy;
            lit += select(0.0, wx * wy, is_lit(receiver, vec2i(base) + vec2i(i, j)));
        }
    }
    return lit / max(weights, 1e-6);
}
