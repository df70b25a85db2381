#import lib/scene

// The scene's binary hierarchy: as gpu::hierarchy packs it. Of a node, lower bounds are in the low sixteen bits of x, y and z, upper ones in
// the high; w is what it holds: a leaf's triangles, or the place of the first of its two children.

// The origin and the step of the grid that boxes are given in, the root, then pairs of children.
@group(1) @binding(3) var<storage, read> scene_nodes: array<vec4u>;

// More than the longest path from the root to a leaf: gpu::hierarchy.
const MAX_DEPTH = 64u;
// Stands for what a node holds where a walk has ended.
const NO_NODE = 0xffffffffu;

fn root_content() -> u32 {
    return scene_nodes[2].w;
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

fn triangles_of(leaf: u32) -> Triangles {
    let first = leaf & 0x03ffffffu;
    return Triangles(first, first + (leaf >> 26u & 31u));
}

// The grid as seen from a point.
struct Grid {
    origin: vec3f,
    step: vec3f,
}

fn grid_from(origin: vec3f) -> Grid {
    return Grid(bitcast<vec3f>(scene_nodes[0].xyz) - origin, bitcast<vec3f>(scene_nodes[1].xyz));
}

fn lower_bound(node: vec4u, grid: Grid) -> vec3f {
    return vec3f(node.xyz & vec3u(0xffffu)) * grid.step + grid.origin;
}

fn upper_bound(node: vec4u, grid: Grid) -> vec3f {
    return vec3f(node.xyz >> vec3u(16u)) * grid.step + grid.origin;
}

fn safe_inverse(direction: vec3f) -> vec3f {
    let tiny = abs(direction) <= vec3f(1e-12);
    return select(1.0 / direction, select(vec3f(-1e12), vec3f(1e12), direction >= vec3f(0.0)), tiny);
}
