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
    if all(id.xy < camera.size) {
        textureStore(picture, id.xy, combined(id.xy, reflected(id.xy)));
    }
}

@compute @workgroup_size(8, 8)
fn combine_and_keep_indirect(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < camera.size) {
        let indirect_light = reflected(id.xy);
        textureStore(all_indirect, id.xy, vec4f(indirect_light, 1.0));
        textureStore(picture, id.xy, combined(id.xy, indirect_light));
    }
}

fn reflected(pixel: vec2u) -> vec3f {
    var light = vec3f(0.0);
    if HAS_INDIRECT {
        light += textureLoad(indirect, pixel, 0).rgb;
    }
    if HAS_GLOSSY {
        light += textureLoad(glossy, pixel, 0).rgb;
    }
    return light;
}

fn combined(pixel: vec2u, indirect_light: vec3f) -> vec4f {
    let triangle = textureLoad(triangles, pixel, 0).x;
    let ray = pixel_ray(pixel);
    if triangle == 0u {
        return vec4f(environment_radiance(normalize(ray)), 1.0);
    }
    var radiance = surface_seen(triangle - 1u, camera.eye, ray).emission + indirect_light;
    if HAS_DIRECT {
        radiance += textureLoad(direct, pixel, 0).rgb;
    }
    return vec4f(radiance, 1.0);
}
