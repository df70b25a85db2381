#import IRRADIANCE_FIELD

// Indirect light at the visible surfaces, from a field that is asked at each of them.

@group(0) @binding(0) var position: texture_2d<f32>;
@group(0) @binding(1) var normal: texture_2d<f32>;
@group(0) @binding(2) var reflectance: texture_2d<f32>;
@group(0) @binding(5) var triangles: texture_2d<u32>;
@group(0) @binding(3) var irradiance: texture_storage_2d<rgba32float, write>;
@group(0) @binding(4) var radiance: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn ask(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(position)) {
        return;
    }
    let place = textureLoad(position, id.xy, 0);
    var arriving = vec3f(0.0);
    if place.w > 0.0 {
        arriving = indirect_irradiance(place.xyz, textureLoad(normal, id.xy, 0).xyz, textureLoad(triangles, id.xy, 0).x);
    }
    textureStore(irradiance, id.xy, vec4f(arriving, 1.0));
    textureStore(radiance, id.xy, vec4f(arriving * textureLoad(reflectance, id.xy, 0).rgb / 3.14159265358979, 1.0));
}
