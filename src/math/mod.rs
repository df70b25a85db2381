//! The mathematics that shaders, passes and tests share: hemispheres and their sums, records and their weights,
//! colours, frames, bounds on the screen, expansions in harmonics, glossy lobes. No device, no files, no other module of the crate.

pub mod beside;
pub mod bounces;
pub mod choice;
pub mod colour;
pub mod curve;
mod eight_records;
pub mod frame;
pub mod harmonics;
pub mod hemisphere;
pub mod lattice;
pub mod life;
pub mod lobe;
pub mod morton;
#[cfg(test)]
mod oracle;
pub mod outline;
pub mod pixel_filter;
pub mod projection;
pub mod radiance;
pub mod radius;
pub mod random;
pub mod record_filter;
pub mod record_index;
pub mod record_tree;
pub mod solid_angle;
pub mod spherical_triangle;
pub mod sum;
pub mod sum_vectors;
pub mod thinning;
pub mod uncertainty;
pub mod vectors;
pub mod walk;
pub mod weight;
pub mod windows;
