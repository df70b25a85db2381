#import lib/lobe
#import lib/pixel

// Pixels that see a surface of one kind; at the others nothing is seen.

@group(0) @binding(0) var position: texture_2d<f32>;
@group(0) @binding(1) var reflectance: texture_2d<f32>;
@group(0) @binding(2) var triangles: texture_2d<u32>;
@group(0) @binding(3) var kept: texture_storage_2d<rgba32float, write>;
@group(0) @binding(4) var<storage, read> tables: array<MaterialTables>;
// Reflectance of the lobe; its table, and as the fraction the azimuth of its first axis, or −1 where there is no lobe.
@group(0) @binding(5) var seen: texture_storage_2d<rgba32float, write>;

// Whether sharp lobes stay with the others.
override SHARP_TOO: bool = true;

// Those of a material: passes/lobe_coefficients has the twin.
struct MaterialTables {
    first: u32,
    count: u32,
    least: f32,
    step: f32,
}

// Of a material that has any, the nearest to how rough it is there.
fn table_of(at: MaterialTables, surface: Surface) -> u32 {
    if at.count == 1u {
        return at.first;
    }
    let level = round((sqrt(surface.lobe_shape.x) - at.least) / at.step);
    return at.first + u32(clamp(level, 0.0, f32(at.count - 1u)));
}

@compute @workgroup_size(8, 8)
fn keep_diffuse(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(triangles)) {
        return;
    }
    let is_diffuse = any(textureLoad(reflectance, id.xy, 0).rgb > vec3f(0.0));
    textureStore(kept, id.xy, select(vec4f(0.0), textureLoad(position, id.xy, 0), is_diffuse));
}

@compute @workgroup_size(8, 8)
fn keep_glossy(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(triangles)) {
        return;
    }
    let triangle = textureLoad(triangles, id.xy, 0).x;
    var place = vec4f(0.0);
    var lobe = vec4f(0.0, 0.0, 0.0, -1.0);
    if triangle != 0u {
        let of_material = tables[material_of(triangle - 1u)];
        if of_material.count > 0u {
            let surface = surface_in_pixel(triangle - 1u, id.xy);
            if SHARP_TOO || !is_sharp(lobe_of(surface)) {
                let frame = frame_around(surface.normal, 0.0);
                let azimuth = fract(atan2(dot(surface.tangent, frame[1]), dot(surface.tangent, frame[0])) / (2.0 * PI));
                lobe = vec4f(surface.specular, f32(table_of(of_material, surface)) + min(azimuth, 0.9999));
                place = textureLoad(position, id.xy, 0);
            }
        }
    }
    textureStore(kept, id.xy, place);
    textureStore(seen, id.xy, lobe);
}

@compute @workgroup_size(8, 8)
fn keep_sharp(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(triangles)) {
        return;
    }
    let triangle = textureLoad(triangles, id.xy, 0).x;
    var place = vec4f(0.0);
    if triangle != 0u {
        let surface = surface_in_pixel(triangle - 1u, id.xy);
        if surface.lobe != 0u && is_sharp(lobe_of(surface)) {
            place = textureLoad(position, id.xy, 0);
        }
    }
    textureStore(kept, id.xy, place);
}
