#import lib/scene

// The scene's binary hierarchy: as scene::bvh.

struct SceneNode {
    min: vec3f,
    // Triangles of a leaf, 0 for an inner node.
    count: u32,
    max: vec3f,
    // A leaf's first triangle, or an inner node's first child: the other one follows it.
    first: u32,
}

@group(1) @binding(3) var<storage, read> scene_nodes: array<SceneNode>;

// Longest path from the root to a leaf: scene::bvh::MAX_DEPTH.
const MAX_DEPTH = 64u;
// Stands for a node where a walk has ended.
const NO_NODE = 0xffffffffu;

fn is_inner(node: u32) -> bool {
    return node != NO_NODE && scene_nodes[node].count == 0u;
}

fn safe_inverse(direction: vec3f) -> vec3f {
    let tiny = abs(direction) <= vec3f(1e-12);
    return select(1.0 / direction, select(vec3f(-1e12), vec3f(1e12), direction >= vec3f(0.0)), tiny);
}
