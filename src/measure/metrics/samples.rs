//! The pixels that are compared: where the reference sees a surface, each with its tested and its true luminance and the variance of the latter.

use super::{MetricsError, Selected, VARIANCE};
use crate::math::windows::Windows;
use crate::measure::layers::{GLOSSY, IRRADIANCE, Layer, Layers};

/// The layer of a reference that tells which pixels see a lobe.
const GLOSSY_VARIANCE: &str = "glossy_variance";

/// A compared pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Its place in the reference.
    pub at: usize,
    /// The tested luminance.
    pub x: f64,
    /// The reference's.
    pub r: f64,
    /// The variance of `r`; 0 where it is not known.
    pub variance: f64,
}

impl Sample {
    pub fn difference(&self) -> f64 {
        self.x - self.r
    }
}

/// All compared pixels of two layers.
pub(super) struct Samples {
    pub all: Vec<Sample>,
    /// Every how many pixels of the tested picture one is compared, in both directions.
    pub stride: u32,
    /// Where all of them lie; None where that is anywhere.
    pub windows: Option<Windows>,
    /// Columns and rows of the reference [pixels].
    pub size: [u32; 2],
    /// Mean of r.
    pub mean: f64,
    /// Mean variance of r; None where it is not known.
    pub variance: Option<f64>,
}

impl Samples {
    /// `variance` holds the variance of each pixel of the reference; not given, it is what the reference itself holds.
    pub fn of(test: Selected, reference: Selected, variance: Option<&Layers>) -> Result<Self, MetricsError> {
        let samples = Self::of_any(test, reference, variance)?;
        if samples.all.is_empty() {
            return Err(MetricsError::NoSurface);
        }
        if samples.mean <= 0.0 { Err(MetricsError::Black) } else { Ok(samples) }
    }

    /// The same of a reference that may be black, or see no surface.
    pub fn of_any(test: Selected, reference: Selected, variance: Option<&Layers>) -> Result<Self, MetricsError> {
        let stride = stride(test.picture, reference.picture)?;
        let windows = common_windows(test.picture, reference.picture)?;
        let r = values(reference, "reference")?;
        let x = every(&values(test, "tested picture")?, test.picture, stride);
        let surface = judged_surface(reference, &r, windows.as_ref())?;
        let variance = match variance {
            Some(given) => Some(variances(given, VARIANCE, reference.picture)?),
            None => own_variances(reference)?,
        };
        let of_pixel = |at: usize| variance.as_ref().map_or(0.0, |variance| variance[at]);
        let all: Vec<Sample> = (0..r.len()).filter(|&at| surface[at]).map(|at| Sample { at, x: x[at], r: r[at], variance: of_pixel(at) }).collect();
        let mean = mean(all.iter().map(|s| s.r)).unwrap_or(0.0);
        let variance = variance.and_then(|_| self::mean(all.iter().map(|s| s.variance)));
        Ok(Self { all, stride, windows, size: [reference.picture.width, reference.picture.height], mean, variance })
    }

    /// The column and row of a sample in the tested picture.
    pub fn place_in_test(&self, sample: &Sample) -> [u32; 2] {
        let at = sample.at as u32;
        [at % self.size[0], at / self.size[0]].map(|index| index * self.stride + self.stride / 2)
    }
}

/// None of nothing.
pub(super) fn mean(values: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let count = values.len();
    (count > 0).then(|| values.sum::<f64>() / count as f64)
}

/// How many pixels of `test` stand for one of `reference`, in each direction.
pub(super) fn stride(test: &Layers, reference: &Layers) -> Result<u32, MetricsError> {
    let [a, b] = [test, reference].map(|picture| [picture.width, picture.height]);
    let stated = reference.attributes.get("stride").and_then(|stride| stride.parse().ok());
    let stride = if a == b { 1 } else { stated.unwrap_or(a[0] / b[0].max(1)) };
    let fits = |side: usize| stride > 0 && strided(a[side], stride).count() == b[side] as usize;
    if fits(0) && fits(1) { Ok(stride) } else { Err(MetricsError::SizesDiffer { test: a, reference: b }) }
}

/// The windows that both pictures hold; None where both hold all pixels, or those of a stride.
fn common_windows(test: &Layers, reference: &Layers) -> Result<Option<Windows>, MetricsError> {
    let of = |picture: &Layers, which| picture.windows().map_err(|error| MetricsError::Picture { which, error });
    let windows = match (of(test, "tested picture")?, of(reference, "reference")?) {
        (Some(a), Some(b)) => Some(b.shared(&a).ok_or(MetricsError::NoCommonWindow)?),
        (a, b) => a.or(b),
    };
    let [a, b] = [test, reference].map(|picture| [picture.width, picture.height]);
    if windows.is_some() && a != b { Err(MetricsError::SizesDiffer { test: a, reference: b }) } else { Ok(windows) }
}

fn strided(length: u32, stride: u32) -> impl Iterator<Item = u32> {
    (stride / 2..length).step_by(stride as usize)
}

/// The luminance of a layer, all of it finite.
pub(super) fn values(selected: Selected, which: &'static str) -> Result<Vec<f64>, MetricsError> {
    let wrap = |error| MetricsError::Picture { which, error };
    selected.picture.validate().map_err(wrap)?;
    selected.picture.luminance(selected.layer).map_err(wrap)
}

/// Those of the pixels that the reference holds.
pub(super) fn every(values: &[f64], picture: &Layers, stride: u32) -> Vec<f64> {
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
fn judged_surface(reference: Selected, luminance: &[f64], windows: Option<&Windows>) -> Result<Vec<bool>, MetricsError> {
    let mut surface = surface(reference.picture, luminance);
    if let Some(windows) = windows {
        let held = windows.mask([reference.picture.width, reference.picture.height], 0);
        surface.iter_mut().zip(held).for_each(|(surface, held)| *surface &= held);
    }
    let by_kind = reference.picture.layers.contains_key(GLOSSY_VARIANCE) && [IRRADIANCE, GLOSSY].contains(&reference.layer);
    if let Some(variance) = if by_kind { own_variances(reference)? } else { None } {
        surface.iter_mut().zip(variance).for_each(|(surface, variance)| *surface &= variance > 0.0);
    }
    Ok(surface)
}

/// Those that the reference itself holds of a layer: of its luminance, or else of its channels.
pub(super) fn own_variances(reference: Selected) -> Result<Option<Vec<f64>>, MetricsError> {
    let of_channels = if reference.layer == IRRADIANCE { VARIANCE.to_owned() } else { format!("{}_{VARIANCE}", reference.layer) };
    let names = [format!("{}_luminance_{VARIANCE}", reference.layer), of_channels];
    let held = names.into_iter().find(|name| reference.picture.layers.contains_key(name));
    held.map(|name| variances(reference.picture, &name, reference.picture)).transpose()
}

/// Variance of each pixel's luminance. That of three channels is taken as if they rose and fell together, so that their deviations add up: exact
/// for grey, and never too small.
fn variances(variance: &Layers, layer: &str, reference: &Layers) -> Result<Vec<f64>, MetricsError> {
    let size = |picture: &Layers| [picture.width, picture.height];
    if size(variance) != size(reference) {
        return Err(MetricsError::VarianceSize { variance: size(variance), reference: size(reference) });
    }
    let wrap = |error| MetricsError::Picture { which: "reference's variance", error };
    variance.validate().map_err(wrap)?;
    // A file of one layer, whatever it is called, holds nothing else.
    let only = variance.layers.values().next().filter(|_| variance.layers.len() == 1);
    let plane = only.map_or_else(|| variance.layer(layer), Ok).map_err(wrap)?;
    let mut deviations = Layers::new(variance.width, variance.height).with(VARIANCE, plane.clone());
    deviations.layers.values_mut().flat_map(|layer| layer.channels.values_mut()).flatten().for_each(|value| *value = value.max(0.0).sqrt());
    Ok(deviations.luminance(VARIANCE).map_err(wrap)?.iter().map(|deviation| deviation * deviation).collect())
}
