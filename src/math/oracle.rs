//! A scene whose irradiance is known in closed form for every point and normal: what gradients are tested against.

use super::{
    frame::Frame,
    hemisphere::{Sample, Table},
    solid_angle::polygon_moment,
    sum::{Summed, sum},
};
use glam::{DVec2, DVec3, Vec3};
use std::f64::consts::PI;

const SKY: f64 = 0.3;
/// A bright rectangle overhead: corners at the height, radiance.
const EMITTER: Rectangle = Rectangle { min: DVec2::new(-0.4, -0.7), max: DVec2::new(1.1, 0.5), height: 2.0, radiance: 5.0 };
/// A dark rectangle half before it.
const OCCLUDER: Rectangle = Rectangle { min: DVec2::new(0.35, -0.2), max: DVec2::new(0.8, 0.45), height: 1.0, radiance: 0.1 };
/// An upright rectangle that floats above the floor, beside the others: x, y from and to, z from and to, radiance.
const WALL: Wall = Wall { x: 2.5, y: [-1.2, 1.6], z: [0.3, 1.4], radiance: 2.0 };

/// What stands there besides the emitter.
#[derive(Clone, Copy)]
pub struct Objects {
    pub occluder: bool,
    pub wall: bool,
}

struct Rectangle {
    min: DVec2,
    max: DVec2,
    height: f64,
    radiance: f64,
}

struct Wall {
    x: f64,
    y: [f64; 2],
    z: [f64; 2],
    radiance: f64,
}

impl Rectangle {
    /// Bounds of the picture on the plane at distance 1 above `point`.
    fn seen(&self, point: DVec3) -> [DVec2; 2] {
        [self.min, self.max].map(|corner| (corner - point.truncate()) / (self.height - point.z))
    }
}

fn moment([min, max]: [DVec2; 2]) -> DVec3 {
    let corners = [min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)];
    polygon_moment(&corners.map(|c| c.extend(1.0).normalize()))
}

fn wall_moment(point: DVec3) -> DVec3 {
    let Wall { x, y, z, .. } = WALL;
    let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| (DVec3::new(x, y[i], z[j]) - point).normalize());
    polygon_moment(&corners)
}

/// Irradiance at a point near the floor for a normal that is nearly upright: the sky goes on below the floor.
pub fn irradiance(point: DVec3, normal: DVec3, objects: Objects) -> f64 {
    let emitter = EMITTER.seen(point);
    let mut light = moment(emitter) * (EMITTER.radiance - SKY);
    if objects.occluder {
        let occluder = OCCLUDER.seen(point);
        let hidden = [emitter[0].max(occluder[0]), emitter[1].min(occluder[1])];
        light += moment(occluder) * (OCCLUDER.radiance - SKY) - moment(hidden) * (EMITTER.radiance - SKY);
    }
    if objects.wall {
        light += wall_moment(point) * (WALL.radiance - SKY);
    }
    SKY * PI + light.dot(normal)
}

/// Radiance and distance along a unit direction.
pub fn trace(point: DVec3, direction: DVec3, objects: Objects) -> (f64, f64) {
    for rectangle in [objects.occluder.then_some(OCCLUDER), Some(EMITTER)].into_iter().flatten() {
        let distance = (rectangle.height - point.z) / direction.z;
        let hit = (point + direction * distance).truncate();
        if distance > 0.0 && hit.cmpge(rectangle.min).all() && hit.cmple(rectangle.max).all() {
            return (rectangle.radiance, distance);
        }
    }
    let distance = (WALL.x - point.x) / direction.x;
    let hit = point + direction * distance;
    let inside = (WALL.y[0]..WALL.y[1]).contains(&hit.y) && (WALL.z[0]..WALL.z[1]).contains(&hit.z);
    if objects.wall && distance > 0.0 && inside { (WALL.radiance, distance) } else { (SKY, f64::INFINITY) }
}

/// The tile seen by a function of local directions that returns radiance and distance.
pub fn tile(table: &Table, trace: impl Fn(DVec3) -> (f64, f64)) -> Vec<[f32; 4]> {
    let texel = |sample: &Sample| {
        let (radiance, distance) = trace(DVec3::from(sample.direction));
        [radiance as f32, radiance as f32, radiance as f32, distance as f32]
    };
    table.samples.iter().map(texel).collect()
}

/// Sums a tile of one colour.
pub fn gather(table: &Table, trace_local: impl Fn(DVec3) -> (f64, f64)) -> Summed {
    sum(table, &tile(table, trace_local), 1e-9).expect("a tile of the table's size")
}

/// Root of the mean square error of the gradients over many points, relative to the gradients' own: translation along
/// the surface, translation along the normal, rotation.
pub struct GradientErrors {
    pub tangent: f64,
    pub normal: f64,
    pub rotation: f64,
}

/// Compares a table's gradients with central differences of the closed form, over points on the floor and frames
/// turned about the normal.
pub fn gradient_errors(table: &Table, objects: Objects) -> GradientErrors {
    let [mut tangent, mut normal, mut rotation] = [[0.0; 2]; 3];
    for i in 0..48 {
        let (point, frame) = place(i);
        let to_world = |v: DVec3| frame.tangent.as_dvec3() * v.x + frame.bitangent.as_dvec3() * v.y + DVec3::Z * v.z;
        let summed = gather(table, |direction| trace(point, to_world(direction), objects));
        let (found, truth) = (to_world(summed.translation[0]), translation(point, objects));
        accumulate(&mut tangent, found.truncate().extend(0.0), truth.truncate().extend(0.0));
        accumulate(&mut normal, DVec3::Z * found.z, DVec3::Z * truth.z);
        accumulate(&mut rotation, to_world(summed.rotation[0]), rotation_truth(point, objects));
    }
    let relative = |[error, total]: [f64; 2]| (error / total).sqrt();
    GradientErrors { tangent: relative(tangent), normal: relative(normal), rotation: relative(rotation) }
}

/// Relative root of the mean square error of the second derivatives along the surface over many points, against
/// central differences of the closed form.
pub fn hessian_error(table: &Table, objects: Objects) -> f64 {
    let mut errors = [0.0; 2];
    for i in 0..48 {
        let (point, frame) = place(i);
        let to_world = |v: DVec3| frame.tangent.as_dvec3() * v.x + frame.bitangent.as_dvec3() * v.y + DVec3::Z * v.z;
        let summed = gather(table, |direction| trace(point, to_world(direction), objects));
        let [x, y] = [DVec3::X, DVec3::Y].map(to_world);
        let truth = DVec3::new(second_difference(point, x, x, objects), second_difference(point, x, y, objects), second_difference(point, y, y, objects));
        accumulate(&mut errors, summed.hessian, truth);
    }
    (errors[0] / errors[1]).sqrt()
}

fn second_difference(point: DVec3, a: DVec3, b: DVec3, objects: Objects) -> f64 {
    const STEP: f64 = 1e-3;
    let at = |s: f64, t: f64| irradiance(point + (a * s + b * t) * STEP, DVec3::Z, objects);
    (at(1.0, 1.0) - at(1.0, -1.0) - at(-1.0, 1.0) + at(-1.0, -1.0)) / (4.0 * STEP * STEP)
}

/// The i-th of many points on the floor and frames turned about the normal.
pub fn place(i: u32) -> (DVec3, Frame) {
    let share = |k: f64| (0.5 + f64::from(i) * k).fract();
    let point = DVec3::new(0.5 * share(0.754_877_67), 0.4 * share(0.569_840_29) - 0.2, 0.0);
    (point, Frame::new(Vec3::Z).turned(std::f32::consts::TAU * share(0.618_034) as f32))
}

fn accumulate(sums: &mut [f64; 2], found: DVec3, truth: DVec3) {
    sums[0] += (found - truth).length_squared();
    sums[1] += truth.length_squared();
}

const STEP: f64 = 1e-5;

fn translation(point: DVec3, objects: Objects) -> DVec3 {
    let difference = |axis: DVec3| irradiance(point + axis * STEP, DVec3::Z, objects) - irradiance(point - axis * STEP, DVec3::Z, objects);
    DVec3::new(difference(DVec3::X), difference(DVec3::Y), difference(DVec3::Z)) / (2.0 * STEP)
}

/// The normal turned by α about an axis changes the irradiance by α · axis·∇r.
fn rotation_truth(point: DVec3, objects: Objects) -> DVec3 {
    let difference = |axis: DVec3| {
        let turned = |sign: f64| (DVec3::Z + axis.cross(DVec3::Z) * sign * STEP).normalize();
        irradiance(point, turned(1.0), objects) - irradiance(point, turned(-1.0), objects)
    };
    DVec3::new(difference(DVec3::X), difference(DVec3::Y), 0.0) / (2.0 * STEP)
}
