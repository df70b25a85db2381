// Lobes as expansions over a grid of outgoing directions: math::harmonics::reflection has the twin.

// Of each table and outgoing direction two parts: what the lobe's reflectance multiplies, and what rises toward grazing angles.
@group(0) @binding(17) var<storage, read> lobes: array<vec4f>;
@group(0) @binding(19) var<storage, read> lobe_places: array<TablePlace>;

override GRID: u32 = 32u;

const PARTS = 2u;

// Where a table begins, and the order that it holds: passes/record.rs has the twin.
struct TablePlace {
    first: u32,
    order: u32,
}

// Four directions of the grid around one, and what each counts; the order of the expansions there, and the fours that each takes.
struct Corners {
    order: u32,
    quads: u32,
    first: u32,
    right: u32,
    below: u32,
    weights: vec4f,
}

fn corners_of(table: u32, outgoing: vec3f) -> Corners {
    let kept = lobe_places[table];
    let quads = (kept.order * kept.order + 3u) / 4u;
    let stride = PARTS * quads;
    let place = 0.5 + 0.5 * outgoing.xy / (1.0 + max(outgoing.z, 0.0));
    let at = clamp(place * f32(GRID) - 0.5, vec2f(0.0), vec2f(f32(GRID) - 1.0));
    let base = min(floor(at), vec2f(max(f32(GRID) - 2.0, 0.0)));
    let f = at - base;
    let first = kept.first + (u32(base.y) * GRID + u32(base.x)) * stride;
    let weights = vec4f((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
    return Corners(kept.order, quads, first, stride, stride * GRID, weights);
}

// Four coefficients of a part.
fn four(at: Corners, part: u32, quad: u32) -> vec4f {
    let first = at.first + part * at.quads + quad;
    return lobes[first] * at.weights.x
        + lobes[first + at.right] * at.weights.y
        + lobes[first + at.below] * at.weights.z
        + lobes[first + at.right + at.below] * at.weights.w;
}
