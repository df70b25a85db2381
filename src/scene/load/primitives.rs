//! The simple shapes that a scene document can hold.

use super::draft::Face;
use glam::{DVec3, Vec2};
use std::collections::HashMap;

/// The finest sphere: 20 · 4⁹ triangles.
pub(super) const MAX_SUBDIVISIONS: u32 = 9;

/// Two triangles over four corners, counter-clockwise seen from the front.
pub(super) fn quad(corners: [DVec3; 4], material: u32) -> [Face; 2] {
    let [a, b, c, d] = corners;
    let uvs = [Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(1.0, 0.0), Vec2::new(0.0, 0.0)];
    let half = |positions, uvs| Face { uvs, ..Face::flat(positions, material) };
    [half([a, b, c], [uvs[0], uvs[1], uvs[2]]), half([a, c, d], [uvs[0], uvs[2], uvs[3]])]
}

/// The six sides of an upright box, their fronts outside.
pub(super) fn cuboid(low: DVec3, high: DVec3, material: u32) -> Vec<Face> {
    let corner = |index: usize| {
        let side = |axis: usize| if index >> axis & 1 == 1 { high[axis] } else { low[axis] };
        DVec3::new(side(0), side(1), side(2))
    };
    // Bit 0 of a corner's number is x, bit 1 is y, bit 2 is z.
    const SIDES: [[usize; 4]; 6] = [[4, 6, 2, 0], [1, 3, 7, 5], [0, 1, 5, 4], [6, 7, 3, 2], [2, 3, 1, 0], [4, 5, 7, 6]];
    SIDES.iter().flat_map(|side| quad(side.map(corner), material)).collect()
}

/// A sphere of 20 · 4ⁿ triangles from an icosahedron, with the sphere's own normals.
pub(super) fn sphere(centre: DVec3, radius: f64, subdivisions: u32, material: u32) -> Vec<Face> {
    let (mut points, mut triangles) = icosahedron();
    for _ in 0..subdivisions.min(MAX_SUBDIVISIONS) {
        triangles = subdivide(&mut points, &triangles);
    }
    let face =
        |triangle: &[usize; 3]| Face { normals: triangle.map(|i| points[i].as_vec3()), ..Face::flat(triangle.map(|i| centre + radius * points[i]), material) };
    triangles.iter().map(face).collect()
}

fn icosahedron() -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let g = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let points = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ];
    let triangles = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    (points.map(|p| DVec3::from(p).normalize()).to_vec(), triangles.to_vec())
}

/// Splits every triangle into four at the middles of its edges, pushed out to the unit sphere.
fn subdivide(points: &mut Vec<DVec3>, triangles: &[[usize; 3]]) -> Vec<[usize; 3]> {
    let mut middles = HashMap::new();
    let mut middle = |a: usize, b: usize| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            points.push((points[a] + points[b]).normalize());
            points.len() - 1
        })
    };
    let mut finer = Vec::with_capacity(4 * triangles.len());
    for &[a, b, c] in triangles {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    finer
}

/// Sides of a tube, if nothing is said.
pub(super) const SIDES: u32 = 64;
/// Fewest and most.
pub(super) const SIDES_IN: std::ops::RangeInclusive<u32> = 3..=65_536;

/// Of an upright tube: the middle of its lower end, and what is said of its size.
#[derive(Clone, Copy)]
pub(super) struct Tube {
    pub centre: DVec3,
    /// Of the outer wall.
    pub radius: f64,
    pub thickness: f64,
    pub height: f64,
    pub sides: u32,
}

/// A tube of 8 triangles a side: two round walls with their own normals, between flat ends.
pub(super) fn tube(of: Tube, material: u32) -> Vec<Face> {
    let way = |side: u32| {
        let (sine, cosine) = (std::f64::consts::TAU * f64::from(side % of.sides) / f64::from(of.sides)).sin_cos();
        DVec3::new(cosine, 0.0, sine)
    };
    let up = of.height * DVec3::Y;
    let wall = |radius: f64, [from, to]: [DVec3; 2], outwards: f64| {
        let [low_from, low_to] = [from, to].map(|way| of.centre + radius * way);
        let normals = [from, to].map(|way| (outwards * way).as_vec3());
        // Around the corners of a quad; the first half has the first three.
        let quad = quad([low_from, low_from + up, low_to + up, low_to], material);
        let corners = [[0, 0, 1], [0, 1, 1]];
        [0, 1].map(|half: usize| Face { normals: corners[half].map(|corner: usize| normals[corner]), ..quad[half] })
    };
    let inner = of.radius - of.thickness;
    (0..of.sides)
        .flat_map(|side| {
            let ways = [way(side), way(side + 1)];
            let [outer_from, outer_to] = ways.map(|way| of.centre + of.radius * way);
            let [inner_from, inner_to] = ways.map(|way| of.centre + inner * way);
            let top = quad([inner_from + up, inner_to + up, outer_to + up, outer_from + up], material);
            let bottom = quad([inner_from, outer_from, outer_to, inner_to], material);
            let inside = wall(inner, [ways[1], ways[0]], -1.0);
            [wall(of.radius, ways, 1.0), inside, top, bottom].concat()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(faces: &[Face]) -> f64 {
        faces.iter().map(|face| face.positions[0].dot(face.positions[1].cross(face.positions[2])) / 6.0).sum()
    }

    #[test]
    fn boxes_and_spheres_are_closed_and_face_outwards() {
        let cuboid = cuboid(DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, 4.0, 6.0), 0);
        assert!((volume(&cuboid) - 6.0).abs() < 1e-12);
        let sphere = sphere(DVec3::new(5.0, 0.0, 0.0), 2.0, 5, 0);
        assert_eq!(sphere.len(), 20 << 10);
        assert!((volume(&sphere) / (32.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 2e-3);
        let tube = tube(Tube { centre: DVec3::new(5.0, 1.0, 0.0), radius: 2.0, thickness: 0.5, height: 3.0, sides: 200 }, 0);
        assert_eq!(tube.len(), 1600);
        assert!((volume(&tube) / ((4.0 - 2.25) * 3.0 * std::f64::consts::PI) - 1.0).abs() < 2e-3);
        for face in &tube {
            let [a, b, c] = face.positions;
            let plane = (b - a).cross(c - a).as_vec3().normalize();
            assert!(face.normals.iter().all(|normal| normal.dot(plane) > 0.99 || *normal == glam::Vec3::ZERO), "{face:?}");
        }
    }
}
