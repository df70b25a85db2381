//! Global illumination on the GPU by caching irradiance; every method is a pipeline of passes, wired in RON.

pub mod cli;
pub mod contract;
pub mod gpu;
pub mod math;
pub mod measure;
pub mod pipeline;
pub mod reference;
pub mod scene;
pub mod schedule;

#[path = "../passes/mod.rs"]
pub mod passes;
