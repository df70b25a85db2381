//! How measured times spread, and which differences between them are larger than the noise.
//!
//! Two variants are measured in pairs, one of each a round, so that what slows the machine for a while slows both. The logarithms of the pairs'
//! ratios, whose distribution is symmetric about 0 where nothing but noise differs, go into Wilcoxon's signed rank test, exact for any number of
//! pairs; the shift that belongs to it is that of Hodges and Lehmann. Both ask for no shape of the noise, and single outliers cannot carry them.

use serde::{Deserialize, Serialize};

/// How certain the intervals of a comparison are, all of them together.
pub const CONFIDENCE: f64 = 0.95;

/// How often the recommended number of runs finds the difference that was asked for.
pub const POWER: f64 = 0.9;

/// The middle of several measurements and how they spread about it, in the unit of the measurements.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    pub median: f64,
    /// A quarter of the measurements lies below.
    pub lower_quartile: f64,
    /// A quarter of the measurements lies above.
    pub upper_quartile: f64,
    pub least: f64,
    pub most: f64,
}

impl Spread {
    /// Quantiles are linear between neighbours; None without a measurement.
    pub fn of(values: &[f64]) -> Option<Self> {
        let sorted = sorted(values.to_vec());
        let at = |share| quantile(&sorted, share);
        Some(Self { median: at(0.5)?, lower_quartile: at(0.25)?, upper_quartile: at(0.75)?, least: at(0.0)?, most: at(1.0)? })
    }
}

/// A quantile of sorted values, linear between neighbours; None without a value.
pub fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let place = share * sorted.len().checked_sub(1)? as f64;
    let (below, above) = (place.floor() as usize, place.ceil() as usize);
    Some(sorted[below] + (sorted[above] - sorted[below]) * place.fract())
}

/// The exponent p of the power law c·xᵖ that fits positive values best, by least squares of their logarithms; None where fewer than two differ in x.
pub fn slope(points: &[[f64; 2]]) -> Option<f64> {
    let logarithms: Vec<[f64; 2]> = points.iter().map(|point| point.map(f64::ln)).collect();
    let mean = |axis: usize| logarithms.iter().map(|point| point[axis]).sum::<f64>() / logarithms.len() as f64;
    let (x, y) = (mean(0), mean(1));
    let (covariance, variance) = logarithms.iter().fold((0.0, 0.0), |(c, v), point| (c + (point[0] - x) * (point[1] - y), v + (point[0] - x).powi(2)));
    (variance > 1e-12 && covariance.is_finite()).then(|| covariance / variance)
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
}

/// How two variants differ in a positive quantity, such as a time, measured in pairs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Difference {
    /// Median of the second over median of the first.
    pub ratio_of_medians: f64,
    /// exp of the Hodges-Lehmann estimate of ln(second / first): the median of the means of any two logarithms.
    pub ratio: f64,
    /// Where the true ratio lies with [`Difference::confidence`]; None where there are too few pairs to say it.
    pub ratio_interval: Option<[f64; 2]>,
    /// Of the interval, after the correction for several comparisons.
    pub confidence: f64,
    /// Chance of a difference like this, or a larger one, from noise alone: the exact two-sided signed rank test.
    pub p: f64,
    /// The same times the number of comparisons (Bonferroni), at most 1.
    pub p_corrected: f64,
    /// Whether the difference is larger than the noise: `p_corrected` is at most 1 − [`CONFIDENCE`].
    pub significant: bool,
    /// Standard deviation of ln(second / first); None for a single pair.
    pub deviation_of_log_ratio: Option<f64>,
}

impl Difference {
    /// Compares `second` with `first`, positive and measured in pairs, as one of `comparisons` that are all to hold together. None without a pair.
    pub fn between(first: &[f64], second: &[f64], comparisons: usize) -> Option<Self> {
        let pairs: Vec<f64> = first.iter().zip(second).map(|(a, b)| (b / a).ln()).collect();
        let comparisons = comparisons.max(1) as f64;
        let error = (1.0 - CONFIDENCE) / comparisons;
        let averages = sorted(walsh_averages(&pairs));
        let p = signed_rank_p(&pairs);
        let p_corrected = (p * comparisons).min(1.0);
        Some(Self {
            ratio_of_medians: Spread::of(second)?.median / Spread::of(first)?.median,
            ratio: quantile(&averages, 0.5)?.exp(),
            ratio_interval: interval(&averages, pairs.len(), error).map(|bounds| bounds.map(f64::exp)),
            confidence: 1.0 - error,
            p,
            p_corrected,
            significant: p_corrected <= 1.0 - CONFIDENCE,
            deviation_of_log_ratio: standard_deviation(&pairs),
        })
    }
}

/// Fewest pairs with which `comparisons` at once can show any difference: with fewer, even all pairs on one side may be chance.
pub fn least_runs(comparisons: usize) -> usize {
    let sides = 2.0 * comparisons.max(1) as f64 / (1.0 - CONFIDENCE);
    sides.log2().ceil() as usize
}

/// About how many pairs find a ratio of 1 + `difference` with the chance [`POWER`] where ln(second / first) has this standard deviation.
///
/// The number for a t-test (Guenther 1981) over the asymptotic efficiency of signed ranks under normal noise, 3/π.
pub fn runs_to_find(difference: f64, deviation_of_log_ratio: f64, comparisons: usize) -> usize {
    let (tail, miss) = (normal_tail((1.0 - CONFIDENCE) / 2.0 / comparisons.max(1) as f64), normal_tail(1.0 - POWER));
    let noise_over_signal = deviation_of_log_ratio / difference.ln_1p();
    let pairs = ((tail + miss) * noise_over_signal).powi(2) + tail * tail / 2.0;
    ((pairs * std::f64::consts::PI / 3.0).ceil() as usize).max(least_runs(comparisons))
}

/// How many standard deviations about the mean hold a normal variable but with this chance.
pub fn two_sided(error: f64) -> f64 {
    normal_tail(error / 2.0)
}

/// The point above which a standard normal variable lies with this probability, below one half; to 4.5e-4 (Abramowitz and Stegun 26.2.23).
fn normal_tail(probability: f64) -> f64 {
    let t = (-2.0 * probability.ln()).sqrt();
    t - (2.515517 + t * (0.802853 + t * 0.010328)) / (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308)))
}

fn standard_deviation(values: &[f64]) -> Option<f64> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.len() > 1).then(|| (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt())
}

/// The means of any two values, each with itself too (Walsh 1949).
fn walsh_averages(values: &[f64]) -> Vec<f64> {
    values.iter().enumerate().flat_map(|(i, a)| values[i..].iter().map(move |b| (a + b) / 2.0)).collect()
}

/// The interval of the shift of so many pairs that the signed rank test does not refuse at this error (Tukey 1949); None with too few pairs.
fn interval(walsh_averages: &[f64], pairs: usize, error: f64) -> Option<[f64; 2]> {
    let ranks: Vec<usize> = (1..=pairs).map(|rank| 2 * rank).collect();
    let mut below = 0.0;
    // Ranks count twice, so only every other sum occurs.
    let cut = signed_rank_distribution(&ranks).into_iter().step_by(2).take_while(|probability| {
        below += probability;
        below <= error / 2.0
    });
    let last = cut.count().checked_sub(1)?;
    Some([*walsh_averages.get(last)?, *walsh_averages.get(walsh_averages.len().checked_sub(last + 1)?)?])
}

/// Two-sided p of Wilcoxon's signed rank test against a median of 0: exact, given the ranks; zeros are left out, ties share the mean of their ranks.
fn signed_rank_p(differences: &[f64]) -> f64 {
    let mut differences: Vec<f64> = differences.iter().copied().filter(|difference| *difference != 0.0).collect();
    differences.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let ranks = doubled_ranks(&differences);
    let positive: usize = differences.iter().zip(&ranks).filter(|(difference, _)| **difference > 0.0).map(|(_, rank)| rank).sum();
    let all: usize = ranks.iter().sum();
    // The distribution is symmetric.
    let tail: f64 = signed_rank_distribution(&ranks).iter().take(positive.min(all - positive) + 1).sum();
    (2.0 * tail).min(1.0)
}

/// Twice the ranks of values that are sorted by size: whole numbers even where ties share the mean of two.
fn doubled_ranks(sorted: &[f64]) -> Vec<usize> {
    let ties = sorted.chunk_by(|a, b| a.abs() == b.abs());
    let mut before = 0;
    ties.flat_map(|ties| {
        let rank = 2 * before + ties.len() + 1;
        before += ties.len();
        std::iter::repeat_n(rank, ties.len())
    })
    .collect()
}

/// The probability of each sum of the ranks of positive differences, from 0, where either sign is as likely.
fn signed_rank_distribution(ranks: &[usize]) -> Vec<f64> {
    let mut probabilities = vec![0.0; ranks.iter().sum::<usize>() + 1];
    probabilities[0] = 1.0;
    let mut most = 0;
    for rank in ranks {
        most += rank;
        for sum in (0..=most).rev() {
            let with = sum.checked_sub(*rank).map_or(0.0, |rest| probabilities[rest]);
            probabilities[sum] = 0.5 * (probabilities[sum] + with);
        }
    }
    probabilities
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn close(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() <= tolerance, "found {found}, expected {expected}");
    }

    /// Differences of ranks 1..=n whose positive ones add up to `sum`.
    fn with_rank_sum(n: usize, sum: usize) -> Vec<f64> {
        let mut rest = sum;
        let mut differences: Vec<f64> = (1..=n)
            .rev()
            .map(|rank| {
                let is_positive = rest >= rank;
                rest -= if is_positive { rank } else { 0 };
                if is_positive { rank as f64 } else { -(rank as f64) }
            })
            .collect();
        differences.reverse();
        assert_eq!(rest, 0);
        differences
    }

    #[test]
    fn the_slope_of_a_power_law_is_its_exponent() {
        let law = |x: f64| [x, 3.0 * x.powf(0.4)];
        assert!((slope(&[law(10.0), law(1e3), law(2e5)]).unwrap() - 0.4).abs() < 1e-12);
        // Noise that is even to both sides leaves it.
        assert!((slope(&[[1.0, 2.0], [1.0, 0.5], [100.0, 20.0], [100.0, 5.0]]).unwrap() - 0.5).abs() < 1e-12);
        assert_eq!([slope(&[]), slope(&[law(2.0)]), slope(&[law(2.0), [2.0, 9.0]]), slope(&[law(2.0), [3.0, 0.0]])], [None; 4]);
    }

    #[test]
    fn a_spread_by_hand() {
        let spread = Spread::of(&[4.0, 1.0, 3.0, 2.0]).unwrap();
        assert_eq!(spread, Spread { median: 2.5, lower_quartile: 1.75, upper_quartile: 3.25, least: 1.0, most: 4.0 });
        assert_eq!(Spread::of(&[7.0]).unwrap().upper_quartile, 7.0);
        assert_eq!(Spread::of(&[]), None);
    }

    /// Critical values of T at 5 %, two-sided, and the next that is not significant (Wilcoxon and Wilcox 1964, as printed in textbooks).
    #[test]
    fn critical_values_are_those_of_the_tables() {
        for (n, critical) in [(6, 0), (7, 2), (8, 3), (9, 5), (10, 8), (11, 10), (12, 13), (15, 25), (20, 52), (25, 89)] {
            assert!(signed_rank_p(&with_rank_sum(n, critical)) <= 0.05, "{n}");
            assert!(signed_rank_p(&with_rank_sum(n, critical + 1)) > 0.05, "{n}");
        }
        assert!(signed_rank_p(&with_rank_sum(5, 0)) > 0.05);
        close(signed_rank_p(&with_rank_sum(10, 8)), 50.0 / 1024.0, 1e-15);
    }

    /// Hollander and Wolfe, Nonparametric Statistical Methods, table 3.1: a depression scale before and after a tranquillizer, × 1000.
    #[test]
    fn a_published_example_has_its_p_its_estimate_and_its_interval() {
        let before = [1830.0, 500.0, 1620.0, 2480.0, 1680.0, 1880.0, 1550.0, 3060.0, 1300.0];
        let after = [878.0, 647.0, 598.0, 2050.0, 1060.0, 1290.0, 1060.0, 3140.0, 1290.0];
        let differences: Vec<f64> = before.iter().zip(after).map(|(x, y)| y - x).collect();
        close(signed_rank_p(&differences), 20.0 / 512.0, 1e-12);
        let averages = sorted(walsh_averages(&differences));
        assert_eq!(quantile(&averages, 0.5), Some(-460.0));
        assert_eq!(interval(&averages, differences.len(), 0.04), Some([-786.0, -10.0]));
    }

    /// Darwin's maize, crossed less self-fertilised [inches / 8]: what the randomization over the signs of its ranks, done by hand, gives.
    #[test]
    fn ties_and_zeros() {
        let maize = [49.0, -67.0, 8.0, 16.0, 6.0, 23.0, 28.0, 41.0, 14.0, 29.0, 56.0, 24.0, 75.0, 60.0, -48.0];
        close(signed_rank_p(&maize), 0.041259765625, 1e-12);
        assert_eq!(doubled_ranks(&[-1.0, 1.0, 2.0, -3.0, 3.0, 3.0]), [3, 3, 6, 10, 10, 10]);
        // Ranks 1½, 1½, 3, all positive: one of 8 sign patterns, twice.
        close(signed_rank_p(&[1.0, 1.0, 2.0, 0.0]), 0.25, 1e-15);
        assert_eq!(signed_rank_p(&[0.0, 0.0]), 1.0);
        assert_eq!(signed_rank_p(&[1.0, -1.0]), 1.0);
    }

    #[test]
    fn a_difference_by_hand() {
        let first = [1.0; 6];
        let second = [2.0, 2.0, 4.0, 4.0, 2.0, 4.0];
        let found = Difference::between(&first, &second, 1).unwrap();
        close(found.ratio_of_medians, 3.0, 1e-12);
        // Of 21 means of two logarithms, 6 are those of 2, 9 those of √8.
        close(found.ratio, 8f64.sqrt(), 1e-12);
        let [low, high] = found.ratio_interval.unwrap();
        close(low, 2.0, 1e-12);
        close(high, 4.0, 1e-12);
        assert_eq!((found.p, found.significant), (2.0 / 64.0, true));
        let one_of_two = Difference::between(&first, &second, 2).unwrap();
        assert_eq!((one_of_two.p_corrected, one_of_two.significant, one_of_two.ratio_interval), (4.0 / 64.0, false, None));
        assert_eq!(Difference::between(&[], &[], 1), None);
        assert_eq!(Difference::between(&[1.0], &[2.0], 1).unwrap().deviation_of_log_ratio, None);
    }

    #[test]
    fn the_same_times_do_not_differ() {
        let times = [1.0, 1.5, 0.5, 3.0, 2.0, 1.0, 1.0];
        let found = Difference::between(&times, &times, 1).unwrap();
        assert_eq!((found.ratio, found.p, found.significant), (1.0, 1.0, false));
        assert_eq!(found.ratio_interval, Some([1.0, 1.0]));
    }

    #[test]
    fn with_the_least_runs_all_on_one_side_is_significant_and_with_one_fewer_nothing_is() {
        for comparisons in [1, 2, 3, 10, 45, 190] {
            let significant = |runs: usize| {
                let second: Vec<f64> = (0..runs).map(|run| 2.0 + run as f64).collect();
                Difference::between(&vec![1.0; runs], &second, comparisons).unwrap()
            };
            let least = least_runs(comparisons);
            assert!(significant(least).significant && significant(least).ratio_interval.is_some(), "{comparisons}");
            assert!(!significant(least - 1).significant && significant(least - 1).ratio_interval.is_none(), "{comparisons}");
        }
        assert_eq!([1, 3].map(least_runs), [6, 7]);
    }

    #[test]
    fn normal_tails_are_those_of_the_tables() {
        for (probability, point) in [(0.025, 1.95996), (0.1, 1.28155), (0.005, 2.57583), (0.0005, 3.29053)] {
            close(normal_tail(probability), point, 5e-4);
        }
    }

    /// Normal noise that depends on its seed alone.
    struct Noise(u64);

    impl Noise {
        fn uniform(&mut self) -> f64 {
            // SplitMix64 (Steele and others 2014).
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut bits = self.0;
            bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((bits ^ (bits >> 31)) >> 11) as f64 / (1u64 << 53) as f64
        }

        fn normal(&mut self) -> f64 {
            let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
            radius * (std::f64::consts::TAU * self.uniform()).cos()
        }
    }

    /// Of 1,000 seeds, how many comparisons find a difference between times of 10 % noise, of which the second is slower by a factor.
    fn found(factor: f64, runs: usize) -> usize {
        let is_found = |seed: u64| {
            let mut noise = Noise(seed << 32);
            let mut times = |factor: f64| (0..runs).map(|_| factor * (0.1 * noise.normal()).exp()).collect::<Vec<f64>>();
            let (first, second) = (times(1.0), times(factor));
            Difference::between(&first, &second, 1).unwrap().significant
        };
        (0..1000).filter(|seed| is_found(*seed)).count()
    }

    #[test]
    fn false_alarms_come_at_the_stated_rate() {
        // The exact level of 10 pairs is 4.88 %; three standard deviations of 1,000 draws are 20.
        let alarms = found(1.0, 10);
        assert!((29..=69).contains(&alarms), "{alarms}");
    }

    /// Four variants that do the same make six pairs; the correction keeps any alarm among them as rare as one of a single pair.
    #[test]
    fn several_pairs_at_once_raise_no_more_false_alarms() {
        let has_alarm = |seed: u64| {
            let mut noise = Noise(seed << 32);
            let times: Vec<Vec<f64>> = (0..4).map(|_| (0..10).map(|_| (0.1 * noise.normal()).exp()).collect()).collect();
            let differ = |a: usize, b: usize| Difference::between(&times[a], &times[b], 6).unwrap().significant;
            (0..4).any(|a| (a + 1..4).any(|b| differ(a, b)))
        };
        let alarms = (0..1000).filter(|seed| has_alarm(*seed)).count();
        assert!((5..=69).contains(&alarms), "{alarms}");
    }

    /// What slows the machine for a while slows both of a pair, and now and then a single run takes three times as long.
    #[test]
    fn a_busy_machine_raises_no_false_alarms_and_hides_no_tenth() {
        let count = |factor: f64| {
            let is_found = |seed: u64| {
                let mut noise = Noise(seed << 32);
                let mut pairs = Vec::new();
                for _ in 0..30 {
                    let slowdown = 1.0 + noise.uniform();
                    let mut time = |factor: f64| factor * slowdown * (0.05 * noise.normal()).exp() * if noise.uniform() < 0.05 { 3.0 } else { 1.0 };
                    pairs.push([time(1.0), time(factor)]);
                }
                let [first, second] = [0, 1].map(|side| pairs.iter().map(|pair| pair[side]).collect::<Vec<f64>>());
                Difference::between(&first, &second, 1).unwrap().significant
            };
            (0..1000).filter(|seed| is_found(*seed)).count()
        };
        let (alarms, found) = (count(1.0), count(1.1));
        assert!((29..=69).contains(&alarms) && found >= 950, "{alarms} {found}");
    }

    #[test]
    fn a_tenth_slower_under_a_tenth_of_noise_is_found_with_the_runs_that_are_recommended() {
        let runs = runs_to_find(0.1, 0.1 * 2f64.sqrt(), 1);
        assert!((20..40).contains(&runs), "{runs}");
        let found = found(1.1, runs);
        assert!((880..=960).contains(&found), "{found} of 1000 with {runs} runs");
    }
}
