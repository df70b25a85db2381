//! Irradiance records: where one counts, how much, and what it estimates. Single precision, as the shaders compute it.

use glam::Vec3;

/// The least error that a weight divides by: it bounds the weight at the record's own place to 1e5, far above any
/// other record's, without an infinity to divide by infinity.
pub const LEAST_ERROR: f32 = 1e-5;

/// A record is in front of a point, and does not count, when it is farther above the mean tangent plane than this
/// times its radius.
pub const FRONT_TOLERANCE: f32 = 0.02;

/// `sqrt(1 − cos 10°)`: the change of normal at which Tabellion and Lamorlette's weight reaches 0 for κ = 1.
pub const TEN_DEGREES: f32 = 0.123_256_83;

/// What extrapolation may make of a record's irradiance, as factors of it.
pub const EXTRAPOLATION: [f32; 2] = [0.05, 20.0];

/// Irradiance at one place, and how it changes around it (Gautron 2006, 4.4.2). World space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Record {
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Harmonic mean distance of the surroundings, clamped; finite and > 0 [scene units].
    pub radius: f32,
    /// Distance of the nearest surface seen [scene units].
    pub min_distance: f32,
    /// Red, green, blue [W/m²].
    pub irradiance: Vec3,
    /// Rotation gradient of each channel [W/m² per radian].
    pub rotation: [Vec3; 3],
    /// Translation gradient of each channel [W/m² per scene unit].
    pub translation: [Vec3; 3],
}

impl Record {
    /// `sqrt(1 − n·n_k)` for unit normals, as `|n − n_k|/√2`: exactly 0 for equal normals, where the difference of 1
    /// and a rounded product has lost its digits or its sign.
    fn turn(&self, normal: Vec3) -> f32 {
        (normal - self.normal).length() * std::f32::consts::FRAC_1_SQRT_2
    }

    /// Whether the record lies in front of the point by a clear share of `length`: it then sees what the point does not.
    fn in_front(&self, position: Vec3, normal: Vec3, length: f32) -> bool {
        (position - self.position).dot(normal + self.normal) * 0.5 < -FRONT_TOLERANCE * length
    }
}

/// Ward's weight `1 / (|p−p_k|/R_k + sqrt(1 − n·n_k))` (Gautron 2005, equation 2), at most `1/LEAST_ERROR`; 0 where
/// the record does not count: its error exceeds `accuracy`, or it is in front of the point.
///
/// A record reaches no farther than `accuracy · radius`.
pub fn ward(record: &Record, position: Vec3, normal: Vec3, accuracy: f32) -> f32 {
    let distance = position.distance(record.position);
    let error = distance / record.radius.max(f32::MIN_POSITIVE) + record.turn(normal);
    if error <= accuracy && !record.in_front(position, normal, record.radius) { 1.0 / error.max(LEAST_ERROR) } else { 0.0 }
}

/// Tabellion and Lamorlette's weight (2004, equation 4)
/// `1 − κ · max(|p−p_k| / clamp(R'/2, R−, R+), sqrt(1 − n·n_k) / sqrt(1 − cos 10°))`, R' the nearest distance seen and
/// `limits` = [R−, R+] [scene units]; 0 where the record does not count. A larger `kappa` is stricter; the record
/// reaches no farther than `clamp(…)/κ`, where its weight is 0.
pub fn tabellion_lamorlette(record: &Record, position: Vec3, normal: Vec3, kappa: f32, limits: [f32; 2]) -> f32 {
    let radius = (record.min_distance / 2.0).min(limits[1]).max(limits[0]).max(f32::MIN_POSITIVE);
    let error = (position.distance(record.position) / radius).max(record.turn(normal) / TEN_DEGREES);
    let weight = 1.0 - kappa * error;
    if weight > 0.0 && !record.in_front(position, normal, radius) { weight } else { 0.0 }
}

/// The record's estimate `E_k + (n_k × n)·∇r + (p − p_k)·∇t` of the irradiance at a point, per channel, at least 0
/// (Gautron 2005, equation 8, with absolute gradients).
pub fn estimate(record: &Record, position: Vec3, normal: Vec3) -> Vec3 {
    let turn = record.normal.cross(normal);
    let step = position - record.position;
    let change = |channel: usize| turn.dot(record.rotation[channel]) + step.dot(record.translation[channel]);
    (record.irradiance + Vec3::new(change(0), change(1), change(2))).max(Vec3::ZERO)
}

/// An estimate held within [`EXTRAPOLATION`] times the record's own irradiance, channel by channel: the last of the
/// caps on gradients, beside the papers' own way, which has none.
pub fn limit_extrapolation(record: &Record, estimate: Vec3) -> Vec3 {
    estimate.max(record.irradiance * EXTRAPOLATION[0]).min(record.irradiance * EXTRAPOLATION[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;
    use proptest::prelude::*;

    fn record() -> Record {
        Record {
            position: Vec3::new(1.0, 2.0, 3.0),
            normal: Vec3::Z,
            radius: 2.0,
            min_distance: 0.5,
            irradiance: Vec3::new(1.0, 2.0, 3.0),
            rotation: [Vec3::X * 0.5, Vec3::Y, Vec3::ZERO],
            translation: [Vec3::X, Vec3::ZERO, Vec3::new(0.0, -3.0, 0.0)],
        }
    }

    fn tilted(axis: Vec3, degrees: f32) -> Vec3 {
        Quat::from_axis_angle(axis, degrees.to_radians()) * Vec3::Z
    }

    #[test]
    fn ward_is_bounded_at_its_own_place_and_0_out_of_reach() {
        let r = record();
        assert_eq!(ward(&r, r.position, r.normal, 0.15), 1.0 / LEAST_ERROR);
        assert!((ward(&r, r.position + Vec3::X * 0.2, r.normal, 0.15) - 10.0).abs() < 1e-4);
        assert_eq!(ward(&r, r.position + Vec3::X * 0.3001, r.normal, 0.15), 0.0);
        assert_eq!(ward(&r, r.position, r.normal, f32::NAN), 0.0);
        assert_eq!(ward(&r, r.position, r.normal, -1.0), 0.0);
        assert_eq!(ward(&Record { radius: 0.0, ..r }, r.position + Vec3::X, r.normal, 0.15), 0.0);
        assert!(ward(&Record { radius: f32::INFINITY, ..r }, r.position + Vec3::X, r.normal, 0.15) > 0.0);
    }

    #[test]
    fn normals_that_round_above_1_are_no_error() {
        let longer = Vec3::new(0.0, 0.0, 1.0 + 1e-7);
        assert!(ward(&record(), record().position, longer, 0.15) > 1e4);
    }

    #[test]
    fn records_in_front_do_not_count() {
        let r = record();
        let below = r.position + Vec3::new(0.1, 0.0, -0.1);
        assert_eq!(ward(&r, below, r.normal, 0.15), 0.0);
        assert!(ward(&r, below, r.normal, 0.15) < ward(&r, r.position + Vec3::new(0.1, 0.0, 0.1), r.normal, 0.15));
        // On a sphere the chord is perpendicular to the mean normal: curvature alone rejects nothing.
        let normal = tilted(Vec3::Y, 5.0);
        assert!(ward(&r, r.position + (normal - Vec3::Z), normal, 0.15) > 0.0);
    }

    #[test]
    fn tabellion_lamorlette_falls_to_0_at_its_rim() {
        let (r, limits) = (record(), [0.1, 1.0]);
        let at = |x: f32| tabellion_lamorlette(&r, r.position + Vec3::X * x, r.normal, 1.0, limits);
        assert_eq!(at(0.0), 1.0);
        assert!((at(0.125) - 0.5).abs() < 1e-6);
        assert_eq!(at(0.25), 0.0);
        let turned = |degrees: f32| tabellion_lamorlette(&r, r.position, tilted(Vec3::X, degrees), 1.0, limits);
        assert!(turned(9.9) > 0.0 && turned(9.9) < 0.02 && turned(10.1) == 0.0);
        let open = Record { min_distance: f32::INFINITY, ..r };
        assert!((tabellion_lamorlette(&open, r.position + Vec3::X * 0.5, r.normal, 1.0, limits) - 0.5).abs() < 1e-6);
        assert_eq!(TEN_DEGREES, (1.0 - 10f64.to_radians().cos()).sqrt() as f32);
    }

    #[test]
    fn estimates_follow_the_gradients() {
        let r = record();
        assert_eq!(estimate(&r, r.position, r.normal), r.irradiance);
        assert_eq!(estimate(&r, r.position + Vec3::X * 0.25, r.normal), Vec3::new(1.25, 2.0, 3.0));
        assert_eq!(estimate(&r, r.position + Vec3::Y * 2.0, r.normal), Vec3::new(1.0, 2.0, 0.0));
        // z × n for a normal turned about x by α is (sin α, 0, 0).
        let turned = estimate(&r, r.position, tilted(Vec3::X, 30.0));
        assert!(turned.abs_diff_eq(Vec3::new(1.25, 2.0, 3.0), 1e-6));
    }

    #[test]
    fn extrapolation_is_limited() {
        let r = record();
        assert_eq!(limit_extrapolation(&r, Vec3::new(0.0, 2.5, 1e9)), Vec3::new(0.05, 2.5, 60.0));
    }

    proptest! {
        #[test]
        fn ward_counts_where_the_formula_says(x in -0.5..0.5f32, y in -0.5..0.5f32, degrees in 0.0..30.0f32, accuracy in 0.01..2.0f32) {
            let r = record();
            let (p, n) = (r.position + Vec3::new(x, y, 0.0), tilted(Vec3::X, degrees));
            let error = f64::from((p - r.position).length()) / 2.0 + (1.0 - f64::from(degrees).to_radians().cos()).sqrt();
            prop_assume!((error - f64::from(accuracy)).abs() > 1e-5 && !r.in_front(p, n, r.radius) && error > 1e-3);
            let weight = f64::from(ward(&r, p, n, accuracy));
            if error < f64::from(accuracy) { prop_assert!((weight * error - 1.0).abs() < 1e-3) } else { prop_assert_eq!(weight, 0.0) }
        }
    }
}
