//! Maps of errors.

use super::samples::Samples;
use super::{MetricsError, Selected};
use crate::measure::layers::Layers;

/// Where a layer is too bright and where too dark.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorMap {
    /// Columns and rows of the reference [pixels].
    pub size: [u32; 2],
    /// (x − r) / mean of each pixel of the reference, signed, rows from the top; None where it sees no surface.
    pub over_mean: Vec<Option<f32>>,
}

/// The error of each pixel that [`compare`](super::compare) judges, by the same rules.
pub fn error_map(test: &Layers, reference: &Layers, layer: &str) -> Result<ErrorMap, MetricsError> {
    let samples = Samples::of(Selected { picture: test, layer }, Selected { picture: reference, layer }, None)?;
    let mut over_mean = vec![None; reference.width as usize * reference.height as usize];
    samples.all.iter().for_each(|sample| over_mean[sample.at] = Some((sample.difference() / samples.mean) as f32));
    Ok(ErrorMap { size: samples.size, over_mean })
}
