#import lib/scene
#import lib/frame
#import lib/record
#import lib/tile

// One workgroup a tile: each lane adds every 64th sample and edge, then a tree adds the lanes. math::sum is the twin.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read> weights: array<TileSample>;
@group(0) @binding(2) var<storage, read> edges: array<TileEdge>;
@group(0) @binding(3) var<storage, read> radiance: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> records: array<Record>;

override EDGES: u32 = 0u;
override GRADIENTS: bool = true;

const LANES = 64u;
const PARTS = 6u;

// Irradiance and Σ w/d; rotation of red and green, of blue with Σ w and 1/nearest; translation of each channel.
var<workgroup> sums: array<vec4f, 384>;

fn nearest_distance(request: Request) -> f32 {
    return max(surface_offset(request.position), 1e-30);
}

@compute @workgroup_size(64)
fn sum(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = group.x + group.y * groups.x;
    if tile >= TILE_CAPACITY {
        return;
    }
    let request = requests[tile];
    let size = TILE_WIDTH * TILE_HEIGHT;
    let nearest = nearest_distance(request);
    var irradiance = vec4f(0.0);
    var rotation_rg = vec4f(0.0);
    var rotation_b = vec4f(0.0);
    for (var i = lane; i < size; i += LANES) {
        let weight = weights[i];
        if weight.plain_weight > 0.0 {
            let seen = radiance[tile * size + i];
            let inverse = 1.0 / max(seen.w, nearest);
            irradiance += vec4f(seen.rgb, inverse) * weight.cosine_weight;
            let turn = vec2f(weight.rotation_x, weight.rotation_y);
            rotation_rg += vec4f(turn * seen.r, turn * seen.g);
            rotation_b = vec4f(rotation_b.xy + turn * seen.b, rotation_b.z + weight.cosine_weight, max(rotation_b.w, inverse));
        }
    }
    var translation_r = vec4f(0.0);
    var translation_g = vec4f(0.0);
    var translation_b = vec4f(0.0);
    if GRADIENTS {
        for (var i = lane; i < EDGES; i += LANES) {
            let edge = edges[i];
            let a = radiance[tile * size + edge.a];
            let b = radiance[tile * size + edge.b];
            let inverse_a = 1.0 / (max(a.w, nearest) * weights[edge.a].depth_cosine);
            let inverse_b = 1.0 / (max(b.w, nearest) * weights[edge.b].depth_cosine);
            let step = (b.rgb - a.rgb) * max(inverse_a, inverse_b);
            let gradient = vec4f(edge.gradient, 0.0);
            translation_r += gradient * step.r;
            translation_g += gradient * step.g;
            translation_b += gradient * step.b;
        }
    }
    sums[lane] = irradiance;
    sums[LANES + lane] = rotation_rg;
    sums[2u * LANES + lane] = rotation_b;
    sums[3u * LANES + lane] = translation_r;
    sums[4u * LANES + lane] = translation_g;
    sums[5u * LANES + lane] = translation_b;
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            for (var part = 0u; part < PARTS; part++) {
                let at = part * LANES + lane;
                let other = sums[at + half];
                let mine = sums[at];
                // The third part's last component is a maximum.
                let last = select(mine.w + other.w, max(mine.w, other.w), part == 2u);
                sums[at] = vec4f(mine.xyz + other.xyz, last);
            }
        }
    }
    workgroupBarrier();
    if lane == 0u {
        records[tile] = finish(request);
    }
}

fn finish(request: Request) -> Record {
    let frame = frame_around(request.normal, request.turn);
    let irradiance = sums[0];
    let rotation_rg = sums[LANES];
    let rotation_b = sums[2u * LANES];
    var record: Record;
    record.position = request.position;
    record.normal = request.normal;
    record.footprint = request.footprint;
    record.irradiance = irradiance.rgb;
    record.radius = rotation_b.z / max(irradiance.w, 1e-30);
    record.minimum_distance = 1.0 / max(rotation_b.w, 1e-30);
    if GRADIENTS {
        record.rotation[0] = vec4f(frame * vec3f(rotation_rg.xy, 0.0), 0.0);
        record.rotation[1] = vec4f(frame * vec3f(rotation_rg.zw, 0.0), 0.0);
        record.rotation[2] = vec4f(frame * vec3f(rotation_b.xy, 0.0), 0.0);
        record.translation[0] = vec4f(frame * sums[3u * LANES].xyz, 0.0);
        record.translation[1] = vec4f(frame * sums[4u * LANES].xyz, 0.0);
        record.translation[2] = vec4f(frame * sums[5u * LANES].xyz, 0.0);
    }
    return record;
}
