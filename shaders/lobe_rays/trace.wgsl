#import lib/pixel
#import lib/colour
#import lib/frame
#import lib/reflected
#import IRRADIANCE_FIELD

// Light that lobes of the visible surfaces reflect, by rays drawn from the lobe at each pixel: as passes/lobe_rays.

@group(0) @binding(0) var position: texture_2d<f32>;
@group(0) @binding(1) var triangles: texture_2d<u32>;
// Light that the rays see, in the mean over what the lobe reflects of it, and the standard error of its luminance.
@group(0) @binding(2) var seen: texture_storage_2d<rgba32float, write>;
// The share of light that the lobe reflects.
@group(0) @binding(3) var albedo: texture_storage_2d<rgba32float, write>;

override RAYS: u32 = 64u;
// Whether rays see emitters and the sky themselves; otherwise the direct pass lights from them.
override SEES_EMISSION: bool = false;

// Of so many rays one goes anywhere over the surface.
const ANYWHERE = 4u;

// As math::lattice::golden.
fn golden(number: u32, of_all: u32, shift: vec2f) -> vec2f {
    return fract(vec2f((f32(number) + 0.5) / f32(of_all), 0.618034 * f32(number)) + shift);
}

// Where the number-th ray of a pixel comes from, in the lobe's frame.
fn ray_from(lobe: Lobe, outgoing: vec3f, number: u32, shift: vec2f) -> vec3f {
    let anywhere = RAYS / ANYWHERE;
    if number >= anywhere {
        return lobe_sample(lobe, outgoing, golden(number - anywhere, RAYS - anywhere, shift));
    }
    let at = golden(number, anywhere, shift);
    return around(sqrt(1.0 - at.x), 2.0 * PI * at.y);
}

// How many of a pixel's rays come from around a direction [1/sr].
fn ray_density(lobe: Lobe, outgoing: vec3f, incoming: vec3f) -> f32 {
    let anywhere = RAYS / ANYWHERE;
    return f32(RAYS - anywhere) * lobe_density(lobe, outgoing, incoming) + f32(anywhere) * incoming.z / PI;
}

// What comes along a ray that meets a surface.
fn light_seen(surface: Surface, triangle: u32, seed: u32) -> vec3f {
    var light = reflected_of_direct(surface, seed);
    if SEES_EMISSION {
        light += surface.emission;
    }
    if WALKS {
        let stay = stay_of(surface, triangle + 1u, seed);
        if any(stay.reflectance != vec3f(0.0)) {
            light += indirect_irradiance(stay.position, stay.normal, stay.triangle) * stay.reflectance / PI;
        }
    }
    return light;
}

fn light_along(origin: vec3f, direction: vec3f, seed: u32) -> vec3f {
    let hit = nearest_hit(origin, direction, FAR_AWAY, false);
    if hit.triangle != NO_TRIANGLE {
        return light_seen(surface_seen(hit.triangle, origin, direction), hit.triangle, seed);
    }
    if SEES_EMISSION {
        return environment_radiance(direction);
    }
    return vec3f(0.0);
}

struct Traced {
    seen: vec3f,
    error: f32,
    albedo: vec3f,
}

// As Fan::traced.
fn traced(surface: Surface, pixel: u32) -> Traced {
    let lobe = lobe_of(surface);
    let origin = surface.position + surface.face_normal * surface_offset(surface.position);
    let shift = vec2f(unit(hash(pixel ^ 0x9e3779b9u)), unit(hash(pixel ^ 0x85ebca6bu)));
    let turn = bitcast<u32>(unit(pixel));
    var albedo_sum = vec3f(0.0);
    var light_sum = vec3f(0.0);
    // Of squares of shares, of these by light, and by light squared.
    var squares = vec3f(0.0);
    for (var number = 0u; number < RAYS; number++) {
        let incoming = ray_from(lobe, surface.outgoing, number, shift);
        let density = ray_density(lobe, surface.outgoing, incoming);
        let direction = surface.tangent * incoming.x + surface.bitangent * incoming.y + surface.normal * incoming.z;
        if incoming.z > 0.0 && density > 0.0 && dot(surface.face_normal, direction) > 0.0 {
            let light = light_along(origin, normalize(direction), combine(turn, number));
            let share = lobe_value(lobe, surface.outgoing, incoming) * (incoming.z / density);
            albedo_sum += share;
            light_sum += share * light;
            let weight = luminance(share);
            let bright = luminance(light);
            squares += weight * weight * vec3f(1.0, bright, bright * bright);
        }
    }
    let mean = select(light_sum / albedo_sum, vec3f(0.0), albedo_sum <= vec3f(0.0));
    let bright = luminance(mean);
    let variance = max(squares.z - 2.0 * bright * squares.y + bright * bright * squares.x, 0.0);
    return Traced(mean, sqrt(variance) / max(luminance(albedo_sum), 1e-37), albedo_sum);
}

@compute @workgroup_size(8, 8)
fn trace(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(position)) {
        return;
    }
    let triangle = textureLoad(triangles, id.xy, 0).x;
    var light = Traced(vec3f(0.0), 0.0, vec3f(0.0));
    if triangle != 0u && textureLoad(position, id.xy, 0).w > 0.0 {
        let surface = surface_in_pixel(triangle - 1u, id.xy);
        if surface.lobe != 0u {
            light = traced(surface, combine(id.x, id.y));
        }
    }
    textureStore(seen, id.xy, vec4f(light.seen, light.error));
    textureStore(albedo, id.xy, vec4f(light.albedo, 1.0));
}
