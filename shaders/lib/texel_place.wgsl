#import lib/lightmap
#import lib/scene

// A point that a texel stands for: as TexelPlace of passes/texels.rs.
struct TexelPlace {
    triangle: u32,
    barycentric_u: f32,
    barycentric_v: f32,
    // The texel's area, over that of this triangle.
    share: f32,
}

fn area_of(texel: TexelPlace) -> f32 {
    let plane = cross(scene_corners[3u * texel.triangle + 1u].xyz, scene_corners[3u * texel.triangle + 2u].xyz);
    return texel.share * 0.5 * length(plane);
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
    return TexelSurface(a + e1 * texel.barycentric_u + e2 * texel.barycentric_v, area_of(texel), normal, texel.triangle);
}
