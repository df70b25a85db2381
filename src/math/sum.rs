//! The sum of one tile in double precision: what every summation on the GPU must agree with.

use super::{
    colour::luminance,
    frame::Frame,
    hemisphere::{Edge, Sample, Table},
    radius::Ellipse,
    weight::Record,
};
use glam::{DVec3, Vec3};

/// What a hemisphere of samples adds up to, in the record's frame (x, y, z along the normal).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summed {
    /// Red, green, blue [W/m²].
    pub irradiance: DVec3,
    /// Standard error of it, by what neighbouring samples differ by [W/m²].
    pub error: DVec3,
    /// Rotation gradient of each channel [W/m² per radian].
    pub rotation: [DVec3; 3],
    /// Translation gradient of each channel, along the normal too [W/m² per scene unit].
    pub translation: [DVec3; 3],
    /// xx, xy and yy of the second derivatives of the luminance along the surface [W/m² per square scene unit].
    pub hessian: DVec3,
    /// Harmonic mean distance in the cosine measure, for irradiance [scene units]; infinite where only sky is seen.
    pub harmonic_mean_cosine: f64,
    /// The same in the plain measure, for radiance.
    pub harmonic_mean_plain: f64,
    /// Distance of the nearest surface; infinite where only sky is seen.
    pub min_distance: f64,
}

/// A tile that does not fit its table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a tile of {found} samples for a table of {expected}")]
pub struct SizeError {
    pub found: usize,
    pub expected: usize,
}

/// Sums a tile. `radiance` holds red, green, blue [W m⁻² sr⁻¹] and the distance [scene units] of each sample of the
/// table, sky at infinity (any distance whose inverse is negligible will do). Distances count as `nearest` at least
/// (> 0), so that contact does not make gradients infinite. Samples without weight are not read.
///
/// # Errors
/// When the tile has another number of samples than the table.
pub fn sum(table: &Table, radiance: &[[f32; 4]], nearest: f64) -> Result<Summed, SizeError> {
    if radiance.len() != table.samples.len() {
        return Err(SizeError { found: radiance.len(), expected: table.samples.len() });
    }
    let mut total = Total::default();
    for (sample, &texel) in table.samples.iter().zip(radiance).filter(|(sample, _)| sample.plain_weight > 0.0) {
        total.add(sample, colour(texel), distance(texel, nearest));
    }
    for edge in &table.edges {
        let beside = |sample: u32| Beside::new(radiance[sample as usize], table.samples[sample as usize].depth_cosine, nearest);
        total.add_wall(edge, &beside(edge.a), &beside(edge.b));
    }
    for last in table.blocks.iter().map(|last| *last as usize) {
        let above = last - table.width as usize;
        let [a, b, c, d] = [above - 1, above, last - 1, last].map(|sample| colour(radiance[sample]));
        total.add_block(table.samples[last].cosine_weight, (a - b) - (c - d));
    }
    Ok(total.finish(table.block_share()))
}

/// Radius of a record that sees nothing but sky [scene units].
const FAR_AWAY: f64 = 1e30;

fn colour(texel: [f32; 4]) -> DVec3 {
    DVec3::new(texel[0].into(), texel[1].into(), texel[2].into())
}

fn distance(texel: [f32; 4], nearest: f64) -> f64 {
    f64::from(texel[3]).max(nearest)
}

/// `gradient` times each channel.
fn add_outer(sum: &mut [DVec3; 3], channels: DVec3, gradient: DVec3) {
    for (sum, channel) in sum.iter_mut().zip(channels.to_array()) {
        *sum += gradient * channel;
    }
}

/// A sample beside a wall.
pub(super) struct Beside {
    radiance: DVec3,
    inverse_depth: f64,
}

impl Beside {
    pub(super) fn new(texel: [f32; 4], depth_cosine: f64, nearest: f64) -> Self {
        Self { radiance: colour(texel), inverse_depth: 1.0 / (distance(texel, nearest) * depth_cosine) }
    }
}

#[derive(Default)]
pub(super) struct Total {
    pub irradiance: DVec3,
    /// Squares of the blocks' mixed differences, times their weights.
    pub squares: DVec3,
    pub rotation: [DVec3; 3],
    pub translation: [DVec3; 3],
    pub hessian: DVec3,
    /// Weight and weight over distance, in the cosine and in the plain measure.
    pub cosine: [f64; 2],
    pub plain: [f64; 2],
    /// 1 over the nearest distance.
    pub largest_inverse: f64,
}

impl Total {
    fn add(&mut self, sample: &Sample, radiance: DVec3, distance: f64) {
        let inverse = 1.0 / distance;
        self.irradiance += radiance * sample.cosine_weight;
        add_outer(&mut self.rotation, radiance, DVec3::new(sample.rotation[0], sample.rotation[1], 0.0));
        for (sum, weight) in [(&mut self.cosine, sample.cosine_weight), (&mut self.plain, sample.plain_weight)] {
            *sum = [sum[0] + weight, sum[1] + weight * inverse];
        }
        self.largest_inverse = self.largest_inverse.max(inverse);
    }

    pub(super) fn add_wall(&mut self, edge: &Edge, a: &Beside, b: &Beside) {
        let inverse = a.inverse_depth.max(b.inverse_depth);
        let step = (b.radiance - a.radiance) * inverse;
        add_outer(&mut self.translation, step, DVec3::from(edge.gradient));
        self.hessian += DVec3::from(edge.hessian) * (luminance(step) * inverse);
    }

    /// Adds the mixed difference of a block of samples, which have a weight.
    fn add_block(&mut self, weight: f64, mixed: DVec3) {
        self.squares += (mixed * weight).powf(2.0);
    }

    /// Adds what other samples of the tile add up to.
    pub(super) fn join(&mut self, other: &Self) {
        self.irradiance += other.irradiance;
        self.squares += other.squares;
        self.hessian += other.hessian;
        let vectors = self.rotation.iter_mut().chain(&mut self.translation).zip(other.rotation.iter().chain(&other.translation));
        vectors.for_each(|(sum, part)| *sum += *part);
        let weights = self.cosine.iter_mut().chain(&mut self.plain).zip(other.cosine.iter().chain(&other.plain));
        weights.for_each(|(sum, part)| *sum += part);
        self.largest_inverse = self.largest_inverse.max(other.largest_inverse);
    }

    /// `block_share`: [`Table::block_share`].
    pub(super) fn finish(self, block_share: f64) -> Summed {
        Summed {
            irradiance: self.irradiance,
            error: standard_error(self.squares, block_share),
            rotation: self.rotation,
            translation: self.translation,
            hessian: self.hessian,
            harmonic_mean_cosine: self.cosine[0] / self.cosine[1],
            harmonic_mean_plain: self.plain[0] / self.plain[1],
            min_distance: 1.0 / self.largest_inverse,
        }
    }
}

/// Of a sum, from the squares of its blocks' mixed differences times their weights. What samples differ by has two parts, how light changes from one to the
/// other and what chance does within each. `B = g₀₀ − g₁₀ − g₀₁ + g₁₁` leaves out a steady change and holds four times the variance of one sample; what no
/// sample has met is not in it. [`super::uncertainty`] tells more of it.
pub fn standard_error(squares: DVec3, block_share: f64) -> DVec3 {
    (squares * (0.25 * block_share)).powf(0.5)
}

impl Summed {
    /// Of the irradiance [W/m²].
    pub fn luminance(&self) -> f64 {
        luminance(self.irradiance)
    }

    /// `|∇E| / E` of the luminance along the surface [1 / scene unit].
    fn relative_gradient(&self) -> f64 {
        let along = DVec3::from_array([0, 1, 2].map(|i| luminance(DVec3::from_array(self.translation.map(|t| t[i])))));
        along.truncate().length() / self.luminance().max(1e-30)
    }

    /// The record of this hemisphere at `position`, seen in `frame`, that reaches as the ellipse says; `footprint` is
    /// the width of a pixel there.
    pub fn record(&self, position: Vec3, frame: &Frame, ellipse: Ellipse, footprint: f32) -> Record {
        let to_world = |gradient: DVec3| frame.to_world(gradient.as_vec3());
        Record {
            position,
            normal: frame.normal,
            radius: ellipse.radius.min(FAR_AWAY) as f32,
            minimum_distance: self.min_distance as f32,
            irradiance: self.irradiance.as_vec3(),
            footprint,
            error: self.error.as_vec3(),
            rotation: self.rotation.map(to_world),
            translation: self.translation.map(to_world),
            relative_gradient: self.relative_gradient().min(FAR_AWAY) as f32,
            fineness: 1.0,
            confinement: 0.0,
            stretch: to_world(ellipse.stretch.extend(0.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{
        hemisphere::{Method, Shape, tests::COMPLETE},
        oracle::{GradientErrors, Objects, gather, gradient_errors, hessian_error, tile},
    };
    use std::f64::consts::PI;

    const PLANE: Shape = Shape::Plane { fov_degrees: 126.869_897_645_844_03 };

    fn table(shape: Shape, resolution: u32, method: Method) -> Table {
        Table::new(shape, resolution, method).expect("a table")
    }

    #[test]
    fn gradients_are_told_in_proportion_to_the_luminance() {
        let all = |value: f64| DVec3::splat(value);
        let summed = Total { irradiance: all(4.0), translation: [DVec3::new(6.0, 8.0, 5.0); 3], ..Total::default() }.finish(1.0);
        assert!((summed.luminance() - 4.0).abs() < 1e-12 && (summed.relative_gradient() - 2.5).abs() < 1e-12);
    }

    fn assert_near(found: f64, expected: f64, tolerance: f64, what: impl std::fmt::Debug) {
        assert!((found - expected).abs() <= tolerance, "{what:?}: {found}, not {expected}");
    }

    /// A plane with border extension, and the complete shapes.
    fn closed(resolution: u32) -> Vec<(Shape, Table)> {
        COMPLETE.into_iter().chain([PLANE]).map(|shape| (shape, table(shape, resolution, Method::BorderExtension))).collect()
    }

    #[test]
    fn a_furnace_is_pi_and_has_no_gradients() {
        for (shape, table) in closed(64) {
            let summed = gather(&table, |direction| (1.0, 0.3 + direction.x.abs()));
            assert_near(summed.irradiance.x, PI, 1e-9, shape);
            assert!(summed.translation[0].length() == 0.0 && summed.rotation[0].length() < 1e-9, "{shape:?}");
        }
    }

    #[test]
    fn an_endless_ceiling_has_one_and_a_half_times_its_height() {
        let height = 0.7;
        for shape in COMPLETE {
            let summed = gather(&table(shape, 128, Method::None), |direction| (1.0, height / direction.z));
            assert_near(summed.harmonic_mean_cosine / height, 1.5, 2e-3, shape);
            // A stratum at the horizon has much of the plain solid angle; a ray that is shifted passes anywhere in it.
            assert_near(summed.harmonic_mean_plain / height, 2.0, if shape == Shape::Concentric { 3e-2 } else { 2e-2 }, shape);
            assert_near(summed.min_distance / height, 1.0, 5e-3, shape);
        }
        let plane = |method: Method| gather(&table(PLANE, 128, method), |direction| (1.0, height / direction.z)).harmonic_mean_cosine / height;
        assert_near(plane(Method::None), 1.34, 0.01, "the window alone");
        assert_near(plane(Method::BorderExtension), 1.45, 0.01, "with the band at the border's distances");
    }

    #[test]
    fn the_sky_is_infinitely_far() {
        let summed = gather(&table(PLANE, 16, Method::BorderExtension), |direction| (direction.x + 1.0, f64::INFINITY));
        assert!(summed.harmonic_mean_cosine == f64::INFINITY && summed.min_distance == f64::INFINITY);
        assert_eq!(summed.translation[0], DVec3::ZERO);
        let far = gather(&table(PLANE, 16, Method::BorderExtension), |direction| (direction.x + 1.0, f32::MAX.into()));
        assert!(far.translation[0].length() < 1e-30 && far.harmonic_mean_cosine > 1e30);
    }

    #[test]
    fn contact_is_bounded_and_unused_samples_are_not_read() {
        let table = table(Shape::Hemispherical, 8, Method::None);
        let mut texels = tile(&table, |direction| (direction.x, 0.0));
        texels[0] = [f32::NAN; 4];
        let summed = sum(&table, &texels, 0.5).expect("fits");
        assert!(summed.translation[0].is_finite() && summed.irradiance.is_finite());
        assert_eq!(summed.min_distance, 0.5);
        assert_eq!(sum(&table, &texels[1..], 0.5), Err(SizeError { found: 63, expected: 64 }));
    }

    /// The point in the middle and in a corner of a unit cube's floor: irradiance of each face over π.
    #[test]
    fn unit_cubes_have_their_form_factors() {
        let face_seen = |point: DVec3, direction: DVec3, axis: usize, side: f64| {
            let exit = |i: usize| ((if direction[i] > 0.0 { 1.0 } else { 0.0 }) - point[i]) / direction[i];
            let distance = exit(0).min(exit(1)).min(exit(2));
            let hit = exit(axis) == distance && (direction[axis] > 0.0) == (side > 0.0);
            (if hit { 1.0 } else { 0.0 }, distance)
        };
        let factor = |table: &Table, point: DVec3, axis: usize, side: f64| gather(table, |d| face_seen(point, d, axis, side)).irradiance.x / PI;
        let middle = DVec3::new(0.5, 0.5, 0.0);
        for (shape, table) in closed(512) {
            // A plane cannot see the walls' feet: the band takes them as walls, which is what they are.
            let tolerance = if shape == Shape::Hemicube { 1e-3 } else { 2e-3 };
            assert_near(factor(&table, middle, 2, 1.0), 0.23946, tolerance, shape);
            for (axis, side) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)] {
                assert_near(factor(&table, middle, axis, side), 0.1901, tolerance, shape);
            }
            let corner = DVec3::new(1e-7, 1e-7, 0.0);
            assert_near(factor(&table, corner, 2, 1.0), 0.13853, tolerance, shape);
            assert_near(factor(&table, corner, 0, 1.0), 0.05573, tolerance, shape);
            assert_near(factor(&table, corner, 0, -1.0), 0.375, tolerance, shape);
        }
        // The ceiling's edges fall between pixels, and the window holds all of it.
        let bare = factor(&table(PLANE, 64, Method::None), middle, 2, 1.0);
        assert_near(bare, 0.239_46, 5e-6, "bare");
        assert_near(factor(&table(PLANE, 64, Method::BorderExtension), middle, 2, 1.0), bare, 1e-12, "extended");
        assert_near(factor(&table(PLANE, 64, Method::CoverageRatio), middle, 2, 1.0) * 0.831, bare, 1e-3, "ratio");
    }

    /// A sky of 1 over a black wall, endless along y: `E = π/2·(1 + x/√(x²+H²))`.
    #[test]
    fn a_wall_hides_its_part_of_the_sky() {
        let (x, height) = (1.0, 0.8);
        let expected = PI / 2.0 * (1.0 + x / f64::hypot(x, height));
        for (shape, table) in closed(256) {
            let hidden = |direction: DVec3| direction.x > 0.0 && direction.z / direction.x * x < height;
            let summed = gather(&table, |d| if hidden(d) { (0.0, x / d.x) } else { (1.0, f64::INFINITY) });
            // The plane takes what stands lower than its window, far along the wall, for sky.
            let tolerance = if matches!(shape, Shape::Plane { .. }) { 0.015 } else { 2e-3 };
            assert_near(summed.irradiance.x / expected, 1.0, tolerance, shape);
            // dE/dx, from the derivative of the same formula.
            let slope = PI / 2.0 * height * height / f64::hypot(x, height).powi(3);
            assert_near(-summed.translation[0].x / slope, 1.0, 3.0 * tolerance.max(5e-3), shape);
        }
    }

    #[test]
    fn gradients_match_differences_of_the_closed_form() {
        // Root mean square over 48 points: translation along the surface, along the normal, rotation.
        for (resolution, limits) in [(64, [0.05, 0.03, 0.05]), (512, [0.005, 0.003, 0.003])] {
            for (shape, table) in closed(resolution) {
                let GradientErrors { tangent, normal, rotation } = gradient_errors(&table, Objects { occluder: true, wall: false });
                // The plane's pixels are the widest.
                let share = if shape == PLANE { 2.0 } else { 1.0 };
                for (error, limit) in [tangent, normal, rotation].into_iter().zip(limits.map(|limit| limit * share)) {
                    assert!(error < limit, "{shape:?} {resolution}: {error} over {limit}");
                }
            }
        }
    }

    #[test]
    fn second_derivatives_match_differences_of_the_closed_form() {
        let alone = Objects { occluder: false, wall: false };
        for (resolution, limit) in [(64, 0.02), (256, 0.011)] {
            for (shape, table) in closed(resolution) {
                let error = hessian_error(&table, alone);
                assert!(error < limit, "{shape:?} {resolution}: {error} over {limit}");
            }
        }
        // Where a near edge crosses a far one, the crossing moves along both, which no wall alone can tell.
        let crossing = hessian_error(&table(Shape::Hemicube, 256, Method::None), Objects { occluder: true, wall: false });
        assert!((0.5..0.65).contains(&crossing), "{crossing}");
    }

    /// A wall that floats below the plane's window: complete shapes see it, the bands of the plane let it stand on the
    /// floor, which its rotation gradient shows most.
    #[test]
    fn gradients_of_complete_shapes_reach_down_to_the_horizon() {
        let errors = |shape: Shape| gradient_errors(&table(shape, 512, Method::BorderExtension), Objects { occluder: true, wall: true });
        for shape in COMPLETE {
            let GradientErrors { tangent, normal, rotation } = errors(shape);
            assert!(tangent < 0.006 && normal < 0.004 && rotation < 0.008, "{shape:?}: {tangent} {normal} {rotation}");
        }
        let GradientErrors { tangent, normal, rotation } = errors(PLANE);
        assert!(tangent < 0.02 && normal < 0.12 && (0.3..0.4).contains(&rotation), "{tangent} {normal} {rotation}");
    }

    #[test]
    fn records_stand_in_world_space() {
        let table = table(Shape::Hemicube, 16, Method::None);
        let frame = Frame::new(Vec3::X).turned(0.4);
        let summed = gather(&table, |d| (1.0 + d.x, 2.0));
        let record = summed.record(Vec3::ONE, &frame, Ellipse::disc(1.5), 0.1);
        assert_eq!((record.normal, record.radius, record.minimum_distance, record.footprint), (Vec3::X, 1.5, 2.0, 0.1));
        // Brighter towards the tangent: turning the normal there, about the bitangent, brightens.
        let expected = frame.bitangent * (2.0 * PI / 3.0) as f32;
        assert!(record.rotation[1].abs_diff_eq(expected, 0.02), "{} {expected}", record.rotation[1]);
    }
}
