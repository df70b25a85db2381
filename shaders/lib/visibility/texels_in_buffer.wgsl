// Shadow maps in a buffer, as far as one may be so large: a driver that runs on the CPU takes two thirds of the time for 16 taps.

@group(2) @binding(0) var<storage, read> shadow_depth: array<f32>;

// Texels along an edge of a map, and words from a row to the next.
override SHADOW_ROWS: u32 = 1024u;
override SHADOW_PITCH: u32 = 1024u;

fn shadow_texel(layer: u32, texel: vec2i) -> f32 {
    return shadow_depth[(layer * SHADOW_ROWS + u32(texel.y)) * SHADOW_PITCH + u32(texel.x)];
}
