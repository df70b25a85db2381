//! What came out, and how good it is: layered pictures, the curve that shows them, and the errors against a reference.

#[doc(hidden)]
pub mod average;
#[doc(hidden)]
pub mod bands;
mod blocks;
#[doc(hidden)]
pub mod cache;
#[doc(hidden)]
pub mod compare;
#[doc(hidden)]
pub mod course;
#[doc(hidden)]
pub mod criteria;
#[doc(hidden)]
pub mod edges;
#[doc(hidden)]
pub mod expectation;
#[doc(hidden)]
pub mod exposure;
#[doc(hidden)]
pub mod flip;
#[doc(hidden)]
pub mod front;
#[doc(hidden)]
pub mod gap;
mod labels;
pub mod layers;
#[doc(hidden)]
pub mod metrics;
#[doc(hidden)]
pub mod page;
#[doc(hidden)]
pub mod plot;
#[doc(hidden)]
pub mod projection;
pub mod run;
#[cfg(not(target_arch = "wasm32"))]
#[doc(hidden)]
pub mod stability;
#[doc(hidden)]
pub mod statistics;
#[doc(hidden)]
pub mod study;
#[doc(hidden)]
pub mod survey;
#[doc(hidden)]
pub mod sweep;
#[doc(hidden)]
pub mod told;
#[doc(hidden)]
pub mod tone;
#[doc(hidden)]
pub mod traffic;

pub use layers::{DIRECT, GLOSSY, IRRADIANCE, Layer, Layers, MAX_SAMPLES, PICTURE, PictureError, WINDOWS};
pub use metrics::{ErrorDifference, Errors, Interval, LargestError, MetricsError, Selected, compare, compare_layers};
