#import lib/scene
#import lib/camera

// The picture: reflected light, what surfaces emit toward the camera, and the sky.

@group(0) @binding(0) var triangles: texture_2d<u32>;
@group(0) @binding(1) var direct: texture_2d<f32>;
@group(0) @binding(2) var indirect: texture_2d<f32>;
@group(0) @binding(3) var picture: texture_storage_2d<rgba32float, write>;
@group(0) @binding(4) var glossy: texture_2d<f32>;
@group(0) @binding(5) var all_indirect: texture_storage_2d<rgba32float, write>;

override HAS_DIRECT: bool = true;
override HAS_INDIRECT: bool = true;
override HAS_GLOSSY: bool = true;

@compute @workgroup_size(8, 8)
fn combine_parts(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= camera.size) {
        return;
    }
    var reflected = vec3f(0.0);
    if HAS_INDIRECT {
        reflected += textureLoad(indirect, id.xy, 0).rgb;
    }
    if HAS_GLOSSY {
        reflected += textureLoad(glossy, id.xy, 0).rgb;
    }
    textureStore(all_indirect, id.xy, vec4f(reflected, 1.0));
    let triangle = textureLoad(triangles, id.xy, 0).x;
    let ray = pixel_ray(id.xy);
    var radiance: vec3f;
    if triangle == 0u {
        radiance = environment_radiance(normalize(ray));
    } else {
        radiance = surface_seen(triangle - 1u, camera.eye, ray).emission + reflected;
        if HAS_DIRECT {
            radiance += textureLoad(direct, id.xy, 0).rgb;
        }
    }
    textureStore(picture, id.xy, vec4f(radiance, 1.0));
}
