#import lib/camera
#import lib/search
#import lib/variables

// What passes/find_misses/grid.rs does between two rounds, where the device drives the loop: counts what was found and goes on to the next cells.

@group(0) @binding(0) var<storage, read_write> next: Round;
// As the search leaves them.
@group(0) @binding(1) var<storage, read> counts: array<u32, 5>;

// Of the picture [pixels].
override WIDTH: u32 = 1u;
override HEIGHT: u32 = 1u;
// Cells up to this edge take one lane each.
override SMALL: u32 = 1u;
override FINEST: u32 = 1u;
// Whether the cache has the records of earlier samples of a picture.
override LASTS: bool = true;
override MOST_REQUESTS: u32 = 1u;
override MOST_MADE: u32 = 1u;
override MOST_RECORDS: u32 = 1u;
override STALLED_ROUNDS: u32 = 1u;
// Codes of shortfalls.
override NO_PROGRESS: u32 = 0u;
override CACHE_FULL: u32 = 0u;
override FRAME_LIMIT: u32 = 0u;
// Where variables stand.
override COUNT: u32 = 0u;
override MADE: u32 = 0u;
override RECORDS: u32 = 0u;
override NONE: u32 = 0u;
override STALLED: u32 = 0u;
override CELL: u32 = 0u;
override PHASE: u32 = 0u;
override IDLE: u32 = 0u;
override LOOKS_OVER: u32 = 0u;
override LANES: u32 = 0u;
override BLOCKS: u32 = 0u;
override ALL_BLOCKS: u32 = 0u;

fn count_stalled() {
    let asked = variables[COUNT];
    if asked > 0u {
        variables[STALLED] = select(0u, variables[STALLED] + 1u, counts[3] >= asked);
    }
}

// Tells why the loop ends, if this search ends it.
fn fall_short(because: u32) {
    if NONE == variables[UNTIL] {
        variables[SHORTFALL] = because;
    }
}

// How many more records there may be. Without room the loop must end.
fn room() -> u32 {
    let unasked = MOST_MADE - min(MOST_MADE, variables[MADE]);
    let free = MOST_RECORDS - min(MOST_RECORDS, variables[RECORDS]);
    if variables[IS_LAST_ROUND] != 0u {
        return 0u;
    }
    if variables[STALLED] >= STALLED_ROUNDS {
        fall_short(NO_PROGRESS);
        return 0u;
    }
    if free == 0u {
        fall_short(CACHE_FULL);
    } else if unasked == 0u {
        fall_short(FRAME_LIMIT);
    }
    return min(unasked, free);
}

// The block from which on the next round looks.
fn start_of_next() -> u32 {
    // What did not fit into the batch is looked for again, among what the batch leaves uncovered.
    if counts[1] > MOST_REQUESTS {
        return counts[2];
    }
    let phase = variables[PHASE] + 1u;
    variables[PHASE] = phase % 4u;
    if phase == 4u {
        if variables[CELL] != FINEST {
            variables[CELL] /= 2u;
        } else if FINEST > 1u {
            variables[NONE] = 1u;
        }
    }
    return 0u;
}

@compute @workgroup_size(1)
fn advance() {
    count_stalled();
    // A part of a pixel farther only slivers are seen for the first time, for which the rays of a later search's records are enough.
    var most = 0u;
    if FINEST == 1u || !LASTS || camera.sample == 0u {
        most = room();
    }
    let requests = min(counts[0], most);
    variables[COUNT] = requests;
    variables[MADE] += requests;
    variables[IDLE] = select(0u, variables[IDLE] + 1u, variables[CELL] == FINEST && counts[1] == 0u);
    variables[NONE] = u32(variables[IDLE] == 4u || most == 0u || counts[4] == 0u);
    variables[LOOKS_OVER] = 0u;
    let start = start_of_next();
    let cell = variables[CELL];
    next = Round(cell, variables[PHASE], MOST_REQUESTS, start);
    let blocks = ((WIDTH + 2u * cell - 1u) / (2u * cell)) * ((HEIGHT + 2u * cell - 1u) / (2u * cell));
    variables[LANES] = select(0u, blocks, cell <= SMALL);
    variables[BLOCKS] = select(blocks, 0u, cell <= SMALL);
    variables[ALL_BLOCKS] = blocks;
}
