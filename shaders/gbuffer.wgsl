#import lib/pixel

// The triangle at each pixel's centre, then what the pixel sees of it.

struct Fragment {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat, either) triangle: u32,
}

@vertex
fn vertex(@location(0) position: vec3f, @builtin(vertex_index) index: u32) -> Fragment {
    return Fragment(project(position), index / 3u);
}

// Of a triangle that is seen from behind, where surfaces have two sides: as outlines.wgsl.
const FROM_BEHIND = 0x80000000u;

@fragment
fn fragment(in: Fragment, @builtin(front_facing) is_front: bool) -> @location(0) u32 {
    if ONE_SIDED || ALPHA_MASKS {
        let hit = intersect_plane(in.triangle, camera.eye, pixel_ray(vec2u(in.clip.xy)));
        if ONE_SIDED && hit.determinant < 0.0 && (scene_material(material_of(in.triangle)).flags & TWO_SIDED) == 0u {
            discard;
        }
        if ALPHA_MASKS && is_hole(in.triangle, hit.barycentric) {
            discard;
        }
    }
    return in.triangle + 1u + select(0u, FROM_BEHIND, TWO_SIDES && !is_front);
}

@group(0) @binding(0) var triangles: texture_2d<u32>;
@group(0) @binding(1) var position: texture_storage_2d<rgba32float, write>;
@group(0) @binding(2) var normal: texture_storage_2d<rgba32float, write>;
@group(0) @binding(3) var reflectance: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn resolve(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= camera.size) {
        return;
    }
    let triangle = textureLoad(triangles, id.xy, 0).x;
    if triangle == 0u {
        textureStore(position, id.xy, vec4f(0.0));
        textureStore(normal, id.xy, vec4f(0.0));
        textureStore(reflectance, id.xy, vec4f(0.0));
        return;
    }
    let surface = surface_in_pixel(triangle - 1u, id.xy);
    let depth = dot(surface.position - camera.eye, camera.forward);
    let footprint = depth * 2.0 * camera.half_width / f32(camera.size.x);
    textureStore(position, id.xy, vec4f(surface.position, footprint));
    textureStore(normal, id.xy, vec4f(surface.normal, depth));
    textureStore(reflectance, id.xy, vec4f(surface.reflectance, 1.0));
}
