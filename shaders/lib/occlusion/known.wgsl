// Whether a shadow ray of a known number is blocked, where all of the picture have been cast: a bit for each ray, a word of a pixel beside that of the
// next.

@group(0) @binding(17) var<storage, read> blocked_rays: array<u32>;

// The pixel's place among the pixels, and their number.
var<private> blocked_at: vec2u;

fn at_pixel(place: u32, pixels: u32) {
    blocked_at = vec2u(place, pixels);
}

fn is_blocked(ray: u32, origin: vec3f, direction: vec3f, distance: f32) -> bool {
    return (blocked_rays[ray / 32u * blocked_at.y + blocked_at.x] >> (ray % 32u) & 1u) != 0u;
}
