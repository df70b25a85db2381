// The sum of two images.

@group(0) @binding(0) var left: texture_2d<f32>;
@group(0) @binding(1) var right: texture_2d<f32>;
@group(0) @binding(2) var sum: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn add(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < textureDimensions(sum)) {
        textureStore(sum, id.xy, vec4f(textureLoad(left, id.xy, 0).rgb + textureLoad(right, id.xy, 0).rgb, 1.0));
    }
}
