//! What is rendered: loading, the model, its acceleration structure and what it requires of a pipeline.

pub mod animation;
#[doc(hidden)]
pub mod atlas;
#[doc(hidden)]
pub mod bvh;
mod clusters;
#[doc(hidden)]
pub mod emitters;
pub mod load;
mod mipmaps;
pub mod model;
pub mod needs;
#[doc(hidden)]
pub mod packets;
#[doc(hidden)]
pub mod parts;
#[doc(hidden)]
pub mod shadow_maps;
#[doc(hidden)]
pub mod shape;
mod simplify;
#[doc(hidden)]
pub mod sky;
#[doc(hidden)]
pub mod sources;
pub mod stage;
#[doc(hidden)]
pub mod surface;
mod wide;

pub use model::*;
pub use shape::Corners;
pub use simplify::Simplified;
