#import lib/light

// Whether another shader adds what diffuse parts reflect of the broad sky.
override SKY_APART: bool = false;

// Light of emissive surfaces and the sky at a pixel: by shadow rays.
fn emitters_reflected(surface: Surface, seed: u32, place: u32) -> vec3f {
    if SKY_APART {
        return area_reflected(surface, seed) + sky_but_broad(surface, seed);
    }
    return area_reflected(surface, seed) + sky_reflected(surface, seed);
}
