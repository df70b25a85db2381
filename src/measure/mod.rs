//! What came out, and how good it is: layered pictures, the curve that shows them, and the errors against a reference.

pub mod average;
pub mod bands;
mod blocks;
pub mod cache;
pub mod compare;
pub mod criteria;
pub mod edges;
pub mod expectation;
pub mod exposure;
pub mod flip;
pub mod front;
pub mod gap;
mod labels;
pub mod layers;
pub mod metrics;
pub mod page;
pub mod plot;
pub mod projection;
pub mod run;
#[cfg(not(target_arch = "wasm32"))]
pub mod stability;
pub mod statistics;
pub mod study;
pub mod survey;
pub mod sweep;
pub mod told;
pub mod tone;
pub mod traffic;

pub use layers::{DIRECT, GLOSSY, IRRADIANCE, Layer, Layers, MAX_SAMPLES, PICTURE, PictureError, WINDOWS};
pub use metrics::{ErrorDifference, Errors, Interval, LargestError, MetricsError, Selected, compare, compare_layers};
