#import lib/camera

// Sums that the host made, into the image that other passes read.

// Σ w E and Σ w of each pixel, row by row.
@group(0) @binding(0) var<storage, read> values: array<vec4f>;
@group(0) @binding(1) var image: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn store(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < camera.size) {
        textureStore(image, id.xy, values[id.y * camera.size.x + id.x]);
    }
}
