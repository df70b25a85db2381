#import lib/light
#import lib/pixel
#import EMITTERS

// Light that reaches the visible surfaces without touching another.

@group(0) @binding(0) var triangles: texture_2d<u32>;
// Light of the sky, where another pass computed it.
@group(0) @binding(2) var sky: texture_2d<f32>;
@group(0) @binding(1) var radiance: texture_storage_2d<rgba32float, write>;

override HAS_SKY: bool = false;

@compute @workgroup_size(8, 8)
fn shade(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(triangles)) {
        return;
    }
    let triangle = textureLoad(triangles, id.xy, 0).x;
    var light = vec3f(0.0);
    if triangle != 0u {
        let surface = surface_in_pixel(triangle - 1u, id.xy);
        let seed = combine(id.x, id.y);
        light = punctual_reflected(surface, seed) + emitters_reflected(surface, seed, id.y * textureDimensions(triangles).x + id.x);
        if HAS_SKY {
            light += textureLoad(sky, id.xy, 0).rgb;
        }
    }
    textureStore(radiance, id.xy, vec4f(light, 1.0));
}
