#import lib/colour
#import lib/group_sum
#import lib/lightmap
#import lib/random
#import lib/record
#import lib/scene

// Texels that send their light out, chosen by chance: as passes/choose_texel.rs.

struct Pick {
    place: u32,
    number: u32,
    total: u32,
    padding: u32,
}

struct Iteration {
    // Of its numbers.
    seed: u32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
}

@group(0) @binding(0) var<storage, read> surfaces: array<TexelSurface>;
@group(0) @binding(1) var<storage, read> direct: array<vec4f>;
// Indirect irradiance that the texels send out.
@group(0) @binding(2) var<storage, read> light: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> weights: array<f32>;
// Of the weights of each group; then the scale.
@group(0) @binding(4) var<storage, read_write> sums: array<f32>;
// What places count, and levels of sums of four behind them.
@group(0) @binding(5) var<storage, read_write> numbers: array<u32>;
@group(0) @binding(6) var<uniform> iteration: Iteration;
@group(0) @binding(7) var<storage, read_write> requests: array<Request>;
@group(0) @binding(8) var<storage, read_write> shots: array<Shot>;
@group(0) @binding(9) var<storage, read> picks: array<Pick>;

override SIDES: u32 = 1u;
override PLACES: u32 = 256u;
override SHOOTERS: u32 = 1u;
override NEAREST: f32 = 1.0;
override ROOT: bool = false;
// Of a step up: where numbers start, how many they are, and how many they become.
override START: u32 = 0u;
override BELOW: u32 = 1u;
override ABOVE: u32 = 1u;
// Above the places.
override LEVELS: u32 = 0u;

fn radiance_of(place: u32) -> vec3f {
    return radiance_of_texel(direct[place], light[place]);
}

@compute @workgroup_size(256)
fn weigh(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let number = group.x + group.y * groups.x;
    let place = number * GROUP + lane;
    var weight = 0.0;
    if place < PLACES {
        weight = favour(luminance(radiance_of(place)), ROOT) * surfaces[place / SIDES].area;
        weights[place] = weight;
    }
    let sum = sum_of_lanes(lane, vec2f(weight, 0.0)).x;
    if lane == 0u && number * GROUP < PLACES {
        sums[number] = sum;
    }
}

// One group.
@compute @workgroup_size(256)
fn scale(@builtin(local_invocation_index) lane: u32) {
    let count = (PLACES + GROUP - 1u) / GROUP;
    var own = 0.0;
    for (var at = lane; at < count; at += GROUP) {
        own += sums[at];
    }
    let sum = sum_of_lanes(lane, vec2f(own, 0.0)).x;
    if lane == 0u {
        sums[count] = select(0.0, exp2(29.0 - floor(log2(max(sum, 1e-37)))), sum > 0.0);
    }
}

@compute @workgroup_size(256)
fn count(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = (group.x + group.y * groups.x) * GROUP + lane;
    if place < PLACES {
        let weight = weights[place];
        numbers[place] = select(0u, max(u32(weight * sums[(PLACES + GROUP - 1u) / GROUP]), 1u), weight > 0.0);
    }
    if place == PLACES - 1u {
        // Sums of all before have one more.
        numbers[PLACES] = 0u;
    }
}

@compute @workgroup_size(256)
fn add_four(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let at = (group.x + group.y * groups.x) * GROUP + lane;
    if at < ABOVE {
        var sum = 0u;
        for (var child = 4u * at; child < min(4u * at + 4u, BELOW); child++) {
            sum += numbers[START + child];
        }
        numbers[START + BELOW + at] = sum;
    }
}

// The upper half of a product.
fn product_above(a: u32, b: u32) -> u32 {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let first = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let second = (a & 0xffffu) * (b >> 16u) + (first & 0xffffu);
    return (a >> 16u) * (b >> 16u) + (first >> 16u) + (second >> 16u);
}

// A whole number below `total` by chance, from one of equal parts.
fn number_in(part: u32, total: u32) -> u32 {
    let each = total / SHOOTERS;
    let rest = total % SHOOTERS;
    let width = each + select(0u, 1u, part < rest);
    return part * each + min(part, rest) + product_above(combine(iteration.seed, part), width);
}

fn send(shooter: u32, place: u32, number: u32, total: u32) {
    var request: Request;
    var shot: Shot;
    if number > 0u {
        let surface = surfaces[place / SIDES];
        let stands_for = surface.area * (f32(total) / f32(number));
        request.position = surface.position;
        let plane = cross(scene_corners[3u * surface.triangle + 1u].xyz, scene_corners[3u * surface.triangle + 2u].xyz);
        request.normal = plane * (select(1.0, -1.0, place % SIDES == 1u) / max(length(plane), 1e-37));
        request.footprint = sqrt(surface.area);
        let nearest = max(stands_for * NEAREST, surface.area * NEAREST_TEXEL);
        shot = Shot(surface.position, nearest, request.normal, stands_for, radiance_of(place) * (stands_for / f32(SHOOTERS)), 0u);
    }
    requests[shooter] = request;
    shots[shooter] = shot;
}

// Where the sums of a level start.
fn level_start(level: u32) -> u32 {
    var start = 0u;
    var size = PLACES;
    for (var below = 0u; below < level; below++) {
        start += size;
        size = (size + 3u) / 4u;
    }
    return start;
}

// Down a tree of sums, each time to the one of four that holds the number.
@compute @workgroup_size(256)
fn descend(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let shooter = group.x * GROUP + lane;
    if shooter >= SHOOTERS {
        return;
    }
    let total = numbers[level_start(LEVELS)];
    var rest = number_in(shooter, total);
    var place = 0u;
    for (var above = LEVELS; above > 0u; above--) {
        let start = level_start(above - 1u);
        place *= 4u;
        for (var child = 0u; child < 3u; child++) {
            let number = numbers[start + place];
            if rest < number {
                break;
            }
            rest -= number;
            place += 1u;
        }
    }
    send(shooter, place, select(numbers[place], 0u, total == 0u), total);
}

// Among sums of all before each place.
@compute @workgroup_size(256)
fn search(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let shooter = group.x * GROUP + lane;
    if shooter >= SHOOTERS {
        return;
    }
    let total = numbers[PLACES];
    let at = number_in(shooter, total);
    var low = 0u;
    var high = PLACES;
    // The last place whose sum before it is not above the number.
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if numbers[middle] <= at {
            low = middle;
        } else {
            high = middle;
        }
    }
    send(shooter, low, select(numbers[low + 1u] - numbers[low], 0u, total == 0u), total);
}

// What the host has found.
@compute @workgroup_size(256)
fn take(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let shooter = group.x * GROUP + lane;
    if shooter < SHOOTERS {
        let pick = picks[shooter];
        send(shooter, pick.place, pick.number, pick.total);
    }
}
