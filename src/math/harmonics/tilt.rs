//! Rotation of hemispherical harmonics: of what is known above one surface into the frame of another (thesis, section 3.4). What sinks below the
//! horizon is lost, and nothing is known of what rises above it.
//!
//! Any rotation is one around z, one around y by the angle β between the normals, and one around z (Euler's angles, ZYZ). Those around z are exact;
//! [`Method`] says how the tilt by β is done.

use super::{Basis, Conversion, Rotation, index, quadrature::gauss_legendre};
use std::f64::consts::{FRAC_PI_2, PI};

/// How a hemispherical expansion is tilted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Converted to spherical harmonics of an order, rotated, converted back (3.4.1).
    Conversion { spherical: usize },
    /// What sinks below the horizon is deleted by a matrix for β, then the spherical rotation by `arccos(2 cosβ − 1)` is applied to the stretched
    /// hemisphere (3.4.2, 3.4.3). An approximation: only what is at the pole lands where it should. None for β > 90°.
    DigonDeletion,
    /// A matrix for β that does all of it (3.4.4).
    Precomputed,
}

/// A way to tilt, made ready.
pub enum Tilting {
    Conversion(Conversion),
    DigonDeletion(Table),
    Precomputed(Table),
}

impl Tilting {
    /// Of expansions of an order. Tables have `steps` + 1 angles from 0 to the largest.
    pub fn new(order: usize, method: Method, steps: usize) -> Self {
        Self::kept(order, method, steps, |_, _, make| make())
    }

    /// The same with a table that `keep` may have, or have made: of a name, which tells all that it depends on, and of so many numbers.
    pub fn kept(order: usize, method: Method, steps: usize, keep: impl FnOnce(&str, usize, &dyn Fn() -> Vec<f32>) -> Vec<f32>) -> Self {
        let table = |largest: f64, tilts: bool| {
            let name = format!("rotations {VERSION}: {method:?} of order {order} in {steps} steps");
            let groups = groups(order);
            let numbers = keep(&name, (steps + 1) * matrix_size(&groups), &|| matrices(order, &groups, steps, largest, tilts));
            Table { steps, largest, groups, numbers }
        };
        match method {
            Method::Conversion { spherical } => Self::Conversion(Conversion::new(order, spherical)),
            Method::DigonDeletion => Self::DigonDeletion(table(FRAC_PI_2, false)),
            Method::Precomputed => Self::Precomputed(table(PI, true)),
        }
    }

    /// Of the expansions that it tilts.
    pub fn order(&self) -> usize {
        match self {
            Self::Conversion(conversion) => conversion.hemispherical_order(),
            Self::DigonDeletion(table) | Self::Precomputed(table) => table.groups.iter().map(Vec::len).sum::<usize>().isqrt(),
        }
    }

    /// Bytes of the tables.
    pub fn memory(&self) -> usize {
        match self {
            Self::Conversion(conversion) => conversion.elements().count() * size_of::<f32>(),
            Self::DigonDeletion(table) | Self::Precomputed(table) => table.numbers.len() * size_of::<f32>(),
        }
    }

    /// The expansion above the other surface: the value at d becomes the value at `matrix · d`, `matrix` row by row.
    pub fn rotate(&self, values: &[f64], matrix: [[f64; 3]; 3]) -> Vec<f64> {
        match self {
            Self::Conversion(conversion) => {
                let rotation = Rotation::new(conversion.spherical_order(), matrix);
                conversion.to_hemispherical(&rotation.apply(&conversion.to_spherical(values)))
            }
            Self::DigonDeletion(table) => by_angles(values, matrix, |values, beta| delete_and_tilt(table, values, beta)),
            Self::Precomputed(table) => by_angles(values, matrix, |values, beta| table.apply(values, beta)),
        }
    }
}

/// A rotation as turns around z and a tilt around y by β in 0..π, towards +x.
fn by_angles(values: &[f64], matrix: [[f64; 3]; 3], tilt: impl Fn(&[f64], f64) -> Vec<f64>) -> Vec<f64> {
    let [first, beta, last] = euler_angles(matrix);
    let mut values = values.to_vec();
    turn(&mut values, first);
    let mut tilted = tilt(&values, beta);
    turn(&mut tilted, last);
    tilted
}

fn delete_and_tilt(digons: &Table, values: &[f64], beta: f64) -> Vec<f64> {
    if beta > FRAC_PI_2 {
        return vec![0.0; values.len()];
    }
    let stretched = (2.0 * beta.cos() - 1.0).clamp(-1.0, 1.0).acos();
    Rotation::new(values.len().isqrt(), around_y(stretched)).apply(&digons.apply(values, beta))
}

fn around_y(angle: f64) -> [[f64; 3]; 3] {
    let (sine, cosine) = angle.sin_cos();
    [[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]]
}

/// The angles around z, then y, then z that make up a rotation; that around y is in 0..π.
pub fn euler_angles(matrix: [[f64; 3]; 3]) -> [f64; 3] {
    let [[a, _, c], [d, _, f], [g, h, i]] = matrix;
    let sine = g.hypot(h);
    if sine < 1e-12 {
        // The axes coincide: all of the turn around z is in one angle.
        return if i > 0.0 { [d.atan2(a), 0.0, 0.0] } else { [d.atan2(-a), PI, 0.0] };
    }
    [h.atan2(-g), sine.atan2(i), f.atan2(c)]
}

/// Turns an expansion around z, in place.
pub fn turn(values: &mut [f64], angle: f64) {
    let order = values.len().isqrt();
    for m in 1..order {
        let (sine, cosine) = (angle * m as f64).sin_cos();
        for l in m..order {
            let (at_cosine, at_sine) = (index(l, m as isize), index(l, -(m as isize)));
            let (c, s) = (values[at_cosine], values[at_sine]);
            (values[at_cosine], values[at_sine]) = (c * cosine - s * sine, c * sine + s * cosine);
        }
    }
}

/// Matrices for angles from 0 on. They do not mix functions that are even in y with those that are odd.
pub struct Table {
    steps: usize,
    largest: f64,
    /// The functions even in y, then those odd in y.
    groups: [Vec<usize>; 2],
    /// Of each angle the matrix of the even functions, then of the odd ones, row by row.
    numbers: Vec<f32>,
}

/// Told in the names of tables: another one wherever their numbers change.
const VERSION: u32 = 1;

/// The functions even in y, then those odd in y.
fn groups(order: usize) -> [Vec<usize>; 2] {
    [true, false].map(|even| {
        let orders = |l: usize| (-(l as isize)..=l as isize).filter(move |m| (*m >= 0) == even);
        (0..order).flat_map(|l| orders(l).map(move |m| index(l, m))).collect::<Vec<_>>()
    })
}

/// Numbers of one angle.
fn matrix_size(groups: &[Vec<usize>; 2]) -> usize {
    groups.iter().map(|group| group.len() * group.len()).sum()
}

/// Matrices that tilt, or those that only delete what a tilt by the angle would take below the horizon.
fn matrices(order: usize, groups: &[Vec<usize>; 2], steps: usize, largest: f64, tilts: bool) -> Vec<f32> {
    let basis = Basis::new(order);
    let angles = (0..=steps).map(|step| largest * step as f64 / steps.max(1) as f64);
    angles.flat_map(|beta| matrix(&basis, groups, beta, tilts)).map(|value| value as f32).collect()
}

impl Table {
    fn apply(&self, values: &[f64], beta: f64) -> Vec<f64> {
        let size = matrix_size(&self.groups);
        let place = (beta / self.largest).clamp(0.0, 1.0) * self.steps as f64;
        let below = (place.floor() as usize).min(self.steps.saturating_sub(1));
        let share = place - below as f64;
        let matrix = |step: usize| &self.numbers[step.min(self.steps) * size..][..size];
        let (low, high) = (matrix(below), matrix(below + 1));
        let mut out = vec![0.0; values.len()];
        let mut at = 0;
        for group in &self.groups {
            for row in group {
                for column in group {
                    out[*row] += (low[at] as f64 * (1.0 - share) + high[at] as f64 * share) * values[*column];
                    at += 1;
                }
            }
        }
        out
    }
}

/// Integrals over what is above both horizons (3.27 and 3.31): a digon between two half planes through y, in angles along and around y, whose points
/// are denser where the functions have a root at a horizon.
fn matrix(basis: &Basis<f64>, groups: &[Vec<usize>; 2], beta: f64, tilts: bool) -> Vec<f64> {
    let points = gauss_legendre(2 * basis.order() + 24);
    let mut sums = groups.each_ref().map(|group| vec![0.0; group.len() * group.len()]);
    for [s, across] in &points {
        // Around y from z toward x; the digon is as wide as the hemisphere less β.
        let width = PI - beta;
        let (wave, slope) = (PI * (s - 0.5)).sin_cos();
        let from = 0.5 * width * (1.0 + wave) - FRAC_PI_2;
        let around = 0.5 * width * PI * slope * across;
        for [t, along] in &points {
            // One side of the plane of symmetry counts for both.
            let latitude = FRAC_PI_2 * t;
            let weight = 2.0 * around * FRAC_PI_2 * along * latitude.cos();
            let at = |angle: f64| basis.hemispherical([latitude.cos() * angle.sin(), latitude.sin(), latitude.cos() * angle.cos()]);
            let before = at(from);
            let after = if tilts { at(from + beta) } else { before.clone() };
            for (sums, group) in sums.iter_mut().zip(groups) {
                // Of order 1 nothing is odd.
                for (row, sums) in group.iter().zip(sums.chunks_exact_mut(group.len().max(1))) {
                    let scaled = weight * after[*row];
                    sums.iter_mut().zip(group).for_each(|(sum, column)| *sum += scaled * before[*column]);
                }
            }
        }
    }
    let [even, odd] = sums;
    [even, odd].concat()
}

#[cfg(test)]
mod tests {
    use super::super::{count, quadrature::hemisphere};
    use super::*;
    use glam::{DMat3, DVec3};

    const ORDER: usize = 10;

    fn rows(matrix: DMat3) -> [[f64; 3]; 3] {
        matrix.transpose().to_cols_array_2d()
    }

    fn projected(function: impl Fn(DVec3) -> f64) -> Vec<f64> {
        projected_by(96, 128, function)
    }

    /// By so many points that an edge across the hemisphere does little harm.
    fn projected_finely(function: impl Fn(DVec3) -> f64) -> Vec<f64> {
        projected_by(300, 600, function)
    }

    fn projected_by(heights: usize, azimuths: usize, function: impl Fn(DVec3) -> f64) -> Vec<f64> {
        let basis = Basis::new(ORDER);
        let mut out = vec![0.0; count(ORDER)];
        for (direction, weight) in hemisphere(heights, azimuths) {
            let scaled = weight * function(DVec3::from(direction));
            if scaled != 0.0 {
                out.iter_mut().zip(basis.hemispherical(direction)).for_each(|(out, h)| *out += scaled * h);
            }
        }
        out
    }

    fn lobe(axis: DVec3, exponent: i32) -> impl Fn(DVec3) -> f64 {
        move |direction| direction.dot(axis).max(0.0).powi(exponent)
    }

    /// Square error of an expansion as a share of the other's energy, square-rooted.
    fn error(found: &[f64], right: &[f64]) -> f64 {
        let square = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>();
        (square(&mut found.iter().zip(right).map(|(a, b)| a - b)) / square(&mut right.iter().copied())).sqrt()
    }

    #[test]
    fn angles_make_up_the_rotation() {
        let turned = |angle: f64| DMat3::from_rotation_z(angle);
        let some = DMat3::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 2.5);
        for matrix in [DMat3::IDENTITY, some, turned(1.0), DMat3::from_rotation_y(PI) * turned(0.4), DMat3::from_rotation_x(1e-14), DMat3::from_rotation_y(1.0)]
        {
            let [first, beta, last] = euler_angles(rows(matrix));
            let again = turned(last) * DMat3::from_rotation_y(beta) * turned(first);
            assert!(again.abs_diff_eq(matrix, 1e-10) && (0.0..=PI).contains(&beta), "{matrix}: {again}");
        }
    }

    /// Where this fails as the numbers are meant to change, VERSION has to change too: tables are kept between runs.
    #[test]
    fn numbers_are_those_of_their_version() {
        let sums = [(FRAC_PI_2, false), (PI, true)].map(|(largest, tilts)| {
            let numbers = matrices(4, &groups(4), 5, largest, tilts);
            numbers.iter().zip(1..).map(|(number, at)| f64::from(*number) * f64::from(at).sqrt()).sum::<f64>()
        });
        assert!(VERSION == 1 && (sums[0] - SUMS[0]).abs() < 1e-3 && (sums[1] - SUMS[1]).abs() < 1e-3, "{sums:?}");
    }

    const SUMS: [f64; 2] = [1140.4915, 264.2114];

    #[test]
    fn a_single_function_is_cut_by_the_horizon() {
        // What is the same everywhere stays so; only the share of it that was below the horizon is lost.
        for method in [Method::DigonDeletion, Method::Precomputed] {
            let tilting = Tilting::new(1, method, 8);
            let rows = rows(DMat3::from_rotation_y(FRAC_PI_2));
            let found = tilting.rotate(&[1.0], rows);
            assert!(found.len() == 1 && (found[0] - 0.5).abs() < 1e-6, "{method:?}: {found:?}");
        }
    }

    #[test]
    fn every_way_knows_its_order_and_its_size() {
        // Of the 9 functions 6 are even in y and 3 odd; of a conversion two times 3·3 for m = 0, 2·2 and 1 both ways otherwise.
        let sizes = [(Method::Conversion { spherical: 3 }, 9 + 2 * 4 + 2), (Method::DigonDeletion, 2 * (36 + 9)), (Method::Precomputed, 2 * (36 + 9))];
        for (method, numbers) in sizes {
            let tilting = Tilting::new(3, method, 1);
            assert_eq!((tilting.order(), tilting.memory()), (3, 4 * numbers), "{method:?}");
        }
    }

    /// Between two angles a matrix is their mean, beyond the largest the last.
    #[test]
    fn matrices_are_linear_between_angles() {
        let groups = groups(2);
        let numbers = (0..3).flat_map(|step| (0..matrix_size(&groups)).map(move |at| (step * (at + 2)) as f32)).collect();
        let table = Table { steps: 2, largest: 1.0, groups: groups.clone(), numbers };
        let values = [0.3, -0.7, 1.1, 0.4];
        for (beta, step) in [(0.0, 0.0), (0.125, 0.25), (0.5, 1.0), (0.875, 1.75), (1.0, 2.0), (3.0, 2.0)] {
            let mut known = [0.0; 4];
            let pairs = groups.iter().flat_map(|group| group.iter().flat_map(move |row| group.iter().map(move |column| (*row, *column))));
            pairs.enumerate().for_each(|(at, (row, column))| known[row] += step * (at + 2) as f64 * values[column]);
            assert!(table.apply(&values, beta).iter().zip(known).all(|(a, b)| (a - b).abs() < 1e-12), "{beta}");
        }
    }

    /// Of what is the same everywhere a tilt takes the digon away: `1 − β/π` of the first coefficient is left, and of the cosine's moment `(1 + cosβ)/2`.
    #[test]
    fn digons_have_their_area_and_moment() {
        for beta in [0.0f64, 0.4, 1.3] {
            let numbers = matrix(&Basis::new(2), &groups(2), beta, false);
            // The even functions are those at 0, 2 and 3; the third is the cosine's.
            let [first, second] = [numbers[0], numbers[1]];
            assert!((first - (1.0 - beta / PI)).abs() < 1e-9, "{beta}: {first}");
            // √3 (2 cosθ − 1) times the first function's square, 1/2π.
            let known = 3f64.sqrt() * (0.5 * (1.0 + beta.cos()) - (1.0 - beta / PI));
            assert!((second - known).abs() < 1e-9, "{beta}: {second}, not {known}");
        }
    }

    #[test]
    fn turns_around_the_normal_lose_nothing() {
        let axis = DVec3::new(0.48, 0.6, 0.64);
        let mut turned = projected(lobe(axis, 5));
        turn(&mut turned, 0.7);
        assert!(error(&turned, &projected(lobe(DMat3::from_rotation_z(0.7) * axis, 5))) < 1e-10);
    }

    /// A lobe that stays above the horizon, by rotations whose axis is none of the frame's.
    #[test]
    fn lobes_land_where_they_should() {
        let axis = DVec3::new(0.2, -0.1, 1.0).normalize();
        let function = projected(lobe(axis, 12));
        let conversion = Tilting::new(ORDER, Method::Conversion { spherical: 14 }, 0);
        let table = Tilting::new(ORDER, Method::Precomputed, 30);
        for degrees in [0.0, 3.0, 10.0, 31.0] {
            let matrix = DMat3::from_axis_angle(DVec3::new(0.6, 0.8, 0.0), f64::to_radians(degrees));
            let right = projected(lobe(matrix * axis, 12));
            let by_table = error(&table.rotate(&function, rows(matrix)), &right);
            assert!(by_table < 0.02, "precomputed, {degrees}°: {by_table}");
            let by_conversion = error(&conversion.rotate(&function, rows(matrix)), &right);
            assert!(by_conversion < 0.08, "conversion, {degrees}°: {by_conversion}");
        }
    }

    #[test]
    fn a_table_entry_is_the_projection_of_the_tilted_function() {
        let beta = 0.6;
        let basis = Basis::<f64>::new(ORDER);
        let function: Vec<f64> = (0..count(ORDER)).map(|k| ((k * k) as f64 * 0.37 + 0.2).sin()).collect();
        let groups = groups(ORDER);
        let numbers = matrix(&basis, &groups, beta, true).into_iter().map(|v| v as f32).collect::<Vec<_>>();
        let table = Table { steps: 0, largest: beta, groups, numbers };
        let tilt = DMat3::from_rotation_y(beta);
        let right = projected_finely(|direction| {
            let before = tilt.transpose() * direction;
            if before.z <= 0.0 { 0.0 } else { basis.hemispherical(before.to_array()).iter().zip(&function).map(|(h, f)| h * f).sum() }
        });
        assert!(error(&table.apply(&function, beta), &right) < 3e-3, "{}", error(&table.apply(&function, beta), &right));
    }

    #[test]
    fn energy_never_grows() {
        for method in [Method::Conversion { spherical: 14 }, Method::Precomputed] {
            let tilting = Tilting::new(ORDER, method, 36);
            for degrees in [5.0, 45.0, 90.0, 120.0, 180.0] {
                for k in (0..count(ORDER)).step_by(7) {
                    let mut unit = vec![0.0; count(ORDER)];
                    unit[k] = 1.0;
                    let energy: f64 = tilting.rotate(&unit, around_y(f64::to_radians(degrees))).iter().map(|v| v * v).sum();
                    assert!(energy <= 1.0 + 1e-5, "{method:?}, {degrees}°, {k}: {energy}");
                }
            }
        }
    }

    /// The figures of the approximation: near for small tilts, far off for large ones, nothing beyond a right angle.
    #[test]
    fn digon_deletion_is_near_for_small_tilts() {
        // In steps of 10°.
        let tilting = Tilting::new(ORDER, Method::DigonDeletion, 9);
        let function = projected(lobe(DVec3::Z, 5));
        for (degrees, most) in [(10.0, 0.04), (30.0, 0.15), (60.0, 0.6)] {
            let beta = f64::to_radians(degrees);
            let right = projected_finely(lobe(DVec3::new(beta.sin(), 0.0, beta.cos()), 5));
            let found = error(&tilting.rotate(&function, around_y(beta)), &right);
            assert!(found < most, "{degrees}°: {found}");
        }
        assert!(tilting.rotate(&function, around_y(2.0)).iter().all(|v| *v == 0.0));
    }
}
