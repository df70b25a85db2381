#import lib/camera
#import lib/frame
#import lib/lobe_table

// Light of the sky that visible surfaces reflect, as if nothing stood in its way: the sky's expansion in spherical harmonics, turned into the frame of each
// surface, times what the surface takes of it. Degrees are turned apart: by a quarter turn around x and back between turns around z.

@group(0) @binding(0) var position: texture_2d<f32>;
@group(0) @binding(1) var normal: texture_2d<f32>;
@group(0) @binding(2) var reflectance: texture_2d<f32>;
// Reflectance of the lobe; its table, and as the fraction the azimuth of its first axis, or −1 where there is no lobe.
@group(0) @binding(3) var seen: texture_2d<f32>;
@group(0) @binding(4) var radiance: texture_storage_2d<rgba32float, write>;
// The sky's expansion in red, green and blue; its pole is up, y.
@group(0) @binding(5) var<storage, read> sky: array<vec4f>;
// Of each degree the coefficient of the cosine above the horizon; the others are 0.
@group(0) @binding(6) var<storage, read> cosine_lobe: array<f32>;
// The matrices of a quarter turn around x, one after the other.
@group(0) @binding(7) var<storage, read> quarter_turns: array<f32>;
// What the host found in its stead, where it turned the sky.
@group(0) @binding(8) var<storage, read> irradiance: array<vec4f>;
@group(0) @binding(9) var<storage, read> glossy: array<vec4f>;

override ORDER: u32 = 10u;
// Whether any surface has a lobe.
override GLOSSY: bool = true;
// Whether any lobe rises toward grazing angles.
override RISE: bool = true;

const PI = 3.14159265358979;
const MOST_ORDER = 20;
const MOST_BAND = 39;

// Of one degree the coefficients, −l to l, and room for what becomes of them.
var<private> band: array<vec3f, MOST_BAND>;
var<private> turned: array<vec3f, MOST_BAND>;

// Cosine and sine of the multiples of an angle.
alias Multiples = array<vec2f, MOST_ORDER>;

fn multiples_of(turn: vec2f) -> Multiples {
    var multiples: Multiples;
    multiples[0] = vec2f(1.0, 0.0);
    for (var m = 1u; m < ORDER; m++) {
        let before = multiples[m - 1u];
        multiples[m] = vec2f(before.x * turn.x - before.y * turn.y, before.x * turn.y + before.y * turn.x);
    }
    return multiples;
}

// Turns the band around z by minus the angle.
fn turn_back(l: i32, angle: ptr<function, Multiples>) {
    for (var m = 1; m <= l; m++) {
        let turn = (*angle)[m];
        let cosines = band[l + m];
        let sines = band[l - m];
        band[l + m] = cosines * turn.x + sines * turn.y;
        band[l - m] = sines * turn.x - cosines * turn.y;
    }
}

// A quarter turn of the band around x, or the one back. Three quarters of the matrix are 0: of a row only columns of one sign count, every second of them.
fn quarter_turn(l: i32, is_back: bool) {
    let width = 2 * l + 1;
    let first = l * (2 * l - 1) * width / 3;
    for (var row = -l; row <= l; row++) {
        let sign = select(-1, 1, ((l + row) & 1) == 0);
        let parity = (l + select(0, 1, row < 0)) & 1;
        var sum = vec3f(0.0);
        for (var size = select(parity, 2 - parity, sign < 0); size <= l; size += 2) {
            let column = sign * size;
            let at = select((row + l) * width + column + l, (column + l) * width + row + l, is_back);
            sum += quarter_turns[first + at] * band[column + l];
        }
        turned[row + l] = sum;
    }
    for (var i = 0; i < width; i++) {
        band[i] = turned[i];
    }
}

// Cosines and sines of the angles around z, y and z, in this order from right to left, that take the axes of directions to those of a frame.
struct Euler {
    last: vec2f,
    middle: vec2f,
    first: vec2f,
}

fn euler_of(tangent: vec3f, normal: vec3f) -> Euler {
    let flat = length(normal.xy);
    let last = select(vec2f(1.0, 0.0), normal.xy / max(flat, 1e-30), flat > 1e-6);
    // Where x and y come to lie by the other two: the tangent stands between them.
    let x = vec3f(last * normal.z, -flat);
    let first = vec2f(dot(tangent, x), dot(tangent.xy, vec2f(-last.y, last.x)));
    return Euler(last, vec2f(normal.z, flat), normalize(first));
}

// The pole of the sky's expansion is up.
fn around_up(direction: vec3f) -> vec3f {
    return direction.zxy;
}

@compute @workgroup_size(8, 8)
fn shade(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(radiance)) {
        return;
    }
    let place = textureLoad(position, id.xy, 0);
    if place.w == 0.0 {
        textureStore(radiance, id.xy, vec4f(0.0));
        return;
    }
    let facing = textureLoad(normal, id.xy, 0).xyz;
    var lobe = vec4f(0.0, 0.0, 0.0, -1.0);
    var at: Corners;
    var axes = frame_around(facing, 0.0);
    if GLOSSY {
        lobe = textureLoad(seen, id.xy, 0);
        axes = frame_around(facing, fract(lobe.w) * 2.0 * PI);
        at = corners_of(u32(max(lobe.w, 0.0)), normalize(camera.eye - place.xyz) * axes);
    }
    let euler = euler_of(around_up(axes[0]), around_up(facing));
    var last = multiples_of(euler.last);
    var middle = multiples_of(euler.middle);
    var first = multiples_of(euler.first);
    var arriving = vec3f(0.0);
    var flat = vec3f(0.0);
    var rise = vec3f(0.0);
    for (var l = 0; l < i32(ORDER); l++) {
        for (var i = 0; i <= 2 * l; i++) {
            band[i] = sky[l * l + i].xyz;
        }
        turn_back(l, &last);
        quarter_turn(l, false);
        turn_back(l, &middle);
        quarter_turn(l, true);
        arriving += cosine_lobe[l] * band[l];
        if GLOSSY && lobe.w >= 0.0 {
            turn_back(l, &first);
            for (var i = 0; i <= 2 * l; i++) {
                let index = u32(l * l + i);
                flat += four(at, 0u, index / 4u)[index % 4u] * band[i];
                if RISE {
                    rise += four(at, 1u, index / 4u)[index % 4u] * band[i];
                }
            }
        }
    }
    store_light(id.xy, arriving, lobe.rgb * flat + rise);
}

// What the sum makes negative, as sharp things ring, is no light.
fn store_light(pixel: vec2u, arriving: vec3f, reflected: vec3f) {
    let diffuse = textureLoad(reflectance, pixel, 0).rgb / PI * max(arriving, vec3f(0.0));
    textureStore(radiance, pixel, vec4f(diffuse + max(reflected, vec3f(0.0)), 1.0));
}

// Puts the host's sums together.
@compute @workgroup_size(8, 8)
fn store(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(radiance)) {
        return;
    }
    let at = id.y * textureDimensions(radiance).x + id.x;
    store_light(id.xy, irradiance[at].rgb, glossy[at].rgb);
}
