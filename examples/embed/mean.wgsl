// The mean of a picture: one workgroup, each lane a share of the pixels.

@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var<storage, read_write> mean: vec4f;

const LANES = 64u;
var<workgroup> sums: array<vec4f, LANES>;

@compute @workgroup_size(64)
fn add_up(@builtin(local_invocation_index) lane: u32) {
    let size = textureDimensions(picture);
    var sum = vec4f(0.0);
    for (var at = lane; at < size.x * size.y; at += LANES) {
        sum += textureLoad(picture, vec2u(at % size.x, at / size.x), 0);
    }
    sums[lane] = sum;
    workgroupBarrier();
    if lane == 0u {
        var all = vec4f(0.0);
        for (var other = 0u; other < LANES; other++) {
            all += sums[other];
        }
        mean = all / f32(size.x * size.y);
    }
}
