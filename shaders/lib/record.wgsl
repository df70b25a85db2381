#import lib/colour

// Records and requests: passes/record.rs has the same structs, math::weight the same arithmetic.

// What extrapolation may make of a record's irradiance: math::weight::EXTRAPOLATION.
const LEAST_FALL = 0.4;
const MOST_RISE = 1.5;

struct Record {
    position: vec3f,
    // Harmonic mean distance of what the hemisphere sees; a huge number under open sky.
    radius: f32,
    normal: vec3f,
    // Distance of the nearest thing seen.
    minimum_distance: f32,
    irradiance: vec3f,
    // Width of the pixel that asked for the record.
    footprint: f32,
    // Gradients of red, green and blue. The rotation's fourth components are the stretch: along the axis of the longest
    // reach, sqrt(1 - (R0 / R1)²) long.
    rotation: array<vec4f, 3>,
    // The first one's fourth component is the luminance's relative gradient along the surface, |∇E| / E, the second one's the
    // share of the least spacing that holds for this record, in (0, 1], the third one's the share that it reaches of the way to what stands on its surface.
    translation: array<vec4f, 3>,
    // Standard error of the irradiance, as far as its samples tell it.
    error: vec3f,
    padding: u32,
}

struct Request {
    position: vec3f,
    footprint: f32,
    normal: vec3f,
    // Turn of the frame around the normal [radians].
    turn: f32,
    // How much farther its record reaches along the frame's first axis, sqrt(1 - (R0 / R1)²); 0 where the light alone says so.
    stretch: f32,
    // The share that it reaches of the way to what stands on its surface; 0 where that is not known.
    confinement: f32,
    // Unit normal of the surface's plane, in signed 16 bits a component; 0 where that of the shading stands for it.
    face: vec2u,
}

// Whether a direction lies below a place's plane, where no light comes from.
fn is_below(request: Request, direction: vec3f) -> bool {
    let face = vec3f(unpack2x16snorm(request.face.x), unpack2x16snorm(request.face.y).x);
    return any(request.face != vec2u(0u)) && dot(face, direction) <= 0.0;
}

struct Weighting {
    // The accuracy a: a record reaches a · R.
    accuracy: f32,
    // Limits of the validity radius in widths of the pixel.
    minimum_spacing: f32,
    maximum_spacing: f32,
    // 0 Ward, 1 Tabellion and Lamorlette, 2 compact.
    kind: u32,
    // Most of the validity radius in distances of the nearest thing seen.
    nearest: f32,
    // Most of the validity radius in lengths over which the irradiance changes by all of itself.
    change: f32,
    // A point whose weights add up to this or less misses a record.
    overlap: f32,
    // Most change within the least validity radius, as a share of the picture's irradiance, and how small that validity radius may become for it
    // [widths of the pixel].
    contrast: f32,
    finest_spacing: f32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
}

// Items of a list that a step works on.
struct Stretch {
    first: u32,
    count: u32,
    padding_a: u32,
    padding_b: u32,
}

// The largest power of two that is no more than a value, within what products of two of them can hold.
fn binade(value: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(clamp(value, 1e-15, 1e15)) & 0x7f800000u);
}

// What half floats of a record's expansions and of their derivatives count in: no brightness and no unit of length leaves their
// range so. math::weight has the same.
fn half_units(record: Record) -> vec2f {
    let light = max(record.irradiance.r, max(record.irradiance.g, record.irradiance.b));
    let unit = binade(light);
    return vec2f(unit, unit * binade(record.translation[0].w));
}

// How far a record's gradient may be followed: not to the corner of the nearest surface, nor until all has changed.
fn gradient_radius(record: Record, weighting: Weighting) -> f32 {
    return min(weighting.nearest * record.minimum_distance, weighting.change / max(record.translation[0].w, 1e-30));
}

// How far a record reaches along its shorter axis [scene units], within the limits in pixels.
fn validity_radius(record: Record, weighting: Weighting) -> f32 {
    let distance = select(record.radius, record.minimum_distance, weighting.kind == 1u);
    let free = min(weighting.accuracy * distance, gradient_radius(record, weighting));
    return clamp(free, weighting.minimum_spacing * record.translation[1].w * record.footprint, weighting.maximum_spacing * record.footprint);
}

// Share of the least spacing within which a record foretells no more change than is allowed around `level`, the picture's luminance.
fn fineness(record: Record, weighting: Weighting, level: f32) -> f32 {
    let step = weighting.minimum_spacing * record.footprint;
    let change = min(record.translation[0].w * step, MOST_RISE) * luminance(record.irradiance);
    let allowed = weighting.contrast * level;
    if !(change > allowed) {
        return 1.0;
    }
    return clamp(allowed / change, min(weighting.finest_spacing / weighting.minimum_spacing, 1.0), 1.0);
}

fn stretch_of(record: Record) -> vec3f {
    return vec3f(record.rotation[0].w, record.rotation[1].w, record.rotation[2].w);
}

// How far a record reaches along its longer axis [scene units].
fn longest_validity_radius(record: Record, weighting: Weighting) -> f32 {
    let stretch = stretch_of(record);
    return validity_radius(record, weighting) / sqrt(max(1.0 - dot(stretch, stretch), 0.01));
}

// Weight of a record at a point; 0 where it does not count.
fn record_weight(record: Record, weighting: Weighting, position: vec3f, normal: vec3f) -> f32 {
    let radius = max(validity_radius(record, weighting), 1e-30);
    let d = position - record.position;
    let along = dot(d, stretch_of(record));
    let apart = sqrt(max(dot(d, d) - along * along, 0.0)) / radius;
    if apart > 1.0 {
        return 0.0;
    }
    // sqrt(1 − n·n_k), without its cancellation.
    let turned = length(normal - record.normal) * 0.70710678;
    // In front of the point: what the record saw is behind the point's surroundings.
    if dot(d, normal + record.normal) * 0.5 < -0.05 * length(d) {
        return 0.0;
    }
    switch weighting.kind {
        case 0u: {
            let error = apart * weighting.accuracy + turned;
            return select(0.0, 1.0 / max(error, 1e-3), error <= weighting.accuracy);
        }
        case 1u: {
            return max(1.0 - max(apart, turned / 0.12326), 0.0);
        }
        default: {
            return max(1.0 - apart - turned / weighting.accuracy, 0.0);
        }
    }
}

// Irradiance that a record foretells at a point (RCS 8), within limits of its own.
fn record_estimate(record: Record, weighting: Weighting, position: vec3f, normal: vec3f) -> vec3f {
    let turn = cross(record.normal, normal);
    // A record that has to reach farther foretells at its rim what it would have where its gradient ends.
    let share = min(gradient_radius(record, weighting) / max(validity_radius(record, weighting), 1e-30), 1.0);
    let move_by = (position - record.position) * share;
    let change = vec3f(
        dot(turn, record.rotation[0].xyz) + dot(move_by, record.translation[0].xyz),
        dot(turn, record.rotation[1].xyz) + dot(move_by, record.translation[1].xyz),
        dot(turn, record.rotation[2].xyz) + dot(move_by, record.translation[2].xyz),
    );
    return clamp(record.irradiance + change, record.irradiance * LEAST_FALL, record.irradiance * (1.0 + MOST_RISE));
}
