#import lib/in_texture
#import lib/scene

// The irradiance at any point of a triangle, from a lightmap: as Looks of passes/texels.rs.

// Of each triangle two, whose first six numbers tell where its corners lie, and the seventh in which chart; then irradiance, and the chart.
@group(0) @binding(20) var<storage, read> lightmap: array<vec4f>;

override LIGHTMAP_EDGE: u32 = 16u;
override LIGHTMAP_SIDES: u32 = 1u;
override LIGHTMAP_FIRST: u32 = 2u;

fn lightmap_texel(at: vec2i, side: u32) -> vec4f {
    if any(at < vec2i(0)) || any(at >= vec2i(i32(LIGHTMAP_EDGE))) {
        return vec4f(0.0);
    }
    return lightmap[LIGHTMAP_FIRST + (u32(at.y) * LIGHTMAP_EDGE + u32(at.x)) * LIGHTMAP_SIDES + side];
}

fn indirect_irradiance(position: vec3f, normal: vec3f, triangle: u32) -> vec3f {
    if triangle == 0u {
        return vec3f(0.0);
    }
    let number = triangle - 1u;
    let e1 = scene_corners[3u * number + 1u].xyz;
    let e2 = scene_corners[3u * number + 2u].xyz;
    let side = select(0u, 1u, LIGHTMAP_SIDES == 2u && dot(cross(e1, e2), normal) < 0.0);
    let weights = nearest_weights(e1, e2, position - scene_corners[3u * number].xyz);
    let first = lightmap[2u * number];
    let second = lightmap[2u * number + 1u];
    let place = laid_at(first, second, weights);
    let corner = floor(place - 0.5);
    let share = place - 0.5 - corner;
    var sum = vec4f(0.0);
    for (var number_of_four = 0u; number_of_four < 4u; number_of_four++) {
        let beside = vec2u(number_of_four & 1u, number_of_four >> 1u);
        let weight = select(1.0 - share.x, share.x, beside.x == 1u) * select(1.0 - share.y, share.y, beside.y == 1u);
        let texel = lightmap_texel(vec2i(corner) + vec2i(beside), side);
        sum += vec4f(texel.rgb, 1.0) * select(0.0, weight, texel.w == second.z);
    }
    if sum.w > 0.0 {
        return sum.rgb / sum.w;
    }
    return lightmap_texel(vec2i(place), side).rgb;
}

// The same at a point of each lane that asks.
fn irradiance_of_lanes(lane: u32, asks: bool, position: vec3f, normal: vec3f, triangle: u32) -> vec3f {
    if !asks {
        return vec3f(0.0);
    }
    return indirect_irradiance(position, normal, triangle);
}
