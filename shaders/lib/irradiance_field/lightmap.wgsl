#import lib/in_texture
#import lib/lightmap
#import lib/scene

// The irradiance at any point of a triangle, from a lightmap: as Looks of passes/texels.rs.

// Of each triangle two, whose first six numbers tell where its corners lie; of each cell the number of its first texel + 1 and its parts; of each texel and side irradiance, and its links,
// or -1 less those where no light has come.
@group(0) @binding(20) var<storage, read> lightmap: array<vec4f>;

override LIGHTMAP_EDGE: u32 = 16u;
override LIGHTMAP_SIDES: u32 = 1u;
override LIGHTMAP_FIRST: u32 = 2u;

fn lightmap_cell(at: vec2i) -> vec4u {
    if any(at < vec2i(0)) || any(at >= vec2i(i32(LIGHTMAP_EDGE))) {
        return vec4u(0u);
    }
    return vec4u(lightmap[LIGHTMAP_FIRST + u32(at.y) * LIGHTMAP_EDGE + u32(at.x)]);
}

fn lightmap_texel(texel: u32, side: u32) -> vec4f {
    return lightmap[LIGHTMAP_FIRST + LIGHTMAP_EDGE * LIGHTMAP_EDGE + texel * LIGHTMAP_SIDES + side];
}

// The texel of a cell that a place within it is in, of those that have light if there is any: as Looks::texel_at.
fn lightmap_texel_at(cell: vec4u, within: vec2f, side: u32) -> u32 {
    let first = cell.x - 1u;
    if cell.y == 0u {
        return first;
    }
    var is_lit = vec3<bool>(false);
    for (var part = 0u; part < 3u && cell[part + 1u] != 0u; part++) {
        is_lit[part] = lightmap_texel(first + part, side).w >= 0.0;
    }
    return first + part_at(cell, within, is_lit);
}

// What comes to a place whose cell has had no light: as Looks::beside.
fn light_beside(place: vec2f, at: vec2i, links: u32, side: u32) -> vec3f {
    let within = place - vec2f(at);
    let toward = select(vec2i(-1), vec2i(1), within >= vec2f(0.5));
    let is_near = min(within, 1.0 - within) < vec2f(BESIDE_WALL);
    var sum = vec4f(0.0);
    for (var number = 1u; number < 4u; number++) {
        let is_along = vec2<bool>((number & 1u) != 0u, number > 1u);
        let way = select(vec2i(0), toward, is_along);
        if any(is_along & !is_near) || !is_same_chart(links, way) {
            continue;
        }
        let cell = lightmap_cell(at + way);
        let light = lightmap_texel(lightmap_texel_at(cell, place - vec2f(at + way), side), side);
        sum += select(vec4f(0.0), vec4f(light.rgb, 1.0), light.w >= 0.0);
    }
    return sum.rgb / max(sum.w, 1.0);
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
    let place = laid_at(lightmap[2u * number], lightmap[2u * number + 1u], weights);
    let at = vec2i(floor(place));
    let cell = lightmap_cell(at);
    if cell.x == 0u {
        return vec3f(0.0);
    }
    let own = lightmap_texel(lightmap_texel_at(cell, place - vec2f(at), side), side);
    if own.w < 0.0 {
        return light_beside(place, at, u32(-1.0 - own.w), side);
    }
    let links = u32(own.w);
    let corner = floor(place - 0.5);
    let share = place - 0.5 - corner;
    var sum = vec4f(0.0);
    for (var number_of_four = 0u; number_of_four < 4u; number_of_four++) {
        let beside = vec2u(number_of_four & 1u, number_of_four >> 1u);
        let weight = select(1.0 - share.x, share.x, beside.x == 1u) * select(1.0 - share.y, share.y, beside.y == 1u);
        let there = vec2i(corner) + vec2i(beside);
        if all(there == at) {
            sum += vec4f(own.rgb, 1.0) * weight;
            continue;
        }
        let link = link_of(links, there - at);
        if link != 0u {
            sum += vec4f(lightmap_texel(lightmap_cell(there).x - 1u + link - 1u, side).rgb, 1.0) * weight;
        }
    }
    return sum.rgb / sum.w;
}

// The same at a point of each lane that asks.
fn irradiance_of_lanes(lane: u32, asks: bool, position: vec3f, normal: vec3f, triangle: u32) -> vec3f {
    if !asks {
        return vec3f(0.0);
    }
    return indirect_irradiance(position, normal, triangle);
}
