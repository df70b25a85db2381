//! Maps of errors.

use super::samples::Samples;
use super::{MetricsError, Selected};
use crate::measure::layers::Layers;

/// The errors of a layer by their places.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorMap {
    /// Columns and rows of the reference [pixels].
    pub size: [u32; 2],
    /// The error of each pixel of the reference, rows from the top; None where it is not judged, as where it sees no surface.
    pub errors: Vec<Option<f32>>,
}

/// (x − r) / mean of each pixel that [`compare`](super::compare) judges, signed, by the same rules.
pub fn error_map(test: &Layers, reference: &Layers, layer: &str) -> Result<ErrorMap, MetricsError> {
    let samples = Samples::of(Selected { picture: test, layer }, Selected { picture: reference, layer }, None)?;
    let mut errors = vec![None; reference.width as usize * reference.height as usize];
    samples.all.iter().for_each(|sample| errors[sample.at] = Some((sample.difference() / samples.mean) as f32));
    Ok(ErrorMap { size: samples.size, errors })
}
