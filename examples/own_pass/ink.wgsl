// Lines where surfaces end or bend, and the picture with them drawn in.

#import lib/beside

@group(0) @binding(0) var position: texture_2d<f32>;
@group(0) @binding(1) var normal: texture_2d<f32>;
// Of each pixel the share of those around it that show another surface.
@group(0) @binding(2) var<storage, read_write> edges: array<f32>;

override REACH: i32 = 1;

fn shows(at: vec2i) -> vec4f {
    return textureLoad(position, clamp(at, vec2i(0), vec2i(textureDimensions(position)) - 1), 0);
}

@compute @workgroup_size(8, 8)
fn find(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(position);
    if any(id.xy >= size) {
        return;
    }
    let at = vec2i(id.xy);
    let own = shows(at);
    let facing = textureLoad(normal, at, 0).xyz;
    var others = 0.0;
    for (var y = -REACH; y <= REACH; y++) {
        for (var x = -REACH; x <= REACH; x++) {
            let there = clamp(at + vec2i(x, y), vec2i(0), vec2i(size) - 1);
            let other = shows(there);
            let is_one = (own.w > 0.0) == (other.w > 0.0) && (own.w <= 0.0 || all(there == at) || is_beside(own.xyz, facing, other.xyz, textureLoad(normal, there, 0).xyz));
            others += select(1.0, 0.0, is_one);
        }
    }
    let pixels = f32((2 * REACH + 1) * (2 * REACH + 1));
    edges[id.y * size.x + id.x] = others / pixels;
}

@group(0) @binding(3) var picture: texture_2d<f32>;
@group(0) @binding(4) var inked: texture_storage_2d<rgba32float, write>;

override STRENGTH: f32 = 1.0;

@compute @workgroup_size(8, 8)
fn draw(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(picture);
    if any(id.xy >= size) {
        return;
    }
    let ink = saturate(STRENGTH * edges[id.y * size.x + id.x]);
    textureStore(inked, id.xy, vec4f(textureLoad(picture, id.xy, 0).rgb * (1.0 - ink), 1.0));
}
