#import lib/beside
#import lib/colour
#import lib/group_sum
#import lib/lightmap

// A lightmap laid out for looks: as passes/lightmap_field.rs.

// Where each triangle's corners lie, and in which chart: two a triangle.
@group(0) @binding(0) var<storage, read> corners: array<vec4f>;
@group(0) @binding(1) var<storage, read> surfaces: array<TexelSurface>;
@group(0) @binding(2) var<storage, read> mean: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> data: array<vec4f>;
// The texel at each place of the texture, + 1; 0 where there is none.
@group(0) @binding(4) var<storage, read> numbers: array<u32>;

// Of each group of texels, the light that shots have brought and what their bound has taken, by area.
@group(0) @binding(5) var<storage, read_write> sums: array<vec2f>;
@group(0) @binding(6) var<storage, read_write> told: array<u32>;

// Texels of all sides.
override PLACES: u32 = 1u;
override EDGE: u32 = 16u;
override SIDES: u32 = 1u;
override TRIANGLES: u32 = 1u;
// Where the light starts.
override FIRST: u32 = 2u;
// How far away texels are whose mean each becomes.
override SMOOTH: u32 = 0u;

@compute @workgroup_size(64)
fn lay_out_corners(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let triangle = (group.x + group.y * groups.x) * 64u + lane;
    if triangle < TRIANGLES {
        data[2u * triangle] = corners[2u * triangle];
        data[2u * triangle + 1u] = corners[2u * triangle + 1u];
    }
}

@compute @workgroup_size(64)
fn lay_out_light(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = (group.x + group.y * groups.x) * 64u + lane;
    if place >= EDGE * EDGE * SIDES {
        return;
    }
    let number = numbers[place / SIDES];
    var laid = vec4f(0.0);
    if number != 0u {
        let centre = vec2i(vec2u(place / SIDES % EDGE, place / SIDES / EDGE));
        let reach = i32(SMOOTH);
        var sum = vec4f(0.0);
        for (var y = -reach; y <= reach; y++) {
            for (var x = -reach; x <= reach; x++) {
                let at = centre + vec2i(x, y);
                if all(at >= vec2i(0)) && all(at < vec2i(i32(EDGE))) {
                    sum += counted(number - 1u, numbers[u32(at.y) * EDGE + u32(at.x)], place % SIDES);
                }
            }
        }
        laid = vec4f(sum.rgb / max(sum.w, 1e-37), corners[2u * surfaces[number - 1u].triangle + 1u].z);
    }
    data[FIRST + place] = laid;
}

// What another texel, of which the number + 1 is given, counts for one: its light and its area, if it is on the same surface.
fn counted(texel: u32, number: u32, side: u32) -> vec4f {
    if number == 0u {
        return vec4f(0.0);
    }
    let other = number - 1u;
    let own = surfaces[texel];
    let surface = surfaces[other];
    let counts = other == texel || is_beside(own.position, normal_of_side(own, side), surface.position, normal_of_side(surface, side));
    return select(vec4f(0.0), vec4f(mean[other * SIDES + side].rgb, 1.0) * max(surface.area, 1.17549435e-38), counts);
}

@compute @workgroup_size(256)
fn sum_bound(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let number = group.x + group.y * groups.x;
    let place = number * GROUP + lane;
    var own = vec2f(0.0);
    if place < PLACES {
        own = vec2f(luminance(mean[place].rgb), mean[place].w) * surfaces[place / SIDES].area;
    }
    let sum = sum_of_lanes(lane, own);
    if lane == 0u && number * GROUP < PLACES {
        sums[number] = sum;
    }
}

// One group.
@compute @workgroup_size(256)
fn tell_bound(@builtin(local_invocation_index) lane: u32) {
    var own = vec2f(0.0);
    for (var at = lane; at < (PLACES + GROUP - 1u) / GROUP; at += GROUP) {
        own += sums[at];
    }
    let sum = sum_of_lanes(lane, own);
    if lane == 0u {
        told[0] = select(0u, u32(1e6 * sum.y / (sum.x + sum.y) + 0.5), sum.y > 0.0);
    }
}
