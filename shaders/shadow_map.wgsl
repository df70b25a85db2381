#import lib/visibility/shadow_view

// Texels along an edge of a map.
override SHADOW_RESOLUTION: f32 = 1024.0;

// Depth of the scene from a light: one layer a view. Surfaces block from both sides.

struct Fragment {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat, either) triangle: u32,
    @location(1) @interpolate(flat, either) instance: u32,
}

// The instance is light · 16 + side of its cube or place in its grid.
fn view_of(instance: u32) -> ShadowView {
    return shadow_view(scene_light(instance / 16u), instance % 16u);
}

@vertex
fn vertex(@location(0) position: vec3f, @builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> Fragment {
    let view = view_of(instance);
    let d = position - view.origin;
    let x = dot(d, view.right) / view.half.x;
    let y = dot(d, view.up) / view.half.y;
    let z = dot(d, view.forward);
    let perspective = vec4f(x, y, view.near, z);
    let orthographic = vec4f(x, y, 1.0 - z / max(view.range, 1e-30), 1.0);
    return Fragment(select(perspective, orthographic, view.range > 0.0), index / 3u, instance);
}

// Only for scenes with alpha masks: leaves the holes open.
@fragment
fn fragment(in: Fragment) {
    let view = view_of(in.instance);
    let ndc = in.clip.xy / SHADOW_RESOLUTION * 2.0 - 1.0;
    let lateral = view.right * (ndc.x * view.half.x) - view.up * (ndc.y * view.half.y);
    var origin = view.origin;
    var direction = view.forward + lateral;
    if view.range > 0.0 {
        origin = view.origin + lateral;
        direction = view.forward;
    }
    if is_hole(in.triangle, intersect_plane(in.triangle, origin, direction).barycentric) {
        discard;
    }
}
