//! Bounds of a sphere on the screen of a pinhole camera.

use glam::{Vec2, Vec3};

/// A pinhole camera: `right`, `up` and `forward` are unit and perpendicular, `half_extent` the picture plane's half
/// width and height at distance 1, `size` the picture in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    pub eye: Vec3,
    pub right: Vec3,
    pub up: Vec3,
    pub forward: Vec3,
    pub half_extent: Vec2,
    pub size: [u32; 2],
}

/// A rectangle of pixels, rows from the top: from `min` up to, not including, `max`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelRectangle {
    pub min: [u32; 2],
    pub max: [u32; 2],
}

impl PixelRectangle {
    pub fn contains(&self, pixel: [u32; 2]) -> bool {
        (0..2).all(|i| (self.min[i]..self.max[i]).contains(&pixel[i]))
    }
}

impl Pinhole {
    /// The pixels that can show a point of the sphere; none when no point of it is in view. Never too small, and tight
    /// to a pixel: the slopes x/z and y/z of the sphere's part before the eye are bounded by its tangents (after Mara and
    /// McGuire 2013), whether it crosses the eye's plane, holds the eye, or is far off the axis.
    pub fn bounds(&self, centre: Vec3, radius: f32) -> Option<PixelRectangle> {
        let offset = centre - self.eye;
        let centre_local = Vec3::new(offset.dot(self.right), offset.dot(self.up), offset.dot(self.forward));
        // The points' own coordinates are rounded too: widen by that much.
        let magnitude = centre.abs().max_element().max(self.eye.abs().max_element());
        let radius = radius * (1.0 + 1e-5) + 1e-6 * magnitude;
        let x = slopes(centre_local.x, centre_local.z, radius)?;
        let y = slopes(centre_local.y, centre_local.z, radius)?;
        let columns = pixels(x, self.half_extent.x, self.size[0])?;
        let rows = pixels([-y[1], -y[0]], self.half_extent.y, self.size[1])?;
        Some(PixelRectangle { min: [columns[0], rows[0]], max: [columns[1], rows[1]] })
    }
}

/// Least and greatest x/z over the part with z > 0 of the disc around (x, z); none when there is no such part.
fn slopes(x: f32, z: f32, radius: f32) -> Option<[f32; 2]> {
    if z <= -radius {
        return None;
    }
    let square = x * x + z * z;
    let tangent = (square - radius * radius).max(0.0).sqrt();
    if tangent == 0.0 {
        // The disc holds the eye.
        return Some([f32::NEG_INFINITY, f32::INFINITY]);
    }
    // The two tangents from the eye, as (x, z) up to a factor: the way to the centre, turned.
    let least = Vec2::new(x * tangent - z * radius, z * tangent + x * radius);
    let greatest = Vec2::new(x * tangent + z * radius, z * tangent - x * radius);
    Some([if least.y > 0.0 { least.x / least.y } else { f32::NEG_INFINITY }, if greatest.y > 0.0 { greatest.x / greatest.y } else { f32::INFINITY }])
}

/// The pixels from the first to behind the last that an interval of slopes touches; none outside the picture.
fn pixels(slopes: [f32; 2], half_extent: f32, size: u32) -> Option<[u32; 2]> {
    let [low, high] = slopes.map(|s| (s / half_extent + 1.0) / 2.0 * size as f32);
    // A thousandth of a pixel for the rounding of the slopes themselves. Casts saturate: infinity is the picture's edge.
    let first = (low - 1e-3).floor().max(0.0) as u32;
    let end = ((high + 1e-3).floor() + 1.0).clamp(0.0, size as f32) as u32;
    (first < end).then_some([first, end])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Quat};
    use proptest::prelude::*;

    fn camera(rotation: Quat, eye: Vec3, half_extent: Vec2) -> Pinhole {
        Pinhole { eye, right: rotation * Vec3::X, up: rotation * Vec3::Y, forward: rotation * Vec3::NEG_Z, half_extent, size: [640, 480] }
    }

    /// The pixel that shows a point, in double precision.
    fn pixel(camera: &Pinhole, point: DVec3) -> Option<[u32; 2]> {
        let offset = point - camera.eye.as_dvec3();
        let depth = offset.dot(camera.forward.as_dvec3());
        let at = |axis: Vec3, half: f32, size: u32, sign: f64| (sign * offset.dot(axis.as_dvec3()) / depth / f64::from(half) + 1.0) / 2.0 * f64::from(size);
        let x = at(camera.right, camera.half_extent.x, camera.size[0], 1.0);
        let y = at(camera.up, camera.half_extent.y, camera.size[1], -1.0);
        let inside = depth > 0.0 && (0.0..f64::from(camera.size[0])).contains(&x) && (0.0..f64::from(camera.size[1])).contains(&y);
        inside.then_some([x as u32, y as u32])
    }

    fn vector() -> impl Strategy<Value = Vec3> {
        (-1.0..1.0f32, -1.0..1.0f32, -1.0..1.0f32).prop_map(Vec3::from)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// Spheres of all sizes everywhere: in view, across the eye's plane, around the eye, behind it.
        #[test]
        fn every_point_of_the_sphere_is_in_its_rectangle(
            axis in vector(), angle in 0.0..6.0f32, eye in vector(), centre in vector(), exponent in -3.0..1.0f32, width in 0.1..4.0f32,
            points in prop::collection::vec(vector(), 40), scale in -3.0..6.0f32,
        ) {
            let (rotation, unit) = (Quat::from_axis_angle(axis.try_normalize().unwrap_or(Vec3::X), angle), 10f32.powf(scale));
            let camera = camera(rotation, eye * unit, Vec2::new(width, width * 0.75));
            let (centre, radius) = (centre * unit, 10f32.powf(exponent) * unit);
            let bounds = camera.bounds(centre, radius);
            for direction in points {
                // On the sphere and inside it.
                for share in [1.0, 0.7] {
                    let point = centre.as_dvec3() + direction.as_dvec3().normalize_or_zero() * f64::from(radius) * share;
                    if let Some(pixel) = pixel(&camera, point) {
                        prop_assert!(bounds.is_some_and(|b| b.contains(pixel)), "{pixel:?} of {bounds:?}");
                    }
                }
            }
        }
    }

    /// Against the densely sampled outline: at most a pixel larger on each side.
    #[test]
    fn bounds_are_tight() {
        let camera = camera(Quat::IDENTITY, Vec3::ZERO, Vec2::new(1.0, 0.75));
        for (centre, radius) in [(Vec3::new(0.3, -0.2, -5.0), 0.5), (Vec3::new(3.0, 2.0, -4.0), 1.0), (Vec3::new(-0.8, 0.3, -1.2), 0.4)] {
            let bounds = camera.bounds(centre, radius).expect("in view");
            let (mut min, mut max) = ([u32::MAX; 2], [0; 2]);
            let steps = 600;
            for i in 0..steps * steps {
                let (z, azimuth) =
                    (1.0 - 2.0 * (f64::from(i % steps) + 0.5) / f64::from(steps), std::f64::consts::TAU * f64::from(i / steps) / f64::from(steps));
                let sine = (1.0 - z * z).sqrt();
                let point = centre.as_dvec3() + DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), z) * f64::from(radius);
                if let Some(pixel) = pixel(&camera, point) {
                    min = [0, 1].map(|i| min[i].min(pixel[i]));
                    max = [0, 1].map(|i| max[i].max(pixel[i] + 1));
                }
            }
            for i in 0..2 {
                assert!(min[i] - bounds.min[i] <= 1 && bounds.max[i] - max[i] <= 1, "{bounds:?}, seen {min:?} {max:?}");
            }
        }
    }

    #[test]
    fn rectangles_hold_their_first_pixels_and_not_those_behind_the_last() {
        let rectangle = PixelRectangle { min: [2, 5], max: [4, 9] };
        for pixel in [[2, 5], [3, 5], [2, 8], [3, 8]] {
            assert!(rectangle.contains(pixel), "{pixel:?}");
        }
        for pixel in [[1, 6], [4, 6], [3, 4], [3, 9], [0, 0]] {
            assert!(!rectangle.contains(pixel), "{pixel:?}");
        }
    }

    #[test]
    fn what_is_behind_or_beside_has_no_rectangle() {
        let camera = camera(Quat::IDENTITY, Vec3::ZERO, Vec2::new(1.0, 0.75));
        assert_eq!(camera.bounds(Vec3::new(0.0, 0.0, 2.0), 1.0), None);
        assert_eq!(camera.bounds(Vec3::new(50.0, 0.0, -2.0), 1.0), None);
        assert_eq!(camera.bounds(Vec3::new(-50.0, 0.0, 0.5), 1.0), None);
        let all = PixelRectangle { min: [0, 0], max: camera.size };
        assert_eq!(camera.bounds(Vec3::new(0.1, 0.0, 0.5), 1.0), Some(all));
        assert_eq!(camera.bounds(Vec3::new(0.0, 0.0, -2.0), f32::INFINITY), Some(all));
    }
}
