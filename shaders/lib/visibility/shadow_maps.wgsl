#import lib/random
#import lib/trace
#import lib/visibility/shadow_view
#import SHADOW_TEXELS

// How much of a punctual light arrives at a surface point, by percentage-closer filtering of its shadow map
// (Reeves et al. 1987) against the receiver's own plane; by a shadow ray where it is seen from nearby.

// Taps along each axis: 4 × 4 is 16-tap filtering. 1: one of the 4-tap filter's, drawn by its weight.
override SHADOW_TAPS: i32 = 4;
// What is nearer than so many widths of a texel to where it is seen from is too near for a map: as scene::shadow_maps.
const NEAR = 8.0;
// Texels along an edge of a map.
override SHADOW_RESOLUTION: f32 = 1024.0;

fn stored_depth(view: ShadowView, layer: u32, texel: vec2i) -> f32 {
    let value = shadow_texel(layer, texel);
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
    let lateral = view.right * (ndc.x * view.half.x) - view.up * (ndc.y * view.half.y);
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

fn light_visibility(light: SceneLight, surface: Surface, arriving: Arriving, seed: u32) -> f32 {
    if light.shadow_layers == 0u {
        return 1.0;
    }
    let position = surface.position;
    let normal = surface.face_normal;
    let face = map_of(light, position);
    let view = shadow_view(light, face);
    let d = position - view.origin;
    let z = dot(d, view.forward);
    let scale = select(1.0, z, view.range == 0.0);
    if scale <= 0.0 {
        return 1.0;
    }
    let at = (vec2f(dot(d, view.right), -dot(d, view.up)) / (scale * view.half) * 0.5 + 0.5) * SHADOW_RESOLUTION;
    // A texel's width where the receiver is: what is nearer than that to the receiver does not shadow it.
    let slack = 2.0 * max(view.half.x, view.half.y) * scale / SHADOW_RESOLUTION + 2.0 * surface_offset(position);
    if surface.distance < NEAR * slack {
        return visibility_by_ray(light, surface, arriving);
    }
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
