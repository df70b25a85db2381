//! Errors told apart as an eye does: at edges, inside surfaces, and inside surfaces in the band of wavelengths that is seen as splotches.

use super::found::Square;
use super::samples::{Sample, Samples};
use crate::measure::bands::{Band, bands, noise_area};
use crate::measure::edges::{Geometry, surfaces};
use crate::measure::layers::Layers;

/// What is told of each pixel of a reference; None where it cannot be.
pub(super) struct Parts {
    /// Whether it is an edge.
    edge: Vec<Option<bool>>,
    band: Vec<Option<Band>>,
}

impl Parts {
    /// The reference's depth and normals decide what is an edge; where it has none, or not of all pixels, those of the tested picture.
    pub fn of(test: &Layers, reference: &Layers, samples: &Samples) -> Self {
        let pixels = samples.size[0] as usize * samples.size[1] as usize;
        let told = edges(test, reference, samples.stride).unwrap_or(vec![None; pixels]);
        let (mut edge, mut errors, mut variances) = (vec![None; pixels], vec![0.0; pixels], vec![0.0; pixels]);
        for sample in &samples.all {
            (edge[sample.at], errors[sample.at], variances[sample.at]) = (told[sample.at], sample.difference(), sample.variance);
        }
        let is_dense = samples.stride == 1 && reference.is_dense() && edge.contains(&Some(false));
        let width = samples.size[0] as usize;
        let band = if is_dense { bands(&errors, &variances, &surfaces(&edge, width), width) } else { vec![None; pixels] };
        Self { edge, band }
    }

    /// The share of edges among the pixels of which it is told; None where it is told of none.
    pub fn edge_share(&self) -> Option<f64> {
        let [edges, all] = self.edge.iter().flatten().fold([0.0, 0.0], |[edges, all], edge| [edges + f64::from(u8::from(*edge)), all + 1.0]);
        (all > 0.0).then(|| edges / all)
    }

    /// The square of an error at an edge, or inside a surface; None elsewhere.
    pub fn square(&self, sample: &Sample, is_edge: bool) -> Option<Square> {
        let square = || Square { value: sample.difference().powi(2) - sample.variance, spread: 2.0 * sample.variance.powi(2) };
        (self.edge[sample.at] == Some(is_edge)).then(square)
    }

    /// The square of an error in the band; the noise that neighbours share makes its mean less certain.
    pub fn square_in_band(&self, sample: &Sample) -> Option<Square> {
        let square = |band: Band| Square { value: band.error.powi(2) - band.noise, spread: 2.0 * band.noise.powi(2) * noise_area() };
        self.band[sample.at].map(square)
    }
}

/// Of each pixel of the reference; None where no picture tells it.
fn edges(test: &Layers, reference: &Layers, stride: u32) -> Option<Vec<Option<bool>>> {
    let own = if stride == 1 { geometry(reference) } else { None };
    if let Some(own) = own {
        return Some(own.edges());
    }
    let edges = geometry(test)?.edges();
    let places = |length: u32| (stride / 2..length).step_by(stride as usize);
    Some(places(test.height).flat_map(|y| places(test.width).map(move |x| y * test.width + x)).map(|at| edges[at as usize]).collect())
}

/// None of a picture whose neighbours are not neighbours.
fn geometry(picture: &Layers) -> Option<Geometry<'_>> {
    if picture.is_dense() { Geometry::of(picture) } else { None }
}
