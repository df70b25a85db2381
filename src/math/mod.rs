//! Mathematics of hemispheres and records: plain Rust, no other module's use.
pub mod hemisphere;
