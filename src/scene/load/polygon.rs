//! Polygons as triangles.

use super::guard;
use glam::DVec3;

/// The most corners of a polygon that is cut at its ears: the time that it takes grows with their square.
pub(super) const MAX_CORNERS: usize = 4096;

/// Squared corners of all polygons of a file that are cut at their ears, at most: so that no file takes minutes.
pub(super) const MAX_WORK: u64 = 1 << 30;

/// What is nothing beside a polygon's area: single precision would not show it.
const NOTHING: f64 = 1e-7;

/// How a polygon becomes triangles.
#[derive(Debug, PartialEq)]
pub(super) enum Cut {
    /// A fan around the first corner covers it, and nothing else.
    Fan,
    /// The numbers of each triangle's corners, in the polygon's order.
    Triangles(Vec<[usize; 3]>),
    /// Seen along its normal it crosses itself, or it has too many corners, or no work is left. A fan covers it and may cover more.
    Unclear,
}

impl Cut {
    /// What a note says of unclear polygons, after their number.
    pub const UNCLEAR: &str = "polygons are twisted, cross themselves, have more than 4096 corners, or are too many of thousands of corners: they were filled as fans, \
                               which may cover more than the polygon";

    /// The numbers of the corners of the triangles of a polygon of so many.
    pub fn triangles(&self, count: usize) -> impl Iterator<Item = [usize; 3]> + '_ {
        let (cut, fan) = match self {
            Self::Triangles(triangles) => (triangles.as_slice(), 0..0),
            Self::Fan | Self::Unclear => (&[][..], 1..count - 1),
        };
        cut.iter().copied().chain(fan.map(|at| [0, at, at + 1]))
    }
}

/// Cuts a polygon of `count` corners, which need not lie in a plane: its mean plane decides (Newell). What cutting takes is taken off `work`.
pub(super) fn cut(count: usize, corner: impl Fn(usize) -> DVec3, work: &mut u64) -> Cut {
    if count <= 3 {
        return Cut::Fan;
    }
    let origin = corner(0);
    let fan = || (1..count - 1).map(|i| (corner(i) - origin).cross(corner(i + 1) - origin));
    let (sum, total) = fan().fold((DVec3::ZERO, 0.0), |(sum, total), cross| (sum + cross, total + cross.length()));
    let nothing = NOTHING * total;
    let widest = (1..count).map(|i| corner(i).distance_squared(origin)).fold(0.0, f64::max);
    if total <= NOTHING * widest {
        return Cut::Fan;
    }
    let Some(normal) = sum.try_normalize().filter(|_| sum.length() > nothing) else { return Cut::Unclear };
    if fan().all(|cross| cross.dot(normal) >= -nothing) {
        return Cut::Fan;
    }
    let Some(left) = work.checked_sub((count * count) as u64).filter(|_| count <= MAX_CORNERS) else { return Cut::Unclear };
    *work = left;
    let (right, up) = normal.any_orthonormal_pair();
    let flat: Vec<[f64; 2]> = (0..count).map(|i| corner(i) - origin).map(|at| [at.dot(right), at.dot(up)].map(|x| x / total.sqrt())).collect();
    cut_ears(&flat, sum.length() / total).map_or(Cut::Unclear, Cut::Triangles)
}

/// Triangles of a polygon in the plane, counter-clockwise; None where they do not add up to its doubled area.
fn cut_ears(corners: &[[f64; 2]], doubled_area: f64) -> Option<Vec<[usize; 3]>> {
    let numbers = guard(|| earcutr::earcut(corners.as_flattened(), &[], 2).ok()).flatten()?;
    let (mut triangles, mut covered) = (Vec::with_capacity(corners.len() - 2), 0.0);
    for &[a, b, c] in numbers.as_chunks().0 {
        let cross = cross(corners, [a, b, c])?;
        covered += cross.abs();
        triangles.push(if cross < 0.0 { [a, c, b] } else { [a, b, c] });
    }
    ((covered - doubled_area).abs() <= 10.0 * NOTHING).then_some(triangles)
}

fn cross(corners: &[[f64; 2]], triangle: [usize; 3]) -> Option<f64> {
    let [a, b, c] = triangle.map(|corner| corners.get(corner));
    let (a, b, c) = (a?, b?, c?);
    Some((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec2};

    /// The polygon somewhere in space.
    fn placed(corners: &[[f64; 2]]) -> Vec<DVec3> {
        let turn = DQuat::from_rotation_x(0.7) * DQuat::from_rotation_y(-2.1);
        corners.iter().map(|&[x, y]| turn * DVec3::new(x, y, 0.0) + DVec3::new(300.0, -20.0, 7.0)).collect()
    }

    fn cut_placed(corners: &[[f64; 2]]) -> (Cut, f64) {
        let placed = placed(corners);
        let cut = cut(placed.len(), |i| placed[i], &mut MAX_WORK.clone());
        let fan: Vec<[usize; 3]> = (1..placed.len() - 1).map(|i| [0, i, i + 1]).collect();
        let triangles = if let Cut::Triangles(triangles) = &cut { triangles } else { &fan };
        let area = triangles.iter().map(|t| (placed[t[1]] - placed[t[0]]).cross(placed[t[2]] - placed[t[0]]).length() / 2.0).sum();
        (cut, area)
    }

    const U: [[f64; 2]; 8] = [[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [2.0, 3.0], [2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];

    #[test]
    fn concave_polygons_keep_their_area() {
        for start in 0..U.len() {
            let mut corners = U;
            corners.rotate_left(start);
            for _ in 0..2 {
                let (cut, area) = cut_placed(&corners);
                assert!((area - 7.0).abs() < 1e-9, "{corners:?}: {cut:?}");
                corners.reverse();
            }
        }
    }

    #[test]
    fn triangles_keep_the_side_of_their_polygon() {
        let placed = placed(&U);
        let Cut::Triangles(triangles) = cut(placed.len(), |i| placed[i], &mut MAX_WORK.clone()) else { panic!("not cut") };
        let cross = |t: &[usize; 3]| (placed[t[1]] - placed[t[0]]).cross(placed[t[2]] - placed[t[0]]);
        let first = cross(&triangles[0]);
        assert!(triangles.iter().all(|triangle| cross(triangle).dot(first) > 0.0), "{triangles:?}");
    }

    /// As ever, so that pictures stay as they are: also with corners on an edge, twice the same corner and a fold.
    #[test]
    fn convex_polygons_are_fans() {
        let circle: Vec<[f64; 2]> = (0..100).map(|i| DVec2::from_angle(f64::from(i) / 100.0 * std::f64::consts::TAU).to_array()).collect();
        let straight = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [2.0, 2.0], [0.0, 2.0], [0.0, 1.0]];
        for corners in [&circle[..], &straight, &U[..4], &[[0.0; 2]; 5], &[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]] {
            assert_eq!(cut_placed(corners).0, Cut::Fan, "{corners:?}");
        }
        let folded = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.4), DVec3::Y];
        assert_eq!(cut(4, |i| folded[i], &mut MAX_WORK.clone()), Cut::Fan);
    }

    #[test]
    fn polygons_that_cross_themselves_are_known() {
        let bow = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        let pentagram: Vec<[f64; 2]> = (0..5).map(|i| DVec2::from_angle(f64::from(2 * i) / 5.0 * std::f64::consts::TAU).to_array()).collect();
        for corners in [&bow[..], &pentagram] {
            assert_eq!(cut_placed(corners).0, Cut::Unclear, "{corners:?}");
        }
    }

    /// A square with a hole, its border one line that goes in and out along a bridge.
    #[test]
    fn work_on_polygons_ends() {
        let (placed, mut work) = (placed(&U), 100);
        let mut of_many = std::iter::repeat_with(|| cut(placed.len(), |i| placed[i], &mut work)).take(3);
        assert!(matches!(of_many.next(), Some(Cut::Triangles(_))) && of_many.all(|cut| cut == Cut::Unclear));
    }

    #[test]
    fn polygons_that_touch_themselves_are_cut() {
        let keyhole = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [0.0, 0.0], [1.0, 1.0], [1.0, 3.0], [3.0, 3.0], [3.0, 1.0], [1.0, 1.0]];
        let (cut, area) = cut_placed(&keyhole);
        assert!((area - 12.0).abs() < 1e-9, "{cut:?}: {area}");
    }

    #[test]
    fn scribbles_of_any_length_end() {
        for count in [50_usize, MAX_CORNERS, 100_000] {
            let scribble: Vec<[f64; 2]> = (0..count).map(|i| [(i * 7919 % 1009) as f64, (i * 6007 % 997) as f64]).collect();
            assert_eq!(cut_placed(&scribble).0, Cut::Unclear);
        }
    }
}
