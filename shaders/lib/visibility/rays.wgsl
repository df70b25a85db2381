// How much of a punctual light arrives at a surface point: 0 or 1, by a shadow ray.
fn light_visibility(light: SceneLight, surface: Surface, arriving: Arriving, seed: u32) -> f32 {
    if light.shadow_layers == 0u {
        return 1.0;
    }
    return visibility_by_ray(surface, arriving);
}
