#import lib/reflected
#import SEEN

// Radiance and distance of what each sample sees, shaded once.

// Radiance, distance: tile · samples + sample.
@group(0) @binding(3) var<storage, read_write> radiance: array<vec4f>;

// Whether records see emitters and the sky themselves; otherwise the direct pass lights from them.
override SEES_EMISSION: bool = false;

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
        var light = reflected_of_direct(surface, seed);
        if SEES_EMISSION {
            light += surface.emission;
        }
        value = vec4f(light, surface.distance);
    } else if SEES_EMISSION && ray.is_cast {
        value = vec4f(environment_radiance(ray.direction), FAR_AWAY);
    }
    radiance[ray.place] = value;
}
