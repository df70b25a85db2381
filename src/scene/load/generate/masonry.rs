//! What buildings are made of: sheets and rings of cells, with openings that are set back, as fine as asked for.

use super::super::draft::Face;
use glam::DVec3;
use std::f64::consts::TAU;

/// How far weather has worn stone [m], and the length of its waves.
const WEAR: f64 = 0.05;
const WEAR_LENGTH: f64 = 2.6;
/// Stone is as it was cut this close to its edges, so that walls meet [m].
const SHARP_EDGE: f64 = 0.8;
/// The fewest sides of something round.
const FEWEST_SIDES: usize = 12;

/// A place and a direction to build in: x along, y up, z across.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub origin: DVec3,
    pub along: DVec3,
    pub across: DVec3,
}

impl Frame {
    /// At a place, turned counter-clockwise seen from above [degrees].
    pub fn new(origin: DVec3, degrees: f64) -> Self {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let along = DVec3::new(cosine, 0.0, -sine);
        Self { origin, along, across: along.cross(DVec3::Y) }
    }

    /// From one place along the ground towards another.
    pub fn between(from: DVec3, to: DVec3) -> Self {
        let along = (to - from).with_y(0.0).normalize_or(DVec3::X);
        Self { origin: from, along, across: along.cross(DVec3::Y) }
    }

    pub fn at(&self, x: f64, y: f64, z: f64) -> DVec3 {
        self.origin + self.along * x + DVec3::Y * y + self.across * z
    }

    /// The same directions elsewhere.
    pub fn moved(&self, x: f64, y: f64, z: f64) -> Self {
        Self { origin: self.at(x, y, z), ..*self }
    }

    /// Turned by quarters, counter-clockwise seen from above, around its origin.
    pub fn quarters(&self, count: usize) -> Self {
        (0..count).fold(*self, |frame, _| Self { along: -frame.across, across: frame.along, ..frame })
    }
}

/// A rectangle that is set back from a surface, in its own lengths from its lower left corner [m].
#[derive(Debug, Clone, Copy)]
pub(super) struct Opening {
    pub low: [f64; 2],
    pub high: [f64; 2],
    pub depth: f64,
    /// What closes it.
    pub material: u32,
}

impl Opening {
    /// By the middle of its lower side, its width and its height.
    pub fn new(middle: f64, low: f64, [width, height]: [f64; 2], depth: f64, material: u32) -> Self {
        Self { low: [middle - width / 2.0, low], high: [middle + width / 2.0, low + height], depth, material }
    }

    fn holds(&self, u: f64, v: f64) -> bool {
        (self.low[0]..self.high[0]).contains(&u) && (self.low[1]..self.high[1]).contains(&v)
    }
}

/// A surface over a grid: where its lines run [m], and what kind it is.
struct Surface<'a> {
    lines: [&'a [f64]; 2],
    openings: &'a [Opening],
    material: u32,
    /// The last line is the first one.
    round: bool,
    /// The upper edge is a point.
    pointed: bool,
}

/// One edge of something turned around an upright axis: from radius and height to radius and height.
#[derive(Debug, Clone, Copy)]
pub(super) struct Band {
    pub from: [f64; 2],
    pub to: [f64; 2],
}

/// Faces on the way to a building, or only their number.
pub(super) struct Mason {
    /// The most that a cell may measure [m].
    cell: f64,
    /// What has weathered.
    stone: u32,
    /// Without openings: for few triangles.
    plain: bool,
    /// `None` while only counting.
    faces: Option<Vec<Face>>,
    count: usize,
}

impl Mason {
    /// One that counts and makes nothing.
    pub fn new(cell: f64, plain: bool, stone: u32) -> Self {
        Self { cell, stone, plain, faces: None, count: 0 }
    }

    /// One that builds, with room for so many triangles.
    pub fn with_room(self, room: usize) -> Self {
        Self { faces: Some(Vec::with_capacity(room)), ..self }
    }

    /// The triangles so far, made or counted.
    pub fn count(&self) -> usize {
        self.count
    }

    pub fn finish(self) -> Vec<Face> {
        self.faces.unwrap_or_default()
    }

    /// A sheet between four corners, counter-clockwise seen from the front; the last two may be one. Openings lie in rectangles only.
    pub fn sheet(&mut self, [a, b, c, d]: [DVec3; 4], openings: &[Opening], material: u32) {
        let openings = if self.plain { &[] } else { openings };
        let width = a.distance(b).max(d.distance(c));
        let height = a.distance(d).max(b.distance(c));
        let inwards = -(c - a).cross(d - b).normalize_or_zero();
        let lines = [self.lines(width, openings, 0, 1), self.lines(height, openings, 1, 1)];
        let surface = Surface { lines: [&lines[0], &lines[1]], openings, material, round: false, pointed: c == d };
        // Rounding must not spread a point.
        let upper = |u: f64| if c == d { d } else { d * (1.0 - u) + c * u };
        self.surface(&surface, |u, v, depth| {
            let (u, v) = (u / width, v / height);
            (a * (1.0 - u) + b * u) * (1.0 - v) + upper(u) * v + inwards * depth
        });
    }

    /// The sides and the top of a block that stands on or in something.
    pub fn block(&mut self, frame: &Frame, low: [f64; 3], high: [f64; 3], material: u32) {
        let corner = |x: f64, y: f64, z: f64| frame.at(x, y, z);
        let ([x, y, z], [far_x, far_y, far_z]) = (low, high);
        let around = [[x, far_z], [far_x, far_z], [far_x, z], [x, z]];
        for side in 0..4 {
            let ([a, b], [c, d]) = (around[side], around[(side + 1) % 4]);
            self.sheet([corner(a, y, b), corner(c, y, d), corner(c, far_y, d), corner(a, far_y, b)], &[], material);
        }
        self.sheet(around.map(|[x, z]| corner(x, far_y, z)), &[], material);
    }

    /// A block with its underside.
    pub fn beam(&mut self, frame: &Frame, low: [f64; 3], high: [f64; 3], material: u32) {
        self.block(frame, low, high, material);
        let ([x, y, z], [far_x, _, far_z]) = (low, high);
        self.sheet([frame.at(x, y, z), frame.at(far_x, y, z), frame.at(far_x, y, far_z), frame.at(x, y, far_z)], &[], material);
    }

    /// Bands around an upright axis through `foot`, one on the other, from the bottom outwards and up; openings of the band whose number stands
    /// beside them, along the widest circle.
    pub fn turned(&mut self, foot: DVec3, bands: &[Band], openings: &[(usize, Opening)], material: u32) {
        let openings = if self.plain { &[] } else { openings };
        let radius = bands.iter().flat_map(|band| [band.from[0], band.to[0]]).fold(0.0, f64::max);
        let around = TAU * radius;
        let all: Vec<Opening> = openings.iter().map(|(_, opening)| *opening).collect();
        let columns = self.lines(around, &all, 0, FEWEST_SIDES);
        for (number, band) in bands.iter().enumerate() {
            let own: Vec<Opening> = openings.iter().filter(|(at, _)| *at == number).map(|(_, opening)| *opening).collect();
            let height = (band.to[0] - band.from[0]).hypot(band.to[1] - band.from[1]);
            let rows = self.lines(height, &own, 1, 1);
            let surface = Surface { lines: [&columns, &rows], openings: &own, material, round: true, pointed: band.to[0] == 0.0 };
            self.surface(&surface, |u, v, depth| {
                let (sine, cosine) = (u / around * TAU).sin_cos();
                let t = v / height;
                let [r, y] = [0, 1].map(|axis| band.from[axis] * (1.0 - t) + band.to[axis] * t);
                foot + DVec3::new((r - depth) * cosine, y, -(r - depth) * sine)
            });
        }
    }

    /// A sheet over lengths in metres that `map` bends, without openings.
    pub fn bent(&mut self, size: [f64; 2], fewest: usize, pointed: bool, material: u32, map: impl Fn(f64, f64) -> DVec3) {
        let lines = [self.lines(size[0], &[], 0, fewest), self.lines(size[1], &[], 1, 1)];
        let surface = Surface { lines: [&lines[0], &lines[1]], openings: &[], material, round: false, pointed };
        self.surface(&surface, |u, v, _| map(u / size[0], v / size[1]));
    }

    /// A sheet of so many cells, which `map` bends from the unit square.
    pub fn land(&mut self, cells: [usize; 2], material: u32, map: impl Fn(f64, f64) -> DVec3) {
        let lines = cells.map(|count| (0..=count).map(|line| line as f64 / count as f64).collect::<Vec<f64>>());
        let surface = Surface { lines: [&lines[0], &lines[1]], openings: &[], material, round: false, pointed: false };
        self.surface(&surface, |u, v, _| map(u, v));
    }

    /// Where the lines of a grid run: on the edges of openings, and no further apart than a cell.
    fn lines(&self, length: f64, openings: &[Opening], axis: usize, fewest: usize) -> Vec<f64> {
        let mut ends: Vec<f64> = openings.iter().flat_map(|opening| [opening.low[axis], opening.high[axis]]).chain([0.0, length]).collect();
        ends.sort_by(f64::total_cmp);
        // Openings of several bands that only rounding keeps apart share a line.
        ends.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
        let cell = self.cell.min(length / fewest as f64);
        let between = |pair: &[f64]| {
            let (from, to) = (pair[0], pair[1]);
            let steps = ((to - from) / cell - 1e-9).ceil().max(1.0) as usize;
            (1..=steps).map(move |step| if step == steps { to } else { from + (to - from) * step as f64 / steps as f64 })
        };
        std::iter::once(0.0).chain(ends.windows(2).flat_map(between)).collect()
    }

    /// The cells of a surface; `map` takes lengths along it and a depth behind it.
    fn surface(&mut self, surface: &Surface, map: impl Fn(f64, f64, f64) -> DVec3) {
        self.count += surface.triangles();
        let Some(faces) = &mut self.faces else { return };
        let worn = surface.material == self.stone;
        let at = |column: usize, row: usize, depth: f64| {
            let (u, v, to_edge) = surface.place(column, row);
            let wear = if worn && to_edge > 0.0 { WEAR * (to_edge / SHARP_EDGE).min(1.0) * noise(map(u, v, 0.0) / WEAR_LENGTH) } else { 0.0 };
            map(u, v, depth + wear)
        };
        for (row, column) in surface.cells() {
            let corners = [[column, row], [column + 1, row], [column + 1, row + 1], [column, row + 1]];
            let opening = surface.opening_at(column, row);
            let depth = opening.map_or(0.0, |opening| opening.depth);
            push(faces, corners.map(|[column, row]| at(column, row, depth)), opening.map_or(surface.material, |opening| opening.material));
            // The jambs: where the neighbour beyond an edge is not in the opening.
            let beyond = [[0, -1], [1, 0], [0, 1], [-1, 0]];
            for side in (0..4).filter(|&side| opening.is_some() && !surface.is_open(column as isize + beyond[side][0], row as isize + beyond[side][1])) {
                let ([a, b], [c, d]) = (corners[side], corners[(side + 1) % 4]);
                push(faces, [at(a, b, 0.0), at(c, d, 0.0), at(c, d, depth), at(a, b, depth)], surface.material);
            }
        }
    }
}

impl Surface<'_> {
    fn columns(&self) -> usize {
        self.lines[0].len() - 1
    }

    fn rows(&self) -> usize {
        self.lines[1].len() - 1
    }

    fn cells(&self) -> impl Iterator<Item = (usize, usize)> {
        let columns = self.columns();
        (0..self.rows()).flat_map(move |row| (0..columns).map(move |column| (row, column)))
    }

    /// The opening that holds a cell.
    fn opening_at(&self, column: usize, row: usize) -> Option<&Opening> {
        let middle = |lines: &[f64], at: usize| (lines[at] + lines[at + 1]) / 2.0;
        let (u, v) = (middle(self.lines[0], column), middle(self.lines[1], row));
        self.openings.iter().find(|opening| opening.holds(u, v))
    }

    fn is_open(&self, column: isize, row: isize) -> bool {
        let inside = (0..self.columns() as isize).contains(&column) && (0..self.rows() as isize).contains(&row);
        inside && self.opening_at(column as usize, row as usize).is_some()
    }

    /// Lengths to a crossing of lines, and from there to the nearest edge.
    fn place(&self, column: usize, row: usize) -> (f64, f64, f64) {
        let [columns, rows] = self.lines;
        let (u, v) = (columns[column], rows[row]);
        let to_end = |lines: &[f64], at: f64| at.min(lines[lines.len() - 1] - at);
        if self.round { (if column == self.columns() { 0.0 } else { u }, v, to_end(rows, v)) } else { (u, v, to_end(rows, v).min(to_end(columns, u))) }
    }

    /// Two triangles for each cell and each piece of a jamb, one where a cell ends in a point.
    fn triangles(&self) -> usize {
        let steps = |opening: &Opening, axis: usize| {
            self.lines[axis].windows(2).filter(|pair| (opening.low[axis]..opening.high[axis]).contains(&((pair[0] + pair[1]) / 2.0))).count()
        };
        let jambs: usize = self.openings.iter().map(|opening| 2 * (steps(opening, 0) + steps(opening, 1))).sum();
        2 * (self.columns() * self.rows() + jambs) - if self.pointed { self.columns() } else { 0 }
    }
}

/// The triangles of a cell, without one that has shrunk to an edge.
fn push(faces: &mut Vec<Face>, [a, b, c, d]: [DVec3; 4], material: u32) {
    let whole = |[a, b, c]: &[DVec3; 3]| a != b && b != c && c != a;
    faces.extend([[a, b, c], [a, c, d]].into_iter().filter(whole).map(|corners| Face::flat(corners, material)));
}

/// Smooth noise from −1 to 1 with waves of about length 1.
pub(super) fn noise(at: DVec3) -> f64 {
    let base = at.floor();
    let weight = (at - base).map(|t| t * t * t * (t * (6.0 * t - 15.0) + 10.0));
    let corner = |x: f64, y: f64, z: f64| random(base + DVec3::new(x, y, z));
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let edge = |y: f64, z: f64| mix(corner(0.0, y, z), corner(1.0, y, z), weight.x);
    let side = |z: f64| mix(edge(0.0, z), edge(1.0, z), weight.y);
    mix(side(0.0), side(1.0), weight.z)
}

/// A number from −1 to 1 for each whole point, the same everywhere.
fn random(point: DVec3) -> f64 {
    let word =
        point.to_array().iter().fold(0x9e37_79b9_7f4a_7c15_u64, |hash, &x| (hash ^ (x as i64 as u64)).wrapping_mul(0xbf58_476d_1ce4_e5b9).rotate_left(29));
    let mixed = (word ^ (word >> 32)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (mixed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}
