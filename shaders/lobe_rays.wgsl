#import lib/camera
#import lib/frame
#import lib/reflected
#import IRRADIANCE_FIELD

// Light that lobes of the visible surfaces reflect, by rays drawn from the lobe at each pixel: as passes/lobe_rays.rs.

@group(0) @binding(0) var position: texture_2d<f32>;
@group(0) @binding(1) var triangles: texture_2d<u32>;
@group(0) @binding(2) var radiance: texture_storage_2d<rgba32float, write>;

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
fn light_seen(surface: Surface, seed: u32) -> vec3f {
    var light = reflected_of_direct(surface, seed);
    if SEES_EMISSION {
        light += surface.emission;
    }
    if WALKS {
        let stay = stay_of(surface, seed);
        if any(stay.reflectance != vec3f(0.0)) {
            light += indirect_irradiance(stay.position, stay.normal) * stay.reflectance / PI;
        }
    }
    return light;
}

fn light_along(origin: vec3f, direction: vec3f, seed: u32) -> vec3f {
    let hit = nearest_hit(origin, direction, FAR_AWAY, false);
    if hit.triangle != NO_TRIANGLE {
        return light_seen(surface_seen(hit.triangle, origin, direction), seed);
    }
    if SEES_EMISSION {
        return environment_radiance(direction);
    }
    return vec3f(0.0);
}

// What the lobe of a surface reflects.
fn reflected_light(surface: Surface, pixel: u32) -> vec3f {
    let lobe = lobe_of(surface);
    let origin = surface.position + surface.face_normal * surface_offset(surface.position);
    let shift = vec2f(unit(hash(pixel ^ 0x9e3779b9u)), unit(hash(pixel ^ 0x85ebca6bu)));
    let turn = bitcast<u32>(unit(pixel));
    var sum = vec3f(0.0);
    for (var number = 0u; number < RAYS; number++) {
        let incoming = ray_from(lobe, surface.outgoing, number, shift);
        let density = ray_density(lobe, surface.outgoing, incoming);
        let direction = surface.tangent * incoming.x + surface.bitangent * incoming.y + surface.normal * incoming.z;
        if incoming.z > 0.0 && density > 0.0 && dot(surface.face_normal, direction) > 0.0 {
            let light = light_along(origin, normalize(direction), combine(turn, number));
            sum += lobe_value(lobe, surface.outgoing, incoming) * (incoming.z / density) * light;
        }
    }
    return sum;
}

@compute @workgroup_size(8, 8)
fn trace(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(position)) {
        return;
    }
    let triangle = textureLoad(triangles, id.xy, 0).x;
    var light = vec3f(0.0);
    if triangle != 0u && textureLoad(position, id.xy, 0).w > 0.0 {
        let surface = surface_seen(triangle - 1u, camera.eye, pixel_ray(id.xy));
        if surface.lobe != 0u {
            light = reflected_light(surface, combine(id.x, id.y));
        }
    }
    textureStore(radiance, id.xy, vec4f(light, 1.0));
}
