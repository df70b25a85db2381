#import lib/emitters/traced
#import lib/lightmap

// Direct light that the texels of a lightmap reflect: as passes/lightmap does it.

// As scene::atlas has it.
struct TexelPlace {
    triangle: u32,
    barycentric_u: f32,
    barycentric_v: f32,
    area: f32,
}

@group(0) @binding(0) var<storage, read> texels: array<TexelPlace>;
@group(0) @binding(1) var<storage, read_write> surfaces: array<TexelSurface>;
// Light, and the bits of the reflectance: texel · SIDES + side.
@group(0) @binding(2) var<storage, read_write> direct: array<vec4f>;

override SIDES: u32 = 1u;
override TEXELS: u32 = 1u;

@compute @workgroup_size(64)
fn light(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = (group.x + group.y * groups.x) * 64u + lane;
    if place >= TEXELS * SIDES {
        return;
    }
    let texel = texels[place / SIDES];
    let side = place % SIDES;
    if side == 0u {
        surfaces[place / SIDES] = surface_of(texel);
    }
    var light = vec4f(0.0);
    if side == 0u || (scene_material(material_of(texel.triangle)).flags & TWO_SIDED) != 0u {
        let surface = seen_side(texel.triangle, texel, side);
        let seed = hash(place);
        let reflected = punctual_reflected(surface, seed) + emitters_reflected(surface, seed, place);
        light = vec4f(reflected, bitcast<f32>(reflectance_bits(surface.reflectance)));
    }
    direct[place] = light;
}

fn surface_of(texel: TexelPlace) -> TexelSurface {
    let triangle = texel.triangle;
    let a = scene_corners[3u * triangle].xyz;
    let e1 = scene_corners[3u * triangle + 1u].xyz;
    let e2 = scene_corners[3u * triangle + 2u].xyz;
    let plane = cross(e1, e2);
    let face = plane / max(length(plane), 1e-37);
    var normal = face;
    if SMOOTH {
        let n0 = scene_attributes[4u * triangle].xyz;
        let n1 = scene_attributes[4u * triangle + 1u].xyz;
        let n2 = scene_attributes[4u * triangle + 2u].xyz;
        let smooth_normal = n0 + (n1 - n0) * texel.barycentric_u + (n2 - n0) * texel.barycentric_v;
        let normal_length = length(smooth_normal);
        normal = select(face, smooth_normal / max(normal_length, 1e-37), normal_length > 1e-6);
    }
    return TexelSurface(a + e1 * texel.barycentric_u + e2 * texel.barycentric_v, texel.area, normal, texel.triangle);
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
    let width = sqrt(texel.area) / max(extent, 1e-37);
    return surface_seen_over(triangle, position + face * extent, -face, mat2x3f(frame[0] * width, frame[1] * width));
}
