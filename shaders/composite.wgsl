#import lib/pixel

// The picture: reflected light, what surfaces emit toward the camera, and the sky.

@group(0) @binding(0) var triangles: texture_2d<u32>;
@group(0) @binding(1) var direct: texture_2d<f32>;
@group(0) @binding(2) var indirect: texture_2d<f32>;
@group(0) @binding(3) var picture: texture_storage_2d<rgba32float, write>;

override HAS_DIRECT: bool = true;

@compute @workgroup_size(8, 8)
fn composite(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < textureDimensions(triangles)) {
        textureStore(picture, id.xy, vec4f(radiance_toward_camera(id.xy), 1.0));
    }
}

fn radiance_toward_camera(pixel: vec2u) -> vec3f {
    let triangle = textureLoad(triangles, pixel, 0).x;
    if triangle == 0u {
        return environment_radiance(normalize(pixel_ray(pixel)));
    }
    var radiance = surface_in_pixel(triangle - 1u, pixel).emission + textureLoad(indirect, pixel, 0).rgb;
    if HAS_DIRECT {
        radiance += textureLoad(direct, pixel, 0).rgb;
    }
    return radiance;
}
