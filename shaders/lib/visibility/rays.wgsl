// How much of a punctual light arrives at a surface point, by a shadow ray wherever it is seen from.
fn light_visibility(light: SceneLight, surface: Surface, arriving: Arriving, seed: u32) -> f32 {
    return visibility_by_ray(light, surface, arriving);
}
