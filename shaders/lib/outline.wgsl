// The area that points in a disc stand for: as math::outline.

const DIRECTIONS = 32u;
const FEWEST = 10u;
const DEVIATIONS = 2.5;
const LEAST_SHARE = 0.01;
const WIDER = 1.25;
const GOLDEN_ANGLE = 2.3999632;

var<private> outline_most: array<f32, DIRECTIONS>;
var<private> outline_farthest: array<vec2f, DIRECTIONS>;
var<private> outline_count: u32;

fn begin_outline() {
    for (var number = 0u; number < DIRECTIONS; number++) {
        outline_most[number] = -1e38;
        outline_farthest[number] = vec2f(0.0);
    }
    outline_count = 0u;
}

fn add_to_outline(at: vec2f) {
    outline_count += 1u;
    for (var number = 0u; number < DIRECTIONS; number++) {
        let angle = 6.2831853072 * f32(number) / f32(DIRECTIONS);
        let along = dot(at, vec2f(cos(angle), sin(angle)));
        if along > outline_most[number] {
            outline_most[number] = along;
            outline_farthest[number] = at;
        }
    }
}

fn crossed(a: vec2f, b: vec2f) -> f32 {
    return a.x * b.y - a.y * b.x;
}

fn next_of_outline(number: u32) -> vec2f {
    return outline_farthest[(number + 1u) % DIRECTIONS];
}

fn outline_area() -> f32 {
    var sum = 0.0;
    for (var number = 0u; number < DIRECTIONS; number++) {
        sum += crossed(outline_farthest[number], next_of_outline(number));
    }
    return sum * 0.5;
}

fn expected_share(count: f32) -> f32 {
    let s = count + 0.81319;
    let root = pow(s, -2.0 / 3.0);
    return 1.0 - 3.38323 * root * (1.0 - 0.72365 * root - 0.13495 / s);
}

fn is_disc(radius: f32) -> bool {
    let whole = expected_share(f32(outline_count)) - DEVIATIONS * 1.1 * pow(f32(max(outline_count, 1u)), -0.82);
    return outline_count < FEWEST || outline_area() >= whole * 3.14159265 * radius * radius;
}

fn outline_stands_for(radius: f32) -> f32 {
    let disc = 3.14159265 * radius * radius;
    if is_disc(radius) {
        return disc;
    }
    var corners = 0u;
    for (var number = 0u; number < DIRECTIONS; number++) {
        corners += select(0u, 1u, any(outline_farthest[number] != next_of_outline(number)));
    }
    let inside = outline_count - corners;
    return clamp(outline_area() * f32(outline_count + 1u) / f32(inside + 1u), LEAST_SHARE * disc, disc);
}

// The region that is looked at: its middle, its area, and whether it is the disc.
struct Region {
    middle: vec2f,
    area: f32,
    is_disc: bool,
}

fn region_corner(region: Region, number: u32) -> vec2f {
    return region.middle + (outline_farthest[number] - region.middle) * WIDER;
}

// Twice the area of a triangle around the first corner.
fn region_part(region: Region, number: u32) -> f32 {
    let first = region_corner(region, 0u);
    return max(crossed(region_corner(region, number) - first, region_corner(region, number + 1u) - first), 0.0);
}

fn outline_region(radius: f32) -> Region {
    if is_disc(radius) {
        return Region(vec2f(0.0), 3.14159265 * radius * radius, true);
    }
    var region = Region(vec2f(0.0), 0.0, false);
    for (var number = 0u; number < DIRECTIONS; number++) {
        region.middle += outline_farthest[number] / f32(DIRECTIONS);
    }
    for (var number = 1u; number < DIRECTIONS - 1u; number++) {
        region.area += 0.5 * region_part(region, number);
    }
    return region;
}

// One of `count` points that fill a region evenly.
fn region_point(region: Region, radius: f32, at: u32, count: u32) -> vec2f {
    let share = (f32(at) + 0.5) / f32(count);
    if region.is_disc {
        let angle = GOLDEN_ANGLE * f32(at);
        return vec2f(cos(angle), sin(angle)) * (radius * sqrt(share));
    }
    let chosen = share * 2.0 * region.area;
    var number = 1u;
    var sum = region_part(region, 1u);
    while number < DIRECTIONS - 2u && sum <= chosen {
        number += 1u;
        sum += region_part(region, number);
    }
    let u = fract(vec2f(0.7548777, 0.5698403) * f32(at) + 0.5);
    let root = sqrt(u.x);
    let first = region_corner(region, 0u);
    let a = region_corner(region, number) - first;
    let b = region_corner(region, number + 1u) - first;
    return first + a * (root * (1.0 - u.y)) + b * (root * u.y);
}
