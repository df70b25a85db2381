#import lib/texel_place

// Where texels are by the point whose turn it is: as passes/draw_points.rs.

// Where its texels start.
@group(0) @binding(0) var<uniform> turn: vec4u;
@group(0) @binding(1) var<storage, read> texels: array<TexelPlace>;
@group(0) @binding(2) var<storage, read_write> surfaces: array<TexelSurface>;

override TEXELS: u32 = 1u;

@compute @workgroup_size(64)
fn draw(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let texel = (group.x + group.y * groups.x) * 64u + lane;
    if texel < TEXELS {
        surfaces[texel] = surface_of(texels[turn.x + texel]);
    }
}
