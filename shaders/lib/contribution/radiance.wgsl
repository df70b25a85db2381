#import lib/camera
#import lib/frame
#import lib/record
#import lib/lobe_table
#import COEFFICIENTS

// What a record of radiance adds to a pixel: the dot product of its coefficients with those of the lobe there. math::radiance has the twin.

// Reflectance of the lobe; its table, and as the fraction the azimuth of its first axis.
@group(0) @binding(18) var seen: texture_2d<f32>;

// Fours of numbers that an expansion of a record takes; that of a lobe may take less.
override QUADS: u32 = 25u;

// Of each record: red, green, blue, and their derivatives along both tangents.
const PLANES = 9u;
const TURN = 6.28318530718;

// The lobe's reflectance toward a direction, up to a factor.
fn albedo(at: Corners, reflectance: vec3f) -> vec3f {
    return reflectance * four(at, 0u, 0u).x + four(at, 1u, 0u).x;
}

// One coefficient of a part, of the lobe turned around the normal.
fn one_turned(at: Corners, part: u32, index: u32, angle: f32) -> f32 {
    var l = u32(sqrt(f32(index)));
    l = select(l, l - 1u, l * l > index);
    l = select(l, l + 1u, (l + 1u) * (l + 1u) <= index);
    let m = i32(index - l * l) - i32(l);
    let twin = u32(i32(l * l + l) - m);
    let own = four(at, part, index / 4u)[index % 4u];
    let other = four(at, part, twin / 4u)[twin % 4u];
    let turned = f32(abs(m)) * angle;
    return own * cos(turned) + other * select(sin(turned), -sin(turned), m > 0);
}

fn four_turned(at: Corners, part: u32, quad: u32, angle: f32) -> vec4f {
    if angle == 0.0 {
        return four(at, part, quad);
    }
    var value = vec4f(0.0);
    for (var i = 0u; i < 4u; i++) {
        if 4u * quad + i < at.order * at.order {
            value[i] = one_turned(at, part, 4u * quad + i, angle);
        }
    }
    return value;
}

fn turned_about(direction: vec3f, angle: f32) -> vec3f {
    let c = cos(angle);
    let s = sin(angle);
    return vec3f(direction.x * c - direction.y * s, direction.x * s + direction.y * c, direction.z);
}

// Azimuth of the lobe's first axis in the record's frame.
fn azimuth_in(frame: mat3x3f, facing: vec3f, azimuth: f32) -> f32 {
    if azimuth == 0.0 {
        return 0.0;
    }
    let own = frame_around(facing, 0.0);
    let axis = own[0] * cos(azimuth * TURN) + own[1] * sin(azimuth * TURN);
    return atan2(dot(axis, frame[1]), dot(axis, frame[0]));
}

// Weighted radiance toward the camera and weight at a pixel that sees `place`, whose fourth component is 0 where nothing is seen.
fn contribution(record: Record, index: u32, weighting: Weighting, place: vec4f, facing: vec3f, pixel: vec2u) -> vec4f {
    let weight = record_weight(record, weighting, place.xyz, facing);
    if place.w == 0.0 || weight <= 0.0 {
        return vec4f(0.0);
    }
    let lobe = textureLoad(seen, pixel, 0);
    let table = u32(lobe.w);
    let frame = frame_around(record.normal, 0.0);
    let angle = azimuth_in(frame, facing, fract(lobe.w));
    // The viewer is moved to where the record's own plane would mirror what the pixel's mirrors: nothing has to be rotated.
    let toward = normalize(camera.eye - place.xyz);
    let mirrored = 2.0 * dot(toward, facing) * facing - toward;
    let moved = transpose(frame) * (2.0 * dot(mirrored, record.normal) * record.normal - mirrored);
    let at = corners_of(table, turned_about(moved, -angle));
    let share = min(gradient_radius(record, weighting) / max(validity_radius(record, weighting), 1e-30), 1.0);
    let offset = (place.xyz - record.position) * share;
    let x = dot(offset, frame[0]);
    let y = dot(offset, frame[1]);
    var here: vec3f;
    var there: vec3f;
    var rise_here: vec3f;
    var rise_there: vec3f;
    let first = index * PLANES * QUADS;
    for (var quad = 0u; quad < at.quads; quad++) {
        let flat = four_turned(at, 0u, quad, angle);
        let rise = four_turned(at, 1u, quad, angle);
        for (var channel = 0u; channel < 3u; channel++) {
            let plane = first + channel * QUADS + quad;
            let arriving = coefficient_four(plane);
            let moved_by = coefficient_four(plane + 3u * QUADS) * x + coefficient_four(plane + 6u * QUADS) * y;
            here[channel] += dot(flat, arriving);
            rise_here[channel] += dot(rise, arriving);
            there[channel] += dot(flat, moved_by);
            rise_there[channel] += dot(rise, moved_by);
        }
    }
    let units = coefficient_units(record);
    let base = (here * lobe.rgb + rise_here) * units.x;
    let estimate = base + (there * lobe.rgb + rise_there) * units.y;
    // What the lobe of the pixel's own plane reflects in place of the record's.
    let level = vec3f(dot(toward, frame_around(facing, 0.0)[0]), dot(toward, frame_around(facing, 0.0)[1]), dot(toward, facing));
    let scale = albedo(corners_of(table, turned_about(level, -fract(lobe.w) * TURN)), lobe.rgb) / max(albedo(at, lobe.rgb), vec3f(1e-12));
    let bounded = select(base, clamp(estimate, base * LEAST_FALL, base * (1.0 + MOST_RISE)), base > vec3f(0.0));
    return vec4f(bounded * clamp(scale, vec3f(0.25), vec3f(4.0)), 1.0) * weight;
}
