#import lib/sums

// One workgroup sums four tiles: each lane walks along pairs of rows of all four, so that a weight is read once for four
// samples, and a sample serves as its neighbours' left one and upper one; then eight lanes a part add what
// all have, tile by tile.

// What a sample stands for, and its walls to the samples on its left and above.
struct Cell {
    // Cosine weight, turn of the normal, 1 over the cosine to the raster's axis; that is 0 for an unused sample.
    weights: vec4f,
    // Gradient, and xx of the second derivatives.
    left: vec4f,
    above: vec4f,
    // xy and yy of the second derivatives, left and above.
    bends: vec4f,
    // Of the block of four whose last sample this is, the weight as the first number; 0 where there is none.
    block: vec4f,
}

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read> cells: array<Cell>;
// The walls between samples that are no such neighbours.
@group(0) @binding(2) var<storage, read> seams: array<TileEdge>;
@group(0) @binding(3) var<storage, read> radiance: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> records: array<Record>;

override SEAMS: u32 = 0u;

const LANES = 64u;
// Lanes that add up one part of a tile.
const SHARES = 8u;

// Each part's lanes, one part after the other.
var<workgroup> lanes: array<vec4f, 448>;

// Where a tile's samples are, and what bounds their distances.
struct Place {
    first: u32,
    nearest: f32,
}

fn place_of(tile: u32) -> Place {
    let placed = min(tile, TILE_CAPACITY - 1u);
    return Place(placed * TILE_WIDTH * TILE_HEIGHT, least_distance(requests[placed]));
}

// Radiance and inverse distance; nothing infinitely far where the sample is unused, whatever stands in its memory.
fn seen_at(place: Place, sample: u32, inverse_depth_cosine: f32) -> vec4f {
    let seen = radiance[place.first + sample];
    return select(vec4f(0.0), vec4f(seen.rgb, 1.0 / max(seen.w, place.nearest)), inverse_depth_cosine > 0.0);
}

// The same with the inverse of the depth along the raster's axis.
fn in_depth(seen: vec4f, inverse_depth_cosine: f32) -> vec4f {
    return vec4f(seen.rgb, seen.w * inverse_depth_cosine);
}

// Lanes that have rows.
fn busy_lanes() -> u32 {
    return min((TILE_HEIGHT + 1u) / 2u, LANES);
}

// Adds the wall between two samples that are neighbours in the picture: its gradient with xx, xy and yy of the second derivatives.
fn visit_wall(sums: ptr<function, Sums>, wall: vec4f, bend: vec2f, a: vec4f, b: vec4f) {
    if GRADIENTS {
        add_wall(sums, wall.xyz, vec3f(wall.w, bend), a, b);
    }
}

// Adds a sample with its block and its walls to the one before it and the one above, which are as `in_depth`; returns it so.
fn visit(sums: ptr<function, Sums>, place: Place, cell: Cell, sample: u32, before: vec4f, above: vec4f, corner: vec3f) -> vec4f {
    let seen = seen_at(place, sample, cell.weights.w);
    add_sample(sums, cell.weights.x, cell.weights.yz, seen.rgb, seen.w);
    add_block(sums, cell.block.x, corner, above.rgb, before.rgb, seen.rgb);
    let placed = in_depth(seen, cell.weights.w);
    visit_wall(sums, cell.left, cell.bends.xy, before, placed);
    visit_wall(sums, cell.above, cell.bends.zw, above, placed);
    return placed;
}

// What two samples, one above the other, stand for.
struct CellPair {
    sample: u32,
    // The sample above the pair.
    above: u32,
    above_cosine: f32,
    upper: Cell,
    lower: Cell,
}

// Two samples, one above the other, of the rows that a lane walks along, and the one above them.
struct Pair {
    above: vec4f,
    upper: vec4f,
    lower: vec4f,
}

fn visit_pair(sums: ptr<function, Sums>, place: Place, cells: CellPair, before: Pair) -> Pair {
    let above = in_depth(seen_at(place, cells.above, cells.above_cosine), cells.above_cosine);
    let upper = visit(sums, place, cells.upper, cells.sample, before.upper, above, before.above.rgb);
    let lower = visit(sums, place, cells.lower, cells.sample + TILE_WIDTH, before.lower, upper, before.upper.rgb);
    return Pair(above, upper, lower);
}

fn visit_seam(sums: ptr<function, Sums>, place: Place, seam: TileEdge, depth_a: f32, depth_b: f32) {
    let hessian = vec3f(seam.hessian_xx, seam.hessian_xy, seam.hessian_yy);
    let a = in_depth(seen_at(place, seam.a, depth_a), depth_a);
    let b = in_depth(seen_at(place, seam.b, depth_b), depth_b);
    add_wall(sums, seam.gradient, hessian, a, b);
}

// Adds the lanes' parts of one tile: first eight lanes a part, then one. Few lanes with several steps each, as a driver that runs on the CPU
// takes as long for a lane that waits as for one that works.
fn finish(sums: Sums, tile: u32, lane: u32) {
    workgroupBarrier();
    if lane < busy_lanes() {
        for (var part = 0u; part < PARTS; part++) {
            lanes[part * LANES + lane] = sums.parts[part];
        }
    }
    workgroupBarrier();
    let part = lane / SHARES;
    if part < PARTS {
        var sum: vec4f;
        for (var i = lane % SHARES; i < busy_lanes(); i += SHARES) {
            sum = joined(part, sum, lanes[part * LANES + i]);
        }
        lanes[part * LANES + lane % SHARES] = sum;
    }
    workgroupBarrier();
    if lane < PARTS {
        var sum = lanes[lane * LANES];
        for (var i = 1u; i < SHARES; i++) {
            sum = joined(lane, sum, lanes[lane * LANES + i]);
        }
        lanes[lane * LANES] = sum;
    }
    workgroupBarrier();
    if lane == 0u && tile < TILE_CAPACITY {
        var all: Sums;
        for (var part = 0u; part < PARTS; part++) {
            all.parts[part] = lanes[part * LANES];
        }
        records[tile] = record_of(requests[tile], all);
    }
}

@compute @workgroup_size(64)
fn sum(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = 4u * (group.x + group.y * groups.x);
    let place_a = place_of(tile + 0u);
    let place_b = place_of(tile + 1u);
    let place_c = place_of(tile + 2u);
    let place_d = place_of(tile + 3u);
    var a: Sums;
    var b: Sums;
    var c: Sums;
    var d: Sums;
    var before_a: Pair;
    var before_b: Pair;
    var before_c: Pair;
    var before_d: Pair;
    for (var row = 2u * lane; row < TILE_HEIGHT; row += 2u * LANES) {
        for (var column = 0u; column < TILE_WIDTH; column++) {
            let sample = row * TILE_WIDTH + column;
            let above = sample - min(sample, TILE_WIDTH);
            let pair = CellPair(sample, above, cells[above].weights.w, cells[sample], cells[sample + TILE_WIDTH]);
            before_a = visit_pair(&a, place_a, pair, before_a);
            before_b = visit_pair(&b, place_b, pair, before_b);
            before_c = visit_pair(&c, place_c, pair, before_c);
            before_d = visit_pair(&d, place_d, pair, before_d);
        }
    }
    if GRADIENTS {
        for (var i = select(SEAMS, lane, lane < busy_lanes()); i < SEAMS; i += busy_lanes()) {
            let seam = seams[i];
            let depth_a = cells[seam.a].weights.w;
            let depth_b = cells[seam.b].weights.w;
            visit_seam(&a, place_a, seam, depth_a, depth_b);
            visit_seam(&b, place_b, seam, depth_a, depth_b);
            visit_seam(&c, place_c, seam, depth_a, depth_b);
            visit_seam(&d, place_d, seam, depth_a, depth_b);
        }
    }
    // A loop, and not four calls: the text of this shader is what takes longest to build.
    for (var i = 0u; i < 4u; i++) {
        finish(a, tile + i, lane);
        a = b;
        b = c;
        c = d;
    }
}
