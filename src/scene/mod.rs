//! What is rendered: loading, the model, its acceleration structure and what it requires of a pipeline.

pub mod bvh;
mod clusters;
pub mod emitters;
pub mod load;
mod mipmaps;
pub mod model;
pub mod needs;
pub mod packets;
pub mod parts;
pub mod shadow_maps;
pub mod sky;
pub mod sources;
pub mod stage;
pub mod surface;
mod wide;

pub use model::*;
