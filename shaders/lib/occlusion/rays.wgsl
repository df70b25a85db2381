#import lib/trace

// Whether a shadow ray of a known number is blocked: by casting it.
fn at_pixel(place: u32, pixels: u32) {}

fn is_blocked(ray: u32, origin: vec3f, direction: vec3f, distance: f32) -> bool {
    return trace_occluded(origin, direction, distance);
}
