#import lib/variables

// A loop that the device drives: rounds are encoded ahead, and those after its end do nothing.

struct Rounds {
    // Where the variable stands that ends the loop, and the one that counts its rounds.
    until: u32,
    round: u32,
    at_most: u32,
    // Sizes to compute.
    sizes: u32,
    variables: u32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
}

// What a dispatch or a draw is sized by.
struct Sizing {
    groups: vec3u,
    // Where the variable stands that counts, or UNCOUNTED.
    count: u32,
    divisor: u32,
    per: u32,
    // Of a draw; 0 for a dispatch.
    vertices: u32,
    padding: u32,
}

@group(0) @binding(0) var<uniform> rounds: Rounds;
@group(0) @binding(1) var<storage, read> sized_by: array<Sizing>;
// Workgroups, or vertices and instances.
@group(0) @binding(2) var<storage, read_write> sizes: array<vec4u>;

const UNCOUNTED = 0xffffffffu;
// Most workgroups along an edge of a dispatch, everywhere.
const MOST_GROUPS = 65535u;

// Opens the loop.
@compute @workgroup_size(1)
fn open() {
    if variables[HELD] == 0u {
        variables[ROUNDS] = 0u;
        variables[IS_OVER] = 0u;
        variables[IS_LAST_ROUND] = 0u;
        variables[SHORTFALL] = 0u;
    }
}

// Closes a loop that the host does not look at: unless it is done, nothing is done any more.
@compute @workgroup_size(1)
fn close() {
    if variables[HELD] == 0u && (variables[IS_OVER] == 0u || variables[IS_LAST_ROUND] != 0u || variables[SHORTFALL] != 0u) {
        variables[HELD] = 1u;
    }
}

// Begins a round, unless the loop has ended.
@compute @workgroup_size(1)
fn begin() {
    if variables[HELD] != 0u {
        return;
    }
    variables[UNTIL] = rounds.until;
    let is_over = variables[rounds.until] != 0u || variables[ROUNDS] == rounds.at_most;
    variables[IS_OVER] = u32(is_over);
    if !is_over {
        variables[rounds.round] = variables[ROUNDS];
        variables[ROUNDS] += 1u;
        variables[IS_LAST_ROUND] = u32(variables[ROUNDS] == rounds.at_most);
    }
}

fn size_of(sizing: Sizing) -> vec4u {
    if sizing.count == UNCOUNTED {
        return vec4u(sizing.groups, 0u);
    }
    let count = variables[sizing.count];
    if sizing.vertices > 0u {
        return vec4u(sizing.vertices, count, 0u, 0u);
    }
    let groups = (count + sizing.divisor - 1u) / sizing.divisor * sizing.per;
    return vec4u(min(groups, MOST_GROUPS), (groups + MOST_GROUPS - 1u) / MOST_GROUPS, 1u, 0u);
}

// Sizes all of a round anew as variables are now, and keeps what those are that are not 0. One workgroup.
@compute @workgroup_size(64)
fn size(@builtin(local_invocation_index) lane: u32) {
    if variables[IS_OVER] != 0u || variables[HELD] != 0u {
        if lane < rounds.sizes {
            sizes[lane] = vec4u(0u);
        }
        return;
    }
    if lane < rounds.sizes {
        sizes[lane] = size_of(sized_by[lane]);
    }
    for (var at = VARIABLES_BEFORE + lane; at < VARIABLES_BEFORE + rounds.variables; at += 64u) {
        if variables[at] != 0u {
            variables[at + rounds.variables] = variables[at];
        }
    }
}
