#import lib/packet
#import lib/closest_hit
#import lib/frame
#import lib/record
#import lib/tile

// The triangle that each sample of a tile sees, by a ray a sample.

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read> samples: array<TileSample>;
// Triangle + 1.
@group(0) @binding(2) var<storage, read_write> seen: array<u32>;

// Samples along x and y that a packet and a workgroup's packets cover.
const PACKET = vec2u(4u, 2u);
const COVERED = vec2u(32u, 16u);

// Where a lane's packet stands among those of its workgroup: eight lanes after another are 2×4 packets, 8×8 samples.
fn packet_of(lane: u32) -> vec2u {
    return vec2u((lane & 1u) | ((lane >> 2u) & 6u), ((lane >> 1u) & 3u) | ((lane >> 3u) & 4u));
}

fn is_sample(at: vec2u) -> bool {
    return at.x < TILE_WIDTH && at.y < TILE_HEIGHT;
}

fn has_ray(at: vec2u) -> bool {
    return is_sample(at) && samples[at.y * TILE_WIDTH + at.x].plain_weight > 0.0;
}

fn direction_at(frame: mat3x3f, at: vec2u) -> vec3f {
    let inside = min(at, vec2u(TILE_WIDTH, TILE_HEIGHT) - 1u);
    return frame * samples[inside.y * TILE_WIDTH + inside.x].direction;
}

fn start_of(request: Request) -> vec3f {
    return request.position + request.normal * surface_offset(request.position);
}

// Four samples in a row.
fn row(frame: mat3x3f, at: vec2u) -> Rays {
    let b = at + vec2u(1u, 0u);
    let c = at + vec2u(2u, 0u);
    let d = at + vec2u(3u, 0u);
    let alive = vec4<bool>(has_ray(at), has_ray(b), has_ray(c), has_ray(d));
    return rays(direction_at(frame, at), direction_at(frame, b), direction_at(frame, c), direction_at(frame, d), alive);
}

fn store(tile: u32, at: vec2u, triangle: u32) {
    if is_sample(at) {
        seen[atlas_place(tile, at)] = triangle;
    }
}

fn store_row(tile: u32, at: vec2u, triangles: vec4u) {
    store(tile, at, triangles.x);
    store(tile, at + vec2u(1u, 0u), triangles.y);
    store(tile, at + vec2u(2u, 0u), triangles.z);
    store(tile, at + vec2u(3u, 0u), triangles.w);
}

// A packet of 4×2 neighbours a lane: where lanes are the elements of a processor's vectors, whose loads from different places take turns.
@compute @workgroup_size(64)
fn trace_packets(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let across = (TILE_WIDTH + COVERED.x - 1u) / COVERED.x;
    let parts = across * ((TILE_HEIGHT + COVERED.y - 1u) / COVERED.y);
    let linear = group.x + group.y * groups.x;
    let tile = linear / parts;
    let part = linear % parts;
    let at = vec2u(part % across, part / across) * COVERED + packet_of(lane) * PACKET;
    if tile >= TILE_CAPACITY || !is_sample(at) {
        return;
    }
    let request = requests[tile];
    let frame = frame_around(request.normal, request.turn);
    let below = at + vec2u(0u, 1u);
    let packet = trace_packet(start_of(request), Packet(row(frame, at), row(frame, below)));
    store_row(tile, at, packet.a.seen);
    store_row(tile, below, packet.b.seen);
}

// A ray a lane: where there are more lanes than a batch has packets. Lanes after another stand in columns of bands of four rows.
@compute @workgroup_size(64)
fn trace_each(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let item = tile_item(TILE_WIDTH * TILE_HEIGHT, group, groups, lane);
    if !item.inside {
        return;
    }
    let band = item.index / (4u * TILE_WIDTH);
    let in_band = item.index % (4u * TILE_WIDTH);
    let rows = min(TILE_HEIGHT - 4u * band, 4u);
    let at = vec2u(in_band / rows, 4u * band + in_band % rows);
    var triangle = 0u;
    if has_ray(at) {
        let request = requests[item.tile];
        let direction = direction_at(frame_around(request.normal, request.turn), at);
        let hit = nearest_hit(start_of(request), direction, FAR_AWAY, false);
        triangle = select(hit.triangle + 1u, 0u, hit.triangle == NO_TRIANGLE);
    }
    seen[atlas_place(item.tile, at)] = triangle;
}
