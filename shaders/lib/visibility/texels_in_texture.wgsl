// Shadow maps in a texture, where they are too large for a buffer.

@group(2) @binding(0) var shadow_depth: texture_depth_2d_array;

fn shadow_texel(layer: u32, texel: vec2i) -> f32 {
    return textureLoad(shadow_depth, texel, i32(layer), 0);
}
