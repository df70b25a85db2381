#import lib/camera
#import lib/movers

// How far what each pixel sees has come since the picture before.

@group(0) @binding(0) var triangles: texture_2d<u32>;
@group(0) @binding(1) var position: texture_2d<f32>;
@group(0) @binding(2) var motion: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn move_back(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= camera.size) {
        return;
    }
    let triangle = textureLoad(triangles, id.xy, 0).x;
    if triangle == 0u {
        // The sky is as far away as can be: it turns, and comes no nearer.
        let ray = pixel_ray(id.xy);
        textureStore(motion, id.xy, vec4f(pixels_now(ray) - pixels_before(ray), 0.0, 0.0));
        return;
    }
    let here = textureLoad(position, id.xy, 0).xyz;
    let now = here - camera.eye;
    let before = point_before(triangle - 1u, here) - camera.eye_before;
    let away = dot(now, camera.forward) - dot(before, camera.forward_before);
    textureStore(motion, id.xy, vec4f(pixels_now(now) - pixels_before(before), away, 0.0));
}

fn pixels_now(to: vec3f) -> vec2f {
    return pixels(mat3x3f(camera.right, -camera.up, camera.forward), vec2f(camera.half_width, camera.half_height), to);
}

fn pixels_before(to: vec3f) -> vec2f {
    return pixels(mat3x3f(camera.right_before, -camera.up_before, camera.forward_before), vec2f(camera.half_width_before, camera.half_height_before), to);
}

// Where a camera of these axes, right, down and forward, sees what lies at `to` from it: from the middle of the picture to the right and down [pixels]. What is beside
// the camera or behind it counts as far out.
fn pixels(axes: mat3x3f, half_extent: vec2f, to: vec3f) -> vec2f {
    let local = to * axes;
    let depth = max(local.z, 1e-3 * max(length(to), camera.near));
    return local.xy / half_extent / depth * 0.5 * vec2f(camera.size);
}
