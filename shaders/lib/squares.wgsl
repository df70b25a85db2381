#import lib/tile

// Strata of tiles that are squares of the square which is mapped to the disc under the hemisphere: as math::hemisphere::concentric.

// The square that holds a direction, by its x and y.
fn square_of(aside: vec2f) -> u32 {
    let turned = abs(aside.x) < abs(aside.y);
    let ways = select(aside, vec2f(aside.y, -aside.x), turned);
    let a = min(length(aside), 1.0) * select(1.0, -1.0, ways.x < 0.0);
    var b = 0.0;
    if ways.x != 0.0 {
        b = a * atan(ways.y / ways.x) / QUARTER_PI;
    }
    let at = select(vec2f(a, b), vec2f(-b, a), turned);
    let square = min(vec2u(max((at + 1.0) * 0.5 * f32(TILE_WIDTH), vec2f(0.0))), vec2u(TILE_WIDTH - 1u));
    return square.y * TILE_WIDTH + square.x;
}

const QUARTER_PI = 0.78539816340;
const GOLDEN = 0.61803398875;
const SPREAD = vec2f(0.75487766625, 0.569840291);

// The direction of one of the rays of a square: as concentric::ray.
fn square_direction(square: u32, number: u32) -> vec3f {
    let corner = vec2f(vec2u(square % TILE_WIDTH, square / TILE_WIDTH));
    let within = fract((corner.yx + 0.5) * GOLDEN + f32(number) * SPREAD);
    let at = 2.0 * (corner + within) / f32(TILE_WIDTH) - 1.0;
    let turned = abs(at.x) < abs(at.y);
    let ways = select(at, vec2f(at.y, -at.x), turned);
    var aside = vec2f(0.0);
    if ways.x != 0.0 {
        let azimuth = QUARTER_PI * ways.y / ways.x;
        aside = ways.x * vec2f(cos(azimuth), sin(azimuth));
    }
    return vec3f(select(aside, vec2f(-aside.y, aside.x), turned), sqrt(max(1.0 - dot(aside, aside), 0.0)));
}

// Rays in lists: the square, and the number of the ray there.
const NUMBER_BITS = 8u;

fn listed_ray(square: u32, number: u32) -> u32 {
    return (square << NUMBER_BITS) | number;
}

fn square_of_listed(listed: u32) -> u32 {
    return listed >> NUMBER_BITS;
}

fn listed_direction(listed: u32) -> vec3f {
    return square_direction(square_of_listed(listed), listed & ((1u << NUMBER_BITS) - 1u));
}
