#import lib/sums

// One workgroup a tile: each lane adds every 64th sample and edge, then a tree adds the lanes.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read> weights: array<TileSample>;
@group(0) @binding(2) var<storage, read> edges: array<TileEdge>;
@group(0) @binding(3) var<storage, read> radiance: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> records: array<Record>;

override EDGES: u32 = 0u;

const LANES = 64u;

// Each part's lanes, one part after the other.
var<workgroup> lanes: array<vec4f, 384>;

fn inverse_depth(request: Request, sample: u32, distance: f32) -> f32 {
    return inverse_distance(request, distance) / weights[sample].depth_cosine;
}

@compute @workgroup_size(64)
fn sum(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = group.x + group.y * groups.x;
    if tile >= TILE_CAPACITY {
        return;
    }
    let request = requests[tile];
    let size = TILE_WIDTH * TILE_HEIGHT;
    var mine: Sums;
    for (var i = lane; i < size; i += LANES) {
        let weight = weights[i];
        if weight.plain_weight > 0.0 {
            let seen = radiance[tile * size + i];
            add_sample(&mine, weight, seen, inverse_distance(request, seen.w));
        }
    }
    if GRADIENTS {
        for (var i = lane; i < EDGES; i += LANES) {
            let edge = edges[i];
            let a = radiance[tile * size + edge.a];
            let b = radiance[tile * size + edge.b];
            add_edge(&mine, edge, a.rgb, b.rgb, inverse_depth(request, edge.a, a.w), inverse_depth(request, edge.b, b.w));
        }
    }
    for (var part = 0u; part < PARTS; part++) {
        lanes[part * LANES + lane] = mine.parts[part];
    }
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            for (var part = 0u; part < PARTS; part++) {
                let at = part * LANES + lane;
                lanes[at] = joined(part, lanes[at], lanes[at + half]);
            }
        }
    }
    workgroupBarrier();
    if lane == 0u {
        var all: Sums;
        for (var part = 0u; part < PARTS; part++) {
            all.parts[part] = lanes[part * LANES];
        }
        records[tile] = record_of(request, all);
    }
}
