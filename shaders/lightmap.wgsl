#import lib/emitters/traced
#import lib/lightmap
#import lib/texel_place

// Direct light that the texels of a lightmap reflect: as passes/lightmap does it.

// A point of each texel, then another of each, and so on.
@group(0) @binding(0) var<storage, read> texels: array<TexelPlace>;
@group(0) @binding(1) var<storage, read_write> surfaces: array<TexelSurface>;
// Light, and the bits of the reflectance: texel · SIDES + side.
@group(0) @binding(2) var<storage, read_write> direct: array<vec4f>;


override SIDES: u32 = 1u;
override TEXELS: u32 = 1u;
override POINTS: u32 = 1u;

@compute @workgroup_size(64)
fn light(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = (group.x + group.y * groups.x) * 64u + lane;
    if place >= TEXELS * SIDES {
        return;
    }
    let side = place % SIDES;
    if side == 0u {
        surfaces[place / SIDES] = surface_of(texels[place / SIDES]);
    }
    var reflected = vec3f(0.0);
    var reflectance = vec3f(0.0);
    for (var point = 0u; point < POINTS; point++) {
        let texel = texels[point * TEXELS + place / SIDES];
        if side == 0u || (scene_material(material_of(texel.triangle)).flags & TWO_SIDED) != 0u {
            let surface = seen_side(texel.triangle, texel, side);
            let seed = combine(hash(place), point);
            reflected += punctual_reflected(surface, seed) + emitters_reflected(surface, seed, place);
            reflectance += surface.reflectance;
        }
    }
    let share = 1.0 / f32(POINTS);
    direct[place] = vec4f(reflected * share, bitcast<f32>(reflectance_bits(reflectance * share)));
}

// A side of a texel, with its maps as wide as the texel.
fn seen_side(triangle: u32, texel: TexelPlace, side: u32) -> Surface {
    let e1 = scene_corners[3u * triangle + 1u].xyz;
    let e2 = scene_corners[3u * triangle + 2u].xyz;
    let position = scene_corners[3u * triangle].xyz + e1 * texel.barycentric_u + e2 * texel.barycentric_v;
    let plane = cross(e1, e2);
    let face = plane * (select(1.0, -1.0, side == 1u) / max(length(plane), 1e-37));
    let frame = frame_around(face, 0.0);
    let extent = scene_parameters.extent;
    let width = sqrt(area_of(texel)) / max(extent, 1e-37);
    return surface_seen_over(triangle, position + face * extent, -face, mat2x3f(frame[0] * width, frame[1] * width));
}
