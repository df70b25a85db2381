use super::*;
use crate::measure::layers::PICTURE;
use crate::measure::layers::{Layer, VALUE};
use proptest::prelude::*;

fn grey(width: u32, height: u32, values: Vec<f32>) -> Layers {
    Layers::new(width, height).with("irradiance", Layer::value(values))
}

/// A uniform number in 0..1 that depends on its index alone.
fn uniform(index: u32) -> f32 {
    let mut bits = index.wrapping_mul(0x9e37_79b9).wrapping_add(0x7f4a_7c15);
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x85eb_ca6b);
    bits = (bits ^ (bits >> 13)).wrapping_mul(0xc2b2_ae35);
    (bits ^ (bits >> 16)) as f32 / u32::MAX as f32
}

#[track_caller]
fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "found {found}, expected {expected}");
}

/// What cannot be told of one layer alone, without a picture, depth and normals.
const NEEDS_MORE: [&str; 5] = ["band_error", "rmse_edges", "rmse_interior", "flip", "hdr_flip"];

#[test]
fn four_pixels_by_hand() {
    // r = 1, 2, 4, 1 (mean 2), x − r = 0.5, 0, −1, 0.
    let reference = grey(2, 2, vec![1.0, 2.0, 4.0, 1.0]);
    let errors = compare(&grey(2, 2, vec![1.5, 2.0, 3.0, 1.0]), &reference, "irradiance", None).unwrap();
    assert_eq!((errors.pixels, errors.stride, errors.reference_mean), (4, 1, 2.0));
    close(errors.rmse_over_mean, (1.25f64 / 4.0).sqrt() / 2.0, 1e-12);
    close(errors.bias_over_mean, -0.5 / 4.0 / 2.0, 1e-12);
    close(errors.rms_of_relative.unwrap(), ((0.25f64 + 0.0625) / 4.0).sqrt(), 1e-12);
    close(errors.relmse, (0.25 / 1.04 + 1.0 / 16.04) / 4.0, 1e-12);
    // Blocks of one pixel: 0, 0, 0.25, 0.5.
    close(errors.block_p50.unwrap(), 0.125, 1e-12);
    close(errors.block_p99.unwrap(), 0.25 + 0.25 * 0.97, 1e-12);
    assert_eq!(errors.largest, LargestError { x: 0, y: 1, test: 3.0, reference: 4.0, over_mean: -0.5 });
}

#[test]
fn the_variance_of_the_reference_is_taken_off() {
    let reference = grey(2, 1, vec![2.0, 2.0]);
    let test = grey(2, 1, vec![3.0, 1.0]);
    let with = |variance: f32| compare(&test, &reference, "irradiance", Some(&grey(2, 1, vec![variance; 2]))).unwrap();
    close(with(0.75).rmse_over_mean, 0.25, 1e-6);
    close(with(0.75).reference_noise_over_mean.unwrap(), 0.75f64.sqrt() / 2.0, 1e-6);
    assert_eq!(with(5.0).rmse_over_mean, 0.0);
    let own = reference.clone().with(VARIANCE, Layer::value(vec![0.75; 2]));
    assert_eq!(compare(&test, &own, "irradiance", None).unwrap(), with(0.75));
    let [tested, of_another_layer] = [&test, &own].map(|picture| picture.clone().with("indirect", Layer::value(vec![2.0; 2])));
    assert_eq!(compare(&tested, &of_another_layer, "indirect", None).unwrap().reference_noise_over_mean, None);
}

#[test]
fn noise_of_the_reference_does_not_count_as_error() {
    // The truth is 1; the reference has uniform noise of variance 0.4²/12, the test an error of 5 %.
    let noisy: Vec<f32> = (0..40_000).map(|i| 1.0 + 0.4 * (uniform(i) - 0.5)).collect();
    let variance = grey(200, 200, vec![0.4 * 0.4 / 12.0; 40_000]);
    let test = grey(200, 200, vec![1.05; 40_000]);
    let raw = compare(&test, &grey(200, 200, noisy.clone()), "irradiance", None).unwrap();
    let corrected = compare(&test, &grey(200, 200, noisy), "irradiance", Some(&variance)).unwrap();
    close(raw.rmse_over_mean, (0.05f64.powi(2) + 0.16 / 12.0).sqrt(), 2e-3);
    close(corrected.rmse_over_mean, 0.05, 3e-3);
}

#[test]
fn deviations_of_colour_channels_add_up() {
    let rgb = |value: [f32; 3]| Layers::new(1, 1).with("irradiance", Layer::interleaved(&["R", "G", "B"], &value, 3));
    let errors = compare(&rgb([2.0; 3]), &rgb([1.0; 3]), "irradiance", Some(&rgb([0.25, 0.0, 0.0]))).unwrap();
    close(errors.reference_noise_over_mean.unwrap(), 0.2126 * 0.5, 1e-12);
    let errors = compare(&rgb([2.0; 3]), &rgb([1.0; 3]), "irradiance", Some(&rgb([0.25; 3]))).unwrap();
    close(errors.reference_noise_over_mean.unwrap(), 0.5, 1e-9);
}

#[test]
fn the_reference_decides_what_is_surface() {
    let reference = grey(3, 1, vec![1.0, 0.0, 1.0]);
    let test = grey(3, 1, vec![1.0, 1.0, 1.0]);
    let error = |reference: &Layers| compare(&test, reference, "irradiance", None).unwrap();
    assert_eq!(error(&reference).pixels, 2);
    let with_normal = reference.clone().with("normal", Layer::interleaved(&["X", "Y", "Z"], &[0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0], 3));
    assert_eq!(error(&with_normal).pixels, 2);
    close(error(&with_normal).reference_mean, 0.5, 1e-12);
    let with_depth = with_normal.with("depth", Layer::value(vec![3.0, 2.0, 1.0]));
    assert_eq!(error(&with_depth).pixels, 3);
    let only_sky = reference.with("depth", Layer::value(vec![0.0; 3]));
    assert!(matches!(compare(&test, &only_sky, "irradiance", None), Err(MetricsError::NoSurface)));
}

#[test]
fn a_strided_reference_takes_the_pixels_that_it_holds() {
    // k = 4 from pixel 2 on, as numpy's arange(2, 10, 4): columns 2 and 6.
    let test: Vec<f32> = (0..100).map(|i| 1.0 + i as f32).collect();
    let truth = |of: [usize; 4]| of.iter().map(|&i| 1.0 + i as f32).collect::<Vec<_>>();
    let reference = grey(2, 2, truth([22, 26, 62, 66])).with_attribute("stride", 4);
    let errors = compare(&grey(10, 10, test), &reference, "irradiance", None).unwrap();
    assert_eq!((errors.rmse_over_mean, errors.stride, errors.flip), (0.0, 4, None));
    assert_eq!((errors.largest.x, errors.largest.y), (2, 2));
    // Without the attribute the ratio of the sizes tells.
    let test: Vec<f32> = (0..64).map(|i| 1.0 + i as f32).collect();
    let errors = compare(&grey(8, 8, test), &grey(2, 2, truth([18, 22, 50, 54])), "irradiance", None).unwrap();
    assert_eq!((errors.rmse_over_mean, errors.stride), (0.0, 4));
}

#[test]
fn blocks_see_a_leak_that_pixels_average_away() {
    // 64×64: blocks of 2×2. One block 50 % too bright; pixel noise that cancels in each block elsewhere.
    let mut test: Vec<f32> = (0..64 * 64).map(|i| if i % 2 == 0 { 1.2 } else { 0.8 }).collect();
    for at in [10 * 64 + 10, 10 * 64 + 11, 11 * 64 + 10, 11 * 64 + 11] {
        test[at] = 1.5;
    }
    let errors = compare(&grey(64, 64, test), &grey(64, 64, vec![1.0; 64 * 64]), "irradiance", None).unwrap();
    close(errors.block_p50.unwrap(), 0.0, 1e-7);
    close(errors.rmse_over_mean, 0.2, 0.002);
    close(errors.largest.over_mean, 0.5, 1e-7);
}

#[test]
fn partial_blocks_are_dropped() {
    // 33×2: blocks of 2×2; column 32 is cut off, and the block at column 0 has a pixel without surface.
    let mut reference = vec![1.0f32; 66];
    reference[0] = 0.0;
    let mut test = reference.clone();
    (test[1], test[32], test[65]) = (9.0, 9.0, 9.0);
    let errors = compare(&grey(33, 2, test), &grey(33, 2, reference), "irradiance", None).unwrap();
    assert_eq!((errors.block_p50, errors.block_p99), (Some(0.0), Some(0.0)));
    let lone = compare(&grey(33, 1, vec![1.0; 33]), &grey(33, 1, vec![1.0; 33]), "irradiance", None).unwrap();
    assert_eq!(lone.block_p99, None);
}

#[test]
fn what_cannot_be_compared_is_an_error() {
    let one = grey(1, 1, vec![1.0]);
    let error = |test: &Layers, reference: &Layers| compare(test, reference, "irradiance", None).unwrap_err().to_string();
    assert_eq!(error(&one, &grey(1, 1, vec![0.0]).with("depth", Layer::value(vec![1.0]))), MetricsError::Black.to_string());
    assert!(error(&grey(3, 1, vec![1.0; 3]), &grey(2, 1, vec![1.0; 2])).contains("3×1"));
    assert!(error(&grey(1, 1, vec![f32::INFINITY]), &one).contains("tested picture"));
    let (first, all) = (one.clone().with_attribute("bounces", 1), one.clone().with_attribute("bounces", "all"));
    assert_eq!(error(&first, &all), "the picture has `bounces` 1, the reference all");
    assert!(compare(&first, &one, "irradiance", None).is_ok());
}

#[test]
fn flip_is_that_of_the_picture() {
    let reference = grey(2, 2, vec![1.0; 4]).with(PICTURE, Layer::value(vec![1.0; 4]));
    let test = grey(2, 2, vec![2.0; 4]).with(PICTURE, Layer::value(vec![1.0; 4]));
    let seen = |test: &Layers, reference: &Layers, layer: &str| compare(test, reference, layer, None).map(|errors| [errors.flip, errors.hdr_flip]).unwrap();
    assert_eq!(seen(&test, &reference, "irradiance"), [Some(0.0); 2]);
    let brighter = test.clone().with(PICTURE, Layer::value(vec![2.0; 4]));
    assert!(seen(&brighter, &reference, "irradiance").iter().all(|flip| flip.unwrap() > 0.1));
    assert_eq!(seen(&brighter, &reference, "irradiance"), seen(&brighter, &reference, PICTURE));
    // Irradiance is no picture, and nobody says that a nameless layer is one.
    assert_eq!(seen(&grey(2, 2, vec![2.0; 4]), &grey(2, 2, vec![1.0; 4]), "irradiance"), [None; 2]);
    let nameless = Layers { is_nameless: true, ..Layers::new(2, 2).with(PICTURE, Layer::value(vec![1.0; 4])) };
    assert_eq!(seen(&test, &nameless, "irradiance"), [None; 2]);
    assert_eq!(seen(&nameless, &reference, PICTURE), [None; 2]);
}

#[test]
fn json_has_the_names_and_no_nan() {
    let one = grey(33, 1, vec![1.0; 33]);
    let json = serde_json::to_value(compare(&one, &one, "irradiance", None).unwrap()).unwrap();
    for metric in Errors::METRICS {
        assert!(json.get(metric).is_some(), "{metric}");
    }
    assert_eq!(json["block_p99"], serde_json::Value::Null);
    assert_eq!(json["schema"], 1);
    assert_eq!(json["intervals"]["block_p99"], serde_json::Value::Null);
    assert_eq!(json["intervals"]["rmse_over_mean"], serde_json::json!({ "low": 0.0, "high": 0.0, "noise_floor": null, "below_noise": false }));
}

/// A grey picture whose error is made of splotches, with a reference that has white noise of a known variance.
struct Made {
    /// Side [pixels].
    side: u32,
    /// The radius of a splotch [pixels]; 0 is white noise.
    radius: f64,
    /// Of the error.
    deviation: f64,
    bias: f64,
    /// Of the reference's noise.
    noise: f64,
}

impl Made {
    /// Both pictures, another pair for each seed.
    fn draw(&self, seed: u64) -> [Layers; 2] {
        let mut stream = resampling::Stream(seed << 32);
        let count = (self.side * self.side) as usize;
        let errors = self.splotches(&mut stream);
        let test = errors.iter().map(|error| (1.0 + self.bias + self.deviation * error) as f32).collect();
        let truth = (0..count).map(|_| (1.0 + self.noise * stream.normal()) as f32).collect();
        let reference = grey(self.side, self.side, truth).with("depth", Layer::value(vec![1.0; count]));
        [grey(self.side, self.side, test), reference.with(VARIANCE, Layer::value(vec![self.noise.powi(2) as f32; count]))]
    }

    /// White noise smoothed by a Gaussian, of variance 1.
    fn splotches(&self, stream: &mut resampling::Stream) -> Vec<f64> {
        let side = self.side as i64;
        let white: Vec<f64> = (0..side * side).map(|_| stream.normal()).collect();
        let reach = (3.0 * self.radius).ceil() as i64;
        let taps: Vec<f64> = (-reach..=reach).map(|x| if self.radius > 0.0 { (-(x as f64 / self.radius).powi(2) / 2.0).exp() } else { 1.0 }).collect();
        let norm = taps.iter().map(|tap| tap * tap).sum::<f64>().sqrt();
        // On a torus, so that the variance is the same everywhere.
        let smooth = |plane: &[f64], step: i64| -> Vec<f64> {
            let at = |index: i64, offset: i64| {
                let (x, y) = (index % side, index / side);
                if step == 1 { y * side + (x + offset).rem_euclid(side) } else { (y + offset).rem_euclid(side) * side + x }
            };
            let sum = |index: i64| taps.iter().zip(-reach..=reach).map(|(tap, offset)| tap / norm * plane[at(index, offset) as usize]).sum();
            (0..side * side).map(sum).collect()
        };
        smooth(&smooth(&white, 1), side)
    }

    /// What is found of so many pictures.
    fn judge(&self, pictures: u64) -> Vec<Errors> {
        let judge = |seed: u64| {
            let [test, reference] = self.draw(seed);
            compare(&test, &reference, "irradiance", None).unwrap()
        };
        (0..pictures).map(judge).collect()
    }

    /// Of the error without noise.
    fn rmse(&self) -> f64 {
        self.deviation.hypot(self.bias)
    }
}

const SPLOTCHES: Made = Made { side: 64, radius: 1.3, deviation: 0.03, bias: 0.0, noise: 0.0 };

/// The share of intervals that hold the value.
fn covered(found: &[Errors], metric: &str, truth: f64) -> f64 {
    let holds = |errors: &&Errors| errors.interval(metric).is_some_and(|interval| interval.low <= truth && truth <= interval.high);
    found.iter().filter(holds).count() as f64 / found.len() as f64
}

#[test]
fn intervals_hold_the_truth_nineteen_times_of_twenty() {
    let splotches = SPLOTCHES;
    let noisy = Made { noise: 0.05, ..SPLOTCHES };
    let biased = Made { radius: 0.0, bias: 0.01, noise: 0.1, ..SPLOTCHES };
    let alone = Made { deviation: 0.0, bias: -0.02, noise: 0.05, radius: 0.0, ..SPLOTCHES };
    let mut missed = Vec::new();
    for made in [splotches, noisy, biased, alone] {
        let found = made.judge(160);
        for (metric, truth) in [("rmse_over_mean", made.rmse()), ("bias_over_mean", made.bias)] {
            let share = covered(&found, metric, truth);
            if !(0.9..=0.99).contains(&share) {
                missed.push(format!("radius {}, noise {}: {metric} in {share}", made.radius, made.noise));
            }
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}

/// Quantiles of blocks and the mean of squares have no simple truth: it is that of far more pictures.
#[test]
fn intervals_hold_the_mean_of_many_pictures() {
    let made = Made { bias: 0.01, ..SPLOTCHES };
    let found = made.judge(300);
    for metric in ["rms_of_relative", "relmse", "block_p50", "block_p99"] {
        let mean = found.iter().map(|errors| errors.metric(metric).flatten().unwrap()).sum::<f64>() / found.len() as f64;
        let share = covered(&found, metric, mean);
        // Ten blocks are above the 99th percentile: too few to do better.
        let least = if metric == "block_p99" { 0.86 } else { 0.89 };
        assert!((least..=0.99).contains(&share), "{metric} {share}");
    }
}

#[test]
fn what_noise_hides_is_told_as_hidden_and_nothing_else_is() {
    // A picture without error, and one whose error stands out; the reference's noise is the same.
    let [none, some] = [0.0, 0.05].map(|bias| Made { radius: 0.0, deviation: 0.0, bias, noise: 0.05, ..SPLOTCHES }.judge(200));
    for metric in ["rmse_over_mean", "bias_over_mean", "rms_of_relative", "relmse", "block_p50", "block_p99", "largest"] {
        let hidden = |found: &[Errors]| found.iter().filter(|errors| errors.interval(metric).unwrap().below_noise).count();
        let (of_none, of_some) = (hidden(&none), hidden(&some));
        assert!(of_none >= 180 && (of_some == 0 || metric == "largest"), "{metric}: {of_none} of nothing, {of_some} of something");
        assert!(none.iter().all(|errors| errors.interval(metric).unwrap().most() > 0.0), "{metric} is told as 0");
    }
    // What a picture without error has of them is what is told as their floor.
    for metric in ["rms_of_relative", "relmse", "block_p50", "block_p99"] {
        let mean = |value: &dyn Fn(&Errors) -> f64| none.iter().map(value).sum::<f64>() / none.len() as f64;
        let (floor, found) = (mean(&|errors| errors.interval(metric).unwrap().noise_floor.unwrap()), mean(&|errors| errors.metric(metric).flatten().unwrap()));
        assert!((floor / found - 1.0).abs() < 0.05, "{metric} {floor} {found}");
    }
}

#[test]
fn pairs_differ_where_their_errors_do() {
    // Both have the same splotches; one of them is worse by a twentieth, or not at all.
    let significant = |factor: f64, metric: &str| {
        let is_found = |seed: u64| {
            let [first, reference] = Made { noise: 0.05, ..SPLOTCHES }.draw(2 * seed);
            let [other, _] = SPLOTCHES.draw(2 * seed + 1);
            let plane = |layers: &Layers| layers.layers["irradiance"].channels[VALUE].clone();
            let planes = [plane(&first), plane(&other)];
            let second = planes[0].iter().zip(&planes[1]).map(|(a, b)| {
                let (a, b) = (f64::from(*a) - 1.0, f64::from(*b) - 1.0);
                (1.0 + factor * if factor == 1.0 { b } else { a }) as f32
            });
            let second = grey(64, 64, second.collect());
            let found = [&first, &second].map(|test| compare(test, &reference, "irradiance", None).unwrap());
            let difference = ErrorDifference::of(&found[0], &found[1], metric, 1).unwrap();
            assert!(difference.interval[0] <= difference.difference && difference.difference <= difference.interval[1]);
            difference.significant
        };
        (0..200u64).filter(|seed| is_found(*seed)).count()
    };
    for metric in ["rmse_over_mean", "relmse"] {
        assert!(significant(1.0, metric) <= 24, "{metric}: {} alarms of 200", significant(1.0, metric));
        assert!(significant(1.1, metric) >= 195, "{metric}: {} of 200 found", significant(1.1, metric));
    }
}

#[test]
fn draws_are_the_same_each_time_and_need_pixels() {
    let [test, reference] = Made { noise: 0.05, ..SPLOTCHES }.draw(3);
    let found = || compare(&test, &reference, "irradiance", None).unwrap();
    assert_eq!(found(), found());
    assert_eq!(found().draws("rmse_over_mean").len(), RESAMPLES);
    let few = compare(&grey(2, 2, vec![1.5; 4]), &grey(2, 2, vec![1.0; 4]), "irradiance", None).unwrap();
    assert_eq!((few.interval("rmse_over_mean"), few.draws("rmse_over_mean")), (None, Vec::new()));
    assert_eq!(ErrorDifference::of(&few, &few, "rmse_over_mean", 1), None);
}

proptest! {
    #[test]
    fn equal_pictures_have_no_error_and_scale_does_not_matter(values in prop::collection::vec(0.01f32..10.0, 64), other in prop::collection::vec(0.01f32..10.0, 64), power in -20i32..20) {
        let reference = grey(8, 8, values.clone());
        let same = compare(&reference, &reference, "irradiance", None).unwrap();
        for metric in Errors::METRICS {
            prop_assert_eq!(same.metric(metric), Some(if NEEDS_MORE.contains(&metric) { None } else { Some(0.0) }));
        }
        // A power of two scales floats exactly.
        let scaled = |values: &[f32]| grey(8, 8, values.iter().map(|value| value * 2f32.powi(power)).collect());
        let plain = compare(&grey(8, 8, other.clone()), &reference, "irradiance", None).unwrap();
        let large = compare(&scaled(&other), &scaled(&values), "irradiance", None).unwrap();
        for metric in Errors::METRICS {
            let [a, b] = [&plain, &large].map(|errors| errors.metric(metric).flatten().unwrap_or(0.0));
            prop_assert!((a - b).abs() <= 1e-5 * a.abs().max(1e-3), "{metric}: {a} {b}");
        }
    }

    #[test]
    fn a_single_plane_and_three_equal_ones_are_the_same(values in prop::collection::vec(0.01f32..10.0, 16)) {
        let colours: Vec<f32> = values.iter().flat_map(|&value| [value; 3]).collect();
        let rgb = Layers::new(4, 4).with("irradiance", Layer::interleaved(&["R", "G", "B"], &colours, 3));
        let errors = compare(&rgb, &grey(4, 4, values.clone()), "irradiance", None).unwrap();
        prop_assert!(errors.rmse_over_mean < 1e-6);
        prop_assert_eq!(&rgb.layers["irradiance"].channels["R"], &grey(4, 4, values).layers["irradiance"].channels[VALUE]);
    }
}
