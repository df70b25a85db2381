#import lib/scene
#import lib/record
#import lib/tile

// Tiles times tables of the basis: the coefficients of what arrives, and their derivatives along both tangents.

struct TileWall {
    a: u32,
    b: u32,
    // 1 over the cosines to the raster's axis.
    depth_a: f32,
    depth_b: f32,
    gradient: vec2f,
    padding: vec2u,
}

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read> walls: array<TileWall>;
@group(0) @binding(2) var<storage, read> radiance: array<vec4f>;
// Of each tile and wall the step of radiance over the nearer depth.
@group(0) @binding(3) var<storage, read_write> steps: array<vec4f>;
// The samples that have a weight.
@group(0) @binding(4) var<storage, read> places: array<u32>;
// Of each of them, and of each wall, the basis: four coefficients a number.
@group(0) @binding(5) var<storage, read> basis: array<vec4f>;
@group(0) @binding(6) var<storage, read> wall_basis: array<vec4f>;
// Of each tile nine planes of coefficients, in the tile's frame and in the normal's.
@group(0) @binding(7) var<storage, read_write> raw: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> values: array<vec4f>;

// The records of the same tiles.
@group(0) @binding(9) var<storage, read_write> records: array<Record>;

override QUADS: u32 = 25u;
override ORDER: u32 = 10u;
override SAMPLES: u32 = 1u;
override WALLS: u32 = 0u;

const PLANES = 9u;
const TILES = 2u;
// Fours of coefficients of a workgroup, and lanes that share the samples of each.
const COLUMNS = 32u;
const SHARES = 4u;

@compute @workgroup_size(64)
fn step(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let item = tile_item(WALLS, group, groups, lane);
    if !item.inside {
        return;
    }
    let nearest = max(surface_offset(requests[item.tile].position), 1e-30);
    let wall = walls[item.index];
    let first = item.tile * TILE_WIDTH * TILE_HEIGHT;
    let a = radiance[first + wall.a];
    let b = radiance[first + wall.b];
    let inverse = max(wall.depth_a / max(a.w, nearest), wall.depth_b / max(b.w, nearest));
    steps[item.tile * WALLS + item.index] = vec4f((b.rgb - a.rgb) * inverse, 0.0);
}

// Nine planes of four coefficients of one tile.
struct Sums {
    planes: array<vec4f, 9>,
}

// Of all shares but the first.
var<workgroup> shared_sums: array<Sums, 96>;

fn add_sample(sums: ptr<function, Sums>, weight: vec4f, seen: vec4f) {
    (*sums).planes[0] += weight * seen.r;
    (*sums).planes[1] += weight * seen.g;
    (*sums).planes[2] += weight * seen.b;
}

fn add_wall(sums: ptr<function, Sums>, x: vec4f, y: vec4f, change: vec4f) {
    (*sums).planes[3] += x * change.r;
    (*sums).planes[4] += x * change.g;
    (*sums).planes[5] += x * change.b;
    (*sums).planes[6] += y * change.r;
    (*sums).planes[7] += y * change.g;
    (*sums).planes[8] += y * change.b;
}

// Adds the shares of a tile's columns and writes them.
fn finish(sums: Sums, tile: u32, quad: u32, lane: u32) {
    workgroupBarrier();
    if lane >= COLUMNS {
        shared_sums[lane - COLUMNS] = sums;
    }
    workgroupBarrier();
    if lane < COLUMNS && quad < QUADS && tile < TILE_CAPACITY {
        for (var plane = 0u; plane < PLANES; plane++) {
            var sum = sums.planes[plane];
            for (var share = 0u; share + 1u < SHARES; share++) {
                sum += shared_sums[lane + share * COLUMNS].planes[plane];
            }
            raw[(tile * PLANES + plane) * QUADS + quad] = sum;
        }
    }
}

@compute @workgroup_size(128)
fn project(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let blocks = (QUADS + COLUMNS - 1u) / COLUMNS;
    let linear = group.x + group.y * groups.x;
    let tile = TILES * (linear / blocks);
    let quad = (linear % blocks) * COLUMNS + lane % COLUMNS;
    let column = min(quad, QUADS - 1u);
    let first_a = min(tile, TILE_CAPACITY - 1u);
    let first_b = min(tile + 1u, TILE_CAPACITY - 1u);
    let size = TILE_WIDTH * TILE_HEIGHT;
    var a: Sums;
    var b: Sums;
    for (var i = lane / COLUMNS; i < SAMPLES; i += SHARES) {
        let weight = basis[i * QUADS + column];
        let place = places[i];
        add_sample(&a, weight, radiance[first_a * size + place]);
        add_sample(&b, weight, radiance[first_b * size + place]);
    }
    for (var i = lane / COLUMNS; i < WALLS; i += SHARES) {
        let gradient = walls[i].gradient;
        let weight = wall_basis[i * QUADS + column];
        let x = weight * gradient.x;
        let y = weight * gradient.y;
        add_wall(&a, x, y, steps[first_a * WALLS + i]);
        add_wall(&b, x, y, steps[first_b * WALLS + i]);
    }
    finish(a, tile, quad, lane);
    finish(b, tile + 1u, quad, lane);
}

fn raw_at(tile: u32, plane: u32, index: u32) -> f32 {
    return raw[(tile * PLANES + plane) * QUADS + index / 4u][index % 4u];
}

// A coefficient of a plane, turned around the normal as its function is.
fn turned(tile: u32, plane: u32, index: u32, twin: u32, rotation: vec2f) -> f32 {
    return raw_at(tile, plane, index) * rotation.x + raw_at(tile, plane, twin) * rotation.y;
}

// Four coefficients of all planes from the tile's frame into that of its normal: math::radiance::Projected::turned.
@compute @workgroup_size(64)
fn turn(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let item = tile_item(4u * QUADS, group, groups, lane);
    if !item.inside {
        return;
    }
    let index = item.index;
    let angle = requests[item.tile].turn;
    // Degree l and order m.
    var l = u32(sqrt(f32(index)));
    l = select(l, l - 1u, l * l > index);
    l = select(l, l + 1u, (l + 1u) * (l + 1u) <= index);
    let m = i32(index - l * l) - i32(l);
    let twin = u32(i32(l * l + l) - m);
    // The cosine's coefficient loses what the sine's gains.
    let rotation = vec2f(cos(f32(abs(m)) * angle), select(1.0, -1.0, m > 0) * select(0.0, sin(f32(abs(m)) * angle), m != 0));
    let inside = index < ORDER * ORDER;
    let c = cos(angle);
    let s = sin(angle);
    for (var channel = 0u; channel < 3u; channel++) {
        var value = 0.0;
        var x = 0.0;
        var y = 0.0;
        if inside {
            value = turned(item.tile, channel, index, twin, rotation);
            x = turned(item.tile, 3u + channel, index, twin, rotation);
            y = turned(item.tile, 6u + channel, index, twin, rotation);
        }
        let at = item.tile * PLANES * QUADS + index / 4u;
        values[at + channel * QUADS][index % 4u] = value;
        values[at + (3u + channel) * QUADS][index % 4u] = x * c - y * s;
        values[at + (6u + channel) * QUADS][index % 4u] = x * s + y * c;
    }
}

var<workgroup> energies: array<vec2f, 64>;

// How fast what arrives changes along the surface, in place of how fast the irradiance does: the derivatives' norm over the expansion's.
@compute @workgroup_size(64)
fn bound(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = min(group.x + group.y * groups.x, TILE_CAPACITY - 1u);
    var sum = vec2f(0.0);
    for (var i = lane; i < PLANES * QUADS; i += 64u) {
        let value = raw[tile * PLANES * QUADS + i];
        let energy = dot(value, value);
        sum += select(vec2f(0.0, energy), vec2f(energy, 0.0), i < 3u * QUADS);
    }
    energies[lane] = sum;
    workgroupBarrier();
    if lane == 0u {
        var all = vec2f(0.0);
        for (var i = 0u; i < 64u; i++) {
            all += energies[i];
        }
        records[tile].translation[0].w = min(sqrt(all.y / max(all.x, 1e-30)), 1e30);
    }
}
