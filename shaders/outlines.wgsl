#import lib/closest_hit
#import lib/camera

// What pixels see along the outlines of surfaces with two sides. The rasteriser rounds corners to parts of a pixel, so that a pixel beside a closed
// surface may show its far side from within, lit as nothing else there is. Such a pixel is traced: a ray passes between no two triangles that share an edge.

@group(0) @binding(0) var drawn: texture_2d<u32>;
@group(0) @binding(1) var triangles: texture_storage_2d<r32uint, write>;

// Of a triangle that is seen from behind: as gbuffer.wgsl.
const FROM_BEHIND = 0x80000000u;

// Cosine of the angle of planes that are taken for one.
const PARALLEL = 0.9999;

@compute @workgroup_size(8, 8)
fn settle(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= camera.size) {
        return;
    }
    let seen = textureLoad(drawn, id.xy, 0).x;
    var triangle = seen & ~FROM_BEHIND;
    if triangle != 0u && is_stray(id.xy, seen) {
        let ray = pixel_ray(id.xy);
        let hit = nearest_hit(camera.eye + ray * camera.near, normalize(ray), FAR_AWAY, false);
        triangle = select(hit.triangle + 1u, 0u, hit.triangle == NO_TRIANGLE);
    }
    textureStore(triangles, id.xy, vec4u(triangle));
}

// Whether more of the pixels beside this one see the other side than its own: it lies on an outline, or is alone.
fn is_stray(pixel: vec2u, seen: u32) -> bool {
    let last = camera.size - 1u;
    let beside = vec4u(
        textureLoad(drawn, vec2u(max(pixel.x, 1u) - 1u, pixel.y), 0).x,
        textureLoad(drawn, vec2u(min(pixel.x + 1u, last.x), pixel.y), 0).x,
        textureLoad(drawn, vec2u(pixel.x, max(pixel.y, 1u) - 1u), 0).x,
        textureLoad(drawn, vec2u(pixel.x, min(pixel.y + 1u, last.y)), 0).x,
    );
    let are_other = ((beside ^ vec4u(seen)) & vec4u(FROM_BEHIND)) != vec4u(0u);
    let are_there = beside != vec4u(0u);
    let sides = select(select(vec4i(0), vec4i(1), are_there), vec4i(-1), are_there & are_other);
    if dot(sides, vec4i(1)) >= 0 {
        return false;
    }
    // Two triangles of opposite sides in one plane are a wall that is there twice.
    let own = plane_of(seen);
    for (var i = 0u; i < 4u; i++) {
        if sides[i] < 0 && abs(dot(own, plane_of(beside[i]))) < PARALLEL {
            return true;
        }
    }
    return false;
}

// Normal of the plane of a triangle that was drawn.
fn plane_of(seen: u32) -> vec3f {
    let triangle = (seen & ~FROM_BEHIND) - 1u;
    let plane = cross(scene_corners[3u * triangle + 1u].xyz, scene_corners[3u * triangle + 2u].xyz);
    return plane / max(length(plane), 1e-37);
}
