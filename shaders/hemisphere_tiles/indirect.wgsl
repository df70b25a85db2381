#import lib/lobe
#import lib/seen
#import IRRADIANCE_FIELD

// Adds what the surfaces that a tile sees reflect of indirect light.

// Radiance, distance: tile · samples + sample.
@group(0) @binding(3) var<storage, read_write> radiance: array<vec4f>;

@compute @workgroup_size(64)
fn add_indirect(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let ray = seen_sample(group, groups, lane);
    if !ray.inside || ray.triangle == 0u {
        return;
    }
    let surface = surface_seen(ray.triangle - 1u, ray.origin, ray.direction);
    // Lobes reflect it as if it came alike from all sides.
    var reflectance = surface.reflectance;
    if GLOSSY && surface.lobe != 0u {
        reflectance += lobe_albedo(lobe_of(surface), surface.outgoing);
    }
    let reflected = indirect_irradiance(surface.position, surface.normal) * reflectance / PI;
    radiance[ray.place] += vec4f(reflected, 0.0);
}
