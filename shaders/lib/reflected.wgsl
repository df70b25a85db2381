#import lib/light
#import lib/lobe_walk

// What surfaces that are seen reflect of direct light: as passes/seen_light.

// Lobes that reflect direct light: as seen_light::Highlights.
override HIGHLIGHTS: u32 = 0u;
const WIDE_HIGHLIGHTS = 1u;
const SOFT_HIGHLIGHTS = 2u;
// Whether what lobes reflect of other surfaces is gathered, as an irradiance field will be asked there.
override WALKS: bool = false;

// The surface as direct light is reflected.
fn lit(surface: Surface) -> Surface {
    var same = surface;
    if !GLOSSY || surface.lobe == 0u {
        return same;
    }
    if HIGHLIGHTS == WIDE_HIGHLIGHTS && is_narrow(lobe_of(surface)) {
        same.lobe = 0u;
    }
    if HIGHLIGHTS == SOFT_HIGHLIGHTS {
        same.lobe_shape = softened(surface.lobe, surface.lobe_shape);
    }
    return same;
}

// Direct light of punctual lights by shadow rays, and of others.
fn direct_by_rays(surface: Surface, seed: u32) -> vec3f {
    let lights = select(LIGHTS, scene_parameters.lights, LIGHTS == ANY_NUMBER);
    var sum = area_reflected(surface, seed) + sky_reflected(surface, seed);
    for (var i = 0u; i < lights; i++) {
        let light = scene_light(i);
        let arriving = arriving_from(light, surface);
        if any(arriving.irradiance != vec3f(0.0)) && visibility_by_ray(light, surface, arriving) > 0.0 {
            sum += arriving.irradiance * response(surface, arriving.to_light);
        }
    }
    return sum;
}

// What the lobe of a surface reflects of direct light that others reflect.
fn walked(first: Surface, seed: u32) -> vec3f {
    var at = first;
    var share = vec3f(1.0);
    var sum = vec3f(0.0);
    for (var number = 0u; number < MOST_LOBES && at.lobe != 0u; number++) {
        let next_seed = walk_seed(seed, number);
        let next = walk_step(at, next_seed);
        if !next.goes_on {
            break;
        }
        share *= next.share;
        sum += share * direct_by_rays(lit(next.surface), next_seed);
        at = next.surface;
    }
    return sum;
}

fn reflected_of_direct(surface: Surface, seed: u32) -> vec3f {
    let light = direct_reflected(lit(surface), seed);
    if GLOSSY && WALKS {
        return light + walked(surface, seed);
    }
    return light;
}
