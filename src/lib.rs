//! Global illumination on the GPU by caching irradiance; every method is a pipeline of passes, wired in RON.
//!
//! [`Engine`] is the way in for other programs: `examples/embed` and `examples/own_pass` show it at work. What this documentation hides is for the program
//! `hemisplat` and its tests, and changes without notice.

#![warn(missing_docs)]
#![allow(rustdoc::broken_intra_doc_links, reason = "units stand in brackets")]

#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
pub mod contract;
pub mod engine;
pub mod gpu;
#[doc(hidden)]
pub mod math;
pub mod measure;
pub mod pipeline;
#[doc(hidden)]
pub mod reference;
pub mod scene;
#[doc(hidden)]
pub mod schedule;

#[doc(hidden)]
#[path = "../passes/mod.rs"]
pub mod passes;

pub use engine::{ChangeError, Engine, Renewed};
#[cfg(not(target_arch = "wasm32"))]
pub use gpu::block_on;
pub use gpu::{GpuError, Pace};
pub use measure::run::{FrameReport, Run, RunError};
pub use pipeline::{Pipeline, Plan, Problems};
pub use scene::{
    Camera, Scene,
    stage::{Change, Stage, Unchangeable},
};

/// Its types are part of the interface: a program that lends its device has to have them from here, or the same version.
pub use wgpu;
