//! What each metric means, in the words of help texts, pages and the book.

/// A metric in a formula and in words.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Definition {
    pub metric: &'static str,
    /// x is the tested luminance, r the reference's, mean that of r.
    pub formula: &'static str,
    pub meaning: &'static str,
}

impl Definition {
    /// One of each of [`Errors::METRICS`](super::Errors::METRICS), in their order.
    pub const ALL: [Self; 12] = [
        Self {
            metric: "rmse_over_mean",
            formula: "sqrt(mean((x - r)^2) - mean variance of r) / mean",
            meaning: "How far a pixel is off, as a share of the mean light. The reference's noise is taken off.",
        },
        Self {
            metric: "bias_over_mean",
            formula: "(mean of x - mean) / mean",
            meaning: "Whether all of it is too bright (positive) or too dark. Noise averages out of it.",
        },
        Self {
            metric: "rms_of_relative",
            formula: "sqrt(mean(((x - r) / r)^2)) where r > 2 % of the mean",
            meaning: "How far a pixel is off as a share of its own light: dark places count as much as bright ones. The reference's noise is in it.",
        },
        Self {
            metric: "block_p50",
            formula: "median over blocks of |mean of x - mean of r| / mean of r",
            meaning: "The error of blocks of 1/32 of the longer side, in which the noise of pixels averages out: splotches and leaks. What noise remains is in it.",
        },
        Self { metric: "block_p99", formula: "99th percentile over blocks of the same", meaning: "The worst places: one block in a hundred is further off." },
        Self {
            metric: "band_error",
            formula: "rms inside surfaces of what two Gaussians leave of x - r between 5 and 30 pixels' wavelength, over the mean",
            meaning: "Splotches and streaks, as an eye sees them first. The reference's noise is taken off; measured where it holds every pixel, or windows of them.",
        },
        Self {
            metric: "rmse_edges",
            formula: "rmse_over_mean over the pixels at edges of depth or normal",
            meaning: "Jags, and light that is wrong beside edges. The reference's noise is taken off.",
        },
        Self {
            metric: "rmse_interior",
            formula: "rmse_over_mean over all other pixels",
            meaning: "Errors inside surfaces. The reference's noise is taken off.",
        },
        Self {
            metric: "relmse",
            formula: "mean((x - r)^2 / (r^2 + 0.01 mean^2))",
            meaning: "Relative square error, as papers on path tracing have it. The reference's noise is in it.",
        },
        Self {
            metric: "flip",
            formula: "mean of FLIP over all pixels of both files' layer `picture`, tone-mapped with the reference's mean at middle grey",
            meaning: "How much a viewer sees who flips between the two, 0 to 1. Measured where both files name a picture and the reference holds every pixel.",
        },
        Self {
            metric: "hdr_flip",
            formula: "mean of the largest FLIP of each pixel over all exposures of the reference",
            meaning: "The same at whatever exposure shows it most.",
        },
        Self {
            metric: "largest",
            formula: "the largest |x - r| / mean, with its sign",
            meaning: "The worst pixel. Its interval bounds the normal noise of all pixels at once.",
        },
    ];

    /// That of a metric, if there is one of this name.
    pub fn of(metric: &str) -> Option<&'static Self> {
        Self::ALL.iter().find(|definition| definition.metric == metric)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Errors;

    #[test]
    fn every_metric_is_defined() {
        assert_eq!(Definition::ALL.map(|definition| definition.metric), Errors::METRICS);
    }
}
