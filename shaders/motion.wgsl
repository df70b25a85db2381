#import lib/camera
#import lib/movers

// How far what each pixel sees has come since the picture before.

@group(0) @binding(0) var triangles: texture_2d<u32>;
@group(0) @binding(1) var position: texture_2d<f32>;
@group(0) @binding(2) var motion: texture_storage_2d<rgba32float, write>;

// Of what is seen from behind, beside the number: as gbuffer.wgsl.
const NUMBER = 0x7fffffffu;

@compute @workgroup_size(8, 8)
fn move_back(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= camera.size) {
        return;
    }
    let triangle = textureLoad(triangles, id.xy, 0).x & NUMBER;
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

// Where something is seen that lies at `to`, relative to the eye, from the middle of the picture to the right and down [pixels]. What is beside the eye or behind it
// counts as far out.
fn pixels_now(to: vec3f) -> vec2f {
    let at = vec2f(dot(to, camera.right) / camera.half_width, -dot(to, camera.up) / camera.half_height);
    return at / in_front(dot(to, camera.forward), to) * 0.5 * vec2f(camera.size);
}

fn pixels_before(to: vec3f) -> vec2f {
    let at = vec2f(dot(to, camera.right_before) / camera.half_width_before, -dot(to, camera.up_before) / camera.half_height_before);
    return at / in_front(dot(to, camera.forward_before), to) * 0.5 * vec2f(camera.size);
}

fn in_front(depth: f32, to: vec3f) -> f32 {
    return max(depth, 1e-3 * max(length(to), camera.near));
}
