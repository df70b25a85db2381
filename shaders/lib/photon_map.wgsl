// Photons near a point: as passes/photons/lookup.rs.

struct Photon {
    position: vec3f,
    // Length of the way from the last surface.
    leg: f32,
    flux: vec3f,
    // The surface's normal and the way to where it came from: two times two bytes.
    ways: u32,
}

// What stands first.
struct MapHead {
    corner: vec3f,
    cells_per_unit: f32,
    count: u32,
    level: u32,
    padding_a: u32,
    padding_b: u32,
}

// The head; of the table's cells the first photon; the photons.
@group(0) @binding(22) var<storage, read> photon_map: array<vec4u>;

const HEAD_WORDS = 8u;
// Where the photons start [photons].
const SLOTS_BEFORE = 32770u;
const BITS = 10u;
const TABLE_BITS = 12u;
const CROWD = 6u;
const DETAIL = 4u;
const WIDENED = 1u;
const LONGER = 1.0001;
const RINGS = 16u;
const LEAST_COSINE = 0.8;
const FLATNESS = 0.25;

// As Zone.
struct Zone {
    radius: f32,
    level: u32,
    is_filled: bool,
}

fn map_head() -> MapHead {
    let cube = bitcast<vec4f>(photon_map[0]);
    return MapHead(cube.xyz, cube.w, photon_map[1].x, photon_map[1].y, 0u, 0u);
}

fn photon_at(number: u32) -> Photon {
    let place = bitcast<vec4f>(photon_map[2u * (SLOTS_BEFORE + number)]);
    let light = photon_map[2u * (SLOTS_BEFORE + number) + 1u];
    return Photon(place.xyz, place.w, bitcast<vec3f>(light.xyz), light.w);
}

// The first photon in a cell of the table, or behind it.
fn table_start(cell: u32) -> u32 {
    let word = HEAD_WORDS + cell;
    return photon_map[word / 4u][word % 4u];
}

fn fair_share(zone: Zone, count: u32) -> f32 {
    return select(1.0, 1.0 - 1.0 / f32(max(count, 1u)), zone.is_filled && count > 1u);
}

fn spread_bits(bits: u32) -> u32 {
    let a = (bits | (bits << 16u)) & 0x030000ffu;
    let b = (a | (a << 8u)) & 0x0300f00fu;
    let c = (b | (b << 4u)) & 0x030c30c3u;
    return (c | (c << 2u)) & 0x09249249u;
}

fn cell_code(cell: vec3u) -> u32 {
    return spread_bits(cell.x) | (spread_bits(cell.y) << 1u) | (spread_bits(cell.z) << 2u);
}

// The cell that a place is in, as a code.
fn code_of(head: MapHead, position: vec3f) -> u32 {
    let cell = clamp((position - head.corner) * head.cells_per_unit, vec3f(0.0), vec3f(f32((1u << BITS) - 1u)));
    return cell_code(vec3u(cell));
}

// The first photon whose code is no less.
fn first_from(head: MapHead, code: u32) -> u32 {
    let cell = code >> TABLE_BITS;
    var low = table_start(cell);
    if (code & ((1u << TABLE_BITS) - 1u)) == 0u {
        return low;
    }
    var high = table_start(cell + 1u);
    while low < high {
        let middle = (low + high) / 2u;
        if code_of(head, bitcast<vec3f>(photon_map[2u * (SLOTS_BEFORE + middle)].xyz)) < code {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

fn half_edge(head: MapHead, level: u32) -> f32 {
    return 0.5 * f32(1u << level) / head.cells_per_unit;
}

// How far from a surface the middle of a cell may be that has photons of it.
fn slab_of(head: MapHead, normal: vec3f, radius: f32, level: u32) -> f32 {
    return FLATNESS * radius + half_edge(head, level) * dot(abs(normal), vec3f(1.0)) * LONGER;
}

// The photons in one of the eight cells next to a point, if its middle is within a slab: the first, and one past the last.
fn photons_of(head: MapHead, position: vec3f, level: u32, number: u32, normal: vec3f, slab: f32) -> vec2u {
    let last = (1 << (BITS - level)) - 1;
    let place = (position - head.corner) * head.cells_per_unit;
    let base = vec3i(floor(place / f32(1u << level) - 0.5));
    let cell = base + vec3i(vec3u(number & 1u, (number >> 1u) & 1u, number >> 2u));
    if any(cell < vec3i(0)) || any(cell > vec3i(last)) {
        return vec2u(0u);
    }
    let middle = head.corner + (vec3f(cell) + 0.5) * (f32(1u << level) / head.cells_per_unit);
    if abs(dot(middle - position, normal)) > slab {
        return vec2u(0u);
    }
    let first = cell_code(vec3u(cell)) << (3u * level);
    return vec2u(first_from(head, first), first_from(head, first + (1u << (3u * level))));
}

fn count_around(head: MapHead, position: vec3f, level: u32) -> u32 {
    var count = 0u;
    for (var number = 0u; number < 8u; number++) {
        let range = photons_of(head, position, level, number, vec3f(0.0), 0.0);
        count += range.y - range.x;
    }
    return count;
}

fn fold(own: f32, other: f32) -> f32 {
    return (1.0 - abs(other)) * select(1.0, -1.0, own < 0.0);
}

// As passes::photons::ways.
fn packed_way(way: vec3f) -> u32 {
    let flat = way / max(dot(abs(way), vec3f(1.0)), 1e-37);
    let folded = select(flat.xy, vec2f(fold(flat.x, flat.y), fold(flat.y, flat.x)), flat.z < 0.0);
    let at = vec2u(clamp(folded * 127.0 + 127.5, vec2f(0.0), vec2f(254.0)));
    return at.x | (at.y << 8u);
}

fn unpacked_way(bits: u32) -> vec3f {
    let at = vec2f(vec2u(bits & 255u, (bits >> 8u) & 255u)) / 127.0 - 1.0;
    let z = 1.0 - abs(at.x) - abs(at.y);
    return normalize(select(vec3f(at, z), vec3f(fold(at.x, at.y), fold(at.y, at.x), z), z < 0.0));
}

// The squared distance of a photon that is on the surface within the radius, and −1 of others.
fn photon_distance(photon: Photon, position: vec3f, normal: vec3f, radius: f32) -> f32 {
    let way = photon.position - position;
    let squared = dot(way, way);
    let is_near = squared <= radius * radius && abs(dot(way, normal)) <= FLATNESS * radius;
    if is_near && dot(unpacked_way(photon.ways), normal) >= LEAST_COSINE {
        return squared;
    }
    return -1.0;
}

// As Lookup::zone.
fn photon_zone(position: vec3f, normal: vec3f, wanted: u32, most: f32) -> Zone {
    let head = map_head();
    let crowd = CROWD * wanted;
    var level = head.level;
    if count_around(head, position, level) >= crowd {
        while level > 0u && count_around(head, position, max(level, 1u) - 1u) >= crowd {
            level -= 1u;
        }
    } else {
        while level < BITS && half_edge(head, level) < most && count_around(head, position, level) < crowd {
            level += 1u;
        }
    }
    let last = min(BITS, level + WIDENED);
    var radius: f32;
    loop {
        radius = min(half_edge(head, level), most);
        var rings: array<u32, RINGS>;
        let scale = f32(RINGS) / (radius * radius);
        let slab = slab_of(head, normal, radius, level);
        for (var number = 0u; number < 8u; number++) {
            let range = photons_of(head, position, level, number, normal, slab);
            for (var i = range.x; i < range.y; i++) {
                let squared = photon_distance(photon_at(i), position, normal, radius);
                if squared >= 0.0 {
                    rings[min(u32(squared * scale), RINGS - 1u)] += 1u;
                }
            }
        }
        var sum = 0u;
        for (var ring = 0u; ring < RINGS; ring++) {
            sum += rings[ring];
            if sum >= wanted {
                return Zone(radius * sqrt(f32(ring + 1u) / f32(RINGS)), level, true);
            }
        }
        if level == last || half_edge(head, level) >= most || sum * DETAIL >= wanted {
            break;
        }
        level += 1u;
    }
    return Zone(radius, level, false);
}
