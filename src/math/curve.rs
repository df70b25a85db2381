//! Values that change in time, by keys.

use glam::{DQuat, DVec3};

/// What can stand between two keys.
pub trait Value: Copy + PartialEq {
    /// Between `self` at 0 and `other` at 1.
    fn toward(self, other: Self, share: f64) -> Self;

    /// The sum of values times weights: from the first key, its rate, the second key and its rate.
    fn weighted(values: [Self; 4], weights: [f64; 4]) -> Self;
}

impl Value for f64 {
    fn toward(self, other: Self, share: f64) -> Self {
        self + share * (other - self)
    }

    fn weighted(values: [Self; 4], weights: [f64; 4]) -> Self {
        values.into_iter().zip(weights).map(|(value, weight)| value * weight).sum()
    }
}

impl Value for DVec3 {
    fn toward(self, other: Self, share: f64) -> Self {
        self.lerp(other, share)
    }

    fn weighted(values: [Self; 4], weights: [f64; 4]) -> Self {
        values.into_iter().zip(weights).map(|(value, weight)| value * weight).sum()
    }
}

impl Value for DQuat {
    /// The shorter way round.
    fn toward(self, other: Self, share: f64) -> Self {
        self.slerp(other, share)
    }

    fn weighted(values: [Self; 4], weights: [f64; 4]) -> Self {
        let sum = values.into_iter().zip(weights).fold(DQuat::from_array([0.0; 4]), |sum, (value, weight)| sum + value * weight);
        if sum.length_squared() > 0.0 { sum.normalize() } else { values[0] }
    }
}

/// How values go from one key to the next.
#[derive(Debug, Clone, PartialEq)]
pub enum Between<V> {
    /// Each holds until the next.
    Step,
    /// In even steps.
    Linear,
    /// By cubic polynomials with these rates before and after each key [per second].
    Cubic(Vec<[V; 2]>),
}

/// A value for each time: of its keys, before the first that of the first, after the last that of the last.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve<V> {
    /// Ascending [s].
    times: Vec<f64>,
    values: Vec<V>,
    between: Between<V>,
}

impl<V: Value> Curve<V> {
    /// The same at all times.
    pub fn constant(value: V) -> Self {
        Self { times: vec![0.0], values: vec![value], between: Between::Step }
    }

    /// None where there are no keys, or other numbers of times, values and rates, or where a time is not later than the one before.
    pub fn new(times: Vec<f64>, values: Vec<V>, between: Between<V>) -> Option<Self> {
        let rates = if let Between::Cubic(rates) = &between { rates.len() } else { times.len() };
        let is_whole = !times.is_empty() && times.len() == values.len() && rates == values.len();
        let ascends = times.iter().all(|time| time.is_finite()) && times.windows(2).all(|pair| pair[0] < pair[1]);
        (is_whole && ascends).then_some(Self { times, values, between })
    }

    /// Whether it has the same value at all times.
    pub fn is_constant(&self) -> bool {
        matches!(self.between, Between::Step | Between::Linear) && self.values.windows(2).all(|pair| pair[0] == pair[1])
    }

    /// The last of its keys [s].
    pub fn end(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }

    /// Those of its keys.
    pub fn values(&self) -> &[V] {
        &self.values
    }

    /// Its value at a time [s].
    pub fn at(&self, time: f64) -> V {
        let next = self.times.partition_point(|key| *key <= time);
        if next == 0 || next == self.times.len() {
            return self.values[next.saturating_sub(1)];
        }
        let (before, span) = (next - 1, self.times[next] - self.times[next - 1]);
        let share = (time - self.times[before]) / span;
        let (a, b) = (self.values[before], self.values[next]);
        match &self.between {
            Between::Step => a,
            Between::Linear => a.toward(b, share),
            Between::Cubic(rates) => {
                let (squared, cubed) = (share * share, share * share * share);
                let weights =
                    [2.0 * cubed - 3.0 * squared + 1.0, span * (cubed - 2.0 * squared + share), 3.0 * squared - 2.0 * cubed, span * (cubed - squared)];
                V::weighted([a, rates[before][1], b, rates[next][0]], weights)
            }
        }
    }
}

/// Values whose coordinates are on their own.
pub trait Components: Value {
    /// A value of what is made of each of the coordinates of several.
    fn each(values: &[Self], make: impl Fn(&[f64]) -> Vec<f64>) -> Vec<Self>;
}

impl Components for f64 {
    fn each(values: &[Self], make: impl Fn(&[f64]) -> Vec<f64>) -> Vec<Self> {
        make(values)
    }
}

impl Components for DVec3 {
    fn each(values: &[Self], make: impl Fn(&[f64]) -> Vec<f64>) -> Vec<Self> {
        let [x, y, z] = [0, 1, 2].map(|axis| make(&values.iter().map(|value| value[axis]).collect::<Vec<_>>()));
        x.into_iter().zip(y).zip(z).map(|((x, y), z)| DVec3::new(x, y, z)).collect()
    }
}

impl<V: Components> Between<V> {
    /// Cubic, with rates by which a curve passes smoothly through its values and never beyond two neighbours.
    pub fn smooth(times: &[f64], values: &[V]) -> Self {
        Self::Cubic(V::each(values, |values| rates(times, values)).into_iter().map(|rate| [rate; 2]).collect())
    }
}

/// The rates of such a curve: the weighted harmonic mean of the slopes on both
/// sides, 0 where these have different signs (Fritsch and Butland 1984).
fn rates(times: &[f64], values: &[f64]) -> Vec<f64> {
    let slope = |k: usize| (values[k + 1] - values[k]) / (times[k + 1] - times[k]);
    let rate = |k: usize| {
        if k == 0 || k + 1 >= times.len() {
            return 0.0;
        }
        let (before, after) = (slope(k - 1), slope(k));
        if before * after <= 0.0 {
            return 0.0;
        }
        let (left, right) = (times[k] - times[k - 1], times[k + 1] - times[k]);
        let share = (left + 2.0 * right) / (3.0 * (left + right));
        before * after / (share * after + (1.0 - share) * before)
    };
    (0..times.len()).map(rate).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn times() -> Vec<f64> {
        vec![1.0, 2.0, 4.0]
    }

    #[test]
    fn curves_hold_before_their_first_key_and_after_their_last() {
        for between in [Between::Step, Between::Linear, Between::Cubic(vec![[9.0; 2]; 3])] {
            let curve = Curve::new(times(), vec![5.0, 7.0, 3.0], between).unwrap();
            assert_eq!([-1.0, 1.0, 2.0, 4.0, 9.0].map(|time| curve.at(time)), [5.0, 5.0, 7.0, 3.0, 3.0]);
        }
    }

    #[test]
    fn steps_and_lines() {
        let curve = |between| Curve::new(times(), vec![DVec3::ZERO, DVec3::X, DVec3::Y], between).unwrap();
        assert_eq!(curve(Between::Step).at(3.9), DVec3::X);
        assert_eq!(curve(Between::Linear).at(2.5), DVec3::new(0.75, 0.25, 0.0));
    }

    /// Rates per second give back the cubic that they are of.
    #[test]
    fn cubics_are_exact_with_their_own_rates() {
        let (value, rate) = (|t: f64| t * t * t - 2.0 * t + 1.0, |t: f64| 3.0 * t * t - 2.0);
        let curve = Curve::new(times(), times().into_iter().map(value).collect(), Between::Cubic(times().into_iter().map(|t| [rate(t); 2]).collect())).unwrap();
        for time in [1.0, 1.3, 2.0, 2.7, 3.9] {
            assert!((curve.at(time) - value(time)).abs() < 1e-12, "{time}");
        }
    }

    #[test]
    fn turns_take_the_shorter_way() {
        let turn = |degrees: f64| DQuat::from_rotation_y(degrees.to_radians());
        let curve = Curve::new(vec![0.0, 1.0], vec![turn(350.0), turn(10.0)], Between::Linear).unwrap();
        assert!(curve.at(0.5).angle_between(turn(0.0)) < 1e-6);
    }

    #[test]
    fn keys_that_say_nothing_are_refused() {
        let refused = |times: &[f64], values: usize| Curve::new(times.to_vec(), vec![0.0; values], Between::Linear).is_none();
        assert!(refused(&[], 0) && refused(&[0.0], 2) && refused(&[1.0, 1.0], 2) && refused(&[2.0, 1.0], 2) && refused(&[f64::NAN], 1));
        assert!(Curve::new(vec![0.0, 1.0], vec![0.0; 2], Between::Cubic(vec![[0.0; 2]])).is_none());
    }

    proptest! {
        /// What holds for keys, such as light that is not negative, holds between them.
        #[test]
        fn smooth_curves_stay_between_their_keys(values in prop::collection::vec(0.0..10.0f64, 2..6), steps in prop::collection::vec(0.01..5.0f64, 6), share in 0.0..1.0f64) {
            let times: Vec<f64> = steps.iter().scan(0.0, |time, step| { *time += step; Some(*time) }).take(values.len()).collect();
            let curve = Curve::new(times.clone(), values.clone(), Between::smooth(&times, &values)).unwrap();
            for (pair, ends) in values.windows(2).zip(times.windows(2)) {
                let value = curve.at(ends[0] + share * (ends[1] - ends[0]));
                prop_assert!(value >= pair[0].min(pair[1]) - 1e-9 && value <= pair[0].max(pair[1]) + 1e-9);
            }
        }
    }
}
