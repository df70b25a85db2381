//! Which pixels of a picture are edges: places where what is seen breaks off or turns, told by depth and normal alone.
//!
//! Light is not asked: what a method draws wrong must not decide where it is judged.

use super::layers::{Layer, Layers};
use crate::math::windows::Windows;

/// Two neighbours belong to one surface if their normals are no farther apart than this [degrees].
pub const TURN: f32 = 20.0;

/// A step in depth, as a share of it, that is one whatever the slopes beside it.
pub const STEP: f32 = 0.01;

/// How far away a pixel may be that decides over this one: an edge counts one pixel beyond its two sides, and slopes are taken from the next pixels.
pub const REACH: u32 = 3;

/// What the pixels of a picture see.
pub struct Geometry<'a> {
    size: [usize; 2],
    /// Along the camera's axis; 0 where no surface is seen.
    depth: &'a [f32],
    /// x, y and z.
    normal: [&'a [f32]; 3],
    /// What is known; all if nothing is said.
    windows: Option<Windows>,
}

impl<'a> Geometry<'a> {
    /// From the layers `depth` and `normal`. None where the picture lacks one, or all is empty.
    pub fn of(picture: &'a Layers) -> Option<Self> {
        let plane = |layer: &'a Layer, name: &str| layer.channels.get(name).map(Vec::as_slice);
        let depth = picture.layers.get("depth")?.channels.values().next()?.as_slice();
        let normal = picture.layers.get("normal")?;
        let normal = [plane(normal, "X")?, plane(normal, "Y")?, plane(normal, "Z")?];
        Some(Self { size: [picture.width as usize, picture.height as usize], depth, normal, windows: picture.windows().ok()? })
    }

    /// Whether each pixel is an edge, rows from the top; None where it sees no surface, or too little around it is known.
    pub fn edges(&self) -> Vec<Option<bool>> {
        let mut edges = self.widened(&self.sides());
        if let Some(windows) = &self.windows {
            let told = windows.mask(self.size.map(|side| side as u32), REACH);
            edges.iter_mut().zip(told).filter(|(_, told)| !told).for_each(|(edge, _)| *edge = None);
        }
        edges
    }

    fn is_surface(&self, at: usize) -> bool {
        self.depth[at] > 0.0
    }

    /// The pixels on both sides of each edge between neighbours in a row or a column.
    fn sides(&self) -> Vec<bool> {
        let mut sides = vec![false; self.depth.len()];
        for [of_line, step, lines, length] in [[self.size[0], 1, self.size[1], self.size[0]], [1, self.size[0], self.size[0], self.size[1]]] {
            for line in 0..lines {
                let at = |place: usize| line * of_line + place * step;
                for place in 1..length {
                    let [p, q] = [at(place - 1), at(place)];
                    let beside = [place.checked_sub(2).map(at), (place + 1 < length).then(|| at(place + 1))];
                    if self.breaks([p, q], beside) {
                        (sides[p], sides[q]) = (true, true);
                    }
                }
            }
        }
        sides
    }

    /// Whether there is an edge between neighbours, with the pixels before and after them in the line.
    fn breaks(&self, [p, q]: [usize; 2], beside: [Option<usize>; 2]) -> bool {
        match [p, q].map(|at| self.is_surface(at)) {
            [true, true] => self.turns([p, q]) || self.steps([p, q], beside),
            [before, after] => before != after,
        }
    }

    fn turns(&self, [p, q]: [usize; 2]) -> bool {
        let dot = |a: usize, b: usize| self.normal.iter().map(|axis| axis[a] * axis[b]).sum::<f32>();
        dot(p, q) < TURN.to_radians().cos() * (dot(p, p) * dot(q, q)).sqrt()
    }

    /// Whether depth steps. One over depth is linear along the picture of a plane, however it leans: a step is a change that the changes before and
    /// after do not foretell. Where surfaces meet in a crease, the change across it lies between these two.
    fn steps(&self, [p, q]: [usize; 2], [o, r]: [Option<usize>; 2]) -> bool {
        let inverse = |at: usize| 1.0 / self.depth[at];
        let change = inverse(q) - inverse(p);
        let slopes = [o.map(|o| (o, p)), r.map(|r| (q, r))].into_iter().flatten().filter(|&(a, b)| self.is_surface(a) && self.is_surface(b));
        let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
        for slope in slopes.map(|(a, b)| inverse(b) - inverse(a)) {
            (least, most) = (least.min(slope), most.max(slope));
        }
        // Two pixels that see a surface, alone in their line: what their slope is nobody knows.
        let expected = if least <= most { change.clamp(least, most) } else { 0.0 };
        (change - expected).abs() > STEP * inverse(p).max(inverse(q))
    }

    /// Surfaces within one pixel of a side, diagonally too.
    fn widened(&self, sides: &[bool]) -> Vec<Option<bool>> {
        let [width, height] = self.size;
        let near = |place: usize, length: usize| place.saturating_sub(1)..(place + 2).min(length);
        let is_edge = |at: usize| near(at / width, height).any(|y| near(at % width, width).any(|x| sides[y * width + x]));
        (0..self.depth.len()).map(|at| self.is_surface(at).then(|| is_edge(at))).collect()
    }
}

/// Numbers the surfaces that pixels belong to: those off the edges that are joined along rows and columns have one number. None on edges and elsewhere.
pub fn surfaces(edges: &[Option<bool>], width: usize) -> Vec<Option<u32>> {
    let mut surfaces = vec![None; edges.len()];
    let (mut open, mut number) = (Vec::new(), 0);
    for start in 0..edges.len() {
        if edges[start] != Some(false) || surfaces[start].is_some() {
            continue;
        }
        open.push(start);
        surfaces[start] = Some(number);
        while let Some(at) = open.pop() {
            let column = at % width;
            let beside = [(column > 0).then(|| at - 1), (column + 1 < width).then_some(at + 1), at.checked_sub(width), Some(at + width)];
            for next in beside.into_iter().flatten().filter(|&next| next < edges.len()) {
                if edges[next] == Some(false) && surfaces[next].is_none() {
                    surfaces[next] = Some(number);
                    open.push(next);
                }
            }
        }
        number += 1;
    }
    surfaces
}

#[cfg(test)]
mod tests {
    use super::super::layers::WINDOWS;
    use super::*;
    use glam::Vec3;

    /// A picture of what planes `(normal, distance)` show to a viewer at the origin who looks along −z, 90° wide, nearest first come; no plane, no surface.
    fn seen(size: [u32; 2], plane: impl Fn(f32, f32) -> Option<(Vec3, f32)>) -> Layers {
        let [width, height] = size;
        let (mut depth, mut normals) = (Vec::new(), Vec::new());
        for at in 0..width * height {
            let x = ((at % width) as f32 + 0.5) / width as f32 * 2.0 - 1.0;
            let y = (1.0 - ((at / width) as f32 + 0.5) / height as f32 * 2.0) * height as f32 / width as f32;
            let (normal, distance) = plane(x, y).unwrap_or((Vec3::ZERO, 0.0));
            let along = normal.dot(Vec3::new(x, y, -1.0));
            depth.push(if along == 0.0 { 0.0 } else { distance / along });
            normals.extend(normal.to_array());
        }
        Layers::new(width, height).with("depth", Layer::value(depth)).with("normal", Layer::interleaved(&["X", "Y", "Z"], &normals, 3))
    }

    fn edges(picture: &Layers) -> Vec<Option<bool>> {
        Geometry::of(picture).unwrap().edges()
    }

    fn columns(edges: &[Option<bool>], width: usize) -> Vec<usize> {
        (0..width).filter(|x| edges.iter().skip(*x).step_by(width).all(|edge| *edge == Some(true))).collect()
    }

    /// Facing the viewer, at that depth: `depth = distance / (n·d)` with n = +z needs a negative distance.
    fn facing(depth: f32) -> Option<(Vec3, f32)> {
        Some((Vec3::Z, -depth))
    }

    #[test]
    fn a_plane_has_no_edge_however_it_leans() {
        for lean in [0.0f32, 45.0, 80.0, 89.0] {
            // A floor below the viewer that rises to face him.
            let normal = Vec3::new(0.0, lean.to_radians().sin(), lean.to_radians().cos());
            let floor = seen([48, 48], |_, y| (normal.dot(Vec3::new(0.0, y, -1.0)) < -0.01).then_some((normal, -3.0)));
            let found = edges(&floor);
            let horizon = (0..48).filter(|y| found[y * 48..][..48].contains(&None)).count();
            // The horizon's own edge is two rows wide.
            assert!((0..48 * 48).all(|at| found[at].is_none() || (found[at] == Some(true)) == (horizon > 0 && at / 48 < horizon + 2)), "{lean}");
        }
    }

    #[test]
    fn steps_and_turns_are_edges_two_pixels_to_each_side() {
        let step = |near: f32| columns(&edges(&seen([40, 20], |x, _| facing(if x < 0.0 { near } else { 10.0 }))), 40);
        assert_eq!(step(9.8), [18, 19, 20, 21]);
        assert_eq!(step(9.95), [0; 0], "half a per cent is no step");
        let turn = |degrees: f32| {
            let wall = Vec3::new(-degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
            columns(&edges(&seen([40, 20], |x, _| if x < 0.0 { facing(10.0) } else { Some((wall, -10.0 * wall.z)) })), 40)
        };
        assert_eq!(turn(25.0), [18, 19, 20, 21]);
        assert_eq!(turn(15.0), [0; 0]);
    }

    #[test]
    fn thin_things_and_outlines_are_edges_all_over() {
        let pole = |width: u32| columns(&edges(&seen([40, 20], |x, _| facing(if ((x + 1.0) * 20.0) as u32 / width == 20 / width { 2.0 } else { 10.0 }))), 40);
        assert_eq!(pole(1), [18, 19, 20, 21, 22]);
        assert_eq!(pole(2), [18, 19, 20, 21, 22, 23]);
        let half = edges(&seen([40, 20], |x, _| if x < 0.0 { facing(10.0) } else { None }));
        assert_eq!(columns(&half, 40), [18, 19]);
        assert!(half.iter().enumerate().all(|(at, edge)| edge.is_some() == (at % 40 < 20)));
    }

    #[test]
    fn a_round_thing_is_no_edge_but_for_its_outline() {
        // A ball of 120 pixels: near its outline normals turn fast from pixel to pixel.
        let side = 160;
        let (mut depth, mut normals) = (Vec::new(), Vec::new());
        for at in 0..side * side {
            let [x, y] = [at % side, at / side].map(|i| (i as f32 + 0.5 - side as f32 / 2.0) / 60.0);
            let z = (1.0 - x * x - y * y).max(0.0).sqrt();
            depth.push(if z > 0.0 { 5.0 - z } else { 9.0 });
            normals.extend(if z > 0.0 { [x, y, z] } else { [0.0, 0.0, 1.0] });
        }
        let ball = Layers::new(side, side).with("depth", Layer::value(depth)).with("normal", Layer::interleaved(&["X", "Y", "Z"], &normals, 3));
        for (at, edge) in edges(&ball).into_iter().enumerate() {
            let [x, y] = [at as u32 % side, at as u32 / side].map(|i| i as f32 + 0.5 - side as f32 / 2.0);
            let off = x.hypot(y) - 60.0;
            if !(-6.0..=3.0).contains(&off) {
                assert_eq!(edge, Some(false), "{off} pixels off the outline");
            } else if off.abs() <= 1.0 {
                assert_eq!(edge, Some(true), "{off} pixels off the outline");
            }
        }
    }

    #[test]
    fn windows_tell_what_the_whole_picture_tells() {
        let whole = seen([90, 80], |x, y| facing(if x * x + y * y < 0.4 { 5.0 } else { 10.0 }));
        let expected = edges(&whole);
        let told: Windows = "20,10".parse().unwrap();
        let inside = told.mask([90, 80], 0);
        let mut part = whole.with_attribute(WINDOWS, &told);
        part.layers.values_mut().flat_map(|layer| layer.channels.values_mut()).for_each(|plane| {
            plane.iter_mut().zip(&inside).filter(|(_, inside)| !**inside).for_each(|(value, _)| *value = 0.0);
        });
        let found = edges(&part);
        let inner = told.mask([90, 80], REACH);
        assert!((0..90 * 80).all(|at| found[at] == if inner[at] { expected[at] } else { None }));
        assert!(found.contains(&Some(true)) && found.contains(&Some(false)));
    }

    #[test]
    fn surfaces_end_at_edges() {
        let [o, e, n] = [Some(false), Some(true), None];
        let found = surfaces(&[o, e, o, o, e, n, o, o, o], 3);
        assert_eq!(found, [Some(0), None, Some(1), Some(0), None, None, Some(0), Some(0), Some(0)]);
        assert!(Geometry::of(&Layers::new(1, 1)).is_none());
    }
}
