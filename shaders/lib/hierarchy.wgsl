#import lib/scene

// The scene's binary hierarchy: as gpu::hierarchy packs it. Of a node, lower bounds are in the low sixteen bits of x, y and z, upper ones in
// the high; w is what it holds: a leaf's triangles, or the place of the first of its two children. While they walk, shaders measure lengths in
// units of the scene's largest extent.

// The grid's origin with the unit, the steps of its boxes with the place of the triangles, the root, pairs of children, then triangles.

// More than the longest path from the root to a leaf: gpu::hierarchy.
const MAX_DEPTH = 64u;
// Stands for what a node holds where a walk has ended.
const NO_NODE = 0xffffffffu;

fn root_content() -> u32 {
    return scene_tables[2].w;
}

// Whether a node with this content has children.
fn is_inner(content: u32) -> bool {
    return (content & 0x80000000u) == 0u;
}

struct Triangles {
    first: u32,
    // One past the last.
    end: u32,
}

// None of `NO_NODE`.
fn triangles_of(leaf: u32) -> Triangles {
    let first = leaf & 0x03ffffffu;
    return Triangles(first, first + select((leaf >> 26u) & 31u, 0u, leaf == NO_NODE));
}

// The grid as seen from a point.
struct Grid {
    origin: vec3f,
    step: vec3f,
    // The point in steps of the grid that corners are given in.
    point: vec3i,
    // In the scene's units of length.
    unit: f32,
    // The place of the first triangle.
    triangles: u32,
}

// Steps of the grid that corners are given in, along an extent.
const FINE_STEPS = 268435456.0;

fn grid_from(origin: vec3f) -> Grid {
    let unit = bitcast<f32>(scene_tables[0].w);
    let place = clamp((origin - bitcast<vec3f>(scene_tables[0].xyz)) / unit, vec3f(-7.0), vec3f(7.0));
    return Grid(-place, bitcast<vec3f>(scene_tables[1].xyz), vec3i(round(place * FINE_STEPS)), unit, scene_tables[1].w);
}

fn lower_bound(node: vec4u, grid: Grid) -> vec3f {
    return vec3f(node.xyz & vec3u(0xffffu)) * grid.step + grid.origin;
}

fn upper_bound(node: vec4u, grid: Grid) -> vec3f {
    return vec3f(node.xyz >> vec3u(16u)) * grid.step + grid.origin;
}

// A triangle as seen from a point.
struct Corners {
    // From the first corner to the point.
    point: vec3f,
    // From the first corner to the others.
    e1: vec3f,
    e2: vec3f,
    // What rounding may add to products of a unit direction with the cross product of an edge and `point`: edges are this much
    // wider, so that no ray passes between two triangles that share one.
    rounding: f32,
}

fn corners(triangle: u32, grid: Grid) -> Corners {
    let x = scene_tables[grid.triangles + 2u * triangle];
    let y = scene_tables[grid.triangles + 2u * triangle + 1u];
    let low = (x & vec4u(15u)) << vec4u(0u, 4u, 8u, 12u);
    let high = (y.xyz & vec3u(15u)) << vec3u(16u, 20u, 24u);
    let last = low.x | low.y | low.z | low.w | high.x | high.y | high.z;
    let a = vec3i(x.xyz >> vec3u(4u));
    let b = vec3i(vec3u(x.w, y.xy) >> vec3u(4u));
    let c = vec3i(vec3u(y.z >> 4u, y.w >> 4u, last));
    let point = vec3f(grid.point - a) / FINE_STEPS;
    let e1 = vec3f(b - a) / FINE_STEPS;
    let e2 = vec3f(c - a) / FINE_STEPS;
    return Corners(point, e1, e2, 2e-7 * sum_of_sizes(point) * (sum_of_sizes(e1) + sum_of_sizes(e2)));
}

fn sum_of_sizes(v: vec3f) -> f32 {
    return dot(abs(v), vec3f(1.0));
}

fn safe_inverse(direction: vec3f) -> vec3f {
    let tiny = abs(direction) <= vec3f(1e-12);
    return select(1.0 / direction, select(vec3f(-1e12), vec3f(1e12), direction >= vec3f(0.0)), tiny);
}
