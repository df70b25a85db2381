//! Irradiance records: where one counts, how much, and what it estimates. Single precision, line by line as
//! `shaders/lib/record.wgsl` computes it; a test on the device compares the two.

use super::colour::luminance;
use super::vectors::Vectors;
use fearless_simd::{Select, Simd, f32x8, prelude::*};
use glam::Vec3;

/// The least error that Ward's weight divides by: it bounds the weight at the record's own place to 1000, far above
/// any other record's, without an infinity to divide by infinity.
pub const LEAST_ERROR: f32 = 1e-3;

/// A record is in front of a point, and does not count, when the way to the point leaves the mean tangent plane downwards by more
/// than this times its length. A share of the validity radius would be no measure: records that see the sky alone reach any distance.
pub const FRONT_TOLERANCE: f32 = 0.05;

/// `sqrt(1 − cos 10°)`: the change of normal at which Tabellion and Lamorlette's weight reaches 0.
pub const TEN_DEGREES: f32 = 0.12326;

/// What extrapolation may make of a record's irradiance, as factors of it. Wider limits, such as the 0.05 and 20 that others
/// use, let records near edges foretell far too much: Sponza's error was 8.4 % with them and is 5.9 %.
pub const EXTRAPOLATION: [f32; 2] = [0.4, 2.5];

/// The most of one over a length, so that its square is a number.
pub const MOST_PER_LENGTH: f32 = 1e15;

/// The least length that counts as one [scene units].
const LEAST_LENGTH: f32 = 1e-30;

/// Irradiance at one place, and how it changes around it (Gautron 2006, 4.4.2). World space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Record {
    pub position: Vec3,
    /// What the validity radius is in proportion to: the harmonic mean distance of the surroundings, or the smaller radius of the
    /// ellipse of its curvature; finite and > 0 [scene units].
    pub radius: f32,
    /// Unit normal.
    pub normal: Vec3,
    /// Distance of the nearest surface seen [scene units].
    pub minimum_distance: f32,
    /// Red, green, blue [W/m²].
    pub irradiance: Vec3,
    /// Width of the pixel that asked for the record [scene units].
    pub footprint: f32,
    /// Standard error of the irradiance, red, green, blue, as far as its samples tell it [W/m²].
    pub error: Vec3,
    /// Rotation gradient of each channel [W/m² per radian].
    pub rotation: [Vec3; 3],
    /// Translation gradient of each channel [W/m² per scene unit].
    pub translation: [Vec3; 3],
    /// Along the axis of the ellipse's larger radius, `√(1 − (R₀/R₁)²)` long; 0 for a disc.
    pub stretch: Vec3,
    /// Of the luminance along the surface, `|∇E| / E` [1 / scene unit].
    pub relative_gradient: f32,
    /// The share of the least spacing that holds for this record, in (0, 1]: [`Rule::fineness`].
    pub fineness: f32,
    /// The share that it reaches of the way to what stands on its surface, up to 1; 0 where that is not known.
    pub confinement: f32,
}

impl Record {
    /// Its reach along the shorter axis over that along the longer one.
    fn roundness(&self) -> f32 {
        (1.0 - self.stretch.length_squared()).max(0.01).sqrt()
    }

    /// What half floats of a record's expansions and of their derivatives count in, powers of two: no brightness and no unit of length leaves
    /// their range so [W/(m² sr), the same per scene unit].
    pub fn half_units(&self) -> [f32; 2] {
        let light = binade(self.irradiance.max_element());
        [light, light * binade(self.relative_gradient)]
    }
}

/// The largest power of two that is no more than a value, within what products of two of them can hold.
fn binade(value: f32) -> f32 {
    f32::from_bits(value.clamp(1e-15, 1e15).to_bits() & 0x7f80_0000)
}

/// How a record counts within its validity radius; the shaders know the kinds by these numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weighting {
    /// Ward 1988, RCS 2 and 3: 1 over the error, counts from 1/a on.
    Ward = 0,
    /// Tabellion and Lamorlette 2004: reaches a times the nearest distance, falls to 0 at the rim and at 10 degrees.
    TabellionLamorlette = 1,
    /// Reaches as far as Ward's, falls to 0 at the rim.
    Compact = 2,
}

/// The rule by which records count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rule {
    pub weighting: Weighting,
    /// The accuracy parameter a: a record reaches a·R.
    pub accuracy: f32,
    /// Least and most reach in widths of the pixel that asked for the record; the least is not above the most.
    pub spacing: [f32; 2],
    /// Most of the validity radius in distances of the nearest surface seen.
    pub nearest: f32,
    /// Most of the validity radius in lengths over which the irradiance changes by all of itself.
    pub change: f32,
    /// A point whose weights add up to this or less misses a record.
    pub overlap: f32,
    /// Most change that a gradient may foretell within the least validity radius, as a share of the picture's irradiance.
    pub contrast: f32,
    /// How small the least validity radius may become for the contrast, in widths of the pixel.
    pub finest_spacing: f32,
}

impl Rule {
    /// How far a record's gradient may be followed: not to the corner of the nearest surface, nor until all has changed
    /// [scene units].
    fn gradient_radius(&self, record: &Record) -> f32 {
        let change = self.change / record.relative_gradient.max(LEAST_LENGTH);
        (self.nearest * record.minimum_distance).min(change)
    }

    /// How far a record reaches along the shorter axis: `a` times its distance, as far as the gradient may be followed,
    /// within the limits in pixels [scene units].
    pub fn validity_radius(&self, record: &Record) -> f32 {
        let [least, most] = self.limits(record);
        (self.accuracy * self.distance(record)).min(self.gradient_radius(record)).max(least).min(most)
    }

    /// The least and the most that it may reach [scene units].
    fn limits(&self, record: &Record) -> [f32; 2] {
        [self.spacing[0] * record.fineness * record.footprint, self.spacing[1] * record.footprint]
    }

    /// The share of the least spacing within which a record foretells no more change than `contrast` allows around `level`, the
    /// luminance of the picture's irradiance [W/m²]. What an edge gets wrong over a whole least validity radius is then little in the picture,
    /// and dark creases, where relative gradients are as steep, ask for no more records than they are worth.
    pub fn fineness(&self, record: &Record, level: f32) -> f32 {
        let step = self.spacing[0] * record.footprint;
        let light = luminance(record.irradiance.as_dvec3()) as f32;
        let change = (record.relative_gradient * step).min(EXTRAPOLATION[1] - 1.0) * light;
        let allowed = self.contrast * level;
        if change > allowed { (allowed / change).max((self.finest_spacing / self.spacing[0]).min(1.0)) } else { 1.0 }
    }

    /// What the accuracy multiplies [scene units].
    fn distance(&self, record: &Record) -> f32 {
        if self.weighting == Weighting::TabellionLamorlette { record.minimum_distance } else { record.radius }
    }

    /// The parameter that decided how far a record reaches.
    pub fn limited_by(&self, record: &Record) -> &'static str {
        let reach = self.validity_radius(record);
        let [least, most] = self.limits(record);
        match reach {
            _ if reach == most => "maximum_spacing",
            _ if reach == least => "minimum_spacing",
            _ if reach == self.accuracy * self.distance(record) => "accuracy",
            _ if reach == self.nearest * record.minimum_distance => "nearest",
            _ => "change",
        }
    }

    /// How far a record reaches along the longer axis [scene units].
    pub fn longest_validity_radius(&self, record: &Record) -> f32 {
        self.validity_radius(record) / record.roundness()
    }

    /// What a record estimates at a point, see [`Reaching::estimate`].
    pub fn estimate(&self, record: &Record, position: Vec3, normal: Vec3) -> Vec3 {
        self.reaching(record).estimate(position, normal)
    }

    /// Weight of a record at a point, see [`Reaching::weight`].
    pub fn weight(&self, record: &Record, position: Vec3, normal: Vec3) -> f32 {
        self.reaching(record).weight(position, normal)
    }

    /// A record for many points.
    pub fn reaching<'a>(&self, record: &'a Record) -> Reaching<'a> {
        let reach = self.validity_radius(record).max(LEAST_LENGTH);
        let followed = (self.gradient_radius(record) / reach).min(1.0);
        Reaching { record, reach, followed, weighting: self.weighting, accuracy: self.accuracy, front: FRONT_TOLERANCE }
    }

    /// The rule by which records reach so many times as far, and normals may differ by so much more; their weights fall to 0 at the rim.
    pub fn farther(&self, times: f32) -> Self {
        let spacing = self.spacing.map(|limit| limit * times);
        let (accuracy, nearest, change) = (self.accuracy * times, self.nearest * times, self.change * times);
        Self { weighting: Weighting::Compact, accuracy, spacing, nearest, change, ..*self }
    }

    /// A record by a coarser accuracy, `times` this one: all limits of its validity radius are so many times as far, normals may differ by so much more, and
    /// it may stand so much farther in front. Its gradient is followed no farther, and its weight falls to 0 at the rim, whatever the weighting.
    pub fn coarsely<'a>(&self, record: &'a Record, times: f32) -> Reaching<'a> {
        let fine = self.reaching(record);
        let reach = fine.reach * times;
        let followed = (self.gradient_radius(record) / reach).min(1.0);
        Reaching { record, reach, followed, weighting: Weighting::Compact, accuracy: fine.accuracy * times, front: fine.front * times }
    }
}

/// A record and how far it reaches.
#[derive(Debug, Clone, Copy)]
pub struct Reaching<'a> {
    record: &'a Record,
    /// Along the shorter axis [scene units].
    reach: f32,
    /// The share of the way to a point along which gradients are followed.
    followed: f32,
    weighting: Weighting,
    accuracy: f32,
    /// How far in front of a point the record may stand: see [`FRONT_TOLERANCE`].
    front: f32,
}

impl Reaching<'_> {
    /// The record's estimate `E_k + (n_k × n)·∇r + (p − p_k)·∇t` of the irradiance at a point, per channel (Gautron 2005,
    /// equation 8, with absolute gradients), within [`EXTRAPOLATION`] times its own. A record that has to reach farther
    /// foretells at its rim what it would have where its gradient ends.
    #[inline]
    pub fn estimate(&self, position: Vec3, normal: Vec3) -> Vec3 {
        let record = self.record;
        let turn = record.normal.cross(normal);
        let step = self.step(position);
        let change = |channel: usize| turn.dot(record.rotation[channel]) + step.dot(record.translation[channel]);
        let estimate = record.irradiance + Vec3::new(change(0), change(1), change(2));
        estimate.max(record.irradiance * EXTRAPOLATION[0]).min(record.irradiance * EXTRAPOLATION[1])
    }

    /// How far from the record toward a point its gradients are followed [scene units].
    #[inline]
    pub fn step(&self, position: Vec3) -> Vec3 {
        (position - self.record.position) * self.followed
    }

    /// The record that reaches so far.
    pub fn record(&self) -> &Record {
        self.record
    }

    /// How far it reaches along the shorter axis [scene units].
    pub fn validity_radius(&self) -> f32 {
        self.reach
    }

    /// How far it reaches along the longer axis [scene units].
    pub fn longest_validity_radius(&self) -> f32 {
        self.reach / self.record.roundness()
    }

    /// Weight of the record at a point; 0 where it does not count: out of reach, turned too far, or in front of the point.
    #[inline]
    pub fn weight(&self, position: Vec3, normal: Vec3) -> f32 {
        let (record, accuracy) = (self.record, self.accuracy);
        let offset = position - record.position;
        let along = offset.dot(record.stretch);
        let apart = (offset.length_squared() - along * along).max(0.0).sqrt() / self.reach;
        let behind = offset.dot(normal + record.normal) * 0.5;
        if apart > 1.0 || behind < -self.front * offset.length() {
            return 0.0;
        }
        // sqrt(1 − n·n_k) as |n − n_k|/√2: exactly 0 for equal normals, where the difference of 1 and a rounded
        // product has lost its digits or its sign.
        let turned = (normal - record.normal).length() * std::f32::consts::FRAC_1_SQRT_2;
        match self.weighting {
            Weighting::Ward => {
                let error = apart * accuracy + turned;
                if error <= accuracy { 1.0 / error.max(LEAST_ERROR) } else { 0.0 }
            }
            Weighting::TabellionLamorlette => (1.0 - apart.max(turned / TEN_DEGREES)).max(0.0),
            Weighting::Compact => (1.0 - apart - turned / accuracy).max(0.0),
        }
    }

    /// What the record weighs among those of an index, whose reaches differ by far more than those of neighbours in a picture: its weight by the area that it
    /// reaches, so that one that stands for much tells little where others stand close together; and only where it is level with the point, neither in front of it
    /// nor behind. Those behind stand deeper, where there is less light, so that to leave out only those in front makes the light too little.
    pub fn local_weight(&self, position: Vec3, normal: Vec3) -> f32 {
        let offset = position - self.record.position;
        let behind = offset.dot(normal + self.record.normal) * 0.5;
        let per_area = self.reach.recip().min(MOST_PER_LENGTH).powi(2);
        if behind > self.front * offset.length() { 0.0 } else { self.weight(position, normal) * per_area }
    }

    /// [`Reaching::estimate`] at eight points.
    #[inline(always)]
    pub fn estimates<S: Simd>(&self, simd: S, positions: Vectors<S>, normals: Vectors<S>) -> Vectors<S> {
        let record = self.record;
        let turn = Vectors::splat(simd, record.normal).cross(normals);
        let step = positions.minus(Vectors::splat(simd, record.position)).scaled(f32x8::splat(simd, self.followed));
        let [rotation, translation] = [&record.rotation, &record.translation];
        let change = Vectors {
            x: turn.product(rotation[0]) + step.product(translation[0]),
            y: turn.product(rotation[1]) + step.product(translation[1]),
            z: turn.product(rotation[2]) + step.product(translation[2]),
        };
        let [least, most] = EXTRAPOLATION.map(|factor| record.irradiance * factor);
        let estimate = Vectors::splat(simd, record.irradiance).plus(change);
        Vectors { x: estimate.x.max(least.x).min(most.x), y: estimate.y.max(least.y).min(most.y), z: estimate.z.max(least.z).min(most.z) }
    }

    /// [`Reaching::weight`] at eight points.
    #[inline(always)]
    pub fn weights<S: Simd>(&self, simd: S, positions: Vectors<S>, normals: Vectors<S>) -> f32x8<S> {
        let (record, accuracy) = (self.record, self.accuracy);
        let zero = f32x8::splat(simd, 0.0);
        let normal = Vectors::splat(simd, record.normal);
        let offset = positions.minus(Vectors::splat(simd, record.position));
        let (along, square) = (offset.product(record.stretch), offset.dot(offset));
        let apart = (square - along * along).max(zero).sqrt() / self.reach;
        let behind = offset.dot(normals.plus(normal)) * 0.5;
        let counts = apart.simd_le(1.0) & behind.simd_ge(square.sqrt() * -self.front);
        let difference = normals.minus(normal);
        let turned = difference.dot(difference).sqrt() * std::f32::consts::FRAC_1_SQRT_2;
        let weight = match self.weighting {
            Weighting::Ward => {
                let error = apart * accuracy + turned;
                error.simd_le(accuracy).select(1.0 / error.max(LEAST_ERROR), zero)
            }
            Weighting::TabellionLamorlette => (1.0 - apart.max(turned / TEN_DEGREES)).max(zero),
            Weighting::Compact => (1.0 - apart - turned / accuracy).max(zero),
        };
        counts.select(weight, zero)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use glam::Quat;
    use proptest::prelude::*;

    fn record() -> Record {
        Record {
            position: Vec3::new(1.0, 2.0, 3.0),
            radius: 2.0,
            normal: Vec3::Z,
            minimum_distance: 0.5,
            irradiance: Vec3::new(1.0, 2.0, 3.0),
            footprint: 0.01,
            error: Vec3::new(0.1, 0.2, 0.3),
            rotation: [Vec3::X * 0.5, Vec3::Y, Vec3::ZERO],
            translation: [Vec3::X, Vec3::ZERO, Vec3::new(0.0, -3.0, 0.0)],
            stretch: Vec3::ZERO,
            relative_gradient: 1.0,
            fineness: 1.0,
            confinement: 0.0,
        }
    }

    fn rule(weighting: Weighting) -> Rule {
        Rule { weighting, accuracy: 0.15, spacing: [1.5, 40.0], nearest: 1e6, change: 1e6, overlap: 0.0, contrast: 1e6, finest_spacing: 1.5 }
    }

    fn tilted(axis: Vec3, degrees: f32) -> Vec3 {
        Quat::from_axis_angle(axis, degrees.to_radians()) * Vec3::Z
    }

    fn near(found: f32, expected: f32) -> bool {
        (found - expected).abs() < 1e-5 * expected.abs().max(1.0)
    }

    #[test]
    fn ward_is_bounded_at_its_own_place_and_0_out_of_reach() {
        let (r, ward) = (record(), rule(Weighting::Ward));
        let at = |x: f32| ward.weight(&r, r.position + Vec3::X * x, r.normal);
        assert_eq!(at(0.0), 1.0 / LEAST_ERROR);
        assert!((at(0.2) - 10.0).abs() < 1e-4);
        assert_eq!(at(0.3001), 0.0);
        assert!(at(0.2999) >= 1.0 / 0.15 - 1e-3);
    }

    #[test]
    fn the_reach_is_held_in_pixels() {
        let rule = rule(Weighting::Compact);
        assert!(near(rule.validity_radius(&record()), 0.3));
        assert!(near(rule.validity_radius(&Record { radius: 1e30, ..record() }), 0.4));
        assert!(near(rule.validity_radius(&Record { radius: 0.0, ..record() }), 0.015));
        let tabellion = super::tests::rule(Weighting::TabellionLamorlette);
        assert!(near(tabellion.validity_radius(&record()), 0.075));
    }

    #[test]
    fn what_limits_a_reach_is_named() {
        let rule = Rule { nearest: 2.0, change: 0.5, ..rule(Weighting::Compact) };
        // A fineness of the least and a gradient that is none leave the others to decide.
        let wide = Record { minimum_distance: 1e3, relative_gradient: 0.0, ..record() };
        let cases = [
            (wide, "accuracy", 0.3),
            (Record { radius: 1e3, ..wide }, "maximum_spacing", 0.4),
            (Record { radius: 1e-3, ..wide }, "minimum_spacing", 0.015),
            (Record { radius: 1e-3, fineness: 0.5, ..wide }, "minimum_spacing", 0.0075),
            (Record { minimum_distance: 0.1, ..wide }, "nearest", 0.2),
            (Record { relative_gradient: 2.0, ..wide }, "change", 0.25),
        ];
        for (record, by, reach) in cases {
            assert!(
                rule.limited_by(&record) == by && near(rule.validity_radius(&record), reach),
                "{} and {}, not {by}",
                rule.limited_by(&record),
                rule.validity_radius(&record)
            );
            let stretched = Record { stretch: Vec3::new(0.48, 0.64, 0.0), ..record };
            assert!(near(rule.longest_validity_radius(&stretched), reach / 0.6) && near(rule.reaching(&stretched).longest_validity_radius(), reach / 0.6));
        }
    }

    #[test]
    fn half_floats_count_in_powers_of_two() {
        assert_eq!(Record { relative_gradient: 0.3, ..record() }.half_units(), [2.0, 0.5]);
        assert_eq!(Record { irradiance: Vec3::new(0.4, 0.1, 0.2), relative_gradient: 8.0, ..record() }.half_units(), [0.25, 2.0]);
        assert!(Record { irradiance: Vec3::ZERO, relative_gradient: 0.0, ..record() }.half_units().iter().all(|unit| unit.is_normal()));
    }

    #[test]
    fn a_coarser_accuracy_reaches_farther_and_extrapolates_no_farther() {
        let (record, rule) = (Record { translation: [Vec3::X; 3], ..record() }, Rule { change: 0.3, ..rule(Weighting::Compact) });
        let (fine, coarse) = (rule.reaching(&record), rule.coarsely(&record, 4.0));
        let at = |x: f32| record.position + Vec3::X * x;
        assert_eq!(rule.coarsely(&record, 1.0).weight(at(0.1), Vec3::Z), fine.weight(at(0.1), Vec3::Z));
        assert!(fine.weight(at(0.301), Vec3::Z) == 0.0 && near(coarse.weight(at(0.6), Vec3::Z), 0.5) && coarse.weight(at(1.201), Vec3::Z) == 0.0);
        assert!(near(coarse.step(at(1.2)).x, 0.3) && near(fine.step(at(0.3)).x, 0.3));
        // Four times the change of normal, and four times as far in front.
        assert!(fine.weight(record.position, tilted(Vec3::X, 20.0)) == 0.0 && coarse.weight(record.position, tilted(Vec3::X, 20.0)) > 0.0);
        assert_eq!(coarse.weight(record.position, tilted(Vec3::X, 70.0)), 0.0);
        let in_front = |share: f32| record.position + 0.5 * Vec3::new((1.0 - share * share).sqrt(), 0.0, -share);
        let [below, beyond] = [0.9, 1.1].map(|factor| factor * 4.0 * FRONT_TOLERANCE);
        assert!(
            fine.weight(in_front(below), Vec3::Z) == 0.0 && coarse.weight(in_front(below), Vec3::Z) > 0.0 && coarse.weight(in_front(beyond), Vec3::Z) == 0.0
        );
        // Other normals and other sides count in the end: no place is left without light.
        let upside_down = rule.coarsely(&record, 1e6).weight(record.position + Vec3::Z * 1e3, Vec3::NEG_Z);
        assert!(upside_down > 0.9, "{upside_down}");
    }

    #[test]
    fn eight_points_are_as_eight_times_one() {
        let gradients = [Vec3::new(0.3, -0.5, 0.2), Vec3::new(-0.4, 0.6, 0.1), Vec3::new(0.2, 0.1, -0.7)];
        let stretched =
            Record { stretch: Vec3::new(0.6, 0.3, 0.0), relative_gradient: 20.0, rotation: gradients, translation: gradients.map(|g| -2.0 * g), ..record() };
        let records = [record(), stretched];
        for (record, weighting) in records.iter().flat_map(|r| [Weighting::Ward, Weighting::TabellionLamorlette, Weighting::Compact].map(|w| (r, w))) {
            let rule = Rule { accuracy: 0.3, ..rule(weighting) };
            let reaching = rule.reaching(record);
            let mut counted = 0;
            for eight in 0..400 {
                let points: [(Vec3, Vec3); 8] = std::array::from_fn(|lane| scattered(record, 8 * eight + lane as u32));
                let axis = |of: &dyn Fn(&(Vec3, Vec3)) -> f32| points.each_ref().map(of);
                let positions = [axis(&|p| p.0.x), axis(&|p| p.0.y), axis(&|p| p.0.z)];
                let normals = [axis(&|p| p.1.x), axis(&|p| p.1.y), axis(&|p| p.1.z)];
                let (weights, estimates) = dispatch!(Level::new(), simd => {
                    let (positions, normals) = (Vectors::load(simd, &positions), Vectors::load(simd, &normals));
                    let estimates = reaching.estimates(simd, positions, normals);
                    (reaching.weights(simd, positions, normals).to_array(), [estimates.x.to_array(), estimates.y.to_array(), estimates.z.to_array()])
                });
                for (lane, (position, normal)) in points.into_iter().enumerate() {
                    let (weight, estimate) = (reaching.weight(position, normal), reaching.estimate(position, normal));
                    assert!(near(weights[lane], weight), "{} instead of {weight} by {weighting:?} at {position}", weights[lane]);
                    assert!((0..3).all(|channel| near(estimates[channel][lane], estimate[channel])), "{estimate} by {weighting:?} at {position}");
                    counted += u32::from(weight > 0.0);
                }
            }
            assert!((50..2900).contains(&counted), "{counted} of 3200 points count by {weighting:?}");
        }
    }

    /// The k-th of points around a record, and its normal.
    fn scattered(record: &Record, k: u32) -> (Vec3, Vec3) {
        let at = |prime: f32| 2.0 * (k as f32 * prime).fract() - 1.0;
        let offset = Vec3::new(at(0.754_877_7), at(0.569_840_3), 0.1 * at(0.430_159_7));
        let normal = record.normal + 0.1 * Vec3::new(at(0.618_034), at(0.324_718), at(0.414_214));
        (record.position + 0.8 * offset, normal.normalize())
    }

    #[test]
    fn normals_that_round_above_1_are_no_error() {
        let longer = Vec3::new(0.0, 0.0, 1.0 + 1e-7);
        assert!(rule(Weighting::Ward).weight(&record(), record().position, longer) > 999.0);
    }

    #[test]
    fn records_in_front_do_not_count() {
        let (r, rule) = (record(), rule(Weighting::Ward));
        let weight = |offset: Vec3| rule.weight(&r, r.position + offset, r.normal);
        assert_eq!(weight(Vec3::new(0.1, 0.0, -0.1)), 0.0);
        assert!(weight(Vec3::new(0.1, 0.0, 0.1)) > 0.0 && weight(Vec3::new(0.1, 0.0, -0.004)) > 0.0);
        // What sees nothing but sky reaches far, but does not count for what lies behind it.
        let (sky, far) = (Record { radius: 1e30, minimum_distance: 1e30, ..r }, Rule { spacing: [1.0, 1e6], ..rule });
        assert_eq!(far.weight(&sky, r.position - Vec3::new(1.0, 0.0, 1.0), r.normal), 0.0);
        // On a sphere the chord is perpendicular to the mean normal: curvature alone rejects nothing.
        let normal = tilted(Vec3::Y, 5.0);
        assert!(rule.weight(&r, r.position + (normal - Vec3::Z), normal) > 0.0);
    }

    #[test]
    fn compact_weights_fall_to_0_at_their_rim() {
        let r = record();
        let (tabellion, compact) = (rule(Weighting::TabellionLamorlette), rule(Weighting::Compact));
        let moved = |rule: &Rule, x: f32| rule.weight(&r, r.position + Vec3::X * x, r.normal);
        let turned = |rule: &Rule, degrees: f32| rule.weight(&r, r.position, tilted(Vec3::X, degrees));
        assert!(near(moved(&tabellion, 0.0375), 0.5) && moved(&tabellion, 0.0751) == 0.0);
        assert!(turned(&tabellion, 9.9) > 0.0 && turned(&tabellion, 9.9) < 0.02 && turned(&tabellion, 10.1) == 0.0);
        assert!(near(moved(&compact, 0.15), 0.5) && moved(&compact, 0.3001) == 0.0);
        assert!(turned(&compact, 12.1) > 0.0 && turned(&compact, 12.3) == 0.0);
        assert!((f64::from(TEN_DEGREES) - (1.0 - 10f64.to_radians().cos()).sqrt()).abs() < 1e-5);
    }

    #[test]
    fn estimates_follow_the_gradients_within_limits() {
        let r = record();
        let rule = Rule { spacing: [0.0, 1e6], ..rule(Weighting::Ward) };
        let estimate = |record: &Record, position: Vec3, normal: Vec3| rule.estimate(record, position, normal);
        assert_eq!(estimate(&r, r.position, r.normal), r.irradiance);
        assert_eq!(estimate(&r, r.position + Vec3::X * 0.25, r.normal), Vec3::new(1.25, 2.0, 3.0));
        assert_eq!(estimate(&r, r.position + Vec3::Y * 2.0, r.normal), Vec3::new(1.0, 2.0, 3.0 * EXTRAPOLATION[0]));
        assert_eq!(estimate(&r, r.position + Vec3::X * 1e9, r.normal), Vec3::new(EXTRAPOLATION[1], 2.0, 3.0));
        // z × n for a normal turned about x by α is (sin α, 0, 0).
        let turned = estimate(&r, r.position, tilted(Vec3::X, 30.0));
        assert!(turned.abs_diff_eq(Vec3::new(1.25, 2.0, 3.0), 1e-6));
        // A reach that the limits in pixels make ten times as long as the gradient's: the step counts a tenth.
        let steep = Record { relative_gradient: 100.0, footprint: 0.1, ..r };
        let wide = Rule { spacing: [1.0, 2.0], change: 1.0, ..rule };
        assert!(near(wide.validity_radius(&steep), 0.1) && near(wide.estimate(&steep, r.position + Vec3::X * 0.05, r.normal).x, 1.005));
    }

    #[test]
    fn strong_contrasts_make_the_least_reach_smaller() {
        // |∇E|/E = 1 over a least validity radius of 0.2: a fifth of a luminance of 1.8596.
        let r = Record { footprint: 0.1, radius: 0.0, ..record() };
        let rule = Rule { spacing: [2.0, 40.0], contrast: 0.1, finest_spacing: 0.5, ..rule(Weighting::Compact) };
        assert_eq!(rule.fineness(&r, 3.8), 1.0);
        assert!(near(rule.fineness(&r, 1.8596), 0.5) && near(rule.fineness(&r, 0.1), 0.25));
        assert!(
            near(rule.validity_radius(&Record { fineness: 0.5, ..r }), 0.1) && near(rule.validity_radius(&Record { fineness: 0.5, radius: 1.0, ..r }), 0.15)
        );
        // What an extrapolation may not foretell does not count, and a least validity radius that is fine already stays.
        assert!(near(rule.fineness(&Record { relative_gradient: 1e30, ..r }, 10.0 * 1.8596), 1.0 / 1.5));
        assert_eq!(Rule { finest_spacing: 3.0, ..rule }.fineness(&r, 0.0), 1.0);
        // Without light there is no contrast.
        assert_eq!(rule.fineness(&Record { irradiance: Vec3::ZERO, ..r }, 0.0), 1.0);
    }

    const KINDS: [Weighting; 3] = [Weighting::Ward, Weighting::TabellionLamorlette, Weighting::Compact];

    /// The same record in another unit of length.
    fn in_unit(record: &Record, unit: f32) -> Record {
        Record {
            position: record.position * unit,
            radius: record.radius * unit,
            minimum_distance: record.minimum_distance * unit,
            footprint: record.footprint * unit,
            translation: record.translation.map(|gradient| gradient / unit),
            relative_gradient: record.relative_gradient / unit,
            ..*record
        }
    }

    proptest! {
        #[test]
        fn weights_fall_with_distance_and_with_turn(azimuth in 0.0..6.3f32, near in 0.0..1.0f32, far in 0.0..1.0f32, less in 0.0..20.0f32, more in 0.0..20.0f32) {
            let r = record();
            let along = Vec3::new(azimuth.cos(), azimuth.sin(), 0.0);
            for kind in KINDS {
                let rule = Rule { spacing: [0.0, 1e6], ..rule(kind) };
                let moved = |share: f32| rule.weight(&r, r.position + along * share * rule.validity_radius(&r) * 1.1, r.normal);
                prop_assert!(moved(near.min(far)) >= moved(near.max(far)), "{kind:?}");
                // About the way to the point, so that the record comes no nearer to being in front of it.
                let turned = |degrees: f32| rule.weight(&r, r.position + along * near * rule.validity_radius(&r), tilted(along, degrees));
                prop_assert!(turned(less.min(more)) >= turned(less.max(more)), "{kind:?}");
            }
        }

        #[test]
        fn weights_and_estimates_know_no_unit_of_length(x in -0.5..0.5f32, y in -0.5..0.5f32, degrees in 0.0..15.0f32, exponent in -30..30i32) {
            let unit = 2f32.powi(exponent);
            let (r, p, n) = (record(), record().position + Vec3::new(x, y, 0.0), tilted(Vec3::X, degrees));
            for kind in KINDS {
                let rule = rule(kind);
                prop_assert_eq!(rule.weight(&r, p, n), rule.weight(&in_unit(&r, unit), p * unit, n));
                prop_assert_eq!(rule.estimate(&r, p, n), rule.estimate(&in_unit(&r, unit), p * unit, n));
                let strict = Rule { contrast: 0.01, finest_spacing: 0.1, ..rule };
                prop_assert_eq!(strict.fineness(&r, 1.0), strict.fineness(&in_unit(&r, unit), 1.0));
                prop_assert!(strict.fineness(&r, 1.0) < 1.0);
            }
        }

        #[test]
        fn ward_counts_where_the_formula_says(x in -0.5..0.5f32, y in -0.5..0.5f32, degrees in 0.0..30.0f32, accuracy in 0.01..2.0f32) {
            let (r, rule) = (record(), Rule { weighting: Weighting::Ward, accuracy, spacing: [0.0, 1e6], nearest: 1e6, change: 1e6, overlap: 0.0, contrast: 1e6, finest_spacing: 1.5 });
            let (p, n) = (r.position + Vec3::new(x, y, 0.0), tilted(Vec3::X, degrees));
            let behind = (p - r.position).dot(n + r.normal) * 0.5 + FRONT_TOLERANCE * (p - r.position).length();
            let error = f64::from((p - r.position).length()) / 2.0 + (1.0 - f64::from(degrees).to_radians().cos()).sqrt();
            prop_assume!((error - f64::from(accuracy)).abs() > 1e-5 && behind > 0.0 && error > 2e-3);
            let weight = f64::from(rule.weight(&r, p, n));
            if error < f64::from(accuracy) { prop_assert!((weight * error - 1.0).abs() < 1e-3) } else { prop_assert_eq!(weight, 0.0) }
        }
    }
}
