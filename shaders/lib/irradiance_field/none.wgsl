// No light by way of others.

fn indirect_irradiance(position: vec3f, normal: vec3f, triangle: u32) -> vec3f {
    return vec3f(0.0);
}
