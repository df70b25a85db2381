//! A vaulted hall of repeated bays.

use super::super::{draft::Face, primitives::quad};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// The fewest triangles that make a hall.
pub(in super::super) const MIN_HALL: usize = 1000;
/// The materials of a hall, in the order of the numbers that [`hall`] takes.
pub(in super::super) const HALL_MATERIALS: [&str; 5] = ["floor", "walls", "vault", "columns", "arches"];

const BAY: f64 = 4.0;
const NAVE_HALF_WIDTH: f64 = 3.0;
const WALL_AT: f64 = 5.0;
const SPRINGING: f64 = 4.0;
const WALL_HEIGHT: f64 = 5.0;
const COLUMN_RADIUS: f64 = 0.35;
const RIB: f64 = 0.25;

/// How a hall spends its triangles.
#[derive(Debug, Clone, Copy)]
struct Plan {
    bays: usize,
    /// Segments around a column and along an arch are six times this; a column is twice this high.
    detail: usize,
    floor: [usize; 2],
    wall: [usize; 2],
}

impl Plan {
    /// Bays grow with the cube root of the count, detail takes up to 0.7 of it, floor and walls share what is left.
    fn new(triangles: usize) -> Self {
        let bays = (3.0 * (triangles as f64 / MIN_HALL as f64).cbrt()).round() as usize;
        let curved = |detail: usize| curved_triangles(bays, detail);
        let detail = (1..).take_while(|&detail| curved(detail) * 10 <= triangles * 7).last().unwrap_or(1);
        let rest = triangles.saturating_sub(curved(detail) + 4);
        let length = bays as f64 * BAY;
        let wall = grid(rest / 4, length / WALL_HEIGHT);
        let floor = grid(rest.saturating_sub(4 * wall[0] * wall[1]), length / (2.0 * WALL_AT));
        Self { bays, detail, floor, wall }
    }
}

/// Triangles of columns, arches, vault and lunettes.
fn curved_triangles(bays: usize, detail: usize) -> usize {
    let around = 6 * detail;
    let columns = 2 * (bays + 1) * around * 2 * detail * 2;
    let arches = (bays + 1 + 2 * bays) * around * 4 * 2;
    let vault = around * bays * 2;
    columns + arches + vault + 2 * around
}

/// Columns and rows of a grid of about `triangles` triangles whose cells are about square.
fn grid(triangles: usize, aspect: f64) -> [usize; 2] {
    let rows = ((triangles as f64 / 2.0 / aspect).sqrt().round() as usize).max(1);
    [((triangles as f64 / (2 * rows) as f64).round() as usize).max(1), rows]
}

/// A vaulted hall of repeated bays between two rows of columns: `triangles` within 5 %, along +x from the origin, y up,
/// 4 units a bay, 10 wide and 10 high. `materials` numbers [`HALL_MATERIALS`].
pub(in super::super) fn hall(triangles: usize, materials: [u32; 5]) -> Vec<Face> {
    let plan = Plan::new(triangles);
    let [floor, walls, vault, columns, arches] = materials;
    let length = plan.bays as f64 * BAY;
    let mut faces = Vec::with_capacity(triangles + triangles / 16);
    let point = DVec3::new;
    patch(&mut faces, plan.floor, floor, |u, v| point(u * length, 0.0, WALL_AT * (1.0 - 2.0 * v)));
    patch(&mut faces, plan.wall, walls, |u, v| point(u * length, v * WALL_HEIGHT, -WALL_AT));
    patch(&mut faces, plan.wall, walls, |u, v| point((1.0 - u) * length, v * WALL_HEIGHT, WALL_AT));
    for (x, side) in [(0.0, 1.0), (length, -1.0)] {
        end_wall(&mut faces, x, side, 6 * plan.detail, walls);
    }
    patch(&mut faces, [plan.bays, 6 * plan.detail], vault, |u, v| point(u * length, WALL_HEIGHT + WALL_AT * (v * PI).sin(), -WALL_AT * (v * PI).cos()));
    for boundary in 0..=plan.bays {
        let x = (boundary as f64 * BAY).clamp(COLUMN_RADIUS + 0.05, length - COLUMN_RADIUS - 0.05);
        for z in [-NAVE_HALF_WIDTH, NAVE_HALF_WIDTH] {
            column(&mut faces, point(x, 0.0, z), plan.detail, columns);
        }
        arch(&mut faces, point(x, SPRINGING, 0.0), DVec3::Z, NAVE_HALF_WIDTH, 6 * plan.detail, arches);
    }
    for bay in 0..plan.bays {
        for z in [-NAVE_HALF_WIDTH, NAVE_HALF_WIDTH] {
            arch(&mut faces, point((bay as f64 + 0.5) * BAY, SPRINGING, z), DVec3::X, BAY / 2.0, 6 * plan.detail, arches);
        }
    }
    faces
}

/// A grid of `cells` over the unit square, mapped into space; counter-clockwise in (u, v) is the front.
fn patch(faces: &mut Vec<Face>, cells: [usize; 2], material: u32, map: impl Fn(f64, f64) -> DVec3) {
    let at = |column: usize, row: usize| map(column as f64 / cells[0] as f64, row as f64 / cells[1] as f64);
    for row in 0..cells[1] {
        for column in 0..cells[0] {
            faces.extend(quad([at(column, row), at(column + 1, row), at(column + 1, row + 1), at(column, row + 1)], material));
        }
    }
}

/// The wall that closes the hall at `x`: a rectangle and the half disc under the vault; `side` is where it faces.
fn end_wall(faces: &mut Vec<Face>, x: f64, side: f64, segments: usize, material: u32) {
    let point = |y: f64, z: f64| DVec3::new(x, y, side * z);
    faces.extend(quad([point(0.0, WALL_AT), point(0.0, -WALL_AT), point(WALL_HEIGHT, -WALL_AT), point(WALL_HEIGHT, WALL_AT)], material));
    let rim = |step: usize| {
        let angle = PI * step as f64 / segments as f64;
        point(WALL_HEIGHT + WALL_AT * angle.sin(), WALL_AT * angle.cos())
    };
    for step in 0..segments {
        let positions = [point(WALL_HEIGHT, 0.0), rim(step + 1), rim(step)];
        faces.push(Face::flat(positions, material));
    }
}

/// An open cylinder from the floor to the springing of the arches.
fn column(faces: &mut Vec<Face>, foot: DVec3, detail: usize, material: u32) {
    patch(faces, [6 * detail, 2 * detail], material, |u, v| {
        foot + DVec3::new(COLUMN_RADIUS * (u * TAU).cos(), v * SPRINGING, -COLUMN_RADIUS * (u * TAU).sin())
    });
}

/// A half ring of square section over `centre`, from −`radius` to `radius` along `along`.
fn arch(faces: &mut Vec<Face>, centre: DVec3, along: DVec3, radius: f64, segments: usize, material: u32) {
    let across = along.cross(DVec3::Y);
    // The four edges of the section, in turn: outwards from the middle line and sideways.
    const SECTION: [[f64; 2]; 5] = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
    patch(faces, [4, segments], material, |u, v| {
        let [outwards, sideways] = SECTION[((u * 4.0).round() as usize).min(4)];
        let (sine, cosine) = (v * PI).sin_cos();
        centre + (along * -cosine + DVec3::Y * sine) * (radius + RIB * outwards) + across * (RIB * sideways)
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halls_have_the_triangles_asked_for() {
        for asked in [1000, 1500, 2000, 5000, 10_000, 30_000, 123_456, 1_000_000] {
            let made = hall(asked, [0, 1, 2, 3, 4]).len();
            let off = made as f64 / asked as f64 - 1.0;
            assert!(off.abs() < 0.05, "asked for {asked}, made {made}");
        }
    }
}
