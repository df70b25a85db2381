#import lib/light

// Light of emissive surfaces and the sky at a pixel: by shadow rays.
fn emitters_reflected(surface: Surface, seed: u32, place: u32) -> vec3f {
    return area_reflected(surface, seed) + sky_reflected(surface, seed);
}
