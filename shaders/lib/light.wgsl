#import lib/colour
#import lib/scene
#import lib/lobe
#import lib/random
#import lib/frame
#import lib/spherical_triangle
#import lib/trace
#import VISIBILITY

// Direct light that a surface point reflects: of punctual lights, area lights, sky.

// Points sampled on the area lights, and rays to the sky; 0 where the scene has none.
override AREA_SAMPLES: u32 = 1u;
override SKY_SAMPLES: u32 = 1u;
// Rays to the suns of a sky beside those above.
override SUN_SAMPLES: u32 = 1u;
// Punctual lights; `ANY_NUMBER` where the scene's parameters tell.
override LIGHTS: u32 = ANY_NUMBER;
const ANY_NUMBER = 0xffffffffu;
// Of each of the first of them four bits: its kind, and 0 to 3 for no shadow map, one, a cube or a grid of them. A driver that builds shaders
// anew for the uniforms that their branches look at would build one for every dispatch.
override LIGHT_KINDS: u32 = 0u;

// What is reflected toward the ray's origin of light from a unit direction [1/sr].
fn response(surface: Surface, incoming: vec3f) -> vec3f {
    let diffuse = surface.reflectance / PI;
    if !GLOSSY || surface.lobe == 0u {
        return diffuse;
    }
    return diffuse + lobe_value(lobe_of(surface), surface.outgoing, in_lobe_frame(surface, incoming));
}

fn in_lobe_frame(surface: Surface, direction: vec3f) -> vec3f {
    return vec3f(dot(direction, surface.tangent), dot(direction, surface.bitangent), dot(direction, surface.normal));
}

// Of a punctual light where nothing is in its way.
struct Arriving {
    // Irradiance that the surface receives; black where the light is behind it.
    irradiance: vec3f,
    // Unit vector to the light, and how far it is.
    to_light: vec3f,
    distance: f32,
}

fn arriving_from(light: SceneLight, surface: Surface) -> Arriving {
    var to_light = -light.direction;
    var distance = 4.0 * scene_parameters.extent;
    var arriving = light.intensity;
    if light.kind != 2u {
        let d = light.position - surface.position;
        distance = max(length(d), 1e-30);
        to_light = d / distance;
        arriving /= distance * distance;
    }
    if light.kind == 1u {
        let ramp = saturate((dot(-to_light, light.direction) - light.cos_outer) / max(light.cos_inner - light.cos_outer, 1e-4));
        arriving *= ramp * ramp;
    }
    arriving *= dot(surface.normal, to_light);
    let is_lit = max(arriving.x, max(arriving.y, arriving.z)) > 0.0 && dot(surface.face_normal, to_light) > 0.0;
    return Arriving(select(vec3f(0.0), arriving, is_lit), to_light, distance);
}

// How much of a punctual light arrives at a surface point: 0 or 1, by a shadow ray if it casts shadows.
fn visibility_by_ray(light: SceneLight, surface: Surface, arriving: Arriving) -> f32 {
    if light.shadow_layers == 0u {
        return 1.0;
    }
    let origin = surface.position + surface.face_normal * surface_offset(surface.position);
    return select(1.0, 0.0, trace_occluded(origin, arriving.to_light, arriving.distance * 0.9999));
}

// Light of a punctual light that is reflected; the surface's normal faces the side that is lit.
fn light_reflected(light: SceneLight, surface: Surface, seed: u32) -> vec3f {
    let arriving = arriving_from(light, surface);
    if all(arriving.irradiance == vec3f(0.0)) {
        return vec3f(0.0);
    }
    return arriving.irradiance * response(surface, arriving.to_light) * light_visibility(light, surface, arriving, seed);
}

// One of the first lights, with what the plan knows of it in place of what the scene says.
fn known(light: SceneLight, index: u32) -> SceneLight {
    var same = light;
    if LIGHTS != ANY_NUMBER {
        let bits = LIGHT_KINDS >> (4u * index);
        same.kind = bits & 3u;
        let maps = array<u32, 4>(0u, 1u, 6u, light.shadow_layers);
        same.shadow_layers = maps[(bits >> 2u) & 3u];
    }
    return same;
}

// Reflected light of all punctual lights.
fn punctual_reflected(surface: Surface, seed: u32) -> vec3f {
    let lights = select(LIGHTS, scene_parameters.lights, LIGHTS == ANY_NUMBER);
    var sum = vec3f(0.0);
    if lights > 0u {
        sum += light_reflected(known(scene_first_lights[0], 0u), surface, seed + 5u);
    }
    if lights > 1u {
        sum += light_reflected(known(scene_first_lights[1], 1u), surface, seed + 7u);
    }
    if lights > 2u {
        sum += light_reflected(known(scene_first_lights[2], 2u), surface, seed + 9u);
    }
    if lights > 3u {
        sum += light_reflected(known(scene_first_lights[3], 3u), surface, seed + 11u);
    }
    for (var i = FIRST_LIGHTS; i < lights; i++) {
        sum += light_reflected(scene_light(i), surface, seed + 5u + 2u * i);
    }
    return sum;
}

// A lamp that was chosen.
struct Lamp {
    triangle: u32,
    // What a point spread evenly over its area stands for: its power over the probability of the choice, or 0 where no lamp can matter.
    weight: f32,
    // Its area times the luminance of its mean emission.
    power: f32,
}

const IS_LAMP = 0x80000000u;
const BOTH_SIDES = 0x40000000u;
// Of an importance: eight of them have a sum.
const MOST_IMPORTANCE = 1e37;

// The cosine of an angle, less another one, but not below 0.
fn lessened(cosine: f32, by_cosine: f32, by_sine: f32) -> f32 {
    return select(cosine * by_cosine + sqrt(max(1.0 - cosine * cosine, 0.0)) * by_sine, 1.0, cosine >= by_cosine);
}

// At least in proportion to what a surface may receive of some lamps, were nothing between: as scene::emitters::tree.
fn importance(lamps: SceneLamps, origin: vec3f, normal: vec3f) -> f32 {
    let way = lamps.centre - origin;
    let radius = lamps.radius;
    let squared = dot(way, way);
    if squared <= radius {
        return min(lamps.power / max(radius, 1e-30), MOST_IMPORTANCE);
    }
    let direction = way / sqrt(squared);
    let seen = radius / squared;
    let by = vec2f(sqrt(max(1.0 - seen, 0.0)), sqrt(seen));
    let arriving = lessened(dot(normal, direction), by.x, by.y);
    var cosine = -dot(lamps.axis, direction);
    if (lamps.next & BOTH_SIDES) != 0u {
        cosine = abs(cosine);
    }
    let leaving = lessened(lessened(cosine, lamps.spread, sqrt(max(1.0 - lamps.spread * lamps.spread, 0.0))), by.x, by.y);
    return min(lamps.power / squared, MOST_IMPORTANCE) * max(arriving, 0.0) * max(leaving, 0.0);
}

// The lamp at `at` of 0..1 as a surface has them: down the tree, each time to the group that holds it.
fn choose_lamp(at: f32, origin: vec3f, normal: vec3f) -> Lamp {
    var lamps = scene_lamps(0u);
    var begin = 0.0;
    var width = 1.0;
    var probability = 1.0;
    while (lamps.next & IS_LAMP) == 0u {
        let first = lamps.next & ~BOTH_SIDES;
        let count = lamps.count;
        var importances: array<f32, 8>;
        var all = 0.0;
        for (var group = 0u; group < count; group++) {
            importances[group] = importance(scene_lamps(first + group), origin, normal);
            all += importances[group];
        }
        if all <= 0.0 {
            return Lamp(0u, 0.0, 0.0);
        }
        var below = 0.0;
        var found = count;
        for (var group = 0u; group < count; group++) {
            let share = importances[group] / all;
            let end = begin + width * (below + share);
            if share > 0.0 && at < end {
                begin += width * below;
                width = end - begin;
                probability *= share;
                found = group;
                break;
            }
            below += share;
        }
        if found == count {
            return Lamp(0u, 0.0, 0.0);
        }
        lamps = scene_lamps(first + found);
    }
    return Lamp(lamps.next & ~(IS_LAMP | BOTH_SIDES), lamps.power / probability, lamps.power);
}

// Whether a lamp, from its corner on as it is seen, is so near that its points differ much in what they stand for: no farther than its longest edge is long.
fn is_lamp_near(corner: vec3f, e1: vec3f, e2: vec3f) -> bool {
    let middle = corner + (e1 + e2) / 3.0;
    let longest = max(dot(e1, e1), max(dot(e2, e2), dot(e2 - e1, e2 - e1)));
    return dot(middle, middle) < longest;
}

// Reflected light of emissive triangles: points of lamps that are chosen by how they matter, in `AREA_SAMPLES` strata; the point within the triangle by a
// rank-1 lattice, shifted by `seed`.
fn area_reflected(surface: Surface, seed: u32) -> vec3f {
    if AREA_SAMPLES == 0u || (LIGHTS == ANY_NUMBER && scene_parameters.emitters == 0u) {
        return vec3f(0.0);
    }
    let origin = surface.position + surface.face_normal * surface_offset(surface.position);
    let shift = vec3f(unit(hash(seed)), unit(hash(seed + 1u)), unit(hash(seed + 2u)));
    var sum = vec3f(0.0);
    for (var i = 0u; i < AREA_SAMPLES; i++) {
        let index = f32(i);
        let lamp = choose_lamp((index + shift.x) / f32(max(AREA_SAMPLES, 1u)), origin, surface.normal);
        if lamp.weight <= 0.0 {
            continue;
        }
        let triangle = lamp.triangle;
        let u = fract(vec2f(0.7548776662, 0.5698402910) * index + shift.yz);
        let root = sqrt(u.x);
        let b = vec2f(root * (1.0 - u.y), root * u.y);
        let e1 = scene_corners[3u * triangle + 1u].xyz;
        let e2 = scene_corners[3u * triangle + 2u].xyz;
        let corner = scene_corners[3u * triangle].xyz - origin;
        let material = scene_material(material_of(triangle));
        var d = corner + e1 * b.x + e2 * b.y;
        let plane = cross(e1, e2);
        let is_near = is_lamp_near(corner, e1, e2);
        var seen: SphericalTriangle;
        if is_near {
            seen = spherical_triangle(corner, corner + e1, corner + e2);
            if seen.solid_angle > 0.0 {
                let direction = sample_spherical_triangle(seen, u);
                d = direction * (dot(corner, plane) / dot(direction, plane));
            }
        }
        let squared = max(dot(d, d), 1e-30);
        let to_light = d * inverseSqrt(squared);
        var leaving = -dot(plane, to_light) / max(length(plane), 1e-37);
        if (material.flags & TWO_SIDED) != 0u {
            leaving = abs(leaving);
        }
        let arriving = dot(surface.normal, to_light);
        if leaving > 0.0 && arriving > 0.0 && dot(surface.face_normal, to_light) > 0.0 && !trace_occluded(origin, d, 0.9999) {
            // What a point of the lamp stands for: its area as it is seen, or an equal share of the solid angle of all.
            let by_area = leaving / squared;
            let by_angle = seen.solid_angle / max(0.5 * length(plane), 1e-37);
            let share = select(by_area, by_angle, seen.solid_angle > 0.0);
            var hue = material.emission / max(luminance(material.emission), 1e-37);
            if TEXTURES && material.maps != 0u {
                let there = intersect_plane(triangle, origin, d).barycentric;
                hue = emission_at(material, triangle, there) * (0.5 * length(plane) / max(lamp.power, 1e-37));
            }
            sum += response(surface, to_light) * hue * (arriving * share * lamp.weight);
        }
    }
    return sum / f32(max(AREA_SAMPLES, 1u));
}

fn is_sky_black() -> bool {
    return all(textureDimensions(scene_environment) == vec2u(1u)) && all(environment_texel(0, 0).rgb == vec3f(0.0));
}

// The sky in a direction: as scene::sky.
struct InSky {
    // Radiance of the broad sky and of suns.
    broad: vec3f,
    suns: vec3f,
    // With which rays are sent to suns there [1/sr].
    density: f32,
}

fn no_suns() -> bool {
    return SUN_SAMPLES == 0u || (LIGHTS == ANY_NUMBER && scene_parameters.sun_weight == 0.0);
}

// Solid angle of a texel over that of one at the horizon.
fn row_sine(row: i32) -> f32 {
    return sin((f32(row) + 0.5) / f32(scene_parameters.environment_size.y) * PI);
}

fn in_sky(direction: vec3f) -> InSky {
    if no_suns() {
        return InSky(environment_radiance(direction), vec3f(0.0), 0.0);
    }
    let at = in_environment(direction);
    var seen: InSky;
    for (var row = 0; row < 2; row++) {
        for (var column = 0; column < 2; column++) {
            let texel = environment_texel(at.columns[column], at.rows[row]).rgb;
            let share = select(1.0 - at.share.x, at.share.x, column == 1) * select(1.0 - at.share.y, at.share.y, row == 1);
            let brightness = luminance(texel);
            let above = max(brightness - scene_parameters.sky_limit, 0.0);
            // Of the whole the share below the limit: the difference would cancel out.
            let below = select(1.0, scene_parameters.sky_limit / max(brightness, 1e-37), above > 0.0);
            seen.suns += texel * ((1.0 - below) * share);
            seen.broad += texel * (below * share);
            seen.density += share * above * row_sine(at.rows[row]);
        }
    }
    let size = vec2f(scene_parameters.environment_size);
    seen.density *= size.x * size.y / (scene_parameters.sun_weight * (2.0 * PI * PI) * max(length(direction.xz), 1e-6));
    return seen;
}

// A direction of suns: by a number of 0..1 that chooses the texel, and two for the place within the tent that spreads it.
fn sample_suns(chosen: f32, place: vec2f) -> vec3f {
    let size = scene_parameters.environment_size;
    let at = chosen * scene_parameters.sun_weight;
    var low = 0u;
    var high = size.x * size.y - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if environment_texel(i32(middle % size.x), i32(middle / size.x)).w > at {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return within_texel(low, place);
}

// The mean radiance of the broad sky, by cosine-distributed rays in strata of the azimuth, and the standard error of its luminance.
fn broad_sky(surface: Surface, seed: u32) -> vec4f {
    let origin = surface.position + surface.face_normal * surface_offset(surface.position);
    let frame = frame_around(surface.normal, 0.0);
    let shift = vec2f(unit(hash(seed + 3u)), unit(hash(seed + 4u)));
    var sum = vec4f(0.0);
    for (var i = 0u; i < SKY_SAMPLES; i++) {
        let direction = frame * around(sqrt(1.0 - fract(0.6180339887 * f32(i) + shift.y)), 2.0 * PI * (f32(i) + shift.x) / f32(max(SKY_SAMPLES, 1u)));
        if dot(direction, surface.face_normal) > 0.0 && !trace_occluded(origin, direction, FAR_AWAY) {
            let broad = in_sky(direction).broad;
            let bright = luminance(broad);
            sum += vec4f(broad, bright * bright);
        }
    }
    let mean = sum / f32(max(SKY_SAMPLES, 1u));
    let bright = luminance(mean.rgb);
    return vec4f(mean.rgb, sqrt(max(mean.a - bright * bright, 0.0) / f32(max(SKY_SAMPLES, 1u))));
}

// Light of the sky that the lobe reflects: as many rays, distributed as the lobe is; of suns the share that rays to them leave.
fn sky_glossed(surface: Surface, seed: u32) -> vec3f {
    let origin = surface.position + surface.face_normal * surface_offset(surface.position);
    let lobe = lobe_of(surface);
    let shift = vec2f(unit(hash(seed + 13u)), unit(hash(seed + 14u)));
    var sum = vec3f(0.0);
    for (var i = 0u; i < SKY_SAMPLES; i++) {
        let u = vec2f(fract(0.6180339887 * f32(i) + shift.y), (f32(i) + shift.x) / f32(max(SKY_SAMPLES, 1u)));
        let incoming = lobe_sample(lobe, surface.outgoing, u);
        let density = lobe_density(lobe, surface.outgoing, incoming);
        let direction = surface.tangent * incoming.x + surface.bitangent * incoming.y + surface.normal * incoming.z;
        if incoming.z > 0.0 && density > 0.0 && dot(direction, surface.face_normal) > 0.0 && !trace_occluded(origin, direction, FAR_AWAY) {
            let seen = in_sky(direction);
            let share = f32(SKY_SAMPLES) * density / (f32(SKY_SAMPLES) * density + f32(SUN_SAMPLES) * seen.density);
            sum += (seen.broad + seen.suns * share) * lobe_value(lobe, surface.outgoing, incoming) * (incoming.z / density);
        }
    }
    return sum / f32(max(SKY_SAMPLES, 1u));
}

// Of suns: what the diffuse part reflects, and of the lobe the share that is not left to its own rays.
fn suns_reflected(surface: Surface, seed: u32) -> vec3f {
    let origin = surface.position + surface.face_normal * surface_offset(surface.position);
    let shift = vec3f(unit(hash(seed + 15u)), unit(hash(seed + 16u)), unit(hash(seed + 17u)));
    var sum = vec3f(0.0);
    for (var i = 0u; i < SUN_SAMPLES; i++) {
        let direction = sample_suns((f32(i) + shift.x) / f32(max(SUN_SAMPLES, 1u)), fract(vec2f(0.7548776662, 0.5698402910) * f32(i) + shift.yz));
        let cosine = dot(surface.normal, direction);
        if cosine <= 0.0 || dot(direction, surface.face_normal) <= 0.0 || trace_occluded(origin, direction, FAR_AWAY) {
            continue;
        }
        let seen = in_sky(direction);
        let density = f32(SUN_SAMPLES) * seen.density;
        if density > 0.0 {
            var reflected = surface.reflectance / (PI * density);
            if GLOSSY && surface.lobe != 0u {
                let incoming = in_lobe_frame(surface, direction);
                let lobe = lobe_of(surface);
                reflected += lobe_value(lobe, surface.outgoing, incoming) / (density + f32(SKY_SAMPLES) * lobe_density(lobe, surface.outgoing, incoming));
            }
            sum += seen.suns * reflected * cosine;
        }
    }
    return sum;
}

fn sky_reflected(surface: Surface, seed: u32) -> vec3f {
    if SKY_SAMPLES == 0u || (LIGHTS == ANY_NUMBER && is_sky_black()) {
        return vec3f(0.0);
    }
    return broad_sky(surface, seed).rgb * surface.reflectance + sky_but_broad(surface, seed);
}

// Of the sky, all but what the diffuse part reflects of what is broad.
fn sky_but_broad(surface: Surface, seed: u32) -> vec3f {
    if SKY_SAMPLES == 0u || (LIGHTS == ANY_NUMBER && is_sky_black()) {
        return vec3f(0.0);
    }
    var sum = vec3f(0.0);
    if GLOSSY && surface.lobe != 0u {
        sum += sky_glossed(surface, seed);
    }
    if !no_suns() {
        sum += suns_reflected(surface, seed);
    }
    return sum;
}

// Light of whatever emits that the surface reflects toward the ray's origin, without having touched another surface.
fn direct_reflected(surface: Surface, seed: u32) -> vec3f {
    return punctual_reflected(surface, seed) + area_reflected(surface, seed) + sky_reflected(surface, seed);
}
