//! How far a picture is from the truth: each metric has one meaning, the same in every table and file of the project.

use super::flip::{flip, hdr_flip};
use super::layers::{GLOSSY, IRRADIANCE, Layer, Layers, PICTURE, PictureError};
use super::statistics::quantile;
use super::tone::{light_shown_as, tone_map};
use crate::math::colour::luminance;
use glam::{DVec3, Vec3};
use miette::Diagnostic;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The layer of a reference that holds the variance of its `irradiance`.
pub const VARIANCE: &str = "variance";

/// The layer of a reference that tells which pixels see a lobe.
const GLOSSY_VARIANCE: &str = "glossy_variance";
/// Pixels darker than this share of the mean are left out of `rms_of_relative`.
const DARK: f64 = 0.02;
/// Blocks along the longer side of the image.
const BLOCKS: u32 = 32;
/// What keeps `relmse` finite in the dark [share of the squared mean].
const RELMSE_FLOOR: f64 = 0.01;
/// The linear value, on the screen, of the reference's mean luminance when pictures are tone-mapped for `flip`.
const MIDDLE_GREY: f64 = 0.18;

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
    /// of the reference; blocks that are cut off by the border or not filled by surface are dropped, and so are black ones. Not noise-corrected.
    pub block_p99: Option<f64>,
    /// mean((x − r)² / (r² + 0.01 · mean²)).
    pub relmse: f64,
    /// Mean ꟻLIP of the tone-mapped pictures, exposed so that the reference's mean luminance lies on middle grey: of the layer
    /// [`PICTURE`] where both files have one beside the compared layer, else of the compared layer. Null if the reference does not hold every pixel.
    pub flip: Option<f64>,
    /// Mean HDR-ꟻLIP of the same layer, as [`hdr_flip`] tells: what a viewer sees at whatever exposure shows it most. Null where `flip` is.
    pub hdr_flip: Option<f64>,
    /// The largest |x − r|.
    pub largest: LargestError,
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
    #[diagnostic(code(measure::bounces_differ), help("compute a reference of the same bounces: hemisplat reference --bounces {test}"))]
    BouncesDiffer { test: String, reference: String },
    #[error("the reference sees no surface")]
    #[diagnostic(code(measure::no_surface))]
    NoSurface,
    #[error("the reference's surfaces are black: no error relative to their mean can be told")]
    #[diagnostic(code(measure::black_reference))]
    Black,
}

/// Compares one layer of `test` with the same layer of `reference`.
///
/// `variance` holds, for each pixel of the reference, the variance of its mean, in its layer `variance` or in its only layer; not given, it is the
/// layer `variance` of the reference itself, which belongs to the layer `irradiance`, or its layer `NAME_variance` for the layer NAME; without either
/// nothing is taken off for the reference's noise. Where some surfaces are glossy, irradiance and what lobes reflect count on the surfaces that have
/// them, by their variance. The reference may hold every k-th pixel of each row and column, from pixel k/2 on: its attribute `stride` says k, or its size does. Which pixels see a surface is decided by the reference: its `depth` is positive,
/// else its `normal` is not zero, else its luminance is not. Attributes `bounces` that both have and that differ are an error.
pub fn compare(test: &Layers, reference: &Layers, layer: &str, variance: Option<&Layers>) -> Result<Errors, MetricsError> {
    compare_layers(Selected { picture: test, layer }, Selected { picture: reference, layer }, variance)
}

/// The same for layers of different names.
pub fn compare_layers(test: Selected, reference: Selected, variance: Option<&Layers>) -> Result<Errors, MetricsError> {
    same_bounces(test.picture, reference.picture)?;
    let stride = stride(test.picture, reference.picture)?;
    let r = values(reference, "reference")?;
    let x = every(&values(test, "tested picture")?, test.picture, stride);
    let surface = judged_surface(reference, &r)?;
    let variance = match variance {
        Some(given) => Some(variances(given, VARIANCE, reference.picture)?),
        None => own_variances(reference)?,
    };
    let samples: Vec<Sample> = (0..r.len()).filter(|&at| surface[at]).map(|at| Sample { at, x: x[at], r: r[at] }).collect();
    let mean = mean(samples.iter().map(|s| s.r)).ok_or(MetricsError::NoSurface)?;
    if mean <= 0.0 {
        return Err(MetricsError::Black);
    }
    let variance = variance.map(|variance| samples.iter().map(|s| variance[s.at]).sum::<f64>() / samples.len() as f64);
    let [flip, hdr_flip] = if stride == 1 { flips(test, reference)? } else { [None; 2] };
    let blocks = block_errors(&samples, [reference.picture.width, reference.picture.height]);
    Ok(Errors {
        schema: 1,
        layer: test.layer.to_owned(),
        pixels: samples.len(),
        stride,
        reference_mean: mean,
        reference_noise_over_mean: variance.map(|variance| variance.sqrt() / mean),
        rmse_over_mean: (mean_square_error(&samples) - variance.unwrap_or(0.0)).max(0.0).sqrt() / mean,
        bias_over_mean: samples.iter().map(|s| s.x - s.r).sum::<f64>() / samples.len() as f64 / mean,
        rms_of_relative: rms_of_relative(&samples, mean),
        block_p50: quantile(&blocks, 0.5),
        block_p99: quantile(&blocks, 0.99),
        relmse: samples.iter().map(|s| s.difference().powi(2) / (s.r * s.r + RELMSE_FLOOR * mean * mean)).sum::<f64>() / samples.len() as f64,
        flip,
        hdr_flip,
        largest: largest(&samples, mean, reference.picture.width, stride).ok_or(MetricsError::NoSurface)?,
    })
}

/// The value of a metric by its name in JSON, for thresholds; a signed one by its size.
impl Errors {
    /// The metrics that have a threshold, in the order of tables.
    pub const METRICS: [&str; 9] = ["rmse_over_mean", "bias_over_mean", "rms_of_relative", "block_p50", "block_p99", "relmse", "flip", "hdr_flip", "largest"];

    /// Whether a metric is a share, told in percent.
    pub fn is_share(metric: &str) -> bool {
        !matches!(metric, "relmse" | "flip" | "hdr_flip")
    }

    /// The metric of that name, `largest` as a share of the mean. `None` for other names, `Some(None)` where it could not be measured.
    pub fn metric(&self, name: &str) -> Option<Option<f64>> {
        Some(match name {
            "rmse_over_mean" => Some(self.rmse_over_mean),
            "bias_over_mean" => Some(self.bias_over_mean),
            "rms_of_relative" => self.rms_of_relative,
            "block_p50" => self.block_p50,
            "block_p99" => self.block_p99,
            "relmse" => Some(self.relmse),
            "flip" => self.flip,
            "hdr_flip" => self.hdr_flip,
            "largest" => Some(self.largest.over_mean),
            _ => return None,
        })
    }
}

/// A compared pixel: its place in the reference, its tested and its true luminance.
#[derive(Clone, Copy)]
struct Sample {
    at: usize,
    x: f64,
    r: f64,
}

impl Sample {
    fn difference(&self) -> f64 {
        self.x - self.r
    }
}

fn same_bounces(test: &Layers, reference: &Layers) -> Result<(), MetricsError> {
    match (test.attributes.get("bounces"), reference.attributes.get("bounces")) {
        (Some(a), Some(b)) if a != b => Err(MetricsError::BouncesDiffer { test: a.clone(), reference: b.clone() }),
        _ => Ok(()),
    }
}

/// How many pixels of `test` stand for one of `reference`, in each direction.
fn stride(test: &Layers, reference: &Layers) -> Result<u32, MetricsError> {
    let [a, b] = [test, reference].map(|picture| [picture.width, picture.height]);
    let stated = reference.attributes.get("stride").and_then(|stride| stride.parse().ok());
    let stride = if a == b { 1 } else { stated.unwrap_or(a[0] / b[0].max(1)) };
    let fits = |side: usize| stride > 0 && strided(a[side], stride).count() == b[side] as usize;
    if fits(0) && fits(1) { Ok(stride) } else { Err(MetricsError::SizesDiffer { test: a, reference: b }) }
}

fn strided(length: u32, stride: u32) -> impl Iterator<Item = u32> {
    (stride / 2..length).step_by(stride as usize)
}

/// The luminance of a layer, all of it finite.
fn values(selected: Selected, which: &'static str) -> Result<Vec<f64>, MetricsError> {
    let wrap = |error| MetricsError::Picture { which, error };
    selected.picture.validate().map_err(wrap)?;
    selected.picture.luminance(selected.layer).map_err(wrap)
}

fn every(values: &[f64], picture: &Layers, stride: u32) -> Vec<f64> {
    let row = |y: u32| strided(picture.width, stride).map(move |x| values[(y * picture.width + x) as usize]);
    strided(picture.height, stride).flat_map(row).collect()
}

fn surface(reference: &Layers, luminance: &[f64]) -> Vec<bool> {
    let plane = |layer: &Layer| layer.channels.values().next().cloned();
    if let Some(depth) = reference.layers.get("depth").and_then(plane) {
        return depth.iter().map(|&depth| depth > 0.0).collect();
    }
    match reference.layers.get("normal") {
        Some(normal) => (0..luminance.len()).map(|at| normal.channels.values().any(|axis| axis[at] != 0.0)).collect(),
        None => luminance.iter().map(|&value| value != 0.0).collect(),
    }
}

/// Where a layer is judged. In a scene with lobes, irradiance and what lobes reflect are on the surfaces that have them, by their own variance.
fn judged_surface(reference: Selected, luminance: &[f64]) -> Result<Vec<bool>, MetricsError> {
    let mut surface = surface(reference.picture, luminance);
    let by_kind = reference.picture.layers.contains_key(GLOSSY_VARIANCE) && [IRRADIANCE, GLOSSY].contains(&reference.layer);
    if let Some(variance) = if by_kind { own_variances(reference)? } else { None } {
        surface.iter_mut().zip(variance).for_each(|(surface, variance)| *surface &= variance > 0.0);
    }
    Ok(surface)
}

/// Those that the reference itself holds of a layer.
fn own_variances(reference: Selected) -> Result<Option<Vec<f64>>, MetricsError> {
    let layer = if reference.layer == IRRADIANCE { VARIANCE.to_owned() } else { format!("{}_{VARIANCE}", reference.layer) };
    let holds = reference.picture.layers.contains_key(&layer);
    holds.then(|| variances(reference.picture, &layer, reference.picture)).transpose()
}

/// Variance of each pixel's luminance. The channels of a light path rise and fall together, so their deviations add up: exact for grey,
/// and never too small.
fn variances(variance: &Layers, layer: &str, reference: &Layers) -> Result<Vec<f64>, MetricsError> {
    let size = |picture: &Layers| [picture.width, picture.height];
    if size(variance) != size(reference) {
        return Err(MetricsError::VarianceSize { variance: size(variance), reference: size(reference) });
    }
    let wrap = |error| MetricsError::Picture { which: "reference's variance", error };
    variance.validate().map_err(wrap)?;
    let mut deviations = Layers::new(variance.width, variance.height).with(VARIANCE, variance.layer(layer).map_err(wrap)?.clone());
    deviations.layers.values_mut().flat_map(|layer| layer.channels.values_mut()).flatten().for_each(|value| *value = value.max(0.0).sqrt());
    Ok(deviations.luminance(VARIANCE).map_err(wrap)?.iter().map(|deviation| deviation * deviation).collect())
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let count = values.len();
    (count > 0).then(|| values.sum::<f64>() / count as f64)
}

fn mean_square_error(samples: &[Sample]) -> f64 {
    samples.iter().map(|s| s.difference().powi(2)).sum::<f64>() / samples.len() as f64
}

fn rms_of_relative(samples: &[Sample], mean_of_reference: f64) -> Option<f64> {
    let squares: Vec<f64> = samples.iter().filter(|s| s.r > DARK * mean_of_reference).map(|s| (s.difference() / s.r).powi(2)).collect();
    mean(squares.into_iter()).map(f64::sqrt)
}

/// Side of a block in a reference of this size [pixels].
pub fn block_side(size: [u32; 2]) -> u32 {
    size[0].max(size[1]).div_ceil(BLOCKS).max(1)
}

/// The relative errors of the block means, from the smallest.
fn block_errors(samples: &[Sample], size: [u32; 2]) -> Vec<f64> {
    let side = block_side(size);
    let across = size[0].div_ceil(side) as usize;
    let mut blocks = vec![(0u32, 0.0, 0.0); across * size[1].div_ceil(side) as usize];
    for sample in samples {
        let (x, y) = (sample.at as u32 % size[0], sample.at as u32 / size[0]);
        let block = &mut blocks[(y / side) as usize * across + (x / side) as usize];
        *block = (block.0 + 1, block.1 + sample.x, block.2 + sample.r);
    }
    let whole = blocks.into_iter().filter(|&(count, _, r)| count == side * side && r > 0.0);
    let mut errors: Vec<f64> = whole.map(|(_, x, r)| ((x - r) / r).abs()).collect();
    errors.sort_by(f64::total_cmp);
    errors
}

fn largest(samples: &[Sample], mean: f64, width: u32, stride: u32) -> Option<LargestError> {
    let worst = samples.iter().reduce(|worst, next| if next.difference().abs() > worst.difference().abs() { next } else { worst })?;
    let place = |index: u32| index * stride + stride / 2;
    let (x, y) = (place(worst.at as u32 % width), place(worst.at as u32 / width));
    Some(LargestError { x, y, test: worst.x, reference: worst.r, over_mean: worst.difference() / mean })
}

/// ꟻLIP and HDR-ꟻLIP.
fn flips(test: Selected, reference: Selected) -> Result<[Option<f64>; 2], MetricsError> {
    // A strided reference of a strided picture has no neighbours to look at.
    if reference.picture.attributes.get("stride").is_some_and(|stride| stride != "1") {
        return Ok([None; 2]);
    }
    let pictures = [test, reference].map(|selected| selected.picture);
    // A file of one layer without a name holds what it is compared with, and no picture beside it.
    let holds_both = |picture: &&Layers| [PICTURE, test.layer].iter().all(|layer| picture.layers.contains_key(*layer));
    let whole = test.layer == reference.layer && pictures.iter().all(holds_both);
    let layer = |selected: &Selected| if whole { PICTURE.to_owned() } else { selected.layer.to_owned() };
    let colours = |selected: Selected, which| -> Result<Vec<[f32; 3]>, MetricsError> {
        let [r, g, b] = selected.picture.rgb(&layer(&selected)).map_err(|error| MetricsError::Picture { which, error })?;
        Ok((0..r.len()).map(|i| [r[i], g[i], b[i]]).collect())
    };
    let (test, truth) = (colours(test, "tested picture")?, colours(reference, "reference")?);
    let Some(mean) = mean(truth.iter().map(|colour| luminance(Vec3::from(*colour).as_dvec3()))).filter(|&mean| mean > 0.0) else {
        return Ok([None; 2]);
    };
    let exposure = exposure_of(mean);
    let linear = |colour: [f32; 3]| DVec3::from_array(colour.map(f64::from));
    let shown = |colours: &[[f32; 3]]| -> Vec<DVec3> { colours.iter().map(|&colour| linear(tone_map(colour, exposure))).collect() };
    let light = |colours: &[[f32; 3]]| -> Vec<DVec3> { colours.iter().copied().map(linear).collect() };
    let width = reference.picture.width as usize;
    Ok([Some(flip(&shown(&test), &shown(&truth), width)), hdr_flip(&light(&test), &light(&truth), width)])
}

/// The exposure that brings a mean luminance to middle grey [stops].
fn exposure_of(mean: f64) -> f32 {
    (light_shown_as(MIDDLE_GREY) / mean).log2() as f32
}

/// The exposure that shows a layer well [stops]: its mean luminance on middle grey, as for `flip`; 0 for a black one.
pub fn fair_exposure(picture: &Layers, layer: &str) -> Result<f32, PictureError> {
    picture.validate()?;
    let mean = mean(picture.luminance(layer)?.into_iter()).filter(|&mean| mean > 0.0);
    Ok(mean.map_or(0.0, exposure_of))
}

/// Where a layer is too bright and where too dark.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorMap {
    /// Columns and rows of the reference [pixels].
    pub size: [u32; 2],
    /// (x − r) / mean of each pixel of the reference, signed, rows from the top; None where it sees no surface.
    pub over_mean: Vec<Option<f32>>,
}

/// The error of each pixel that [`compare`] judges, by the same rules.
pub fn error_map(test: &Layers, reference: &Layers, layer: &str) -> Result<ErrorMap, MetricsError> {
    let stride = stride(test, reference)?;
    let selected = Selected { picture: reference, layer };
    let r = values(selected, "reference")?;
    let x = every(&values(Selected { picture: test, layer }, "tested picture")?, test, stride);
    let surface = judged_surface(selected, &r)?;
    let seen: Vec<f64> = (0..r.len()).filter(|&at| surface[at]).map(|at| r[at]).collect();
    let mean = mean(seen.into_iter()).ok_or(MetricsError::NoSurface)?;
    if mean <= 0.0 {
        return Err(MetricsError::Black);
    }
    let over_mean = (0..r.len()).map(|at| surface[at].then(|| ((x[at] - r[at]) / mean) as f32)).collect();
    Ok(ErrorMap { size: [reference.width, reference.height], over_mean })
}

#[cfg(test)]
mod tests {
    use super::super::layers::VALUE;
    use super::*;
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
        let of_another_layer = own.clone().with("indirect", Layer::value(vec![2.0; 2]));
        assert_eq!(compare(&test, &of_another_layer, "indirect", None).unwrap().reference_noise_over_mean, None);
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
        assert_eq!(compare(&test, &reference, "irradiance", None).unwrap().flip, Some(0.0));
        assert!(compare(&grey(2, 2, vec![2.0; 4]), &grey(2, 2, vec![1.0; 4]), "irradiance", None).unwrap().flip.unwrap() > 0.1);
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
    }

    proptest! {
        #[test]
        fn equal_pictures_have_no_error_and_scale_does_not_matter(values in prop::collection::vec(0.01f32..10.0, 64), other in prop::collection::vec(0.01f32..10.0, 64), power in -20i32..20) {
            let reference = grey(8, 8, values.clone());
            let same = compare(&reference, &reference, "irradiance", None).unwrap();
            for metric in Errors::METRICS {
                prop_assert_eq!(same.metric(metric), Some(Some(0.0)));
            }
            // A power of two scales floats exactly.
            let scaled = |values: &[f32]| grey(8, 8, values.iter().map(|value| value * 2f32.powi(power)).collect());
            let plain = compare(&grey(8, 8, other.clone()), &reference, "irradiance", None).unwrap();
            let large = compare(&scaled(&other), &scaled(&values), "irradiance", None).unwrap();
            for metric in Errors::METRICS {
                let [a, b] = [&plain, &large].map(|errors| errors.metric(metric).flatten().unwrap());
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
}
