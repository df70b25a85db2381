//! How far a picture is from the truth, and how certain that is: each metric has one meaning, the same in every table and file of the project.

mod definition;
mod found;
mod interval;
mod map;
mod origin;
mod over_frames;
mod parts;
mod resampling;
mod samples;
mod seen;
#[cfg(test)]
mod tests;
mod told;

pub use definition::Definition;
pub use interval::{ErrorDifference, Interval, Resampled};
pub use map::{ErrorMap, error_map};
pub use origin::{SCENE_CHECKSUM, other_view};
pub use resampling::RESAMPLES;
pub use seen::{fair_exposure, hdr_flips};
pub use told::Told;

use super::layers::{Layers, PictureError};
pub(super) use found::Block;
use found::{Found, Judged};
use miette::Diagnostic;
use parts::Parts;
use samples::{Samples, mean};
use seen::flips;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use thiserror::Error;

/// The layer of a reference that holds the variance of its `irradiance`.
pub const VARIANCE: &str = "variance";
/// Blocks along the longer side of the image.
const BLOCKS: u32 = 32;

/// What a comparison found. Keys in JSON are the fields' names; a metric that cannot be measured is null.
///
/// x is the tested luminance, r the reference's, over the reference's pixels that hit a surface; "mean" is the mean of r over them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Version of this record: 1.
    pub schema: u32,
    /// The tested layer.
    pub layer: String,
    /// Compared pixels.
    pub pixels: usize,
    /// Every how many pixels of the tested picture one is compared, in both directions.
    pub stride: u32,
    /// In how many windows of 64×64 pixels pixels are compared; null where that is everywhere.
    #[serde(default)]
    pub windows: Option<usize>,
    /// Mean of r, in the layer's unit.
    pub reference_mean: f64,
    /// sqrt(mean variance of r) / mean: the reference's own noise, null if its variance is not known.
    pub reference_noise_over_mean: Option<f64>,
    /// sqrt(max(0, mean((x − r)²) − mean variance of r)) / mean.
    pub rmse_over_mean: f64,
    /// (mean of x − mean) / mean, signed.
    pub bias_over_mean: f64,
    /// sqrt(mean(((x − r)/r)²)) over the pixels with r > 2 % of the mean.
    pub rms_of_relative: Option<f64>,
    /// Median over blocks of |mean of x − mean of r| / mean of r, as [`Errors::block_p99`].
    pub block_p50: Option<f64>,
    /// 99th percentile, interpolated linearly, of the same. Blocks are squares with 1/32 of the longer image side, rounded up to whole pixels
    /// of the reference; blocks that are cut off by the border of the picture or of a window, or not filled by surface are dropped, and so are black ones. Not noise-corrected.
    pub block_p99: Option<f64>,
    /// Of the pixels of which it can be told, the share at edges: within two pixels of where what is seen breaks off or turns. Null where the depth
    /// and normals of neither picture tell it.
    #[serde(default)]
    pub edge_share: Option<f64>,
    /// As [`Errors::rmse_over_mean`] over the pixels at edges, over the same mean. Null where `edge_share` is, or no pixel is at an edge.
    #[serde(default)]
    pub rmse_edges: Option<f64>,
    /// The same over the pixels off the edges.
    #[serde(default)]
    pub rmse_interior: Option<f64>,
    /// The same of the error between 5 and 30 pixels' wavelength, over pixels off the edges with enough of their surface around them. Null where
    /// `edge_share` is, and where not every pixel is compared.
    #[serde(default)]
    pub band_error: Option<f64>,
    /// mean((x − r)² / (r² + 0.01 · mean²)).
    pub relmse: f64,
    /// Mean ꟻLIP of the tone-mapped pictures, exposed so that the reference's mean luminance lies on middle grey: of the layer
    /// [`PICTURE`](super::layers::PICTURE), whatever layer is compared. Null where a file does not name one, or the reference does not hold every pixel;
    /// of windows, in which it does, pixels ten or more off the border count.
    pub flip: Option<f64>,
    /// Mean HDR-ꟻLIP of the same, as [`hdr_flip`](super::flip::hdr_flip) tells: what a viewer sees at whatever exposure shows it most. Null where `flip` is.
    pub hdr_flip: Option<f64>,
    /// The largest |x − r|.
    pub largest: LargestError,
    /// How certain each metric is, by its name; null where that is not known.
    #[serde(default)]
    pub intervals: BTreeMap<String, Option<Interval>>,
    /// The metrics in each draw of the picture's blocks, for comparisons with other pictures that the same reference judges.
    #[serde(skip)]
    pub resampled: Resampled,
}

/// Where x and r are farthest apart; the first such pixel in reading order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LargestError {
    /// Column in the tested picture.
    pub x: u32,
    /// Row in the tested picture, from the top.
    pub y: u32,
    /// The tested luminance there.
    pub test: f64,
    /// The reference's.
    pub reference: f64,
    /// (test − reference) / mean, signed.
    pub over_mean: f64,
}

/// A layer of a picture, by name, as [`Layers::layer`] finds it.
#[derive(Debug, Clone, Copy)]
pub struct Selected<'a> {
    pub picture: &'a Layers,
    pub layer: &'a str,
}

/// Why two pictures cannot be compared.
#[derive(Debug, Error, Diagnostic)]
pub enum MetricsError {
    #[error("the {which}: {error}")]
    #[diagnostic(forward(error))]
    Picture { which: &'static str, error: PictureError },
    #[error("a picture of {}×{} pixels cannot be compared with a reference of {}×{}", test[0], test[1], reference[0], reference[1])]
    #[diagnostic(code(measure::sizes_differ), help("a reference of every k-th pixel states k as its attribute `stride`, or is exactly k times smaller"))]
    SizesDiffer { test: [u32; 2], reference: [u32; 2] },
    #[error("the variance has {}×{} pixels, its reference {}×{}", variance[0], variance[1], reference[0], reference[1])]
    #[diagnostic(code(measure::variance_size))]
    VarianceSize { variance: [u32; 2], reference: [u32; 2] },
    #[error("the picture has `bounces` {test}, the reference {reference}")]
    #[diagnostic(
        code(measure::bounces_differ),
        help("compute a reference of the same bounces: hemisplat reference --bounces {test}; or count what is left out as error: --bounces {reference}")
    )]
    BouncesDiffer { test: String, reference: String },
    #[error("the two pictures have no window in common")]
    #[diagnostic(code(measure::no_common_window), help("trace both with the same --size and --windows"))]
    NoCommonWindow,
    #[error("the reference sees no surface")]
    #[diagnostic(code(measure::no_surface))]
    NoSurface,
    #[error("the reference's surfaces are black: no error relative to their mean can be told")]
    #[diagnostic(code(measure::black_reference))]
    Black,
}

impl MetricsError {
    /// Whether all that is wrong is that there is no light to tell errors by.
    pub fn is_dark(&self) -> bool {
        matches!(self, Self::NoSurface | Self::Black)
    }
}

/// Compares one layer of `test` with the same layer of `reference`.
///
/// `variance` holds, for each pixel of the reference, the variance of its mean, in its layer `variance` or in its only layer; not given, it is the
/// layer `NAME_luminance_variance` of the reference itself for the layer NAME, or else its layer `NAME_variance`, which for `irradiance` is called
/// `variance`; without any nothing is taken off for the reference's noise. Where some surfaces are glossy, irradiance and what lobes reflect count on the surfaces that have
/// them, by their variance. The reference may hold every k-th pixel of each row and column, from pixel k/2 on: its attribute `stride` says k, or its size does. Or it holds windows, as its attribute `windows` tells: then only their pixels are compared. Which pixels see a surface is decided by the reference: its `depth` is positive,
/// else its `normal` is not zero, else its luminance is not. Attributes `bounces` that both have and that differ are an error.
pub fn compare(test: &Layers, reference: &Layers, layer: &str, variance: Option<&Layers>) -> Result<Errors, MetricsError> {
    compare_layers(Selected { picture: test, layer }, Selected { picture: reference, layer }, variance)
}

/// The blocks of the tested picture that are filled by surface, as [`Errors::block_p99`] has them, black ones too; none where the reference sees no surface.
pub(super) fn blocks(test: Selected, reference: Selected) -> Result<Vec<Block>, MetricsError> {
    Ok(found::blocks(&Samples::of_any(test, reference, None)?))
}

/// The same for layers of different names.
pub fn compare_layers(test: Selected, reference: Selected, variance: Option<&Layers>) -> Result<Errors, MetricsError> {
    same_bounces(test.picture, reference.picture)?;
    let samples = Samples::of(test, reference, variance)?;
    let judged = Judged::new(&samples);
    let parts = Parts::of(test.picture, reference.picture, &samples);
    let [edges, interior] = [true, false].map(|is_edge| judged.root_mean(|s| parts.square(s, is_edge)));
    let band = judged.root_mean(|s| parts.square_in_band(s));
    let (largest, of_largest) = judged.largest().ok_or(MetricsError::NoSurface)?;
    let (rmse, bias, [block_p50, block_p99], relmse) = (judged.rmse(), judged.bias(), judged.blocks(), judged.relmse());
    let rms_of_relative = judged.rms_of_relative();
    let [flip, hdr_flip] = flips(test.picture, reference.picture, samples.windows.as_ref())?;
    let mut errors = Errors {
        schema: 1,
        layer: test.layer.to_owned(),
        pixels: samples.all.len(),
        stride: samples.stride,
        windows: samples.windows.as_ref().map(|windows| windows.corners().len()),
        reference_mean: samples.mean,
        reference_noise_over_mean: samples.variance.map(|variance| variance.sqrt() / samples.mean),
        rmse_over_mean: rmse.value.unwrap_or(0.0),
        bias_over_mean: bias.value.unwrap_or(0.0),
        rms_of_relative: rms_of_relative.value,
        block_p50: block_p50.value,
        block_p99: block_p99.value,
        edge_share: parts.edge_share(),
        rmse_edges: edges.value,
        rmse_interior: interior.value,
        band_error: band.value,
        relmse: relmse.value.unwrap_or(0.0),
        flip: flip.value,
        hdr_flip: hdr_flip.value,
        largest,
        intervals: BTreeMap::new(),
        resampled: Resampled::default(),
    };
    let found = [rmse, bias, rms_of_relative, block_p50, block_p99, band, edges, interior, relmse, flip, hdr_flip, of_largest];
    Errors::METRICS.into_iter().zip(found).for_each(|(metric, found)| errors.note(metric, found));
    Ok(errors)
}

/// The value of a metric by its name in JSON, for thresholds; a signed one by its size.
impl Errors {
    /// The metrics that have a threshold, in the order of tables.
    pub const METRICS: [&str; 12] = [
        "rmse_over_mean",
        "bias_over_mean",
        "rms_of_relative",
        "block_p50",
        "block_p99",
        "band_error",
        "rmse_edges",
        "rmse_interior",
        "relmse",
        "flip",
        "hdr_flip",
        "largest",
    ];

    /// Whether a metric is a share, told in percent.
    pub fn is_share(metric: &str) -> bool {
        !matches!(metric, "relmse" | "flip" | "hdr_flip")
    }

    /// Whether a metric has a sign.
    pub fn is_signed(metric: &str) -> bool {
        matches!(metric, "bias_over_mean" | "largest")
    }

    /// The metric of that name, `largest` as a share of the mean. `None` for other names, `Some(None)` where it could not be measured.
    pub fn metric(&self, name: &str) -> Option<Option<f64>> {
        Some(match name {
            "rmse_over_mean" => Some(self.rmse_over_mean),
            "bias_over_mean" => Some(self.bias_over_mean),
            "rms_of_relative" => self.rms_of_relative,
            "block_p50" => self.block_p50,
            "block_p99" => self.block_p99,
            "band_error" => self.band_error,
            "rmse_edges" => self.rmse_edges,
            "rmse_interior" => self.rmse_interior,
            "relmse" => Some(self.relmse),
            "flip" => self.flip,
            "hdr_flip" => self.hdr_flip,
            "largest" => Some(self.largest.over_mean),
            _ => return None,
        })
    }

    /// How certain that metric is; None where that is not known.
    pub fn interval(&self, name: &str) -> Option<Interval> {
        self.intervals.get(name).copied().flatten()
    }

    /// The size of that metric in each draw of the picture's blocks; empty where it was not resampled.
    pub fn draws(&self, name: &str) -> Vec<f64> {
        let size = |draw: &f32| if Self::is_signed(name) { f64::from(draw.abs()) } else { f64::from(*draw) };
        self.resampled.metrics.get(name).map_or(Vec::new(), |draws| draws.iter().map(size).collect())
    }

    fn note(&mut self, metric: &str, found: Found) {
        self.intervals.insert(metric.to_owned(), found.interval);
        self.resampled.add(metric, &found.draws);
    }
}

fn same_bounces(test: &Layers, reference: &Layers) -> Result<(), MetricsError> {
    match (test.attributes.get("bounces"), reference.attributes.get("bounces")) {
        (Some(a), Some(b)) if a != b => Err(MetricsError::BouncesDiffer { test: a.clone(), reference: b.clone() }),
        _ => Ok(()),
    }
}

/// Side of a block in a reference of this size [pixels].
pub fn block_side(size: [u32; 2]) -> u32 {
    size[0].max(size[1]).div_ceil(BLOCKS).max(1)
}
