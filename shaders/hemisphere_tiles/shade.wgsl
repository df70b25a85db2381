#import lib/light
#import lib/lobe_walk
#import SEEN

// Radiance and distance of what each sample sees, shaded once.

// Radiance, distance: tile · samples + sample.
@group(0) @binding(3) var<storage, read_write> radiance: array<vec4f>;

// Whether records see emitters and the sky themselves; otherwise the direct pass lights from them.
override SEES_EMISSION: bool = false;
// Whether narrow lobes reflect direct light.
override NARROW_HIGHLIGHTS: bool = true;
// Whether what lobes reflect of other surfaces is gathered, as an irradiance field will be asked there.
override WALKS: bool = false;

// The surface as direct light is reflected.
fn lit(surface: Surface) -> Surface {
    var same = surface;
    if GLOSSY && !NARROW_HIGHLIGHTS && surface.lobe != 0u && is_narrow(lobe_of(surface)) {
        same.lobe = 0u;
    }
    return same;
}

// Direct light of punctual lights by shadow rays, and of others.
fn direct_by_rays(surface: Surface, seed: u32) -> vec3f {
    let lights = select(LIGHTS, scene_parameters.lights, LIGHTS == ANY_NUMBER);
    let origin = surface.position + surface.face_normal * surface_offset(surface.position);
    var sum = area_reflected(surface, seed) + sky_reflected(surface, seed);
    for (var i = 0u; i < lights; i++) {
        let light = scene_light(i);
        let there = arriving_from(light, surface);
        if any(there.irradiance != vec3f(0.0)) && (light.shadow_layers == 0u || !trace_occluded(origin, there.to_light, there.distance * 0.9999)) {
            sum += there.irradiance * response(surface, there.to_light);
        }
    }
    return sum;
}

// What the lobe of a surface reflects of direct light that others reflect.
fn walked(first: Surface, seed: u32) -> vec3f {
    var at = first;
    var share = vec3f(1.0);
    var sum = vec3f(0.0);
    for (var number = 0u; number < MOST_LOBES && at.lobe != 0u; number++) {
        let next_seed = walk_seed(seed, number);
        let next = walk_step(at, next_seed);
        if !next.goes_on {
            break;
        }
        share *= next.share;
        sum += share * direct_by_rays(lit(next.surface), next_seed);
        at = next.surface;
    }
    return sum;
}

@compute @workgroup_size(64)
fn shade(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let ray = seen_sample(group, groups, lane);
    if !ray.inside {
        return;
    }
    var value = vec4f(0.0, 0.0, 0.0, FAR_AWAY);
    if ray.triangle != 0u {
        let surface = surface_seen(ray.triangle - 1u, ray.origin, ray.direction);
        let seed = combine(bitcast<u32>(ray.turn), ray.index);
        var light = direct_reflected(lit(surface), seed);
        if GLOSSY && WALKS {
            light += walked(surface, seed);
        }
        if SEES_EMISSION {
            light += surface.emission;
        }
        value = vec4f(light, surface.distance);
    } else if SEES_EMISSION && ray.is_cast {
        value = vec4f(environment_radiance(ray.direction), FAR_AWAY);
    }
    radiance[ray.place] = value;
}
