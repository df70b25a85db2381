//! A castle on a hill: walls between round towers, a gatehouse, a keep, houses, and the land around.

use super::super::draft::Face;
use super::masonry::{Band, Frame, Mason, Opening, noise};
use glam::{DVec2, DVec3, dvec2};
use std::f64::consts::PI;

/// The fewest triangles that make a castle.
pub(in super::super) const MIN_CASTLE: usize = 10_000;
/// The materials of a castle, in the order of the numbers that [`castle`] takes.
pub(in super::super) const CASTLE_MATERIALS: [&str; 4] = ["stone", "roofs", "ground", "wood"];

/// How deep walls reach into the ground [m].
const FOOTING: f64 = -6.0;
/// Where guards walk, the top of the parapet over it, and half the thickness of walls [m].
const WALK: f64 = 8.5;
const PARAPET: f64 = 9.6;
const HALF_WALL: f64 = 1.3;
const PARAPET_THICKNESS: f64 = 0.7;
/// Half the side of the land, and how far the hill's foot lies below the yard [m].
const LAND: f64 = 170.0;
const DROP: f64 = 15.0;
/// The gate's half width and the height where its arch begins [m].
const GATE: f64 = 2.5;
const SPRINGING: f64 = 2.8;

/// A corner tower: where its middle stands, its radius, and the heights of its walls and of its roof above them [m].
struct Tower {
    at: DVec2,
    radius: f64,
    height: f64,
    roof: f64,
}

const fn tower(x: f64, z: f64, radius: f64, height: f64, roof: f64) -> Tower {
    Tower { at: dvec2(x, z), radius, height, roof }
}

/// Counter-clockwise seen from above, from the left end of the front; the gate is in the middle of the first wall.
const TOWERS: [Tower; 6] = [
    tower(-34.0, 30.0, 4.6, 16.0, 10.0),
    tower(34.0, 27.0, 5.0, 15.0, 10.5),
    tower(41.0, -12.0, 4.2, 16.5, 9.5),
    tower(17.0, -37.0, 4.8, 17.0, 11.0),
    tower(-22.0, -35.0, 4.2, 15.5, 9.5),
    tower(-41.0, -4.0, 5.2, 18.5, 12.0),
];

/// A house: the middle of its floor, how far it is turned [degrees], length, width, height of its walls, rise of its roof [m], and whether of wood.
struct House {
    at: DVec2,
    degrees: f64,
    size: [f64; 4],
    wooden: bool,
}

const fn house(x: f64, z: f64, degrees: f64, size: [f64; 4], wooden: bool) -> House {
    House { at: dvec2(x, z), degrees, size, wooden }
}

/// In the yard: hall, chapel, kitchen, stable, barn; and a village around.
const HOUSES: [House; 10] = [
    house(-22.5, -9.0, 72.0, [21.0, 9.5, 7.0, 6.5], false),
    house(25.5, 7.0, 80.0, [15.0, 7.5, 6.5, 7.0], false),
    house(-6.0, -28.0, 2.0, [13.0, 7.0, 4.5, 4.2], false),
    house(-18.5, 19.5, 4.0, [13.0, 6.5, 3.6, 3.6], true),
    house(26.0, -17.0, -35.0, [10.0, 6.0, 3.8, 3.6], true),
    house(-95.0, -62.0, 20.0, [9.0, 6.0, 2.8, 3.4], true),
    house(-82.0, -76.0, -30.0, [10.0, 6.0, 3.0, 3.6], false),
    house(-107.0, -47.0, 65.0, [8.5, 5.5, 2.7, 3.2], true),
    house(-70.0, -90.0, 10.0, [8.0, 5.5, 2.7, 3.2], true),
    house(-48.0, 69.0, -30.0, [9.0, 6.0, 2.8, 3.4], true),
];

#[derive(Debug, Clone, Copy)]
struct Materials {
    stone: u32,
    roofs: u32,
    wood: u32,
}

/// A castle on a hill: `triangles` within 5 %, in metres, its yard around the origin, y up, its gate towards +z. `materials` numbers
/// [`CASTLE_MATERIALS`].
pub(in super::super) fn castle(triangles: usize, [stone, roofs, ground, wood]: [u32; 4]) -> Vec<Face> {
    let materials = Materials { stone, roofs, wood };
    let mut mason = plan(triangles, &materials).with_room(triangles + triangles / 16);
    raise(&mut mason, &materials);
    let rest = triangles.saturating_sub(mason.count());
    lay_land(&mut mason, rest, ground);
    mason.finish()
}

/// A mason whose buildings take up to 0.6 of the triangles, or more where even the coarsest do; windows are left out where few triangles
/// would remain for the land.
fn plan(triangles: usize, materials: &Materials) -> Mason {
    const COARSEST: f64 = 100.0;
    let count = |cell: f64, plain: bool| {
        let mut mason = Mason::new(cell, plain, materials.stone);
        raise(&mut mason, materials);
        mason.count()
    };
    let plain = count(COARSEST, false) > triangles * 8 / 10;
    let (mut fine, mut coarse) = (1e-3, COARSEST);
    for _ in 0..40 {
        let middle = f64::sqrt(fine * coarse);
        if count(middle, plain) <= triangles * 6 / 10 { coarse = middle } else { fine = middle }
    }
    Mason::new(coarse, plain, materials.stone)
}

fn raise(mason: &mut Mason, materials: &Materials) {
    for (number, tower) in TOWERS.iter().enumerate() {
        raise_tower(mason, tower, materials);
        curtain(mason, tower.at, TOWERS[(number + 1) % TOWERS.len()].at, materials);
    }
    gatehouse(mason, materials);
    keep(mason, materials);
    HOUSES.iter().for_each(|house| raise_house(mason, house, materials));
    well(mason, materials);
}

/// A point of the plan at a height.
fn lifted(at: DVec2, height: f64) -> DVec3 {
    DVec3::new(at.x, height, at.y)
}

fn slit(middle: f64, low: f64, stone: u32) -> Opening {
    Opening::new(middle, low, [0.35, 1.7], 0.6, stone)
}

fn raise_tower(mason: &mut Mason, tower: &Tower, materials: &Materials) {
    let Tower { at, radius, height, roof } = *tower;
    let foot = lifted(at, 0.0);
    let wide = radius + 0.5;
    let bands = bands(&[[radius + 1.6, FOOTING - 4.0], [radius, 3.5], [radius, height - 3.4], [wide, height - 2.6], [wide, height + 0.2]]);
    let base = radius + 1.6;
    let around = |share: f64| share * 2.0 * PI * base;
    let mut openings: Vec<(usize, Opening)> = (0..3).map(|i| (1, slit(around((f64::from(i) + 0.3) / 3.0), 2.2, materials.stone))).collect();
    openings.extend((0..3).map(|i| (1, slit(around((f64::from(i) + 0.75) / 3.0), 5.8, materials.stone))));
    openings.extend((0..8).map(|i| (3, Opening::new(around((f64::from(i) + 0.5) / 8.0), 0.9, [1.0, 1.2], 0.5, materials.wood))));
    mason.turned(foot, &bands, &openings, materials.stone);
    cone_roof(mason, foot + DVec3::Y * height, wide, roof, materials);
}

/// Bands between points of a profile.
fn bands(points: &[[f64; 2]]) -> Vec<Band> {
    points.windows(2).map(|pair| Band { from: pair[0], to: pair[1] }).collect()
}

/// A round roof that flares at its eaves, over walls of `radius` that end at `foot`, with a knob.
fn cone_roof(mason: &mut Mason, foot: DVec3, radius: f64, rise: f64, materials: &Materials) {
    let eave = radius + 0.6;
    let mut profile = vec![[radius - 0.2, -0.1], [eave, -0.35], [eave, -0.1]];
    // Steeper towards the top.
    const STEPS: u32 = 5;
    profile.extend((1..STEPS).map(|step| f64::from(step) / f64::from(STEPS)).map(|t| [eave * (1.0 - t), rise * t.powf(1.12)]));
    let top = profile.pop().unwrap_or([0.0, 0.0]);
    let neck = 0.16;
    let tip = |share: f64| [top[0] + (neck - top[0]) * share, top[1] + (rise - top[1]) * share];
    profile.extend([tip(0.0), tip(1.0), [neck * 0.6, rise + 0.5], [neck * 2.0, rise + 0.8], [neck * 0.4, rise + 1.1], [0.0, rise + 1.9]]);
    mason.turned(foot, &bands(&profile), &[], materials.roofs);
}

/// A wall with a walk, its outside to the right of the way from `from` to `to`.
fn curtain(mason: &mut Mason, from: DVec2, to: DVec2, materials: &Materials) {
    let stone = materials.stone;
    let length = from.distance(to);
    let frame = Frame::between(lifted(from, 0.0), lifted(to, 0.0));
    let point = |x: f64, y: f64, z: f64| frame.at(x, y, z);
    let inner = HALF_WALL - PARAPET_THICKNESS;
    let count = (length / 7.0).floor().max(1.0) as usize;
    let slits: Vec<Opening> = (0..count).map(|i| slit(length * (i as f64 + 0.5) / count as f64, 4.2 - FOOTING, stone)).collect();
    let (low, high, walk) = (FOOTING, PARAPET, WALK);
    mason.sheet([point(0.0, low, HALF_WALL), point(length, low, HALF_WALL), point(length, high, HALF_WALL), point(0.0, high, HALF_WALL)], &slits, stone);
    mason.sheet([point(0.0, high, HALF_WALL), point(length, high, HALF_WALL), point(length, high, inner), point(0.0, high, inner)], &[], stone);
    mason.sheet([point(length, walk, inner), point(0.0, walk, inner), point(0.0, high, inner), point(length, high, inner)], &[], stone);
    mason.sheet([point(0.0, walk, inner), point(length, walk, inner), point(length, walk, -HALF_WALL), point(0.0, walk, -HALF_WALL)], &[], stone);
    mason.sheet([point(length, low, -HALF_WALL), point(0.0, low, -HALF_WALL), point(0.0, walk, -HALF_WALL), point(length, walk, -HALF_WALL)], &[], stone);
    merlons(mason, &frame.moved(0.0, high, inner + PARAPET_THICKNESS / 2.0), length, stone);
}

/// Teeth with gabled tops along a parapet's middle, whose top is at height 0.
fn merlons(mason: &mut Mason, frame: &Frame, length: f64, stone: u32) {
    let count = (length / 2.3).round().max(2.0) as usize;
    let pitch = length / count as f64;
    let (half_width, half_depth, sunk, high) = (0.29 * pitch, PARAPET_THICKNESS / 2.0 - 0.05, -0.1, 1.15);
    for number in 0..count {
        let frame = frame.moved(pitch * (number as f64 + 0.5), 0.0, 0.0);
        for frame in [frame, frame.quarters(2)] {
            let point = |x: f64, y: f64, z: f64| frame.at(x * half_width, y, z * half_depth);
            let (left, right) = (point(-1.0, high, 1.0), point(1.0, high, 1.0));
            mason.sheet([point(-1.0, sunk, 1.0), point(1.0, sunk, 1.0), right, left], &[], stone);
            mason.sheet([point(1.0, sunk, 1.0), point(1.0, sunk, -1.0), point(1.0, high, -1.0), right], &[], stone);
            mason.sheet([right, point(1.0, high, -1.0), point(1.0, high + 0.3, 0.0), point(1.0, high + 0.3, 0.0)], &[], stone);
            mason.sheet([left, right, point(1.0, high + 0.3, 0.0), point(-1.0, high + 0.3, 0.0)], &[], stone);
        }
    }
}

/// The top of a square building: a parapet that juts out around a roof, with merlons. `half` are half its length and width.
fn crown(mason: &mut Mason, frame: &Frame, half: [f64; 2], top: f64, stone: u32) {
    let jut = 0.45;
    let (below, high) = (top - 0.9, top + 1.1);
    for quarter in 0..4 {
        let frame = frame.quarters(quarter);
        let [along, across] = if quarter % 2 == 0 { half } else { [half[1], half[0]] };
        let (wide, deep) = (along + jut, across + jut);
        let inner = jut - PARAPET_THICKNESS;
        let (inside_wide, inside_deep) = (along + inner, across + inner);
        let strip = |[x, y, z]: [f64; 3], [far_x, far_y, far_z]: [f64; 3]| {
            [frame.at(-x, y, z), frame.at(x, y, z), frame.at(far_x, far_y, far_z), frame.at(-far_x, far_y, far_z)]
        };
        mason.sheet(strip([along, below - 0.8, across], [wide, below, deep]), &[], stone);
        mason.sheet(strip([wide, below, deep], [wide, high, deep]), &[], stone);
        mason.sheet(strip([wide, high, deep], [inside_wide, high, inside_deep]), &[], stone);
        mason.sheet(strip([inside_wide, high, inside_deep], [inside_wide, top, inside_deep]), &[], stone);
        merlons(mason, &frame.moved(-wide + 0.35, high, deep - PARAPET_THICKNESS / 2.0), 2.0 * wide - 0.7, stone);
    }
    mason.sheet(rectangle(frame, half, top), &[], stone);
}

/// A rectangle that faces up.
fn rectangle(frame: &Frame, [x, z]: [f64; 2], y: f64) -> [DVec3; 4] {
    [frame.at(-x, y, z), frame.at(x, y, z), frame.at(x, y, -z), frame.at(-x, y, -z)]
}

/// Four slopes to a ridge, with eaves that stand over a parapet's walk.
fn hipped_roof(mason: &mut Mason, frame: &Frame, half: [f64; 2], foot: f64, rise: f64, material: u32) {
    let ridge = (half[0] - half[1]).max(0.0) + 0.3;
    let lift = 0.5;
    for quarter in 0..4 {
        let frame = frame.quarters(quarter);
        let [x, z] = if quarter % 2 == 0 { half } else { [half[1], half[0]] };
        let reach = if quarter % 2 == 0 { ridge } else { 0.0 };
        let setback = if quarter % 2 == 0 { 0.0 } else { ridge };
        let low = [frame.at(-x, foot, z), frame.at(x, foot, z)];
        let eave = [frame.at(-x, foot + lift, z), frame.at(x, foot + lift, z)];
        mason.sheet([low[0], low[1], eave[1], eave[0]], &[], material);
        let top = [frame.at(-reach, foot + rise, setback), frame.at(reach, foot + rise, setback)];
        mason.sheet([eave[0], eave[1], top[1], top[0]], &[], material);
    }
}

/// A tower on each side of a block with an arched gate.
fn gatehouse(mason: &mut Mason, materials: &Materials) {
    let Materials { stone, wood, .. } = *materials;
    let [left, right] = [&TOWERS[0], &TOWERS[1]];
    let frame = Frame::between(lifted((left.at + right.at) / 2.0, 0.0), lifted(right.at, 0.0));
    let (half, front, back, top) = (6.5, 4.5, -4.5, 13.5);
    arched_front(mason, &frame.moved(0.0, 0.0, front), half, top - 1.7, materials);
    let window = |middle: f64| Opening::new(middle, 7.5 - FOOTING, [1.0, 1.8], 0.5, wood);
    let rear = frame.quarters(2);
    let point = |frame: &Frame, x: f64, y: f64, z: f64| frame.at(x, y, z);
    let wall = |frame: &Frame, x: f64, far: f64, z: f64| {
        [point(frame, x, FOOTING, z), point(frame, far, FOOTING, z), point(frame, far, top, z), point(frame, x, top, z)]
    };
    mason.sheet(wall(&rear, -half, half, -back), &[window(4.0), window(9.0)], stone);
    for quarter in [1, 3] {
        mason.sheet(wall(&frame.quarters(quarter), -front, front, half), &[], stone);
    }
    crown(mason, &frame, [half, front], top, stone);
    hipped_roof(mason, &frame, [half - 1.6, front - 1.6], top, 5.5, materials.roofs);
    for side in [-1.0, 1.0] {
        let foot = frame.at(side * (half + 0.6), 0.0, front);
        let tower = Tower { at: dvec2(foot.x, foot.z), radius: 2.7, height: 16.5, roof: 8.0 };
        raise_tower(mason, &tower, materials);
    }
}

/// A wall up to `top` around an arched recess, and the wooden gate in it; the frame's origin is the middle of the gate's sill.
fn arched_front(mason: &mut Mason, frame: &Frame, half: f64, top: f64, materials: &Materials) {
    let Materials { stone, wood, .. } = *materials;
    let crest = SPRINGING + GATE + 0.5;
    let upright = |x: f64, y: f64, far_x: f64, far_y: f64, z: f64| [frame.at(x, y, z), frame.at(far_x, y, z), frame.at(far_x, far_y, z), frame.at(x, far_y, z)];
    for (x, far_x) in [(-half, -GATE), (GATE, half)] {
        mason.sheet(upright(x, FOOTING, far_x, crest, 0.0), &[], stone);
    }
    let windows = [half - 2.0, half + 2.0].map(|middle| Opening::new(middle, 2.0, [0.9, 1.6], 0.5, wood));
    mason.sheet(upright(-half, crest, half, top + 1.7, 0.0), &windows, stone);
    let depth = -1.5;
    let rim = |share: f64, z: f64| {
        let (sine, cosine) = (PI * (1.0 - share)).sin_cos();
        frame.at(GATE * cosine, SPRINGING + GATE * sine, z)
    };
    let (sides, around) = (10, PI * GATE);
    mason.bent([around, 1.0], sides, false, stone, |u, v| {
        let low = rim(u, 0.0);
        low * (1.0 - v) + low.with_y(crest) * v
    });
    mason.bent([around, -depth], sides, false, stone, |u, v| rim(1.0 - u, depth * v));
    mason.bent([around, GATE], sides, true, wood, |u, v| rim(1.0 - u, depth) * (1.0 - v) + frame.at(0.0, SPRINGING, depth) * v);
    mason.sheet(upright(-GATE, FOOTING, GATE, SPRINGING, depth), &[], wood);
    let jamb = |x: f64, z: f64, far_z: f64| [frame.at(x, FOOTING, z), frame.at(x, FOOTING, far_z), frame.at(x, SPRINGING, far_z), frame.at(x, SPRINGING, z)];
    mason.sheet(jamb(-GATE, 0.0, depth), &[], stone);
    mason.sheet(jamb(GATE, depth, 0.0), &[], stone);
    for (low, high) in [(0.7, 1.0), (2.2, 2.5)] {
        mason.beam(frame, [-GATE + 0.1, low, depth - 0.1], [GATE - 0.1, high, depth + 0.12], wood);
    }
    mason.beam(frame, [-0.12, FOOTING, depth - 0.1], [0.12, SPRINGING + GATE - 0.1, depth + 0.16], wood);
}

fn keep(mason: &mut Mason, materials: &Materials) {
    let Materials { stone, wood, roofs, .. } = *materials;
    let frame = Frame::new(DVec3::new(7.0, 0.0, -12.0), 8.0);
    let (half, top, base) = (7.5, 24.0, 8.3);
    for quarter in 0..4 {
        let frame = frame.quarters(quarter);
        let level = |half: f64, y: f64| [frame.at(-half, y, half), frame.at(half, y, half)];
        let ([a, b], [d, c], [f, e]) = (level(base, FOOTING), level(half, 3.0), level(half, top));
        mason.sheet([a, b, c, d], &[], stone);
        let windows = [(5.5, 4.0), (9.5, 4.0), (7.5, 10.0), (4.0, 15.5), (11.0, 15.5)].map(|(middle, low)| Opening::new(middle, low, [1.0, 2.0], 0.5, wood));
        mason.sheet([d, c, e, f], &windows, stone);
        let corner = frame.at(half - 0.5, 0.0, half - 0.5);
        bartizan(mason, corner, materials);
    }
    crown(mason, &frame, [half, half], top, stone);
    hipped_roof(mason, &frame, [half - 1.3, half - 1.3], top, 12.5, roofs);
}

/// A turret that juts out from a corner of the keep.
fn bartizan(mason: &mut Mason, corner: DVec3, materials: &Materials) {
    let radius = 2.0;
    let profile = bands(&[[0.3, 14.5], [radius, 18.0], [radius, 27.2]]);
    let around = |share: f64| share * 2.0 * PI * radius;
    let openings: Vec<(usize, Opening)> =
        (0..6).map(|i| (1, Opening::new(around((f64::from(i) + 0.5) / 6.0), 6.6, [0.55, 1.3], 0.4, materials.wood))).collect();
    mason.turned(corner, &profile, &openings, materials.stone);
    cone_roof(mason, corner + DVec3::Y * 27.0, radius, 6.0, materials);
}

/// A house with a gabled roof, windows, a door and a chimney.
fn raise_house(mason: &mut Mason, house: &House, materials: &Materials) {
    let Materials { stone, wood, roofs, .. } = *materials;
    let [length, width, height, rise] = house.size;
    let walls = if house.wooden { wood } else { stone };
    let frame = Frame::new(lifted(house.at, land_height(house.at)), house.degrees);
    let (x, z, low) = (length / 2.0, width / 2.0, -3.0);
    let count = (length / 4.0).floor().max(1.0) as usize;
    for side in [frame, frame.quarters(2)] {
        let sill = (height - 2.2).max(1.0) - low;
        let windows: Vec<Opening> = (0..count).map(|i| Opening::new(length * (i as f64 + 0.5) / count as f64, sill, [0.9, 1.3], 0.3, wood)).collect();
        mason.sheet([side.at(-x, low, z), side.at(x, low, z), side.at(x, height, z), side.at(-x, height, z)], &windows, walls);
        let door = [Opening::new(width / 2.0, 0.1 - low, [1.4, 2.2], 0.35, wood)];
        let end = side.quarters(1);
        mason.sheet([end.at(-z, low, x), end.at(z, low, x), end.at(z, height, x), end.at(-z, height, x)], &door, walls);
        let ridge = end.at(0.0, height + rise, x);
        mason.sheet([end.at(-z, height, x), end.at(z, height, x), ridge, ridge], &[], walls);
        half_roof(mason, &side, [x + 0.5, z], height, rise, roofs);
    }
    let stack = [length * 0.22, z * 0.3];
    mason.block(&frame, [stack[0], height, -stack[1] - 0.5], [stack[0] + 0.9, height + rise + 1.2, -stack[1] + 0.5], stone);
}

/// The slope of a gabled roof on the side of positive z: a slab whose underside runs a little below the walls' top.
fn half_roof(mason: &mut Mason, frame: &Frame, [x, z]: [f64; 2], height: f64, rise: f64, material: u32) {
    let (eave, slope, thickness) = (z + 0.6, rise / z, 0.4);
    let under = |at: f64| height + rise - 0.1 - slope * at;
    let level = |z: f64, y: f64| [frame.at(-x, y, z), frame.at(x, y, z)];
    let [[a, b], [d, c]] = [level(eave, under(eave) + thickness), level(0.0, under(0.0) + thickness)];
    let [[e, f], [h, g]] = [level(eave, under(eave)), level(0.0, under(0.0))];
    mason.sheet([a, b, c, d], &[], material);
    mason.sheet([h, g, f, e], &[], material);
    mason.sheet([e, f, b, a], &[], material);
    mason.sheet([f, g, c, b], &[], material);
    mason.sheet([h, e, a, d], &[], material);
}

/// A well with a small roof on two posts.
fn well(mason: &mut Mason, materials: &Materials) {
    let at = dvec2(4.0, 10.0);
    let frame = Frame::new(lifted(at, land_height(at)), 25.0);
    let profile = [[1.3, -1.0], [1.3, 0.9], [1.0, 0.9], [1.0, 0.1], [0.0, 0.1]];
    mason.turned(frame.origin, &bands(&profile), &[], materials.stone);
    for side in [-1.5, 1.5] {
        mason.block(&frame, [side - 0.1, -1.0, -0.1], [side + 0.1, 2.7, 0.1], materials.wood);
    }
    for side in [frame, frame.quarters(2)] {
        half_roof(mason, &side, [1.9, 0.9], 2.4, 0.7, materials.roofs);
    }
}

/// A square of land around the castle, of about `triangles` triangles.
fn lay_land(mason: &mut Mason, triangles: usize, ground: u32) {
    let rows = ((triangles as f64 / 2.0).sqrt().round() as usize).max(1);
    let columns = (triangles / 2).div_ceil(rows).max(1);
    mason.land([columns, rows], ground, |u, v| {
        // Finer in the middle, where walls meet it.
        let at = dvec2(u * 2.0 - 1.0, 1.0 - v * 2.0).map(|t| LAND * t * (0.45 + 0.55 * t * t));
        lifted(at, land_height(at))
    });
}

/// How high the land lies: flat in the yard, a hill around it, and a rise far behind.
fn land_height(at: DVec2) -> f64 {
    let away = outside(at);
    let slope = smooth_step(away / 62.0) * DROP;
    let rough = 0.15 + 2.6 * smooth_step(away / 40.0);
    let far = smooth_step((at.length() - 85.0) / 115.0);
    -0.1 - slope + rough * relief(at) + 85.0 * far * (0.85 + 0.3 * noise(lifted(at / 55.0, 7.5)))
}

/// Waves of falling length and height.
fn relief(at: DVec2) -> f64 {
    (0..5).map(|octave| f64::exp2(f64::from(octave))).map(|finer| noise(lifted(at * finer / 28.0, finer)) / finer).sum()
}

fn smooth_step(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// How far a place lies outside of the walls; 0 within and for a little way around [m].
fn outside(at: DVec2) -> f64 {
    const MARGIN: f64 = 5.0;
    let corners: [DVec2; 6] = std::array::from_fn(|i| TOWERS[i].at);
    let sides = (0..6).map(|i| (corners[i], corners[(i + 1) % 6]));
    let beyond = |(from, to): (DVec2, DVec2)| (at - from).perp_dot(to - from) < 0.0;
    if !sides.clone().any(beyond) {
        return 0.0;
    }
    let to_side = |(from, to): (DVec2, DVec2)| {
        let share = ((at - from).dot(to - from) / from.distance_squared(to)).clamp(0.0, 1.0);
        at.distance(from.lerp(to, share))
    };
    (sides.map(to_side).fold(f64::INFINITY, f64::min) - MARGIN).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn castles_have_the_triangles_asked_for() {
        for asked in [10_000, 15_000, 20_000, 21_000, 30_000, 58_000, 123_456, 1_000_000] {
            let made = castle(asked, [0, 1, 2, 3]).len();
            let off = made as f64 / asked as f64 - 1.0;
            assert!(off.abs() < 0.05, "asked for {asked}, made {made}");
        }
    }

    #[test]
    fn what_is_counted_is_what_is_built() {
        let materials = Materials { stone: 0, roofs: 1, wood: 3 };
        for (cell, plain) in [(0.7, false), (3.0, true), (3.0, false), (100.0, true), (100.0, false)] {
            let mut counting = Mason::new(cell, plain, 0);
            let mut building = Mason::new(cell, plain, 0).with_room(0);
            raise(&mut counting, &materials);
            raise(&mut building, &materials);
            assert_eq!((counting.count(), building.count()), (building.count(), building.finish().len()), "{cell}, {plain}");
        }
    }
}
