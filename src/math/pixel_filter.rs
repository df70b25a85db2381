//! Where the samples of a pixel lie, so that their plain mean is filtered.

use glam::DVec2;
use std::f64::consts::TAU;

/// How much a place counts for a pixel, by its distance from the centre along each axis. All hold as much light as there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelFilter {
    /// The pixel's own area, all alike: a square one pixel wide.
    Box,
    /// Less from the centre outward, to 0 at the neighbours' centres: two pixels wide.
    Tent,
    /// The window of Blackman and Harris, of four terms (Harris 1978), three pixels wide: hardly any jags, a little softer.
    BlackmanHarris,
}

/// The four terms of the window.
const WINDOW: [f64; 4] = [0.35875, 0.48829, 0.14128, 0.01168];

impl PixelFilter {
    /// Where so many samples lie from the centre of their pixel, to the right and down [pixels]; the one that is nearest to the centre comes first. Each stands
    /// for as much of the filter. Their mean is 0, so that the picture does not move.
    pub fn offsets(self, samples: u32) -> Vec<DVec2> {
        let count = f64::from(samples);
        let point = |number: u32| DVec2::new((f64::from(number) + 0.5) / count, mirrored(number) + 0.5 / count);
        let mut offsets: Vec<DVec2> = (0..samples).map(|number| point(number).to_array().map(|share| self.quantile(share.min(1.0))).into()).collect();
        let mean = offsets.iter().sum::<DVec2>() / count;
        offsets.iter_mut().for_each(|offset| *offset -= mean);
        offsets.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        offsets
    }

    /// The distance from the centre that has so much of the filter before it, 0 to 1.
    fn quantile(self, share: f64) -> f64 {
        match self {
            Self::Box => share - 0.5,
            Self::Tent if share < 0.5 => (2.0 * share).sqrt() - 1.0,
            Self::Tent => 1.0 - (2.0 - 2.0 * share).sqrt(),
            Self::BlackmanHarris => 3.0 * (inverse(before, share) - 0.5),
        }
    }
}

/// The number's bits behind the point, the last one first: 0 to 1.
fn mirrored(number: u32) -> f64 {
    f64::from(number.reverse_bits()) / 4_294_967_296.0
}

/// The share of the window of Blackman and Harris that is before x, 0 to 1.
fn before(x: f64) -> f64 {
    let [a, b, c, d] = WINDOW;
    x - ((TAU * x).sin() * b - (2.0 * TAU * x).sin() * c / 2.0 + (3.0 * TAU * x).sin() * d / 3.0) / (TAU * a)
}

/// Where an increasing function of 0 to 1 has this value, by halves.
fn inverse(function: impl Fn(f64) -> f64, value: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if function(middle) < value { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use PixelFilter::*;

    /// Variance along an axis, of closed forms.
    fn spread(filter: PixelFilter) -> f64 {
        match filter {
            Box => 1.0 / 12.0,
            Tent => 1.0 / 6.0,
            // 9 ∫ (x − ½)² w(x) / a₀ dx, term by term.
            BlackmanHarris => {
                let [a, b, c, d] = WINDOW;
                let term = |k: f64| 2.0 / (TAU * k).powi(2);
                9.0 * (1.0 / 12.0 - (b * term(1.0) - c * term(2.0) + d * term(3.0)) / a)
            }
        }
    }

    #[test]
    fn one_sample_is_the_centre() {
        for filter in [Box, Tent, BlackmanHarris] {
            assert!(filter.offsets(1)[0].length() < 1e-12, "{filter:?}");
        }
    }

    #[test]
    fn samples_are_spread_as_the_filter_is() {
        for (filter, widest) in [(Box, 0.5), (Tent, 1.0), (BlackmanHarris, 1.5)] {
            for samples in [2, 3, 4, 7, 16, 64] {
                let offsets = filter.offsets(samples);
                assert_eq!(offsets.len(), samples as usize);
                assert!(
                    offsets.iter().sum::<DVec2>().length() < 1e-9 && offsets.iter().all(|offset| offset.abs().max_element() <= widest),
                    "{filter:?} {samples}"
                );
                assert!(offsets.windows(2).all(|pair| pair[0].length_squared() <= pair[1].length_squared() + 1e-15));
            }
            let offsets = filter.offsets(4096);
            let variance = offsets.iter().map(|offset| *offset * *offset).sum::<DVec2>() / 4096.0;
            assert!((variance - DVec2::splat(spread(filter))).abs().max_element() < 1e-3 * spread(filter), "{filter:?}: {variance} {}", spread(filter));
        }
    }
}
