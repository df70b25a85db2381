#import lib/frame
#import lib/outline
#import lib/photon_map

// The irradiance at any point, from the photons that arrive near it: as Density of passes/irradiance_field.rs.

// Photons of a point, how far away they may be, and whether their outline tells their area.
override PHOTONS_WANTED: u32 = 64u;
override SEARCH_RADIUS: f32 = 1.0;
override PHOTONS_EDGES: bool = true;

fn indirect_irradiance(position: vec3f, normal: vec3f, triangle: u32) -> vec3f {
    let zone = photon_zone(position, normal, PHOTONS_WANTED, SEARCH_RADIUS);
    let frame = frame_around(normal, 0.0);
    let head = map_head();
    var flux = vec3f(0.0);
    var count = 0u;
    begin_outline();
    let slab = slab_of(head, normal, zone.radius, zone.level);
    for (var number = 0u; number < 8u; number++) {
        let range = photons_of(head, position, zone.level, number, normal, slab);
        for (var i = range.x; i < range.y; i++) {
            let photon = photon_at(i);
            if photon_distance(photon, position, normal, zone.radius) >= 0.0 {
                flux += photon.flux;
                count += 1u;
                if PHOTONS_EDGES {
                    let way = photon.position - position;
                    add_to_outline(vec2f(dot(way, frame[0]), dot(way, frame[1])));
                }
            }
        }
    }
    var area = 3.14159265 * zone.radius * zone.radius;
    if PHOTONS_EDGES {
        area = outline_stands_for(zone.radius);
    }
    return flux * (fair_share(zone, count) / max(area, 1e-37));
}

// The same at a point of each lane that asks.
fn irradiance_of_lanes(lane: u32, asks: bool, position: vec3f, normal: vec3f, triangle: u32) -> vec3f {
    if !asks {
        return vec3f(0.0);
    }
    return indirect_irradiance(position, normal, triangle);
}
