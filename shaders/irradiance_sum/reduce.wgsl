#import lib/sums

// What the mipmap chain and the ping-pong share: each sample's seven parts as an image, and averages of 2×2 texels.
// A part is stored times the number of samples, so that the average over a tile is its sum, and free of the unit of
// length: what has 1/distance in it is stored times the scene's extent. The third part's last component is a maximum. Squares are
// stored times the square of that number, as half floats hold none that are so small.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read> weights: array<TileSample>;
// Sorted by their first samples; those of sample i are `edge_starts[i] .. edge_starts[i + 1]`.
@group(0) @binding(2) var<storage, read> edges: array<TileEdge>;
@group(0) @binding(3) var<storage, read> edge_starts: array<u32>;
@group(0) @binding(4) var<storage, read> radiance: array<vec4f>;
// The level before the one that is written, a part a layer; level 0 has a texel a sample.
@group(0) @binding(5) var fine: texture_2d_array<f32>;
@group(0) @binding(6) var coarse_f32: texture_storage_2d_array<rgba32float, write>;
@group(0) @binding(7) var coarse_f16: texture_storage_2d_array<rgba16float, write>;

// Of the block of four whose last sample each is, the weight; 0 where there is none.
@group(0) @binding(9) var<storage, read> block_weights: array<f32>;

// What each tile's radiance is multiplied by before it is stored as half floats: a power of two, so that no digit changes.
@group(0) @binding(8) var<storage, read_write> exposures: array<f32>;

// The largest half float: what is beyond is cut, not infinite.
const LARGEST_F16 = 65504.0;
// The exponent of the largest finite float, and as far as the exposure's inverse is one too.
const LARGEST_EXPONENT = 126.0;

var<workgroup> brightest: array<f32, 64>;

// One workgroup a tile: the exposure under which its brightest sample is between 1 and 2.
@compute @workgroup_size(64)
fn expose(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = group.x + group.y * groups.x;
    let size = TILE_WIDTH * TILE_HEIGHT;
    var most = 0.0;
    if tile < TILE_CAPACITY {
        for (var sample = lane; sample < size; sample += 64u) {
            if weights[sample].plain_weight > 0.0 {
                let seen = radiance[tile * size + sample];
                most = max(most, max(seen.r, max(seen.g, seen.b)));
            }
        }
    }
    brightest[lane] = most;
    for (var half = 32u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            brightest[lane] = max(brightest[lane], brightest[lane + half]);
        }
    }
    if lane == 0u && tile < TILE_CAPACITY {
        // What is next to black needs no exposure.
        let exponent = clamp(floor(log2(max(brightest[0], 1e-30))), -LARGEST_EXPONENT, LARGEST_EXPONENT);
        exposures[tile] = ldexp(1.0, -i32(exponent));
    }
}

struct Place {
    tile: u32,
    // Within the tile.
    texel: vec2u,
    // In the image.
    at: vec2u,
    inside: bool,
}

fn place_of(group: vec3u, groups: vec3u, lane: u32) -> Place {
    let item = tile_item(LEVEL_WIDTH * LEVEL_HEIGHT, group, groups, lane);
    let texel = vec2u(item.index % LEVEL_WIDTH, item.index / LEVEL_WIDTH);
    return Place(item.tile, texel, level_corner(item.tile) + texel, item.inside);
}

fn scaled(part: u32, value: vec4f) -> vec4f {
    let count = f32(TILE_WIDTH * TILE_HEIGHT);
    let extent = scene_parameters.extent;
    switch part {
        case 0u: {
            return value * count * vec4f(1.0, 1.0, 1.0, extent);
        }
        case 1u: {
            return value * count;
        }
        case 2u: {
            return value * vec4f(count, count, count, extent);
        }
        case 6u: {
            return value * count * count;
        }
        default: {
            return value * count * extent * vec4f(1.0, 1.0, 1.0, extent);
        }
    }
}

// Of a tile's radiance times an exposure.
fn contribution(tile: u32, sample: u32, exposure: f32) -> Sums {
    let exposed = vec4f(vec3f(exposure), 1.0);
    let request = requests[tile];
    let size = TILE_WIDTH * TILE_HEIGHT;
    let weight = weights[sample];
    var sums: Sums;
    if weight.plain_weight > 0.0 {
        let seen = radiance[tile * size + sample] * exposed;
        let nearest = least_distance(request);
        let inverse = 1.0 / max(seen.w, nearest);
        add_sample(&sums, weight.cosine_weight, vec2f(weight.rotation_x, weight.rotation_y), seen.rgb, inverse);
        let block_weight = block_weights[sample];
        if block_weight > 0.0 {
            let last = tile * size + sample;
            let above = last - TILE_WIDTH;
            let corner = radiance[above - 1u].rgb * exposure;
            add_block(&sums, block_weight, corner, radiance[above].rgb * exposure, radiance[last - 1u].rgb * exposure, seen.rgb);
        }
        if GRADIENTS {
            for (var i = edge_starts[sample]; i < edge_starts[sample + 1u]; i++) {
                let edge = edges[i];
                let other = radiance[tile * size + edge.b] * exposed;
                let inverse_other = 1.0 / max(other.w, nearest) / weights[edge.b].depth_cosine;
                let hessian = vec3f(edge.hessian_xx, edge.hessian_xy, edge.hessian_yy);
                add_wall(&sums, edge.gradient, hessian, vec4f(seen.rgb, inverse / weight.depth_cosine), vec4f(other.rgb, inverse_other));
            }
        }
    }
    return sums;
}

@compute @workgroup_size(64)
fn contribute_f32(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = place_of(group, groups, lane);
    if place.inside {
        let sums = contribution(place.tile, place.texel.y * TILE_WIDTH + place.texel.x, 1.0);
        for (var part = 0u; part < PARTS; part++) {
            textureStore(coarse_f32, place.at, part, scaled(part, sums.parts[part]));
        }
    }
}

@compute @workgroup_size(64)
fn contribute_f16(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = place_of(group, groups, lane);
    if place.inside {
        let sums = contribution(place.tile, place.texel.y * TILE_WIDTH + place.texel.x, exposures[place.tile]);
        for (var part = 0u; part < PARTS; part++) {
            textureStore(coarse_f16, place.at, part, clamp(scaled(part, sums.parts[part]), vec4f(-LARGEST_F16), vec4f(LARGEST_F16)));
        }
    }
}

fn average(at: vec2u, part: u32) -> vec4f {
    let a = textureLoad(fine, 2u * at, part, 0);
    let b = textureLoad(fine, 2u * at + vec2u(1u, 0u), part, 0);
    let c = textureLoad(fine, 2u * at + vec2u(0u, 1u), part, 0);
    let d = textureLoad(fine, 2u * at + vec2u(1u, 1u), part, 0);
    let mean = (a + b + c + d) * 0.25;
    return vec4f(mean.xyz, select(mean.w, max(max(a.w, b.w), max(c.w, d.w)), part == 2u));
}

@compute @workgroup_size(64)
fn average_f32(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = place_of(group, groups, lane);
    if place.inside {
        for (var part = 0u; part < PARTS; part++) {
            textureStore(coarse_f32, place.at, part, average(place.at, part));
        }
    }
}

@compute @workgroup_size(64)
fn average_f16(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = place_of(group, groups, lane);
    if place.inside {
        for (var part = 0u; part < PARTS; part++) {
            textureStore(coarse_f16, place.at, part, average(place.at, part));
        }
    }
}
