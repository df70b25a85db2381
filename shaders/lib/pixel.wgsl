#import lib/scene
#import lib/camera

// The surface that a pixel sees, with its maps as wide as the pixel.
fn surface_in_pixel(triangle: u32, pixel: vec2u) -> Surface {
    return surface_seen_over(triangle, camera.eye, pixel_ray(pixel), pixel_sides());
}
