// An image, times a number.

@group(0) @binding(0) var image: texture_2d<f32>;
@group(0) @binding(1) var product: texture_storage_2d<rgba32float, write>;

override FACTOR: f32 = 1.0;

@compute @workgroup_size(8, 8)
fn multiply(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < textureDimensions(product)) {
        textureStore(product, id.xy, vec4f(textureLoad(image, id.xy, 0).rgb * FACTOR, 1.0));
    }
}
