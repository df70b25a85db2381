//! Errors of a sequence: the means over its frames.

use super::{Errors, Interval, Resampled, mean};
use std::collections::BTreeMap;

impl Errors {
    /// The mean of each metric over frames, as far as they have it; `largest` is the largest of all. Errors of frames that follow each other are alike: the ends of an
    /// interval are the means of its ends, and draws, which are the same for all pictures of a frame, are averaged one by one. None of no frame.
    pub fn over_frames(frames: &[&Self]) -> Option<Self> {
        let (first, others) = frames.split_first()?;
        if others.is_empty() {
            return Some((*first).clone());
        }
        let mean = |value: &dyn Fn(&Self) -> Option<f64>| mean(frames.iter().filter_map(|errors| value(errors)).collect::<Vec<_>>().into_iter());
        let all = |value: fn(&Self) -> f64| mean(&|errors| Some(value(errors))).unwrap_or(0.0);
        let worst = frames.iter().copied().reduce(|a, b| if b.largest.over_mean.abs() > a.largest.over_mean.abs() { b } else { a })?;
        let mut intervals: BTreeMap<String, Option<Interval>> = first
            .intervals
            .keys()
            .map(|metric| (metric.clone(), interval(&frames.iter().filter_map(|errors| errors.interval(metric)).collect::<Vec<_>>())))
            .collect();
        let mut resampled = Resampled::default();
        for metric in first.resampled.metrics.keys() {
            let draws: Option<Vec<&Vec<f32>>> = frames.iter().map(|errors| errors.resampled.metrics.get(metric)).collect();
            resampled.add(metric, &draws.map_or(Vec::new(), |draws| averaged(&draws)));
        }
        const LARGEST: &str = "largest";
        intervals.insert(LARGEST.to_owned(), worst.interval(LARGEST));
        if let Some(draws) = worst.resampled.metrics.get(LARGEST) {
            resampled.metrics.insert(LARGEST.to_owned(), draws.clone());
        }
        Some(Self {
            schema: first.schema,
            layer: first.layer.clone(),
            pixels: frames.iter().map(|errors| errors.pixels).sum(),
            stride: first.stride,
            windows: first.windows,
            reference_mean: all(|errors| errors.reference_mean),
            reference_noise_over_mean: mean(&|errors| errors.reference_noise_over_mean),
            rmse_over_mean: all(|errors| errors.rmse_over_mean),
            bias_over_mean: all(|errors| errors.bias_over_mean),
            rms_of_relative: mean(&|errors| errors.rms_of_relative),
            block_p50: mean(&|errors| errors.block_p50),
            block_p99: mean(&|errors| errors.block_p99),
            edge_share: mean(&|errors| errors.edge_share),
            rmse_edges: mean(&|errors| errors.rmse_edges),
            rmse_interior: mean(&|errors| errors.rmse_interior),
            band_error: mean(&|errors| errors.band_error),
            relmse: all(|errors| errors.relmse),
            flip: mean(&|errors| errors.flip),
            hdr_flip: mean(&|errors| errors.hdr_flip),
            largest: worst.largest,
            intervals,
            resampled,
        })
    }
}

/// Hidden where it is so in every frame.
fn interval(frames: &[Interval]) -> Option<Interval> {
    let of = |value: fn(&Interval) -> f64| mean(frames.iter().map(value));
    let floors: Option<Vec<f64>> = frames.iter().map(|interval| interval.noise_floor).collect();
    Some(Interval {
        low: of(|interval| interval.low)?,
        high: of(|interval| interval.high)?,
        noise_floor: floors.and_then(|floors| mean(floors.into_iter())),
        below_noise: frames.iter().all(|interval| interval.below_noise),
    })
}

/// Draw by draw; nothing where frames have other numbers of them.
fn averaged(draws: &[&Vec<f32>]) -> Vec<f64> {
    let count = draws.first().map_or(0, |draws| draws.len());
    if draws.iter().any(|draws| draws.len() != count) {
        return Vec::new();
    }
    (0..count).map(|at| draws.iter().map(|draws| f64::from(draws[at])).sum::<f64>() / draws.len() as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::super::compare;
    use super::*;
    use crate::measure::layers::{IRRADIANCE, Layer, Layers};

    /// Of a picture that is too bright by a share, against one of 64×64 pixels of some pattern.
    fn errors(share: f32) -> Errors {
        let picture = |factor: f32| Layers::new(64, 64).with(IRRADIANCE, Layer::value((0..64 * 64).map(|at| factor * (1.0 + (at % 7) as f32)).collect()));
        compare(&picture(1.0 + share), &picture(1.0), IRRADIANCE, None).unwrap()
    }

    #[test]
    fn errors_of_frames_are_averaged() {
        let [small, large] = [errors(0.1), errors(-0.3)];
        let both = Errors::over_frames(&[&small, &large]).unwrap();
        assert!((both.bias_over_mean + 0.1).abs() < 1e-6 && (both.block_p50.unwrap() - 0.2).abs() < 1e-6, "{both:?}");
        assert_eq!((both.rmse_over_mean, both.largest), ((small.rmse_over_mean + large.rmse_over_mean) / 2.0, large.largest));
        let ends = [&small, &large, &both].map(|errors| errors.interval("block_p50").unwrap().high);
        assert!((ends[2] - (ends[0] + ends[1]) / 2.0).abs() < 1e-9);
        let draws = [&small, &large, &both].map(|errors| errors.draws("rmse_over_mean"));
        assert!(!draws[2].is_empty() && (draws[2][3] - (draws[0][3] + draws[1][3]) / 2.0).abs() < 1e-6);
        assert_eq!((Errors::over_frames(&[&small]), Errors::over_frames(&[])), (Some(small), None));
    }

    /// A frame that lacks a metric has no part in its mean.
    #[test]
    fn what_a_frame_lacks_is_left_out() {
        let (whole, lacking) = (errors(0.1), Errors { block_p50: None, ..errors(0.3) });
        assert_eq!(Errors::over_frames(&[&lacking, &whole]).unwrap().block_p50, whole.block_p50);
    }
}
