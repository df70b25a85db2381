#import lib/beside
#import lib/colour
#import lib/group_sum
#import lib/lightmap

// A lightmap laid out for looks: as passes/lightmap_field.rs.

// Where each triangle's corners lie: two a triangle.
@group(0) @binding(0) var<storage, read> corners: array<vec4f>;
@group(0) @binding(1) var<storage, read> surfaces: array<TexelSurface>;
@group(0) @binding(2) var<storage, read> mean: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> data: array<vec4f>;
// Of each cell of the texture the number of its first texel + 1, 0 where there is none, and its parts.
@group(0) @binding(4) var<storage, read> cells: array<vec4u>;
// Of each texel and side which texels beside go on from it, and the number of its cell.
@group(0) @binding(7) var<storage, read> links: array<vec2u>;

// Of each group of texels, the light that shots have brought and what their bound has taken, by area.
@group(0) @binding(5) var<storage, read_write> sums: array<vec2f>;
@group(0) @binding(6) var<storage, read_write> told: array<u32>;

// Texels of all sides.
override PLACES: u32 = 1u;
override EDGE: u32 = 16u;
override SIDES: u32 = 1u;
override TRIANGLES: u32 = 1u;
// Where the cells start.
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
fn lay_out_cells(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let cell = (group.x + group.y * groups.x) * 64u + lane;
    if cell < EDGE * EDGE {
        data[FIRST + cell] = vec4f(cells[cell]);
    }
}

@compute @workgroup_size(64)
fn lay_out_light(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = (group.x + group.y * groups.x) * 64u + lane;
    if place >= PLACES {
        return;
    }
    let reach = i32(SMOOTH);
    var sum = vec4f(0.0);
    var lit = 0.0;
    for (var y = -reach; y <= reach; y++) {
        for (var x = -reach; x <= reach; x++) {
            let own = counted(place / SIDES, place % SIDES, vec2i(x, y));
            sum += own;
            lit += select(0.0, own.w, any(own.rgb != vec3f(0.0)));
        }
    }
    let own_links = f32(links[place].x);
    // Rays may have missed by chance what those around have found. What is within something solid has an area of 0.
    data[FIRST + EDGE * EDGE + place] = select(vec4f(0.0, 0.0, 0.0, -1.0 - own_links), vec4f(sum.rgb / max(sum.w, 1e-37), own_links), lit > 0.0);
}

// What the texel so many cells away counts for one: its light and its area, if it is on the same surface, and nothing is between on the way there, which goes askew first.
fn counted(texel: u32, side: u32, way: vec2i) -> vec4f {
    var other = texel;
    var rest = way;
    while any(rest != vec2i(0)) {
        let step = sign(rest);
        let of_other = links[other * SIDES + side];
        let link = link_of(of_other.x, step);
        if link == 0u {
            return vec4f(0.0);
        }
        let cell = i32(of_other.y) + step.y * i32(EDGE) + step.x;
        other = cells[cell].x - 1u + link - 1u;
        rest -= step;
    }
    let own = surfaces[texel];
    let surface = surfaces[other];
    let counts = other == texel || is_beside(own.position, normal_of_side(own, side), surface.position, normal_of_side(surface, side));
    return select(vec4f(0.0), vec4f(mean[other * SIDES + side].rgb, 1.0) * surface.area, counts);
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
