//! Newell's teapot: a body turned from Bézier profiles, and a spout and a handle of bicubic patches, closed all round.

use super::draft::Face;
use glam::{DVec2, DVec3, dvec2};
use std::{f64::consts::TAU, ops::RangeInclusive};

/// Cells along the side of a patch where a document does not say: as many corners as the teapots of papers have.
pub(super) const DETAIL: u32 = 7;
/// The coarsest: with less the handle would be flat. The finest: 4,717,056 triangles.
pub(super) const DETAILS: RangeInclusive<u32> = 2..=256;

type Curve = [DVec2; 4];

/// The control points of a bicubic patch: four curves across it, one after the other along it.
type Patch = [[DVec3; 4]; 4];

// M. E. Newell 1975, "The utilization of procedure models in digital image synthesis", with Blinn's lower height, y up.
/// Radius and height from the bottom to the top of the knob; a groove between rim and lid, and the bottom, close it.
const PROFILE: [Curve; 7] = [
    [dvec2(0.0, 0.0), dvec2(1.425, 0.0), dvec2(1.5, 0.075), dvec2(1.5, 0.15)],
    [dvec2(1.5, 0.15), dvec2(1.5, 0.225), dvec2(2.0, 0.45), dvec2(2.0, 0.9)],
    [dvec2(2.0, 0.9), dvec2(2.0, 1.35), dvec2(1.75, 1.875), dvec2(1.5, 2.4)],
    [dvec2(1.5, 2.4), dvec2(1.4375, 2.53125), dvec2(1.3375, 2.53125), dvec2(1.4, 2.4)],
    [dvec2(1.4, 2.4), dvec2(1.39, 2.37), dvec2(1.31, 2.37), dvec2(1.3, 2.4)],
    [dvec2(1.3, 2.4), dvec2(1.3, 2.55), dvec2(0.4, 2.55), dvec2(0.2, 2.7)],
    [dvec2(0.2, 2.7), dvec2(0.0, 2.85), dvec2(0.8, 3.15), dvec2(0.0, 3.15)],
];

/// A section of a tube, a flattened loop: the ends of its lower and upper arc in the plane z = 0, and how far its control points stand aside.
struct Section {
    inside: [f64; 2],
    outside: [f64; 2],
    half_width: f64,
}

const fn section(inside: [f64; 2], outside: [f64; 2], half_width: f64) -> Section {
    Section { inside, outside, half_width }
}

/// From within the body and back into it: two patches along it that share the section in the middle.
const HANDLE: [Section; 7] = [
    section([-1.6, 2.025], [-1.5, 2.25], 0.3),
    section([-2.3, 2.025], [-2.5, 2.25], 0.3),
    section([-2.7, 2.025], [-3.0, 2.25], 0.3),
    section([-2.7, 1.8], [-3.0, 1.8], 0.3),
    section([-2.7, 1.575], [-3.0, 1.35], 0.3),
    section([-2.5, 1.125], [-2.65, 0.9375], 0.3),
    section([-1.95, 0.9], [-1.88, 0.6], 0.3),
];

/// From within the body to the lip and a little way back inside, where tea closes it.
const SPOUT: [Section; 7] = [
    section([1.7, 1.425], [1.7, 0.6], 0.66),
    section([2.6, 1.425], [3.1, 0.825], 0.66),
    section([2.3, 2.1], [2.4, 2.025], 0.25),
    section([2.7, 2.4], [3.3, 2.4], 0.25),
    section([2.8, 2.475], [3.525, 2.49375], 0.25),
    section([2.9, 2.475], [3.45, 2.5125], 0.15),
    section([2.8, 2.4], [3.2, 2.4], 0.15),
];

/// A point and the direction that its surface faces there.
type Corner = (DVec3, DVec3);

/// The triangles of a teapot of this detail.
pub(super) fn triangles(detail: u32) -> usize {
    let cells = detail as usize;
    72 * cells * cells - 6 * cells
}

/// A teapot that stands on `centre`, its spout towards +x, 3.15 high where `scale` is 1; `detail` cells along the side of each patch.
pub(super) fn teapot(centre: DVec3, scale: f64, detail: u32, material: u32) -> Vec<Face> {
    let cells = detail.clamp(*DETAILS.start(), *DETAILS.end()) as usize;
    let mut faces = Vec::with_capacity(triangles(detail));
    for curve in &PROFILE {
        grid(&mut faces, [4 * cells, cells], material, |u, v| turned(curve, u, v));
    }
    for tube in [&HANDLE, &SPOUT] {
        for sections in [&tube[..4], &tube[3..]] {
            for side in [1.0, -1.0] {
                let patch = half_tube(sections, side);
                grid(&mut faces, [cells, cells], material, |u, v| on_patch(&patch, u, v));
            }
        }
    }
    close_spout(&mut faces, cells, material);
    for face in &mut faces {
        face.positions = face.positions.map(|p| centre + scale * p);
    }
    faces
}

/// Two triangles for each cell of the unit square, one where the cell shrinks to a triangle; counter-clockwise in (u, v) is the front.
fn grid(faces: &mut Vec<Face>, cells: [usize; 2], material: u32, map: impl Fn(f64, f64) -> Corner) {
    let at = |column: usize, row: usize| map(column as f64 / cells[0] as f64, row as f64 / cells[1] as f64);
    for (row, column) in (0..cells[1]).flat_map(|row| (0..cells[0]).map(move |column| (row, column))) {
        let [a, b, c, d] = [at(column, row), at(column + 1, row), at(column + 1, row + 1), at(column, row + 1)];
        faces.extend([[a, b, c], [a, c, d]].into_iter().filter(|corners| !shrunk(corners)).map(|corners| face(corners, material)));
    }
}

fn shrunk(&[a, b, c]: &[Corner; 3]) -> bool {
    a.0 == b.0 || b.0 == c.0 || c.0 == a.0
}

fn face(corners: [Corner; 3], material: u32) -> Face {
    Face { normals: corners.map(|corner| corner.1.as_vec3()), ..Face::flat(corners.map(|corner| corner.0), material) }
}

/// A profile turned around the y axis: `u` of a full turn, `v` along the curve.
fn turned(curve: &Curve, u: f64, v: f64) -> Corner {
    // A full turn ends where it began, to the bit, so that no seam is left.
    let (sine, cosine) = (TAU * u.fract()).sin_cos();
    let around = |p: DVec2| DVec3::new(p.x * cosine, p.y, -p.x * sine);
    let tangent = blend(&derivative(v), curve);
    (around(blend(&bernstein(v), curve)), around(dvec2(tangent.y, -tangent.x)).normalize_or_zero())
}

/// One half of a tube, at positive or negative z by the sign of `side`.
fn half_tube(sections: &[Section], side: f64) -> Patch {
    std::array::from_fn(|at| arc(&sections[at], side))
}

/// Half of a section, in the direction that makes the outside of the tube its front.
fn arc(&Section { inside: [x, y], outside: [far_x, far_y], half_width }: &Section, side: f64) -> [DVec3; 4] {
    let z = side * half_width;
    let [a, b, c, d] = [DVec3::new(x, y, 0.0), DVec3::new(x, y, z), DVec3::new(far_x, far_y, z), DVec3::new(far_x, far_y, 0.0)];
    if side > 0.0 { [a, b, c, d] } else { [d, c, b, a] }
}

fn on_patch(patch: &Patch, u: f64, v: f64) -> Corner {
    let point = |across: &[f64; 4], along: &[f64; 4]| -> DVec3 { patch.iter().zip(along).map(|(curve, weight)| weight * blend(across, curve)).sum() };
    let normal = point(&derivative(u), &bernstein(v)).cross(point(&bernstein(u), &derivative(v)));
    (point(&bernstein(u), &bernstein(v)), normal.normalize_or_zero())
}

/// A fan over the inner end of the spout, a little below its lip.
fn close_spout(faces: &mut Vec<Face>, cells: usize, material: u32) {
    let middle = (DVec3::new(3.0, 2.4, 0.0), DVec3::Y);
    for side in [1.0, -1.0] {
        let patch = half_tube(&SPOUT[3..], side);
        let rim = |step: usize| (on_patch(&patch, step as f64 / cells as f64, 1.0).0, DVec3::Y);
        faces.extend((0..cells).map(|step| face([middle, rim(step), rim(step + 1)], material)));
    }
}

/// The weights of a cubic Bézier curve's control points.
fn bernstein(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]
}

/// The weights of its derivative.
fn derivative(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-3.0 * s * s, 3.0 * s * (s - 2.0 * t), 3.0 * t * (2.0 * s - t), 3.0 * t * t]
}

fn blend<P: Copy + std::ops::Mul<f64, Output = P> + std::iter::Sum>(weights: &[f64; 4], points: &[P; 4]) -> P {
    points.iter().zip(weights).map(|(&point, &weight)| point * weight).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{collections::HashMap, f64::consts::PI};

    /// How often each edge is gone along from its first corner to its second, less how often back.
    fn open_edges(faces: &[Face]) -> usize {
        let key = |p: DVec3| (p + 0.0).to_array().map(f64::to_bits);
        let mut edges: HashMap<_, i32> = HashMap::new();
        for (a, b) in faces.iter().flat_map(|face| (0..3).map(|i| (key(face.positions[i]), key(face.positions[(i + 1) % 3])))) {
            *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
        }
        edges.values().filter(|&&sum| sum != 0).count()
    }

    #[test]
    fn teapots_are_closed_but_where_handle_and_spout_end_within_the_body() {
        for detail in [2, 3, 7] {
            let made = teapot(DVec3::new(3.0, -1.0, 2.0), 2.0, detail, 0);
            assert_eq!(made.len(), triangles(detail));
            // Two ends of the handle and one of the spout, each of two halves.
            assert_eq!(open_edges(&teapot(DVec3::ZERO, 1.0, detail, 0)), 6 * detail as usize, "{detail}");
            let heights = made.iter().flat_map(|face| face.positions.map(|p| p.y));
            let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| (low.min(y), high.max(y)));
            assert!((low + 1.0).abs() < 1e-12 && (high - 5.3).abs() < 1e-12, "{low} to {high}");
        }
    }

    /// The body's radius at a height between its bottom and its rim.
    fn radius_at(height: f64) -> f64 {
        let points = PROFILE[..3].iter().flat_map(|curve| (0..=1000).map(move |i| blend(&bernstein(f64::from(i) / 1000.0), curve)));
        points.min_by(|a, b| (a.y - height).abs().total_cmp(&(b.y - height).abs())).unwrap().x
    }

    #[test]
    fn the_ends_of_handle_and_spout_lie_within_the_body() {
        for section in [&HANDLE[0], &HANDLE[6], &SPOUT[0]] {
            for step in 0..=32 {
                let end = blend(&bernstein(f64::from(step) / 32.0), &arc(section, 1.0));
                assert!(end.x.hypot(end.z) < radius_at(end.y) - 0.01, "{end}");
            }
        }
    }

    #[test]
    fn triangles_face_as_their_normals_do_and_enclose_the_body() {
        let made = teapot(DVec3::ZERO, 1.0, 24, 0);
        for face in &made {
            let [a, b, c] = face.positions;
            let front = (b - a).cross(c - a).normalize();
            assert!(face.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-4 && n.as_dvec3().dot(front) > 0.0), "{face:?}");
        }
        let body = 56 * 24 * 24 - 8 * 24;
        let volume: f64 = made[..body].iter().map(|face| face.positions[0].dot(face.positions[1].cross(face.positions[2])) / 6.0).sum();
        let step = 1e-3;
        let discs = (0..2400).map(|i| step * (f64::from(i) + 0.5)).map(|height| PI * radius_at(height).powi(2) * step);
        let (least, lid) = (discs.sum::<f64>(), PI * 1.5 * 1.5 * 0.75);
        assert!((0.99 * least..least + lid).contains(&volume), "{volume} beside {least}");
    }
}
