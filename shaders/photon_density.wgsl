#import lib/camera
#import lib/frame
#import lib/outline
#import lib/photon_map

// Indirect light at the visible surfaces from the photons that arrive near them.

@group(0) @binding(0) var position: texture_2d<f32>;
@group(0) @binding(1) var normal: texture_2d<f32>;
@group(0) @binding(2) var reflectance: texture_2d<f32>;
@group(0) @binding(3) var irradiance: texture_storage_2d<rgba32float, write>;
@group(0) @binding(4) var radiance: texture_storage_2d<rgba32float, write>;

// Photons of a pixel, how far away they may be, and whether their outline tells their area.
override WANTED: u32 = 64u;
override REACH: f32 = 1.0;
override EDGES: bool = true;

@compute @workgroup_size(8, 8)
fn estimate(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= camera.size) {
        return;
    }
    let place = textureLoad(position, id.xy, 0);
    var arriving = vec3f(0.0);
    if place.w > 0.0 {
        arriving = photon_irradiance(place.xyz, textureLoad(normal, id.xy, 0).xyz);
    }
    textureStore(irradiance, id.xy, vec4f(arriving, 1.0));
    textureStore(radiance, id.xy, vec4f(arriving * textureLoad(reflectance, id.xy, 0).rgb / 3.14159265358979, 1.0));
}

fn photon_irradiance(place: vec3f, up: vec3f) -> vec3f {
    let zone = photon_zone(place, up, WANTED, REACH);
    let frame = frame_around(up, 0.0);
    let head = map_head();
    var flux = vec3f(0.0);
    var count = 0u;
    begin_outline();
    let slab = slab_of(head, up, zone.radius, zone.level);
    for (var number = 0u; number < 8u; number++) {
        let range = photons_of(head, place, zone.level, number, up, slab);
        for (var i = range.x; i < range.y; i++) {
            let photon = photons[i];
            if photon_distance(photon, place, up, zone.radius) >= 0.0 {
                flux += photon.flux;
                count += 1u;
                if EDGES {
                    let way = photon.position - place;
                    add_to_outline(vec2f(dot(way, frame[0]), dot(way, frame[1])));
                }
            }
        }
    }
    var area = 3.14159265 * zone.radius * zone.radius;
    if EDGES {
        area = outline_stands_for(zone.radius);
    }
    return flux * (fair_share(zone, count) / max(area, 1e-37));
}
