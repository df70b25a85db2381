#import lib/trace

// How much of a punctual light arrives at a surface point, by percentage-closer filtering of its shadow map
// (Reeves et al. 1987) against the receiver's own plane.

struct ShadowView {
    origin: vec3f,
    near: f32,
    right: vec3f,
    half_width: f32,
    up: vec3f,
    half_height: f32,
    forward: vec3f,
    // Depth that an orthographic map spans, 0 for a perspective one.
    range: f32,
}

@group(2) @binding(0) var shadow_depth: texture_depth_2d_array;
@group(2) @binding(1) var<storage, read> shadow_views: array<ShadowView>;

// Taps along each axis: 4 × 4 is 16-tap filtering.
override SHADOW_TAPS: i32 = 4;

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

fn stored_depth(view: ShadowView, layer: u32, texel: vec2i) -> f32 {
    let value = textureLoad(shadow_depth, texel, i32(layer), 0);
    if view.range > 0.0 {
        return (1.0 - value) * view.range;
    }
    return view.near / max(value, 1e-20);
}

fn light_visibility(light: u32, position: vec3f, normal: vec3f, to_light: vec3f, distance: f32) -> f32 {
    let source = scene_lights[light];
    var layer = source.shadow_layer;
    if layer == 0xffffffffu {
        return 1.0;
    }
    if source.kind == 0u || (source.kind == 1u && source.cos_outer < 0.5) {
        layer += cube_face(position - source.position);
    }
    let view = shadow_views[layer];
    let d = position - view.origin;
    let z = dot(d, view.forward);
    let perspective = view.range == 0.0;
    let scale = select(1.0, z, perspective);
    if scale <= 0.0 {
        return 1.0;
    }
    let resolution = f32(textureDimensions(shadow_depth).x);
    let plane_point = vec2f(dot(d, view.right) / view.half_width, -dot(d, view.up) / view.half_height) / scale;
    let at = (plane_point * 0.5 + 0.5) * resolution - 0.5 * f32(SHADOW_TAPS - 1);
    let base = floor(at);
    let f = at - base;
    // A texel's width where the receiver is: what is nearer than that to the receiver does not shadow it.
    let slack = 2.0 * view.half_width * scale / resolution + 2.0 * surface_offset(position);
    let facing = dot(d, normal);
    var lit = 0.0;
    var weights = 0.0;
    for (var j = 0; j < SHADOW_TAPS; j++) {
        let wy = select(1.0, select(f.y, 1.0 - f.y, j == 0), j == 0 || j == SHADOW_TAPS - 1);
        for (var i = 0; i < SHADOW_TAPS; i++) {
            let wx = select(1.0, select(f.x, 1.0 - f.x, i == 0), i == 0 || i == SHADOW_TAPS - 1);
            let texel = vec2i(base) + vec2i(i, j);
            let inside = clamp(texel, vec2i(0), vec2i(i32(resolution) - 1));
            let ndc = (vec2f(inside) + 0.5) / resolution * 2.0 - 1.0;
            let lateral = view.right * (ndc.x * view.half_width) - view.up * (ndc.y * view.half_height);
            // Depth of the receiver's plane behind the texel.
            var plane = z;
            if perspective {
                let slope = dot(view.forward + lateral, normal);
                plane = select(z, facing / slope, slope * facing > 0.0);
            } else {
                let slope = dot(view.forward, normal);
                plane = select(z, (facing - dot(lateral, normal)) / slope, slope * facing > 0.0);
            }
            let weight = wx * wy;
            weights += weight;
            lit += select(0.0, weight, stored_depth(view, layer, inside) >= min(plane, z) - slack);
        }
    }
    return lit / max(weights, 1e-6);
}
