#import lib/colour
#import lib/scene
#import lib/frame
#import lib/record
#import lib/tile

// What a tile adds up to, as seven vectors in the record's frame: irradiance with Σ w/d; rotation gradients of red and
// green; of blue with Σ w and 1/nearest; translation gradients of red, green and blue with xx, xy and yy of the
// luminance's second derivatives, 0 where the validity radius does not follow the curvature; squares of the mixed differences of
// blocks of four samples, times their weights. math::sum is the twin.

const PARTS = 7u;

// What the validity radius is in proportion to: 0 the harmonic mean distance, 1 the curvature.
override RADIUS: u32 = 0u;
// Whether gradients are wanted.
override GRADIENTS: bool = true;
// How many times as much all samples stand for as the blocks' last ones do, in squares of weights.
override BLOCK_SHARE: f32 = 1.0;

// A tile in an image that holds averages of its texels.
override LEVEL_WIDTH: u32 = 1u;
override LEVEL_HEIGHT: u32 = 1u;

fn level_corner(tile: u32) -> vec2u {
    return vec2u((tile % TILES_PER_ROW) * LEVEL_WIDTH, (tile / TILES_PER_ROW) * LEVEL_HEIGHT);
}

struct Sums {
    parts: array<vec4f, 7>,
}

// What distances count as at least, so that contact does not make their inverses infinite.
fn least_distance(request: Request) -> f32 {
    return max(surface_offset(request.position), 1e-30);
}

// Adds a sample to the first three parts: its cosine weight, its turn of the normal, radiance and inverse distance.
fn add_sample(sums: ptr<function, Sums>, cosine_weight: f32, turn: vec2f, seen: vec3f, inverse: f32) {
    (*sums).parts[0] += vec4f(seen, inverse) * cosine_weight;
    (*sums).parts[1] += vec4f(turn * seen.r, turn * seen.g);
    let blue = (*sums).parts[2];
    (*sums).parts[2] = vec4f(blue.xy + turn * seen.b, blue.z + cosine_weight, max(blue.w, inverse));
}

// Adds a block of four samples that has a weight: the radiance of the corner, of those beside it, and of the last one.
fn add_block(sums: ptr<function, Sums>, weight: f32, corner: vec3f, above: vec3f, before: vec3f, last: vec3f) {
    let mixed = ((corner - above) - (before - last)) * weight;
    (*sums).parts[6] += vec4f(mixed * mixed, 0.0);
}

// Adds the wall between two samples to three parts; `a` and `b` are radiance and inverse depth.
fn add_wall(sums: ptr<function, Sums>, gradient: vec3f, hessian: vec3f, a: vec4f, b: vec4f) {
    let inverse = max(a.w, b.w);
    let step = (b.rgb - a.rgb) * inverse;
    var bend = vec3f(0.0);
    if RADIUS == 1u {
        bend = hessian * (luminance(step) * inverse);
    }
    (*sums).parts[3] += vec4f(gradient * step.r, bend.x);
    (*sums).parts[4] += vec4f(gradient * step.g, bend.y);
    (*sums).parts[5] += vec4f(gradient * step.b, bend.z);
}

// Two sums of one part: the third part's last component is a maximum.
fn joined(part: u32, a: vec4f, b: vec4f) -> vec4f {
    return vec4f(a.xyz + b.xyz, select(a.w + b.w, max(a.w, b.w), part == 2u));
}

struct Ellipse {
    radius: f32,
    // In the record's frame.
    stretch: vec2f,
}

// Where the curvature has changed the irradiance by all of itself, math::radius has the derivation.
fn ellipse_of_curvature(irradiance: f32, hessian: vec3f) -> Ellipse {
    let mean = (hessian.x + hessian.z) * 0.5;
    let half = vec2f((hessian.x - hessian.z) * 0.5, hessian.y);
    let spread = length(half);
    let strongest = abs(mean) + spread;
    let weakest = max(abs(abs(mean) - spread), strongest * 0.25);
    let radius = sqrt(2.0 * irradiance / max(strongest, 1e-30));
    // Twice the angle of the eigenvector that belongs to the weaker curvature.
    let doubled = select(half, -half, mean >= 0.0) / max(spread, 1e-30);
    let axis = vec2f(sqrt(max(0.5 + 0.5 * doubled.x, 0.0)), sqrt(max(0.5 - 0.5 * doubled.x, 0.0)) * select(-1.0, 1.0, doubled.y >= 0.0));
    return Ellipse(min(radius, 1e30), axis * sqrt(max(1.0 - weakest / max(strongest, 1e-30), 0.0)));
}

// Of the luminance along the surface.
fn relative_gradient(sums: Sums) -> f32 {
    let change = vec2f(
        luminance(vec3f(sums.parts[3].x, sums.parts[4].x, sums.parts[5].x)),
        luminance(vec3f(sums.parts[3].y, sums.parts[4].y, sums.parts[5].y)),
    );
    return min(length(change) / max(luminance(sums.parts[0].rgb), 1e-30), 1e30);
}

fn record_of(request: Request, sums: Sums) -> Record {
    let frame = frame_around(request.normal, request.turn);
    var record: Record;
    record.position = request.position;
    record.normal = request.normal;
    record.footprint = request.footprint;
    record.irradiance = sums.parts[0].rgb;
    record.radius = sums.parts[2].z / max(sums.parts[0].w, 1e-30);
    record.minimum_distance = 1.0 / max(sums.parts[2].w, 1e-30);
    record.translation[1].w = 1.0;
    if GRADIENTS {
        record.rotation[0] = vec4f(frame * vec3f(sums.parts[1].xy, 0.0), 0.0);
        record.rotation[1] = vec4f(frame * vec3f(sums.parts[1].zw, 0.0), 0.0);
        record.rotation[2] = vec4f(frame * vec3f(sums.parts[2].xy, 0.0), 0.0);
        record.translation[0] = vec4f(frame * sums.parts[3].xyz, relative_gradient(sums));
        record.translation[1] = vec4f(frame * sums.parts[4].xyz, 1.0);
        record.translation[2] = vec4f(frame * sums.parts[5].xyz, 0.0);
        if RADIUS == 1u {
            let ellipse = ellipse_of_curvature(luminance(record.irradiance), vec3f(sums.parts[3].w, sums.parts[4].w, sums.parts[5].w));
            record.radius = ellipse.radius;
            set_stretch(&record, frame * vec3f(ellipse.stretch, 0.0));
        }
    }
    record.translation[2].w = request.confinement;
    record.error = sqrt(sums.parts[6].rgb * (0.25 * BLOCK_SHARE));
    if request.stretch > 0.0 {
        set_stretch(&record, frame[0] * request.stretch);
    }
    return record;
}

fn set_stretch(record: ptr<function, Record>, stretch: vec3f) {
    (*record).rotation[0].w = stretch.x;
    (*record).rotation[1].w = stretch.y;
    (*record).rotation[2].w = stretch.z;
}
