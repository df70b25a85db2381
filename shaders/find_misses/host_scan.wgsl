// The weight of each pixel for the host's walk: Σ w, or −1 where no surface is seen.

@group(0) @binding(0) var position: texture_2d<f32>;
@group(0) @binding(1) var sums: texture_2d<f32>;
@group(0) @binding(2) var<storage, read_write> weights: array<f32>;

@compute @workgroup_size(64)
fn look(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = (group.x + group.y * groups.x) * 64u + lane;
    let size = textureDimensions(position);
    if index < size.x * size.y {
        let pixel = vec2u(index % size.x, index / size.x);
        weights[index] = select(-1.0, textureLoad(sums, pixel, 0).w, textureLoad(position, pixel, 0).w > 0.0);
    }
}
