#import lib/trace

// How much of a punctual light arrives at a surface point: 0 or 1, by a shadow ray. `to_light` is a unit vector.
fn light_visibility(light: SceneLight, position: vec3f, normal: vec3f, to_light: vec3f, distance: f32, seed: u32) -> f32 {
    if light.shadow_layers == 0u {
        return 1.0;
    }
    let origin = position + normal * surface_offset(position);
    return select(1.0, 0.0, trace_occluded(origin, to_light, distance * 0.9999));
}
