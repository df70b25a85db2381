#import lib/sources

// Where caustics come from: as passes/photon_map/guide.rs.

// Of each part of the sources' flux where its share ends; of each part two grids: where the share of each row ends, then of each row where that of each cell does.
@group(0) @binding(25) var<storage, read> guide: array<u32>;

const PARTS = 8u;
const CELLS = 32u;
const GRID_WORDS = CELLS + CELLS * CELLS;

struct Warped {
    place: u32,
    density: f32,
}

// A place along shares that end there, as a place along as many equal shares; and how much denser places are than without.
fn warped(first: u32, count: u32, place: u32) -> Warped {
    var low = 0u;
    var high = count - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if guide[first + middle] <= place {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    var begin = 0u;
    if low > 0u {
        begin = guide[first + low - 1u];
    }
    let width = f32(max(guide[first + low] - begin, 1u));
    let size = 1u << (32u - firstTrailingBit(count));
    let within = u32(f32(place - begin) / width * f32(size));
    return Warped(low * size + min(within, size - 1u), width * f32(count) / WHOLE);
}

struct Guided {
    start: Start,
    density: f32,
}

// A place on the lattice, moved by chance.
fn shaken(place: u32, number: u32, key: u32) -> u32 {
    return place + (hash(combine(number, key)) >> 5u);
}

// How a photon starts by its number, and by how much rarer it would start so were it not for the guide.
fn guided(number: u32) -> Guided {
    var start = start_of(number);
    start.source = shaken(start.source, number, 1u);
    start.first = vec2u(shaken(start.first.x, number, 2u), shaken(start.first.y, number, 3u));
    start.second = vec2u(shaken(start.second.x, number, 4u), shaken(start.second.y, number, 5u));
    let source = warped(0u, PARTS, start.source);
    let grids = PARTS + (source.place >> 29u) * 2u * GRID_WORDS;
    var found: Guided;
    found.start.source = source.place;
    found.density = source.density;
    for (var grid = 0u; grid < 2u; grid++) {
        let pair = select(start.second, start.first, grid == 0u);
        let row = warped(grids + grid * GRID_WORDS, CELLS, pair.x);
        let column = warped(grids + grid * GRID_WORDS + CELLS * (1u + (row.place >> 27u)), CELLS, pair.y);
        let place = vec2u(row.place, column.place);
        if grid == 0u {
            found.start.first = place;
        } else {
            found.start.second = place;
        }
        found.density *= row.density * column.density;
    }
    return found;
}
