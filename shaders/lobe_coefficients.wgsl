#import lib/lobe
#import lib/frame

// Lobes, times the cosine, on harmonics over a grid of outgoing directions: math::harmonics::reflection has the twin. Lobes that are alike around the normal are
// projected once a height, then turned.

// A lobe, its first outgoing direction in the list of all, its points in that of theirs, none where directions are drawn, where its table begins and the order
// that this holds: device::Shape in passes/lobe_coefficients/device.rs.
struct Shape {
    kind: u32,
    first: u32,
    alpha: vec2f,
    first_point: u32,
    points: u32,
    table: u32,
    order: u32,
}

@group(0) @binding(0) var<storage, read> shapes: array<Shape>;
// Outgoing directions, and the shape that is projected.
@group(0) @binding(1) var<storage, read> outgoing: array<vec4f>;
// Directions over the hemisphere, and what each stands for.
@group(0) @binding(6) var<storage, read> points: array<vec4f>;
// How the value of degree l and order m follows from those of the two degrees before, at l · ORDER + m.
@group(0) @binding(2) var<storage, read> steps: array<vec2f>;
// The value of degree m and order m without the power of the sine.
@group(0) @binding(3) var<storage, read> starts: array<f32>;
// Of each outgoing direction and slice of the points both parts, QUADS fours each.
@group(0) @binding(4) var<storage, read_write> projected: array<f32>;
@group(0) @binding(5) var<storage, read_write> values: array<vec4f>;

// The highest order, and the fours of numbers that it takes.
override ORDER: u32 = 10u;
override QUADS: u32 = 25u;
// Whether terms of high degree are faded out.
override HANN: bool = false;
override GRID: u32 = 32u;
override SPHERICAL: bool = false;
// Steps from the normal to the horizon.
override HEIGHTS: u32 = 96u;
// Parts that the points are visited in: some drivers end loops of more rounds than 16 bits count.
override SLICES: u32 = 1u;

const PARTS = 2u;
const LANES = 64u;
const MOST_ORDER = 20;
// Directions along both axes of the numbers that they are drawn by.
const DRAWN = 64u;
// What the lowest direction of the grid has for a height.
const LEAST_HEIGHT = 1e-3;

// Of some of a lobe's points: where the harmonics are looked up (distance from the axis, azimuth, height), and what they are multiplied by.
var<workgroup> places: array<vec3f, LANES>;
var<workgroup> factors: array<vec2f, LANES>;
var<workgroup> points_of_shape: u32;

// An incoming direction and what it stands for; 0 where nothing comes from.
fn point_of(shape: Shape, at: u32, toward: vec3f) -> vec4f {
    if shape.points > 0u {
        return select(vec4f(0.0), points[shape.first_point + min(at, shape.points - 1u)], at < shape.points);
    }
    let white = Lobe(shape.kind, shape.alpha, vec3f(1.0));
    let incoming = lobe_sample(white, toward, (vec2f(f32(at / DRAWN), f32(at % DRAWN)) + 0.5) / f32(DRAWN));
    let density = lobe_density(white, toward, incoming) * f32(DRAWN * DRAWN);
    return vec4f(incoming, select(0.0, 1.0 / max(density, 1e-37), density > 0.0));
}

fn visit(lane: u32, at: u32, shape: Shape, toward: vec3f) {
    let point = point_of(shape, at, toward);
    places[lane] = vec3f(0.0);
    factors[lane] = vec2f(0.0);
    if point.z <= 0.0 || point.w <= 0.0 {
        return;
    }
    // Of no reflectance is left what rises toward grazing angles alone.
    let rise = lobe_value(Lobe(shape.kind, shape.alpha, vec3f(0.0)), toward, point.xyz).x;
    let all = lobe_value(Lobe(shape.kind, shape.alpha, vec3f(1.0)), toward, point.xyz).x;
    factors[lane] = vec2f(all - rise, rise) * (point.z * point.w);
    // The stretch of the hemisphere over the sphere.
    let stretch = select(2.0 * sqrt(point.z / (1.0 + point.z)), 1.0, SPHERICAL);
    let height = select(2.0 * point.z - 1.0, point.z, SPHERICAL);
    places[lane] = vec3f(length(point.xy) * stretch, atan2(point.y, point.x), height);
}

// One outgoing direction and slice: lanes visit points in turn, then each adds up what all of them are for one order m.
@compute @workgroup_size(64)
fn project(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let item = group.x + group.y * groups.x;
    let entry = item / SLICES;
    let m = i32(lane) - i32(ORDER) + 1;
    let order = u32(abs(m));
    let is_used = lane < 2u * ORDER - 1u;
    let scale = select(select(2.0, sqrt(2.0), m == 0), select(sqrt(2.0), 1.0, m == 0), SPHERICAL);
    let toward = outgoing[min(entry, arrayLength(&outgoing) - 1u)];
    var sums: array<vec2f, MOST_ORDER>;
    if lane == 0u {
        let points = shapes[u32(toward.w)].points;
        points_of_shape = select(points, DRAWN * DRAWN, points == 0u);
    }
    let shape = shapes[u32(toward.w)];
    // The same for all lanes, which the barriers ask for.
    let count = workgroupUniformLoad(&points_of_shape);
    let size = (count / SLICES / LANES + 1u) * LANES;
    let start = item % SLICES * size;
    for (var first = start; first < min(count, start + size); first += LANES) {
        visit(lane, first + lane, shape, toward.xyz);
        workgroupBarrier();
        for (var i = 0u; i < select(0u, LANES, is_used); i++) {
            let place = places[i];
            let angle = f32(order) * place.y;
            let around = pow(max(place.x, 1e-10), f32(order)) * select(sin(angle), cos(angle), m >= 0);
            let factor = factors[i] * (around * scale);
            var before = 0.0;
            var now = starts[order];
            for (var l = order; l < shape.order; l++) {
                if l > order {
                    let step = steps[l * ORDER + order];
                    let next = step.x * (place.z * now - step.y * before);
                    before = now;
                    now = next;
                }
                sums[l] += factor * now;
            }
        }
        workgroupBarrier();
    }
    let room = 4u * QUADS;
    if is_used && entry < arrayLength(&outgoing) {
        for (var l = order; l < shape.order; l++) {
            let at = item * PARTS * room + u32(i32(l * l + l) + m);
            let sum = sums[l] * window(l, shape.order);
            projected[at] = sum.x;
            projected[at + room] = sum.y;
        }
    }
}

// What is left of terms of degree l, as math::harmonics::reflection::Window has it.
fn window(l: u32, order: u32) -> f32 {
    return select(1.0, 0.5 * (1.0 + cos(PI * f32(l) / f32(order))), HANN);
}

// As math::harmonics::reflection::direction_at.
fn direction_at(place: vec2f) -> vec3f {
    let at = 2.0 * place - 1.0;
    let squared = dot(at, at);
    if squared > (1.0 - LEAST_HEIGHT) / (1.0 + LEAST_HEIGHT) {
        return vec3f(normalize(at) * sqrt(1.0 - LEAST_HEIGHT * LEAST_HEIGHT), LEAST_HEIGHT);
    }
    return vec3f(2.0 * at, 1.0 - squared) / (1.0 + squared);
}

// Four coefficients of one part toward one direction of the grid.
@compute @workgroup_size(64)
fn lay_out(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let at = (group.x + group.y * groups.x) * LANES + lane;
    if at >= arrayLength(&shapes) * GRID * GRID * PARTS * QUADS {
        return;
    }
    let quad = at % QUADS;
    let part = at / QUADS % PARTS;
    let direction = at / (QUADS * PARTS) % (GRID * GRID);
    let shape = shapes[at / (QUADS * PARTS * GRID * GRID)];
    let functions = shape.order * shape.order;
    let quads = (functions + 3u) / 4u;
    if quad >= quads {
        return;
    }
    let place = shape.table + (direction * PARTS + part) * quads + quad;
    var four = vec4f(0.0);
    if shape.kind == WARD && shape.alpha.x != shape.alpha.y {
        for (var i = 0u; i < min(4u, functions - 4u * quad); i++) {
            four[i] = coefficient(shape.first + direction, part, 4u * quad + i);
        }
        values[place] = four;
        return;
    }
    let toward = direction_at((vec2f(f32(direction % GRID), f32(direction / GRID)) + 0.5) / f32(GRID));
    let height = atan2(length(toward.xy), toward.z) / (0.5 * PI) * f32(HEIGHTS);
    let base = min(u32(height), HEIGHTS - 1u);
    let share = height - f32(base);
    let azimuth = atan2(toward.y, toward.x);
    for (var i = 0u; i < min(4u, functions - 4u * quad); i++) {
        four[i] = turned_coefficient(shape.first + base, share, part, 4u * quad + i, azimuth);
    }
    values[place] = four;
}

fn coefficient(entry: u32, part: u32, index: u32) -> f32 {
    var sum = 0.0;
    for (var slice = 0u; slice < SLICES; slice++) {
        sum += projected[((entry * SLICES + slice) * PARTS + part) * 4u * QUADS + index];
    }
    return sum;
}

// Between two heights, turned around the normal.
fn turned_coefficient(entry: u32, share: f32, part: u32, index: u32, azimuth: f32) -> f32 {
    var l = u32(sqrt(f32(index)));
    l = select(l, l - 1u, l * l > index);
    l = select(l, l + 1u, (l + 1u) * (l + 1u) <= index);
    let m = i32(index) - i32(l * l + l);
    let twin = u32(i32(l * l + l) - m);
    let own = mix(coefficient(entry, part, index), coefficient(entry + 1u, part, index), share);
    let other = mix(coefficient(entry, part, twin), coefficient(entry + 1u, part, twin), share);
    let angle = f32(abs(m)) * azimuth;
    return own * cos(angle) + other * select(sin(angle), -sin(angle), m > 0);
}
