// Lobes as expansions over a grid of outgoing directions: math::harmonics::reflection has the twin.

// Of each table and outgoing direction two parts: what the lobe's reflectance multiplies, and what rises toward grazing angles.
@group(0) @binding(17) var<storage, read> lobes: array<vec4f>;

override QUADS: u32 = 25u;
override ORDER: u32 = 10u;
override GRID: u32 = 32u;

const PARTS = 2u;

// Four directions of the grid around one, and what each counts.
struct Corners {
    first: u32,
    right: u32,
    below: u32,
    weights: vec4f,
}

fn corners_of(table: u32, outgoing: vec3f) -> Corners {
    let stride = PARTS * QUADS;
    let place = 0.5 + 0.5 * outgoing.xy / (1.0 + max(outgoing.z, 0.0));
    let at = clamp(place * f32(GRID) - 0.5, vec2f(0.0), vec2f(f32(GRID) - 1.0));
    let base = min(floor(at), vec2f(max(f32(GRID) - 2.0, 0.0)));
    let f = at - base;
    let first = ((table * GRID + u32(base.y)) * GRID + u32(base.x)) * stride;
    let weights = vec4f((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
    return Corners(first, stride, stride * GRID, weights);
}

fn four(at: Corners, offset: u32) -> vec4f {
    let first = at.first + offset;
    return lobes[first] * at.weights.x
        + lobes[first + at.right] * at.weights.y
        + lobes[first + at.below] * at.weights.z
        + lobes[first + at.right + at.below] * at.weights.w;
}
