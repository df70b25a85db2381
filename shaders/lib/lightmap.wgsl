// Texels of a lightmap: as passes/texels.rs.

struct TexelSurface {
    position: vec3f,
    area: f32,
    // Of the front.
    normal: vec3f,
    triangle: u32,
}

// What a texel sends out.
struct Shot {
    position: vec3f,
    // The square of the distance below which it brings no more.
    nearest: f32,
    normal: vec3f,
    // The area that it would stand for as the only one of an iteration.
    stands_for: f32,
    // Its radiance times the area that it stands for among all.
    flux: vec3f,
    padding: u32,
}

// The square of the distance within which a texel neither brings nor takes more, over its area.
const NEAREST_TEXEL = 4.0;

// Further than any part of a cell is, squared.
const UNLIT = 16.0;

// How far a point within a cell is from one of its parts, less how far that reaches, squared.
fn distance_of_part(packed: u32, within: vec2f) -> f32 {
    let unpacked = vec3f(f32(packed & 255u), f32((packed >> 8u) & 255u), f32((packed >> 16u) & 255u)) / 255.0;
    let way = within - unpacked.xy;
    return dot(way, way) - unpacked.z * unpacked.z;
}

// Which of a cell's parts a point within the cell is in, of those that are lit if any is: as texels::part_at.
fn part_at(cell: vec4u, within: vec2f, is_lit: vec3<bool>) -> u32 {
    var nearest = 0u;
    var least = 1e30;
    for (var part = 0u; part < 3u && cell[part + 1u] != 0u; part++) {
        let distance = distance_of_part(cell[part + 1u], within) + select(UNLIT, 0.0, is_lit[part]);
        nearest = select(nearest, part, distance < least);
        least = min(least, distance);
    }
    return nearest;
}

// Which of the eight neighbours is a step away along each axis.
fn number_of_neighbour(way: vec2i) -> u32 {
    let at = u32(3 * (way.y + 1) + way.x + 1);
    return select(at, at - 1u, at > 4u);
}

// What links tell of the neighbour that is a step away along each axis: as texels::link.
fn link_of(links: u32, way: vec2i) -> u32 {
    return (links >> (2u * number_of_neighbour(way))) & 3u;
}

fn is_same_chart(links: u32, way: vec2i) -> bool {
    return ((links >> (16u + number_of_neighbour(way))) & 1u) != 0u;
}

// How far from a cell whose points are all beneath a wall a place within may be, in cells.
const BESIDE_WALL = 0.15;

// The reflectance of bits: as math::colour.
fn reflectance_of(bits: u32) -> vec3f {
    let root = vec3f(f32(bits & 2047u), f32((bits >> 11u) & 2047u), f32(bits >> 22u)) / vec3f(2047.0, 2047.0, 1023.0);
    return root * root;
}

fn reflectance_bits(colour: vec3f) -> u32 {
    let rounded = vec3u(sqrt(saturate(colour)) * vec3f(2047.0, 2047.0, 1023.0) + 0.5);
    return rounded.x | (rounded.y << 11u) | (rounded.z << 22u);
}

// The normal of one of its sides.
fn normal_of_side(surface: TexelSurface, side: u32) -> vec3f {
    return select(surface.normal, -surface.normal, side == 1u);
}

// By what an area is chosen whose radiance has such a luminance: its root, or itself.
fn favour(luminance: f32, is_root: bool) -> f32 {
    return select(luminance, sqrt(luminance), is_root);
}

// What a texel reflects, by its direct light, with the bits of its reflectance, and its irradiance.
fn radiance_of_texel(direct: vec4f, irradiance: vec4f) -> vec3f {
    return direct.rgb + reflectance_of(bitcast<u32>(direct.w)) * irradiance.rgb / 3.14159265358979;
}
