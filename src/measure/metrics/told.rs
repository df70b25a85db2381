//! Errors as people read them: in tables, plots and pages alike.

use super::{Errors, Interval};

/// A metric in words.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Told {
    /// With its unit; `< x` where the reference's noise hides it.
    pub value: String,
    /// Where it lies with 95 %, in the same unit, which is left out; None where that is not known.
    pub interval: Option<String>,
}

impl Told {
    /// Both in a line.
    pub fn sentence(&self) -> String {
        let Self { value, interval } = self;
        interval.as_ref().map_or(value.clone(), |interval| format!("{value} ({interval})"))
    }
}

impl Errors {
    /// A metric with so many digits behind the point of percents, and two more where it is no share; None where it could not be measured.
    pub fn told(&self, metric: &str, digits: usize) -> Option<Told> {
        let value = self.metric(metric).flatten()?;
        let (factor, digits, unit) = if Self::is_share(metric) { (100.0, digits, " %") } else { (1.0, digits + 2, "") };
        let number = |value: f64| format!("{:.digits$}", factor * value);
        let interval = self.interval(metric);
        let value = match interval.filter(|interval| interval.below_noise) {
            // Rounded up, so that it holds.
            Some(interval) => format!("< {}{unit}", number(up(interval.most() * factor, digits) / factor)),
            None => number(value) + unit,
        };
        Some(Told { value, interval: interval.map(|Interval { low, high, .. }| format!("{} … {}", number(low), number(high))) })
    }
}

/// The next number with so many digits behind its point.
fn up(value: f64, digits: usize) -> f64 {
    let shift = 10f64.powi(digits as i32);
    // What is such a number but for its rounding stays.
    (value * shift - 1e-6).ceil() / shift
}

#[cfg(test)]
mod tests {
    use super::up;

    #[test]
    fn limits_are_rounded_up() {
        assert_eq!([0.001, 0.11, 0.1100001, 0.119, 2.0].map(|value| up(value, 2)), [0.01, 0.11, 0.12, 0.12, 2.0]);
    }
}
