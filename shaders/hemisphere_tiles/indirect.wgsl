#import lib/lobe_walk
#import SEEN
#import IRRADIANCE_FIELD

// Adds what the surfaces that a tile sees reflect of indirect light.

// Radiance, distance: tile · samples + sample.
@group(0) @binding(3) var<storage, read_write> radiance: array<vec4f>;

@compute @workgroup_size(64)
fn add_indirect(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let ray = seen_sample(group, groups, lane);
    var stay = Stay(vec3f(0.0), vec3f(0.0), vec3f(0.0), 0u);
    if ray.inside && ray.triangle != 0u {
        let surface = surface_seen(ray.triangle - 1u, ray.origin, ray.direction);
        stay = stay_of(surface, ray.triangle, combine(bitcast<u32>(ray.turn), ray.index));
    }
    let asks = any(stay.reflectance != vec3f(0.0));
    let irradiance = irradiance_of_lanes(lane, asks, stay.position, stay.normal, stay.triangle);
    if asks {
        radiance[ray.place] += vec4f(irradiance * stay.reflectance / PI, 0.0);
    }
}
