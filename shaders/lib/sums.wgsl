#import lib/scene
#import lib/frame
#import lib/record
#import lib/tile

// What a tile adds up to, as six vectors in the record's frame: irradiance with Σ w/d; rotation gradients of red and
// green; of blue with Σ w and 1/nearest; translation gradients of red, green and blue. math::sum is the twin.

const PARTS = 6u;

// Whether gradients are wanted.
override GRADIENTS: bool = true;

// A tile in an image that holds averages of its texels.
override LEVEL_WIDTH: u32 = 1u;
override LEVEL_HEIGHT: u32 = 1u;

fn level_corner(tile: u32) -> vec2u {
    return vec2u((tile % TILES_PER_ROW) * LEVEL_WIDTH, (tile / TILES_PER_ROW) * LEVEL_HEIGHT);
}

struct Sums {
    parts: array<vec4f, 6>,
}

// 1 over a distance, which contact does not make infinite.
fn inverse_distance(request: Request, distance: f32) -> f32 {
    return 1.0 / max(distance, max(surface_offset(request.position), 1e-30));
}

// Adds a sample to the first three parts.
fn add_sample(sums: ptr<function, Sums>, weight: TileSample, seen: vec4f, inverse: f32) {
    let turn = vec2f(weight.rotation_x, weight.rotation_y);
    (*sums).parts[0] += vec4f(seen.rgb, inverse) * weight.cosine_weight;
    (*sums).parts[1] += vec4f(turn * seen.r, turn * seen.g);
    let blue = (*sums).parts[2];
    (*sums).parts[2] = vec4f(blue.xy + turn * seen.b, blue.z + weight.cosine_weight, max(blue.w, inverse));
}

// Adds the wall between two samples to the last three parts; their inverse depths are given.
fn add_edge(sums: ptr<function, Sums>, edge: TileEdge, a: vec3f, b: vec3f, inverse_a: f32, inverse_b: f32) {
    let step = (b - a) * max(inverse_a, inverse_b);
    let gradient = vec4f(edge.gradient, 0.0);
    (*sums).parts[3] += gradient * step.r;
    (*sums).parts[4] += gradient * step.g;
    (*sums).parts[5] += gradient * step.b;
}

// Two sums of one part: the third part's last component is a maximum.
fn joined(part: u32, a: vec4f, b: vec4f) -> vec4f {
    return vec4f(a.xyz + b.xyz, select(a.w + b.w, max(a.w, b.w), part == 2u));
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
    if GRADIENTS {
        record.rotation[0] = vec4f(frame * vec3f(sums.parts[1].xy, 0.0), 0.0);
        record.rotation[1] = vec4f(frame * vec3f(sums.parts[1].zw, 0.0), 0.0);
        record.rotation[2] = vec4f(frame * vec3f(sums.parts[2].xy, 0.0), 0.0);
        record.translation[0] = vec4f(frame * sums.parts[3].xyz, 0.0);
        record.translation[1] = vec4f(frame * sums.parts[4].xyz, 0.0);
        record.translation[2] = vec4f(frame * sums.parts[5].xyz, 0.0);
    }
    return record;
}
