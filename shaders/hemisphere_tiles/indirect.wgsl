#import lib/lobe_walk
#import lib/seen
#import IRRADIANCE_FIELD

// Adds what the surfaces that a tile sees reflect of indirect light.

// Radiance, distance: tile · samples + sample.
@group(0) @binding(3) var<storage, read_write> radiance: array<vec4f>;

fn with_lobe_albedo(surface: Surface) -> vec3f {
    if surface.lobe == 0u {
        return surface.reflectance;
    }
    return surface.reflectance + lobe_albedo(lobe_of(surface), surface.outgoing);
}

fn reflected_there(surface: Surface, reflectance: vec3f) -> vec3f {
    if all(reflectance == vec3f(0.0)) {
        return vec3f(0.0);
    }
    return indirect_irradiance(surface.position, surface.normal) * reflectance / PI;
}

// Where the sample stays, and what comes back of what is reflected there.
fn asked(first: Surface, seed: u32) -> vec3f {
    var at = first;
    var share = vec3f(1.0);
    for (var number = 0u; GLOSSY && number < MOST_LOBES && at.lobe != 0u; number++) {
        let next = walk_step(at, walk_seed(seed, number));
        share *= next.share;
        if !next.goes_on {
            return reflected_there(at, share * at.reflectance);
        }
        at = next.surface;
    }
    // The last lobe reflects as if light came alike from all sides.
    return reflected_there(at, share * with_lobe_albedo(at));
}

@compute @workgroup_size(64)
fn add_indirect(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let ray = seen_sample(group, groups, lane);
    if ray.inside && ray.triangle != 0u {
        let surface = surface_seen(ray.triangle - 1u, ray.origin, ray.direction);
        radiance[ray.place] += vec4f(asked(surface, combine(bitcast<u32>(ray.turn), ray.index)), 0.0);
    }
}
