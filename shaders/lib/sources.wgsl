#import lib/lobe
#import lib/random
#import lib/scene

// Light as it leaves its sources, in photons: as scene::sources.

// A head; each source; then of each of the sky's texels where its share ends.
@group(0) @binding(24) var<storage, read> sources: array<vec4u>;

const LIGHT = 0u;
const EMITTER = 1u;
const DOME = 2u;
const SKY = 3u;

// Light's kinds, as LightKind::number tells them.
const POINT_LIGHT = 0u;
const SPOT_LIGHT = 1u;

// Shares of a whole are words of 32 bits.
const WHOLE = 4294967296.0;

struct Source {
    kind: u32,
    // Of the light, or the emissive triangle.
    index: u32,
    // Where its share of the flux ends.
    end: u32,
    // One over that share.
    inverse_share: f32,
}

struct Emitted {
    origin: vec3f,
    direction: vec3f,
    // All of the light, were this the only photon.
    flux: vec3f,
    is_there: bool,
}

fn source_count() -> u32 {
    return sources[0].x;
}

fn source_at(number: u32) -> Source {
    let words = sources[1u + number];
    return Source(words.x, words.y, words.z, bitcast<f32>(words.w));
}

// Where the share of a texel of the sky ends, or that of the one before it.
fn texel_end(texel: u32) -> u32 {
    let word = 4u * (1u + source_count()) + texel;
    return sources[word / 4u][word % 4u];
}

fn texel_begin(texel: u32) -> u32 {
    if texel == 0u {
        return 0u;
    }
    return texel_end(texel - 1u);
}

// In 0..1, for where a photon is along a side of the lattice.
fn side(place: u32) -> f32 {
    return min(f32(place) / WHOLE, 0.99999994);
}

fn lattice_place(number: u32, step: u32) -> u32 {
    return step * (number + 1u) + 0x80000000u;
}

// Where a photon starts: which source, then two numbers for where and two for which way it goes.
struct Start {
    source: u32,
    first: vec2u,
    second: vec2u,
}

fn start_of(number: u32) -> Start {
    return Start(
        lattice_place(number, 3785032107u),
        vec2u(lattice_place(number, 3335640777u), lattice_place(number, 2939605023u)),
        vec2u(lattice_place(number, 2590590015u), lattice_place(number, 2283013049u)),
    );
}

fn emitted(start: Start) -> Emitted {
    let chosen = start.source;
    let u = start.first.x;
    let first = vec2f(side(u), side(start.first.y));
    let second = vec2f(side(start.second.x), side(start.second.y));
    if source_count() == 0u {
        return Emitted(vec3f(0.0), vec3f(0.0), vec3f(0.0), false);
    }
    // The first whose share ends behind the place.
    var low = 0u;
    var high = source_count() - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if source_at(middle).end <= chosen {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    let found = source_at(low);
    var photon: Emitted;
    switch found.kind {
        case LIGHT: {
            photon = leaving_light(scene_light(found.index), first);
        }
        case EMITTER: {
            photon = leaving_emitter(found.index, first, second);
        }
        case DOME: {
            photon = coming_from_afar(around(1.0 - 2.0 * first.x, 2.0 * PI * first.y), second);
            photon.flux = scene_parameters.environment * (4.0 * PI * disc_area());
        }
        default: {
            photon = leaving_sky(u, first.y, second);
        }
    }
    photon.flux *= found.inverse_share;
    return photon;
}

// Of the sphere that light from far away has to cross.
fn scene_radius() -> f32 {
    return 0.5 * scene_parameters.extent;
}

fn disc_area() -> f32 {
    return PI * scene_radius() * scene_radius();
}

// From far away along a unit direction, on a disc before the scene; without flux.
fn coming_from_afar(direction: vec3f, at: vec2f) -> Emitted {
    let frame = frame_around(direction, 0.0);
    let aside = scene_radius() * sqrt(at.x) * (frame[0] * cos(2.0 * PI * at.y) + frame[1] * sin(2.0 * PI * at.y));
    return Emitted(scene_parameters.centre + aside - direction * (1.01 * scene_radius()), direction, vec3f(0.0), true);
}

fn leaving_light(light: SceneLight, at: vec2f) -> Emitted {
    if light.kind == POINT_LIGHT {
        return Emitted(light.position, around(1.0 - 2.0 * at.x, 2.0 * PI * at.y), light.intensity * (4.0 * PI), true);
    }
    if light.kind == SPOT_LIGHT {
        let full = 2.0 * PI * (1.0 - light.cos_inner);
        let ramp = 2.0 * PI * max(light.cos_inner - light.cos_outer, 0.0) / 3.0;
        let chosen = at.x * (full + ramp);
        var cosine = 1.0 - chosen / max(full, 1e-37) * (1.0 - light.cos_inner);
        if chosen >= full {
            // The square of a ramp in the cosine has the third root as the inverse of its sum.
            let share = saturate((chosen - full) / max(ramp, 1e-37));
            cosine = light.cos_outer + (light.cos_inner - light.cos_outer) * pow(max(share, 1e-37), 1.0 / 3.0);
        }
        let direction = frame_around(light.direction, 0.0) * around(cosine, 2.0 * PI * at.y);
        return Emitted(light.position, direction, light.intensity * (full + ramp), true);
    }
    var photon = coming_from_afar(light.direction, at);
    photon.flux = light.intensity * disc_area();
    return photon;
}

// From a triangle, in proportion to the cosine.
fn leaving_emitter(triangle: u32, place: vec2f, way: vec2f) -> Emitted {
    let corner = scene_corners[3u * triangle];
    let e1 = scene_corners[3u * triangle + 1u].xyz;
    let e2 = scene_corners[3u * triangle + 2u].xyz;
    let material = scene_material(bitcast<u32>(corner.w));
    let plane = cross(e1, e2);
    let root = sqrt(place.x);
    let barycentric = vec2f(root * (1.0 - place.y), root * place.y);
    // Light of both sides: the first half of the numbers goes to the front.
    let has_back = (material.flags & TWO_SIDED) != 0u;
    let sign = select(1.0, -1.0, has_back && way.x >= 0.5);
    let s = select(way.x, fract(2.0 * way.x), has_back);
    let normal = plane * (sign / max(length(plane), 1e-37));
    let position = corner.xyz + e1 * barycentric.x + e2 * barycentric.y;
    let flux = emission_at(material, triangle, barycentric) * (0.5 * length(plane) * PI * select(1.0, 2.0, has_back));
    let direction = frame_around(normal, 0.0) * around(sqrt(1.0 - s), 2.0 * PI * way.y);
    let is_there = length(plane) > 0.0 && !(ALPHA_MASKS && is_hole(triangle, barycentric));
    return Emitted(position + normal * surface_offset(position), direction, flux, is_there);
}

// From a sky of texels, chosen by luminance and solid angle.
fn leaving_sky(chosen: u32, beside: f32, at: vec2f) -> Emitted {
    let size = scene_parameters.environment_size;
    var low = 0u;
    var high = size.x * size.y - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if texel_end(middle) <= chosen {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    let begin = texel_begin(low);
    let rest = saturate((f32(chosen - begin) + 0.5) / max(f32(texel_end(low) - begin), 1.0));
    let origin = normalize(within_texel(low, vec2f(rest, beside)));
    var photon = coming_from_afar(-origin, at);
    photon.flux = environment_radiance(origin) * (disc_area() / max(sky_density(origin), 1e-37));
    return photon;
}

fn texel_weight(column: i32, row: i32) -> f32 {
    let texel = u32(row) * scene_parameters.environment_size.x + u32(column);
    return f32(texel_end(texel) - texel_begin(texel)) / WHOLE;
}

// Over solid angle [1/sr]: as Sky::density.
fn sky_density(direction: vec3f) -> f32 {
    let size = vec2f(scene_parameters.environment_size);
    let at = in_environment(direction);
    let upper = mix(texel_weight(at.columns.x, at.rows.x), texel_weight(at.columns.y, at.rows.x), at.share.x);
    let lower = mix(texel_weight(at.columns.x, at.rows.y), texel_weight(at.columns.y, at.rows.y), at.share.x);
    let polar = acos(clamp(direction.y, -1.0, 1.0));
    return mix(upper, lower, at.share.y) * size.x * size.y / (2.0 * PI * PI * max(sin(polar), 1e-37));
}
